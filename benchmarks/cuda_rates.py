"""Rates of generated CUDA on an NVIDIA card, and what its compiler says of registers.

    python -m benchmarks.cuda_rates               # rates, with a card and CuPy; two minutes
    python -m benchmarks.cuda_rates --scan        # also with other launches and sizes of functions
    python -m benchmarks.cuda_rates --registers   # registers and spills, with nvcc only

The robot is the 3-RPS of `generated_cases`. All samples are different closed states; arrays have
entries apart. Times are the card's own, of launches only, medians of several. Errors are those of
all numbers of 4096 states against generated code on the CPU in double precision.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.generated_cases import MECHANISMS
from rps_pin.codegen.cuda import device, source
from rps_pin.codegen.cuda.mechanism import CudaMechanism
from rps_pin.codegen.engine.generated import GeneratedCode

STATES, SAMPLES = 4096, 2**22
STEP, STEPS = 1e-4, 20
ROUNDS = 7
ONE, MANY = "RK4 steps, one a launch", f"RK4 steps, {STEPS} a launch"
#: A second, on an H200 in double precision.
GOALS = {"inverse dynamics": 5e9, "forward dynamics": 3e9, MANY: 5e8}
#: What --scan changes: threads of a block, registers of a thread, statements of a function.
SCAN = [(64, 0, 8000), (128, 0, 8000), (256, 0, 8000), (64, 168, 8000), (64, 128, 8000)]
SCAN += [(64, 0, 500), (64, 168, 500), (64, 0, 2000)]

Array = np.ndarray[Any, Any]


class States:
    """Closed states, forces and accelerations, and what the CPU's code answers; (STATES, ...)."""

    def __init__(self) -> None:
        self.mechanism = MECHANISMS["3-RPS"]()
        cpu = self.mechanism.compile(functions=["dynamics", "kinematics", "simulation"])
        cpu.wait()
        rng = np.random.default_rng(0)
        home = self.mechanism.home
        lengths = home[self.mechanism.actuated_indices] + rng.uniform(-0.03, 0.03, (STATES, 3))
        self.q = cpu.complete(lengths, home, within_limits=False)
        self.v = cpu.velocity(self.q, rng.normal(size=(STATES, 3)))
        self.a = cpu.acceleration(self.q, self.v, rng.normal(size=(STATES, 3)))
        forces = cpu.inverse_dynamics(self.q, self.v, self.a)
        self.tau, self.multipliers = forces.tau, forces.constraint_forces
        after = self.q, self.v
        self.next: list[tuple[Array, Array]] = []
        for _ in range(STEPS):
            after = cpu.step(*after, self.tau, STEP)
            self.next.append(after)


def rates(scan: bool) -> Iterator[str]:
    """Give the lines of Markdown tables."""
    cupy, states = device.load_cupy(), States()
    name = cupy.cuda.runtime.getDeviceProperties(0)["name"].decode()
    yield f"{name}, {SAMPLES} samples:"
    yield ""
    yield "| 3-RPS | precision | a second | goal | largest relative error |"
    yield "|---|---|---|---|---|"
    for dtype in device.REALS:
        fast: CudaMechanism = states.mechanism.compile(device="cuda", dtype=dtype)
        for what, (call, results) in calls(fast, states).items():
            found = call(None)
            errors = [
                np.abs(cupy.asnumpy(one[:STATES]) - right).max() / np.abs(right).max()
                for one, right in results(found)
            ]
            rate = speed(cupy, lambda call=call, found=found: call(found))
            rate *= STEPS if what == MANY else 1
            goal = f"{GOALS[what]:.2g}" if dtype == "float64" and what in GOALS else ""
            yield f"| {what} | {dtype} | {rate:.3g} | {goal} | {max(errors):.1g} |"
            del found
    if scan:
        yield from scanned(cupy, states)


