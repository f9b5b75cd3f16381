"""Choice of independent velocities: mobility, condition, preference; and the order that follows."""

from __future__ import annotations

import time
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from benchmarks.legged import biped, leg
from rps_pin import ClosedLoopModel, LoopClosure
from rps_pin.closed_loop.assembly.closing import closed_gap
from rps_pin.closed_loop.editing.split import split
from rps_pin.codegen.expressions.closures import closure_rows
from rps_pin.codegen.expressions.elimination import Householder
from rps_pin.codegen.expressions.independent import Partition, choose, regular_samples
from rps_pin.codegen.expressions.parameters import Parameters
from rps_pin.codegen.expressions.tree import Tree
from rps_pin.errors import InputError, MechanismError
from tests.closed_loop.random_mechanisms import pooled
from tests.quick import quick
from tests.worst import worst

Array = NDArray[np.float64]
FILES = sorted((Path(__file__).parents[2] / "urdf").glob("*.yaml"))
#: Motions without an actuator: rods that spin, a floating pelvis, fingers held by springs.
UNDERDRIVEN = {"cassie_biped", "cassie_leg", "cassie_leg_free", "gripper"}


def chosen(mechanism: ClosedLoopModel, home: Array | None = None) -> Partition:
    """The partition of a mechanism, and proof that it is one."""
    system = mechanism.system
    samples = regular_samples(system, mechanism.home if home is None else home)
    partition = choose(system, samples.jacobians)
    both = np.concatenate([partition.independent, partition.dependent])
    assert sorted(both) == list(range(mechanism.model.nv))
    assert partition.rank == partition.dependent.size
    assert partition.redundant_rows == mechanism.constraint_size - partition.rank
    for q, jacobian in zip(*samples, strict=True):
        assert system.equations.largest_gap(system.equations.gaps(q)) <= closed_gap(system, q)
        assert np.array_equal(jacobian, system.scaled(mechanism.jacobian(q)))
        values = np.linalg.svd(jacobian[:, partition.dependent], compute_uv=False)
        condition = values[0] / values[-1] if values.size else 1.0
        assert condition <= partition.condition * (1 + 1e-9)
    return partition


def householder_error(mechanism: ClosedLoopModel, partition: Partition) -> float:
    """Largest error of forces and velocities at other samples against NumPy, over the condition."""
    system = mechanism.system
    samples = regular_samples(system, mechanism.home, seed=1)
    jacobians = samples.jacobians
    mask = (np.abs(jacobians) > 1e-12).any(axis=0)[:, partition.dependent]
    pattern = ca.Sparsity.triplet(*mask.shape, *[index.tolist() for index in np.nonzero(mask)])
    A, f, b = ca.SX.sym("A", pattern), ca.SX.sym("f", mask.shape[1]), ca.SX.sym("b", mask.shape[0])
    factors = Householder(A)
    solve = ca.Function("f", [A, f, b], [factors.transposed(f), factors.solve(b)])
    rng = np.random.default_rng(0)
    errors = []
    for jacobian in jacobians:
        dependent = np.where(mask, jacobian[:, partition.dependent], 0.0)
        force, motion = rng.normal(size=mask.shape[1]), rng.normal(size=mask.shape[1])
        y, x = solve(ca.DM(pattern, dependent.T[mask.T]), force, dependent @ motion)
        multipliers = np.linalg.lstsq(dependent.T, force, rcond=None)[0]
        condition = np.linalg.cond(dependent)
        error = worst(np.array(y)[:, 0] - multipliers, np.array(x)[:, 0] - motion)
        errors.append(error / condition)
    return worst(*errors)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_mechanisms_of_the_package(path: Path) -> None:
    """Their actuated joints determine the motion, where enough, and are the independent ones."""
    mechanism = ClosedLoopModel.load(path)
    partition = chosen(mechanism)
    description = mechanism.describe()
    assert partition.is_actuated == (path.stem not in UNDERDRIVEN)
    assert partition.mobility == description.mobility
    assert partition.redundant_rows == description.redundant_rows
    assert partition.condition < 100
    assert householder_error(mechanism, partition) < 1e-12


@pytest.mark.parametrize("planar", [False, True])
def test_random_mechanisms(planar: bool) -> None:
    for seed in range(12):
        mechanism = pooled(seed, planar=planar).mechanism
        partition = chosen(mechanism)
        assert partition.mobility == mechanism.describe().mobility
        assert partition.is_actuated
        assert partition.condition < 1e5
        assert householder_error(mechanism, partition) < 1e-11


@pytest.mark.parametrize("planar", [False, True])
def test_over_and_underactuated(planar: bool) -> None:
    """Well conditioned sets; as many actuated ones in them as move independently."""
    for seed in range(8):
        case = pooled(seed, planar=planar)
        mechanism, model = case.mechanism, case.mechanism.model
        names = list(model.names)[1:]
        for actuated in (mechanism.actuated[:1], names, names[-1:]):
            other = ClosedLoopModel(model, mechanism.closures, actuated, home=case.q)
            partition = chosen(other)
            description = other.describe()
            assert partition.mobility == description.mobility
            assert partition.condition < 1e5
            driven = np.intersect1d(partition.independent, other.actuated_indices).size
            assert driven <= description.actuated_rank
            if description.actuation == "sufficient":
                assert driven == partition.mobility


