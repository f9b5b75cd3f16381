"""`design`: dimensions of a robot that meet requirements and are best in some objectives."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from importlib.metadata import version

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.numerics.block_runs import Workers, cores
from rps_pin.numerics.kept_blocks import KeptBlocks
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.design.measures import Measures, Measuring
from rps_pin.task.design.requirements import Objective, Requirements, objectives_of
from rps_pin.task.design.result import DesignResult
from rps_pin.task.design.search import PORTION, Portions, Search, best_of, measured
from rps_pin.task.design.space import Space
from rps_pin.task.design.violations import contradictions, violations
from rps_pin.validation import whole_number

Progress = Callable[[Iterable[int]], Iterable[int]]

#: Poses from which starting processes (a second or two each) pays.
_WORTH_PROCESSES = 500_000


@refuses_other_kinds
def design(
    space: Space,
    requirements: Requirements,
    objectives: Sequence[str | Objective],
    *,
    candidates: int = 10_000,
    seed: int = 0,
    population: int = 100,
    workers: int | None = None,
    executor: Executor | None = None,
    store: str | os.PathLike[str] | None = None,
    compiler: str = "auto",
    progress: Progress = iter,
) -> DesignResult:
    """Return the candidates that meet requirements and are best in one to three objectives.

    The search is NSGA-II (Deb et al., 2002) of pymoo: candidates that meet all requirements come
    first, then those that fail by less in sum; of the former, those that none is better than in all
    objectives. The same seed gives the same result, for any number of processes.

    Parameters
    ----------
    space
        What may vary: `DesignSpace`, or that of a 3-RPS.
    requirements
        What must hold.
    objectives
        One to three; names of measures or dimensions, or `Objective`.
    candidates
        How many are measured; rounded up to whole generations.
    seed
        Of the random numbers.
    population
        Candidates of a generation; multiples of 50 use two processes to the full.
    workers
        Processes; by default one for each core, or none of their own for small designs.
    executor
        Measures the candidates in place of processes of our own: any `concurrent.futures.Executor`,
        Dask's (``Client.get_executor()``) for many machines. It is not shut down.
    store
        A file's path: each generation is kept in a hidden folder beside it, so that the same call,
        after an interruption, goes on where it stopped, also with more candidates. The folder is
        removed at the end.
    compiler
        See `rps_pin.codegen.compile_mechanism`.
    progress
        Wraps the loop over the generations, for a progress bar.

    Raises
    ------
    InputError
        If pymoo is not installed, an argument is not possible, or no candidate meets all
        requirements: says by how much the best fails, and which two contradict each other.
    MechanismError, SingularityError
        If there are fewer actuators than coordinates; if home is singular.
    CompileError
        If there is no generated code.
    """
    asked = objectives_of(objectives)
    names = [one.name for one in space.dimensions]
    for one in asked:
        one.refuse_unknown(names, requirements)
    whole_number(candidates, "candidates"), whole_number(seed, "seed", 0)
    whole_number(population, "population", 4)
    if executor is not None and workers is not None:
        raise InputError("give either workers or an executor, not both")
    measuring = Measuring(space, requirements, compiler)
    count = whole_number(workers, "workers") if workers is not None else 1
    if workers is None and candidates * len(measuring.points) >= _WORTH_PROCESSES:
        count = cores()
    generations = -(-candidates // population)
    with ExitStack() as stack:
        kept = None
        if store is not None:
            description = _description(measuring, asked, seed, population)
            kept = stack.enter_context(KeptBlocks(store, description))
        pool = None
        if executor is not None or count > 1:
            own = count if executor is None else cores()
            pool = stack.enter_context(Workers(Portions(measuring), own, executor))
        run = _Run(measuring, asked, pool, kept)
        requirements_ = len(run.requirements)
        run.search = Search(space.dimensions, len(asked), requirements_, population, seed)
        for generation in progress(range(generations)):
            run.one(generation)
        return run.result(seed)


class _Run:
    """Generations of a design."""

    search: Search

    def __init__(
        self,
        measuring: Measuring,
        objectives: tuple[Objective, ...],
        workers: Workers | None,
        kept: KeptBlocks | None,
    ) -> None:
        self._measuring, self._objectives = measuring, objectives
        self._workers, self._kept = workers, kept
        self._names = [one.name for one in measuring.space.dimensions]
        self._values: list[Array] = []
        self._measures: list[Measures] = []
        nothing = Measures(*(np.empty(0) for _ in Measures._fields))
        #: Names of the requirements.
        self.requirements = tuple(violations(nothing, measuring.requirements, measuring.length))

    def one(self, generation: int) -> None:
        """Measure a generation, or take it from the store, and tell the search."""
        values = self.search.ask()
        measures = self._stored(generation, values)
        if measures is None:
            measures = measured(self._measuring, values, self._workers)
            if self._kept is not None:
                self._kept.put(generation, {"values": values} | measures._asdict())
        self._values.append(values)
        self._measures.append(measures)
        failed = violations(measures, self._measuring.requirements, self._measuring.length)
        self.search.tell(
            self._scores(values, measures, small=True), np.stack([*failed.values()], axis=-1)
        )

    def _stored(self, generation: int, values: Array) -> Measures | None:
        stored = None if self._kept is None else self._kept.get(generation)
        if stored is None or not np.array_equal(stored.pop("values", np.empty(0)), values):
            return None
        return Measures(**stored)

    def _scores(self, values: Array, measures: Measures, *, small: bool) -> Array:
        """Return the objectives (n, k); with a sign that makes all of them to be small."""
        dimensions = dict(zip(self._names, values.T, strict=True))
        return np.stack(
            [
                (-1.0 if small and one.maximised else 1.0)
                * one.of_candidates(measures._asdict(), dimensions)
                for one in self._objectives
            ],
            axis=-1,
        )

    def result(self, seed: int) -> DesignResult:
        """Return what was found."""
        values = np.concatenate(self._values)
        measures = Measures(*(np.concatenate(part) for part in zip(*self._measures, strict=True)))
        failed = violations(measures, self._measuring.requirements, self._measuring.length)
        worst = np.max([*failed.values()], axis=0)
        met = np.flatnonzero(worst <= 0)
        if not met.size:
            raise InputError(_impossible(measures, failed))
        scores = self._scores(values, measures, small=True)
        front = met[best_of(scores[met])]
        plain = self._scores(values, measures, small=False)
        return DesignResult(
            self._measuring, self._objectives, seed, values, measures, plain, failed, front
        )


def _impossible(measures: Measures, failed: dict[str, Array]) -> str:
    """Return why no candidate meets all requirements."""
    count = len(measures.unreached)
    if (measures.unreached > 1.0).all():
        nearest = 2.0 - float(measures.unreached.min())
        return (
            f"none of {count} candidates closes at the middle of the region: on the straight way "
            f"to it, of dimensions and coordinates, the best gets {nearest:.0%}"
        )
    total = np.sum([np.maximum(value, 0.0) for value in failed.values()], axis=0)
    best = int(np.argmin(total))
    by = [f"{name} by {value[best]:.4g}" for name, value in failed.items() if value[best] > 0]
    never = [name for name, value in failed.items() if not (value <= 0).any()]
    words = f"none of {count} candidates meets all requirements; the best fails {', '.join(by)}"
    if never:
        least = [f"{name} (by {failed[name].min():.4g} at least)" for name in never]
        words += f"; none meets {', '.join(least)}"
    for one, other in contradictions(failed)[:3]:
        words += f"; some meet {one} and some {other}, but none both"
    return words


def _description(
    measuring: Measuring, objectives: Sequence[Objective], seed: int, population: int
) -> dict[str, object]:
    """Return what decides the numbers of the generations."""
    return {
        "version": version("rps-pin"),
        "measuring": measuring.key,
        "objectives": [repr(one) for one in objectives],
        "seed": seed,
        "population": population,
        "portion": PORTION,
    }
