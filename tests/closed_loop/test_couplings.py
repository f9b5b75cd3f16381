"""Couplings of joints: gears, differentials, polynomials; against their formulas and MuJoCo."""

from __future__ import annotations

import dataclasses
import pickle

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, InputError, JointCoupling, MechanismError
from rps_pin.closed_loop.constraints.couplings import Term
from tests.closed_loop.mechanisms import FourBar
from tests.worst import worst

Array = NDArray[np.float64]

# Descriptions -------------------------------------------------------------------------------------


def test_couplings_have_one_row_and_are_named_after_their_joints() -> None:
    coupling = JointCoupling("left", "right", 2.0, 0.1)
    assert coupling.size == 1
    assert coupling.name == "left = right"
    assert JointCoupling("left", "right", name="gear").name == "gear"
    assert JointCoupling("rotor", {"pitch": 10.0, "roll": -10.0}).name == "rotor = pitch + roll"
    assert JointCoupling("left", {}, offset=0.2).name == "left = fixed"
    with pytest.raises(dataclasses.FrozenInstanceError):
        coupling.ratio = 3.0


def test_couplings_are_values() -> None:
    """Hashable, and their own: a dictionary that changes later does not change them."""
    ratios = {"b": 2, "c": np.float64(-1.5)}
    one = JointCoupling("a", ratios)
    ratios["b"] = 7
    assert one == JointCoupling("a", {"b": 2.0, "c": -1.5}) != JointCoupling("a", {"b": 2.0})
    assert len({one, JointCoupling("a", {"b": 2.0, "c": -1.5})}) == 1
    curve = JointCoupling("a", "b", polynomial=np.array([1, 0, 2]))
    assert curve.polynomial == (1.0, 0.0, 2.0)
    for coupling in (one, curve, JointCoupling("a", "b", 2.0, 0.1, "n")):
        assert pickle.loads(pickle.dumps(coupling)) == coupling


@pytest.mark.parametrize("other", ["left", {"right": 1.0, "left": 2.0}])
def test_joint_coupled_to_itself_is_refused(other: object) -> None:
    with pytest.raises(MechanismError, match="cannot tie joint 'left' to itself"):
        JointCoupling("left", other)


@pytest.mark.parametrize("option", ["ratio", "offset"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, "two", None])
def test_couplings_are_of_finite_numbers(option: str, bad: object) -> None:
    with pytest.raises(MechanismError, match=f"coupling 'left = right': {option} = .* finite"):
        JointCoupling("left", "right", **{option: bad})


WRONG = {
    "a ratio of 0 couples nothing": {"other": "right", "ratio": 0},
    "a ratio of 0 couples nothing; leave 'right' out": {"other": {"right": 0}},
    "ratio of 'right' = nan must be finite": {"other": {"right": np.nan}},
    "ratio = 2 stands beside ratios": {"other": {"right": 1.0}, "ratio": 2.0},
    "must be a joint's name, or ratios": {"other": ["right"]},
    "holds ratio and offset already": {"other": "right", "offset": 1.0, "polynomial": [0, 1]},
    "polynomial is of one other joint, not of 2": {
        "other": {"right": 1.0, "up": 1.0},
        "polynomial": [0, 1],
    },
    r"polynomial = \[3.0, 0\] couples nothing": {"other": "right", "polynomial": [3.0, 0]},
    r"polynomial = \[\] couples nothing": {"other": "right", "polynomial": []},
    "polynomial = 3 couples nothing": {"other": "right", "polynomial": 3},
    "polynomial = inf must be finite": {"other": "right", "polynomial": [0, np.inf]},
    "polynomial = 'x' must be finite": {"other": "right", "polynomial": "xy"},
}


@pytest.mark.parametrize(("why", "given"), WRONG.items())
def test_what_couples_nothing_or_twice_is_refused(why: str, given: dict[str, object]) -> None:
    with pytest.raises(MechanismError, match=why):
        JointCoupling("left", **given)


