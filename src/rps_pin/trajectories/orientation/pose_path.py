"""Motions of a frame with its orientation, in a task's coordinates.

Positions are a natural cubic spline, rotations one on SO(3) (see `rotation_curve`), both over the
length of the chords sqrt(|dp|^2 + (L angle)^2), L = `rotation_scale`, m/rad; a law of time makes it
a motion from rest to rest. With w the angular velocity, the rotation vector r has

    r' = A(r) w,    r'' = A(r) w' + A(r)' w

(see `rps_pin.closed_loop.constraints.rotation_vector`). It is continued along the curve, below a
whole turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.rotation_vector import MOST_TURN, vector_rates
from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.trajectories.curve import CurveSample, TimedCurve, TimeLaw
from rps_pin.trajectories.orientation.rotation_curve import RotationCurve, vectors_of
from rps_pin.trajectories.path import checked_parameters, checked_times
from rps_pin.trajectories.resampled import TILT_SCALE
from rps_pin.trajectories.time_laws import Profile, time_law
from rps_pin.validation import fixed_array, numbers, positive_number

COORDINATES = ("x", "y", "z", "rx", "ry", "rz")
#: At how many places the length of the rotation vector is looked at.
_LOOKS = 2001


class PoseSample(NamedTuple):
    """A frame's motion at times of shape (...), in the reference frame's axes."""

    position: Array
    """Shape (..., 3), m."""
    rotation: Array
    """Shape (..., 3, 3)."""
    velocity: Array
    """Shape (..., 3), m/s."""
    angular_velocity: Array
    """Shape (..., 3), rad/s."""
    acceleration: Array
    """Shape (..., 3), m/s^2."""
    angular_acceleration: Array
    """Shape (..., 3), rad/s^2."""


@refuses_other_kinds
class PoseCurve:
    """A smooth curve through poses of a frame, in a task's coordinates; see `pose_path`.

    Attributes
    ----------
    coordinates : tuple of str
        Their names, in order.
    length : float
        Largest u, m.
    """

    def __init__(
        self,
        positions: ArrayLike,
        rotations: ArrayLike,
        coordinates: Sequence[str] = COORDINATES,
        *,
        turns: ArrayLike | None = None,
        rotation_scale: float = TILT_SCALE,
    ) -> None:
        self.coordinates = tuple(coordinates)
        unknown = [one for one in self.coordinates if one not in COORDINATES]
        if unknown or not self.coordinates or len({*self.coordinates}) < len(self.coordinates):
            raise InputError(
                f"coordinates = {shown(self.coordinates)}: they are some of "
                f"{', '.join(COORDINATES)}, each once"
            )
        self._columns = [COORDINATES.index(one) for one in self.coordinates]
        p = fixed_array(positions, "positions", (None, 3), "x, y, z")
        if len(p) < 2:
            raise InputError(f"positions has shape {p.shape}; two or more are needed")
        scale = positive_number(rotation_scale, "rotation_scale", "m/rad")
        if turns is None:
            r = vectors_of(rotations, "rotations")
            _refuse_other_count(len(r), len(p), "rotations")
            steps = Rotation.from_rotvec(r.copy())
            angles = (steps[:-1].inv() * steps[1:]).magnitude()
        else:
            angles = np.linalg.norm(fixed_array(turns, "turns", (None, 3)), axis=-1)
            _refuse_other_count(len(angles) + 1, len(p), "turns, and one more,")
        chords = np.hypot(np.linalg.norm(np.diff(p, axis=0), axis=-1), scale * angles)
        if not (chords > 0).all():
            k = int(np.argmin(chords > 0))
            raise InputError(f"poses {k} and {k + 1} are the same: the chord has no length")
        knots = np.concatenate([[0.0], np.cumsum(chords)])
        self.length = float(knots[-1])
        self._positions = CubicSpline(knots, p, bc_type="natural")
        self._rotations = (
            RotationCurve(r, knots)
            if turns is None
            else RotationCurve.turning(rotations, turns, knots)
        )
        self._refuse_whole_turns()

    def __repr__(self) -> str:
        return f"PoseCurve({', '.join(self.coordinates)}; length={self.length:.6g})"

    def at(self, u: ArrayLike) -> CurveSample:
        """Return coordinates and derivatives at u of shape (...), m."""
        along = checked_parameters(u, self.length)
        turned = self._rotations.at(along)
        rates = vector_rates(turned.vector, turned.velocity, turned.acceleration)
        orders = zip(range(3), (turned.vector, *rates), strict=True)
        parts = [
            np.concatenate([self._positions(along, order), r], axis=-1)[..., self._columns]
            for order, r in orders
        ]
        return CurveSample(*parts)

    def motion(self, u: Array, rate: Array, acceleration: Array) -> PoseSample:
        """Return the frame's motion as u moves, shape (...) each."""
        turned = self._rotations.at(u)
        du, ddu, square = rate[..., None], acceleration[..., None], rate[..., None] ** 2
        p, first, second = (self._positions(u, order) for order in range(3))
        return PoseSample(
            p,
            turned.rotation,
            first * du,
            turned.velocity * du,
            first * ddu + second * square,
            turned.velocity * ddu + turned.acceleration * square,
        )

    def _refuse_whole_turns(self) -> None:
        if not any(one in COORDINATES[3:] for one in self.coordinates):
            return
        u = np.linspace(0.0, self.length, _LOOKS)
        size = np.linalg.norm(self._rotations.at(u).vector, axis=-1)
        jumps = np.abs(np.diff(size)) > np.pi  # past a whole turn, from one side to the other
        if size.max() > MOST_TURN or jumps.any():
            k = int(np.argmax(size > MOST_TURN)) if size.max() > MOST_TURN else int(jumps.argmax())
            raise InputError(
                f"the rotation vector grows to {size[k]:.4g} rad at {k / (_LOOKS - 1):.0%} of the "
                f"way; at most {MOST_TURN:.4g} is possible: a rotation vector of a whole turn has "
                "no rates. Begin with the rotation vector a turn less (rotation vectors may be "
                "given in place of matrices), or make two motions"
            )


