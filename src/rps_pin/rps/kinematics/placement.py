"""Placements of the platform: whether the legs can hold them (Eq. 3 and 4), and their pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from rps_pin.arrays import Array
from rps_pin.errors import ClosureError, InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kinematics import pose as poses
from rps_pin.rps.kinematics.legs import tips
from rps_pin.rps.kinematics.samples import Errors, maskable, refuse
from rps_pin.validation import positive_number, real_array

#: Largest entry of R'R - I in what is still taken for a rotation.
_ORTHONORMAL = 1e-6


@refuses_other_kinds
@maskable(position=1, rotation=2)
def constraint_residuals(
    position: ArrayLike, rotation: ArrayLike, platform_radius: float, *, errors: Errors = "raise"
) -> Array:
    """Return the residuals of a placement in the constraints of Eq. 4, shape (..., 3), m.

    They are h (u_y - v_x), p_y + h u_y and p_x - h/2 (u_x - v_y). All vanish exactly if each
    spherical joint lies in its leg's plane, Eq. 3: then legs of some length and angle reach it.

    Parameters
    ----------
    position
        Of the platform's centre in base axes, shape (..., 3), m.
    rotation
        From platform to base axes, shape (..., 3, 3).
    platform_radius
        The paper's h, m.
    errors
        ``"raise"`` refuses a matrix that is not a rotation; with ``"mask"`` its results are NaN.

    Raises
    ------
    InputError
        If an argument has the wrong shape or is not finite, or a matrix is not a rotation.
    """
    return _residuals(
        *_checked_placement(position, rotation),
        positive_number(platform_radius, "platform_radius", "metres"),
    )


@refuses_other_kinds
@maskable(position=1, rotation=2)
def pose_from_placement(
    position: ArrayLike,
    rotation: ArrayLike,
    platform_radius: float,
    *,
    tolerance: float | None = None,
    errors: Errors = "raise",
) -> Array:
    """Return the pose (..., 3) of a placement of the platform.

    The pose is the nearest in rotation; its tilt is within pi. A placement is refused if one of
    its spherical joints is further than the tolerance from the pose's. A half turn has two poses,
    w and -w; either may be returned.

    Parameters
    ----------
    position
        Of the platform's centre in base axes, shape (..., 3), m.
    rotation
        From platform to base axes, shape (..., 3, 3).
    platform_radius
        The paper's h, m.
    tolerance
        In m; 1e-9 h if left out.
    errors
        ``"raise"`` refuses a placement without a pose; with ``"mask"`` its pose is NaN.

    Raises
    ------
    InputError
        If an argument has the wrong shape or is not finite, a matrix is not a rotation, or the
        placement belongs to the robot's other operation mode: half turns about axes outside the
        base plane.
    ClosureError
        If the placement breaks the constraints of Eq. 4.
    """
    centre, turn = _checked_placement(position, rotation)
    h = positive_number(platform_radius, "platform_radius", "metres")
    allowed = positive_number(1e-9 * h if tolerance is None else tolerance, "tolerance", "metres")
    x, y, torsion, w = _quaternion(turn)
    # The nearest rotation about an axis in the base plane has (x, y, w) alone, normalised.
    sine = np.hypot(x, y)
    size = np.where(sine == 0, 2.0, 2 * np.arctan2(sine, w) / np.where(sine == 0, 1.0, sine))
    pose = np.stack([centre[..., 2], x * size, y * size], axis=-1)

    apart = tips(centre, turn, h) - tips(poses.position(pose, h), poses.rotation(pose), h)
    gap = np.linalg.norm(apart, axis=-1).max(axis=-1)

    def error(first: tuple[int, ...], where: str) -> InputError | ClosureError:
        residuals = _residuals(centre[first], turn[first], h)
        if np.abs(residuals).max() <= allowed:
            return InputError(
                f"the placement{where} has no pose: it is a half turn about an axis "
                f"{np.arcsin(min(1.0, abs(float(torsion[first])))):.6g} rad out of the base plane, "
                f"the robot's other operation mode; a joint is {gap[first]:.3g} m from the nearest "
                f"pose's, more than {allowed:.3g} m"
            )
        return ClosureError(
            f"the placement{where} breaks the constraints of Eq. 4: h (u_y - v_x), p_y + h u_y and "
            f"p_x - h/2 (u_x - v_y) are {', '.join(f'{r:.3g}' for r in residuals)} m; a joint is "
            f"{gap[first]:.3g} m from the nearest pose's, more than {allowed:.3g} m",
            float(gap[first]),
        )

    refuse(gap > allowed, error)
    return pose


def _residuals(position: Array, rotation: Array, h: float) -> Array:
    p_x, p_y, _ = np.moveaxis(position, -1, 0)
    u_x, u_y = rotation[..., 0, 0], rotation[..., 1, 0]
    v_x, v_y = rotation[..., 0, 1], rotation[..., 1, 1]
    # Eq. 4: u_y = v_x, p_y = -h u_y, p_x = h/2 (u_x - v_y)
    return np.stack([h * (u_y - v_x), p_y + h * u_y, p_x - h / 2 * (u_x - v_y)], axis=-1)


def _quaternion(rotation: Array) -> Array:
    """Return the unit quaternion (x, y, z, w) with w >= 0, components first: shape (4, ...)."""
    batch = rotation.shape[:-2]
    if 0 in batch:
        return np.zeros((4, *batch))
    quaternion = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_quat()
    quaternion *= np.where(quaternion[:, 3:] < 0, -1.0, 1.0)
    components: Array = np.moveaxis(quaternion.reshape(*batch, 4), -1, 0)
    return components


def _checked_placement(position: ArrayLike, rotation: ArrayLike) -> tuple[Array, Array]:
    """Return positions (..., 3) and rotations (..., 3, 3) of one batch shape."""
    p, R = real_array(position, "position", (3,)), real_array(rotation, "rotation", (3, 3))
    try:
        batch = np.broadcast_shapes(p.shape[:-1], R.shape[:-2])
    except ValueError:
        raise InputError(
            f"position and rotation have shapes {p.shape} and {R.shape}, which do not go together"
        ) from None
    p, R = np.broadcast_to(p, (*batch, 3)), np.broadcast_to(R, (*batch, 3, 3))
    off = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(-1, -2), initial=0.0)
    determinant = np.linalg.det(R)

    def error(first: tuple[int, ...], where: str) -> InputError:
        return InputError(
            f"rotation{where} is not a rotation: R'R differs from I by {off[first]:.3g} (at most "
            f"{_ORTHONORMAL}), det(R) = {determinant[first]:.6g} (must be 1)"
        )

    refuse((off > _ORTHONORMAL) | (determinant < 0), error)
    return p, R
