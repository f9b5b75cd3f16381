"""The path check: where and when a path of the 3-RPS meets a singularity or leaves a limit.

Everything that can go wrong is a *signal*: a function of the pose that is zero where it happens,
with its exact rate along the path (`rps_pin.rps.singularity.path_signals`).

Its zeros and turning points between samples are bracketed by `rps_pin.task.paths.findings`, which
relies on this: **between two samples, no signal turns more than once.** The samples are as dense
as asked for: neighbours are apart by at most ``duration / least_steps`` in time, and by `max_step`
in z / h and in the tilts, as far as the rates at both ends tell. Accelerations may jump.
"""

from __future__ import annotations

from typing import Protocol

from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.singularity.path_signals import PathSignals
from rps_pin.task.paths.events import PathCheck
from rps_pin.task.paths.findings import GRAZE, check_signals, sample_times
from rps_pin.trajectories.path import Trajectory
from rps_pin.validation import positive_number, whole_number

__all__ = ["PathCheck", "check_path"]


class _HasParameters(Protocol):
    @property
    def parameters(self) -> RPSParameters: ...


@refuses_other_kinds
def check_path(
    robot: _HasParameters,
    trajectory: Trajectory,
    *,
    tolerance: float | None = None,
    threshold: float = GRAZE,
    least_steps: int = 1000,
    max_step: float = 0.01,
) -> PathCheck:
    """Return where and when a path meets a singularity, grazes one, or leaves a limit.

    Parameters
    ----------
    robot
        The 3-RPS, for its geometry and limits.
    trajectory
        The path; its rates must be the derivatives of its poses. Accelerations are not used.
    tolerance
        Widest bracket of an event, s; 1e-10 of the path's duration if left out. Two crossings less
        than this apart count as a graze.
    threshold
        A smallest distance below this is a graze. Distances are those of `SingularityMeasures`: of
        type II, the legs' speed over the platform's; 1e-3 means that the actuators feel a
        thousandth of what the platform does, and push a thousandfold.
    least_steps, max_step
        How dense the path is sampled: at least so many steps, each of at most so much of z / h and
        of the tilts (rad). See the module's text for what that guarantees.

    Raises
    ------
    InputError
        If a number is out of its range, the trajectory's samples are not finite poses and rates of
        the right shapes, or it is tilted by a whole turn.
    """
    threshold = positive_number(threshold, "threshold")
    path = PathSignals(robot.parameters, trajectory, tolerance)
    steps = whole_number(least_steps, "least_steps")
    times = sample_times(path, steps, positive_number(max_step, "max_step"))
    return check_signals(path, times, threshold)
