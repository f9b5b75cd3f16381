"""Elimination over sparse symbols against NumPy: random patterns, redundant rows, near singular."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin.codegen.expressions.elimination import LDL, Householder, blocks
from rps_pin.errors import InputError
from tests.worst import worst

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
EPS = float(np.finfo(float).eps)


def pattern_of(mask: Bools) -> ca.Sparsity:
    return ca.Sparsity.triplet(*mask.shape, *[index.tolist() for index in np.nonzero(mask)])


def given(matrix: Array, mask: Bools) -> ca.DM:
    """A matrix's entries in a pattern."""
    return ca.DM(pattern_of(mask), matrix.T[mask.T])


class Solver:
    """Functions of A (in a pattern): solutions for k right sides, and the inverse pivots."""

    def __init__(self, mask: Bools, sides: int = 2, row_scale: Array | None = None) -> None:
        rows, columns = mask.shape
        A = ca.SX.sym("A", pattern_of(mask))
        B, C = ca.SX.sym("B", rows, sides), ca.SX.sym("C", columns, sides)
        self.mask = mask
        self.factors = factors = Householder(A, row_scale=row_scale)
        inverse = ca.vertcat(*[pivot.value for pivot in factors.inverse_pivots])
        found = [factors.solve(B), factors.transposed(C), inverse]
        self._function = ca.Function("solve", [A, B, C], found)
        self.operations = self._function.n_instructions() - A.nnz() - sides * sum(mask.shape)

    def __call__(self, matrix: Array, b: Array, c: Array) -> list[Array]:
        return [np.array(x) for x in self._function(given(matrix, self.mask), b, c)]


def random_mask(rng: np.random.Generator) -> Bools:
    """A pattern of full structural column rank, rarely square."""
    while True:
        rows = int(rng.integers(1, 10))
        columns = int(rng.integers(1, rows + 1))
        mask = rng.random((rows, columns)) < rng.uniform(0.2, 1)
        if ca.sprank(pattern_of(mask)) == columns:
            return mask


def references(matrix: Array, b: Array, c: Array, scale: Array) -> tuple[Array, Array]:
    """Least squares, and the shortest y, in scaled rows."""
    scaled = scale[:, None] * matrix
    x = np.linalg.lstsq(scaled, scale[:, None] * b, rcond=None)[0]
    return x, scale[:, None] * np.linalg.lstsq(scaled.T, c, rcond=None)[0]


@pytest.mark.parametrize("scaled", [False, True])
def test_random_patterns(scaled: bool) -> None:
    rng = np.random.default_rng(int(scaled))
    count, errors = 0, []
    while count < 50:
        mask = random_mask(rng)
        matrix = np.where(mask, rng.normal(size=mask.shape), 0.0)
        scale = np.exp(rng.normal(size=mask.shape[0])) if scaled else np.ones(mask.shape[0])
        condition = np.linalg.cond(scale[:, None] * matrix)
        if condition > 1e5:
            continue
        b, c = rng.normal(size=(mask.shape[0], 2)), rng.normal(size=(mask.shape[1], 2))
        x, y, inverse = Solver(mask, row_scale=scale if scaled else None)(matrix, b, c)
        expected = references(matrix, b, c, scale)
        for found, right in zip((x, y), expected, strict=True):
            errors.append(worst(found - right) / (np.abs(right).max() * condition))
        smallest = np.linalg.svd(scale[:, None] * matrix, compute_uv=False)[-1]
        growth = np.sqrt((inverse**2).sum()) * smallest
        assert 0.05 < growth <= np.sqrt(mask.shape[1]) * (1 + 1e-6)
        count += 1
    assert worst(*errors) < 100 * EPS


def low_rank(rng: np.random.Generator, rows: int, columns: int, condition: float) -> Array:
    """A random matrix with singular values from 1 to 1 / condition."""
    left = np.linalg.qr(rng.normal(size=(rows, columns)))[0]
    right = np.linalg.qr(rng.normal(size=(columns, columns)))[0]
    return np.asarray((left * np.geomspace(1, 1 / condition, columns)) @ right)


@pytest.mark.parametrize("columns", [1, 2, 3, 5, 9])
@pytest.mark.parametrize("extra", [0, 1, 4])
def test_condition_numbers_up_to_1e8(columns: int, extra: int) -> None:
    """Errors of consistent right sides grow as the condition number, not as its square."""
    rng = np.random.default_rng(columns + 10 * extra)
    solver = Solver(np.ones((columns + extra, columns), dtype=bool), 1)
    for condition in (1.0, 1e2, 1e4, 1e6, 1e8):
        for _ in range(20):
            matrix = low_rank(rng, columns + extra, columns, condition)
            x, y = rng.normal(size=(columns, 1)), matrix @ rng.normal(size=(columns, 1))
            found_x, found_y, _ = solver(matrix, matrix @ x, matrix.T @ y)
            assert worst(found_x - x) < 100 * EPS * condition * np.linalg.norm(x)
            assert worst(found_y - y) < 100 * EPS * condition * np.linalg.norm(y)


