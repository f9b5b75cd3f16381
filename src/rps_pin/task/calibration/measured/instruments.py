"""Instruments that read something of a frame's placement: a tracker's targets, a ball bar, a level.

With t and r the frame's place and rotation vector in the world, and R = exp(r^), a point a of the
frame is at y = t + R a. A tracker that stands at t_0 with R_0 = exp(r_0^) reads R_0'(y - t_0), a
ball bar |y - c|, a height gauge n . y, a level asin(n . R b). With J the right Jacobian of exp,
d(R w) = -R w^ J dr.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.validation import real_array, real_vector

_XYZ, _TURN = ("x", "y", "z"), ("rx", "ry", "rz")


class Seen(NamedTuple):
    """What an instrument reads at frames, and its slopes."""

    values: Array
    """Shape (n, k)."""
    by_frame: Array
    """By the frame's x, y, z, rx, ry, rz, shape (n, k, 6)."""
    by_own: Array
    """By the instrument's own parameters, shape (n, k, s)."""


class Instrument(Protocol):
    """What reads something of a frame's placement."""

    @property
    def frame(self) -> str:
        """Name of the frame."""
        ...

    @property
    def sensors(self) -> tuple[str, ...]:
        """What it reads."""
        ...

    @property
    def angular(self) -> bool:
        """Whether that are angles."""
        ...

    @property
    def labels(self) -> tuple[str, ...]:
        """Its own parameters."""
        ...

    @property
    def nominal(self) -> Array:
        """Their numbers as they are believed to be."""
        ...

    def read(self, frames: Array, own: Array) -> Seen:
        """Return what it reads at frames (n, 6), with its parameters (s,)."""
        ...


