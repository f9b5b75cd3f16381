"""A task's closure equations over arrays and intervals, and the states that they are written about.

See `rps_pin.codegen.expressions.task_equations`. A state holds a configuration, and what the output
frame has that x does not say; y moves a state to another.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.constraints.rotation_vector import rotation_vector
from rps_pin.errors import CompileError
from rps_pin.numerics.intervals import Interval
from rps_pin.numerics.stumpff import bounds_at_ends
from rps_pin.task.task import Task

#: What c_1, c_2 and their slopes by r . r are for tasks without a rotation vector.
_NONE = [0.0] * 6
#: Newton's steps, and the largest error of what counts as closed, in characteristic lengths.
_STEPS, _CLOSED = 8, 1e-10
#: Levenberg's steps towards the least gap.
_LEVENBERG = 10
#: Newton's steps are no longer than this.
_LONGEST = 0.5


class Second(NamedTuple):
    """Second derivatives over boxes: middles and half widths, shape (n, rows, m + n, m + n)."""

    middle: Array
    half: Array
    closed: Bools
    """Whether all cosines are positive, shape (n,)."""


class Equations:
    """F(x, y) = 0 of a task, evaluated of many boxes at a time.

    Parameters
    ----------
    task
        The task.

    Raises
    ------
    MechanismError
        If its mechanism's equations are not as many as its unknowns.
    CompileError
        If CasADi is not installed.
    """

    def __init__(self, task: Task) -> None:
        try:
            from rps_pin.codegen.expressions.task_equations import TaskEquations  # noqa: PLC0415
        except ImportError as error:
            raise CompileError(
                f"boxes of a mechanism are certified with {error.name}: "
                "pip install 'rps-pin[compile]'",
                "",
            ) from error
        name, placement = task.output_frame
        model = task.mechanism.model
        frame = None if name is None else (model.getFrameId(name), placement)
        self.task = task
        self.symbols = TaskEquations(task.mechanism.system, task.coordinates, frame)
        self.unknowns = self.symbols.unknowns
        self.size, self.coordinates = self.symbols.y.numel(), self.symbols.x.numel()
        self._turning = self.symbols.turn is not None

    def function(self, *outputs: Any) -> Any:
        """Return an evaluator of expressions, of the inputs that `inputs` gives."""
        import casadi as ca  # noqa: PLC0415

        from rps_pin.codegen.evaluator import Evaluator  # noqa: PLC0415

        return Evaluator(ca.Function("equations", self.symbols.inputs, list(outputs)))

    @cached_property
    def _gaps(self) -> Any:
        return self.function(self.symbols.gaps)

    @cached_property
    def _slopes(self) -> Any:
        one = self.symbols
        return self.function(one.by_unknowns(one.gaps), one.by_task(one.gaps))

    @cached_property
    def _second(self) -> Any:
        one = self.symbols
        values, self._second_at = one.second(one.gaps)
        return self.function(values, one.cosines)

    def inputs(self, z: Array, x: Any, y: Any) -> list[Any]:
        """Return arguments: states (n, nz), and x (m, n) and y (unknowns, n), arrays or intervals.

        With intervals of x, y holds intervals too.
        """
        return [z.T, x, y, self._stumpff(z, x, y)]

    def _stumpff(self, z: Array, x: Any, y: Any) -> Any:
        if not self._turning:
            return _NONE
        squared: Any = 0.0
        unsaid = dict(zip(self.symbols.open_angular, self._open_angular, strict=True))
        for k, name in enumerate(("rx", "ry", "rz")):
            if k in unsaid:
                at, of_y = unsaid[k]
                r = z[:, at] + y[of_y]
            else:
                r = x[self.task.coordinates.index(name)]
            squared = squared + r * r
        if not isinstance(squared, Interval):
            squared = Interval(np.asarray(squared))
        low, high = bounds_at_ends(squared)
        c = [one.hull(other) for one, other in zip(low, high, strict=True)]
        slope = {n: 0.5 * (n * c[n + 2] - c[n + 1]) for n in range(1, 5)}
        found = [c[1], c[2], slope[1], slope[2]]
        found += [0.5 * (n * slope[n + 2] - slope[n + 1]) for n in (1, 2)]
        if isinstance(x, Interval):
            return found
        return [(one.lower + one.upper) / 2 for one in found]

    @cached_property
    def _open_angular(self) -> list[tuple[int, int]]:
        """Where unknown parts of r are, in the state and in y."""
        at = self.task.mechanism.model.nq + len(self.symbols.open_linear)
        count = len(self.symbols.open_angular)
        of_y = {one.z.start: one.y.start for one in self.unknowns}
        return [(k, of_y[k]) for k in range(at, at + count)]

    # Evaluation -----------------------------------------------------------------------------------

    def gaps(self, z: Array, x: Array, y: Array) -> Array:
        """Return F in floats, shape (n, rows), of x (n, m) and y (n, unknowns)."""
        (found,) = self._gaps(*self.inputs(z, x.T, y.T))
        return np.stack([np.broadcast_to(one, len(z)) for one in found], axis=-1)

    def largest_gaps(self, z: Array, x: Array) -> Array:
        """Return bounds of |F| at points, y = 0, rounding included: shape (n, rows)."""
        nothing = Interval(np.zeros((self.size, len(z))))
        (found,) = self._gaps(*self.inputs(z, Interval(x.T), nothing))
        sizes = [
            np.maximum(np.abs(one.lower), np.abs(one.upper)) if isinstance(one, Interval) else one
            for one in found
        ]
        return np.stack([np.broadcast_to(np.abs(one), len(z)) for one in sizes], axis=-1)

    def slopes_at(self, z: Array, x: Array) -> tuple[Array, Array]:
        """Return the Jacobians by y and x in floats, y = 0."""
        by_y, by_x = self._slopes(*self.inputs(z, x.T, np.zeros((self.size, len(z)))))
        n, m = self.size, self.coordinates
        return _matrices(by_y, n, n, len(z)), _matrices(by_x, n, m, len(z))

    def exact_slopes(self, z: Array, x: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Return the same, with bounds of their rounding errors: middles and half widths."""
        nothing = Interval(np.zeros((self.size, len(z))))
        by_y, by_x = self._slopes(*self.inputs(z, Interval(x.T), nothing))
        n, m = self.size, self.coordinates
        return middles(by_y, n, n, len(z)), middles(by_x, n, m, len(z))

    def second(self, z: Array, x: Interval, y: Interval) -> Second:
        """Return bounds of second derivatives over boxes of x, (m, n), and y, (unknowns, n)."""
        values, cosines = self._second(*self.inputs(z, x, y))
        count, size = len(z), self.coordinates + self.size
        closed = np.ones(count, dtype=bool)
        for one in cosines:
            closed &= (one.lower if isinstance(one, Interval) else np.asarray(one)) > 0.0
        middle, half = (np.zeros((count, self.size, size, size)) for _ in range(2))
        for value, (row, j, k) in zip(values, self._second_at, strict=True):
            low, high = (
                (value.lower, value.upper) if isinstance(value, Interval) else (value, value)
            )
            between = np.asarray((low + high) / 2)
            middle[:, row, j, k] = middle[:, row, k, j] = between
            most = np.maximum(high - between, between - low) * (1.0 + 1e-15)
            half[:, row, j, k] = half[:, row, k, j] = most
        return Second(middle, half, closed)

    # States ---------------------------------------------------------------------------------------

    def state(self, q: Array) -> Array:
        """Return the state of a configuration (nq,), shape (nz,)."""
        task, extra = self.task, []
        name, placement = task.output_frame
        if name is not None:
            at = pin.SE3(np.asarray(task.mechanism.frame_placement(q, name))) * placement
            r = rotation_vector(np.asarray(at.rotation))
            extra = [at.translation[k] for k in self.symbols.open_linear]
            extra += [r[k] for k in self.symbols.open_angular]
        return np.concatenate([q, np.asarray(extra, dtype=np.float64)])

    def moved(self, z: Array, y: Array) -> Array:
        """Return states (n, nz) moved by y, (n, unknowns)."""
        found = z.copy()
        for one in self.unknowns:
            here, by = z[:, one.z], y[:, one.y]
            if one.kind == "pair":
                c, s = np.cos(by), np.sin(by)
                first, second = here[:, :1], here[:, 1:]
                found[:, one.z] = np.hstack([c * first - s * second, s * first + c * second])
            elif one.kind == "quaternion":
                found[:, one.z] = _product(here, by / 2)
            else:
                found[:, one.z] = here + one.unit * by
        return found

    def apart(self, z: Array, other: Array) -> Array:
        """Return y that moves states (n, nz) to others; whole turns of joints are left out."""
        found = np.zeros((len(z), self.size))
        for one in self.unknowns:
            a, b = z[:, one.z], other[:, one.z]
            if one.kind == "pair":
                (c, s), (d, t) = a.T, b.T
                found[:, one.y] = np.arctan2(c * t - s * d, c * d + s * t)[:, None]
            elif one.kind == "quaternion":
                found[:, one.y] = _cayley_between(a, b)
            else:
                difference = (b - a) / one.unit
                if one.kind == "turn":
                    difference -= 2 * np.pi * np.round(difference / (2 * np.pi))
                found[:, one.y] = difference
        return found

    def closed(self, z: Array, x: Array) -> Array:
        """Return states near others that are closed at x, (n, m); NaN where none is found."""
        z = z.copy()
        active = np.arange(len(z))
        for _ in range(_STEPS):
            nothing = np.zeros((len(active), self.size))
            gaps = self.gaps(z[active], x[active], nothing)
            by_y, _ = self.slopes_at(z[active], x[active])
            step = -solved(by_y, gaps)
            size = np.abs(step).max(axis=-1, initial=0.0)
            with np.errstate(invalid="ignore", divide="ignore"):
                step *= np.minimum(1.0, _LONGEST / np.maximum(size, 1e-300))[:, None]
            z[active] = self.moved(z[active], step)
            active = active[~(size < 1e-9)]
            if not active.size:
                break
        gaps = np.abs(self.gaps(z, x, np.zeros((len(z), self.size)))).max(axis=-1, initial=0.0)
        z[~(gaps < _CLOSED * self.task.mechanism.characteristic_length)] = np.nan
        return z

    def nearest(self, z: Array, x: Array) -> tuple[Array, Array]:
        """Return states with small gaps at x, (n, m), from others; and the gaps' sizes, (n,).

        Levenberg's steps: they come to rest where the gaps are least, if not zero.
        """
        z, damping = z.copy(), np.full(len(z), 1e-3)
        unit = self.task.mechanism.characteristic_length
        still = np.zeros((len(z), self.size))
        gaps = self.gaps(z, x, still) / unit
        for _ in range(_LEVENBERG):
            by_y = self.slopes_at(z, x)[0] / unit
            normal = np.swapaxes(by_y, 1, 2) @ by_y + damping[:, None, None] * np.eye(self.size)
            step = -solved(normal, (gaps[:, None] @ by_y)[:, 0])
            size = np.abs(step).max(axis=-1, initial=0.0)
            step *= np.minimum(1.0, _LONGEST / np.maximum(size, 1e-300))[:, None]
            moved = self.moved(z, step)
            found = self.gaps(moved, x, still) / unit
            better = (found * found).sum(axis=-1) < (gaps * gaps).sum(axis=-1)
            z[better], gaps[better] = moved[better], found[better]
            damping *= np.where(better, 0.1, 10.0)
        return z, np.linalg.norm(gaps, axis=-1)


