"""Errors of curves that cannot be scaled in time: raised before anything is solved, say where."""

from __future__ import annotations

import math

import numpy as np

from rps_pin.errors import InfeasibleError, InputError, LimitExcess, ParameterError
from rps_pin.rps.motion.curve_dynamics import CurveDynamics
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity.path_refusal import PathWords, require_clear
from rps_pin.task.motion import curves
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits
from rps_pin.trajectories.curve import Curve

#: Width of the brackets of `check_path`, over the curve's length.
_BRACKET = 1e-9


def ends_at_rest(robot: RPSRobot, curve: Curve) -> tuple[bool, bool]:
    """Return at which ends the rate u' must be zero; see `rps_pin.task.motion.curves`."""
    size = np.array([1 / robot.parameters.platform_radius, 1.0, 1.0])
    return curves.ends_at_rest(curve, size)


def require_clear_curve(robot: RPSRobot, curve: Curve, limits: ActuatorLimits) -> None:
    """Refuse a curve that leaves the workspace, or meets a singularity.

    Parameters
    ----------
    limits
        Those of length count beside the robot's.

    Raises
    ------
    UnreachableError, SingularityError
        Says at which u, and why.
    """
    parameters, asked = robot.parameters, limits.length
    own = parameters.leg_length_limits
    both = max(own[0], asked[0]), min(own[1], asked[1])
    if both != own:
        try:
            robot = RPSRobot(parameters.replace(leg_length_limits=both))
        except ParameterError:
            raise InputError(
                f"length limits = {asked}: the robot's legs have {own} m, and no length is within "
                "both"
            ) from None
    words = PathWords("curve", "u", "", 9)
    require_clear(robot, curves.AsTrajectory(curve), tolerance=_BRACKET * curve.length, words=words)


def infeasible(dynamics: CurveDynamics) -> InfeasibleError:
    """Return the error of a curve without a time law: the forces at rest exceed their limit.

    If holding is possible at every point, so is a motion that is slow enough, also with friction.
    """
    limit = dynamics.limits.force
    u = np.linspace(0.0, dynamics.curve.length, curves.POINTS)
    holding = dynamics.terms(u).holding
    place, leg = np.unravel_index(int(np.abs(holding).argmax()), holding.shape)
    force, actuator = float(holding[place, leg]), f"actuator {leg + 1}"
    z, tilt_x, tilt_y = dynamics.curve.at(u[place]).pose
    where = (
        f"at u = {u[place]:.6g} of {dynamics.curve.length:.6g} (z = {z:.6g} m, tilt = "
        f"({tilt_x:.6g}, {tilt_y:.6g}) rad)"
    )
    if abs(force) <= limit:
        return InfeasibleError(
            f"no time law was found that keeps forces of {limit:.6g} N, although holding "
            f"takes at most {abs(force):.6g} N, of {actuator} {where}"
        )
    return InfeasibleError(
        f"no time law keeps the actuators' limits from rest to rest: {where}, {actuator} needs "
        f"{force:.6g} N to hold still, and its limit is {limit:.6g} N",
        [LimitExcess(actuator, force, math.copysign(limit, force), "N")],
    )
