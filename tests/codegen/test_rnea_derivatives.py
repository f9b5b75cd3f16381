"""Derivatives of a tree's inverse dynamics against CasADi's and Pinocchio's."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin

from rps_pin.codegen.expressions.rnea_derivatives import rnea_derivatives
from tests.codegen.test_tree import SEEDS, case, relative
from tests.each import each
from tests.worst import worst


@each("seed", SEEDS)
def test_as_pinocchio_and_casadi(seed: int) -> None:
    c = case(seed)
    tree, model = c.tree, c.model
    by_q, by_v = c.values(*rnea_derivatives(tree, tree.v, tree.a))
    tau = tree.rnea(tree.v, tree.a)
    tangent = tree.tangent(tree.q)
    expected_q, expected_v = c.values(ca.jacobian(tau, tree.q) @ tangent, ca.jacobian(tau, tree.v))
    assert relative(by_q, expected_q) < 1e-13
    assert relative(by_v, expected_v) < 1e-13
    data = model.createData()  # holds the arrays that Pinocchio returns
    found_q, found_v, _ = pin.computeRNEADerivatives(model, data, c.q, c.v, c.a)
    assert relative(by_q, found_q) < 1e-13
    assert relative(by_v, found_v) < 1e-13


@each("seed", SEEDS)
def test_of_weight_alone_and_without_weight(seed: int) -> None:
    c = case(seed)
    tree, still = c.tree, ca.SX(c.model.nv, 1)
    by_q, by_v = rnea_derivatives(tree, still, still)
    assert by_v.nnz() == 0
    data = c.model.createData()
    expected = pin.computeGeneralizedGravityDerivatives(c.model, data, c.q)
    assert relative(c.values(by_q)[0], expected) < 1e-13
    weightless = c.values(*rnea_derivatives(tree, tree.v, tree.a, gravity=False))
    floating = c.model.copy()
    floating.gravity.linear = np.zeros(3)
    data = floating.createData()
    expected_q, expected_v, _ = pin.computeRNEADerivatives(floating, data, c.q, c.v, c.a)
    assert relative(weightless[0], expected_q) < 1e-13
    assert relative(weightless[1], expected_v) < 1e-13


def test_branches_that_do_not_carry_each_other_are_structural_zeros() -> None:
    c = case(0)
    by_q, by_v = rnea_derivatives(c.tree, c.tree.v, c.tree.a)
    carries = np.zeros((c.model.nv, c.model.nv), dtype=bool)
    for joint in range(1, c.model.njoints):
        for other in c.model.supports[joint]:
            if other:
                block = np.ix_(c.tree.columns[joint], c.tree.columns[other])
                carries[block] = carries.T[block] = True
    for found in (by_q, by_v):
        pattern = np.array(ca.DM(found.sparsity(), 1))
        assert worst(pattern[~carries]) == 0
