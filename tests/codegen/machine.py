"""Machine code for tests of generated C, by the system's compiler, and functions of all kinds."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from rps_pin.codegen.build import compilers
from rps_pin.codegen.build.compilers import has_libmvec
from rps_pin.codegen.build.library import Library, load
from rps_pin.codegen.calls import Argument, CompiledFunction, Entry
from rps_pin.codegen.units import Unit

COMPILERS = [one for one in ("gcc", "clang") if shutil.which(one)]
MVEC = has_libmvec()
FLAGS = [*compilers.FLAGS, "-shared", "-march=native", *([] if MVEC else ["-DNO_MVEC"])]
STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1"]

if not COMPILERS:
    pytest.skip("no C compiler", allow_module_level=True)


def compiled(
    texts: str | Sequence[str],
    folder: Path,
    flags: Sequence[str] = (),
    compiler: str = "",
    suffix: str = ".c",
) -> Path:
    """Return the shared library of one or several texts."""
    sources = []
    for number, text in enumerate([texts] if isinstance(texts, str) else texts):
        sources.append(str(folder / f"{number}{suffix}"))
        Path(sources[-1]).write_text(text, "utf-8")
    library = folder / "library.so"
    given = FLAGS if suffix == ".c" else FLAGS[1:]  # without the language of C
    command = [compiler or COMPILERS[0], *given, *flags, *sources, "-o", str(library)]
    command += ["-lmvec", "-lm"] if MVEC else ["-lm"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr[:4000]
    return library


def loaded(
    unit: Unit, folder: Path, flags: Sequence[str] = (), *, lanes: bool = True
) -> dict[str, CompiledFunction]:
    """Return a unit's entry points as functions."""
    library = load(compiled(unit.library(lanes=lanes), folder, flags), unit.symbols, "gcc")
    return {name: called(unit, library, name) for name in unit.entries}


def called(unit: Unit, library: Library, name: str) -> CompiledFunction:
    """Return one entry point as a function."""
    one = unit.function(name)
    shapes = dict(zip((*one.inputs, *one.outputs), one.shapes, strict=True))
    inputs = [Argument(arg, shapes[arg, size]) for arg, size in one.inputs]
    outputs = [Argument(arg, shapes[arg, size]) for arg, size in unit.handed_out(name)]
    return CompiledFunction(name, inputs, outputs, Entry.of(library, name))


def reference(function: ca.Function, *inputs: Any) -> list[np.ndarray]:
    """Return casadi's own outputs for a batch of inputs, in NumPy's shapes."""
    samples = [function.call([ca.DM(x) for x in sample]) for sample in zip(*inputs, strict=True)]
    outputs = []
    for j in range(function.n_out()):
        values = np.array([sample[j].full() for sample in samples])
        outputs.append(values[..., 0] if function.size2_out(j) == 1 else values)
    return outputs


#: Operations of one and two operands; arguments lie where all are defined.
SINGLE = {
    **{
        name: getattr(ca, name)
        for name in (
            *("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
            *("asinh", "atanh", "exp", "log", "expm1", "log1p", "erf", "fabs", "sign"),
            *("floor", "ceil"),
        )
    },
    "acosh": lambda x: ca.acosh(1.5 + x),
    "neg": lambda x: -x,
    "sq": lambda x: x * x,
    "twice": lambda x: 2 * x,
    "inv": lambda x: 1 / x,
    "constpow": lambda x: x**1.7,
    "not": lambda x: ca.logic_not(ca.floor(2 * x)),
    "sign of a negative": lambda x: ca.sign(x - 0.5),
}
DOUBLE = {
    **{name: getattr(ca, name) for name in ("atan2", "fmin", "fmax", "copysign", "fmod", "hypot")},
    "add": lambda x, y: x + y,
    "sub": lambda x, y: x - y,
    "mul": lambda x, y: x * y,
    "div": lambda x, y: x / y,
    "pow": lambda x, y: x**y,
    "lt": lambda x, y: x < y,
    "le": lambda x, y: x <= y,
    "eq": lambda x, y: ca.floor(3 * x) == ca.floor(3 * y),
    "ne": lambda x, y: ca.floor(3 * x) != ca.floor(3 * y),
    "and": lambda x, y: ca.logic_and(ca.floor(2 * x), ca.floor(2 * y)),
    "or": lambda x, y: ca.logic_or(ca.floor(2 * x), ca.floor(2 * y)),
    "if_else": lambda x, y: ca.if_else(x < y, 3 * x, -y),
    "copysign of a negative": lambda x, y: ca.copysign(x, y - 0.5),
}


def every_operation() -> ca.Function:
    """Return a function with each operation once, of numbers in (0, 1)."""
    x, y = ca.SX.sym("x", 4), ca.SX.sym("y", 4)
    values = [one(x[k % 4]) for k, one in enumerate(SINGLE.values())]
    values += [one(x[k % 4], y[k % 3]) for k, one in enumerate(DOUBLE.values())]
    return ca.Function("every", [x, y], [ca.vertcat(*values)], ["x", "y"], ["z"])


def random_function(rng: np.random.Generator, count: int, name: str = "drawn") -> ca.Function:
    """Return a function of `count` random operations whose values stay moderate."""
    x = ca.SX.sym("x", 5)
    y = ca.SX.sym("y", 3, 2)
    values = [*ca.vertsplit(x), *ca.vertsplit(ca.vec(y))]
    for _ in range(count):
        i, j = rng.integers(max(0, len(values) - 60), len(values), 2)
        a, b = values[i], values[j]
        values.append(
            [
                lambda a, b: (a + b) / 2,
                lambda a, b: a * b,
                lambda a, b: a - 0.3 * b,
                lambda a, b: ca.sin(a) + ca.cos(a) * b,
                lambda a, b: ca.sqrt(1.0 + a * a),
                lambda a, b: ca.if_else(a < b, a, 0.5 * b),
                lambda a, b: a / (1.5 + b * b),
                lambda a, b: ca.fmax(a, b) - 0.25,
            ][rng.integers(8)](a, b)
        )
        if rng.random() < 0.3:
            values[-1] = ca.tanh(values[-1])
    last = values[-40:]
    matrix = ca.SX(3, 4)  # sparse
    matrix[0, 1], matrix[2, 0], matrix[1, 3] = last[0], last[1], 2.5
    return ca.Function(name, [x, y], [ca.vertcat(*last), matrix], ["x", "y"], ["z", "matrix"])
