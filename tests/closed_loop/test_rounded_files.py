"""Mechanisms whose files hold rounded numbers, against those with exact numbers.

What rounding may change is of its own order: nothing here is compared with the package's results
for the same numbers.
"""

from __future__ import annotations

import warnings
from itertools import product

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, LoopClosure
from rps_pin.arrays import Array
from rps_pin.errors import AccuracyWarning, ClosureError
from tests.closed_loop.random_mechanisms import Case, case
from tests.proofs.common import both_engines, through
from tests.quick import quick
from tests.worst import worst

#: A plane five-bar; its hinges are turned by `turn`.
FIVE_BAR = """<mujoco model="five_bar">
  <compiler angle="radian" autolimits="true"/>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="a1" euler="{turn} 0 0"><joint name="motor_a" axis="0 0 1"/>
      <geom type="box" size="0.05 0.01 0.01" pos="0.05 0 0" mass="0.2"/>
      <body name="a2" pos="0.1 0 0" euler="0 0 -0.9"><joint name="knee_a" axis="0 0 1"/>
        <geom type="box" size="0.1 0.01 0.01" pos="0.1 0 0" mass="0.2"/></body></body>
    <body name="b1" euler="-{turn} 0 3.141592653589793"><joint name="motor_b" axis="0 0 1"/>
      <geom type="box" size="0.05 0.01 0.01" pos="0.05 0 0" mass="0.2"/>
      <body name="b2" pos="0.1 0 0" euler="0 0 0.9"><joint name="knee_b" axis="0 0 1"/>
        <geom type="box" size="0.1 0.01 0.01" pos="0.1 0 0" mass="0.2"/></body></body>
  </worldbody>
  <equality><connect name="foot" body1="a2" body2="b2" anchor="0.2 0 0"/></equality>
  <actuator><motor joint="motor_a"/><motor joint="motor_b"/></actuator>
</mujoco>"""

#: Of the exact file; MuJoCo gives -22.5 and -48.0.
ACCELERATION = (-22.508, -48.041)


def link(name: str, mass: float, length: float) -> str:
    inertia = mass * length**2 / 12
    return (
        f'<link name="{name}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="{mass}"/>'
        f'<inertia ixx="1e-4" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/>'
        "</inertial></link>"
    )


def hinge(name: str, parent: str, child: str, xyz: str, rpy: str = "0 0 0") -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 0 1"/>'
        '<limit lower="-6.3" upper="6.3" effort="1e4" velocity="1e3"/></joint>'
    )


def four_bar(
    kind: str, turn: str = repr(np.pi / 2), aside: float = 0.0, **options: object
) -> ClosedLoopModel:
    """A plane four-bar of lengths 1, 0.5, 1.2, 0.8 m; its rocker's hinge turned and aside."""
    urdf = (
        '<robot name="four_bar"><link name="base"/><link name="coupler_end"/><link name="end"/>'
        + link("crank", 0.3, 0.5)
        + link("coupler", 0.5, 1.2)
        + link("rocker", 0.4, 0.8)
        + hinge("crank_joint", "base", "crank", "0 0 0", f"{np.pi / 2!r} 0 0")
        + hinge("coupler_joint", "crank", "coupler", "0.5 0 0")
        + hinge("rocker_joint", "base", "rocker", f"1 {aside!r} 0", f"{turn} 0 0")
        + '<joint name="f1" type="fixed"><parent link="coupler"/><child link="coupler_end"/>'
        '<origin xyz="1.2 0 0"/></joint><joint name="f2" type="fixed"><parent link="rocker"/>'
        '<child link="end"/><origin xyz="0.8 0 0"/></joint></robot>'
    )
    axis = {} if kind == "spherical" else {"axis": (0, 0, 1)}
    closure = LoopClosure("coupler_end", "end", kind, name="pin", **axis)
    return ClosedLoopModel.from_urdf(urdf, [closure], ["crank_joint"], **options)