def chain(loops: int, kind: str, slanted: bool = False) -> tuple[ClosedLoopModel, Array]:
    """Parallelograms in a row, in one plane of any direction, and a configuration of them."""
    model = pin.Model()
    turn = pin.JointModelRY()
    plane = pin.exp3(np.array([0.3, -0.5, 0.7])) if slanted else np.eye(3)

    def bar(parent: int, at: float, name: str, length: float) -> int:
        place = pin.SE3(np.eye(3), np.array([at, 0.0, 0.0]))
        place = pin.SE3(plane, np.zeros(3)) * place if parent == 0 else place
        joint = model.addJoint(parent, turn, place, name)
        tip = pin.SE3(np.eye(3), np.array([length, 0, 0]))
        model.addFrame(pin.Frame(f"{name}_tip", joint, 0, tip, pin.FrameType.OP_FRAME))
        return int(joint)

    crank, closures = bar(0, 0.0, "crank", 0.2), []
    for i in range(loops):
        bar(crank, 0.2, f"coupler_{i}", 0.5)
        crank = bar(0, (i + 1) * 0.5, f"rocker_{i}", 0.2)
        axis = (0.0, 1.0, 0.0) if kind == "point_on_line" else None
        closures.append(LoopClosure(f"rocker_{i}_tip", f"coupler_{i}_tip", kind, axis=axis))
    model.lowerPositionLimit = np.full(model.nq, -np.inf)
    model.upperPositionLimit = np.full(model.nq, np.inf)
    home = np.array([1.0 if "coupler" in name else -1.0 for name in list(model.names)[1:]])
    return ClosedLoopModel(model, closures, ["crank"]), home


@pytest.mark.parametrize(
    ("kind", "slanted"),
    quick(
        [(kind, slanted) for kind in ("point_on_line", "spherical") for slanted in (False, True)],
        [("point_on_line", False), ("spherical", True)],
    ),
)
def test_chains_of_loops(kind: str, slanted: bool) -> None:
    """The cost of J_d grows with the number of loops, also where a row of each is redundant."""
    counts, operations = [4, 12, 36], []
    for loops in counts:
        mechanism, home = chain(loops, kind, slanted)
        samples = regular_samples(mechanism.system, home)
        partition = choose(mechanism.system, samples.jacobians)
        assert (partition.mobility, partition.is_actuated) == (1, True)
        assert partition.redundant_rows == loops * (kind == "spherical")
        mask = (np.abs(samples.jacobians) > 1e-12).any(axis=0)[:, partition.dependent]
        pattern = ca.Sparsity.triplet(*mask.shape, *[index.tolist() for index in np.nonzero(mask)])
        A, f = ca.SX.sym("A", pattern), ca.SX.sym("f", mask.shape[1])
        solve = ca.Function("f", [A, f], [Householder(A).transposed(f)])
        operations.append(solve.n_instructions())
    assert worst(np.diff(np.log(operations)) / np.diff(np.log(counts))) <= 1.1


def test_hundreds_of_loops_take_no_time() -> None:
    """Ranks and conditions of large matrices come from pivots: 0.4 s for 256 loops."""
    mechanism, home = chain(128, "spherical")
    start = time.process_time()
    samples = regular_samples(mechanism.system, home)
    partition = choose(mechanism.system, samples.jacobians)
    assert time.process_time() - start < 20.0
    assert (partition.mobility, partition.redundant_rows, partition.is_actuated) == (1, 128, True)
    true = np.linalg.cond(samples.jacobians[0][:, partition.dependent])
    assert true / 30 < partition.condition < 10 * true


@pytest.mark.parametrize("planar", [False, True])
def test_inverse_dynamics_of_symbols_is_the_engines(planar: bool) -> None:
    """Actuator and constraint forces from J as generated code has it, redundant rows included."""
    for seed in range(10):
        case = pooled(seed, planar=planar)
        mechanism, system = case.mechanism, case.mechanism.system
        tree = Tree(split(mechanism.model), Parameters(system, ()))
        rows = closure_rows(tree, system.equations)
        J = ca.sparsify(rows.jacobian)
        samples = regular_samples(system, mechanism.home)
        pattern = np.zeros(J.shape, dtype=bool)
        pattern[J.sparsity().get_triplet()] = True
        partition = choose(system, samples.jacobians, pattern)
        independent, dependent = partition.independent.tolist(), partition.dependent.tolist()
        tau = ca.SX(tree.rnea(tree.v, tree.a))
        factors = Householder(J[:, dependent], row_scale=mechanism.row_scale)
        forces = factors.transposed(tau[dependent])
        found = ca.Function(
            "f",
            [tree.q, tree.v, tree.a],
            [tau[independent] - J[:, independent].T @ forces, rows.in_package(forces)],
        )(case.q, case.v, case.a)
        expected = mechanism.inverse_dynamics(case.q, case.v, case.a)
        for mine, theirs in zip(found, (expected.tau, expected.constraint_forces), strict=True):
            size = np.abs(theirs).max() * expected.condition
            assert worst(np.array(mine)[:, 0] - theirs) < 1e-12 * size