@refuses_other_kinds
class PosePath(TimedCurve):
    """A motion of a frame: a trajectory of a task's coordinates that also has the frame's motion.

    See `pose_path`.
    """

    curve: PoseCurve

    def __init__(self, curve: PoseCurve, law: TimeLaw) -> None:
        super().__init__(curve, law)

    def motion(self, t: ArrayLike) -> PoseSample:
        """Return the frame's motion at times of shape (...), s; exact."""
        return self.curve.motion(*self.law.at(checked_times(t, self.duration)))


@refuses_other_kinds
def pose_path(
    positions: ArrayLike,
    rotations: ArrayLike,
    coordinates: Sequence[str] = COORDINATES,
    *,
    duration: float,
    turns: ArrayLike | None = None,
    profile: Profile = "s-curve",
    rotation_scale: float = TILT_SCALE,
) -> PosePath:
    """Return a smooth motion of a frame through poses, from rest to rest.

    Parameters
    ----------
    positions
        Of the frame's origin in the reference frame, shape (n, 3), m; n of 2 or more.
    rotations
        Of the frame in the reference frame: matrices, shape (n, 3, 3), or rotation vectors, shape
        (n, 3), rad. From each to the next the shorter way is taken, about one axis where there are
        two. A rotation vector of more than half a turn may begin the motion: see below.
    coordinates
        Which coordinates the trajectory has, in order: ``task.coordinates``.
    duration
        In s.
    turns
        Rotation vectors in the reference frame's axes, shape (n - 1, 3), rad: each leads from one
        pose to the next, by any angle, about a fixed axis. `rotations` is then the first alone,
        shape (3, 3) or (3,).
    profile
        The law of time; see `time_laws`.
    rotation_scale
        L above, m/rad; positive.

    Raises
    ------
    InputError
        If an array is not what it must be, two neighbouring rotations are half a turn apart, two
        neighbouring poses are the same, or the rotation vector, continued from the first one,
        reaches a whole turn (only where it is among the coordinates).
    """
    numbers(positions, "positions", "numbers of shape (n, 3)")
    curve = PoseCurve(positions, rotations, coordinates, turns=turns, rotation_scale=rotation_scale)
    return PosePath(curve, time_law(curve.length, profile, duration=duration))


def _refuse_other_count(count: int, wanted: int, name: str) -> None:
    if count != wanted:
        raise InputError(f"{count} {name} for {wanted} positions: one each is needed")
