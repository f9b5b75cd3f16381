"""All assembly modes of any tree, by loops in complex parameters: known counts, and the search."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, JointCoupling, LoopClosure
from rps_pin.closed_loop.assembly.every.general.factors import Slide, Turn
from rps_pin.closed_loop.assembly.every.general.family import GeneralFamily
from rps_pin.closed_loop.assembly.every.general.modes import closures_of, general_solutions
from rps_pin.closed_loop.assembly.every.solutions import NoFormulationError
from rps_pin.closed_loop.constraints.closures import KINDS
from rps_pin.numerics.intervals import Interval
from tests.closed_loop.test_assembly_modes import at
from tests.proofs.common import loaded
from tests.worst import worst

Array = NDArray[np.float64]
ROD = 2.4


def placed(rng: np.random.Generator) -> pin.SE3:
    e = rng.normal(size=4)
    turn = pin.Quaternion(*(e / np.linalg.norm(e))).toRotationMatrix()
    return pin.SE3(turn, rng.normal(size=3))


def link(model: pin.Model, joint: object, parent: int, place: pin.SE3, name: str) -> int:
    index = model.addJoint(parent, joint, place, name)
    model.appendBodyToJoint(index, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame(f"{name}_link", index, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return int(index)


def six_hinges(seed: int, slides: int = 0) -> tuple[ClosedLoopModel, Array]:
    """A general serial robot of six joints, its tool held where given angles bring it."""
    rng, model, joint = np.random.default_rng(seed), pin.Model(), 0
    for k in range(6):
        kind = pin.JointModelPZ() if k < slides else pin.JointModelRZ()
        joint = link(model, kind, joint, placed(rng), f"j{k}")
    q, data = rng.uniform(-3, 3, 6), model.createData()
    pin.forwardKinematics(model, data, q)
    goal = data.oMi[joint].homogeneous
    held = LoopClosure("j5_link", "universe", "rigid", placement_b=goal)
    return ClosedLoopModel(model, [held], []), q


def rssr(seed: int, balls: bool = False) -> ClosedLoopModel:
    """A crank and a rocker about skew axes, and a rod between; its length is in the second."""
    rng, model = np.random.default_rng(seed), pin.Model()
    crank = link(model, pin.JointModelRZ(), 0, pin.SE3.Identity(), "crank")
    if balls:
        rod = link(model, pin.JointModelSpherical(), crank, at(0.6, 0.0, 0.2), "rod")
        model.addFrame(pin.Frame("rod_end", rod, at(ROD), pin.FrameType.OP_FRAME))
    link(model, pin.JointModelRX(), 0, at(2.0, 1.2, 0.3), "rocker")
    tip = {"placement_b": at(*rng.uniform(0.2, 0.8, 3))}
    if balls:
        closure = LoopClosure("rod_end", "rocker_link", **tip)
    else:
        start = {"placement_a": at(0.6, 0.0, 0.2)}
        closure = LoopClosure("crank_link", "rocker_link", "distance", distance=ROD, **start, **tip)
    return ClosedLoopModel(model, [closure], ["crank"])


def rocker_angles(seed: int, angle: float) -> list[float]:
    """A cos + B sin = C of |tip - pin|^2 = ROD^2, by hand."""
    x, y, z = np.random.default_rng(seed).uniform(0.2, 0.8, 3)
    start = np.array([0.6 * math.cos(angle), 0.6 * math.sin(angle), 0.2])
    d = np.array([2.0 + x, 1.2, 0.3]) - start  # then plus (0, y c - z s, y s + z c)
    a, b = 2 * (d[1] * y + d[2] * z), 2 * (d[2] * y - d[1] * z)
    c = ROD**2 - d @ d - y * y - z * z
    middle, half = math.atan2(b, a), math.acos(c / math.hypot(a, b))
    return sorted(math.remainder(middle + sign * half, 2 * math.pi) for sign in (-1, 1))


def unknowns(family: GeneralFamily, q: Array) -> Array:
    """The unknowns of a configuration."""
    x = np.zeros(family.size)
    for one in family.factors:
        if isinstance(one, Slide):
            x[one.at] = q[one.q] / family.unit
        elif isinstance(one, Turn) and one.by_cosine:
            x[one.at] = math.atan2(q[one.q + 1], q[one.q])
        else:
            x[one.at : one.at + one.size] = q[one.q : one.q + one.size]
    return x


def all_kinds() -> tuple[ClosedLoopModel, Array]:
    """Most kinds of joints, all kinds of closures, and a configuration where they are closed."""
    rng, model = np.random.default_rng(3), pin.Model()
    joints = [pin.JointModelFreeFlyer(), pin.JointModelPlanar(), pin.JointModelSpherical()]
    joints += [pin.JointModelRUBX(), pin.JointModelTranslation(), pin.JointModelSphericalZYX()]
    joints += [pin.JointModelRevoluteUnaligned(*(np.ones(3) / math.sqrt(3))), pin.JointModelPY()]
    joints += [pin.JointModelRX(), pin.JointModelRZ()]
    parent = 0
    for k, joint in enumerate(joints):
        parent = link(model, joint, parent if k % 4 else 0, placed(rng), f"j{k}")
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-1, 1, model.nv))
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    closures: list[LoopClosure | JointCoupling] = []
    for k, kind in enumerate(KINDS):
        a, b = k % 7 + 1, (3 * k + 5) % 10 + 1
        b = b if b != a else 10
        at_a, length = placed(rng), 2.0 if kind == "distance" else None
        at_b = data.oMi[b].actInv(data.oMi[a] * at_a * at(length or 0.0))
        frames = f"j{a - 1}_link", f"j{b - 1}_link"
        places = {"placement_a": at_a.homogeneous, "placement_b": at_b.homogeneous}
        closures.append(LoopClosure(*frames, kind, str(k), distance=length, **places))
    one, two = (model.joints[model.getJointId(name)].idx_q for name in ("j9", "j6"))
    closures.append(JointCoupling("j9", "j6", ratio=2.0, offset=q[one] - 2.0 * q[two]))
    return ClosedLoopModel(model, closures, []), q


def test_equations_of_all_kinds_are_those_of_the_closures() -> None:
    """Zero where the loops are closed, with the same motions left open as by Pinocchio's rows."""
    mechanism, q = all_kinds()
    system, model = mechanism.system, mechanism.model
    family = closures_of(system, np.zeros(model.nv, dtype=bool), q)

    def values(q: Array) -> Array:
        return np.asarray(family.at_zero(unknowns(family, q)[None].astype(complex))[0][0].real)

    assert worst(np.abs(system.equations.gaps(q))) < 1e-12
    assert worst(np.abs(values(q))) < 1e-12
    step = 1e-6
    columns = [
        (values(pin.integrate(model, q, step * v)) - values(pin.integrate(model, q, -step * v)))
        / (2 * step)
        for v in np.eye(model.nv)
    ]
    rows, jacobian = np.array(columns).T, system.equations.jacobian(q)
    ranks = [
        int(np.linalg.matrix_rank(one, tol=1e-6))
        for one in (rows, jacobian, np.vstack([rows, jacobian]))
    ]
    assert ranks[0] == ranks[1] == ranks[2] < model.nv or ranks == [model.nv] * 3
    boxes = family.at_zero(Interval(unknowns(family, q + 0.01)[None]))
    numbers = family.at_zero(unknowns(family, q + 0.01)[None].astype(complex))
    for box, one in zip(boxes, numbers, strict=True):
        assert (box.lower <= one.real).all()
        assert (one.real <= box.upper).all()
        assert worst(box.upper - box.lower) < 1e-11


