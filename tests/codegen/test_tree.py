"""Kinematics and dynamics of trees as expressions against Pinocchio's."""

from __future__ import annotations

import time
from functools import cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, MechanismError, RPSRobot
from rps_pin.closed_loop.editing.split import split
from rps_pin.codegen.expressions.parameters import Parameters
from rps_pin.codegen.expressions.tree import Tree
from tests.closed_loop.random_mechanisms import random_inertia, random_tree, rotation, unit
from tests.each import each
from tests.worst import worst

SORTS = ("revolute", "prismatic", "ball", "free", "turn", "planar", "translation", "helical")
SEEDS = range(12)
WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Case(NamedTuple):
    tree: Tree
    model: pin.Model
    q: Any
    v: Any
    a: Any

    def values(self, *expressions: Any) -> list[np.ndarray]:
        """Values of expressions of the tree's symbols."""
        symbols = [self.tree.q, self.tree.v, self.tree.a]
        function = ca.Function("f", symbols, [ca.densify(x) for x in expressions])
        found = function(self.q, self.v, self.a)
        return [np.array(x) for x in (found if len(expressions) > 1 else [found])]


def tree_of(model: pin.Model) -> Tree:
    system = ClosedLoopModel(model, [], model.names[1]).system
    return Tree(split(model), Parameters(system))


@cache
def case(seed: int) -> Case:
    """A random tree with rotors, some of its joints split, and a motion."""
    rng = np.random.default_rng(seed)
    sorts = SORTS if seed % 4 == 3 else (*SORTS, "zyx", "universal")
    model = random_tree(rng, sorts, planar=seed % 4 == 3)
    model.armature = rng.uniform(0.1, 1.0, size=model.nv)
    whole = split(model)
    q = pin.integrate(whole, pin.neutral(whole), rng.normal(size=whole.nv))
    return Case(tree_of(model), whole, q, rng.normal(size=whole.nv), rng.normal(size=whole.nv))


def relative(found: Any, expected: Any) -> float:
    """Largest error over the largest entry."""
    expected = np.asarray(expected)
    return worst(np.reshape(found, expected.shape) - expected) / worst(expected, 1e-300)


def test_the_cases_hold_every_sort_of_joint() -> None:
    names = {joint.shortname() for seed in SEEDS for joint in list(case(seed).model.joints)[1:]}
    assert len(names) >= 10


@each("seed", SEEDS)
def test_inverse_dynamics(seed: int) -> None:
    c = case(seed)
    rng, data, tree = np.random.default_rng(seed), c.model.createData(), c.tree
    external, forces = {}, pin.StdVec_Force()
    for joint in range(c.model.njoints):
        wrench = pin.Force(rng.normal(size=6) * (joint % 2))
        forces.append(wrench)
        if joint % 2:
            external[joint] = ca.SX(wrench.linear), ca.SX(wrench.angular)
    none = ca.SX(c.model.nv, 1)
    tau, loaded, bias, weight, weightless = c.values(
        tree.rnea(tree.v, tree.a),
        tree.rnea(tree.v, tree.a, external=external),
        tree.rnea(tree.v, none),
        tree.rnea(none, none),
        tree.rnea(tree.v, tree.a, gravity=False),
    )
    assert relative(tau, pin.rnea(c.model, data, c.q, c.v, c.a)) < 1e-14
    assert relative(loaded, pin.rnea(c.model, data, c.q, c.v, c.a, forces)) < 1e-14
    assert relative(bias, pin.nonLinearEffects(c.model, data, c.q, c.v)) < 1e-14
    assert relative(weight, pin.computeGeneralizedGravity(c.model, data, c.q)) < 1e-14
    floating = c.model.copy()
    floating.gravity.linear = np.zeros(3)
    expected = pin.rnea(floating, floating.createData(), c.q, c.v, c.a)
    assert relative(weightless, expected) < 1e-14


@each("seed", SEEDS)
def test_mass_matrix_and_energies(seed: int) -> None:
    c = case(seed)
    data = c.model.createData()
    upper = np.triu(np.array(pin.crba(c.model, data, c.q)).reshape(c.model.nv, c.model.nv))
    mass, kinetic, potential = c.values(
        c.tree.mass_matrix(), c.tree.kinetic_energy(), c.tree.potential_energy()
    )
    expected = upper + np.triu(upper, 1).T
    assert relative(mass, expected) < 1e-14
    assert relative(kinetic[0, 0], c.v @ expected @ c.v / 2) < 1e-14
    scale = 9.81 * sum(inertia.mass for inertia in c.model.inertias)  # of weights at 1 m
    energy = pin.computePotentialEnergy(c.model, data, c.q)
    assert worst(potential[0, 0] - energy) < 1e-14 * scale


