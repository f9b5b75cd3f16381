"""The shortest time along a curve of a task's coordinates.

Limits of forces, accelerations and speeds are linear in u'' and u'^2 (see `curve_dynamics`), and
the shortest time is a convex program (see `fastest_profile`), which is solved repeatedly (see
`time_search`). With limits of jerk the program is not convex: a local optimum is found from that
motion (see `jerk.jerk_search`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.errors import InputError, MechanismError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.loads import Loads, Payload
from rps_pin.task.motion.curves import curve_of, ends_at_rest, refuse_infinite_jerk
from rps_pin.task.motion.jerk.jerk_search import JerkSearch
from rps_pin.task.motion.limited_motion import LimitedMotion
from rps_pin.task.motion.limits import MotionLimits
from rps_pin.task.motion.task_dynamics import TaskDynamics
from rps_pin.task.motion.time_search import INTERVALS, KEPT, Progress, TimeSearch
from rps_pin.task.task import Task
from rps_pin.trajectories.curve import Curve
from rps_pin.trajectories.path import Trajectory
from rps_pin.validation import real_array, whole_number

__all__ = ["KEPT", "time_optimal"]


@refuses_other_kinds
def time_optimal(
    task: Task,
    path: Curve | Trajectory,
    *,
    limits: MotionLimits | None = None,
    payload: Payload | None = None,
    wrench: ArrayLike | None = None,
    near: ArrayLike | None = None,
    intervals: int = INTERVALS,
    progress: Progress = iter,
) -> LimitedMotion:
    """Return the motion of the shortest time along a path of a task, from rest to rest.

    Parameters
    ----------
    task
        The task; a compiled one (`Task.compile`) is done in a fraction of the time.
    path
        A curve of the task's coordinates; or what has one (`TimedCurve`: its time law is not used);
        or a trajectory, which is taken as a curve in its own time. A curve whose second derivative
        jumps should have the parameters where it does in an attribute ``knots``: otherwise the time
        found can be a per cent too long.
    limits
        Of forces, speeds, accelerations and jerks; the forces and speeds of the model if left out.
        With more actuators than coordinates, forces are those of least norm. With limits of jerk,
        the motion begins and ends with zero acceleration, and the time is a local optimum: no small
        change of the time law makes it shorter, by more than some tenths of a per mille to a per
        mille, which is the width of its pieces.
    payload
        Fixed to the output frame: see `Loads`. Of a compiled task, the mechanism with it is
        compiled too.
    wrench
        Constant wrench that the surroundings exert on the output frame: force (N) and moment (N m)
        about its origin, in world axes, shape (6,).
    near
        Closed configuration whose assembly mode the path begins in, shape (nq,); home if left out.
    intervals
        Pieces of the speed profile at first, 8 or more. Those where it matters are divided.
    progress
        Wraps the loop over the rounds, for a progress bar; few of the rounds are used.

    Returns
    -------
    LimitedMotion
        A `TimedCurve` with its use of the limits, which are kept to `KEPT` of each, at places
        within the pieces of its time law and at some thousands of times. Its
        `without_jerk_limits` is the shortest time without limits of jerk.

    Raises
    ------
    InputError
        If there is no shortest time (no limit of force, acceleration or jerk), the path is not a
        path, or its first and second derivatives are zero at some point. With a limit of jerk, also
        if the curve has no tangent at an end, or its second derivative jumps.
    MechanismError
        If there are fewer actuators than coordinates; if a task of joints is to carry a load.
    ClosureError, SingularityError
        If the path cannot be followed, or meets a singularity; says at which u.
    InfeasibleError
        If no time law keeps the limits; says where, which actuator, and by how much.
    RPSPinError
        If no motion is found that keeps the limits to `KEPT`, or friction does not converge.
    """
    if limits is not None and not isinstance(limits, MotionLimits):
        raise InputError(f"limits = {shown(limits)}: they must be MotionLimits")
    bounds = (limits or MotionLimits()).of(task)
    whole_number(intervals, "intervals", least=8)
    curve = curve_of(path)
    _refuse_other_coordinates(task, curve)
    count = task.mechanism.actuated_indices.size
    if count < task.size:
        raise MechanismError(f"{count} actuators do not move {task.size} coordinates as asked")
    load = None if wrench is None else real_array(wrench, "wrench", (6,))
    if load is not None and load.shape != (6,):
        raise InputError(f"wrench has shape {load.shape}; it must be (6,): constant")
    loads = Loads(task, payload, load)
    rest = ends_at_rest(curve, task.scale)
    if bounds.jerks.size:
        refuse_infinite_jerk(curve, task.scale, rest)
    if payload is not None:
        carrying = task.with_mechanism(loads.mechanism)
        task = carrying.compile() if task.is_compiled else carrying
    dynamics = TaskDynamics(task, curve, bounds, loads.wrench, near)
    free = None
    if np.isfinite(bounds.levels).any():
        other = dynamics.without_jerk_limits()
        search = TimeSearch(other, rest, int(intervals), other.infeasible)
        free = search.run(progress)
    if free is not None and not bounds.jerks.size:
        return LimitedMotion(dynamics, free)
    return LimitedMotion(dynamics, JerkSearch(dynamics, free, int(intervals)).run(progress), free)


def _refuse_other_coordinates(task: Task, curve: Curve) -> None:
    shape = np.shape(curve.at(0.0).pose)
    if shape != (task.size,):
        raise InputError(
            f"poses of the path have shape {shape}; the task has {task.size} coordinates: "
            f"{', '.join(task.coordinates)}"
        )
