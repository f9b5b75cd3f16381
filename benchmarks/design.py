"""Candidates a second of `rps_pin.task.design`, with one process and with two.

    python benchmarks/design.py [CANDIDATES]

The Delta of the sample file: arm, rod and base radius, a cylinder of 125 points and a motion of 41
samples. Generated code is compiled before; the time is that of the generations, without the first,
in which the processes start.
"""

from __future__ import annotations

import os
import resource
import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from rps_pin.task.design import DescribedDesign, design, load_design

SAMPLE = Path(__file__).parents[1] / "src/rps_pin/cli/samples/design.yaml"


class Clock:
    """Times the generations after the first."""

    def __init__(self) -> None:
        self.wall = self.cpu = 0.0

    def __call__(self, generations: Iterable[int]) -> Iterator[int]:
        """Give the generations."""
        for generation in generations:
            if generation == 1:
                self.wall, self.cpu = time.perf_counter(), time.process_time()
            yield generation
        self.wall, self.cpu = time.perf_counter() - self.wall, time.process_time() - self.cpu


def rate(asked: DescribedDesign, candidates: int, workers: int) -> tuple[float, float]:
    """Return candidates a second and this process's CPU time, and print them."""
    clock, population = Clock(), 200
    design(
        asked.space,
        asked.requirements,
        asked.objectives,
        candidates=candidates + population,
        population=population,
        workers=workers,
        progress=clock,
    )
    found = candidates / clock.wall
    print(
        f"{workers} process{'es' * (workers > 1)}: {candidates} candidates in {clock.wall:.1f} s, "
        f"{found:.0f} a second; of this process {clock.cpu:.1f} s of CPU time"
    )
    return found, clock.cpu


def main() -> None:
    """Print the rates and their ratio."""
    candidates = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    asked = load_design(SAMPLE)
    rate(asked, 200, 1)  # compiles
    (one, whole), (two, serial) = rate(asked, candidates, 1), rate(asked, candidates, 2)
    load, cores = os.getloadavg()[0], len(os.sched_getaffinity(0))
    print(f"two processes: {two / one:.2f} times as many; load {load:.1f} on {cores} cores")
    # What is not in the workers is serial: Amdahl's law, for cores that nobody else uses.
    share = serial / whole
    print(
        f"by CPU time: {share:.1%} is serial, so {1 / (share + (1 - share) / 2):.2f} times as many"
    )
    print(f"memory of this process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10} MiB")


if __name__ == "__main__":
    main()
