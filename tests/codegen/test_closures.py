"""Rows of closures as expressions, against `ClosureEquations` and differences."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

import rps_pin
from rps_pin import ClosedLoopModel, JointCoupling, LoopClosure
from rps_pin.closed_loop.constraints.closures import KINDS, Closure
from rps_pin.closed_loop.constraints.equations import ClosureEquations
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.codegen.expressions.closures import closure_rows
from rps_pin.codegen.expressions.parameters import Parameters
from rps_pin.codegen.expressions.tree import Tree
from rps_pin.errors import MechanismError
from tests.closed_loop.random_mechanisms import (
    EVERY_KIND,
    allowed_placement,
    case,
    joint_model,
    random_closure,
    random_placement,
    slopes,
)
from tests.worst import worst

Array = NDArray[np.float64]

URDF = Path(rps_pin.__file__).parent / "urdf"


def tree_of(system: ConstraintSystem, names: Sequence[str] = ()) -> Tree:
    parameters = Parameters(system, names)
    return Tree(parameters.model, parameters)


def system_of(model: pin.Model, closures: Sequence[Closure]) -> ConstraintSystem:
    return ConstraintSystem(model, closures, [model.names[1]])


class Numbers(NamedTuple):
    """Rows at a configuration and velocity, as the package turns them."""

    gap: Array
    jacobian: Array
    bias: Array
    rate: Array
    opening: float
    turned: tuple[Array, Array]
    """Jacobian and bias by `in_package`."""


class Rows:
    """Rows of a mechanism as expressions, and as numbers."""

    def __init__(self, system: ConstraintSystem, names: Sequence[str] = ()) -> None:
        self.equations = system.equations
        self.tree = tree_of(system, names)
        self.rows = rows = closure_rows(self.tree, self.equations)
        turned = [rows.in_package(x) for x in (rows.gap, rows.rate, rows.jacobian, rows.bias)]
        of_package = [rows.package_jacobian(), rows.package_bias(), rows.opening]
        outputs = [ca.densify(x) for x in (*turned, *of_package)]
        parameters = self.tree.parameters
        symbols = [self.tree.q, self.tree.v, parameters.symbols]
        self.function = ca.Function("rows", symbols, outputs)

    def __call__(self, q: Array, v: Array, parameters: Array | None = None) -> Numbers:
        numbers = self.tree.parameters.nominal if parameters is None else parameters
        gap, rate, *matrices = (x.toarray() for x in self.function(q, v, numbers))
        jacobian, bias, of_package, bias_of_package, opening = matrices
        turned = (jacobian, bias[:, 0])
        opening = float(opening[0, 0])
        return Numbers(gap[:, 0], of_package, bias_of_package[:, 0], rate[:, 0], opening, turned)


def errors(rows: Rows, q: Array, v: Array) -> list[Array]:
    """Differences from the package, which are exact for any q and v."""
    equations, found = rows.equations, rows(q, v)
    return [
        found.gap - equations.gaps(q),
        found.jacobian - equations.jacobian(q),
        found.bias - equations.bias(q, v),
        found.rate - found.turned[0] @ v,
        np.array([found.opening - opening(equations, q)]),
    ]


def opening(equations: ClosureEquations, q: Array) -> float:
    """Sum of the squared gaps by which the package finds loops open, m^2."""
    scaled = equations.row_scale * equations.gaps(q)
    total = 0.0
    for closure in equations.closures:
        if isinstance(closure, JointCoupling):
            total += float(scaled[equations.rows(closure.name).start] ** 2)
    for frames in equations.closed_frames:
        placement = frames.constraint_data.c1Mc2
        p, R = placement.translation.tolist(), placement.rotation.T.ravel().tolist()
        total += frames.selected.squared_gap(equations.length, p, R)
    return total


def moved(rng: np.random.Generator, model: pin.Model, q: Array, size: float) -> Array:
    return np.asarray(pin.integrate(model, q, size * rng.normal(size=model.nv)))


# Against the package ------------------------------------------------------------------------------


#: Kinds, in space and in the plane; there a closure that allows all motion in it does nothing.
CASES = [(kind, False) for kind in EVERY_KIND]
CASES += [(kind, True) for kind in EVERY_KIND if kind != "planar"]


@pytest.mark.parametrize(("kind", "planar"), CASES)
def test_rows_are_those_of_the_package(kind: str, planar: bool) -> None:
    """Closed, slightly open and wide open; at velocities that open the loops."""
    rng, found = np.random.default_rng(1), []
    for seed in range(2):
        c = case(seed, kinds=[kind], planar=planar)
        model = c.mechanism.model
        rows = Rows(c.mechanism.system)
        for size in (0.0, 1e-4, 0.3):
            q = moved(rng, model, c.q, size)
            found += errors(rows, q, rng.normal(size=model.nv))
        closed = rows(c.q, c.v)
        found += [
            closed.turned[0] - rows.equations.jacobian(c.q),
            closed.turned[1] - rows.equations.bias(c.q, c.v),
        ]
    assert worst(*found) < 1e-12


@pytest.mark.parametrize(
    "name", ["rps", "stewart", "delta", "delta_rods", "five_bar", "four_bar", "slider_crank"]
)
def test_rows_of_mechanisms_that_come_with_the_package(name: str) -> None:
    rng, found = np.random.default_rng(2), []
    mechanism = mechanism_of(name)
    rows = Rows(mechanism.system)
    q = mechanism.home
    for size in (0.0, 1e-3, 0.1):
        here = moved(rng, mechanism.model, q, size)
        found += errors(rows, here, rng.normal(size=mechanism.model.nv))
    assert worst(*found) < 1e-12


def mechanism_of(name: str) -> ClosedLoopModel:
    return ClosedLoopModel.load(URDF / f"{name}.yaml")


JOINTS = ["revolute", "universal", "zyx", "helical", "ball", "planar", "turn", "translation"]


def carried(kind: str, seed: int) -> tuple[pin.Model, LoopClosure, pin.SE3]:
    """Two branches on a body that two joints move, joined by a closure; b's placement in a.

    Some joints are such as `split` replaces.
    """
    rng = np.random.default_rng([7, seed])
    model = pin.Model()
    body = 0
    ends = []
    for name, sorts in (("carrier", ["free", "revolute"]), ("a", JOINTS), ("b", JOINTS)):
        joint = body
        count = 2 if name == "carrier" else int(rng.integers(0 if name == "a" else 1, 4))
        for index in range(count):
            sort = sorts[index] if name == "carrier" else str(rng.choice(sorts))
            made = joint_model(rng, sort, planar=False)
            joint = model.addJoint(joint, made, random_placement(rng), f"{name}_{index}")
        if name == "carrier":
            body = joint
        else:
            ends.append(joint)
    closure = random_closure(rng, kind, "loop_")
    for joint, frame in zip(ends, (closure.frame_a, closure.frame_b), strict=True):
        placement = random_placement(rng)
        model.addFrame(pin.Frame(frame, joint, 0, placement, pin.FrameType.OP_FRAME))
    return model, closure, allowed_placement(closure, rng)


@pytest.mark.parametrize("kind", KINDS)
def test_a_moving_common_ancestor_has_no_columns(kind: str) -> None:
    """And the package's rows follow from it, at any configuration."""
    rng, found = np.random.default_rng(3), []
    for seed in range(3):
        model, closure, _ = carried(kind, seed)
        rows = Rows(system_of(model, [closure]))
        assert rows.rows.jacobian[:, : 6 + 1].nnz() == 0
        q = moved(rng, model, pin.neutral(model), 1.0)
        found += errors(rows, q, rng.normal(size=model.nv))
    assert worst(*found) < 1e-12


