"""`RPSRobot.actuator_forces`: whole trajectories block by block, and what is refused.

The equations are in `force_equations`; here samples are cut into blocks that stay in the
processor's cache. Each block is screened for legs beyond their limits and for singular poses by
comparisons that cost little; what a screen finds is then judged exactly, by the rules of
`RPSRobot.inverse_kinematics` and `ClosedLoopModel.inverse_dynamics`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, SingularityError, UnreachableError
from rps_pin.rps.dynamics.force_equations import BlockState, ForceTerms, block_state, solved_forces
from rps_pin.rps.dynamics.loads import checked_wrench
from rps_pin.rps.kernels import legs, tips
from rps_pin.rps.kernels.limits import LIMIT_TOLERANCE
from rps_pin.rps.kinematics.pose import checked_motion
from rps_pin.rps.kinematics.rates import Errors, check_errors_option, masked_leg_jacobians
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.singularity.measures import passive_conditioning

if TYPE_CHECKING:
    from rps_pin.rps.robot import RPSRobot

#: Samples worked on at a time: few enough for their arrays to stay in the processor's cache.
BLOCK = 4096


def actuator_forces(
    robot: RPSRobot,
    pose: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike,
    *,
    wrench: ArrayLike | None = None,
    errors: Errors = "raise",
) -> Array:
    """Return the actuator forces of samples; see `RPSRobot.actuator_forces`."""
    check_errors_option(errors)
    x, dx, ddx = checked_motion(pose, rate, acceleration)
    on_platform = None if wrench is None else checked_wrench(wrench, x.shape[:-1])
    force, suspect = forces_of(robot.force_terms, (x, dx, ddx), on_platform, robot.parameters)
    refused = np.zeros(suspect.shape, dtype=bool)
    if suspect.any():
        refused[suspect] = _refused(robot, x[suspect])
        if errors == "raise" and refused.any():
            _refuse(robot, x, refused)
    force[refused] = 0.0
    _refuse_overflow(force)
    if errors == "raise":
        return force
    return np.ma.MaskedArray(force, np.repeat(refused[..., None], 3, axis=-1))


def forces_of(
    terms: ForceTerms,
    motion: tuple[Array, Array, Array],
    wrench: Array | None,
    limits: RPSParameters | None = None,
) -> tuple[Array, Bools]:
    """Return what chosen terms contribute to the actuator forces, and what must be judged.

    Parameters
    ----------
    terms
        What takes part.
    motion
        Checked pose, rate and acceleration of one shape (..., 3).
    wrench
        On the platform, shape (..., 6), or none.
    limits
        The robot whose limits the legs shall keep; none if left out.

    Returns
    -------
    force
        Shape (..., 3), N; of no meaning at a singularity.
    suspect
        Which samples may be singular or beyond a limit, shape (...).
    """
    x = motion[0]
    force = np.empty(x.shape)
    suspect = np.empty(x.shape[:-1], dtype=bool)
    flat, flat_suspect = force.reshape(-1, 3), suspect.reshape(-1)
    motions = [a.reshape(-1, 3) for a in motion]
    given = None if wrench is None else wrench.reshape(-1, 6)
    # Where a leg has no length, or K no inverse, the numbers mean nothing and are not used.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for begin in range(0, len(flat), BLOCK):
            part = slice(begin, begin + BLOCK)
            z, dz, ddz = (np.ascontiguousarray(a[part].T) for a in motions)
            w = None if given is None else np.ascontiguousarray(given[part].T)
            state = block_state(terms, z, dz, ddz, w)
            solved, close = solved_forces(terms, z, state)
            flat[part] = solved.T
            flat_suspect[part] = close
            if limits is not None:
                flat_suspect[part] |= _beyond_limits(limits, z[1], z[2], state)
    return force, suspect


# What is refused ----------------------------------------------------------------------------------


def _beyond_limits(p: RPSParameters, x: Array, y: Array, state: BlockState) -> Bools | bool:
    """Return which samples of a block may break a limit of the legs, shape (n,)."""
    beyond: Bools | bool = False
    low, high = p.leg_length_limits
    if low > 0 or math.isfinite(high):
        length = state.length
        beyond = (length.min(axis=0) < low + LIMIT_TOLERANCE) | (
            length.max(axis=0) > high - LIMIT_TOLERANCE
        )
    low, high = p.leg_angle_limits
    half = (high - low) / 2
    if half < math.pi:
        middle = (low + high) / 2
        # cos(phi - middle) >= cos(half)
        inside = math.cos(middle) * state.cosine + math.sin(middle) * state.sine
        beyond = beyond | (inside.min(axis=0) < math.cos(half) + LIMIT_TOLERANCE)
    if p.spherical_cone_limit < math.pi:
        cosine = _cone_cosines(p, x, y, state).min(axis=0)
        beyond = beyond | (cosine < math.cos(p.spherical_cone_limit) + LIMIT_TOLERANCE)
    return beyond


def _cone_cosines(p: RPSParameters, x: Array, y: Array, state: BlockState) -> Array:
    """Return the cosine of the angle between each leg and its joint's rest axis, shape (3, n)."""
    rest = math.cos(p.spherical_rest_angle), math.sin(p.spherical_rest_angle)
    e, t = tips.at_legs((0.0, x, y)), tips.at_legs((0.0, y, -x))
    out, _, up = legs.rest_axis(e, t, state.tilt, *rest)
    cosine: Array = legs.cone_cosine(state.cosine, state.sine, out, up)
    return cosine


def _refused(robot: RPSRobot, pose: Array) -> Bools:
    """Return which poses (n, 3) are refused: out of reach or singular."""
    refused = np.asarray(masked_leg_jacobians(robot.parameters, pose)[1].any(axis=-1))
    with_legs = np.flatnonzero(~refused)
    reachable = robot.inverse_kinematics(pose[with_legs], errors="mask").reachable
    regular = passive_conditioning(robot.parameters, pose[with_legs]) >= 1 / _limit(robot)
    refused[with_legs] = np.logical_not(reachable & regular)
    return refused


def _refuse(robot: RPSRobot, pose: Array, refused: Bools) -> None:
    """Raise the error of the first sample that is refused."""
    first = tuple(int(i) for i in np.argwhere(refused)[0])
    which = f"sample {first[0] if len(first) == 1 else first} of {refused.size}: " if first else ""
    try:
        robot.inverse_kinematics(pose[first])
    except UnreachableError as error:
        raise UnreachableError(f"{which}{error}", error.violations) from None
    distance = float(passive_conditioning(robot.parameters, pose[first]))
    condition = 1 / distance if distance > 0 else math.inf
    z, tilt_x, tilt_y = pose[first]
    raise SingularityError(
        f"{which}pose z = {z:.6g} m, tilt = ({tilt_x:.6g}, {tilt_y:.6g}) rad is singular: the "
        f"condition number of the passive joints' Jacobian is {condition:.3g}, and at most "
        f"{_limit(robot):.3g} is accepted",
        condition,
        _limit(robot),
    )


def _refuse_overflow(force: Array) -> None:
    if not np.isfinite(force).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(force))[0])
        raise InputError(
            f"the force of leg {first[-1] + 1}{f' at sample {first[:-1]}' if first[:-1] else ''} "
            "is beyond what a number can hold: rate, acceleration or wrench are too large"
        )


def _limit(robot: RPSRobot) -> float:
    limit: float = robot.mechanism.max_condition
    return limit
