"""Actuator forces of whole trajectories, block by block, and which samples are refused.

The equations are in `force_equations`; here samples are cut into blocks that stay in the
processor's cache. Each block is screened for legs beyond their limits and for singular poses by
comparisons that cost little; the samples found are then checked exactly, by the rules of
`RPSRobot.inverse_kinematics` and `ClosedLoopModel.inverse_dynamics`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, SingularityError, UnreachableError
from rps_pin.rps.dynamics.force_equations import (
    ForceTerms,
    LegBlock,
    forces_of_motion,
    leg_block,
    may_be_singular,
)
from rps_pin.rps.dynamics.loads import checked_wrench
from rps_pin.rps.kernels import legs, tips
from rps_pin.rps.kernels import limits as margins
from rps_pin.rps.kinematics.inverse_kinematics import inverse_kinematics
from rps_pin.rps.kinematics.legs import (
    ANY_ANGLE,
    PoseLegs,
    cosine_of_cone,
    cosine_of_half,
    legs_of_pose,
)
from rps_pin.rps.kinematics.pose import checked_motion
from rps_pin.rps.kinematics.samples import Errors, check_errors_option, refuse
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.singularity.measures import passive_conditioning

#: Samples worked on at a time: few enough for their arrays to stay in the processor's cache.
BLOCK = 4096


class ForceShare(NamedTuple):
    """Part of the actuator forces: terms, how the pose moves, and what acts on the platform."""

    terms: ForceTerms
    rate: Array
    """Shape (..., 3)."""
    acceleration: Array
    """Shape (..., 3)."""
    wrench: Array | None
    """Shape (..., 6), or none."""


def actuator_forces(
    parameters: RPSParameters,
    terms: ForceTerms,
    max_condition: float,
    motion: tuple[ArrayLike, ArrayLike, ArrayLike],
    *,
    wrench: ArrayLike | None = None,
    errors: Errors = "raise",
) -> Array:
    """Return the actuator forces of samples; see `RPSRobot.actuator_forces`."""
    check_errors_option(errors)
    x, dx, ddx = checked_motion(*motion)
    load = None if wrench is None else checked_wrench(wrench, x.shape[:-1])
    (force,), suspect = forces_of([ForceShare(terms, dx, ddx, load)], x, parameters)
    refused = np.zeros(suspect.shape, dtype=bool)
    if suspect.any():
        refused[suspect] = _refused(parameters, x[suspect], max_condition)
        if errors == "raise":
            _refuse(parameters, x, refused, max_condition)
        force[refused] = 0.0
    _refuse_overflow(force)
    if errors == "raise":
        return force
    return np.ma.MaskedArray(force, np.repeat(refused[..., None], 3, axis=-1))


def forces_of(
    shares: Sequence[ForceShare],
    pose: Array,
    limits: RPSParameters | None = None,
    known: PoseLegs | None = None,
) -> tuple[list[Array], Bools]:
    """Return parts of the actuator forces of poses, and which poses must be looked at closely.

    Parameters
    ----------
    shares
        The parts, of one robot: the legs of a pose are computed once.
    pose
        Checked poses, shape (..., 3).
    limits
        The robot whose limits the legs shall keep; none if left out.
    known
        The legs of the poses; computed block by block if left out.

    Returns
    -------
    forces
        Shape (..., 3) each, N; meaningless at a singularity.
    suspect
        Which samples may be singular or beyond a limit, shape (...).
    """
    found = [np.empty(pose.shape) for _ in shares]
    suspect = np.empty(pose.shape[:-1], dtype=bool)
    flat_suspect = suspect.reshape(-1)
    g, h = shares[0].terms.base_radius, shares[0].terms.platform_radius
    # Where a leg has no length, or K no inverse, the numbers mean nothing and are not used.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for begin in range(0, len(flat_suspect), BLOCK):
            part = slice(begin, begin + BLOCK)
            of_poses = known.part(part) if known else legs_of_pose(_components(pose, part).T, g, h)
            block = leg_block(of_poses)
            flat_suspect[part] = may_be_singular(block, h)
            if limits is not None:
                flat_suspect[part] |= _beyond_limits(limits, block)
            for share, force in zip(shares, found, strict=True):
                rate, acceleration = (_components(a, part) for a in share[1:3])
                load = None if share.wrench is None else _components(share.wrench, part)
                solved = forces_of_motion(share.terms, block, rate, acceleration, load).axial
                force.reshape(-1, 3)[part] = solved.T
    return found, suspect


def _components(array: Array, part: slice) -> Array:
    """Return the components of samples, shape (k, n), contiguous."""
    return np.ascontiguousarray(array.reshape(-1, array.shape[-1])[part].T)


# What is refused ----------------------------------------------------------------------------------


def _beyond_limits(p: RPSParameters, block: LegBlock) -> Bools | bool:
    """Return which samples of a block may break a limit of the legs, shape (n,)."""
    beyond: Bools | bool = False
    low, high = p.leg_length_limits
    if low > 0 or math.isfinite(high):
        beyond = margins.length_margin(block.length, low, high) < 0.0
    low, high = p.leg_angle_limits
    half = cosine_of_half(low, high)
    if half != ANY_ANGLE:
        middle = math.cos((low + high) / 2), math.sin((low + high) / 2)
        beyond = beyond | (margins.angle_margin(block.cosine, block.sine, middle, half) < 0.0)
    if p.spherical_cone_limit < math.pi:
        limit = cosine_of_cone(p.spherical_cone_limit)
        beyond = beyond | (margins.cone_margin(_cone_cosines(p, block), limit) < 0.0)
    return beyond


def _cone_cosines(p: RPSParameters, block: LegBlock) -> Array:
    """Return the cosine of the angle between each leg and its joint's rest axis, shape (3, n)."""
    rest = math.cos(p.spherical_rest_angle), math.sin(p.spherical_rest_angle)
    e, t = tips.at_legs((0.0, block.x, block.y)), tips.at_legs((0.0, block.y, -block.x))
    out, _, up = legs.rest_axis(e, t, block.tilt, *rest)
    cosine: Array = legs.cone_cosine(block.cosine, block.sine, out, up)
    return cosine


