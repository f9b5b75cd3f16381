"""The page of use of exported C, and its CMake file."""

from __future__ import annotations

from rps_pin import __version__
from rps_pin.codegen.export.header import MARK, STATUS
from rps_pin.codegen.export.package import Package
from rps_pin.codegen.export.self_test import template

#: An example of a call is that of the first of these.
_SHOWN = ("inverse_dynamics", "gravity_forces", "forward_dynamics")


def cmake(package: Package) -> str:
    """Return the text of CMakeLists.txt."""
    return template("CMakeLists.txt.in").format(name=package.name, mark=MARK, version=__version__)


def page(package: Package) -> str:
    """Return the text of README.md."""
    single = package.real == "float"
    return template("README.md.in").format(
        mark=MARK,
        version=__version__,
        name=package.name,
        title=package.title,
        real="single" if single else "double",
        precision=", and single precision\nhas few digits to lose" if single else "",
        example=_example(package),
        statuses="\n".join(
            f"| `{package.macro(key)}` | {value} | {what} |" for key, value, what in STATUS
        ),
        notes="\n\n".join(package.notes),
        functions="\n".join(
            f"| `{package.name}_{one.name}` | {one.sentence} |" for one in package.functions
        ),
        orders="".join(
            f"\n## {order.heading}\n\n| | |\n|---|---|\n"
            + "\n".join(f"| {i} | {line} |" for i, line in enumerate(order.lines))
            + "\n"
            for order in package.orders
        ).rstrip("\n"),
    )


def _example(package: Package) -> str:
    """Return a call of one of the functions, as a block of code."""
    names = [one.name for one in package.functions]
    name = next((one for one in _SHOWN if one in names), names[0])
    function = package.unit.function(name)
    outputs = package.unit.handed_out(name)
    lines = [
        f"{package.real} {key}[{max(1, size)}]"
        + (f" = {package.macro('NOMINAL')}" if key == "parameters" else "")
        + ";"
        for key, size in (*function.inputs, *outputs)
    ]
    arguments = ", ".join(key for key, _ in (*function.inputs, *outputs))
    lines += ["/* set the arguments, then: */"]
    lines += [f"if ({package.name}_{name}({arguments}) != 0)", "    return stop_the_machine();"]
    return "\n".join(f"    {line}" for line in lines)
