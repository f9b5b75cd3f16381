"""C99 text of a `casadi.Function` of scalar expressions (SX), in terms of macros.

The text is single assignment: every operation is one constant. It names no type and no function
of C, only macros (`REAL`, `CONST`, `SIN`, `SELECT`, ...), so that the same text is compiled for
double and float, for vectors of samples, and for CUDA; the macros are in the folder ``c``.
Matrices are row-major and dense, as in NumPy; casadi's are by columns and may be sparse.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from rps_pin.errors import InputError

#: A function of more statements than this is cut into chunks of about as many: a compiler's time
#: grows faster than the size of a function.
CHUNK = 500

#: Operations of casadi by the end of their name ``OP_...``, as C with operands {0} and {1}.
OPERATIONS = {
    "ADD": "{0} + {1}",
    "SUB": "{0} - {1}",
    "MUL": "{0} * {1}",
    "DIV": "{0} / {1}",
    "NEG": "-{0}",
    "SQ": "{0} * {0}",
    "TWICE": "{0} + {0}",
    "INV": "CONST(1.0) / {0}",
    "IF_ELSE_ZERO": "SELECT({0}, {1}, CONST(0.0))",
    "CONSTPOW": "POW({0}, {1})",
    **{
        name: f"{name}({{0}})"
        for name in (
            *("SQRT", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "SINH", "COSH", "TANH"),
            *("ASINH", "ACOSH", "ATANH", "EXP", "LOG", "EXPM1", "LOG1P", "ERF", "FABS", "SIGN"),
            *("FLOOR", "CEIL", "NOT"),
        )
    },
    **{
        name: f"{name}({{0}}, {{1}})"
        for name in (
            *("POW", "ATAN2", "FMIN", "FMAX", "FMOD", "HYPOT", "COPYSIGN"),
            *("LT", "LE", "EQ", "NE", "AND", "OR"),
        )
    },
}
#: Operations whose two operands may change places.
SYMMETRIC = frozenset({"ADD", "MUL", "EQ", "NE", "AND", "OR"})


@dataclass
class Listing:
    """A function's operations, each different one once, in an order in which they can be computed.

    A value is a number from 0 on; ``names[k]`` is "INPUT", "CONST" or a key of `OPERATIONS`, and
    ``operands[k]`` its (argument, position), its number, or its operands' values. A step computes
    a value ``k``, or is (output, position, value).
    """

    names: list[str] = field(default_factory=list)
    operands: list[tuple[Any, ...]] = field(default_factory=list)
    steps: list[int | tuple[int, int, int]] = field(default_factory=list)

    def needs(self, step: int | tuple[int, int, int]) -> tuple[int, ...]:
        """Return the values that a step reads."""
        return self.operands[step] if isinstance(step, int) else (step[2],)


@cache
def _names() -> dict[int, str]:
    """Return the names of casadi's operations by their numbers."""
    import casadi as ca  # noqa: PLC0415

    return {getattr(ca, name): name[3:] for name in dir(ca) if name.startswith("OP_")}


def positions(sparsity: Any) -> list[int]:
    """Return where casadi's nonzeros lie in a dense row-major array."""
    rows, columns = sparsity.get_triplet()
    width = sparsity.size2()
    return [row * width + column for row, column in zip(rows, columns, strict=True)]


def listing(function: Any) -> Listing:
    """Return the operations of a `casadi.Function` of SX expressions.

    Raises
    ------
    InputError
        For a function of MX expressions, and for an operation that C text is not written for.
    """
    name = function.name()
    if not function.is_a("SXFunction"):
        raise InputError(
            f"function {name} is a {function.class_name()}: C is written for functions of SX "
            "expressions only (casadi's expand() makes one of an MX function)"
        )
    where_in = [positions(function.sparsity_in(i)) for i in range(function.n_in())]
    where_out = [positions(function.sparsity_out(i)) for i in range(function.n_out())]
    found = Listing()
    known: dict[tuple[Any, ...], int] = {}
    work: dict[int, int] = {}  # the value that casadi's work vector holds at each place

    def value(key: str, operands: tuple[Any, ...], mark: object = None) -> int:
        number = known.setdefault((key, operands, mark), len(found.names))
        if number == len(found.names):
            found.names.append(key)
            found.operands.append(operands)
            if key in OPERATIONS:
                found.steps.append(number)
        return number

    names = _names()
    for k in range(function.n_instructions()):
        key = names[function.instruction_id(k)]
        if key == "OUTPUT":
            output, nonzero = function.instruction_output(k)
            source = work[function.instruction_input(k)[0]]
            found.steps.append((output, where_out[output][nonzero], source))
            continue
        target = function.instruction_output(k)[0]
        if key == "CONST":
            number = function.instruction_constant(k)
            # -0.0 == 0.0, and nan != nan: the text tells them apart
            work[target] = value(key, (number,), repr(number))
            continue
        operands = tuple(function.instruction_input(k))
        if key == "INPUT":
            work[target] = value(key, (operands[0], where_in[operands[0]][operands[1]]))
            continue
        operands = tuple(work[i] for i in operands)
        if key == "ASSIGN":
            work[target] = operands[0]
        elif key in OPERATIONS:
            if key in SYMMETRIC and operands[0] > operands[1]:
                operands = operands[::-1]
            work[target] = value(key, operands)
        else:
            raise InputError(
                f"function {name} uses the operation OP_{key} of casadi, which has no C text here; "
                f"those that have: {', '.join(sorted(OPERATIONS))}"
            )
    _share_reciprocals(found)
    found.steps = _pairs_together(found)
    return found