@each("seed", SEEDS)
def test_integrate_and_tangent(seed: int) -> None:
    c = case(seed)
    moved, tangent = c.values(c.tree.integrate(c.tree.q, c.tree.v), c.tree.tangent(c.tree.q))
    assert relative(moved, pin.integrate(c.model, c.q, c.v)) < 1e-14
    h = 1e-4
    ahead, back = (
        [pin.integrate(c.model, c.q, sign * h * e) for e in np.eye(c.model.nv)] for sign in (1, -1)
    )
    assert worst(tangent - (np.transpose(ahead) - np.transpose(back)) / (2 * h)) < 1e-7


@each("seed", SEEDS)
def test_placements_and_jacobians_of_frames(seed: int) -> None:
    c = case(seed)
    data = c.model.createData()
    pin.computeJointJacobians(c.model, data, c.q)
    pin.updateFramePlacements(c.model, data)
    for frame in range(c.model.nframes):
        rotation, origin, jacobian = c.values(
            *c.tree.frame_placement(frame), c.tree.frame_jacobian(frame)
        )
        assert relative(rotation, data.oMf[frame].rotation) < 1e-14
        assert worst(origin[:, 0] - data.oMf[frame].translation) < 1e-14 * 5
        expected = np.array(pin.getFrameJacobian(c.model, data, frame, WORLD))
        assert worst(jacobian - expected.reshape(6, c.model.nv)) < 1e-14 * 5
    rotation, origin = c.values(*c.tree.world(c.model.njoints - 1))
    assert worst(rotation - data.oMi[c.model.njoints - 1].rotation) < 1e-14
    assert worst(origin[:, 0] - data.oMi[c.model.njoints - 1].translation) < 1e-14 * 5


@each("seed", SEEDS)
def test_placements_and_subspaces_of_joints(seed: int) -> None:
    c = case(seed)
    data = c.model.createData()
    pin.forwardKinematics(c.model, data, c.q)
    for joint in range(1, c.model.njoints):
        rotation, origin = c.values(*c.tree.placement[joint])
        assert worst(rotation - data.liMi[joint].rotation) < 1e-14
        assert worst(origin[:, 0] - data.liMi[joint].translation) < 1e-14
        assert c.tree.parents[joint] == c.model.parents[joint]
        linear, angular = c.tree.subspace[joint]
        own = c.model.joints[joint]
        assert c.tree.columns[joint] == range(own.idx_v, own.idx_v + own.nv)
        assert linear.shape == angular.shape == (3, own.nv)


def test_zeros_are_structural() -> None:
    """Of branches that do not move each other, and of motion in a plane."""
    model = pin.Model()
    for branch in range(2):
        last = 0
        for joint in range(2):
            turned = pin.SE3(pin.rpy.rpyToMatrix(0, 0, 0.3), np.array([0.5, 0, 0]))
            last = model.addJoint(last, pin.JointModelRZ(), turned, f"{branch}{joint}")
            model.appendBodyToJoint(last, pin.Inertia.FromBox(1.0, 1, 0.1, 0.1), turned)
    model.addFrame(pin.Frame("tip", last, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    model.gravity.linear = np.array([0.0, -9.81, 0.0])
    tree = tree_of(model)
    pattern = np.array(tree.mass_matrix().sparsity())
    assert np.array(pattern).tolist() == [[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 1], [0, 0, 1, 1]]
    # Columns of the branch's two joints: x, y and the turn of the first; the turn of the last.
    assert tree.frame_jacobian(model.getFrameId("tip")).nnz() == 4
    assert all(rotation.nnz() == 5 for rotation, _ in tree.placement[1:])


def test_axes_through_a_point_do_not_move_it() -> None:
    """The centre of a universal joint, at the end of a slide: one column of three moves it."""
    model, here = pin.Model(), pin.SE3.Identity()
    slide = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Random(), "slide")
    cross = pin.JointModelUniversal(np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))
    joint = model.addJoint(slide, cross, pin.SE3(np.eye(3), np.array([0, 0, 0.3])), "cross")
    model.addFrame(pin.Frame("centre", joint, 0, here, pin.FrameType.OP_FRAME))
    tree = tree_of(model)
    jacobian = tree.frame_jacobian(model.getFrameId("centre"))
    assert [jacobian[:3, k].nnz() for k in range(3)] == [3, 0, 0]
    assert [jacobian[3:, k].nnz() for k in range(3)] == [0, 3, 3]


