"""Elimination over sparse CasADi symbols, stable at every state although the order is fixed.

**Structure.** A matrix A (m x n, m >= n) is put into block upper triangular form by its pattern
alone (Dulmage-Mendelsohn): square blocks that cannot be split further, then blocks with more rows
than columns. A regular A has regular square blocks and blocks of full column rank, so one block
after another is solved, and the entries outside the blocks are never changed. Of a solution that
is not unique (more rows than columns) the freedom lies in the tall blocks alone: the shortest there
is the shortest of all.

**Within a block** orthogonal steps take the place of pivots chosen by size. A column with one entry
costs nothing; of two rows, x = (a, b), the reflection ``[a b; b -a] / r``, r = |x|; of more,
``I - beta v v'`` with ``v = x + copysign(|x|, x_1) e_1``, ``beta = 1 / (|x| (|x| + |x_1|))``. No
quotient has a denominator that vanishes at a regular state. Rows left over in a tall block go on to
the columns that follow; more of them than columns they have are first reduced to as many (otherwise
the work would grow with the square of the number of loops). Those rows may be zero or rounding
error: their reflections add ``copysign(1e-18, x_1)`` to x_1, which keeps them orthogonal.

**Cramer's rule for the last two columns of a square block.** On 4000 random blocks (singular values
from 1 to 1 / condition, the middle one of three anywhere between), the worst relative error of a
solution, and operations of factors, one solution and the sum of squared inverse pivots:

    size    condition    Cramer's rule    orthogonal    orthogonal, last two by Cramer's rule
    2       1e2          8e-15            9e-15
    2       1e4          3e-13            7e-13
    2       1e8          3e-9             6e-9
    2       operations   20               27, one root
    3       1e2          8e-14            2e-14         3e-14
    3       1e4          8e-10            2e-12         2e-12
    3       1e8          8e-2             2e-8          2e-8
    3       operations   73               84            77

The determinant of a 3 x 3 block loses condition^2 eps where two singular values are small, and is
not used. That of a 2 x 2 block loses condition eps, as every stable method does; it serves for the
last two columns of every square block.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError

#: A scalar SX, and a row of a matrix: its structurally nonzero entries by column.
Scalar = Any
Row = dict[int, Scalar]

#: Added to the first component of a vector that may be zero; its square is a normal `float` too.
_TINY = 1e-18


class Block(NamedTuple):
    """Rows and columns of a diagonal block; square, or with more rows than columns."""

    rows: list[int]
    columns: list[int]


class InversePivot(NamedTuple):
    """Inverse of a pivot of a column, in the unit of x by that of A x (in scaled rows)."""

    column: int
    value: Scalar


def blocks(sparsity: ca.Sparsity) -> list[Block]:
    """Return the diagonal blocks of the block upper triangular form of a pattern.

    A block's columns have no entries in the rows of later blocks. Rows without entries belong to no
    block. Tall blocks come last; there are no entries between them.

    Raises
    ------
    InputError
        If some columns have no rows of their own: no numbers give full column rank.
    """
    rank = ca.sprank(sparsity)
    if rank < sparsity.size2():
        raise InputError(
            f"the pattern of a {sparsity.size1()} x {sparsity.size2()} matrix allows a rank of "
            f"{rank}; full column rank is needed"
        )
    size, row_order, column_order, row_start, column_start, _, _ = sparsity.btf()
    found: list[Block] = []
    for k in range(size):
        rows = row_order[row_start[k] : row_start[k + 1]]
        columns = column_order[column_start[k] : column_start[k + 1]]
        if len(rows) == len(columns):
            found.append(Block(list(rows), list(columns)))
        elif columns:
            found += _components(sparsity, list(rows), list(columns))
    return found if _is_upper(sparsity, found) else found[::-1]


def _is_upper(sparsity: ca.Sparsity, found: list[Block]) -> bool:
    """Return whether no entry lies below the blocks: CasADi 3.8 gives the lower form."""
    of_row = {i: k for k, block in enumerate(found) for i in block.rows}
    of_column = {j: k for k, block in enumerate(found) for j in block.columns}
    return all(of_row[i] <= of_column[j] for i, j in zip(*sparsity.get_triplet(), strict=True))


def _components(sparsity: ca.Sparsity, rows: list[int], columns: list[int]) -> list[Block]:
    """Return the parts of a tall block that have no column in common, in the order of columns."""
    inside, root = set(rows), {column: column for column in columns}

    def find(column: int) -> int:
        while root[column] != column:
            root[column] = root[root[column]]
            column = root[column]
        return column

    first: dict[int, int] = {}
    start, row_of = sparsity.colind(), sparsity.row()
    for column in columns:
        for row in row_of[start[column] : start[column + 1]]:
            if row in inside:
                root[find(column)] = find(first.setdefault(row, column))
    parts: dict[int, Block] = {}
    for column in sorted(columns):
        parts.setdefault(find(column), Block([], [])).columns.append(column)
    for row in sorted(first):
        parts[find(first[row])].rows.append(row)
    return list(parts.values())


class Householder:
    """Factors of A (m x n, m >= n, of full column rank at regular states); see the module's text.

    Parameters
    ----------
    A
        Sparse SX.
    column_order
        Order in which columns are eliminated, within each block; the one that seems cheapest if
        left out.
    row_scale
        (m,) factors that give the rows one unit; 1 if left out. Of solutions that are not unique
        they define the norm: lengths of y count as |y / row_scale|, residuals as
        |row_scale (A x - b)|.

    Attributes
    ----------
    blocks : list of Block
    inverse_pivots : list of InversePivot
        One of each column, or two where Cramer's rule is used: then the entries of the inverse of
        the two columns' block. Each is at most 1 / s, s the smallest singular value of A in scaled
        rows, and the root of the sum of their squares is of that order (tests: at least 0.05 / s),
        so they show how near A is to a singular one. With columns in other units, x = u x_u, they
        are divided by u.

    Raises
    ------
    InputError
        If the shapes do not fit, or the pattern has no full column rank.
    """

    def __init__(
        self,
        A: Any,
        column_order: Sequence[int] | None = None,
        row_scale: Array | None = None,
    ) -> None:
        self.shape: tuple[int, int] = A.shape
        rows, columns = self.shape
        if column_order is not None and sorted(column_order) != list(range(columns)):
            raise InputError(f"column_order holds the numbers 0 to {columns - 1} once each")
        scale = np.ones(rows) if row_scale is None else np.asarray(row_scale, np.float64)
        if scale.shape != (rows,) or not (scale > 0).all():
            raise InputError(f"row_scale has {rows} positive factors, one of each row")
        A = ca.sparsify(A)
        self._rows = rows_of(A)
        self.blocks = blocks(A.sparsity())
        place = None if column_order is None else {j: i for i, j in enumerate(column_order)}
        self._factors = [_factor(self._rows, block, scale, place) for block in self.blocks]
        self.inverse_pivots: list[InversePivot] = [
            pivot for factor in self._factors for pivot in factor.inverse_pivots()
        ]

    @property
    def orientation(self) -> Scalar | None:
        """1 or -1, which changes with the sign of det A; none if a block is not square.

        The number of reflections, each of determinant -1, is always the same.
        """
        found = ca.SX(1)
        for factor in self._factors:
            sign = factor.orientation()
            if sign is None:
                return None
            found *= sign
        return found

    @property
    def pivots(self) -> list[tuple[int, Scalar]]:
        """Column and size of each pivot; where Cramer's rule is used, 1 / |row of the inverse|."""
        squares: dict[int, Scalar] = {}
        for column, value in self.inverse_pivots:
            squares[column] = squares[column] + value * value if column in squares else value**2
        return [(column, 1 / ca.sqrt(square)) for column, square in squares.items()]

    def solve(self, B: Any) -> Any:
        """Return the least-squares solution X (n x k) of A X = B (m x k), sparse SX."""
        self._refuse_rows(B, self.shape[0])
        right, solved = rows_of(B), [Row() for _ in range(self.shape[1])]
        for block, factor in zip(reversed(self.blocks), reversed(self._factors), strict=True):
            own = set(block.columns)
            for row in block.rows:
                for column, entry in self._rows[row].items():
                    if column not in own:
                        _subtract(right[row], entry, solved[column])
            for column, values in factor.solve({row: right[row] for row in block.rows}).items():
                solved[column] = values
        return matrix_of(solved, B.size2())

    def transposed(self, B: Any) -> Any:
        """Return the shortest Y (m x k) with A' Y = B (n x k), sparse SX."""
        self._refuse_rows(B, self.shape[1])
        right, solved = rows_of(B), [Row() for _ in range(self.shape[0])]
        for block, factor in zip(self.blocks, self._factors, strict=True):
            own = set(block.columns)
            for row, values in factor.transposed({j: right[j] for j in block.columns}).items():
                solved[row] = values
                for column, entry in self._rows[row].items():
                    if column not in own:
                        _subtract(right[column], entry, values)
        return matrix_of(solved, B.size2())

    def _refuse_rows(self, B: Any, rows: int) -> None:
        if B.size1() != rows:
            raise InputError(
                f"the right side of a {self.shape[0]} x {self.shape[1]} system has {rows} rows, "
                f"not {B.size1()}"
            )


