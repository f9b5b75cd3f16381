"""Units of generated C: kernels and routines, and the text of one file with entry points to them.

A `Kernel` is a `casadi.Function`; a `Routine` is a body of C with loops that calls kernels and
other routines. A `Unit` gives one file's text: for Python's calls (`Unit.library`), for other
programs (`Unit.c99`), and for CUDA (`Unit.cuda`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from itertools import accumulate
from typing import Any

from rps_pin.codegen.emit import CHUNK, emit, signature
from rps_pin.errors import InputError, did_you_mean

#: Bits of a sample's status.
NOT_FINITE, OPEN, SINGULAR = 1, 2, 4
#: An entry point has at most this many inputs and outputs together (MOST_ARGUMENTS in C too).
MOST_ARGUMENTS = 64
#: An entry point of more numbers computes one sample at a time: 8 lie on the stack otherwise.
MOST_NUMBERS = 50_000

_KEYWORDS = frozenset(
    {
        *("auto", "break", "case", "char", "class", "const", "continue", "default", "delete", "do"),
        *("double", "else", "enum", "extern", "float", "for", "goto", "if", "inline", "int"),
        *("long", "namespace", "new", "operator", "register", "restrict", "return", "short"),
        *("signed", "sizeof", "static", "struct", "switch", "template", "this", "typedef", "union"),
        *("unsigned", "void", "volatile", "while"),
    }
)


def _check_name(name: str) -> None:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or name in _KEYWORDS:
        raise InputError(f"{name!r} cannot name something in C: it must be an identifier of C")


@dataclass(frozen=True, eq=False)
class Kernel:
    """A `casadi.Function` of SX expressions, which becomes a C function of the same name.

    Parameters
    ----------
    function
        The function. A matrix is row-major in C, and dense.
    chunk
        About the largest number of statements of one C function.
    """

    function: Any
    chunk: int = CHUNK

    @property
    def name(self) -> str:
        """Return the function's name."""
        return str(self.function.name())

    @property
    def inputs(self) -> tuple[tuple[str, int], ...]:
        """Return the inputs' names and sizes."""
        f = self.function
        return tuple((f.name_in(i), f.numel_in(i)) for i in range(f.n_in()))

    @property
    def outputs(self) -> tuple[tuple[str, int], ...]:
        """Return the outputs' names and sizes."""
        f = self.function
        return tuple((f.name_out(i), f.numel_out(i)) for i in range(f.n_out()))

    @property
    def shapes(self) -> tuple[tuple[int, ...], ...]:
        """Return the shapes of inputs and outputs in NumPy: (n,) for a column, else (n, m)."""
        f = self.function
        every = [f.size_in(i) for i in range(f.n_in())]
        every += [f.size_out(i) for i in range(f.n_out())]
        return tuple((int(n),) if m == 1 else (int(n), int(m)) for n, m in every)

    @property
    def calls(self) -> tuple[str, ...]:
        """Return the functions it calls: none."""
        return ()

    def text(self) -> str:
        """Return the C text, in macros."""
        return emit(self.function, self.chunk)


@dataclass(frozen=True)
class Routine:
    """A C function with a body written by hand, which may call kernels and earlier routines.

    The body is C99, and C++ too, for CUDA. Numbers are of type REAL: one sample's, or those of
    several samples; so it compares only by the macros LT, LE, EQ, NE, AND, OR, NOT, which give a
    REAL, chooses by SELECT(condition, x, y), writes numbers as CONST(0.5), those that depend on
    the rounding error as PRECISE(in_double, in_single), and repeats a loop while ANY(condition),
    that of any of the samples. It calls a function as ``NAME(x0, ..., y0, ...)`` with pointers to
    inputs and outputs that do not overlap. A ROW is COLUMNS numbers of type REAL, of which
    ENTRY(row, j) is one; it is added, and multiplied by a REAL, as one. STORE(to, row) writes all.

    Parameters
    ----------
    name
        Of the C function.
    inputs, outputs
        Names of its pointers, and how many numbers they point to.
    body
        What stands between its braces.
    calls
        Names of the kernels and routines that it calls.
    matrices
        Shapes of those inputs and outputs that are matrices, row-major.
    before
        Text of C functions that only the body calls.
    """

    name: str
    inputs: tuple[tuple[str, int], ...]
    outputs: tuple[tuple[str, int], ...]
    body: str
    calls: tuple[str, ...] = ()
    matrices: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    before: str = ""

    @property
    def shapes(self) -> tuple[tuple[int, ...], ...]:
        """Return the shapes of inputs and outputs: (size,), or a matrix's."""
        every = (*self.inputs, *self.outputs)
        return tuple(self.matrices.get(name, (size,)) for name, size in every)

    def text(self) -> str:
        """Return the C text, in macros."""
        inputs, outputs = [name for name, _ in self.inputs], [name for name, _ in self.outputs]
        unused = [f"    (void){name};" for name in (*inputs, *outputs)]
        head = f"LOCAL {signature(self.name, inputs, outputs)}"
        return "\n".join([self.before, head, "{", *unused, self.body.strip("\n"), "}", ""])


