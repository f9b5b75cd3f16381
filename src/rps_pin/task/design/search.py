"""The search: NSGA-II of pymoo, generation by generation, its candidates measured in batches.

The same seed asks for the same candidates where it is told the same; candidates are measured in
portions of one size, so that neither the number of processes nor an interruption changes the
result.
"""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from typing import Any

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.numerics.block_runs import Workers
from rps_pin.task.design.geometry.dimensions import Dimension
from rps_pin.task.design.measures import Measures, Measuring

#: Candidates that are measured as one batch.
PORTION = 25
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


class Portions:
    """Measures portions of candidates in any process, which loads generated code once."""

    def __init__(self, measuring: Measuring) -> None:
        self._key, self._pickled = measuring.key, pickle.dumps(measuring)

    def __call__(self, values: Array) -> dict[str, Array]:
        """Return the measures of candidates (n, d), by name."""
        if self._key not in _KNOWN:
            _KNOWN[self._key] = pickle.loads(self._pickled)
        return _KNOWN[self._key](values)._asdict()


#: What this process measures with, by its key.
_KNOWN: dict[str, Measuring] = {}


def measured(measuring: Measuring, values: Array, workers: Workers | None) -> Measures:
    """Return the measures of candidates (n, d), in their order, by workers if there are any."""
    portions = [values[k : k + PORTION] for k in range(0, len(values), PORTION)]
    if workers is None:
        parts = [measuring(portion)._asdict() for portion in portions]
    else:
        waiting = iter(portions)
        parts = []
        for _ in portions:
            workers.fill(waiting)
            parts.append(dict(workers.next()))
    return Measures(*(np.concatenate([part[name] for part in parts]) for name in Measures._fields))
