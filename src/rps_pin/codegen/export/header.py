"""The header of exported C: every function with the shape, unit and order of its arguments."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from rps_pin import __version__
from rps_pin.codegen.export.names import quoted
from rps_pin.codegen.export.package import Function, Package
from rps_pin.codegen.units import NOT_FINITE, OPEN, SINGULAR

#: What an exported file's beginning has, by which it is known as one.
MARK = "written by rps-pin export c"
_WIDTH = 96
#: Name, value and meaning of each bit of the status.
STATUS = (
    ("NOT_FINITE", NOT_FINITE, "an argument or a result is infinite or NaN"),
    ("OPEN", OPEN, "the loops are open, or were not closed"),
    ("SINGULAR", SINGULAR, "the configuration is nearly singular"),
)


def heading(package: Package, file: str, what: str) -> str:
    """Return the comment that a file of C begins with, without its end."""
    first = f"/* {file}, {MARK} (rps_pin {__version__}, {package.real}): {what}"
    return "\n   ".join(textwrap.wrap(first, _WIDTH - 3, break_on_hyphens=False))


def header(package: Package) -> str:
    """Return the text of NAME.h."""
    guard = package.macro("H")
    title = f"{package.title}, a mechanism with closed loops."
    lines = [heading(package, f"{package.name}.h", title), ""]
    lines += _paragraph(
        "Units are SI: m, rad, s, kg, N. Arrays are row-major and must not overlap. Every function "
        "returns a status: 0, or a sum of the bits below; then its results are not to be used. "
        "Nothing is allocated, and nothing is kept between calls: functions may run in any number "
        "of threads and interrupts at once."
    )
    for note in package.notes:
        lines += ["", *_paragraph(note)]
    for order in package.orders:
        lines += ["", *_paragraph(f"{order.heading}:"), *_numbered(order.lines)]
    lines[-1] += " */"
    lines += [f"#ifndef {guard}", f"#define {guard}", ""]
    for key, value, what in package.constants:
        lines.append(f"#define {package.macro(key)} {value} /* {what} */")
    lines.append("")
    for key, value, what in STATUS:
        lines.append(f"#define {package.macro(key)} {value} /* {what} */")
    if package.parameters:
        lines += ["", *_parameters(package)]
    lines += ["", "#ifdef __cplusplus", 'extern "C" {', "#endif"]
    for function in package.functions:
        lines += ["", *_declaration(package, function)]
    lines += ["", "#ifdef __cplusplus", "}", "#endif", "", "#endif", ""]
    return "\n".join(lines)


def shape_of(package: Package, function: Function) -> Iterator[tuple[str, str, bool]]:
    """Return each argument's name, its shape in words, and whether it is a result."""
    one = package.unit.function(function.name)
    handed = len(one.inputs) + len(package.unit.handed_out(function.name))
    named = [*one.inputs, *one.outputs][:handed]
    for i, ((name, _), shape) in enumerate(zip(named, one.shapes, strict=False)):
        yield name, " x ".join(map(str, shape)), i >= len(one.inputs)


def _declaration(package: Package, function: Function) -> list[str]:
    lines = _paragraph(f"/* {function.sentence}", "")
    for name, shape, is_result in shape_of(package, function):
        arrow = "->" if is_result else "  "
        text = f"{arrow} {name} ({shape}): {function.arguments[name]}"
        lines += textwrap.wrap(text, _WIDTH, initial_indent="   ", subsequent_indent=" " * 9)
    lines[-1] += " */"
    prototype = package.unit.prototype(function.name, package.real)
    begin, _, rest = prototype.partition("(")
    # Lines end after arguments only.
    kept = f"{begin}({rest};".replace(" ", "\0").replace(",\0", ", ")
    wrapped = textwrap.wrap(kept, _WIDTH, subsequent_indent=" " * (len(begin) + 1))
    return [*lines, *(line.replace("\0", " ") for line in wrapped)]


def _parameters(package: Package) -> list[str]:
    """Return a macro that sets an array to the nominal numbers, and tells what they are."""
    name = package.macro("NOMINAL")
    count = package.macro("NP")
    lines = [f"/* const {package.real} parameters[{count}] = {name}; */", f"#define {name} \\"]
    lines.append("    { \\")
    end = len(package.parameters) - 1
    for i, (label, value) in enumerate(package.parameters):
        lines.append(f"        {value!r}{',' if i < end else ''} /* {i} {quoted(label)} */ \\")
    return [*lines, "    }"]


def _paragraph(text: str, indent: str = "   ") -> list[str]:
    return textwrap.wrap(
        text,
        _WIDTH,
        initial_indent=indent,
        subsequent_indent="   ",
        break_long_words=False,
        break_on_hyphens=False,
    )


def _numbered(lines: Sequence[str]) -> list[str]:
    return [f"     {i:>3} {line}" for i, line in enumerate(lines)]
