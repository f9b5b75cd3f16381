"""Smooth curves of rotations R(u), with exact angular velocity and acceleration.

Between two neighbouring rotations R(u) = R_k exp(phi(u)^) with a cubic phi, such that the angular
velocity and acceleration are continuous: SciPy's `RotationSpline`. Between two rotations alone it
is the geodesic, a turn about one axis at a constant rate.

The rotation vector r of R is continued along the curve: q being the unit quaternion, continuous,

    r = 2 atan2(|v|, w) v / |v|,    q = (w, v),

which is unique below a whole turn, |r| < 2 pi.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, RotationSpline

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.trajectories.path import checked_parameters
from rps_pin.validation import fixed_array, numbers

#: Rotations further apart have no clear shortest way between them, rad.
FARTHEST = math.pi - 0.01
#: Largest turn between two rotations of the spline where turns are given, rad.
_PIECE = 1.0


class RotationSample(NamedTuple):
    """Rotations at parameters u of shape (...); all in the reference frame's axes."""

    rotation: Array
    """R, shape (..., 3, 3)."""
    vector: Array
    """Rotation vector r, continued along the curve, shape (..., 3), rad."""
    velocity: Array
    """Angular velocity by u, shape (..., 3): dR/du = velocity^ R."""
    acceleration: Array
    """Its derivative by u, shape (..., 3)."""


@refuses_other_kinds
class RotationCurve:
    """The spline through rotations, over a parameter u from 0.

    Parameters
    ----------
    rotations
        Matrices, shape (n, 3, 3), or rotation vectors, shape (n, 3), rad. The way between two is
        the shorter one, less than half a turn; for longer ones see `turning`.
    knots
        Where each is met, increasing from 0, shape (n,).

    Attributes
    ----------
    length : float
        The last knot.

    Raises
    ------
    InputError
        If an array is not what it must be, or two neighbours are half a turn apart.
    """

    def __init__(self, rotations: ArrayLike, knots: ArrayLike) -> None:
        r = vectors_of(rotations, "rotations")
        self._knots = fixed_array(knots, "knots", (len(r),))
        if self._knots[0] != 0 or not (np.diff(self._knots) > 0).all():
            raise InputError("knots must increase from 0")
        self.length = float(self._knots[-1])
        self._turns = turns = Rotation.from_rotvec(r.copy())  # SciPy takes no read-only arrays
        steps = (turns[:-1].inv() * turns[1:]).as_rotvec()
        far = np.linalg.norm(steps, axis=-1) > FARTHEST
        if far.any():
            k = int(np.argmax(far))
            raise InputError(
                f"rotations {k} and {k + 1} are {np.linalg.norm(steps[k]):.4g} rad apart, about "
                "half a turn: the way between them is not determined. Give one between them, or "
                "the turns"
            )
        self._spline = RotationSpline(self._knots.copy(), turns)
        quaternions = [_exponential(r[0] / 2)]
        for step in steps:
            quaternions.append(_product(quaternions[-1], _exponential(step / 2)))
        self._quaternions = np.array(quaternions)

    @classmethod
    def turning(cls, start: ArrayLike, turns: ArrayLike, knots: ArrayLike) -> RotationCurve:
        """Return the spline of turns of any size, one after another.

        Parameters
        ----------
        start
            First rotation, a matrix (3, 3) or a rotation vector (3,).
        turns
            Rotation vectors in the reference frame's axes, shape (n - 1, 3), rad: each about a
            fixed axis, from the rotation before.
        knots
            As for `RotationCurve`, shape (n,).
        """
        first = numbers(start, "start", "a rotation matrix, or a rotation vector")[None]
        r = vectors_of(first, "start", least=1)
        w = fixed_array(turns, "turns", (None, 3), "rotation vectors")
        at = fixed_array(knots, "knots", (len(w) + 1,))
        found, where = [Rotation.from_rotvec(r[0].copy())], [float(at[0])]
        for turn, low, high in zip(w, at[:-1], at[1:], strict=True):
            count, before = math.ceil(np.linalg.norm(turn) / _PIECE) or 1, found[-1]
            for part in np.arange(1, count + 1) / count:
                found.append(Rotation.from_rotvec(part * turn) * before)
                where.append(float(low + part * (high - low)))
        vectors = np.array([one.as_rotvec() for one in found])
        vectors[0] = r[0]
        return cls(vectors, where)

    def __repr__(self) -> str:
        return f"RotationCurve(<{len(self._knots)} rotations>, length={self.length:.6g})"

    def at(self, u: ArrayLike) -> RotationSample:
        """Return rotations and their derivatives at u of shape (...)."""
        along = checked_parameters(u, self.length)
        flat, batch = along.ravel(), along.shape
        turned = self._spline(flat)
        rotation = turned.as_matrix()
        of_body = self._spline(flat, 1), self._spline(flat, 2)  # in the axes that turn
        # The derivative of R w is R (w' + w x w): the same matrix takes both.
        velocity, acceleration = (np.einsum("kij,kj->ki", rotation, one) for one in of_body)
        k = np.searchsorted(self._knots[1:-1], flat, side="right")
        steps = (self._turns[k].inv() * turned).as_rotvec()
        lifted = _product(self._quaternions[k], _exponential(steps / 2))
        parts = rotation.reshape(*batch, 3, 3), _logarithm(lifted), velocity, acceleration
        return RotationSample(parts[0], *(one.reshape(*batch, 3) for one in parts[1:]))


def vectors_of(rotations: ArrayLike, name: str, least: int = 2) -> Array:
    """Return rotation vectors, shape (n, 3), of matrices (n, 3, 3) or of rotation vectors."""
    given = numbers(rotations, name, "rotation matrices (n, 3, 3), or rotation vectors (n, 3)")
    if given.shape[1:] not in ((3,), (3, 3)) or len(given) < least:
        raise InputError(
            f"{name} has shape {given.shape}; it must be (n, 3, 3), matrices, or (n, 3), rotation "
            f"vectors, n of {least} or more"
        )
    found = fixed_array(given, name, given.shape)
    if given.ndim == 2:
        return found
    off = np.abs(np.swapaxes(found, -1, -2) @ found - np.eye(3)).max(axis=(-1, -2))
    bad = (off > 1e-9) | (np.linalg.det(found) < 0)
    if bad.any():
        k = int(np.argmax(bad))
        raise InputError(f"{name}: matrix {k} is no rotation: R' R - 1 has entries of {off[k]:.3g}")
    return np.asarray(Rotation.from_matrix(found.copy()).as_rotvec())


# Quaternions (w, x, y, z), whose sign tells rotation vectors up to a whole turn apart -------------


def _exponential(half: Array) -> Array:
    """Return the quaternion of half a rotation vector, shape (..., 4)."""
    angle = np.linalg.norm(half, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle), np.sinc(angle / np.pi) * half], axis=-1)


def _product(a: Array, b: Array) -> Array:
    v, w = a[..., 1:], b[..., 1:]
    scalar = a[..., :1] * b[..., :1] - (v * w).sum(axis=-1, keepdims=True)
    return np.concatenate([scalar, a[..., :1] * w + b[..., :1] * v + np.cross(v, w)], axis=-1)


def _logarithm(q: Array) -> Array:
    """Return the rotation vector of less than a whole turn, shape (..., 3)."""
    size = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(size, q[..., :1])
    factor = np.where(size > 0, angle / np.where(size > 0, size, 1.0), 2.0)
    return np.asarray(factor * q[..., 1:])
