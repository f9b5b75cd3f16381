"""Limits of positions as signals: the room that joints and cones of balls have along a path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.constraints.closures import frame_id
from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.paths.findings import Signal
from rps_pin.validation import fixed_array, positive_number

#: Limits are kept to rounding error: angles in rad, lengths relative to their limits.
LIMIT_TOLERANCE = 1e-12


@refuses_other_kinds
@dataclass(frozen=True)
class Cone:
    """A limit of a ball or a universal joint: the angle between axes of two frames.

    Parameters
    ----------
    frame_a, frame_b
        Names of the frames, or of the joints that carry them.
    limit
        Largest angle, rad; below pi.
    axis_a, axis_b
        The axes, fixed to each frame, shape (3,); z if left out.
    name
        For events; ``"FRAME_A, FRAME_B"`` if left out.

    Raises
    ------
    InputError
        If an axis is zero, or the limit not between 0 and pi.
    """

    frame_a: str
    frame_b: str
    limit: float
    axis_a: ArrayLike = (0.0, 0.0, 1.0)
    axis_b: ArrayLike = (0.0, 0.0, 1.0)
    name: str = ""

    def __post_init__(self) -> None:
        if not positive_number(self.limit, "a cone's limit", "rad") < math.pi:
            raise InputError(f"a cone's limit = {shown(self.limit)} rad: it must be below pi")
        for each in ("axis_a", "axis_b"):
            axis = fixed_array(getattr(self, each), f"a cone's {each}", (3,))
            size = float(np.linalg.norm(axis))
            if not size > 0:
                raise InputError(f"a cone's {each} is zero")
            object.__setattr__(self, each, axis / size)
        if not self.name:
            object.__setattr__(self, "name", f"{self.frame_a}, {self.frame_b}")


class PositionLimits(Protocol):
    """Limits of a mechanism's positions."""

    @property
    def signals(self) -> tuple[Signal, ...]:
        """What they are."""
        ...

    def rooms(self, q: Array, v: Array, pose: Array, rate: Array) -> tuple[Array, Array]:
        """Return the room to each and its rate, shape (n, limits), negative beyond it.

        Of configurations (n, nq), velocities (n, nv), and the task's coordinates and rates (n, m).
        """
        ...


class JointRooms:
    """The limits of a mechanism's joints that have as many coordinates as velocities."""

    def __init__(self, mechanism: ClosedLoopModel) -> None:
        model, angular = mechanism.model, mechanism.angular_velocities
        found: list[tuple[int, int, float, Signal]] = []
        for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:
            if joint.nq != joint.nv:
                continue
            for part in range(joint.nq):
                iq, iv = joint.idx_q + part, joint.idx_v + part
                unit = "rad" if angular[iv] else "m"
                which = name if joint.nq == 1 else f"{name}[{part}]"
                sides = ("lower", model.lowerPositionLimit), ("upper", model.upperPositionLimit)
                for side, limits in sides:
                    if np.isfinite(limits[iq]):
                        limit = float(limits[iq])
                        signal = Signal("position", 0, side, limit, unit, which)
                        found.append((iq, iv, 1.0 if side == "lower" else -1.0, signal))
        self.signals = tuple(signal for *_, signal in found)
        #: Which coordinates of q have the limits, shape (limits,).
        self.q = np.array([iq for iq, *_ in found], dtype=np.intp)
        self._v = np.array([iv for _, iv, *_ in found], dtype=np.intp)
        self._sign = np.array([sign for _, _, sign, _ in found])
        self._limit = np.array([signal.limit for signal in self.signals])
        sizes = [1.0 if one.unit == "rad" else abs(one.limit) for one in self.signals]
        self._slack = LIMIT_TOLERANCE * np.array(sizes)

    def rooms(self, q: Array, v: Array, pose: Array, rate: Array) -> tuple[Array, Array]:
        """Return the room to each limit and its rate; see `PositionLimits`."""
        room = self._sign * (q[:, self.q] - self._limit) + self._slack
        return room, self._sign * v[:, self._v]


class ConeRooms:
    """Cones; the room is that of the angle's cosine, which is smooth."""

    def __init__(self, mechanism: ClosedLoopModel, cones: Sequence[Cone]) -> None:
        self._mechanism = mechanism
        model = mechanism.model
        self._cones = [
            (frame_id(model, c.frame_a, "cone"), frame_id(model, c.frame_b, "cone"), c)
            for c in cones
        ]
        self.signals = tuple(Signal("cone", 0, "upper", c.limit, "rad", c.name) for c in cones)

    def rooms(self, q: Array, v: Array, pose: Array, rate: Array) -> tuple[Array, Array]:
        """Return the room to each limit and its rate; see `PositionLimits`."""
        found = np.empty((2, len(q), len(self._cones)))
        model, data = self._mechanism.model, self._mechanism.system.data
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        for k in range(len(q) if self._cones else 0):
            pin.forwardKinematics(model, data, q[k], v[k])
            pin.updateFramePlacements(model, data)
            for i, (a, b, cone) in enumerate(self._cones):
                fixed = (a, cone.axis_a), (b, cone.axis_b)
                axes = [data.oMf[one].rotation @ np.asarray(axis) for one, axis in fixed]
                turns = [pin.getFrameVelocity(model, data, one, world).angular for one in (a, b)]
                most = math.cos(min(cone.limit + LIMIT_TOLERANCE, math.pi))
                found[0, k, i] = axes[0] @ axes[1] - most
                found[1, k, i] = (turns[0] - turns[1]) @ np.cross(axes[0], axes[1])
        return found[0], found[1]