@dataclass(frozen=True)
class Tracker:
    """A tracker, a camera or another robot: points of targets on a frame, in its own axes.

    Reads ``TARGET_x``, ``TARGET_y``, ``TARGET_z`` of each target, m. Parameters: where it stands,
    ``NAME.x`` to ``NAME.rz``, unless that is known; and where the targets are, ``TARGET.x`` to
    ``TARGET.z``, if asked for.

    Parameters
    ----------
    targets
        By name, the points in the frame, m.
    frame
        The frame that carries them.
    placement
        Where the tracker stands in the world, an SE3 or a matrix (4, 4). Left out: it is found from
        the readings, which needs three targets, not in a line, at one pose, or as many poses.
    known
        Whether that placement is right.
    unknown_targets
        Whether the targets' points are parameters; `targets` are where they are about.
    name
        Of the tracker.
    """

    targets: Mapping[str, ArrayLike]
    frame: str
    placement: Any = None
    known: bool = False
    unknown_targets: bool = False
    name: str = "tracker"
    points: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        points = [real_vector(point, 3, name) for name, point in self.targets.items()]
        if not points:
            raise InputError(f"{self.name} has no targets")
        if self.known and self.placement is None:
            raise InputError(f"{self.name}: give the placement that is known")
        object.__setattr__(self, "points", np.array(points))

    angular = False

    @property
    def sensors(self) -> tuple[str, ...]:
        """`TARGET_x` and so on."""
        return tuple(f"{name}_{axis}" for name in self.targets for axis in _XYZ)

    @property
    def labels(self) -> tuple[str, ...]:
        """Of its placement, and of its targets."""
        stands = () if self.known else tuple(f"{self.name}.{part}" for part in (*_XYZ, *_TURN))
        points = [f"{name}.{axis}" for name in self.targets for axis in _XYZ]
        return (*stands, *(points if self.unknown_targets else ()))

    @property
    def nominal(self) -> Array:
        """At the world's origin if it is not said where it stands."""
        stands = np.zeros(0) if self.known else self._stands
        points = self.points.ravel() if self.unknown_targets else np.zeros(0)
        return np.concatenate([stands, points])

    @property
    def _stands(self) -> Array:
        if self.placement is None:
            return np.zeros(6)
        at = real_array(getattr(self.placement, "homogeneous", self.placement), "placement", (4, 4))
        return np.concatenate([at[:3, 3], pin.log3(at[:3, :3])])

    def read(self, frames: Array, own: Array) -> Seen:
        """Return R_0'(t + R a - t_0)."""
        own = np.asarray(own)
        stands = self._stands if self.known else own[:6]
        points = own[-self.points.size :].reshape(-1, 3) if self.unknown_targets else self.points
        turn, n, k = pin.exp3(stands[3:]), len(frames), len(points)
        y, by_frame, R = _points(frames, points)
        off = y - stands[:3]
        values = off @ turn  # R_0' of rows
        by_own = np.zeros((n, k, 3, len(self.labels)))
        if not self.known:
            by_own[..., :3] = -turn.T
            # d(R_0' w) = (R_0' w)^ J(r_0) dr_0
            by_own[..., 3:6] = _skews(values) @ pin.Jexp3(stands[3:])
        if self.unknown_targets:
            first = len(self.labels) - points.size
            for i in range(k):
                at = first + 3 * i
                by_own[:, i, :, at : at + 3] = turn.T @ R
        return Seen(
            values.reshape(n, 3 * k),
            (turn.T @ by_frame).reshape(n, 3 * k, 6),
            by_own.reshape(n, 3 * k, -1),
        )

    def placed(self, frames: Array, readings: Array) -> Array:
        """Return where it stands, by what it read at frames (n, 6) of all targets, (6,).

        Least squares of two sets of points; `readings` has shape (n, 3 k), NaN where unread.

        Raises
        ------
        InputError
            If these are fewer than three points, or all in a line.
        """
        y = _points(frames, self.points)[0].reshape(-1, 3)
        z = readings.reshape(-1, 3)
        both = np.isfinite(z).all(axis=1)
        y, z = y[both], z[both]
        middle = (y.mean(axis=0), z.mean(axis=0)) if len(y) else (np.zeros(3), np.zeros(3))
        u, s, vt = np.linalg.svd((y - middle[0]).T @ (z - middle[1]))
        if len(y) < 3 or s[1] <= 1e-9 * s[0]:
            raise InputError(
                f"{self.name}: {len(y)} points are read, in a line or too few, by which to find "
                "where it stands; give its placement"
            )
        turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt  # R_0: y = t_0 + R_0 z
        return np.concatenate([middle[0] - turn @ middle[1], pin.log3(turn)])


@dataclass(frozen=True)
class BallBar:
    """A ball bar, or a wire: the distance of a point of a frame from a point of the world, m.

    Parameters are both points, ``NAME.target.x`` and ``NAME.centre.x`` and so on, unless `known`.
    """

    name: str
    frame: str
    target: ArrayLike
    centre: ArrayLike
    known: bool = False
    angular = False

    @property
    def sensors(self) -> tuple[str, ...]:
        """Its name."""
        return (self.name,)

    @property
    def labels(self) -> tuple[str, ...]:
        """Of both points."""
        if self.known:
            return ()
        return tuple(f"{self.name}.{end}.{axis}" for end in ("target", "centre") for axis in _XYZ)

    @property
    def nominal(self) -> Array:
        """Both points."""
        return np.zeros(0) if self.known else self._points

    @property
    def _points(self) -> Array:
        ends = ("target", self.target), ("centre", self.centre)
        return np.concatenate([real_vector(one, 3, f"{self.name}: {end}") for end, one in ends])

    def read(self, frames: Array, own: Array) -> Seen:
        """Return |t + R a - c|."""
        target, centre = np.split(self._points if self.known else own, 2)
        y, by_frame, R = _points(frames, target[None])
        off = y[:, 0] - centre
        length = np.linalg.norm(off, axis=-1, keepdims=True)
        along = (off / length)[:, None]  # (n, 1, 3)
        slopes = np.concatenate([along @ R, -along], axis=-1)
        return Seen(length, along @ by_frame[:, 0], slopes[..., : len(self.labels)])


