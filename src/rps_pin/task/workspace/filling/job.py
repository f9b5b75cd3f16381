"""A workspace to be computed block by block: its start, checked, and what a block is made of."""

from __future__ import annotations

import copy
import threading
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rps_pin.arrays import Array
from rps_pin.errors import (
    CompileError,
    InputError,
    RPSPinError,
    SingularityError,
    UnreachableError,
)
from rps_pin.task.start import started
from rps_pin.task.task import Task
from rps_pin.task.workspace.evaluate import MIN_CONDITIONING, Evaluation, TaskFields, gains_of
from rps_pin.task.workspace.filling.continuation import continued
from rps_pin.task.workspace.filling.division import Division
from rps_pin.task.workspace.filling.flood import Seeds, Work, filled
from rps_pin.task.workspace.grids import TaskGrid
from rps_pin.validation import non_negative_number, real

#: Points whose fields are computed at a time.
_BATCH = 16_384
#: A start whose conditioning is below this decides no side of a singularity.
_SINGULAR_START = 1e-9
#: How far beyond the ends of an axis a start may be by rounding, in its largest value.
_ROUNDING = 1e-9


class Found(NamedTuple):
    """The points of a block that were reached."""

    at: NDArray[np.int32]
    """Flat indices in the block, shape (n,)."""
    fields: TaskFields
    """Fields there, shape (n, ...)."""
    beside: tuple[Seeds, ...]
    """Points reached beyond each face; see `flood.Filled`."""


class Job:
    """A workspace to be computed.

    Any number of threads may compute blocks of it. Arguments and errors are those of `workspace`;
    fields of more than `most_bytes` are refused. With `settled` generated code is waited for.
    """

    def __init__(
        self,
        task: Task,
        grid: TaskGrid,
        *,
        start: ArrayLike | None = None,
        min_conditioning: float = MIN_CONDITIONING,
        holding: bool = False,
        clearance: float | None = None,
        most_bytes: float = np.inf,
        settled: bool = False,
        **options: Any,
    ) -> None:
        _refuse_other_grid(task, grid)
        self.min_conditioning = real(min_conditioning)
        if not 0 <= self.min_conditioning <= 1:
            raise InputError(f"min_conditioning = {min_conditioning}; it must be from 0 to 1")
        if clearance is not None:
            clearance = non_negative_number(clearance, "clearance", "m")
        self.task = task
        options |= {"holding": bool(holding), "clearance": clearance}
        if settled:
            settle(task, options)
        self.start, q = _started(task, grid, start)
        self.grid = grid.holding(self.start)
        self._arguments = _side(task, q, self.start), self.min_conditioning
        self.options = options
        self.evaluation = Evaluation(task, *self._arguments, **options)
        per_point = self.evaluation.bytes_per_point
        if grid.size * per_point > most_bytes:
            raise InputError(
                f"{grid.size:.3g} points of {per_point} bytes do not go into memory; at most "
                f"{most_bytes:.2g} bytes do, and workspace_to_file computes more"
            )
        self.first = _nearest(self.grid, self.start)
        #: The configuration at the point of the grid at which it begins, shape (nq,).
        self.q = _reached(task, self.grid, self.first, q)
        self.division = Division(self.grid.shape)
        self._own, self._local = threading.get_ident(), threading.local()

    def compute(self, work: Work) -> Found:
        """Return what is found in a block."""
        task, evaluation = self._of_this_thread()
        found = filled(task, self.grid, self.division, work)
        fields = evaluation.empty((len(found.at),))
        for begin in range(0, len(found.at), _BATCH):
            part = slice(begin, begin + _BATCH)
            computed = evaluation.fields(found.q[part], found.x[part])
            for field, values in zip(fields, computed, strict=True):
                field[part] = values
        return Found(found.at, fields, found.beside)

    def __getstate__(self) -> dict[str, Any]:
        """Return all but generated code and scratch memory, which each process has of its own."""
        state = self.__dict__.copy()
        for name in ("evaluation", "_own", "_local"):
            del state[name]
        compiled = self.task.compile_options if self.task.compiled else None
        return state | {"task": self.task.interpreted(), "_compiled": compiled}

    def __setstate__(self, state: dict[str, Any]) -> None:
        compiled = state.pop("_compiled")
        self.__dict__.update(state)
        if compiled is not None:
            self.task = self.task.compile(**compiled)
        self.evaluation = Evaluation(self.task, *self._arguments, **self.options)
        self._own, self._local = threading.get_ident(), threading.local()
        settle(self.task, self.options)

    def _of_this_thread(self) -> tuple[Task, Evaluation]:
        """Return the task and its evaluation with scratch memory of this thread."""
        if threading.get_ident() == self._own:
            return self.task, self.evaluation
        local: Any = self._local
        if not hasattr(local, "parts"):
            task = copy.deepcopy(self.task)
            local.parts = task, Evaluation(task, *self._arguments, **self.options)
        parts: tuple[Task, Evaluation] = local.parts
        return parts


def settle(task: Task, options: Mapping[str, Any]) -> None:
    """Wait for generated code that is being built: all blocks are to be computed by the same.

    Code for batches rounds in another way than that for samples, which answers meanwhile.
    `options` are those of `Evaluation`.
    """
    if not task.compiled:
        return
    from rps_pin.codegen.calls import LARGE_BATCH  # noqa: PLC0415 (only with generated code)

    q, x = (np.tile(one, (LARGE_BATCH, 1)) for one in (task.mechanism.home, task.home))
    continued(task, q, x, x)
    Evaluation(task, 1.0, 0.0, **options).fields(q, x)
    for engine in task.engines:
        with suppress(CompileError):  # the code that is there stays in use
            engine.wait()


def _refuse_other_grid(task: Task, grid: TaskGrid) -> None:
    if grid.coordinates != task.coordinates:
        raise InputError(
            f"the grid is of a task of {', '.join(grid.coordinates)}, not of one of "
            f"{', '.join(task.coordinates)}"
        )


def _started(task: Task, grid: TaskGrid, start: ArrayLike | None) -> tuple[Array, Array]:
    """Return the start's task coordinates (m,) and configuration (nq,)."""
    if start is None:
        return task.home, task.mechanism.home
    x, q = started(task, start)
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