@pytest.mark.parametrize("size", [2, 3, 4])
def test_small_blocks_lose_no_more_than_their_condition(size: int) -> None:
    """Cramer's rule for the last two columns, at a condition of 1e4 and any values between.

    The reference is refined with extended precision.
    """
    rng = np.random.default_rng(size)
    solver = Solver(np.ones((size, size), dtype=bool), 1)
    errors = []
    for _ in range(300):
        left, right = (np.linalg.qr(rng.normal(size=(size, size)))[0] for _ in range(2))
        values = np.array([1.0, 1e-4, *rng.choice([1.0, 1e-2, 1e-4], size=size - 2)])
        matrix, b = (left * values) @ right, rng.normal(size=(size, 1))
        expected = np.linalg.solve(matrix, b).astype(np.longdouble)
        for _ in range(4):
            rest = b - matrix.astype(np.longdouble) @ expected
            expected = expected + np.linalg.solve(matrix, rest.astype(float))
        x = solver(matrix, b, b)[0]
        errors.append(np.abs(x - expected).max() / np.abs(expected).max())
    # One rounding of A already changes x by eps * 1e4 = 2e-12 in the worst direction.
    assert np.median(errors) < 1e-12
    assert worst(np.asarray(errors, dtype=float)) < 3e-12


def test_redundant_rows_that_are_zero_or_rounding_error() -> None:
    """Rows beyond the rank may vanish exactly, and in the pattern only."""
    rng = np.random.default_rng(5)
    mask = chain(6, 3, 2)
    solver = Solver(mask)
    for noise in (0.0, 1e-17, 1e-16, 1e-30, 1e-200):
        matrix = np.where(mask, rng.normal(size=mask.shape), 0.0)
        matrix[2::3] = noise * rng.normal(size=matrix[2::3].shape) * mask[2::3]
        b, c = rng.normal(size=(mask.shape[0], 2)), rng.normal(size=(mask.shape[1], 2))
        expected = references(matrix, b, c, np.ones(mask.shape[0]))
        condition = np.linalg.cond(matrix)
        for found, right in zip(solver(matrix, b, c), expected, strict=False):
            assert worst(found - right) < 100 * EPS * condition * np.abs(right).max()


def test_rows_that_repeat_others() -> None:
    """Leftover rows that are not zero before, but depend on the others."""
    rng = np.random.default_rng(6)
    solver = Solver(np.ones((7, 3), dtype=bool))
    for _ in range(20):
        matrix = rng.normal(size=(7, 4)) @ rng.normal(size=(4, 3))
        matrix[4:] = matrix[[0, 1, 0]] * [[1.0], [-2.0], [0.5]]
        b, c = rng.normal(size=(7, 2)), rng.normal(size=(3, 2))
        expected = references(matrix, b, c, np.ones(7))
        condition = np.linalg.cond(matrix)
        for found, right in zip(solver(matrix, b, c), expected, strict=False):
            assert worst(found - right) < 100 * EPS * condition * np.abs(right).max()


@pytest.mark.parametrize("size", [2, 3, 4, 6])
def test_no_fixed_pivot_is_needed(size: int) -> None:
    """Orthogonal matrices with any entry zero: every entry is 0 at some regular matrix."""
    rng = np.random.default_rng(size)
    solver = Solver(np.ones((size, size), dtype=bool))
    b, c = rng.normal(size=(2, size, 2))
    for row in range(size):
        for column in range(size):
            matrix = np.linalg.qr(rng.normal(size=(size, size)))[0]
            matrix[row, column] = 0.0
            condition = np.linalg.cond(matrix)
            x, y, _ = solver(matrix, b, c)
            assert worst(matrix @ x - b) < 50 * EPS * condition * np.abs(x).max()
            assert worst(matrix.T @ y - c) < 50 * EPS * condition * np.abs(y).max()
    for permutation in [rng.permutation(size) for _ in range(10)]:
        matrix = np.eye(size)[permutation]
        x, y, _ = solver(matrix, b, c)
        assert worst(x - matrix.T @ b, y - matrix @ c) < 20 * EPS