@pytest.mark.parametrize(
    "coupling",
    [
        JointCoupling("crank_joint", "ball"),
        JointCoupling("elbow", "crank_joint"),
        JointCoupling("crank_joint", {"rocker_joint": 1.0, "ball": 2.0}),
    ],
    ids=lambda coupling: coupling.name,
)
def test_joints_that_cannot_be_coupled_are_refused_with_those_that_can(
    coupling: JointCoupling,
) -> None:
    model = pin.buildModelFromXML(FourBar().urdf())
    model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    with pytest.raises(MechanismError, match="of one coordinate; there are: crank_joint") as caught:
        coupling.joint_ids(model)
    assert "universe" not in str(caught.value)
    assert caught.match("no joint '(ball|elbow)'")


def test_a_turn_of_cosine_and_sine_is_refused_with_what_to_do() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), "wheel")
    model.addJoint(1, pin.JointModelRX(), pin.SE3.Identity(), "x")
    with pytest.raises(MechanismError, match=r"'wheel' .*cosine.* make it a revolute joint"):
        JointCoupling("x", "wheel").joint_ids(model)


# Formulas -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", range(1, 9))
def test_polynomials_and_their_derivatives_are_numpy_s(degree: int) -> None:
    rng = np.random.default_rng(degree)
    c, x = rng.normal(size=degree), rng.normal(size=5)
    p = np.polynomial.Polynomial([0.0, *c])
    wanted = np.array([p.deriv(k)(x) if k else p(x) for k in range(4)])
    found = np.array([Term(0, 0, tuple(c)).derivatives(one) for one in x]).T
    assert worst(found - wanted) < 1e-12


def row(ties: list[JointCoupling], joints: int = 3, actuated: list[str] | None = None):
    """Hinges of one chain about different axes, each with a body, called j1, j2, ..."""
    model = pin.Model()
    for k in range(joints):
        axis = np.roll([0.0, 0.6, 0.8], k)
        at = pin.SE3(np.eye(3), np.array([0.1 * k, 0.2, -0.1]))
        joint = model.addJoint(k, pin.JointModelRevoluteUnaligned(axis), at, f"j{k + 1}")
        body = pin.Inertia(1.0 + k, np.array([0.1, 0.2, 0.05 * k]), np.diag([0.02, 0.03, 0.04]))
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    taken = [f"j{k + 1}" for k in range(joints)][: joints - len(ties)]
    return ClosedLoopModel(model, ties, taken if actuated is None else actuated)


def test_a_differential_moves_as_its_ratios_say() -> None:
    """q_3 = 10 (q_1 + q_2) + 0.5."""
    ties = [JointCoupling("j3", {"j1": 10.0, "j2": 10.0}, offset=0.5, name="bevel")]
    mechanism = row(ties)
    q = mechanism.complete([0.1, -0.3])
    assert worst(q - [0.1, -0.3, -1.5]) < 1e-12
    v = mechanism.velocity(q, [1.0, 2.0])
    assert worst(v - [1, 2, 30]) < 1e-12
    assert worst(mechanism.acceleration(q, v, [3.0, -1.0]) - [3, -1, 20]) < 1e-12
    assert worst(mechanism.jacobian(q) - [[-10.0, -10.0, 1.0]]) < 1e-15
    found = mechanism.describe()
    assert (found.mobility, found.actuation) == (2, "sufficient")
    assert found.closures[0].between == ("j3", "j1", "j2")
    assert "j3 = j1 + j2" in str(found)


def test_a_polynomial_moves_as_its_derivatives_say() -> None:
    """q_2 = 0.1 - 0.4 x + 0.3 x^2 + 0.2 x^3 with x = q_1."""
    p = np.polynomial.Polynomial([0.1, -0.4, 0.3, 0.2])
    mechanism = row([JointCoupling("j2", "j1", polynomial=p.coef)], joints=2)
    x, dx, ddx = 0.7, 1.3, -0.8
    q = mechanism.complete([x])
    v = mechanism.velocity(q, [dx])
    a = mechanism.acceleration(q, v, [ddx])
    assert worst(q - [x, p(x)]) < 1e-12
    assert worst(v - [dx, p.deriv()(x) * dx]) < 1e-12
    assert worst(a - [ddx, p.deriv()(x) * ddx + p.deriv(2)(x) * dx**2]) < 1e-12
    assert worst(mechanism.loop_errors(q, v, a)) < 1e-12
    assert worst(mechanism.loop_gap([x, p(x) + 0.01]) - 0.01 * mechanism.characteristic_length) < (
        1e-12
    )