def operations(tree: Tree, expression: Any) -> int:
    """Number of arithmetic operations in an expression."""
    symbols = [tree.q, tree.v, tree.a, tree.parameters.symbols]
    function = ca.Function("f", symbols, [expression], {"cse": True})
    idle = (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST)
    kinds = [function.instruction_id(k) for k in range(function.n_instructions())]
    return sum(kind not in idle for kind in kinds)


def test_number_of_operations_of_the_3_rps() -> None:
    """What it takes today; more would be a step back."""
    tree = tree_of(RPSRobot.from_preset("sokolov").mechanism.model)
    assert operations(tree, tree.rnea(tree.v, tree.a)) <= 55
    assert operations(tree, tree.mass_matrix()) == 0  # its legs and rods have no mass
    micro = tree_of(RPSRobot.from_preset("micro").mechanism.model)
    assert operations(micro, micro.rnea(micro.v, micro.a)) <= 127
    assert operations(micro, micro.mass_matrix()) <= 21


def test_a_chain_of_60_joints_builds_within_seconds() -> None:
    rng = np.random.default_rng(0)
    model, last = pin.Model(), 0
    for index in range(60):
        at = pin.SE3(rotation(rng), rng.normal(size=3))
        last = model.addJoint(last, pin.JointModelRevoluteUnaligned(unit(rng)), at, str(index))
        model.appendBodyToJoint(last, random_inertia(rng), pin.SE3.Identity())
    start = time.process_time()
    tree = tree_of(model)
    tau, mass = tree.rnea(tree.v, tree.a), tree.mass_matrix()
    assert time.process_time() - start < 30  # 0.4 s on a quiet core
    function = ca.Function("f", [tree.q, tree.v, tree.a], [tau, mass])
    q, v, a = rng.normal(size=(3, 60))
    found, inertia = (np.array(x) for x in function(q, v, a))
    data = model.createData()
    assert relative(found, pin.rnea(model, data, q, v, a)) < 1e-12
    upper = np.triu(pin.crba(model, data, q))
    assert relative(np.triu(inertia), upper) < 1e-13


@each("seed", SEEDS)
def test_lengths_of_quaternions_and_of_cosine_and_sine(seed: int) -> None:
    """As many as q has more entries than v; no velocity changes them."""
    c = case(seed)
    model, lengths = c.model, c.tree.unit_lengths(c.tree.q)
    assert lengths.shape == (model.nq - model.nv, 1)
    if model.nq > model.nv:
        slopes = ca.jacobian(lengths, c.tree.q)
        found, along = c.values(lengths, slopes @ c.tree.tangent(c.tree.q))
        assert worst(found, along) < 1e-14
        of = ca.Function("of", [c.tree.q], [lengths])
        changed = pin.normalize(model, 2 * c.q) != 2 * c.q
        np.testing.assert_allclose(of(np.where(changed, 2 * c.q, c.q)), 3.0, rtol=1e-14)


def test_massless_links_cost_nothing() -> None:
    """Of a chain of three hinges only the last link of which has mass."""
    model, last = pin.Model(), 0
    for index in range(3):
        at = pin.SE3(np.eye(3), np.array([0.0, 0.2, 0.3]))
        last = model.addJoint(last, pin.JointModelRX(), at, str(index))
    tree = tree_of(model)
    none = tree.rnea(tree.v, tree.a)
    assert none.shape == (3, 1)
    assert operations(tree, none) == 0
    assert tree.mass_matrix().nnz() == 0


def test_gravity_that_turns_is_refused() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "hinge")
    parameters = Parameters(ClosedLoopModel(model, [], "hinge").system)
    model.gravity = pin.Motion(np.array([0, 0, -9.81, 0, 0, 1.0]))
    with pytest.raises(MechanismError, match="angular part"):
        Tree(model, parameters)


def test_joints_that_were_not_split_are_refused_by_name() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelSphericalZYX(), pin.SE3.Identity(), "shoulder")
    parameters = Parameters(ClosedLoopModel(model, [], "shoulder").system)
    with pytest.raises(MechanismError, match="'shoulder' of type SphericalZYX"):
        Tree(model, parameters)