def test_singular_matrices_show_in_the_inverse_pivots() -> None:
    """They grow as the inverse of the smallest singular value, or are not finite."""
    rng = np.random.default_rng(7)
    for rows, columns in ((2, 2), (3, 3), (5, 3), (6, 6)):
        solver = Solver(np.ones((rows, columns), dtype=bool), 1)
        b, c = np.ones((rows, 1)), np.ones((columns, 1))
        for condition in (1e3, 1e6, 1e9, 1e12):
            inverse = solver(low_rank(rng, rows, columns, condition), b, c)[2]
            assert 0.1 * condition < np.sqrt((inverse**2).sum()) < 100 * condition
        inverse = solver(np.zeros((rows, columns)), b, c)[2]
        assert not np.isfinite(inverse).all()


def test_pivots_are_those_of_the_inverse() -> None:
    A = ca.SX.sym("A", 3, 3)
    factors = Householder(A)
    columns, sizes = zip(*factors.pivots, strict=True)
    assert sorted(columns) == [0, 1, 2]
    sizes = np.array(ca.Function("f", [A], [ca.vertcat(*sizes)])(np.diag([2.0, 0.5, 3.0])))
    assert np.abs(sizes[np.argsort(columns), 0]) == pytest.approx([2.0, 0.5, 3.0])


def test_units_of_pivots_follow_the_row_scale() -> None:
    """A row in other units, with its factor, has the same pivots."""
    rng = np.random.default_rng(8)
    scale = np.array([1.0, 1e-3, 0.1, 1.0])
    full = np.ones((4, 3), dtype=bool)
    for mask in (full, full[:2, :2], full[:3], np.eye(3, dtype=bool)):
        matrix = np.where(mask, rng.normal(size=mask.shape), 0.0)
        here = scale[: mask.shape[0]]
        b, c = np.ones((mask.shape[0], 1)), np.ones((mask.shape[1], 1))
        one = Solver(mask, 1)(matrix, b, c)[2]
        other = Solver(mask, 1, row_scale=here)(matrix / here[:, None], b, c)[2]
        assert worst(one - other) < 1e-13 * np.abs(one).max()


def chain(loops: int, rows: int, columns: int) -> Bools:
    """Each loop's rows have its own columns and the last one of the loop before."""
    mask = np.zeros((rows * loops, columns * loops), dtype=bool)
    for k in range(loops):
        own = slice(rows * k, rows * (k + 1))
        mask[own, max(columns * k - 1, 0) : columns * (k + 1)] = True
    return mask


@pytest.mark.parametrize(("rows", "columns"), [(2, 2), (3, 2), (3, 3), (6, 4)])
def test_cost_grows_with_the_number_of_loops(rows: int, columns: int) -> None:
    counts = [4, 16, 64] + [256] * (rows == columns == 2)
    operations = [Solver(chain(n, rows, columns), 1).operations for n in counts]
    exponents = np.diff(np.log(operations)) / np.diff(np.log(counts))
    assert worst(exponents) <= 1.1


def test_a_chain_is_solved_in_its_blocks() -> None:
    found = blocks(pattern_of(chain(5, 2, 2)))
    assert [(len(one.rows), len(one.columns)) for one in found] == [(2, 2)] * 5
    assert sorted(j for one in found for j in one.columns) == list(range(10))
    for at, one in enumerate(found):
        later = [i for other in found[at + 1 :] for i in other.rows]
        assert not chain(5, 2, 2)[np.ix_(later, one.columns)].any()


def test_parts_of_tall_matrices_are_apart() -> None:
    mask = np.zeros((8, 4), dtype=bool)
    mask[:3, :2] = mask[3:6, 2:] = True  # and two empty rows
    found = blocks(pattern_of(mask))
    assert [(one.rows, one.columns) for one in found] == [
        ([0, 1, 2], [0, 1]),
        ([3, 4, 5], [2, 3]),
    ]
    matrix = np.random.default_rng(0).normal(size=(8, 4)) * mask
    _, y, _ = Solver(mask)(matrix, np.ones((8, 2)), np.ones((4, 2)))
    assert (y[6:] == 0).all()


def test_structural_zeros_stay() -> None:
    """Solutions of sparse right sides have entries only where something reaches."""
    mask = chain(4, 2, 2)
    factors = Householder(ca.SX.sym("A", pattern_of(mask)))
    right = ca.SX(8, 1)
    right[4] = ca.SX.sym("b")
    assert np.nonzero(np.array(ca.DM(factors.solve(right).sparsity())))[0].tolist() == [4, 5, 6, 7]
    reached = np.nonzero(np.array(ca.DM(factors.transposed(right).sparsity())))[0]
    assert reached.tolist() == [2, 3, 4, 5] or set(reached) <= {0, 1, 2, 3, 4, 5}
    triangular = Householder(ca.SX.sym("A", ca.Sparsity.upper(5)))
    assert not any("sqrt" in str(pivot.value) for pivot in triangular.inverse_pivots)