def test_legs_on_rods() -> None:
    """Base and actuated joints are the independent ones; blocks are as large as one drive."""
    for make in (leg, biped):
        mechanism = make()
        partition = chosen(mechanism)
        base = [mechanism.model.names[1]]
        moving = mechanism.system.velocity_indices([*mechanism.actuated, *base], "to move")
        assert partition.independent.tolist() == moving.tolist()
        assert partition.condition < 100


def test_home_may_be_singular() -> None:
    """All bars in one line: samples stand beside it."""
    mechanism, _ = chain(1, "point_on_line")
    home = np.zeros(mechanism.model.nq)
    partition = chosen(mechanism, home)
    assert (partition.mobility, partition.is_actuated) == (1, True)
    assert partition.condition < 1e3
    samples = regular_samples(mechanism.system, home)
    assert len(samples.configurations) > 3
    assert np.abs(samples.configurations).max(axis=1).min() > 1e-3


@pytest.mark.parametrize(("along", "idle"), [((0.7, 0, 0), [1]), ((0.4, -0.3, 0.5), [])])
def test_a_rod_spins_idly(along: tuple[float, float, float], idle: list[int]) -> None:
    """A rod between two balls: a column vanishes if the rod lies along a coordinate of its ball."""
    model = pin.Model()
    crank = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "crank")
    place = pin.SE3(np.eye(3), np.array([0.3, 0, 0]))
    rod = model.addJoint(crank, pin.JointModelSpherical(), place, "rod")
    place = pin.SE3(np.eye(3), np.array([0.9, 0.2, 0.1]))
    rocker = model.addJoint(0, pin.JointModelRX(), place, "rocker")
    for name, joint, at in (("rod_end", rod, along), ("tip", rocker, (0, 0.4, 0))):
        placement = pin.SE3(np.eye(3), np.array(at, float))
        model.addFrame(pin.Frame(name, joint, 0, placement, pin.FrameType.OP_FRAME))
    mechanism = ClosedLoopModel(model, [LoopClosure("tip", "rod_end", "spherical")], ["crank"])
    partition = chosen(mechanism)
    assert partition.idle.tolist() == idle
    assert (partition.mobility, partition.is_actuated) == (2, False)
    assert partition.independent[0] == 0
    assert partition.independent[1] in (idle or [1, 2, 3])
    assert partition.condition < 100


def test_without_closures_all_are_independent() -> None:
    model = pin.buildSampleModelManipulator()
    tree = ClosedLoopModel(model, [], [str(model.names[2])], home=pin.neutral(model))
    partition = chosen(tree)
    assert (partition.rank, partition.mobility) == (0, model.nv)
    assert partition.independent[0] == tree.actuated_indices[0]


def test_a_structure_has_no_independent_velocity() -> None:
    """Two bars, both ends at points of the world."""
    mechanism, home = chain(1, "spherical")
    model = mechanism.model.copy()
    data = model.createData()
    pin.framesForwardKinematics(model, data, home)
    place = pin.SE3(np.eye(3), data.oMf[model.getFrameId("coupler_0_tip")].translation)
    model.addFrame(pin.Frame("ground", 0, 0, place, pin.FrameType.OP_FRAME))
    closures = [*mechanism.closures, LoopClosure("ground", "coupler_0_tip", "spherical")]
    structure = ClosedLoopModel(model, closures, ["crank"])
    partition = chosen(structure, structure.close(home))
    assert (partition.mobility, partition.rank, partition.redundant_rows) == (0, 3, 3)


def test_same_answer_each_time() -> None:
    mechanism = pooled(3).mechanism
    one, other = (regular_samples(mechanism.system, mechanism.home) for _ in range(2))
    assert worst(one.configurations - other.configurations) == 0
    first, second = (choose(mechanism.system, each.jacobians) for each in (one, other))
    assert first.independent.tolist() == second.independent.tolist()


def test_bad_input() -> None:
    mechanism = ClosedLoopModel.load(FILES[0].with_name("delta.yaml"))
    samples = regular_samples(mechanism.system, mechanism.home)
    jacobians = samples.jacobians
    with pytest.raises(InputError, match=r"\(K, 6, 9\), not \(6, 9\)"):
        choose(mechanism.system, jacobians[0])
    with pytest.raises(InputError, match=r"not \(0, 6, 9\)"):
        choose(mechanism.system, jacobians[:0])
    with pytest.raises(MechanismError, match="rank 0 at some samples and 6 at others"):
        choose(mechanism.system, np.concatenate([jacobians, 0 * jacobians]))
    pattern = np.ones(jacobians.shape[1:], dtype=bool)
    pattern[:, 2] = False
    with pytest.raises(MechanismError, match=r"velocities \[2\] move the closures"):
        choose(mechanism.system, jacobians, pattern)
    with pytest.raises(InputError, match=r"pattern has the shape \(6, 9\), not \(6, 2\)"):
        choose(mechanism.system, jacobians, pattern[:, :2])