@cache
def prelude(name: str) -> str:
    """Return the text of a file of the folder ``c``."""
    return (resources.files("rps_pin.codegen") / "c" / name).read_text("utf-8")


def _places(start: str, arguments: tuple[tuple[str, int], ...]) -> list[str]:
    """Return pointers to arrays that lie one after the other."""
    ends = accumulate((size for _, size in arguments), initial=0)
    return [f"{start} + {at}" for at, _ in zip(ends, arguments, strict=False)]


def _renamed(functions: list[Kernel | Routine], end: str) -> list[str]:
    """Return the functions' texts, with names that end in `end`: C's own stay free."""
    return [
        *(f"#define {one.name} {one.name}_{end}" for one in functions),
        *("", *(one.text() for one in functions)),
        *(f"#undef {one.name}" for one in functions),
        "",
    ]


#: A sine and a cosine of the same value, in two statements one after the other.
_SINE_AND_COSINE = re.compile(
    r"const REAL (\w+) = (SIN|COS)\((\w+)\);\s*const REAL (\w+) = (?!\2)(?:SIN|COS)\(\3\);"
)


def _sines_with_cosines(text: str) -> str:
    """Return a function's text with such pairs as one statement, ``SINCOS(x, sine, cosine);``."""

    def together(pair: re.Match[str]) -> str:
        first, name, value, second, *_ = pair.groups()
        sine, cosine = (first, second) if name == "SIN" else (second, first)
        return f"SINCOS({value}, {sine}, {cosine});"

    return _SINE_AND_COSINE.sub(together, text)


def batch_prelude() -> str:
    """Return what stands before the `Unit.batches` of units that share a text."""
    return "\n".join([prelude("scalar.h"), prelude("many.h")])