@pytest.mark.parametrize("kind", ["spherical", "rigid"])
def test_closed_loops_on_a_moving_ancestor_need_only_be_turned(kind: str) -> None:
    rng, found = np.random.default_rng(4), []
    for seed in range(3):
        model, closure, allowed = carried(kind, seed)
        q = moved(rng, model, pin.neutral(model), 1.0)
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        a, b = closure.frame_ids(model)
        joint = model.frames[b].parentJoint
        model.frames[b].placement = data.oMi[joint].actInv(data.oMf[a] * allowed)
        rows = Rows(system_of(model, [closure]))
        jacobian = rows.equations.jacobian(q)
        kernel = np.linalg.svd(jacobian)[2][np.linalg.matrix_rank(jacobian) :].T
        v = kernel @ rng.normal(size=kernel.shape[1])
        turned = rows(q, v).turned
        found += [rows(q, v).gap, turned[0] - jacobian, turned[1] - rows.equations.bias(q, v)]
    assert worst(*found) < 1e-12


# Against differences ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", EVERY_KIND)
def test_the_bias_is_the_derivative_of_the_jacobian(kind: str) -> None:
    """In their own axes, at configurations that are open."""
    rng, found = np.random.default_rng(5), []
    for seed in range(2):
        c = case(seed, kinds=[kind])
        model = c.mechanism.model
        tree = tree_of(c.mechanism.system)
        rows = closure_rows(tree, c.mechanism.system.equations)
        function = ca.Function("rows", [tree.q, tree.v], [rows.jacobian, rows.bias])
        q, v = moved(rng, model, c.q, 0.1), rng.normal(size=model.nv)

        def rate(time: Array, q: Array = q, v: Array = v, f: Any = function, m: Any = model) -> Any:
            return f(pin.integrate(m, q, time[0] * v), v)[0].toarray() @ v

        found.append(slopes(rate, 1)[:, 0] - function(q, v)[1].toarray()[:, 0])
    assert worst(*found) < 1e-7


