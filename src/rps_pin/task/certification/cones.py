"""Cones of any mechanism, bounded over boxes of which configurations are proven.

The angle between an axis n_a of one frame and n_b of another is below a limit l, l < pi, if

    c(x, y) = n_a . n_b - cos(l) > 0.

Over a box, y = S d + z with d = x - x_0 and |z| <= r, so that with bounds of the slopes over the
box, by the mean value theorem,

    c(x, y) is in c(x_0, 0) + (c_x + c_y S) d + c_y z.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import frame_id
from rps_pin.numerics.intervals import Interval
from rps_pin.task.certification.equations import Equations, middles
from rps_pin.task.certification.newton import Sheets
from rps_pin.task.paths.limits import Cone

if TYPE_CHECKING:
    from rps_pin.codegen.expressions.joints import Expression


class Rooms(NamedTuple):
    """Room of the cosine over boxes: middle + slopes . d, but for `error`; n boxes, k cones."""

    middle: Array
    """Shape (n, k)."""
    slopes: Array
    """By the coordinates of the task, shape (n, k, m)."""
    error: Array
    """Shape (n, k)."""


class Cones:
    """Cones of a mechanism whose configurations are proven.

    Parameters
    ----------
    equations
        Of the task.
    cones
        Limits of angles between axes of frames.

    Raises
    ------
    InputError
        If there is no such frame.
    """

    def __init__(self, equations: Equations, cones: Sequence[Cone]) -> None:
        import casadi as ca  # noqa: PLC0415

        self._equations, one = equations, equations.symbols
        rows = ca.vertcat(*(self._cosine(cone) for cone in cones))
        self._values = equations.function(rows)
        self._slopes = equations.function(one.by_task(rows), one.by_unknowns(rows))
        self._count = len(cones)

    def _cosine(self, cone: Cone) -> Expression:
        import casadi as ca  # noqa: PLC0415

        from rps_pin.codegen.expressions.joints import clean, sparse  # noqa: PLC0415

        symbols, model = self._equations.symbols, self._equations.task.mechanism.model
        axes = []
        for name, axis in ((cone.frame_a, cone.axis_a), (cone.frame_b, cone.axis_b)):
            frame = model.frames[frame_id(model, name, "cone")]
            local = sparse(clean(frame.placement.rotation)) @ sparse(np.asarray(axis))
            axes.append(symbols.world(int(frame.parentJoint))[0] @ local)
        return symbols.moved(ca.dot(*axes) - np.cos(cone.limit))

    def rooms(self, one: Sheets) -> Rooms:
        """Return the rooms over boxes."""
        equations, n, k = self._equations, len(one.x), self._count
        point = Interval(one.x.T), Interval(np.zeros((equations.size, n)))
        (values,) = self._values(*equations.inputs(one.z, *point))
        middle, error = (part[..., 0] for part in middles(values, k, 1, n))
        box = Interval((one.x - one.half).T, (one.x + one.half).T).widened(0.0)
        reach = (np.abs(one.slopes) @ one.half[:, :, None])[..., 0]
        y = ((reach + one.within) * (1.0 + 1e-12)).T
        by_x, by_y = self._slopes(*equations.inputs(one.z, box, Interval(-y, y)))
        x_mid, x_rad = middles(by_x, k, one.x.shape[1], n)
        y_mid, y_rad = middles(by_y, k, equations.size, n)
        S = one.slopes
        slopes = x_mid + y_mid @ S
        # Of floats: fewer than 100 operations with each entry.
        rounded = 1e-13 * (np.abs(x_mid) + np.abs(y_mid) @ np.abs(S))
        spread = x_rad + y_rad @ np.abs(S) + rounded
        sizes = np.abs(y_mid) + y_rad
        error = error + (spread @ one.half[:, :, None])[..., 0]
        error = error + (sizes @ one.within[:, :, None])[..., 0]
        return Rooms(middle, slopes, error * (1.0 + 1e-12))