class LDL:
    """A = L D L' of a symmetric positive definite A (n x n sparse SX), without fill in tree order.

    Parameters
    ----------
    A
        Its diagonal and both triangles.
    order
        Order of elimination; the last coordinate first if left out, which makes no fill where A is
        the mass matrix of a tree whose joints come root to leaf.

    Attributes
    ----------
    inverse_diagonal : (n, 1) SX
        1 / D, in A's order.
    """

    def __init__(self, A: Any, order: Sequence[int] | None = None) -> None:
        size = A.size1()
        self.order = list(range(size - 1, -1, -1)) if order is None else list(order)
        if A.size2() != size or sorted(self.order) != list(range(size)):
            raise InputError(f"LDL takes a square matrix and each of its rows once, not {A.shape}")
        rows, left = rows_of(ca.sparsify(A)), set(self.order)
        self._inverse: list[Scalar] = []
        self._columns: list[list[tuple[int, Scalar]]] = []
        for k in self.order:
            left.discard(k)
            if k not in rows[k]:
                raise InputError(f"entry ({k}, {k}) of a positive definite matrix is zero")
            inverse = 1 / rows[k][k]
            entries = [(i, entry) for i, entry in sorted(rows[k].items()) if i in left]
            factors = [(i, entry * inverse) for i, entry in entries]
            for at, (i, factor) in enumerate(factors):
                for j, entry in entries[at:]:
                    product = factor * entry
                    rows[i][j] = rows[i][j] - product if j in rows[i] else -product
                    if j != i:
                        rows[j][i] = rows[i][j]
            self._inverse.append(inverse)
            self._columns.append(factors)
        by_index = dict(zip(self.order, self._inverse, strict=True))
        self.inverse_diagonal = ca.vertcat(*[by_index[i] for i in range(size)])

    def solve(self, B: Any) -> Any:
        """Return X (n x k) with A X = B (n x k), sparse SX."""
        if B.size1() != len(self.order):
            raise InputError(f"the right side has {len(self.order)} rows, not {B.size1()}")
        right = rows_of(B)
        for k, column in zip(self.order, self._columns, strict=True):
            for i, factor in column:
                _subtract(right[i], factor, right[k])
        for k, inverse in zip(self.order, self._inverse, strict=True):
            right[k] = {j: inverse * entry for j, entry in right[k].items()}
        for k, column in zip(reversed(self.order), reversed(self._columns), strict=True):
            for i, factor in column:
                _subtract(right[k], factor, right[i])
        return matrix_of(right, B.size2())