def calls(
    fast: CudaMechanism, states: States
) -> dict[str, tuple[Callable[[Any], Any], Callable[[Any], Sequence[tuple[Any, Array]]]]]:
    """Return what is measured, called with ``out``, and pairs of results and right answers."""
    q, v, a, tau = (
        fast.array(np.tile(one, (SAMPLES // STATES, 1)))
        for one in (states.q, states.v, states.a, states.tau)
    )
    h = fast.array(STEP)

    def with_out(name: str, *given: Any) -> Callable[[Any], Any]:
        return lambda out: getattr(fast, name)(*given, errors="mask", out=out)

    def moved(k: int) -> Callable[[Any], Sequence[tuple[Any, Array]]]:
        return lambda found: list(zip(found[:2], states.next[k], strict=True))

    return {
        "inverse dynamics": (
            with_out("inverse_dynamics", q, v, a),
            lambda f: [(f.tau, states.tau), (f.constraint_forces, states.multipliers)],
        ),
        "forward dynamics": (
            with_out("forward_dynamics", q, v, tau),
            lambda f: [(f.a, states.a)],
        ),
        ONE: (with_out("step", q, v, tau, h), moved(0)),
        MANY: (with_out("steps", q, v, tau, h, STEPS), moved(-1)),
    }


def speed(cupy: Any, launch: Callable[[], object]) -> float:
    """Return samples a second, from the card's clock."""
    start, end, times = cupy.cuda.Event(), cupy.cuda.Event(), []
    launch()
    for _ in range(ROUNDS):
        start.record()
        launch()
        end.record()
        end.synchronize()
        times.append(cupy.cuda.get_elapsed_time(start, end))
    return SAMPLES / (1e-3 * float(np.median(times)))


def scanned(cupy: Any, states: States) -> Iterator[str]:
    """Give a table of rates in double precision with other launches and sizes of functions."""
    names: list[str] = []
    for threads, registers, chunk in SCAN:
        with changed(threads, registers, chunk):
            fast = states.mechanism.compile(device="cuda")
            found = {}
            for what, (call, _) in calls(fast, states).items():
                out = call(None)
                rate = speed(cupy, lambda call=call, out=out: call(out))
                found[what] = rate * (STEPS if what == MANY else 1)
        if not names:
            names = list(found)
            yield ""
            yield f"| threads | registers | statements | {' | '.join(names)} |"
            yield "|---" * (3 + len(names)) + "|"
        figures = " | ".join(f"{found[name]:.3g}" for name in names)
        yield f"| {threads} | {registers or 'any'} | {chunk} | {figures} |"


@contextmanager
def changed(threads: int, registers: int, chunk: int) -> Iterator[None]:
    """Make CUDA code of another kind."""
    kept = device.THREADS, device.OPTIONS, source.CHUNK
    device.THREADS, source.CHUNK = threads, chunk
    if registers:
        device.OPTIONS = (*kept[1], f"--maxrregcount={registers}")
    try:
        yield
    finally:
        device.THREADS, device.OPTIONS, source.CHUNK = kept


# Registers ----------------------------------------------------------------------------------------

_SAYS = re.compile(
    r"Function properties for (\S+)\s+(\d+) bytes stack frame, (\d+) bytes spill stores, "
    r"(\d+) bytes spill loads"
)


def registers() -> Iterator[str]:
    """Give the lines of a table of what ptxas says of the functions, for sm_90."""
    yield "| robot, function | precision | registers | local memory | spilled: stored, loaded |"
    yield "|---|---|---|---|---|"
    robots = {name: MECHANISMS[name]() for name in ("3-RPS", "Stewart")}
    for robot, mechanism in robots.items():
        code = GeneratedCode(mechanism)
        for name in source.NAMES[: 4 if robot == "3-RPS" else 2]:
            for dtype, real in device.REALS.items():
                says = compiled(source.unit(code.functions, name, real).cuda(real))
                shown = "steps of one launch" if name == "motion" else name.replace("_", " ")
                yield (
                    f"| {robot}, {shown} | {dtype} | {says['registers']} | {says['stack']} B | "
                    f"{says['stores']} B, {says['loads']} B |"
                )


def compiled(text: str) -> Mapping[str, int]:
    """Return what ptxas says of a text's entry point and the functions that it calls."""
    nvcc = shutil.which("nvcc")
    if nvcc is None:
        raise SystemExit("no nvcc")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "unit.cu"
        path.write_text(text, "utf-8")
        command = [nvcc, "-arch=sm_90", "-cubin", "-Xptxas", "-v", str(path), "-o", f"{path}bin"]
        said = subprocess.run(command, check=True, capture_output=True, text=True).stderr
    parts = [tuple(map(int, one[1:])) for one in _SAYS.findall(said)]
    used = re.search(r"Used (\d+) registers", said)
    stack = re.search(r"(\d+) bytes cumulative stack size", said)
    assert used is not None
    return {
        "registers": int(used[1]),
        "stack": int(stack[1]) if stack else 0,
        "stores": sum(part[1] for part in parts),
        "loads": sum(part[2] for part in parts),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scan", action="store_true")
    parser.add_argument("--registers", action="store_true")
    options = parser.parse_args(arguments)
    for line in registers() if options.registers else rates(options.scan):
        print(line, flush=True)


if __name__ == "__main__":
    main()
