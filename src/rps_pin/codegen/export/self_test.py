"""The self-test of exported C: states, the Pinocchio engine's answers, and their comparison."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib import resources

import numpy as np

from rps_pin.arrays import Array
from rps_pin.codegen.export.header import heading
from rps_pin.codegen.export.package import Function, Package
from rps_pin.errors import InputError

#: Differences of at least so many epsilons times the condition number are accepted; and of the
#: square root of the number of operations, whose errors add up like a random walk.
_LEAST_FACTOR = 32


def self_test(package: Package) -> str:
    """Return the text of NAME_test.c.

    Raises
    ------
    InputError
        If a case does not fit its function.
    """
    calls = "\n".join(f"    test_{one.name}();" for one in package.functions)
    tests = "\n".join(_test(package, one) for one in package.functions)
    return template("test.c.in").format(
        heading=heading(package, f"{package.name}_test.c", "self-test"),
        name=package.name,
        real=package.real,
        epsilon="DBL_EPSILON" if package.real == "double" else "FLT_EPSILON",
        factor=_LEAST_FACTOR,
        not_finite=package.macro("NOT_FINITE"),
        tests=tests,
        calls=calls,
    )


def template(name: str) -> str:
    """Return the text of a template."""
    folder = resources.files("rps_pin.codegen.export") / "templates"
    return (folder / name).read_text("utf-8")


def _test(package: Package, function: Function) -> str:
    one = package.unit.function(function.name)
    outputs = package.unit.handed_out(function.name)
    cases = function.cases
    if not cases:
        raise InputError(f"{function.name}: a self-test needs at least one state")
    for case in cases:
        sizes = [array.size for array in case.given]
        wanted = [size for _, size in one.inputs]
        if sizes != wanted or len(case.expected) != len(outputs):
            raise InputError(
                f"{function.name}: a case has arguments of sizes {sizes} and {len(case.expected)} "
                f"answers; they must be {wanted} and {len(outputs)}"
            )
    name, count = function.name, len(cases)
    text = []
    for i, (argument, size) in enumerate(one.inputs):
        rows = [case.given[i] for case in cases]
        text.append(_table(package.real, f"{name}_given_{argument}", max(1, size), rows))
    known = [
        (j, result, size)
        for j, (result, size) in enumerate(outputs)
        if size and all(case.expected[j] is not None for case in cases)
    ]
    for j, result, size in known:
        rows = [np.asarray(case.expected[j]) for case in cases]
        text.append(_table("double", f"{name}_wanted_{result}", size, rows))
        column = np.array([[case.condition[j]] for case in cases])
        text.append(_table("double", f"{name}_condition_{result}", 1, list(column)))
    results = [f"{result}_found" for result, _ in outputs]
    given = [f"{name}_given_{argument}[k]" for argument, _ in one.inputs]
    call = f"{package.name}_{name}({', '.join([*given, *results])})"
    factor = max(_LEAST_FACTOR, math.ceil(math.sqrt(function.operations)))
    text += [f"static void test_{name}(void)", "{"]
    text += [f"    REAL {result}_found[{max(1, size)}];" for result, size in outputs]
    text += [
        "    int k;",
        f'    begin("{name}", {count}, {factor});',
        f"    for (k = 0; k < {count}; ++k) {{",
    ]
    text += ["        int status;", "        START;", f"        status = {call};", "        STOP;"]
    text += ["        status_is(k, status, 0);"]
    text += [
        f'        compare("{result}", k, {result}_found, {name}_wanted_{result}[k], {size},\n'
        f"                {name}_condition_{result}[k][0]);"
        for _, result, size in known
    ]
    text += ["    }"]
    if one.inputs and one.inputs[0][1]:
        text += _bad(package, function, results)
    if function.opened:
        for (argument, size), value in zip(one.inputs, function.opened, strict=True):
            text.insert(0, _table(package.real, f"{name}_opened_{argument}", max(1, size), [value]))
        opened = [f"{name}_opened_{argument}[0]" for argument, _ in one.inputs]
        text += _flagged(package, name, [*opened, *results], "OPEN", "    ")
    return "\n".join([*text, "    end();", "}", ""])


def _bad(package: Package, function: Function, results: Sequence[str]) -> list[str]:
    """Return statements that call a function with NaN."""
    one = package.unit.function(function.name)
    (first, size), *rest = one.inputs
    name = function.name
    given = ["bad", *(f"{name}_given_{argument}[0]" for argument, _ in rest)]
    return [
        "    {",
        f"        REAL bad[{size}];",
        f"        for (k = 0; k < {size}; ++k) bad[k] = {name}_given_{first}[0][k];",
        "        bad[0] = (REAL)NAN;",
        *_flagged(package, name, [*given, *results], "NOT_FINITE", "        "),
        "    }",
    ]


def _flagged(
    package: Package, name: str, arguments: Sequence[str], bit: str, indent: str
) -> list[str]:
    """Return a statement that calls a function whose status must have a bit."""
    call, macro = f"{package.name}_{name}({', '.join(arguments)})", package.macro(bit)
    return [f"{indent}status_is(-{macro}, {call} & {macro}, {macro});"]


def _table(real: str, name: str, size: int, rows: Sequence[Array]) -> str:
    text = [f"static const {real} {name}[{len(rows)}][{size}] = {{"]
    for row in rows:
        numbers = [repr(float(number)) for number in np.ravel(row)] or ["0.0"]
        text.append("    {" + ", ".join(numbers) + "},")
    return "\n".join([*text, "};"])