# Rows ---------------------------------------------------------------------------------------------


def rows_of(A: Any) -> list[Row]:
    """Return the rows of a sparse SX as dictionaries of scalars."""
    A = ca.sparsify(ca.SX(A))
    rows = [Row() for _ in range(A.size1())]
    for i, j, entry in zip(*A.sparsity().get_triplet(), A.nonzeros(), strict=True):
        rows[i][j] = entry
    return rows


def matrix_of(rows: Sequence[Row], columns: int) -> Any:
    """Return the sparse SX of rows."""
    entries = sorted((j, i) for i, row in enumerate(rows) for j in row)
    if not entries:
        return ca.SX(len(rows), columns)
    pattern = ca.Sparsity.triplet(
        len(rows), columns, [i for _, i in entries], [j for j, _ in entries]
    )
    return ca.SX(pattern, ca.vertcat(*[rows[i][j] for j, i in entries]))


def _subtract(row: Row, factor: Scalar, other: Row) -> None:
    """Row minus factor times another, in place."""
    for j, entry in other.items():
        product = factor * entry
        row[j] = row[j] - product if j in row else -product


def _scaled(row: Row, factor: float) -> Row:
    return row if factor == 1.0 else {j: factor * entry for j, entry in row.items()}


# One block ----------------------------------------------------------------------------------------