def test_a_joint_can_be_held_at_a_value() -> None:
    mechanism = row([JointCoupling("j3", {}, offset=0.4)])
    q = mechanism.complete([0.1, 0.2])
    assert worst(q - [0.1, 0.2, 0.4]) < 1e-12
    assert mechanism.describe().mobility == 2
    assert "j3 = fixed" in str(mechanism.describe())


TIES = {
    "differential": [JointCoupling("j4", {"j1": 3.0, "j2": -2.0, "j3": 0.5}, offset=-0.2)],
    "polynomial": [JointCoupling("j4", "j2", polynomial=[0.1, 0.4, -0.7, 0.2, 0.1])],
    "both": [
        JointCoupling("j4", "j2", polynomial=[0.1, 0.4, -0.7, 0.2, 0.1]),
        JointCoupling("j3", {"j1": 1.5, "j4": -1.0}),
    ],
}


@pytest.mark.parametrize("ties", TIES.values(), ids=TIES)
@pytest.mark.parametrize("engine", ["pinocchio", "generated"])
def test_forces_solve_the_equations_of_motion_written_out(
    ties: list[JointCoupling], engine: str
) -> None:
    """M and h are Pinocchio's, J and J' v differences of the coupling's own formula."""
    mechanism = row(ties, joints=4)
    solver = mechanism if engine == "pinocchio" else mechanism.compile(compiler="tcc")
    model, data, count = mechanism.model, mechanism.model.createData(), 4 - len(ties)
    rng, found = np.random.default_rng(3), []

    def gaps(q: Array) -> Array:
        names = list(model.names)[1:]
        at = dict(zip(names, q, strict=True))
        values = []
        for tie in ties:
            if tie.polynomial is not None:
                follows = np.polynomial.Polynomial(tie.polynomial)(at[tie.other])
            else:
                follows = sum(r * at[name] for name, r in tie.other.items()) + tie.offset
            values.append(at[tie.joint] - follows)
        return np.array(values)

    step = 1e-5
    for _ in range(5):
        q = mechanism.complete(rng.normal(size=count))
        v = mechanism.velocity(q, rng.normal(size=count))
        tau = rng.normal(size=count)
        J = np.array([(gaps(q + step * e) - gaps(q - step * e)) / (2 * step) for e in np.eye(4)]).T
        along = (gaps(q + 1e-4 * v) - 2 * gaps(q) + gaps(q - 1e-4 * v)) / 1e-8
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        h = pin.nle(model, data, q, v)
        S = np.eye(4)[mechanism.actuated_indices]
        kkt = np.block([[M, -J.T], [J, np.zeros((len(ties), len(ties)))]])
        solved = np.linalg.solve(kkt, np.concatenate([S.T @ tau - h, -along]))
        a = solver.forward_dynamics(q, v, tau)
        found.append(a - solved[:4])
        forces = solver.inverse_dynamics(q, v, a)
        found += [forces.tau - tau, forces.constraint_forces - solved[4:]]
    assert worst(*found) < 1e-5  # of second differences


def test_couplings_do_no_work() -> None:
    """Swinging freely, a chain with a curved coupling keeps its energy."""
    mechanism = row(TIES["both"], joints=4)
    q = mechanism.complete([0.4, -0.3])
    motion = mechanism.simulate(q, mechanism.velocity(q, [1.0, -0.5]), duration=0.5, step=1e-3)
    assert worst(motion.gap) < 1e-9
    energy = motion.energy
    assert np.ptp(motion.kinetic) > 1.0
    assert worst(energy - energy[0]) < 1e-6 * np.ptp(motion.kinetic)


# MuJoCo -------------------------------------------------------------------------------------------

