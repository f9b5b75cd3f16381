"""What `cuda_rates` runs on a card, in one file; and what the card's compiler says of registers.

    python -m benchmarks.cuda_case FILE.npz       # texts, states and the CPU's answers; a minute
    python -m benchmarks.cuda_case --registers    # a table of registers and spills, by nvcc

The robot is the 3-RPS of `generated_cases`, at different closed states; answers are those of
generated code on the CPU in double precision. The machine with the card needs neither Pinocchio
nor CasADi.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.cuda_rates import CHUNKS, STATES, STEP, STEPS
from benchmarks.generated_cases import MECHANISMS
from rps_pin import ClosedLoopModel
from rps_pin.codegen.cuda import source
from rps_pin.codegen.cuda.device import REALS
from rps_pin.codegen.engine.generated import GeneratedCode

Array = np.ndarray[Any, Any]


def write(path: Path) -> None:
    """Write texts, states and answers."""
    mechanism = MECHANISMS["3-RPS"]()
    kernels = list(texts(GeneratedCode(mechanism)))
    np.savez_compressed(path, kernels=np.array(json.dumps(kernels)), **states(mechanism))


def texts(code: GeneratedCode) -> Iterator[dict[str, Any]]:
    """Give the functions in both precisions; in double also in smaller parts."""
    usual = source.CHUNK
    for dtype, real in REALS.items():
        for chunk in CHUNKS if dtype == "float64" else CHUNKS[:1]:
            source.CHUNK = chunk
            for name in source.NAMES:
                unit = source.unit(code.functions, name, real)
                yield {
                    "name": name,
                    "dtype": dtype,
                    "chunk": chunk,
                    "text": unit.cuda(real),
                    "inputs": unit.function(name).inputs,
                    "outputs": unit.handed_out(name),
                }
    source.CHUNK = usual


def states(mechanism: ClosedLoopModel) -> dict[str, Array]:
    """Return closed states, forces and accelerations, and answers by NAME_OUTPUT."""
    cpu = mechanism.compile(functions=["dynamics", "kinematics", "simulation"])
    cpu.wait()
    rng, home = np.random.default_rng(0), mechanism.home
    lengths = home[mechanism.actuated_indices] + rng.uniform(-0.03, 0.03, (STATES, 3))
    q = cpu.complete(lengths, home, within_limits=False)
    v = cpu.velocity(q, rng.normal(size=(STATES, 3)))
    a = cpu.acceleration(q, v, rng.normal(size=(STATES, 3)))
    forces = cpu.inverse_dynamics(q, v, a)
    found = {"q": q, "v": v, "a": a, "tau": forces.tau}
    found |= {"h": np.array(STEP), "count": np.array(float(STEPS))}
    found["inverse_dynamics_tau"] = forces.tau
    found["inverse_dynamics_multipliers"] = forces.constraint_forces
    found["forward_dynamics_a"] = cpu.forward_dynamics(q, v, forces.tau)
    for k in range(STEPS):
        q, v = cpu.step(q, v, forces.tau, STEP)
        if k == 0:
            found |= {"step_q_next": q, "step_v_next": v}
    return found | {"motion_q_next": q, "motion_v_next": v}


# Registers ----------------------------------------------------------------------------------------

_SAYS = re.compile(
    r"Function properties for (\S+)\s+(\d+) bytes stack frame, (\d+) bytes spill stores, "
    r"(\d+) bytes spill loads"
)


def registers() -> Iterator[str]:
    """Give the lines of a table of what ptxas says of the functions, for sm_90."""
    yield "| robot, function | precision | registers | local memory | spilled: stored, loaded |"
    yield "|---|---|---|---|---|"
    for robot, count in (("3-RPS", 4), ("Stewart", 2)):
        code = GeneratedCode(MECHANISMS[robot]())
        for name in source.NAMES[:count]:
            for dtype, real in REALS.items():
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
    """Write the file, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("file", nargs="?", type=Path)
    parser.add_argument("--registers", action="store_true")
    options = parser.parse_args(arguments)
    if options.registers:
        for line in registers():
            print(line, flush=True)
    elif options.file:
        write(options.file)
    else:
        parser.error("name a FILE, or --registers")


if __name__ == "__main__":
    main()
