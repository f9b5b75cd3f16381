"""Limits on constraint forces, for `ForceDistribution`.

A closure's force is that of frame b's side on frame a's side, in the closure's rows: in world axes
for spherical and rigid closures, in frame a's axes for the others. It is positive in tension for a
``distance`` closure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import real_vector


@refuses_other_kinds
@dataclass(frozen=True)
class ForceBound:
    """Limits on one component of a closure's force: lower <= direction . force <= upper.

    Parameters
    ----------
    closure
        Name of the closure.
    row
        Which of the closure's rows is limited, counted from 0. Either this or `direction`.
    direction
        A combination of the closure's rows, of any length: as many numbers as it has rows, or three
        where its first three rows are a force (spherical, rigid, revolute, universal).
    lower, upper
        N (N m for a moment); no limit if left out.
    name
        For messages; made of the closure and the row if left out.

    Raises
    ------
    InputError
        If no force is within the limits, or not one of row and direction is given.
    """

    closure: str
    row: int | None = None
    direction: Sequence[float] | None = None
    lower: float = -math.inf
    upper: float = math.inf
    name: str = ""

    def __post_init__(self) -> None:
        if (self.row is None) == (self.direction is None):
            raise InputError(f"a bound on closure {self.closure!r} takes a row or a direction")
        if not (self.lower <= self.upper and self.lower < math.inf and self.upper > -math.inf):
            raise InputError(
                f"a bound on closure {self.closure!r} from {self.lower} to {self.upper} leaves "
                "no force"
            )
        if not self.name:
            what = f"row {self.row}" if self.direction is None else f"along {self.direction}"
            object.__setattr__(self, "name", f"closure {self.closure!r} ({what})")

    def combination(self, size: int) -> Array:
        """Return the direction as a combination of all rows of a closure, shape (size,).

        Raises
        ------
        InputError
            If the closure does not have the rows named.
        """
        full = np.zeros(size)
        if self.direction is None:
            row = self.row
            if not (isinstance(row, int) and 0 <= row < size):
                raise InputError(
                    f"closure {self.closure!r} has rows 0 to {size - 1}; row {row!r} is none"
                )
            full[row] = 1.0
            return full
        count = 3 if len(self.direction) == 3 <= size else size
        full[:count] = real_vector(self.direction, count, f"direction of {self.name}")
        if not full.any():
            raise InputError(f"direction of {self.name} has no length")
        return full


@refuses_other_kinds
def friction_pyramid(
    closure: str,
    friction: float,
    *,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    sides: int = 4,
    least: float = 0.0,
) -> tuple[ForceBound, ...]:
    """Return bounds that keep a contact's force within a pyramid inside its friction cone.

    For a closure of a body (frame a) on the ground (frame b): the force on the body has a positive
    component along the normal, and a tangential one of at most `friction` times that.

    Parameters
    ----------
    closure
        Name of a closure whose first three rows are a force.
    friction
        Coefficient of dry friction; not negative.
    normal
        Direction of the normal force on the body, shape (3,), of any length, in the closure's axes.
    sides
        Number of faces, at least 3. The pyramid lies within the cone and touches it along its
        edges; with n faces it holds at least cos(pi / n) of the friction.
    least
        Least normal force, N; 0: the contact cannot pull.

    Returns
    -------
    tuple of ForceBound
        First that on the normal force.

    Raises
    ------
    InputError
        If a number does not fit.
    """
    if not (friction >= 0 and math.isfinite(friction)):
        raise InputError(f"friction = {friction}: it must be finite and not negative")
    if sides < 3:
        raise InputError(f"sides = {sides}: a pyramid has at least 3")
    up = real_vector(normal, 3, "normal")
    if not np.linalg.norm(up) > 0:
        raise InputError("normal has no length")
    up = up / np.linalg.norm(up)
    first = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    first /= np.linalg.norm(first)
    second = np.cross(up, first)
    name = f"closure {closure!r}"
    bounds = [ForceBound(closure, direction=tuple(up), lower=least, name=f"{name} (normal force)")]
    for face in range(sides):
        angle = 2 * math.pi * (face + 0.5) / sides
        across = math.cos(angle) * first + math.sin(angle) * second
        inward = across - friction * math.cos(math.pi / sides) * up
        face_name = f"{name} (friction, face {face})"
        bounds.append(ForceBound(closure, direction=tuple(inward), upper=0.0, name=face_name))
    return tuple(bounds)