# Structural zeros ---------------------------------------------------------------------------------


def test_planar_loops_have_empty_rows() -> None:
    """A pin of the four-bar: its fifth of rows, out of the plane, and both of directions."""
    rows = Rows(mechanism_of("four_bar").system).rows
    filled = sorted(set(rows.jacobian.sparsity().get_triplet()[0]))
    assert filled == [0, 2]  # x and z; the axis is y
    assert sorted(set(rows.bias.sparsity().get_triplet()[0])) == [0, 2]
    assert sorted(set(rows.gap.sparsity().get_triplet()[0])) == [0, 2]


def test_joints_through_the_point_have_no_columns() -> None:
    """The idle spin about a rod's own axis, and a ball's rotations about its centre."""
    model = pin.Model()
    at = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3]))
    first = model.addJoint(0, pin.JointModelRX(), at, "first")
    spin = model.addJoint(first, pin.JointModelRZ(), at, "spin")
    along = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5]))
    ball = model.addJoint(spin, pin.JointModelSpherical(), along, "ball")
    model.addFrame(pin.Frame("tip", ball, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    jacobian = Rows(system_of(model, [LoopClosure("tip", "universe")])).rows.jacobian
    assert jacobian[:, 1:].nnz() == 0
    assert jacobian[:, 0].nnz() == 2


def test_a_coupling_has_two_constants() -> None:
    model = mechanism_of("five_bar").model
    one, other = model.names[1], model.names[3]
    rows = Rows(system_of(model, [JointCoupling(one, other, -2.0, 0.5)])).rows
    assert rows.jacobian.is_constant()
    assert rows.jacobian.nnz() == 2
    assert rows.bias.nnz() == 0


@pytest.mark.parametrize("loops", [8, 16])
def test_the_cost_of_loops_grows_as_their_number(loops: int) -> None:
    """A chain of four-bars, each on the one before: as many operations as of one, each."""
    alone, chain = (_operations(*four_bars(count)) for count in (1, loops))
    assert chain <= loops * alone


def four_bars(count: int) -> tuple[pin.Model, list[LoopClosure]]:
    """Each crank and coupler stands on the coupler before, and is closed by a rocker."""
    model, closures = pin.Model(), []
    base, here = 0, pin.SE3.Identity()
    for index in range(count):
        rocker_at = here * pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))
        rocker = model.addJoint(base, pin.JointModelRZ(), rocker_at, f"rocker_{index}")
        crank = model.addJoint(base, pin.JointModelRZ(), here, f"crank_{index}")
        arm = pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))
        base = model.addJoint(crank, pin.JointModelRZ(), arm, f"coupler_{index}")
        for name, joint, length in (("a", base, 0.45), ("b", rocker, 0.4)):
            tip = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
            model.addFrame(pin.Frame(f"{name}_{index}", joint, 0, tip, pin.FrameType.OP_FRAME))
        closures.append(LoopClosure(f"a_{index}", f"b_{index}"))
        here = arm
    return model, closures


