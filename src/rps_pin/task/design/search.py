"""The search: NSGA-II of pymoo, generation by generation, its candidates measured in batches.

The same seed asks for the same candidates where it is told the same; candidates are measured in
portions of one size, so that neither the number of processes nor an interruption changes the
result.
"""

from __future__ import annotations

import multiprocessing.resource_tracker
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor
from typing import Any

import numpy as np
from loky import ProcessPoolExecutor
from loky.backend import resource_tracker

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.interruption import end_with_parent, workers_without_signals
from rps_pin.task.design.dimensions import Dimension
from rps_pin.task.design.measures import Measures

#: Candidates that are measured as one batch.
PORTION = 25
#: Workers that may die before the work is given up.
_MOST_DEATHS = 3
#: The cores are shared out among processes: none of them shall take more than one.
_ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
#: What an objective of a candidate that was not measured is for the search, which looks at its
#: violations alone.
_NOT_MEASURED = 1e30


class Search:
    """Asks for generations of candidates, and is told how good they are.

    Parameters
    ----------
    dimensions
        The dimensions; those that are held are not varied.
    objectives, requirements
        How many there are.
    population
        Candidates of a generation.
    seed
        Of the random numbers.

    Raises
    ------
    InputError
        If pymoo is not installed.
    """

    def __init__(
        self,
        dimensions: Sequence[Dimension],
        objectives: int,
        requirements: int,
        population: int,
        seed: int,
    ) -> None:
        try:
            from pymoo.algorithms.moo.nsga2 import NSGA2  # noqa: PLC0415
            from pymoo.core.evaluator import Evaluator  # noqa: PLC0415
            from pymoo.core.problem import Problem  # noqa: PLC0415
            from pymoo.operators.sampling.lhs import LHS  # noqa: PLC0415
            from pymoo.problems.static import StaticProblem  # noqa: PLC0415
        except ImportError as error:
            raise InputError(
                f"a design needs pymoo: pip install rps-pin[design] ({error})"
            ) from None
        self._dimensions = tuple(dimensions)
        self._free = [k for k, one in enumerate(dimensions) if one.lower < one.upper]
        self._problem = Problem(
            n_var=len(self._free),
            n_obj=objectives,
            n_ieq_constr=requirements,
            xl=np.array([dimensions[k].lower for k in self._free]),
            xu=np.array([dimensions[k].upper for k in self._free]),
        )
        self._static, self._evaluator = StaticProblem, Evaluator
        self._algorithm = NSGA2(pop_size=population, sampling=LHS())
        self._algorithm.setup(self._problem, termination=("n_gen", 10**9), seed=seed, verbose=False)
        self._asked: Any = None

    def ask(self) -> Array:
        """Return the candidates of the next generation, shape (n, d)."""
        self._asked = self._algorithm.ask()
        free = np.asarray(self._asked.get("X"), dtype=np.float64)
        found = np.tile([one.lower for one in self._dimensions], (len(free), 1))
        found[:, self._free] = free
        for k, dimension in enumerate(self._dimensions):
            found[:, k] = dimension.snapped(found[:, k])
        return found

    def tell(self, objectives: Array, violations: Array) -> None:
        """Say how good the candidates are: objectives to be small (n, k), violations (n, c)."""
        F = np.where(np.isfinite(objectives), objectives, _NOT_MEASURED)
        G = np.maximum(violations, 0.0)
        self._evaluator().eval(self._static(self._problem, F=F, G=G), self._asked)
        self._algorithm.tell(infills=self._asked)


def best_of(objectives: Array) -> Array:
    """Return which of objectives to be small, (n, k), no other is better than in all, sorted."""
    order = np.lexsort(objectives.T[::-1])
    kept: list[int] = []
    for index in order:
        one = objectives[index]
        if kept:
            others = objectives[kept]
            if (others <= one).all(axis=1).any():
                continue
        kept.append(int(index))
    return np.array(kept, dtype=np.intp)


class Workers:
    """Measures candidates here, in processes of our own, or in those of an executor.

    Parameters
    ----------
    measure
        What measures a portion of candidates, (n, d).
    count
        Number of processes; one measures here.
    executor
        Any `concurrent.futures.Executor` in place of processes of our own.
    """

    def __init__(
        self, measure: Callable[[Array], Measures], count: int, executor: Executor | None
    ) -> None:
        self._measure, self._count, self._given = measure, count, executor
        self._pool: Any = executor
        self._deaths = 0

    def __call__(self, values: Array) -> Measures:
        """Return the measures of candidates (n, d), in their order."""
        portions = [values[k : k + PORTION] for k in range(0, len(values), PORTION)]
        parts = list(self._parts(portions))
        return Measures(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    def end(self, *, kill: bool) -> None:
        """End our own processes."""
        if self._given is None and self._pool is not None:
            self._pool.shutdown(kill_workers=kill)
            self._pool = None

    def _parts(self, portions: Sequence[Array]) -> Iterator[Measures]:
        if self._given is None and self._count == 1:
            return iter([self._measure(portion) for portion in portions])
        while True:
            try:
                with workers_without_signals():  # the first call starts them
                    if self._pool is None:
                        self._pool = _processes(self._count)
                    under_way = [
                        self._pool.submit(_measured, self._measure, one) for one in portions
                    ]
                return iter([one.result() for one in under_way])
            except BrokenExecutor:
                self._deaths += 1
                if self._given is not None or self._deaths > _MOST_DEATHS:
                    raise
                self.end(kill=True)


#: What this process measures with, by its identity: generated code is loaded once.
_KNOWN: dict[str, Callable[[Array], Measures]] = {}


def _measured(measure: Any, values: Array) -> Measures:
    """Measure in a worker, with the generated code of the calls before."""
    found: Measures = _KNOWN.setdefault(measure.key, measure)(values)
    return found


def _processes(count: int) -> Any:
    """Return an executor of processes of our own."""
    multiprocessing.resource_tracker.ensure_running()
    resource_tracker.ensure_running()
    return ProcessPoolExecutor(
        count, initializer=end_with_parent, initargs=(os.getpid(),), env=_ONE_THREAD
    )