def test_any_column_order() -> None:
    rng = np.random.default_rng(9)
    A, b = ca.SX.sym("A", 6, 5), ca.SX.sym("b", 6)
    matrix, side = rng.normal(size=(6, 5)), rng.normal(size=6)
    expected = np.linalg.lstsq(matrix, side, rcond=None)[0]
    for order in ([0, 1, 2, 3, 4], [4, 2, 0, 1, 3]):
        solve = ca.Function("f", [A, b], [Householder(A, order).solve(b)])
        assert worst(np.array(solve(matrix, side))[:, 0] - expected) < 1e-12


def test_derivatives_are_those_of_the_solution() -> None:
    """CasADi differentiates through the reflections: d(A^-1 b) = -A^-1 dA x."""
    rng = np.random.default_rng(10)
    A, b = ca.SX.sym("A", 4, 4), ca.SX.sym("b", 4)
    slope = ca.Function("f", [A, b], [ca.jacobian(Householder(A).solve(b), ca.vec(A))])
    matrix, side = rng.normal(size=(4, 4)), rng.normal(size=4)
    x = np.linalg.solve(matrix, side)
    expected = -np.kron(x, np.linalg.inv(matrix))
    assert worst(np.array(slope(matrix, side)) - expected) < 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize("order", [None, "first", "any"])
def test_ldl(order: str | None) -> None:
    rng = np.random.default_rng(11)
    for size in (1, 2, 5, 9):
        tree = [int(rng.integers(-1, i)) for i in range(size)]
        mask = np.eye(size, dtype=bool)
        for i in range(size):
            j = i
            while (j := tree[j]) >= 0:
                mask[i, j] = mask[j, i] = True
        root = np.where(np.tril(mask), rng.normal(size=(size, size)), 0.0)
        matrix = root.T @ root + 0.1 * np.eye(size)
        given_order = {"first": list(range(size)), "any": rng.permutation(size).tolist()}
        M, b = ca.SX.sym("M", pattern_of(mask)), ca.SX.sym("b", size, 3)
        factors = LDL(M, given_order.get(order or ""))
        solve = ca.Function("f", [M, b], [factors.solve(b), factors.inverse_diagonal])
        side = rng.normal(size=(size, 3))
        x, inverse = (np.array(one) for one in solve(given(matrix, mask), side))
        assert worst(x - np.linalg.solve(matrix, side)) < 1e-12 * np.linalg.cond(matrix)
        assert np.log(inverse).sum() == pytest.approx(-np.linalg.slogdet(matrix)[1])


def test_ldl_of_a_tree_makes_no_fill() -> None:
    """Operations of a star of chains: what its entries below the diagonal need, and no more."""
    branches, length = 20, 3
    size = branches * length
    mask = np.eye(size, dtype=bool)
    for branch in range(branches):
        own = slice(branch * length, (branch + 1) * length)
        mask[own, own] = True
    M, b = ca.SX.sym("M", pattern_of(mask)), ca.SX.sym("b", size)
    count = ca.Function("f", [M, b], [LDL(M).solve(b)]).n_instructions() / branches
    one = ca.SX.sym("M", length, length)
    side = ca.SX.sym("b", length)
    alone = ca.Function("f", [one, side], [LDL(one).solve(side)]).n_instructions()
    assert count <= alone


def test_bad_input() -> None:
    with pytest.raises(InputError, match=r"3 x 3 matrix allows a rank of 2"):
        Householder(ca.SX.sym("A", pattern_of(np.array([[1, 1, 1], [0, 1, 0], [0, 1, 0]], bool))))
    with pytest.raises(InputError, match="rank of 2"):
        Householder(ca.SX.sym("A", 2, 3))
    A = ca.SX.sym("A", 3, 2)
    with pytest.raises(InputError, match="3 x 2 system has 3 rows, not 2"):
        Householder(A).solve(ca.SX.sym("b", 2))
    with pytest.raises(InputError, match="has 2 rows, not 3"):
        Householder(A).transposed(ca.SX.sym("b", 3))
    with pytest.raises(InputError, match="column_order"):
        Householder(A, [0, 0])
    with pytest.raises(InputError, match="row_scale has 3"):
        Householder(A, row_scale=np.ones(2))
    with pytest.raises(InputError, match="row_scale has 3 positive"):
        Householder(A, row_scale=np.array([1.0, np.nan, 1.0]))
    with pytest.raises(InputError, match="square"):
        LDL(A)
    with pytest.raises(InputError, match=r"entry \(1, 1\)"):
        LDL(ca.SX.sym("M", pattern_of(np.array([[1, 0], [0, 0]], bool))))
    with pytest.raises(InputError, match="2 rows, not 3"):
        LDL(ca.SX.sym("M", 2, 2)).solve(ca.SX.sym("b", 3))