def solved(matrices: Array, right: Array) -> Array:
    """Return solutions of systems (n, k, k), right sides (n, k); NaN where there is none."""
    try:
        return np.asarray(np.linalg.solve(matrices, right[..., None])[..., 0])
    except np.linalg.LinAlgError:
        found = inverses(matrices) @ right[..., None]
        return np.asarray(found[..., 0])


def inverses(matrices: Array) -> Array:
    """Return inverses of matrices (n, k, k) in floats; NaN of singular ones."""
    try:
        return np.asarray(np.linalg.inv(matrices))
    except np.linalg.LinAlgError:
        finite = np.asarray(np.isfinite(matrices).all(axis=(-1, -2)))
        safe = np.where(finite[:, None, None], matrices, 0.0)
        regular = finite & (np.linalg.matrix_rank(safe) == safe.shape[-1])
        found = np.full(matrices.shape, np.nan)
        if regular.any():
            found[regular] = np.linalg.inv(matrices[regular])
        return found


def _matrices(entries: list[Any], rows: int, columns: int, n: int) -> Array:
    stacked = np.stack([np.broadcast_to(one, n) for one in entries], axis=-1)
    return np.asarray(stacked.reshape(n, rows, columns))


def middles(entries: list[Any], rows: int, columns: int, n: int) -> tuple[Array, Array]:
    """Return middles and half widths of matrices of intervals, rounded up: (n, rows, columns)."""
    low = [one.lower if isinstance(one, Interval) else one for one in entries]
    high = [one.upper if isinstance(one, Interval) else one for one in entries]
    lower, upper = _matrices(low, rows, columns, n), _matrices(high, rows, columns, n)
    middle = (lower + upper) / 2
    return middle, np.maximum(upper - middle, middle - lower) * (1.0 + 1e-15)


def _product(q: Array, a: Array) -> Array:
    """Return the quaternions q (a, 1), scaled to unit length, of rows (x, y, z, w)."""
    u, w = q[:, :3], q[:, 3:]
    vector = w * a + u + np.cross(u, a)
    found = np.hstack([vector, w - (u * a).sum(axis=-1, keepdims=True)])
    return np.asarray(found / np.linalg.norm(found, axis=-1, keepdims=True))


def _cayley_between(q: Array, other: Array) -> Array:
    """Return y with other = q (y / 2, 1), up to the sign; infinite at half a turn."""
    u, w, v, s = q[:, :3], q[:, 3:], other[:, :3], other[:, 3:]
    vector = w * v - s * u - np.cross(u, v)
    scalar = w * s + (u * v).sum(axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(2 * vector / scalar)
