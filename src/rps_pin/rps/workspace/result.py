"""The result of a workspace computation on a grid."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.evaluate import Fields
from rps_pin.rps.workspace.grids import Grid
from rps_pin.rps.workspace.reasons import Flags, Reason
from rps_pin.task.workspace.grids import nearest_value


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class Workspace:
    """Fields over the points of a grid, shape (n_1, n_2, n_3), SI units, base axes.

    Nothing is NaN: where a point is `Reason.UNREACHABLE` there is no pose, and its fields are zero.
    """

    parameters: RPSParameters
    """The robot."""
    grid: Grid
    """Leg lengths, or poses."""
    start: Array
    """Pose (3,) that decides the assembly mode, m and rad."""
    min_conditioning: float
    """Conditioning below which a point counts as singular."""
    fields: Fields
    """As computed; each of its members is an attribute here."""

    @property
    def reason(self) -> Flags:
        """`Reason` bits why a point is out, 0 inside."""
        return self.fields.reason

    @property
    def pose(self) -> Array:
        """(z, tilt_x, tilt_y), shape (n_1, n_2, n_3, 3), m and rad."""
        return self.fields.pose

    @property
    def position(self) -> Array:
        """Of the platform's centre, shape (n_1, n_2, n_3, 3), m."""
        return self.fields.position

    @property
    def length(self) -> Array:
        """Leg lengths, shape (n_1, n_2, n_3, 3), m."""
        return self.fields.length

    @property
    def angle(self) -> Array:
        """Leg angles, shape (n_1, n_2, n_3, 3), rad."""
        return self.fields.angle

    @property
    def determinant(self) -> Array:
        """Of the scaled Jacobian; its sign is the side of the singularities."""
        return self.fields.determinant

    @property
    def conditioning(self) -> Array:
        """1/cond of the scaled Jacobian: 0 at a singularity, 1 at best."""
        return self.fields.conditioning

    @property
    def transmission(self) -> Array:
        """Load carried per unit of actuator force; see `rps_pin.rps.workspace.measures`."""
        return self.fields.transmission

    @property
    def inside(self) -> Bools:
        """Whether a point is in the workspace."""
        return np.asarray(self.reason == 0)

    def mask(self, reason: Reason) -> Bools:
        """Return where any of the given reasons holds; for `Reason.INSIDE`, `inside`."""
        if reason is Reason.INSIDE:
            return self.inside
        return np.asarray((self.reason & np.uint16(reason)) != 0)

    def counts(self) -> dict[Reason, int]:
        """Return how many points are inside, and how many each single reason puts out.

        A point with several reasons counts under each of them.
        """
        return {
            reason: int(np.count_nonzero(self.mask(reason))) for reason in (Reason.INSIDE, *Reason)
        }

    def stroke_used(self) -> Array:
        """Return each leg's place in its stroke, shape (n_1, n_2, n_3, 3): 0 short, 1 long.

        Raises
        ------
        InputError
            If the robot has no upper limit of leg length: then there is no stroke.
        """
        shortest, longest = self.parameters.leg_length_limits
        if not math.isfinite(longest):
            raise InputError("leg_length_limits has no upper end, so that there is no stroke")
        return (self.length - shortest) / (longest - shortest)

    def plane(self, axis: int, value: float) -> Workspace:
        """Return the slice of the grid nearest to a value on one axis, shape 1 there.

        Parameters
        ----------
        axis
            0, 1 or 2: leg lengths 1, 2, 3, or z, tilt_x, tilt_y.
        value
            m or rad, within the axis.

        Raises
        ------
        InputError
            If there is no such axis, or the value lies beyond its ends.
        """
        if axis not in (0, 1, 2):
            raise InputError(f"axis = {axis!r}; it must be 0, 1 or 2")
        values = self.grid.axes[axis]
        nearest = nearest_value(values, value, f"axis {axis}")
        part = slice(nearest, nearest + 1)
        where = tuple(part if i == axis else slice(None) for i in range(3))
        first, second, third = (a[part] if i == axis else a for i, a in enumerate(self.grid.axes))
        grid = Grid(self.grid.kind, (first, second, third))
        return replace(self, grid=grid, fields=self.fields.part(where))