def holding_torque(angle: float) -> float:
    """Of the exact four-bar: d(potential energy)/d(crank angle), by intersecting two circles."""

    def energy(crank: float) -> float:
        knee = 0.5 * np.exp(1j * crank)
        apart = 1.0 - knee
        far = abs(apart)
        along = (1.2**2 - 0.8**2 + far**2) / (2 * far)
        tip = knee + apart / far * (along + 1j * np.sqrt(1.2**2 - along**2))
        heights = 0.3 * knee.imag / 2 + 0.5 * (knee + tip).imag / 2 + 0.4 * tip.imag / 2
        return float(9.81 * heights)

    h = 1e-5
    return (energy(angle + h) - energy(angle - h)) / (2 * h)


KINDS = ("revolute", "spherical", "cylindrical", "point_on_line")


@pytest.mark.parametrize("turn", ["1.5708", "1.571", "1.57", "1.570796", "1.57079633"])
def test_rounded_five_bar_has_two_motions(turn: str) -> None:
    with pytest.warns(AccuracyWarning, match=r"'foot' \(singular values 0\.\d+, then "):
        mechanism = ClosedLoopModel.from_mjcf(FIVE_BAR.format(turn=turn))
    described = mechanism.describe()
    assert described.mobility == 2
    assert described.actuation == "sufficient"
    assert "rounded" in str(described)
    a = mechanism.forward_dynamics(mechanism.home, np.zeros(4), [0.3, 0.1])
    error = 10 * abs(float(turn) - np.pi / 2) + 1e-3  # of the figures
    np.testing.assert_allclose(a[mechanism.actuated_indices], ACCELERATION, rtol=0, atol=error)


def test_axes_that_are_not_parallel_are_named() -> None:
    with pytest.warns(AccuracyWarning, match=r"not parallel to the other axes: rocker_joint by"):
        mechanism = four_bar("revolute", "1.5708")
        _ = mechanism.home
    rounding = mechanism.describe().rounding
    assert rounding is not None
    ((name, angle),) = rounding.axes
    assert name == "rocker_joint"
    assert angle == pytest.approx(1.5708 - np.pi / 2, rel=1e-6)
    assert rounding.closures == ("pin",)
    assert rounding.dropped < 1e-5 < rounding.kept


@pytest.mark.filterwarnings("ignore::rps_pin.errors.AccuracyWarning")
@pytest.mark.parametrize(
    ("turn", "aside"),
    [("1.5708", 0.0), ("1.570796", 0.0), ("1.57079633", 0.0), (repr(np.pi / 2), 1e-6)],
)
@pytest.mark.parametrize("kind", KINDS)
def test_rounded_four_bar_moves_and_is_held(kind: str, turn: str, aside: float) -> None:
    mechanism = four_bar(kind, turn, aside)
    q = np.array([0.6, -0.4, 1.5])
    still = np.zeros(3)
    for angle in np.linspace(0.6, 1.2, 7):
        q = mechanism.complete({"crank_joint": angle}, q)
        found = mechanism.inverse_dynamics(q, still, still)
        assert found.tau == pytest.approx(holding_torque(angle), abs=1e-4)
        assert found.condition < 100
        assert found.unproduced is None
    assert mechanism.describe(q).mobility == 1


@pytest.mark.filterwarnings("ignore::rps_pin.errors.AccuracyWarning")
@pytest.mark.parametrize("kind", KINDS)
def test_every_call_takes_a_rounded_mechanism(kind: str) -> None:
    """The same results as of the exact one, to the order of the rounding."""
    both = []
    for turn in (repr(np.pi / 2), "1.5708"):
        mechanism = four_bar(kind, turn)
        q = mechanism.complete({"crank_joint": 0.8}, [0.6, -0.4, 1.5])
        v = mechanism.velocity(q, [1.3])
        a = mechanism.acceleration(q, v, [-0.7])
        tau = mechanism.inverse_dynamics(q, v, a).tau
        back = mechanism.forward_dynamics(q, v, tau)
        assert worst(back - a) < 1e-9
        slopes = mechanism.inverse_dynamics_derivatives(q, v, a)
        model = mechanism.linearize(q, v, tau, ["rocker_joint"])
        motion = mechanism.simulate(q, v, duration=0.3, step=2e-3, tau=tau)
        energy = np.sum(mechanism.energy(motion.q[-1], motion.v[-1])) - motion.work[-1]
        assert energy == pytest.approx(np.sum(mechanism.energy(q, v)), abs=1e-6)
        nearest = mechanism.project(q + np.array([0.1, -0.05, 0.02]))
        results = [q, v, a, tau, mechanism.mass_matrix(q, ["rocker_joint"]).ravel()]
        results += [mechanism.bias(q, v), slopes.position.ravel(), slopes.velocity.ravel()]
        results += [model.A.ravel(), model.B.ravel(), motion.q[-1], motion.v[-1], nearest]
        both.append(results)
    for exact, rounded in zip(*both, strict=True):
        assert worst(rounded - exact) < 1e-4 * max(1.0, float(np.abs(exact).max()))


