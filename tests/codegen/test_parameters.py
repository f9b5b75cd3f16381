"""Parameters of generated code: symbols changed against Pinocchio models changed."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, InputError, JointCoupling, LoopClosure, MechanismError
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.editing.split import split
from rps_pin.codegen.expressions.parameters import Parameters, moved_inertia
from rps_pin.codegen.expressions.tree import Tree
from tests.closed_loop.editing.test_split import composite, somewhere, unit, universal
from tests.closed_loop.random_mechanisms import random_inertia
from tests.each import each
from tests.worst import worst

Array = NDArray[np.float64]

#: Joints of the tree: of one part, and split into several.
JOINTS = ("hinge", "cross", "row", "slide", "ball", "leaf")


def tree_model(seed: int = 0) -> pin.Model:
    """A chain with joints that are split, and frames on bodies and on the ground."""
    rng = np.random.default_rng(seed)
    kinds = {
        "hinge": pin.JointModelRevoluteUnaligned(unit(rng)),
        "cross": universal(rng),
        "row": composite(lambda _: pin.JointModelRX(), lambda _: pin.JointModelRY())(rng),
        "slide": pin.JointModelPZ(),
        "ball": pin.JointModelSpherical(),
        "leaf": pin.JointModelRZ(),
    }
    model, last = pin.Model(), 0
    model.gravity.linear = 9.81 * unit(rng)
    for name in JOINTS:
        last = model.addJoint(last, kinds[name], somewhere(rng), name)
        model.appendBodyToJoint(last, random_inertia(rng), pin.SE3.Identity())
        model.addFrame(pin.Frame(f"{name}_tip", last, 0, somewhere(rng), pin.FrameType.OP_FRAME))
    model.addFrame(pin.Frame("socket", 0, 0, somewhere(rng), pin.FrameType.OP_FRAME))
    return model


def system_of(model: pin.Model) -> ConstraintSystem:
    closures = [
        LoopClosure("leaf_tip", "socket", name="loop"),
        JointCoupling("hinge", "slide", 1.0, 0.0, "gear"),
    ]
    return ClosedLoopModel(model, closures, "hinge").system


def move(numbers: Array) -> pin.SE3:
    """The placement of a shift and a turn by roll, pitch and yaw."""
    return pin.SE3(pin.rpy.rpyToMatrix(*numbers[3:]), np.array(numbers[:3]))


def changed(model: pin.Model, group: str, numbers: Array) -> pin.Model:
    """The model with a group's numbers."""
    model = model.copy()
    kind, _, name = group.partition(":")
    if kind == "gravity":
        model.gravity.linear = numbers
    elif kind == "inertia":
        model.inertias[model.getJointId(name)] = pin.Inertia.FromDynamicParameters(numbers)
    elif kind == "mass":
        body = model.inertias[model.getJointId(name)]
        model.inertias[model.getJointId(name)] = pin.Inertia(
            float(numbers[0]), body.lever, body.inertia * float(numbers[0]) / body.mass
        )
    elif kind == "placement":
        joint = model.getJointId(name)
        model.jointPlacements[joint] = model.jointPlacements[joint] * move(numbers)
    elif kind == "payload":
        frame = model.frames[model.getFrameId(name)]
        body = pin.Inertia.FromDynamicParameters(numbers)
        model.appendBodyToJoint(frame.parentJoint, body, frame.placement)
    return model


def quantities(tree: Tree, parameters: Parameters) -> ca.Function:
    """RNEA, mass matrix, energy of weight and a frame's origin as a function of q, v, a, p."""
    out = [
        tree.rnea(tree.v, tree.a),
        ca.densify(tree.mass_matrix()),
        tree.potential_energy(),
        tree.frame_placement(tree.model.getFrameId("leaf_tip"))[1],
    ]
    return ca.Function("f", [tree.q, tree.v, tree.a, parameters.symbols], out)