def _refused(parameters: RPSParameters, pose: Array, max_condition: float) -> Bools:
    """Return which poses (n, 3) are refused: out of reach or singular."""
    refused = ~inverse_kinematics(parameters, pose, errors="mask").reachable
    within = np.flatnonzero(~refused)
    refused[within] = ~(passive_conditioning(parameters, pose[within]) >= 1 / max_condition)
    return refused


def _refuse(parameters: RPSParameters, pose: Array, refused: Bools, max_condition: float) -> None:
    """Raise the error of the first sample that is refused."""

    def error(first: tuple[int, ...], _: str) -> UnreachableError | SingularityError:
        which = (
            f"sample {first[0] if len(first) == 1 else first} of {refused.size}: " if first else ""
        )
        try:
            inverse_kinematics(parameters, pose[first])
        except UnreachableError as out:
            return UnreachableError(f"{which}{out}", out.violations)
        distance = float(passive_conditioning(parameters, pose[first]))
        condition = 1 / distance if distance > 0 else math.inf
        z, tilt_x, tilt_y = pose[first]
        return SingularityError(
            f"{which}pose z = {z:.6g} m, tilt = ({tilt_x:.6g}, {tilt_y:.6g}) rad is singular: the "
            f"condition number of the passive joints' Jacobian is {condition:.3g}, and at most "
            f"{max_condition:.3g} is accepted",
            condition,
            max_condition,
        )

    refuse(refused, error)


def _refuse_overflow(force: Array) -> None:
    if not np.isfinite(force).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(force))[0])
        raise InputError(
            f"the force of leg {first[-1] + 1}{f' at sample {first[:-1]}' if first[:-1] else ''} "
            "is beyond what a number can hold: rate, acceleration or wrench are too large"
        )
