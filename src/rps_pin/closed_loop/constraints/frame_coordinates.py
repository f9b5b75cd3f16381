"""Coordinates of a frame, as a closure between the frame and joints that hold their values.

A mechanism gets one more joint without mass for each coordinate x_i of an output frame, and rows

    x_i - X_i(q) = 0

that tie these joints to the frame. Whatever holds for actuated joints then holds for a platform's
pose: configurations are completed from it, velocities and forces belong to it, in every engine.
With M = (R, p) the frame's placement in the reference frame, X is p for ``x``, ``y``, ``z``, and
the rotation vector of R for ``rx``, ``ry``, ``rz`` (see `rotation_vector`), both in the reference
frame's axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from rps_pin.closed_loop.constraints.closures import LoopClosure
from rps_pin.errors import MechanismError, shown

#: Names of the coordinates of a frame.
LINEAR, ANGULAR = ("x", "y", "z"), ("rx", "ry", "rz")


def check_coordinates(names: Sequence[str]) -> None:
    """Raise `MechanismError` unless these are names of coordinates, each once."""
    known = (*LINEAR, *ANGULAR)
    for name in names:
        if name not in known:
            raise MechanismError(f"task: no coordinate {name!r}; there are: {', '.join(known)}")
    twice = [name for name in names if list(names).count(name) > 1]
    if twice or not names:
        raise MechanismError(
            f"task: coordinate {twice[0]!r} is named twice"
            if twice
            else f"task: no coordinates are named; there are: {', '.join(known)}"
        )


@dataclass(frozen=True)
class FrameCoordinates(LoopClosure):
    """Joints that hold coordinates of frame b in frame a, the reference frame.

    Parameters
    ----------
    frame_a, frame_b, name, placement_a, placement_b
        As for `LoopClosure`.
    coordinates
        Of ``x``, ``y``, ``z`` (m), ``rx``, ``ry``, ``rz`` (rad), each once, linear ones first.
    joints
        Names of the prismatic or revolute joints that hold them, in this order.

    Raises
    ------
    MechanismError
        If there is no such coordinate, or joints and coordinates do not go together.
    """

    _kinds: ClassVar[tuple[str, ...]] = ("coordinates",)

    kind: Any = "coordinates"
    coordinates: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        known = (*LINEAR, *ANGULAR)
        ordered = tuple(one for one in known if one in self.coordinates)
        if self.coordinates != ordered or len(self.joints) != len(ordered) or not ordered:
            raise MechanismError(
                f"coordinates = {shown(self.coordinates)} with {len(self.joints)} joints: they are "
                f"some of {', '.join(known)}, each once and in this order, with one joint each"
            )
        super().__post_init__()

    @property
    def size(self) -> int:
        """Number of constraint rows."""
        return len(self.coordinates)

    @property
    def linear(self) -> tuple[int, ...]:
        """Axes of the linear coordinates, 0 to 2."""
        return tuple(LINEAR.index(one) for one in self.coordinates if one in LINEAR)

    @property
    def angular(self) -> tuple[int, ...]:
        """Axes of the angular coordinates, 0 to 2."""
        return tuple(ANGULAR.index(one) for one in self.coordinates if one in ANGULAR)