def expected(model: pin.Model, q: Array, v: Array, a: Array) -> list[Array]:
    """The same of a Pinocchio model."""
    data, whole = model.createData(), model
    upper = np.triu(pin.crba(whole, data, q))
    tau = pin.rnea(whole, data, q, v, a)
    energy = pin.computePotentialEnergy(whole, data, q)
    pin.framesForwardKinematics(whole, data, q)
    tip = np.array(data.oMf[whole.getFrameId("leaf_tip")].translation)
    return [tau, upper + np.triu(upper, 1).T, np.array([energy]), tip]


def relative(found: Any, wanted: list[Array]) -> float:
    """Largest error over the largest entry, of each of several arrays."""
    pairs = [(np.array(x).reshape(y.shape), y) for x, y in zip(found, wanted, strict=True)]
    return worst(*(worst(x - y) / max(1.0, worst(y)) for x, y in pairs))


def random_numbers(rng: np.random.Generator, group: str) -> Array:
    """Numbers that a group can have."""
    kind = group.partition(":")[0]
    if kind in ("inertia", "payload"):
        return np.array(random_inertia(rng).toDynamicParameters())
    if kind == "mass":
        return rng.uniform(0.5, 3, size=1)
    return rng.normal(size={"gravity": 3, "placement": 6, "closure": 12}[kind])


def state(model: pin.Model, seed: int) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(seed)
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    return q, rng.normal(size=model.nv), rng.normal(size=model.nv)


GROUPS = [
    "gravity",
    *(f"{kind}:{name}" for kind in ("inertia", "mass", "placement") for name in JOINTS),
    *(f"payload:{name}_tip" for name in JOINTS),
]


@each("group", GROUPS)
def test_symbols_changed_are_a_model_changed(group: str) -> None:
    model = tree_model()
    system = system_of(model)
    parameters = Parameters(system, [group])
    tree = Tree(split(model), parameters)
    function, (q, v, a) = quantities(tree, parameters), state(tree.model, 1)
    nominal = expected(tree.model, q, v, a)
    assert relative(function(q, v, a, parameters.nominal), nominal) < 1e-13
    numbers = random_numbers(np.random.default_rng(2), group)
    assert numbers.shape == parameters.nominal.shape == (len(parameters.labels),)
    wanted = expected(split(changed(model, group, numbers)), q, v, a)
    assert relative(wanted, nominal) > 1e-3
    assert relative(function(q, v, a, numbers), wanted) < 1e-13


def test_all_groups_together() -> None:
    model = tree_model()
    groups = [group for group in GROUPS if not group.startswith("inertia")]
    parameters = Parameters(system_of(model), groups)
    tree = Tree(split(model), parameters)
    function, (q, v, a) = quantities(tree, parameters), state(tree.model, 3)
    rng = np.random.default_rng(4)
    changes = {group: random_numbers(rng, group) for group in groups}
    # The masses first: a payload is no part of the body that its mass scales.
    for group in sorted(groups, key=lambda group: group.startswith("payload")):
        model = changed(model, group, changes[group])
    wanted = expected(split(model), q, v, a)
    assert relative(function(q, v, a, parameters.vector(changes)), wanted) < 1e-13


@each("group", GROUPS)
def test_derivatives_by_parameters(group: str) -> None:
    """Against central differences of Pinocchio's inverse dynamics."""
    model = tree_model()
    parameters = Parameters(system_of(model), [group])
    tree = Tree(split(model), parameters)
    tau, p = tree.rnea(tree.v, tree.a), parameters.symbols
    derivative = ca.Function("d", [tree.q, tree.v, tree.a, p], [ca.jacobian(tau, p)])
    q, v, a = state(tree.model, 5)
    found, columns, h = np.array(derivative(q, v, a, parameters.nominal)), [], 1e-5
    for k in range(parameters.nominal.size):
        sides = []
        for sign in (1, -1):
            numbers = parameters.nominal.copy()
            numbers[k] += sign * h
            one = split(with_dynamic_parameters(model, group, numbers))
            sides.append(np.array(pin.rnea(one, one.createData(), q, v, a)))
        columns.append((sides[0] - sides[1]) / (2 * h))
    assert worst(found - np.transpose(columns)) < 1e-8 * max(1.0, worst(found))


