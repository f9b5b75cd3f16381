"""The shortest time along a curve that a robot's actuators allow.

With forces F = m u'' + c u'^2 + g + friction, and speeds d u' (see
`rps_pin.task.motion.curve_dynamics`), limits of forces and speeds are linear in u'' and u'^2, and
the shortest time is a convex program (see `fastest_profile`), which is solved repeatedly (see
`time_search`).

A motion is returned only if `RPSRobot.actuator_forces` and the legs' speeds keep the limits to
`KEPT`, within the pieces of its time law and at some 20,000 times.
"""

from __future__ import annotations

import math
from functools import partial

from numpy.typing import ArrayLike

from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.dynamics.loads import checked_wrench
from rps_pin.rps.motion.curve_dynamics import CurveDynamics
from rps_pin.rps.motion.curve_refusal import ends_at_rest, infeasible, require_clear_curve
from rps_pin.rps.motion.limited_motion import LimitedMotion
from rps_pin.rps.robot import RPSRobot
from rps_pin.task.motion.curves import curve_of
from rps_pin.task.motion.time_search import INTERVALS, KEPT, Progress, TimeSearch
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits
from rps_pin.trajectories.curve import Curve
from rps_pin.trajectories.path import Trajectory
from rps_pin.validation import whole_number

__all__ = ["INTERVALS", "KEPT", "time_optimal"]


@refuses_other_kinds
def time_optimal(
    robot: RPSRobot,
    path: Curve | Trajectory,
    *,
    limits: ActuatorLimits | None = None,
    wrench: ArrayLike | None = None,
    intervals: int = INTERVALS,
    progress: Progress = iter,
) -> LimitedMotion:
    """Return the motion of the shortest time along a path, from rest to rest.

    Parameters
    ----------
    robot
        The 3-RPS, with its payload and friction.
    path
        A curve; or what has one (`TimedCurve`, `HelixPath`: their time laws are not used); or a
        trajectory, which is taken as a curve in its own time. A curve whose second derivative jumps
        should have the parameters where it does in an attribute ``knots``: otherwise the time found
        can be a per cent too long.
    limits
        Of the actuators' forces and speeds, and of the legs' lengths; the robot's if left out.
    wrench
        Constant external wrench on the platform: force (N) in base axes and moment (N m) about the
        platform's centre, shape (6,).
    intervals
        Pieces of the speed profile at first, 8 or more. Those where it matters are divided.
    progress
        Wraps the loop over the rounds, for a progress bar; few of the rounds are used.

    Returns
    -------
    LimitedMotion
        A `TimedCurve` with its use of the limits, which are kept to `KEPT`.

    Raises
    ------
    InputError
        If there is no shortest time (no limit of force), a limit of power is given, the path is not
        a path, or its first and second derivatives are zero at some point.
    UnreachableError, SingularityError
        If the curve leaves the workspace, or meets a singularity; says at which u.
    InfeasibleError
        If no time law keeps the limits; says where, which actuator, and by how much.
    RPSPinError
        If no motion is found that keeps the limits to `KEPT`, or friction does not converge.
    """
    bounds = _checked_limits(ActuatorLimits.of(robot.parameters) if limits is None else limits)
    whole_number(intervals, "intervals", least=8)
    curve = curve_of(path)
    load = None if wrench is None else checked_wrench(wrench, ())
    rest = ends_at_rest(robot, curve)
    require_clear_curve(robot, curve, bounds)
    dynamics = CurveDynamics(robot, curve, bounds, load)
    search = TimeSearch(dynamics, rest, int(intervals), partial(infeasible, dynamics))
    return LimitedMotion(dynamics, search.run(progress))


# What is given ------------------------------------------------------------------------------------


def _checked_limits(limits: ActuatorLimits) -> ActuatorLimits:
    if not isinstance(limits, ActuatorLimits):
        raise InputError(f"limits = {shown(limits)}: they must be ActuatorLimits")
    if math.isfinite(limits.power):
        raise InputError(
            f"power limit = {limits.power:.6g} W: a motion can be scaled to limits of force and "
            "speed, not of power"
        )
    if math.isinf(limits.force):
        raise InputError(
            "the actuators have no limit of force: without one, any time can be made shorter. Give "
            "limits=ActuatorLimits(force=...), or a robot with an actuator_force_limit"
        )
    return limits