def _operations(model: pin.Model, closures: list[LoopClosure]) -> int:
    system = system_of(model, closures)
    tree = tree_of(system)
    rows = closure_rows(tree, system.equations)
    outputs = [rows.gap, rows.jacobian, rows.bias]
    return int(ca.Function("rows", [tree.q, tree.v], outputs).n_instructions())


# Gaps of large angles -----------------------------------------------------------------------------


def turned_by(angle: float, axis: Array, kind: str) -> tuple[Numbers, Array]:
    """Rows of a closure whose frame b is turned by an angle, and the package's gaps."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint")
    placement = pin.SE3(pin.exp3(angle * axis), np.zeros(3))
    model.addFrame(pin.Frame("a", 0, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    model.addFrame(pin.Frame("b", joint, 0, placement, pin.FrameType.OP_FRAME))
    rows = Rows(system_of(model, [LoopClosure("a", "b", kind)]))
    q = np.zeros(1)
    return rows(q, q), rows.equations.gaps(q)


@pytest.mark.parametrize("kind", ["rigid", "prismatic", "revolute"])
@pytest.mark.parametrize("angle", [0.0, 1e-170, 1e-20, 1e-9, 1e-3, 1.0, 3.0, 3.14])
def test_gaps_of_any_angle(kind: str, angle: float) -> None:
    axis = np.array([0.6, 0.0, 0.8]) if kind != "revolute" else np.array([0.6, 0.8, 0.0])
    found, expected = turned_by(angle, axis, kind)
    assert worst(found.gap - expected) < 1e-12


@pytest.mark.parametrize("kind", ["rigid", "prismatic", "revolute"])
def test_half_a_turn_is_no_closed_loop(kind: str) -> None:
    for axis in np.eye(3)[:2]:
        found, _ = turned_by(np.pi, axis, kind)
        assert np.linalg.norm(found.gap) == pytest.approx(np.pi, abs=1e-9)
        assert found.opening == pytest.approx(4.0)  # the diameter's square; the length is 1 m


def test_vanishing_angles_have_finite_derivatives() -> None:
    x = ca.SX.sym("x", 3)
    joint = pin.Model()
    joint.addJoint(0, pin.JointModelSphericalZYX(), pin.SE3.Identity(), "joint")
    for kind in ("revolute", "rigid"):
        model = joint.copy()
        for frame, parent in (("a", 0), ("b", 1)):
            model.addFrame(pin.Frame(frame, parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
        system = system_of(model, [LoopClosure("a", "b", kind)])
        tree = tree_of(system)
        rows = closure_rows(tree, system.equations)
        slope = ca.substitute(ca.jacobian(rows.gap, tree.q), tree.q, x)
        value = ca.Function("slope", [x], [slope])(np.zeros(3)).toarray()
        assert worst(value - system.equations.jacobian(np.zeros(3))) < 1e-12


# Parameters and bad input -------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_frames_stand_where_the_parameters_say(kind: str) -> None:
    """Moved frames as symbols: rows of the mechanism whose frames stand there."""
    rng = np.random.default_rng(6)
    c = case(0, kinds=[kind])
    closure, model = c.mechanism.closures[0], c.mechanism.model.copy()
    move = 0.3 * rng.normal(size=12)
    for index, part in zip(closure.frame_ids(model), (move[:6], move[6:]), strict=True):
        turn = pin.rpy.rpyToMatrix(*part[3:])
        model.frames[index].placement = model.frames[index].placement * pin.SE3(turn, part[:3])
    rows = Rows(c.mechanism.system, [f"closure:{closure.name}"])
    found, there = rows(c.q, c.v, move), ClosureEquations(model, c.mechanism.closures)
    errors = [found.gap - there.gaps(c.q), found.jacobian - there.jacobian(c.q)]
    assert worst(*errors, found.bias - there.bias(c.q, c.v)) < 1e-12


def test_a_frame_that_is_not_in_the_tree_is_named() -> None:
    mechanism = mechanism_of("four_bar")
    other = tree_of(mechanism_of("delta").system)
    with pytest.raises(MechanismError, match="no frame 'coupler_tip'; there are:"):
        closure_rows(other, mechanism.system.equations)
