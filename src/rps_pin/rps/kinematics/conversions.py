"""Conversions of poses: the paper's angles, and the centre with its parasitic motion.

Section 2.1 of the paper describes the platform by p_z, p_x, p_y and the Z-Y-Z angles alpha, beta,
gamma. With w the rotation vector of the pose, h the platform's radius, and u and v the first two
columns of the rotation R = Rz(alpha) Ry(beta) Rz(gamma),

    gamma = -alpha,                            w = beta (-sin(alpha), cos(alpha), 0),
    p_x = -h/2 (1 - cos(beta)) cos(2 alpha),   p_y = h/2 (1 - cos(beta)) sin(2 alpha),

This is Eq. 5 with p_x and p_y told apart as Eq. 4 demands (as printed they are swapped).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rps_pin.arrays import Array
from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kinematics import pose as poses
from rps_pin.rps.kinematics.pose import checked_motion, checked_pose, platform_motion
from rps_pin.rps.kinematics.samples import Errors, maskable
from rps_pin.rps.kinematics.three_quantities import poses_from
from rps_pin.validation import one_shape, positive_number, real_array


class PaperAngles(NamedTuple):
    """The paper's height and Z-Y-Z angles, shape (...) each."""

    z: Array
    """p_z, m."""
    alpha: Array
    """In (-pi, pi], rad; 0 at the level pose."""
    beta: Array
    """The tilt, rad; never negative."""

    @property
    def gamma(self) -> Array:
        """The paper's third angle, -alpha, rad."""
        return -self.alpha


class Centre(NamedTuple):
    """The platform's centre, and which of the two poses with this centre it is."""

    position: Array
    """(p_x, p_y, p_z) in base axes, shape (..., 3), m."""
    branch: NDArray[np.str_]
    """``"+"`` or ``"-"``, shape (...)."""


class ParasiticMotion(NamedTuple):
    """Horizontal motion of the platform's centre that a tilt causes, shape (..., 2) each."""

    position: Array
    """(p_x, p_y) in base axes, m."""
    velocity: Array
    """Its first time derivative, m/s."""
    acceleration: Array
    """Its second time derivative, m/s^2."""


# The paper's angles -------------------------------------------------------------------------------


@refuses_other_kinds
def pose_from_angles(z: ArrayLike, alpha: ArrayLike, beta: ArrayLike) -> Array:
    """Return the pose (..., 3) of the paper's height (m), alpha and beta (rad; Z-Y-Z, Eq. 5).

    Raises
    ------
    InputError
        If they are not finite numbers of shapes that go together.
    """
    height, a, b = one_shape(
        z=real_array(z, "z"), alpha=real_array(alpha, "alpha"), beta=real_array(beta, "beta")
    )
    return np.stack([height, -b * np.sin(a), b * np.cos(a)], axis=-1)


@refuses_other_kinds
def angles_from_pose(pose: ArrayLike) -> PaperAngles:
    """Return the paper's p_z, alpha and beta of a pose (..., 3); the inverse of `pose_from_angles`.

    Of the paper's two sets (alpha, beta) and (alpha + pi, -beta), which are one rotation, this is
    the one with beta >= 0. At the level pose alpha is 0; close to it, alpha is any angle.

    Raises
    ------
    InputError
        If the pose has the wrong shape or is not finite.
    """
    z, wx, wy = np.moveaxis(checked_pose(pose), -1, 0)
    alpha = np.arctan2(0.0 - wx, wy + 0.0)  # no zeros of negative sign
    return PaperAngles(z.copy(), np.where(alpha == -np.pi, np.pi, alpha), np.hypot(wx, wy))


# The centre ---------------------------------------------------------------------------------------


@refuses_other_kinds
@maskable(position=1, branch=0)
def pose_from_position(
    position: ArrayLike,
    platform_radius: float,
    branch: ArrayLike = "+",
    *,
    errors: Errors = "raise",
) -> Array:
    """Return the pose (..., 3) that holds the platform's centre at a position: Eq. 5 inverted.

    On the circle p_x = r cos(phi), p_y = r sin(phi) the tilt is r = h sin^2(beta/2), and branch
    ``"+"`` has alpha = pi/2 - phi/2, branch ``"-"`` the opposite tilt. phi is that of atan2, in
    (-pi, pi]: across the negative x axis the branches change places, as one turn round the centre
    leads from each to the other. A path that turns further follows one branch, as
    `rps_pin.trajectories.helix` does. `poses_from` gives both branches.

    Parameters
    ----------
    position
        (p_x, p_y, p_z) in base axes, shape (..., 3), m.
    platform_radius
        The paper's h, m.
    branch
        ``"+"`` or ``"-"``; one, or an array of them, shape (...).
    errors
        ``"raise"`` refuses a position out of reach; with ``"mask"`` its pose is NaN.

    Raises
    ------
    InputError
        If the position is not finite or has the wrong shape, or a branch is unknown.
    UnreachableError
        If (p_x, p_y) lies further than h from the axis.
    """
    centre = real_array(position, "position", (3,))
    try:
        signs = np.asarray(branch)
    except ValueError:  # ragged
        signs = np.asarray("")
    if not np.isin(signs, ("+", "-")).all():
        raise InputError(f"branch = {shown(branch)}: it must be '+' or '-', or an array of them")
    try:
        batch = np.broadcast_shapes(centre.shape[:-1], signs.shape)
    except ValueError:
        raise InputError(
            f"position and branch have shapes {centre.shape} and {signs.shape}, which do not go "
            "together: (..., 3) and (...)"
        ) from None
    x, y, z = np.moveaxis(np.broadcast_to(centre, (*batch, 3)), -1, 0)
    both = poses_from(platform_radius, x=x, y=y, z=z).pose
    return np.where((signs == "+")[..., None], both[..., 0, :], both[..., 1, :])


@refuses_other_kinds
def position_from_pose(pose: ArrayLike, platform_radius: float) -> Centre:
    """Return the platform's centre, Eq. 4, and the branch of a pose (..., 3).

    ``pose_from_position(centre.position, h, centre.branch)`` gives back the pose, if its tilt is
    below pi. The level pose, where the branches meet, is given to ``"+"``.

    Raises
    ------
    InputError
        If the pose has the wrong shape or is not finite.
    """
    x = checked_pose(pose)
    wx, wy = x[..., 1], x[..., 2]
    plus = (wx < 0) | ((wx == 0) & (wy >= 0))  # alpha in [0, pi)
    return Centre(
        poses.position(x, positive_number(platform_radius, "platform_radius", "metres")),
        np.where(plus, "+", "-"),
    )


@refuses_other_kinds
def parasitic_motion(
    pose: ArrayLike,
    platform_radius: float,
    rate: ArrayLike = (0.0, 0.0, 0.0),
    acceleration: ArrayLike = (0.0, 0.0, 0.0),
) -> ParasiticMotion:
    """Return the horizontal motion of the platform's centre that its tilt causes: Eq. 4.

    Parameters
    ----------
    pose, rate, acceleration
        Pose (m, rad, rad) and its first and second time derivatives, shape (..., 3) each; at rest
        if left out.
    platform_radius
        The paper's h, m.

    Raises
    ------
    InputError
        If an argument has the wrong shape or is not finite.
    """
    h = positive_number(platform_radius, "platform_radius", "metres")
    motion = platform_motion(*checked_motion(pose, rate, acceleration), h)
    return ParasiticMotion(
        motion.position[..., :2], motion.velocity[..., :2], motion.acceleration[..., :2]
    )