@dataclass(frozen=True)
class Height:
    """A gauge: the component of a frame's point along a direction of the world, m."""

    name: str
    frame: str
    point: ArrayLike = (0.0, 0.0, 0.0)
    direction: ArrayLike = (0.0, 0.0, 1.0)
    angular, labels, nominal = False, (), np.zeros(0)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Its name."""
        return (self.name,)

    def read(self, frames: Array, own: Array) -> Seen:
        """Return n . (t + R a)."""
        n = _unit(self.direction, f"{self.name}: direction")
        y, by_frame, _ = _points(frames, real_vector(self.point, 3, f"{self.name}: point")[None])
        return Seen(y[:, 0] @ n[:, None], (n @ by_frame[:, 0])[:, None], _no_own(frames))


@dataclass(frozen=True)
class Inclinometer:
    """A level: the angle of an axis of a frame above the plane across a direction, rad.

    The direction is up, (0, 0, 1), if it is left out; the axis stays away from it.
    """

    name: str
    frame: str
    axis: ArrayLike
    direction: ArrayLike = (0.0, 0.0, 1.0)
    angular, labels, nominal = True, (), np.zeros(0)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Its name."""
        return (self.name,)

    def read(self, frames: Array, own: Array) -> Seen:
        """Return asin(n . R b)."""
        n = _unit(self.direction, f"{self.name}: direction")
        axis = _unit(self.axis, f"{self.name}: axis")
        level = np.concatenate([np.zeros((len(frames), 3)), frames[:, 3:]], axis=1)
        turned, by_frame, _ = _points(level, axis[None])
        sine = np.clip(turned[:, 0] @ n, -1.0, 1.0)
        slope = (n @ by_frame[:, 0]) / np.sqrt(np.maximum(1 - sine**2, 1e-12))[:, None]
        slope[:, :3] = 0.0
        return Seen(np.arcsin(sine)[:, None], slope[:, None], _no_own(frames))


def sensors_of(instruments: Sequence[Instrument]) -> dict[str, bool]:
    """Return what instruments read, and whether that are angles.

    Raises
    ------
    InputError
        If two read the same.
    """
    found: dict[str, bool] = {}
    for one in instruments:
        for name in one.sensors:
            if name in found:
                raise InputError(f"two instruments read {name!r}; give them other names")
            found[name] = one.angular
    return found


def _points(frames: Array, points: Array) -> tuple[Array, Array, Array]:
    """Return points (n, k, 3) of frames (n, 6), slopes by the frame (n, k, 3, 6), R (n, 3, 3)."""
    R = np.array([pin.exp3(r) for r in frames[:, 3:]]).reshape(-1, 3, 3)
    J = np.array([pin.Jexp3(r) for r in frames[:, 3:]]).reshape(-1, 3, 3)
    y = frames[:, None, :3] + np.einsum("nij,kj->nki", R, points)
    slopes = np.zeros((*y.shape, 6))
    slopes[..., :3] = np.eye(3)
    slopes[..., 3:] = -R[:, None] @ _skews(points) @ J[:, None]
    return y, slopes, R


def _skews(w: Array) -> Array:
    """Return w^ of vectors (..., 3), shape (..., 3, 3)."""
    found = np.zeros((*w.shape, 3))
    found[..., 2, 1], found[..., 0, 2], found[..., 1, 0] = w[..., 0], w[..., 1], w[..., 2]
    return found - np.swapaxes(found, -1, -2)


def _unit(given: ArrayLike, name: str) -> Array:
    vector = real_vector(given, 3, name)
    if not vector.any():
        raise InputError(f"{name} has no length")
    return np.asarray(vector / np.linalg.norm(vector))


def _no_own(frames: Array) -> Array:
    return np.zeros((len(frames), 1, 0))