def test_derivatives_over_complex_numbers_are_those_of_differences() -> None:
    mechanism, q = all_kinds()
    family = closures_of(mechanism.system, np.zeros(mechanism.model.nv, dtype=bool), q)
    rng, step = np.random.default_rng(0), 1e-5
    x, parameters = family.seeds(rng, 4)
    rates, moves = family.drawn(rng, 4), rng.normal(size=x.shape)
    closed, _, _ = family.evaluated(x, parameters, rates)
    assert worst(np.abs(closed) / (1 + np.abs(parameters).max())) < 1e-9
    parameters = family.drawn(rng, 4)
    _, by_x, by_s = family.evaluated(x, parameters, rates)

    def change(dx: Array, dp: Array) -> Array:
        ends = [family.evaluated(x + k * dx, parameters + k * dp, rates)[0] for k in (step, -step)]
        return np.asarray((ends[0] - ends[1]) / (2 * step))

    size = 1 + np.abs(by_x).max() + np.abs(by_s).max()
    one = (by_x @ moves[..., None])[..., 0] - change(moves, np.zeros_like(parameters))
    two = by_s - change(np.zeros_like(x), rates)
    assert worst(np.abs(one) / size) < 1e-7
    assert worst(np.abs(two) / size) < 1e-7


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"j5": 1.5}, "not of turns by whole numbers"),
        ({"j5": 1.0}, "its equations are 7 for 6 unknowns"),
    ],
)
def test_what_is_not_followed_is_said(change: dict[str, float], told: str) -> None:
    mechanism, q = six_hinges(0)
    coupling = JointCoupling("j0", change)
    closures = [*mechanism.closures, coupling]
    more = ClosedLoopModel(mechanism.model, closures, [])
    with pytest.raises(NoFormulationError, match=told):
        general_solutions(more.system, np.zeros(6, dtype=bool), q)


