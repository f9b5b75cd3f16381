"""Rates of generated CUDA on an NVIDIA card, and its errors: a Markdown table.

    python -m benchmarks.cuda_case FILE.npz       # on a machine with the package and gcc
    python -m benchmarks.cuda_rates FILE.npz      # where the card is; below two minutes
    python -m benchmarks.cuda_rates FILE.npz --scan     # also with other launches; below two more

Where the card is, only CuPy and NumPy are needed, and ``src`` on the path. All arrays have entries
apart. Times are the card's own, of launches only, medians of several. Errors are those of all
numbers of 4096 states against generated code on the CPU in double precision, over the largest one.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rps_pin.codegen.cuda import device

STATES, SAMPLES = 4096, 2**22
STEP, STEPS = 1e-4, 20
ROUNDS = 7
#: What is shown for a function, what a sample counts for, and goals a second in double precision.
SHOWN = {
    "inverse_dynamics": ("inverse dynamics", 1, 5e9),
    "forward_dynamics": ("forward dynamics", 1, 3e9),
    "step": ("RK4 steps with projection, one a launch", 1, 5e8),
    "motion": (f"RK4 steps with projection, {STEPS} a launch", STEPS, 5e8),
}
#: Largest functions, in statements: the usual one first, and what --scan compares.
CHUNKS = (8000, 2000, 500)
#: Threads of a block, registers of a thread (0: any) and statements of a function for --scan.
SCAN = [(128, 0, 8000), (256, 0, 8000), (64, 168, 8000), (64, 128, 8000), (64, 0, 2000)]
SCAN += [(64, 0, 500), (64, 168, 500)]


class Case:
    """The functions of a file, called on arrays of the card."""

    def __init__(self, cupy: Any, path: Path) -> None:
        self._cupy = cupy
        with np.load(path) as file:
            self.kernels = json.loads(str(file["kernels"]))
            self.arrays = {name: file[name] for name in file.files if name != "kernels"}
        self._on_card: dict[tuple[str, str], Any] = {}

    def input(self, name: str, dtype: str) -> Any:
        """Return an input of SAMPLES samples, neighbouring ones side by side."""
        key = name, dtype
        if key not in self._on_card:
            array = self._cupy.asarray(self.arrays[name], dtype=dtype)
            if array.ndim:
                array = self._cupy.ascontiguousarray(array.T)
                array = self._cupy.tile(array, (1, SAMPLES // STATES)).T
            self._on_card[key] = array
        return self._on_card[key]

    def run(self, kernel: Mapping[str, Any]) -> tuple[float, float, float]:
        """Return samples a second, the largest relative error, and the time of the compiler, s."""
        name, dtype = kernel["name"], kernel["dtype"]
        began = time.perf_counter()
        function = device.DeviceFunction(
            self._cupy, name, dtype, kernel["text"], kernel["inputs"], kernel["outputs"]
        )
        took = time.perf_counter() - began
        given = [self.input(one, dtype) for one, _ in kernel["inputs"]]
        out, status = function(given)
        if bool(status.any()):
            raise SystemExit(f"{name}: {int((status != 0).sum())} samples are flagged")
        errors = []
        for (output, _), found in zip(kernel["outputs"], out, strict=True):
            right = self.arrays.get(f"{name}_{output}")
            if right is not None:
                error = np.abs(self._cupy.asnumpy(found[:STATES]) - right).max()
                errors.append(error / np.abs(right).max())
        rate = self._speed(lambda: function(given, (*out, status)))
        return rate * SHOWN[name][1], max(errors), took

    def _speed(self, launch: Callable[[], object]) -> float:
        """Return samples a second, by the card's clock."""
        events, times = self._cupy.cuda, []
        start, end = events.Event(), events.Event()
        for _ in range(ROUNDS):
            start.record()
            launch()
            end.record()
            end.synchronize()
            times.append(events.get_elapsed_time(start, end))
        return SAMPLES / (1e-3 * float(np.median(times)))


def table(case: Case) -> Iterator[str]:
    """Give the lines of the table of rates."""
    yield "| 3-RPS | precision | a second | goal | largest relative error | NVRTC |"
    yield "|---|---|---|---|---|---|"
    for kernel in case.kernels:
        if kernel["chunk"] == CHUNKS[0]:
            shown, _, goal = SHOWN[kernel["name"]]
            wanted = f"{goal:.0e}" if kernel["dtype"] == "float64" else ""
            rate, error, took = case.run(kernel)
            yield (
                f"| {shown} | {kernel['dtype']} | {rate:.3g} | {wanted} | {error:.1g} | "
                f"{took:.1f} s |"
            )


def scan(case: Case) -> Iterator[str]:
    """Give a table of rates in double precision with other launches and sizes of functions."""
    usual = device.THREADS, device.OPTIONS
    yield f"| threads | registers | statements | {' | '.join(SHOWN)} |"
    yield "|---" * (3 + len(SHOWN)) + "|"
    for threads, registers, chunk in SCAN:
        device.THREADS = threads
        device.OPTIONS = (*usual[1], *([f"--maxrregcount={registers}"] if registers else []))
        rates = [
            f"{case.run(kernel)[0]:.3g}"
            for kernel in case.kernels
            if (kernel["dtype"], kernel["chunk"]) == ("float64", chunk)
        ]
        yield f"| {threads} | {registers or 'any'} | {chunk} | {' | '.join(rates)} |"
    device.THREADS, device.OPTIONS = usual


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--scan", action="store_true")
    options = parser.parse_args(arguments)
    cupy = device.load_cupy()
    case = Case(cupy, options.file)
    card = cupy.cuda.runtime.getDeviceProperties(0)["name"].decode()
    print(f"{card}, CuPy {cupy.__version__}, {SAMPLES} samples\n", flush=True)
    for line in table(case):
        print(line, flush=True)
    if options.scan:
        print()
        for line in scan(case):
            print(line, flush=True)


if __name__ == "__main__":
    main()
