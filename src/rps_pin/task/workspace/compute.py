"""The workspace of any mechanism with a task, in one assembly mode that is followed over a grid."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, RPSPinError, SingularityError, UnreachableError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.engine import PinocchioEngine
from rps_pin.task.paths.limits import Cone
from rps_pin.task.task import Task
from rps_pin.task.workspace.evaluate import MIN_CONDITIONING, Evaluation, TaskFields, gains_of
from rps_pin.task.workspace.flood import fronts
from rps_pin.task.workspace.grids import TaskGrid
from rps_pin.task.workspace.result import TaskWorkspace
from rps_pin.validation import non_negative_number, numbers, real

Progress = Callable[[Iterable[int]], Iterable[int]]

#: Memory that the fields of a workspace may take, bytes.
MOST_BYTES = 4e9
#: Points whose fields are computed at a time.
_BLOCK = 16_384
#: Steps of a progress bar.
_STEPS = 1000
#: A start whose conditioning is below this decides no side of a singularity.
_SINGULAR_START = 1e-9
#: How far beyond the ends of an axis a start may be by rounding, in its largest value.
_ROUNDING = 1e-9


@refuses_other_kinds
def workspace(
    task: Task,
    grid: TaskGrid,
    *,
    start: ArrayLike | None = None,
    min_conditioning: float = MIN_CONDITIONING,
    cones: Sequence[Cone] = (),
    holding: bool = False,
    clearance: float | None = None,
    ignore: Sequence[tuple[str, str]] = (),
    progress: Progress = iter,
) -> TaskWorkspace:
    """Return which points of a grid a mechanism reaches, why not the others, and fields over them.

    The assembly mode of the start is followed from point to point. A point is inside if it is
    reached so, every limit of positions is kept there, and it lies on the start's side of the type
    II singularities. Points beyond a limit or such a singularity are followed all the same, so that
    each has all its reasons, and parts of the workspace that broken limits keep apart are all
    found.

    Parameters
    ----------
    task
        The task; a compiled one (`Task.compile`) takes some microseconds a point, another some
        milliseconds.
    grid
        The points: `task_grid`.
    start
        Task coordinates (m,), followed straight from home, or a closed configuration (nq,), that
        decide the assembly mode; home if left out. One that is given must be within the grid's
        ends.
    min_conditioning
        Conditioning, 1/cond of K in one unit, below which a point counts as singular; from 0 to 1.
    cones
        Limits of balls and universal joints.
    holding
        Whether the actuators' forces at rest are computed: gravity, springs, what the mechanism
        carries.
    clearance
        Least distance of two links, m, of mechanisms with collision shapes; left out, links are not
        looked at. It takes some 0.1 ms a point.
    ignore
        Pairs of links, by name, that may be nearer.
    progress
        Wraps a loop, for a progress bar.

    Raises
    ------
    InputError
        If the grid is not one of this task or too large for memory, the start is outside the grid,
        or another argument is not what it should be; if links are to be looked at that have no
        shapes.
    MechanismError
        If there are fewer actuators than coordinates, or a cone's frame is unknown.
    ClosureError, SingularityError
        If the start cannot be reached from home, its loops are open, or it is singular.
    UnreachableError
        If the grid's point nearest to the start is not reached from it.
    """
    _refuse_other_grid(task, grid)
    least = real(min_conditioning)
    if not 0 <= least <= 1:
        raise InputError(f"min_conditioning = {min_conditioning}; it must be from 0 to 1")
    if clearance is not None:
        clearance = non_negative_number(clearance, "clearance", "m")
    x, q = _started(task, grid, start)
    grid = grid.holding(x)
    side = _side(task, q, x)
    evaluation = Evaluation(
        task, side, least, cones=cones, holding=bool(holding), clearance=clearance, ignore=ignore
    )
    if grid.size * evaluation.bytes_per_point > MOST_BYTES:
        raise InputError(
            f"{grid.size:.3g} points of {evaluation.bytes_per_point} bytes do not go into memory; "
            f"at most {MOST_BYTES:.2g} bytes do"
        )
    first = _nearest(grid, x)
    q = _reached(task, grid, first, q)
    flat = evaluation.empty((grid.size,))
    bar = _Bar(progress, grid.size)
    for front in fronts(task, grid, first, q):
        for begin in range(0, len(front.at), _BLOCK):
            part = slice(begin, begin + _BLOCK)
            computed = evaluation.fields(front.q[part], front.x[part])
            for field, values in zip(flat, computed, strict=True):
                field[front.at[part]] = values
            bar.add(len(front.at[part]))
    bar.close()
    fields = TaskFields._make(field.reshape(*grid.shape, *field.shape[1:]) for field in flat)
    name, actuated = task.mechanism.name or "mechanism", task.mechanism.actuated
    return TaskWorkspace(name, actuated, grid, x, least, evaluation.reasons, fields)


class _Bar:
    """A progress bar over points that are done in portions of any size."""

    def __init__(self, progress: Progress, size: int) -> None:
        self._steps, self._size, self._done, self._told = iter(progress(range(_STEPS))), size, 0, 0

    def add(self, points: int) -> None:
        """Tell that points are done."""
        self._done += points
        while self._told < _STEPS * self._done // self._size:
            next(self._steps, None)
            self._told += 1

    def close(self) -> None:
        """Tell that all is done."""
        for _ in self._steps:
            pass


def _refuse_other_grid(task: Task, grid: TaskGrid) -> None:
    if grid.coordinates != task.coordinates:
        raise InputError(
            f"the grid is of a task of {', '.join(grid.coordinates)}, not of one of "
            f"{', '.join(task.coordinates)}"
        )


def _started(task: Task, grid: TaskGrid, start: ArrayLike | None) -> tuple[Array, Array]:
    """Return the start's task coordinates (m,) and configuration (nq,)."""
    home = task.mechanism.home
    if start is None:
        return task.home, home
    m, nq = task.size, task.mechanism.model.nq
    given = numbers(start, "start", f"{m} task coordinates, or a configuration of {nq} numbers")
    if given.shape not in ((m,), (nq,)) or not np.isfinite(given).all():
        raise InputError(
            f"start = {shown(start)}: it must be {m} finite task coordinates "
            f"({', '.join(task.coordinates)}), or a configuration of {nq} numbers"
        )
    try:
        if given.shape == (m,):
            x, q = given, task.configuration(given, within_limits=False)
        else:
            q = PinocchioEngine(task.mechanism).closed(given)
            x = task.at(q)
    except RPSPinError as error:
        error.args = (f"the start: {error}", *error.args[1:])
        raise
    for name, axis, column in zip(grid.over, grid.axes, grid.columns, strict=True):
        slack = _ROUNDING * float(np.abs(axis).max())
        if not axis[0] - slack <= x[column] <= axis[-1] + slack:
            raise InputError(
                f"the start is outside the grid: {name} = {x[column]:.6g}, and the grid has "
                f"{axis[0]:.6g} to {axis[-1]:.6g}"
            )
    return x, q