@pytest.mark.filterwarnings("ignore::rps_pin.errors.AccuracyWarning")
@pytest.mark.parametrize("turn", [repr(np.pi / 2), "1.5708"])
def test_rows_that_no_joint_moves(turn: str) -> None:
    """A planar closure of plane bodies forbids nothing: the arms hang on their own."""
    mechanism = four_bar("planar", turn)
    q, still = mechanism.close([0.6, -0.4, 1.5]), np.zeros(3)
    described = mechanism.describe(q)
    assert (described.mobility, described.rank) == (3, 0)
    alone = pin.rnea(mechanism.model, mechanism.model.createData(), q, still, still)
    found = mechanism.inverse_dynamics(q, still, still)
    assert found.tau == pytest.approx(alone[:1], rel=1e-9)
    assert found.unproduced is not None
    assert found.unproduced == pytest.approx([0.0, *alone[1:]], rel=1e-9)


@both_engines
@pytest.mark.filterwarnings("ignore::rps_pin.errors.AccuracyWarning")
@pytest.mark.parametrize("kind", ["revolute", "point_on_line"])
def test_rounded_crank_turns_around_in_one_assembly_mode(kind: str, engine: str) -> None:
    """From home to 61 angles, against circles; what the rounding turns is its square."""
    mechanism = through(engine, four_bar(kind, "1.5708", home=[0.6, -0.4, 1.5]))
    for crank in np.linspace(-np.pi, np.pi, 61):
        knee = 0.5 * np.exp(1j * crank)
        apart = abs(1.0 - knee)
        along = (1.2**2 - 0.8**2 + apart**2) / (2 * apart)
        tip = knee + (1.0 - knee) / apart * (along + 1j * np.sqrt(1.2**2 - along**2))
        turns = np.angle([np.exp(1j * crank), (tip - knee) * np.exp(-1j * crank), tip - 1.0])
        apart_by = mechanism.complete([crank]) - turns
        assert worst(np.abs((apart_by + np.pi) % (2 * np.pi) - np.pi)) < 1e-9


def test_exact_file_stays_exact() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mechanism = four_bar("revolute")
        q = mechanism.complete({"crank_joint": 0.8}, [0.6, -0.4, 1.5])
    described = mechanism.describe(q)
    assert described.rounding is None
    assert described.tolerance == 1e-10
    assert mechanism.loop_gap(q) <= 1e-12


def test_exact_mechanism_near_a_singular_configuration_is_not_rounded() -> None:
    """A parallelogram laid nearly flat: its small singular value grows as it moves."""
    urdf = (
        '<robot name="parallelogram"><link name="base"/><link name="c"/><link name="d"/>'
        + link("crank", 0.3, 0.4)
        + link("coupler", 0.5, 1.0)
        + link("rocker", 0.4, 0.4)
        + hinge("crank_joint", "base", "crank", "0 0 0")
        + hinge("coupler_joint", "crank", "coupler", "0.4 0 0")
        + hinge("rocker_joint", "base", "rocker", "1 0 0")
        + '<joint name="f1" type="fixed"><parent link="coupler"/><child link="c"/>'
        '<origin xyz="1 0 0"/></joint><joint name="f2" type="fixed"><parent link="rocker"/>'
        '<child link="d"/><origin xyz="0.4 0 0"/></joint></robot>'
    )
    closure = LoopClosure("c", "d", "revolute", name="pin", axis=(0, 0, 1))
    for angle in (0.0, 1e-7, 1e-5, 1e-3):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            home = [angle, -angle, angle]
            mechanism = ClosedLoopModel.from_urdf(urdf, [closure], ["crank_joint"], home=home)
            described = mechanism.describe()
        assert described.mobility == 1
        assert described.rounding is None


