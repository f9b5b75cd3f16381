"""Linear maps as steps on rows: against CasADi's own numbers."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from rps_pin.codegen.expressions.elimination import LDL, Householder
from rps_pin.codegen.expressions.functions import MechanismFunctions
from rps_pin.codegen.expressions.independent import choose, regular_samples
from rps_pin.codegen.expressions.mechanism import MechanismExpressions
from rps_pin.codegen.linear_maps import LinearMap
from rps_pin.errors import InputError
from tests.proofs import common
from tests.worst import worst

each = pytest.mark.parametrize


def through(found: LinearMap, coefficients: np.ndarray, given: np.ndarray) -> np.ndarray:
    """Return the results for columns that are given."""
    rows = np.full((found.rows, given.shape[1]), np.nan)
    rows[0], rows[1 : 1 + len(given)] = 0.0, given
    for target, first, second, coefficient in found.steps:
        rows[target] = rows[first] + coefficients[coefficient] * rows[second]
    return rows[found.places]


@each("seed", range(20))
def test_solutions_of_random_matrices(seed: int) -> None:
    """x of A x = b by reflections, then S x for a positive definite S, and what is between."""
    rng = np.random.default_rng(seed)
    rows, columns = 6 + seed % 3, 6
    mask = rng.uniform(size=(rows, columns)) < 0.4
    mask[:columns] |= np.eye(columns, dtype=bool)
    A = ca.SX.sym("A", ca.sparsify(ca.DM(mask.astype(float))).sparsity())
    S, b = ca.SX.sym("S", columns, columns), ca.SX.sym("b", rows)
    x = Householder(A).solve(b)
    y = ca.vertcat(LDL(S).solve(ca.sparsify(x)), x, -x[0] - b[1] / S[0, 0] + 2 * b[2], b[0], 0)
    found = LinearMap(b, y)
    numbers = ca.Function("f", [A, S], [found.coefficients])
    whole = ca.Function("f", [A, S, b], [y])
    a, right = (
        (rng.normal(size=mask.shape) + 2 * np.eye(rows, columns)) * mask,
        rng.normal(size=(rows, 4)),
    )
    s = rng.normal(size=(columns, columns))
    s = s @ s.T + np.eye(columns)
    given = ca.DM(A.sparsity(), a.T[mask.T].tolist()), s
    wanted = np.hstack([whole(*given, one).full() for one in right.T])
    result = through(found, numbers(*given).full().ravel(), right)
    assert worst(np.abs(result - wanted)) < 1e-11 * np.abs(wanted).max()
    assert found.rows <= 1 + rows + len(wanted) + columns


def test_what_is_not_linear_is_refused() -> None:
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p")
    for y in (x[0] * x[1], ca.sin(x[0]), x[0] + p, p / x[0], p, ca.SX(1)):
        with pytest.raises(InputError, match="not linear"):
            LinearMap(x, y)
    assert LinearMap(x, ca.vertcat(0, x[1])).steps == []


def test_columns_are_those_of_the_derivatives() -> None:
    """The routine's numbers, put together with NumPy, are the casadi function's."""
    mechanism = common.loaded("delta")
    system = mechanism.system
    partition = choose(system, regular_samples(system, mechanism.home).jacobians)
    functions = MechanismFunctions(MechanismExpressions(system, partition))
    rng = np.random.default_rng(0)
    given = mechanism.home, *(0.1 * rng.normal(size=n) for n in (mechanism.model.nv, 3))
    right, coefficients, *_ = (
        one.full().ravel() for one in functions["forward_columns"].call(given)
    )
    columns = functions.forward_columns
    found = through(
        columns.response, coefficients, ca.DM(columns.right.sparsity(), right.tolist()).full()
    )
    wanted = functions["forward_dynamics_derivatives"].call(given)
    wanted = np.hstack([one.full() for one in wanted[:3]])
    assert worst(np.abs(found - wanted)) < 1e-11 * np.abs(wanted).max()
