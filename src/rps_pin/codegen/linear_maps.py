"""Linear maps of many columns at once: y = L x, where L is the same for all columns x.

An expression of one column is cut in two: what does not depend on x becomes coefficients, and what
is left a list of steps ``row t = row a + coefficient c * row b``. C does each step for COLUMNS
columns at once (see scalar.h): the text grows with the work for one column, not with their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca

from rps_pin.errors import InputError

#: Steps of one C function: a compiler's time grows faster than the size of a function.
CHUNK = 250
#: A scalar SX.
Scalar = Any


class Step(NamedTuple):
    """``row target = row first + coefficient * row second``; row 0 is zero."""

    target: int
    first: int
    second: int
    coefficient: int


class _Product(NamedTuple):
    """sign * factor * node, where the factor does not depend on x."""

    sign: float
    factor: Scalar
    node: Scalar


class LinearMap:
    """The steps of a linear map.

    Parameters
    ----------
    given
        x, a column of symbols.
    results
        y, a column of expressions that are linear in x.

    Attributes
    ----------
    coefficients : SX
        Column of expressions without x.
    steps : list of Step
    rows : int
        How many rows the steps use: row 0 is zero, x comes in rows 1, 2, ...
    places : list of int
        The rows in which y is left.

    Raises
    ------
    InputError
        If y is not linear in x.
    """

    def __init__(self, given: Any, results: Any) -> None:
        symbols, wanted = given.elements(), ca.densify(results).elements()
        self._alive = [*symbols, *wanted]  # as hashes are places in memory
        self._depends = {one.element_hash(): True for one in symbols}
        self._numbers: dict[tuple[float, int], int] = {}
        self._coefficients: list[Scalar] = []
        self._rows = {one.element_hash(): 1 + k for k, one in enumerate(symbols)}
        order = self._in_order(wanted)
        steps = self._steps(order, wanted)
        ends = [self._row(one) for one in wanted]
        self.steps, self.places, self.rows = _in_few_rows(steps, ends, len(symbols))
        self.coefficients = ca.vertcat(ca.SX(0, 1), *self._coefficients)

    def _in_order(self, wanted: Sequence[Scalar]) -> list[Scalar]:
        """Return all nodes that depend on x, but x itself, each after its operands."""
        order: list[Scalar] = []
        left = [(one, False) for one in reversed(wanted)]
        while left:
            node, is_second = left.pop()
            key = node.element_hash()
            if key in self._depends:
                continue
            operands = _operands(node)
            if operands and not is_second:
                left.append((node, True))
                left += [(one, False) for one in operands]
                continue
            self._alive.append(node)
            self._depends[key] = any(self._depends_on_x(one) for one in operands)
            if self._depends[key]:
                order.append(node)
        return order

    def _depends_on_x(self, node: Scalar) -> bool:
        return self._depends[node.element_hash()]

    def _steps(self, order: Sequence[Scalar], wanted: Sequence[Scalar]) -> list[Step]:
        """Return the steps, each with a row of its own.

        A product that is only part of one sum gets no row.
        """
        uses: dict[int, int] = {}
        for one in [*(x for node in order for x in _operands(node)), *wanted, *wanted]:
            uses[one.element_hash()] = uses.get(one.element_hash(), 0) + 1
        steps: list[Step] = []
        products: dict[int, _Product] = {}
        first_row, unit = 1 + len(self._rows), ca.SX(1)

        def row(node: Scalar) -> int:
            key = node.element_hash()
            if key in products:
                add(key, 0, products.pop(key))
            return self._row(node)

        def add(key: int, first: int, product: _Product) -> None:
            second, number = row(product.node), self._number(product.sign, product.factor)
            self._rows[key] = first_row + len(steps)
            steps.append(Step(self._rows[key], first, second, number))

        for node in order:
            key, (kind, operands) = node.element_hash(), self._operation(node)
            if kind == "product":
                factor, other = operands
                inner = products.pop(other.element_hash(), None) if factor.is_constant() else None
                if inner is None:
                    products[key] = _Product(1.0, factor, other)
                else:
                    products[key] = inner._replace(sign=inner.sign * float(factor))
                if uses[key] > 1:
                    row(node)
                continue
            first, second = operands
            if kind == "sum" and first.element_hash() in products:
                first, second = second, first
            at = row(first)
            product = products.pop(second.element_hash(), _Product(1.0, unit, second))
            add(key, at, product if kind == "sum" else product._replace(sign=-1.0))
        return steps

    def _operation(self, node: Scalar) -> tuple[str, tuple[Scalar, Scalar]]:
        """Return "product" of a factor and a node, or "sum" or "difference" of two nodes."""
        operation, operands = node.op(), _operands(node)
        depends = [self._depends_on_x(one) for one in operands]
        if operation == ca.OP_NEG:
            return "product", (ca.SX(-1), operands[0])
        if operation == ca.OP_TWICE:
            return "product", (ca.SX(2), operands[0])
        if operation == ca.OP_MUL and not all(depends):
            factor, other = operands if depends[1] else operands[::-1]
            return "product", (factor, other)
        if operation == ca.OP_DIV and not depends[1]:
            return "product", (1 / operands[1], operands[0])
        if operation in (ca.OP_ADD, ca.OP_SUB) and all(depends):
            return "sum" if operation == ca.OP_ADD else "difference", (operands[0], operands[1])
        raise InputError(
            f"the results are not linear in what is given: they have CasADi's operation {operation}"
        )

    def _number(self, sign: float, factor: Scalar) -> int:
        """Return the number of a coefficient."""
        key = sign, factor.element_hash()
        if factor.is_constant():
            key = sign * float(factor), 0
        if key not in self._numbers:
            self._alive.append(factor)
            self._numbers[key] = len(self._coefficients)
            self._coefficients.append(sign * factor)
        return self._numbers[key]

    def _row(self, node: Scalar) -> int:
        if self._depends_on_x(node):
            return self._rows[node.element_hash()]
        if not node.is_zero():
            raise InputError("the results are not linear in what is given: they are not 0 with it")
        return 0

    def text(self, name: str) -> str:
        """Return C functions of parts of the steps, which `calls` calls."""
        parts = []
        for k in range(0, len(self.steps), CHUNK):
            parts += [
                f"NOINLINE LOCAL void PART({name}_{k // CHUNK})(",
                "    ROW *RESTRICT row, const REAL *RESTRICT factor)",
                "{",
                *(_statement(step) for step in self.steps[k : k + CHUNK]),
                "}",
                "",
            ]
        return "\n".join(parts)

    def calls(self, name: str, rows: str, coefficients: str) -> str:
        """Return C that takes ``ROW rows[...]``, row 0 zero, through the steps."""
        return " ".join(
            f"PART({name}_{k})({rows}, {coefficients});"
            for k in range(-(-len(self.steps) // CHUNK))
        )


def _statement(step: Step) -> str:
    product = f"factor[{step.coefficient}] * row[{step.second}]"
    return (
        f"    row[{step.target}] = "
        + (f"row[{step.first}] + " if step.first else "")
        + f"{product};"
    )


def _operands(node: Scalar) -> list[Scalar]:
    return [node.dep(i) for i in range(node.n_dep())]


def _in_few_rows(
    steps: Sequence[Step], ends: Sequence[int], given: int
) -> tuple[list[Step], list[int], int]:
    """Return the steps and the rows of results, rows being used again once they are not read."""
    last = {row: k for k, one in enumerate(steps) for row in (one.first, one.second)}
    kept = {0, *ends}
    place = {row: row for row in range(given + 1)}
    free = [row for row in range(given, 0, -1) if row not in last and row not in kept]
    rows, found = given + 1, []
    for k, one in enumerate(steps):
        read = {one.first, one.second}
        first, second = place[one.first], place[one.second]
        free += [place[row] for row in sorted(read - kept) if last[row] == k]
        if not free:
            free.append(rows)
            rows += 1
        place[one.target] = free.pop()
        found.append(Step(place[one.target], first, second, one.coefficient))
    return found, [place[row] for row in ends], rows