def _share_reciprocals(found: Listing) -> None:
    """Make quotients by the same value products with its reciprocal.

    casadi writes every product with ``1 / x`` as a quotient, and a division takes the time of
    several products.
    """
    denominators = {"DIV": 1, "INV": 0}  # which operand it is
    counts: dict[int, int] = {}
    for step in found.steps:
        if isinstance(step, int) and found.names[step] in denominators:
            below = found.operands[step][denominators[found.names[step]]]
            counts[below] = counts.get(below, 0) + 1
    reciprocals = {found.operands[k][0]: k for k, name in enumerate(found.names) if name == "INV"}
    steps: list[int | tuple[int, int, int]] = []
    written: set[int] = set()
    for step in found.steps:
        if not isinstance(step, int) or found.names[step] not in denominators:
            steps.append(step)
            continue
        below = found.operands[step][denominators[found.names[step]]]
        if counts[below] > 1:
            if below not in reciprocals:
                reciprocals[below] = len(found.names)
                found.names.append("INV")
                found.operands.append((below,))
            if below not in written:
                written.add(below)
                steps.append(reciprocals[below])
            if found.names[step] == "DIV":
                found.names[step] = "MUL"
                found.operands[step] = (found.operands[step][0], reciprocals[below])
                steps.append(step)
        else:
            steps.append(step)
    found.steps = steps


def _pairs_together(found: Listing) -> list[int | tuple[int, int, int]]:
    """Return the steps with a sine and cosine of the same value one after the other."""
    partner: dict[int, int] = {}
    first: dict[int, int] = {}
    for k, (name, operands) in enumerate(zip(found.names, found.operands, strict=True)):
        if name in ("SIN", "COS") and first.setdefault(operands[0], k) != k:
            partner[first[operands[0]]] = k
    later = set(partner.values())
    steps: list[int | tuple[int, int, int]] = []
    for step in found.steps:
        if isinstance(step, int):
            if step not in later:
                steps.append(step)
            if step in partner:
                steps.append(partner[step])
        else:
            steps.append(step)
    return steps


# Chunks -------------------------------------------------------------------------------------------


def _cuts(found: Listing, chunk: int) -> list[Sequence[int | tuple[int, int, int]]]:
    """Return the steps in parts of about `chunk`, cut where the fewest values are still needed."""
    steps = found.steps
    count = len(steps)
    if count <= chunk + chunk // 2:
        return [steps]
    last: dict[int, int] = {}
    for at, step in enumerate(steps):
        for k in found.needs(step):
            last[k] = at
    live = [0] * (count + 1)  # values computed before step `at` and read by it or later
    alive = 0
    ends: dict[int, int] = {}
    for at, step in enumerate(steps):
        live[at] = alive
        alive -= ends.pop(at, 0)
        if isinstance(step, int) and last.get(step, at) > at:
            alive += 1
            ends[last[step]] = ends.get(last[step], 0) + 1
    parts = []
    start = 0
    while count - start > chunk + chunk // 2:
        low, high = start + 3 * chunk // 4, start + 5 * chunk // 4
        stop = min(range(low, high), key=live.__getitem__)
        parts.append(steps[start:stop])
        start = stop
    return [*parts, steps[start:]]


def _slots(
    found: Listing, parts: list[Sequence[int | tuple[int, int, int]]]
) -> tuple[dict[int, int], int]:
    """Return the place in the work array of every value that a later part needs, and its length.

    A place is free again after the last part that reads it.
    """
    made: dict[int, int] = {}
    last: dict[int, int] = {}
    for number, part in enumerate(parts):
        for step in part:
            if isinstance(step, int):
                made[step] = number
            for k in found.needs(step):
                last[k] = number
    slots: dict[int, int] = {}
    free: list[int] = []
    ends: list[list[int]] = [[] for _ in parts]
    length = 0
    for number, part in enumerate(parts):
        for slot in ends[number - 1] if number else ():
            heapq.heappush(free, slot)
        for step in part:
            if isinstance(step, int) and last.get(step, number) > number:
                if free:
                    slots[step] = heapq.heappop(free)
                else:
                    slots[step] = length
                    length += 1
                ends[last[step]].append(slots[step])
    return slots, length


# Text ---------------------------------------------------------------------------------------------


