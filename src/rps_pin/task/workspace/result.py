"""The result of a workspace computation on a grid of a task's coordinates."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.numerics.bits import Flags, holds
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.workspace.evaluate import TaskFields
from rps_pin.task.workspace.grids import TaskGrid

#: The name under which points inside are counted.
INSIDE = "inside"


class Region:
    """Points of a grid of which some are inside."""

    grid: TaskGrid

    @property
    def inside(self) -> Bools:
        """Whether a point is inside, of the grid's shape."""
        raise NotImplementedError


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class TaskWorkspace(Region):
    """Fields over the points of a grid, of its shape (n_1, n_2, ...), SI units.

    Nothing is NaN: where no configuration is reached, the fields are zero.
    """

    mechanism: str
    """Name of the mechanism."""
    actuated: tuple[str, ...]
    """Names of the actuators."""
    grid: TaskGrid
    """The points, and where the other coordinates are held."""
    start: Array
    """Task coordinates (m,) that decide the assembly mode, m and rad."""
    min_conditioning: float
    """Conditioning below which a point counts as singular."""
    reasons: tuple[str, ...]
    """Names of the reasons, in the order of the bits of `reason`."""
    fields: TaskFields
    """As computed; each of its members is an attribute here."""

    @property
    def reason(self) -> Flags:
        """Bits why a point is out, 0 inside; bit k is that of ``reasons[k]``."""
        return self.fields.reason

    @property
    def actuators(self) -> Array:
        """Positions of the actuated joints, shape (..., na), m or rad."""
        return self.fields.actuators

    @property
    def gains(self) -> Array:
        """Singular values of K = d(actuators)/d(task) in one unit, falling, shape (..., m).

        Actuators' forces of norm 1 N make forces of the task that fill an ellipsoid: these are its
        semi-axes, N per N. Their inverses are those of the speeds at actuators' speeds of norm 1.
        """
        return self.fields.gains

    @property
    def conditioning(self) -> Array:
        """Least gain over the largest: 0 at a singularity, 1 at best."""
        return self.fields.conditioning

    @property
    def determinant(self) -> Array:
        """Of K in one unit; its sign is the side of the type II singularities."""
        return self.fields.determinant

    @property
    def stroke_left(self) -> Array:
        """Least way of an actuator to its limits over its stroke: 0.5 at best, negative beyond."""
        return self.fields.stroke_left

    @property
    def holding(self) -> Array:
        """Forces of the actuators at rest, shape (..., na), N or N m; (..., 0) if not asked for."""
        return self.fields.holding

    @property
    def force_share(self) -> Array:
        """Largest force of each actuator under payload and wrenches, over its limit, (..., na)."""
        return self.fields.force_share

    @property
    def speed_share(self) -> Array:
        """Largest speed of each actuator at the speeds asked for, over its limit, (..., na)."""
        return self.fields.speed_share

    @property
    def force_left(self) -> Array:
        """Share of the limits of force that is left, shape (...): that of the actuator with least.

        1 where nothing is demanded, negative beyond a limit, minus infinity at a singularity.
        """
        return np.asarray(1 - self.force_share.max(axis=-1, initial=0.0))

    @property
    def speed_left(self) -> Array:
        """Share of the limits of speed that is left, shape (...); as `force_left`."""
        return np.asarray(1 - self.speed_share.max(axis=-1, initial=0.0))

    @property
    def inside(self) -> Bools:
        """Whether a point is in the workspace."""
        return np.asarray(self.reason == 0)

    def mask(self, reason: str) -> Bools:
        """Return where a reason holds, by its name; for ``"inside"``, `inside`.

        Raises
        ------
        InputError
            If there is no such reason.
        """
        if reason == INSIDE:
            return self.inside
        return holds(self.reason, self.reasons, reason)

    def counts(self) -> dict[str, int]:
        """Return how many points are inside, and how many each single reason puts out.

        A point with several reasons counts under each of them.
        """
        return {name: int(np.count_nonzero(self.mask(name))) for name in (INSIDE, *self.reasons)}

    def extents(self) -> dict[str, tuple[float, float]]:
        """Return the least and largest value of each axis inside, m or rad; none if none is."""
        inside, found = self.inside, {}
        for k, (name, axis) in enumerate(zip(self.grid.over, self.grid.axes, strict=True)):
            others = tuple(i for i in range(inside.ndim) if i != k)
            values = axis[inside.any(axis=others)]
            if len(values):
                found[name] = float(values[0]), float(values[-1])
        return found

    def plane(self, name: str, value: float) -> TaskWorkspace:
        """Return the slice of the grid nearest to a value of one axis, which is held there.

        Parameters
        ----------
        name
            Of the axis.
        value
            m or rad, within the axis.

        Raises
        ------
        InputError
            If there is no such axis, or the value lies beyond its ends.
        """
        k, number = self.grid.axis(name), self.grid.nearest(name, value)
        where = (slice(None),) * k + (number,)
        fields = TaskFields._make(field[where] for field in self.fields)
        return replace(self, grid=self.grid.without(name, number), fields=fields)