def with_dynamic_parameters(model: pin.Model, group: str, numbers: Array) -> pin.Model:
    """As `changed`, of a body without mass too, which `pin.Inertia` cannot hold: a difference."""
    if not group.startswith("payload"):
        return changed(model, group, numbers)
    unit_body = pin.Inertia(1.0, np.zeros(3), np.eye(3))
    frame = model.frames[model.getFrameId(group.partition(":")[2])]
    result, joint = model.copy(), frame.parentJoint
    body = pin.Inertia.FromDynamicParameters(numbers + unit_body.toDynamicParameters())
    added = frame.placement.act(body).toDynamicParameters()
    added -= frame.placement.act(unit_body).toDynamicParameters()
    own = model.inertias[joint].toDynamicParameters()
    result.inertias[joint] = pin.Inertia.FromDynamicParameters(own + added)
    return result


def test_placements_of_closures() -> None:
    model = tree_model()
    parameters = Parameters(system_of(model), ["closure:loop"])
    numbers = np.random.default_rng(6).normal(size=12)
    ends = parameters.closure_placements("loop")
    function = ca.Function("f", [parameters.symbols], [x for end in ends for x in end])
    for given, moves in (
        (parameters.nominal, [pin.SE3.Identity()] * 2),
        (numbers, [move(numbers[:6]), move(numbers[6:])]),
    ):
        found = [np.array(x) for x in function(given)]
        for k, name in enumerate(("leaf_tip", "socket")):
            wanted = model.frames[model.getFrameId(name)].placement * moves[k]
            assert worst(found[2 * k] - wanted.rotation) < 1e-14
            assert worst(found[2 * k + 1][:, 0] - wanted.translation) < 1e-14
    fixed = Parameters(system_of(model)).closure_placements("loop")
    assert all(x.is_constant() for end in fixed for x in end)
    with pytest.raises(MechanismError, match="no closure of frames 'gear'; there are: loop"):
        parameters.closure_placements("gear")


def test_labels_and_order() -> None:
    groups = ["gravity", "mass:leaf", "inertia:row", "placement:cross", "closure:loop"]
    parameters = Parameters(system_of(tree_model()), [*groups, "payload:leaf_tip"])
    labels = parameters.labels
    assert labels[:4] == ("gravity[0]", "gravity[1]", "gravity[2]", "mass:leaf")
    assert labels[4:8] == tuple(f"inertia:row.{part}" for part in ("mass", "mx", "my", "mz"))
    assert labels[8:14] == tuple(
        f"inertia:row.I{part}" for part in ("xx", "xy", "yy", "xz", "yz", "zz")
    )
    assert labels[14:20] == tuple(
        f"placement:cross.{part}" for part in ("x", "y", "z", "roll", "pitch", "yaw")
    )
    assert labels[20] == "closure:loop.a.x"
    assert labels[31] == "closure:loop.b.yaw"
    assert labels[32] == "payload:leaf_tip.mass"
    assert len(labels) == len(set(labels)) == parameters.symbols.numel() == 42


def test_vectors_of_changes() -> None:
    parameters = Parameters(system_of(tree_model()), ["gravity", "inertia:leaf", "mass:row"])
    vector = parameters.vector({"gravity[2]": -1.6, "inertia:leaf.mass": 7.0, "mass:row": 2.0})
    assert vector[[2, 3, 13]].tolist() == [-1.6, 7.0, 2.0]
    assert vector[[0, 1, 4, 12]].tolist() == parameters.nominal[[0, 1, 4, 12]].tolist()
    assert parameters.vector({"gravity": [0, 0, -1]})[:3].tolist() == [0, 0, -1]
    assert parameters.vector({}).tolist() == parameters.nominal.tolist()
    with pytest.raises(InputError, match=r"no parameter 'gravty' \(did you mean gravity\?\)"):
        parameters.vector({"gravty": [0, 0, 0]})
    with pytest.raises(InputError, match="there are: none"):
        Parameters(system_of(tree_model())).vector({"gravity": [0, 0, 0]})
    with pytest.raises(InputError, match="gravity"):
        parameters.vector({"gravity": [0.0, 0.0]})
    with pytest.raises(InputError, match="finite"):
        parameters.vector({"inertia:leaf.mass": np.nan})