class _Reflection:
    """An orthogonal, symmetric H with H x = +-|x| e_1, on some rows.

    Attributes
    ----------
    rows : list of int
    first, inverse : SX
        The entry of H x, and 1 over it.
    """

    def __init__(self, rows: list[int], x: list[Scalar], may_vanish: bool = False) -> None:
        self.rows = rows
        if may_vanish:
            x = [x[0] + ca.copysign(_TINY, x[0]), *x[1:]]
        norm = ca.sqrt(_sum(entry * entry for entry in x))
        if len(x) == 2:
            self.inverse = 1 / norm
            self.first = norm
            self._along = [entry * self.inverse for entry in x]
        else:
            length = norm + ca.fabs(x[0])
            self._beta = 1 / (norm * length)
            self._along = [x[0] + ca.copysign(norm, x[0]), *x[1:]]
            self.first = -ca.copysign(norm, x[0])
            self.inverse = -ca.copysign(self._beta * length, x[0])

    def apply(self, rows: dict[int, Row], columns: Iterable[int] | None = None) -> None:
        """Rows times H, in place; only some columns of them, or all."""
        mine = [rows[i] for i in self.rows]
        if columns is None:
            columns = sorted({j for row in mine for j in row})
        for j in columns:
            entries = [row.get(j) for row in mine]
            if len(mine) == 2:
                _rotate(mine, j, entries, self._along)
                continue
            along = self._beta * _sum(
                v * entry
                for v, entry in zip(self._along, entries, strict=True)
                if entry is not None
            )
            for row, v, entry in zip(mine, self._along, entries, strict=True):
                product = v * along
                row[j] = -product if entry is None else entry - product


def _rotate(rows: list[Row], j: int, entries: list[Scalar | None], along: list[Scalar]) -> None:
    """Column j of two rows times [c s; s -c]."""
    c, s = along
    first, second = entries
    if second is None:
        rows[0][j], rows[1][j] = c * first, s * first
    elif first is None:
        rows[0][j], rows[1][j] = s * second, -(c * second)
    else:
        rows[0][j], rows[1][j] = c * first + s * second, s * first - c * second


def _sum(terms: Iterable[Scalar]) -> Scalar:
    """Sum without a leading zero."""
    total = None
    for term in terms:
        total = term if total is None else total + term
    return total


class _Pivot(NamedTuple):
    row: int
    column: int
    inverse: Scalar
    rest: Row
    """The other entries of R's row."""


class _Pair(NamedTuple):
    """Two rows, two columns, and the inverse of their 2 x 2 block."""

    rows: tuple[int, int]
    columns: tuple[int, int]
    inverse: tuple[tuple[Scalar, Scalar], tuple[Scalar, Scalar]]