def _side(task: Task, q: Array, x: Array) -> float:
    """Return the sign of the determinant at the start."""
    measured = gains_of(task, task.jacobian(q[None], x=x[None], errors="mask"))
    conditioning = float(measured.conditioning[0])
    if not conditioning >= _SINGULAR_START:
        raise SingularityError(
            f"the start is singular, so that it decides no assembly mode: its conditioning is "
            f"{conditioning:.3g}, and must be at least {_SINGULAR_START:.3g}",
            1 / max(conditioning, 1e-300),
            1 / _SINGULAR_START,
        )
    return float(np.sign(measured.determinant[0]))


def _nearest(grid: TaskGrid, x: Array) -> int:
    """Return the flat index of the grid's point nearest to task coordinates."""
    wanted = x[list(grid.columns)]
    each = [
        int(np.argmin(np.abs(axis - value))) for axis, value in zip(grid.axes, wanted, strict=True)
    ]
    return int(np.ravel_multi_index(each, grid.shape))


def _reached(task: Task, grid: TaskGrid, first: int, q: Array) -> Array:
    """Return the configuration at a point of the grid, continued from the start's."""
    goal = grid.points([first])[0]
    try:
        return task.configuration(goal, q, within_limits=False)
    except RPSPinError as error:
        where = ", ".join(
            f"{name} = {value:.6g}" for name, value in zip(task.coordinates, goal, strict=True)
        )
        raise UnreachableError(
            f"the grid's point nearest to the start, {where}, is not reached from it: {error}; "
            "give a start within the grid and the workspace"
        ) from error