@each(
    "names, message",
    [
        (["weight"], r"no parameter 'weight'; there are: gravity, inertia:JOINT, .*payload:FRAME"),
        (
            ["mass:laef"],
            r"no parameter 'mass:laef' \(did you mean mass:leaf\?\); there are: mass:h",
        ),
        (["inertia:universe"], "there are: inertia:hinge, inertia:cross"),
        (["closure:gear"], "there are: closure:loop"),
        (["payload:socket"], "no parameter 'payload:socket'"),
        (["placement:cross:1"], "no parameter 'placement:cross:1'"),
        (["gravity", "mass:row", "gravity"], "'gravity' is named twice"),
        (["inertia:row", "mass:row"], "both hold the mass"),
        ([3], "no parameter 3"),
    ],
)
def test_groups_that_are_impossible(names: list[Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Parameters(system_of(tree_model()), names)


def test_a_single_name_is_one_group() -> None:
    assert Parameters(system_of(tree_model()), "gravity").groups == ("gravity",)


def test_the_mass_of_a_massless_body_is_no_parameter() -> None:
    model = tree_model()
    model.inertias[model.getJointId("leaf")] = pin.Inertia.Zero()
    with pytest.raises(InputError, match="no parameter 'mass:leaf'"):
        Parameters(system_of(model), ["mass:leaf"])


def test_rounding_errors_of_a_file_leave_no_operations() -> None:
    """Right angles by roll, pitch and yaw, and a centre of mass that is 0 but for rounding."""
    model = pin.Model()
    quarter = pin.SE3(pin.rpy.rpyToMatrix(np.pi / 2, 0, -np.pi / 2), np.array([0.3, 1e-17, 0]))
    joint = model.addJoint(0, pin.JointModelRZ(), quarter, "hinge")
    body = pin.Inertia(2.0, np.array([1e-18, 0, 0.1]), np.diag([1.0, 1.1, 1.2]))
    model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    parameters = Parameters(ClosedLoopModel(model, [], "hinge").system)
    rotation, translation = parameters.joint_placement(1)
    assert (rotation.nnz(), translation.nnz()) == (3, 1)
    _, first, inertia = parameters.inertia(1)
    assert (first.nnz(), inertia.nnz()) == (1, 3)


def test_moved_inertia() -> None:
    rng = np.random.default_rng(8)
    body, placement = random_inertia(rng), somewhere(rng)
    numbers = body.toDynamicParameters()
    about = pin.Inertia.FromDynamicParameters(numbers)
    assert worst(about.matrix() - body.matrix()) < 1e-14
    full = body.matrix()[3:, 3:]
    given = ca.SX(numbers[0]), ca.SX(numbers[1:4]), ca.SX(full)
    at = ca.SX(placement.rotation), ca.SX(placement.translation)
    mass, first, inertia = (np.array(ca.DM(x)) for x in moved_inertia(given, at))
    wanted = placement.act(body)
    assert worst(mass - wanted.mass, first[:, 0] - wanted.mass * wanted.lever) < 1e-14
    assert worst(inertia - wanted.matrix()[3:, 3:]) < 1e-13


def test_lengths_of_a_mechanism_with_redundant_rows() -> None:
    """Most changes open its loops; how far, has a derivative all the same."""
    mechanism = ClosedLoopModel.load("urdf/five_bar.yaml")
    fast = mechanism.compile(parameters=["closure:tips", "placement:left_joint"])
    q, nominal, h = mechanism.home, fast.nominal_parameters, 1e-6
    columns = []
    for k in range(nominal.size):
        sides = [
            fast.reference(nominal + sign * h * np.eye(nominal.size)[k]).loop_errors(q).position
            for sign in (1, -1)
        ]
        columns.append((sides[0] - sides[1]) / (2 * h))
    wanted = np.transpose(columns)
    assert worst(wanted[1]) > 0.5  # across the plane
    assert worst(fast.gaps_by_parameters(q) - wanted) < 1e-9