def test_short_lever_is_not_a_rounding_error() -> None:
    """An eccentric of 0.3 mm drives a rod of 1 m: exact, and it cannot turn alone."""
    urdf = (
        '<robot name="press"><link name="base"/><link name="end"/>'
        + link("shaft", 0.3, 3e-4)
        + link("rod", 0.5, 1.0)
        + link("slide", 0.4, 0.1)
        + hinge("shaft_joint", "base", "shaft", "0 0 0")
        + hinge("rod_joint", "shaft", "rod", "3e-4 0 0")
        + '<joint name="slide_joint" type="prismatic"><parent link="base"/><child link="slide"/>'
        '<origin xyz="1 0 0"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1e4" '
        'velocity="1e3"/></joint>'
        '<joint name="f1" type="fixed"><parent link="rod"/><child link="end"/>'
        '<origin xyz="1 0 0"/></joint></robot>'
    )
    closure = LoopClosure("end", "slide", "revolute", name="pin", axis=(0, 0, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mechanism = ClosedLoopModel.from_urdf(urdf, [closure], ["shaft_joint"])
        q = mechanism.complete({"shaft_joint": 1.0})
        assert mechanism.describe(q).mobility == 1


def test_accuracy_is_the_user_s() -> None:
    text = FIVE_BAR.format(turn="1.5708")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        exact = ClosedLoopModel.from_mjcf(text, accuracy=0)
    assert exact.describe().mobility == 1
    with pytest.warns(AccuracyWarning):
        taken = ClosedLoopModel.from_mjcf(text, accuracy=1e-4)
    assert taken.describe().mobility == 2
    with pytest.raises(ClosureError, match="stay"):
        _ = four_bar("revolute", aside=0.02).home
    with pytest.warns(AccuracyWarning, match=r"open by 0\.02 m"):
        _ = four_bar("revolute", aside=0.02, accuracy=0.03).home


def moved(placement: pin.SE3, size: float, length: float, rng: np.random.Generator) -> pin.SE3:
    def error() -> Array:
        return size * rng.uniform(-1.0, 1.0, 3)

    turned = placement.rotation @ pin.exp3(error())
    return pin.SE3(turned, placement.translation + length * error())


def as_a_file_has_it(c: Case, size: float) -> ClosedLoopModel:
    """The mechanism with all placements of joints and frames off by random errors."""
    rng, model = np.random.default_rng(0), c.mechanism.model.copy()
    length = c.mechanism.characteristic_length
    for i in range(1, model.njoints):
        model.jointPlacements[i] = moved(model.jointPlacements[i], size, length, rng)
    for frame in model.frames:
        if frame.type != pin.FrameType.JOINT:
            frame.placement = moved(frame.placement, size, length, rng)
    effects, actuated = c.mechanism.effects, c.mechanism.actuated
    return ClosedLoopModel(model, c.mechanism.closures, actuated, home=c.q, effects=effects)


@pytest.mark.filterwarnings("ignore::rps_pin.errors.AccuracyWarning")
@pytest.mark.parametrize(
    ("planar", "size"), quick(product([True, False], [1e-6, 1e-5]), [(True, 1e-5), (False, 1e-6)])
)
def test_random_mechanisms_with_random_errors(planar: bool, size: float) -> None:
    """Motions, and the forces of one, as those of the exact mechanism (of tests/random_mechanisms).

    Most plane ones have redundant rows, which are not redundant any more.
    """
    rounded = 0
    for seed in range(10):
        c = case(seed, planar=planar)
        exact, found = c.mechanism, as_a_file_has_it(c, size)
        described = found.describe()
        rounded += described.rounding is not None
        assert described.mobility == exact.describe().mobility, seed
        given = exact.actuated_indices
        v = found.velocity(found.home, c.v[given])
        a = found.acceleration(found.home, v, c.a[given])
        forces, wanted = (
            found.inverse_dynamics(found.home, v, a),
            exact.inverse_dynamics(c.q, c.v, c.a),
        )
        error = worst(forces.tau - wanted.tau) / max(1.0, worst(wanted.tau))
        assert error < 300 * size * wanted.condition, seed
        assert worst(found.forward_dynamics(found.home, v, forces.tau) - a) < 1e-7 * max(
            1.0, worst(a)
        )
    assert rounded > 5 or not planar