@dataclass(frozen=True)
class Unit:
    """One file of C: kernels and routines, and those of them that are entry points.

    Parameters
    ----------
    name
        Of the file, and what public names of `c99` begin with.
    kernels, routines
        The functions; a routine stands after those it calls.
    entries
        Names of functions with an entry point.
    checked
        Names of entries whose last output is `check`, 2 numbers: open, growth. An entry point does
        not hand them out; they become bits of its status.
    limit
        Largest growth that is not nearly singular.

    Raises
    ------
    InputError
        If a name is no identifier, stands twice, or is missing, or if an entry has too many
        arguments or a `check` that is not 2 numbers.
    """

    name: str
    kernels: tuple[Kernel, ...]
    routines: tuple[Routine, ...] = ()
    entries: tuple[str, ...] = ()
    checked: frozenset[str] = field(default_factory=frozenset)
    limit: float = 1e12

    def __post_init__(self) -> None:
        _check_name(self.name)
        before: dict[str, Kernel | Routine] = {}
        arguments: set[str] = set()
        for one in self.functions:
            _check_name(one.name)
            if one.name in before:
                raise InputError(f"unit {self.name} has two functions named {one.name}")
            for other in one.calls:
                if other not in before:
                    raise InputError(
                        f"{one.name} calls {other}, which does not stand before it in unit "
                        f"{self.name}{did_you_mean(other, before)}"
                    )
            before[one.name] = one
            if isinstance(one, Routine):
                for name, _ in (*one.inputs, *one.outputs):
                    _check_name(name)
                    arguments.add(name)
        if both := sorted(arguments & set(before)):
            raise InputError(f"unit {self.name} names an argument and a function {both[0]}")
        for name in (*self.entries, *self.checked):
            if name not in before:
                raise InputError(
                    f"unit {self.name} has no function {name}{did_you_mean(name, before)}"
                )
        for name in self.entries:
            self._check_entry(before[name])

    def _check_entry(self, one: Kernel | Routine) -> None:
        if one.name in self.checked and (not one.outputs or one.outputs[-1][1] != 2):
            raise InputError(
                f"the last output of {one.name} must be its check, 2 numbers; its outputs are "
                f"{dict(one.outputs)}"
            )
        count = len(one.inputs) + len(one.outputs)
        if count > MOST_ARGUMENTS:
            raise InputError(
                f"{one.name} has {count} inputs and outputs; an entry point has at most "
                f"{MOST_ARGUMENTS}"
            )

    def _has_lanes(self, name: str) -> bool:
        """Whether a group of samples of an entry finds room on the stack."""
        one = self.function(name)
        return sum(size for _, size in (*one.inputs, *one.outputs)) <= MOST_NUMBERS

    @property
    def functions(self) -> tuple[Kernel | Routine, ...]:
        """Return all kernels and routines."""
        return (*self.kernels, *self.routines)

    def function(self, name: str) -> Kernel | Routine:
        """Return a kernel or routine by its name."""
        return next(one for one in self.functions if one.name == name)

    def handed_out(self, name: str) -> tuple[tuple[str, int], ...]:
        """Return the names and sizes of an entry's outputs, without `check`."""
        outputs = self.function(name).outputs
        return outputs[:-1] if name in self.checked else outputs

    def _needed(self) -> Iterator[Kernel | Routine]:
        """Return the entries and what they call, in their order."""
        wanted = set(self.entries)
        for one in reversed(self.functions):
            if one.name in wanted:
                wanted.update(one.calls)
        return (one for one in self.functions if one.name in wanted)

    def local(self, end: str) -> str:
        """Return the entries and what they call as local functions, with names that end in `end`.

        To stand after ``scalar.h`` in a text with others.
        """
        parts = ["#undef PART", f"#define PART(name) name##_part_{end}"]
        return "\n".join([*parts, *_renamed(list(self._needed()), end)])

    # For Python ---------------------------------------------------------------------------------

    @property
    def symbols(self) -> tuple[str, ...]:
        """Return the names of the functions of `library` that Python calls."""
        return tuple(f"{name}_{end}" for name in self.entries for end in ("call", "many"))

    def library(self, *, lanes: bool = True) -> tuple[str, str]:
        """Return the two texts of a shared library, in double precision.

        For an entry NAME the first has ``int NAME_at(double *const *io)``, which computes one
        sample from arrays of inputs into arrays of outputs and returns the status, and ``void
        *NAME_call(void *self, void *const *arguments, long count, void *names)``, the code of a
        builtin function of Python (see `python_calls`). The second has ``void NAME_many(long n,
        const double *const *in, const long *stride, double *const *out, int *status)`` for n
        samples: input i of sample s begins at
        ``in[i] + s * stride[i]``, outputs follow each other, and status may be NULL.

        Parameters
        ----------
        lanes
            Whether NAME_many computes 8, 4 or 2 samples at once, in vectors of GNU C: it takes as
            long to compile as the first text. tcc leaves them out. Without the macro NO_MVEC, it
            uses functions of glibc's libmvec (sin, cos; from 2.35 on also tanh, atan2).
        """
        needed = list(self._needed())
        one = [prelude("scalar.h"), prelude("status.h"), prelude("python_call.h")]
        one += _renamed(needed, "scalar")
        one += [self._one(name) for name in self.entries]
        many = [prelude("scalar.h"), prelude("many.h")]
        if lanes:
            many += ["#if defined(__GNUC__) && !defined(__TINYC__)", prelude("lanes.h")]
            many += [*_renamed(needed, "lanes"), prelude("many_lanes.h")]
            with_lanes = [name for name in self.entries if self._has_lanes(name)]
            many += [*(self._group(name) for name in with_lanes), "#endif", ""]
        many += [self._many(name, lanes and self._has_lanes(name)) for name in self.entries]
        return "\n".join(one), "\n".join(many)

    def batches(self) -> list[str]:
        """Return NAME_many of the entries, sample by sample, to stand after `batch_prelude`."""
        return [self._many(name, False) for name in self.entries]

    def _one(self, name: str) -> str:
        one = self.function(name)
        outputs = self.handed_out(name)
        every = (*one.inputs, *outputs)
        arguments = [f"io[{i}]" for i in range(len(every))]
        bad = [f"status_not_finite(io[{i}], {size})" for i, (_, size) in enumerate(every) if size]
        at = f"int {name}_at(double *const *io)"
        lines = [f"{at};", at, "{", "    (void)io;"]
        if name in self.checked:
            lines.append("    double check[2];")
            arguments.append("check")
        lines.append(f"    {name}_scalar({', '.join(arguments)});")
        lines.append(f"    int status = {' | '.join(bad) or '0'};")
        if name in self.checked:
            lines.append(f"    status |= STATUS_OF_CHECK(check, {self.limit!r});")
        call = f"void *{name}_call(void *self, void *const *arguments, long count, void *names)"
        lines += ["    return status;", "}", f"{call};", call, "{"]
        lines += [f"    return py_call(self, arguments, count, names, {name}_at);", "}", ""]
        return "\n".join(lines)

    def _group(self, name: str) -> str:
        one = self.function(name)
        lines = [f"static void {name}_group(const REAL *x, REAL *y)", "{", "    (void)x, (void)y;"]
        arguments = [*_places("x", one.inputs), *_places("y", one.outputs)]
        return "\n".join([*lines, f"    {name}_lanes({', '.join(arguments)});", "}", ""])

    def _many(self, name: str, lanes: bool) -> str:
        one = self.function(name)
        outputs = self.handed_out(name)
        sizes = [size for _, size in (*one.inputs, *outputs)]
        lines = [
            f"int {name}_at(double *const *io);",
            f"void {name}_many(long n, const double *const *in, const long *stride,",
            "    double *const *out, int *status)",
            "{",
            f"    static const int sizes[] = {{{', '.join(map(str, sizes or [0]))}}};",
            f"    static const many_shape shape = {{{len(one.inputs)}, {len(outputs)}, sizes, "
            f"{int(name in self.checked)}, {self.limit!r}, {name}_at}};",
        ]
        if lanes:
            room = [max(1, sum(n for _, n in part)) for part in (one.inputs, one.outputs)]
            lines += [
                "#if defined(LANES)",
                "    if (n > 1) {",
                f"        REAL x[{room[0]}], y[{room[1]}];",
                f"        many_groups(&shape, n, in, stride, out, status, x, y, {name}_group);",
                "        return;",
                "    }",
                "#endif",
            ]
        lines.append("    many_scalar(&shape, n, in, stride, out, status);")
        return "\n".join([*lines, "}", ""])

    # For other programs -------------------------------------------------------------------------

    def prototype(self, name: str, real: str = "double") -> str:
        """Return the C declaration of an entry of `c99`, without its semicolon."""
        one = self.function(name)
        arguments = [f"const {real} {arg}[{max(1, size)}]" for arg, size in one.inputs]
        arguments += [f"{real} {arg}[{max(1, size)}]" for arg, size in self.handed_out(name)]
        return f"int {self.name}_{name}({', '.join(arguments) or 'void'})"

    def c99(self, real: str = "double", *, heading: str = "") -> str:
        """Return the text of a C99 file that needs only the C library's mathematics.

        It allocates nothing and has no variables outside functions. An entry NAME is
        ``int UNIT_NAME(const REAL input[SIZE], ..., REAL output[SIZE], ...)``, which returns a
        status; arrays are row-major and do not overlap.

        Parameters
        ----------
        real
            "double" or "float".
        heading
            Text before everything else: a comment, an ``#include`` of the header.
        """
        self._check_real(real)
        needed = list(self._needed())
        text = [heading] if heading else []
        text += ["#define SINGLE"] if real == "float" else []
        text += [prelude("scalar.h"), prelude("status.h")]
        text += _renamed(needed, "real")
        return "\n".join([*text, "", *(self._public(name, real) for name in self.entries)])

    def _public(self, name: str, real: str) -> str:
        one = self.function(name)
        outputs = self.handed_out(name)
        arguments = [arg for arg, _ in (*one.inputs, *outputs)]
        bad = [f"status_not_finite({arg}, {n})" for arg, n in (*one.inputs, *outputs) if n]
        declaration = self.prototype(name, real)
        lines = [f"{declaration};", declaration, "{", "    int status;"]
        checked = name in self.checked
        lines += ["    REAL check[2];"] if checked else []
        arguments += ["check"] if checked else []
        lines.append(f"    {name}_real({', '.join(arguments)});")
        lines.append(f"    status = {' | '.join(bad) or '0'};")
        lines += (
            [f"    status |= STATUS_OF_CHECK(check, CONST({self.limit!r}));"] if checked else []
        )
        return "\n".join([*lines, "    return status;", "}", ""])

    def _check_real(self, real: str) -> None:
        if real not in ("double", "float"):
            raise InputError(f"real = {real!r}: it must be 'double' or 'float'")

    # For CUDA -----------------------------------------------------------------------------------

    def cuda(self, real: str = "double") -> str:
        """Return the text of kernels of CUDA, one thread a sample; nvcc and NVRTC take it.

        An entry NAME is ``extern "C" __global__ void NAME_cuda(long long n, const REAL *x0,
        long long x0_entry, long long x0_sample, ..., REAL *y0, long long y0_entry,
        long long y0_sample, ..., int *status)``: entry k of input 0 of sample s is
        ``x0[k * x0_entry + s * x0_sample]``. A structure of arrays, of shape (size, n), has
        ``x0_entry = n`` and ``x0_sample = 1``, so that neighbouring threads read neighbouring
        numbers; an array of samples, of shape (n, size), has 1 and size; ``x0_sample = 0`` is the
        same for all samples. ``status`` may be NULL. Any number of threads and blocks will do. A
        thread reads all inputs of a sample before it writes: an output may lie where an input of
        the same sample is. Outputs of a sample whose status is not 0 are NaN.
        """
        self._check_real(real)
        needed = list(self._needed())
        text = ["#define SINGLE"] if real == "float" else []
        text += [prelude("cuda.h"), prelude("scalar.h"), prelude("status.h")]
        text += map(_sines_with_cosines, _renamed(needed, "real"))
        return "\n".join([*text, "", *(self._cuda(name) for name in self.entries)])

    def _cuda(self, name: str) -> str:
        one = self.function(name)
        outputs = self.handed_out(name)
        inputs = [(f"x{i}", size) for i, (_, size) in enumerate(one.inputs)]
        results = [(f"y{i}", size) for i, (_, size) in enumerate(outputs)]
        arguments = ["long long n"]
        for const, group in (("const ", inputs), ("", results)):
            for arg, _ in group:
                arguments += [f"{const}REAL *{arg}", f"long long {arg}_entry"]
                arguments += [f"long long {arg}_sample"]
        arguments.append("int *status")
        lines = [f'extern "C" __global__ void {name}_cuda({", ".join(arguments)})', "{"]
        lines.append("    for (long long s = FIRST_SAMPLE; s < n; s += SAMPLE_STEP) {")
        lines += [f"        REAL {arg}s[{max(1, size)}];" for arg, size in (*inputs, *results)]
        checked = name in self.checked
        lines += ["        REAL check[2];"] if checked else []
        every = [(arg, size) for arg, size in (*inputs, *results) if size]
        where = "{0}[k * {0}_entry + s * {0}_sample]"
        loop = "        for (int k = 0; k < {1}; ++k) "
        lines += [
            (loop + "{0}s[k] = " + where + ";").format(arg, size) for arg, size in inputs if size
        ]
        call = [f"{arg}s" for arg, _ in (*inputs, *results)] + (["check"] if checked else [])
        lines.append(f"        {name}_real({', '.join(call)});")
        bad = " | ".join(f"status_not_finite({arg}s, {size})" for arg, size in every) or "0"
        check = f" | STATUS_OF_CHECK(check, CONST({self.limit!r}))" if checked else ""
        lines += [f"        const int found = {bad}{check};"]
        lines += ["        if (status) status[s] = found;"]
        result = loop + where + " = found ? CONST(NAN) : {0}s[k];"
        lines += [result.format(arg, size) for arg, size in results if size]
        lines += ["    }", "}", ""]
        return "\n".join(lines)