def constant(number: float) -> str:
    """Return a number as C, read back as the same double."""
    if math.isnan(number):
        return "CONST(NAN)"
    if math.isinf(number):
        return "CONST(INFINITY)" if number > 0 else "(-CONST(INFINITY))"
    return f"CONST({number!r})" if math.copysign(1.0, number) > 0 else f"(-CONST({-number!r}))"


class _Part:
    """The text of one part, and what it uses: arguments, and the work array."""

    def __init__(self, found: Listing, slots: dict[int, int]) -> None:
        self.found = found
        self.slots = slots
        self.lines: list[str] = []
        self.ready: dict[int, str] = {}
        self.inputs: set[int] = set()
        self.outputs: set[int] = set()
        self.work = False

    def read(self, k: int) -> str:
        """Return a value's name, loaded at its first use."""
        if k in self.ready:
            return self.ready[k]
        name = self.found.names[k]
        if name == "CONST":
            text = constant(self.found.operands[k][0])
        else:
            text = f"v{k}"
            if name == "INPUT":
                argument, position = self.found.operands[k]
                self.inputs.add(argument)
                source = f"x{argument}[{position}]"
            else:
                self.work = True
                source = f"w[{self.slots[k]}]"
            self.lines.append(f"    const REAL {text} = {source};")
        self.ready[k] = text
        return text

    def add(self, step: int | tuple[int, int, int]) -> None:
        """Append a step's statement."""
        if not isinstance(step, int):
            output, position, k = step
            text = self.read(k)
            self.outputs.add(output)
            self.lines.append(f"    y{output}[{position}] = {text};")
            return
        operands = [self.read(k) for k in self.found.operands[step]]
        text = OPERATIONS[self.found.names[step]].format(*operands)
        self.lines.append(f"    const REAL v{step} = {text};")
        self.ready[step] = f"v{step}"
        if step in self.slots:
            self.work = True
            self.lines.append(f"    w[{self.slots[step]}] = v{step};")


def _zeros(function: Any) -> list[str]:
    """Return statements that set the structural zeros of sparse outputs."""
    lines = []
    for i in range(function.n_out()):
        sparsity = function.sparsity_out(i)
        size = sparsity.numel()
        empty = sorted(set(range(size)) - set(positions(sparsity)))
        if len(empty) > 16:
            lines.append(f"    for (int k = 0; k < {size}; ++k) y{i}[k] = CONST(0.0);")
        else:
            lines += [f"    y{i}[{position}] = CONST(0.0);" for position in empty]
    return lines


def emit(function: Any, chunk: int = CHUNK) -> str:
    """Return a function's C99 text.

    Parameters
    ----------
    function
        A `casadi.Function` of SX expressions, of any sparsity.
    chunk
        About the largest number of statements of one C function.

    Returns
    -------
    str
        ``LOCAL void NAME(const REAL *x0, ..., REAL *y0, ...)`` and what it calls. Arrays are dense
        and row-major; inputs and outputs must not overlap.

    Raises
    ------
    InputError
        For a function that is not of SX expressions, and for an operation without C text.
    """
    name = function.name()
    found = listing(function)
    cut = _cuts(found, chunk)
    slots, length = _slots(found, cut)
    parts = []
    for steps in cut:
        part = _Part(found, slots)
        for step in steps:
            part.add(step)
        parts.append(part)
    inputs = [f"x{i}" for i in range(function.n_in())]
    outputs = [f"y{i}" for i in range(function.n_out())]
    body = _zeros(function)
    text = []
    if len(parts) == 1:
        unused = [x for i, x in enumerate(inputs) if i not in parts[0].inputs]
        body += parts[0].lines
    else:
        used = set().union(*(part.inputs for part in parts))
        unused = [x for i, x in enumerate(inputs) if i not in used]
        if length:
            body.insert(0, f"    REAL w[{length}];")
        for number, part in enumerate(parts):
            mine = [x for i, x in enumerate(inputs) if i in part.inputs]
            made = [y for i, y in enumerate(outputs) if i in part.outputs]
            work = ["w"] if part.work else []
            head = signature(f"PART({name}_{number})", mine, [*made, *work])
            text += [f"NOINLINE LOCAL {head}", "{", *part.lines, "}", ""]
            body.append(f"    PART({name}_{number})({', '.join([*mine, *made, *work])});")
    written = {i for part in parts for i in part.outputs} | {
        i for i in range(len(outputs)) if function.nnz_out(i) < function.numel_out(i)
    }
    unused += [y for i, y in enumerate(outputs) if i not in written]
    body += [f"    (void){one};" for one in unused]
    text += [f"LOCAL {signature(name, inputs, outputs)}", "{", *body, "}", ""]
    return "\n".join(text)


def signature(name: str, inputs: Sequence[str], outputs: Sequence[str]) -> str:
    """Return the head of a C function that reads `inputs` and writes `outputs`."""
    arguments = [f"const REAL *RESTRICT {one}" for one in inputs]
    arguments += [f"REAL *RESTRICT {one}" for one in outputs]
    return f"void {name}({', '.join(arguments) or 'void'})"