def _factor(
    rows: list[Row], block: Block, scale: Array, place: dict[int, int] | None
) -> _BlockFactor:
    own = set(block.columns)
    factors = scale[block.rows]
    # Rows of a block of two are not combined, and need no common unit.
    plain = len(block.rows) == len(block.columns) <= 2
    common = factors if plain else np.full(factors.shape, factors.min())
    relative = dict(zip(block.rows, (factors / common).tolist(), strict=True))
    units = dict(zip(block.rows, common.tolist(), strict=True))
    inside = {
        i: _scaled({j: e for j, e in rows[i].items() if j in own}, relative[i]) for i in block.rows
    }
    return _BlockFactor(inside, block.columns, relative, units, place)


class _BlockFactor:
    """Factors of one block: reflections, R, and the inverse of its last two columns.

    Parameters
    ----------
    rows
        The block's rows, scaled; changed.
    columns
        Its columns.
    relative, units
        Factors of the rows: the rows are scaled by the first, the pivots by both.
    place
        Places of the columns in the order of elimination, or None.
    """

    def __init__(
        self,
        rows: dict[int, Row],
        columns: list[int],
        relative: dict[int, float],
        units: dict[int, float],
        place: dict[int, int] | None,
    ) -> None:
        self._rows, self._relative, self._units = rows, relative, units
        self._square = len(rows) == len(columns)
        self._left, self._free = set(columns), set(rows)
        self._holders: dict[int, set[int]] = {j: set() for j in columns}
        for i, row in rows.items():
            for j in row:
                self._holders[j].add(i)
        self._reflections: list[_Reflection] = []
        self._pivots: list[_Pivot] = []
        self._pair: _Pair | None = None
        self._costs: dict[int, tuple[int, int]] = {}
        while self._left:
            if self._square and len(self._left) == 2 and self._take_pair():
                break
            self._eliminate(self._next(place))
        del self._rows, self._holders, self._costs

    # Factorisation

    def _next(self, place: dict[int, int] | None) -> int:
        """Return the column of least cost, or the next in a given order."""
        if place is not None:
            return min(self._left, key=place.__getitem__)
        for j in self._left:
            if j not in self._costs:
                holders = self._holders[j]
                width = len(set().union(*(self._rows[i] for i in holders)))
                self._costs[j] = (len(holders) - 1) * width, j
        return min(self._costs.values())[1]

    def _eliminate(self, column: int) -> None:
        rows = self._rows
        holders = sorted(self._holders[column], key=lambda i: (len(rows[i]), i))
        pivot = holders[0]
        if len(holders) == 1:
            inverse = 1 / rows[pivot][column]
        else:
            reflection = self._reflect(holders, column)
            inverse = reflection.inverse
        self._free.discard(pivot)
        self._left.discard(column)
        self._costs.pop(column, None)
        rest = {j: entry for j, entry in rows[pivot].items() if j != column}
        for j in rest:
            self._holders[j].discard(pivot)
            self._costs.pop(j, None)
        self._pivots.append(_Pivot(pivot, column, inverse, rest))
        self._reduce(holders[1:], sorted(rest))

    def _reflect(self, holders: list[int], column: int, may_vanish: bool = False) -> _Reflection:
        """Clear a column of rows but for the first."""
        rows = self._rows
        reflection = _Reflection(holders, [rows[i][column] for i in holders], may_vanish)
        touched = sorted({j for i in holders for j in rows[i]} - {column})
        reflection.apply(rows, touched)
        for i in holders[1:]:
            del rows[i][column]
        rows[holders[0]][column] = reflection.first
        self._holders[column] -= set(holders[1:])
        for j in touched:
            self._holders[j].update(holders)
            self._costs.pop(j, None)
        self._costs.pop(column, None)
        self._reflections.append(reflection)
        return reflection

    def _reduce(self, rows: list[int], columns: list[int]) -> None:
        """Reduce more rows than columns, which may be zero, to as many rows.

        Nothing is gained if no other rows have these columns: they are eliminated next.
        """
        others = set().union(*(self._holders[j] for j in columns)) - set(rows)
        if len(rows) <= len(columns) or not others:
            return
        for column in sorted(columns, key=lambda j: (len(self._holders[j]), j)):
            if len(rows) > 1:
                self._reflect(rows, column, may_vanish=True)
            rows = rows[1:]

    def _take_pair(self) -> bool:
        """Invert the last two columns of a square block by Cramer's rule, if they are full."""
        j, k = sorted(self._left)
        i, h = sorted(self._free)
        if not all(column in self._rows[row] for row in (i, h) for column in (j, k)):
            return False
        a, b, c, d = self._rows[i][j], self._rows[i][k], self._rows[h][j], self._rows[h][k]
        inverse = 1 / (a * d - b * c)
        negative = -inverse
        entries = (d * inverse, b * negative), (c * negative, a * inverse)
        self._pair = _Pair((i, h), (j, k), entries)
        return True

    def inverse_pivots(self) -> list[InversePivot]:
        """Return the inverse pivots in the unit of the scaled rows."""
        found = [
            InversePivot(pivot.column, _product(1 / self._units[pivot.row], pivot.inverse))
            for pivot in self._pivots
        ]
        if self._pair is not None:
            units = [self._units[row] for row in self._pair.rows]
            for column, entries in zip(self._pair.columns, self._pair.inverse, strict=True):
                found += [
                    InversePivot(column, _product(1 / unit, entry))
                    for unit, entry in zip(units, entries, strict=True)
                ]
        return found

    def orientation(self) -> Scalar | None:
        """Return the sign of the determinant, but for a constant; none if it is not square."""
        if not self._square:
            return None
        found = ca.SX(1)
        for pivot in self._pivots:
            found *= ca.copysign(1.0, pivot.inverse)
        if self._pair is not None:
            (a, b), (c, d) = self._pair.inverse
            found *= ca.copysign(1.0, a * d - b * c)
        return found

    # Solutions

    def solve(self, right: dict[int, Row]) -> dict[int, Row]:
        """Return the rows of X by column of A, of the block's right side by row."""
        turned = {i: dict(_scaled(row, self._relative[i])) for i, row in right.items()}
        for reflection in self._reflections:
            reflection.apply(turned)
        solved: dict[int, Row] = {}
        if self._pair is not None:
            first, second = (turned[i] for i in self._pair.rows)
            for column, (one, other) in zip(self._pair.columns, self._pair.inverse, strict=True):
                solved[column] = _combined(one, first, other, second)
        for pivot in reversed(self._pivots):
            row = turned[pivot.row]
            for column, entry in pivot.rest.items():
                _subtract(row, entry, solved[column])
            solved[pivot.column] = {j: pivot.inverse * entry for j, entry in row.items()}
        return solved

    def transposed(self, right: dict[int, Row]) -> dict[int, Row]:
        """Return the rows of Y by row of A, of the block's right side by column."""
        right = {j: dict(row) for j, row in right.items()}
        turned = {i: Row() for i in self._relative}
        for pivot in self._pivots:
            solved = {j: pivot.inverse * entry for j, entry in right[pivot.column].items()}
            turned[pivot.row] = solved
            for column, entry in pivot.rest.items():
                _subtract(right[column], entry, solved)
        if self._pair is not None:
            first, second = (right[j] for j in self._pair.columns)
            one, other = self._pair.inverse
            for at, row in enumerate(self._pair.rows):
                turned[row] = _combined(one[at], first, other[at], second)
        for reflection in reversed(self._reflections):
            reflection.apply(turned)
        return {i: _scaled(row, self._relative[i]) for i, row in turned.items()}


def _product(factor: float, value: Scalar) -> Scalar:
    return value if factor == 1.0 else factor * value


def _combined(one: Scalar, first: Row, other: Scalar, second: Row) -> Row:
    """Return one times a row plus other times another."""
    row = {j: one * entry for j, entry in first.items()}
    for j, entry in second.items():
        product = other * entry
        row[j] = row[j] + product if j in row else product
    return row