POLYNOMIAL = (0.1, -0.4, 0.3, 0.2, 0.05)
CHAIN = """<mujoco><worldbody>
<body><joint name="pitch" axis="0 1 0"/><geom size=".1" pos=".2 0 0"/>
 <body pos=".3 0 0"><joint name="roll" axis="1 0 0"/><geom size=".1" pos="0 .1 0"/></body></body>
<body pos="0 1 0"><joint name="rotor" axis="0 1 0"/><geom size=".05" pos="0.1 0 0"/></body>
</worldbody>
<tendon><fixed name="bevel"><joint joint="pitch" coef="1"/><joint joint="roll" coef="1"/>
<joint joint="rotor" coef="-0.1"/></fixed></tendon>
<equality>EQUALITY</equality></mujoco>"""
EQUALITIES = {
    '<tendon tendon1="bevel"/>': (
        JointCoupling("rotor", {"pitch": 10.0, "roll": 10.0}),
        0.1,
    ),
    f'<joint joint1="rotor" joint2="roll" polycoef="{" ".join(map(str, POLYNOMIAL))}"/>': (
        JointCoupling("rotor", "roll", polynomial=POLYNOMIAL),
        1.0,
    ),
}


@pytest.mark.parametrize(("element", "same"), EQUALITIES.items(), ids=["tendon", "polycoef"])
def test_couplings_are_mujoco_s_equalities(element: str, same: tuple[JointCoupling, float]) -> None:
    """The residual and its row, but for the sign and scale in which MuJoCo writes them."""
    coupling, scale = same
    m = mujoco.MjModel.from_xml_string(CHAIN.replace("EQUALITY", element))
    d = mujoco.MjData(m)
    model = pin.Model()
    for name, axis in (("pitch", [0.0, 1.0, 0.0]), ("roll", [1.0, 0, 0]), ("rotor", [0, 1.0, 0])):
        parent = 1 if name == "roll" else 0
        joint = pin.JointModelRevoluteUnaligned(np.array(axis))
        model.addJoint(parent, joint, pin.SE3.Identity(), name)
    ours = ClosedLoopModel(model, [coupling], ["pitch"])
    rng, found = np.random.default_rng(0), []
    for _ in range(5):
        d.qpos[:] = rng.normal(size=3)
        mujoco.mj_forward(m, d)
        J = np.zeros((d.nefc, m.nv))
        J[:] = d.efc_J.reshape(d.nefc, m.nv)
        sign = np.sign(J[0, 2])
        found += [
            sign * J[0] - scale * ours.jacobian(d.qpos)[0],
            sign * d.efc_pos[0] - scale * ours.loop_errors(d.qpos).position[0],
        ]
    assert worst(*found) < 1e-12


# The case of the differential that a rotor drives -------------------------------------------------


@pytest.mark.parametrize("joints", ["pitch and roll driven", "rotor and roll driven"])
def test_a_rotor_holds_a_differential(joints: str) -> None:
    """By virtual work: moving pitch with roll held moves the rotor ten times as far."""
    actuated = ["pitch", "roll"] if joints.startswith("pitch") else ["rotor", "roll"]
    model = pin.Model()
    pitch = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "pitch")
    at = pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))
    roll = model.addJoint(pitch, pin.JointModelRX(), at, "roll")
    model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "rotor")
    for joint, com in ((pitch, [0.2, 0, 0]), (roll, [0, 0.1, 0])):
        body = pin.Inertia(2.0, np.array(com), 0.01 * np.eye(3))
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    bevel = JointCoupling("rotor", {"pitch": 10.0, "roll": 10.0}, name="bevel")
    mechanism = ClosedLoopModel(model, [bevel], actuated)
    q = mechanism.complete({"pitch": 0.3, "roll": -0.2})
    still = np.zeros(3)
    tau = mechanism.inverse_dynamics(q, still, still).tau
    data = model.createData()
    weight = pin.computeGeneralizedGravity(model, data, q)  # the rotor has none
    wanted = weight[:2] if actuated[0] == "pitch" else [weight[0] / 10, weight[1] - weight[0]]
    assert worst(tau - wanted) < 1e-12


def test_wrong_objects_are_refused() -> None:
    with pytest.raises(InputError, match="closures are LoopClosure or JointCoupling objects"):
        row([("j1", "j2")])