def test_a_general_robot_of_six_hinges_has_sixteen() -> None:
    """Lee and Liang (1988): 16 in general. The real ones bring the tool to its place."""
    mechanism, q = six_hinges(2)
    found = mechanism.assembly_modes(q_guess=q, method="all", within_limits=False)
    assert (found.complex_count, found.paths, found.singular) == (16, 16, 0)
    assert len(found.q) == 8
    assert found.certified is not None
    assert found.certified.all()
    assert "that none is missing is not proven" in str(found)
    assert worst(np.abs(np.exp(1j * found.q) - np.exp(1j * q)).max(axis=1).min()) < 1e-9
    goal = mechanism.frame_placement(q, "j5_link")
    for one in found.q:
        assert worst(np.abs(mechanism.frame_placement(one, "j5_link") - goal)) < 1e-9
    turns = np.exp(1j * found.q)
    apart = np.abs(turns[:, None] - turns).max(axis=2) + 10 * np.eye(8)
    assert apart.min() > 1e-3


@pytest.mark.parametrize("balls", [False, True])
def test_a_spatial_four_bar_has_the_two_of_its_closed_form(balls: bool) -> None:
    """With the rod as a closure, and as a link with a ball, whose spin is idle."""
    mechanism = rssr(1, balls)
    found = mechanism.assembly_modes([1.0], method="all", within_limits=False)
    rocker = mechanism.model.joints[mechanism.model.getJointId("rocker")].idx_q
    assert (found.complex_count, found.paths, len(found.q)) == (2, 2, 2)
    assert worst(np.abs(np.sort(found.q[:, rocker]) - rocker_angles(1, 1.0))) < 1e-9
    assert found.certified is not None
    assert found.certified.all()


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("cassie_leg", 4),
        pytest.param("ankle", 32, marks=pytest.mark.slow),
    ],
)
def test_robots_have_those_that_the_search_finds(name: str, count: int) -> None:
    mechanism = loaded(name)
    found = mechanism.assembly_modes(method="all", within_limits=False)
    searched = mechanism.assembly_modes(within_limits=False)
    assert found.complex_count == count
    assert found.certified is not None
    assert found.certified.all()
    assert len(found.q) == len(searched.q)
    balls = [joint for joint in mechanism.model.joints if "Spherical" in joint.shortname()]
    idle = [i for joint in balls for i in range(joint.idx_q, joint.idx_q + 4)]
    one, two = (np.exp(1j * np.delete(each.q, idle, axis=1)) for each in (found, searched))
    assert worst(np.abs(two[:, None] - one).max(axis=2).min(axis=1)) < 1e-9
    for q in found.q:
        assert worst(np.abs(mechanism.system.equations.gaps(q))) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rps", "rrs"])
def test_platforms_on_three_legs_have_the_sixteen_of_their_own_equations(name: str) -> None:
    mechanism = loaded(name)
    system = mechanism.system
    held = np.zeros(mechanism.model.nv, dtype=bool)
    held[system.actuated] = True
    found = general_solutions(system, held, mechanism.home)
    own = mechanism.assembly_modes(method="all", within_limits=False)
    assert (found.complex_count, len(found.guesses)) == (own.complex_count, len(own.q))
    assert found.certified.all()
