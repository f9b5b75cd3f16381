"""All assembly modes that a search finds: against closed forms, and a platform that has 40."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from rps_pin import ClosedLoopModel, LoopClosure, RPSRobot
from rps_pin.errors import ClosureError, InputError
from tests.closed_loop.test_rounded_files import KINDS
from tests.closed_loop.test_rounded_files import four_bar as rounded_four_bar
from tests.proofs.common import loaded
from tests.worst import worst

Array = NDArray[np.float64]
BARS = {"ground": 1.0, "crank": 0.5, "coupler": 1.2, "rocker": 0.8}


def at(*point: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([*point, 0.0, 0.0, 0.0])[:3])


def chain(model: pin.Model, name: str, *bars: float, x: float = 0.0) -> None:
    """Bars that turn in the x-y plane, from x on; the frame NAME is at the end."""
    parent, place = 0, x
    for k, bar in enumerate(bars):
        parent = model.addJoint(parent, pin.JointModelRZ(), at(place), f"{name}{k}")
        model.appendBodyToJoint(parent, pin.Inertia.Random(), pin.SE3.Identity())
        place = bar
    model.addFrame(pin.Frame(name, parent, at(place), pin.FrameType.OP_FRAME))


def four_bar() -> ClosedLoopModel:
    model = pin.Model()
    chain(model, "a", BARS["crank"], BARS["coupler"])
    chain(model, "b", BARS["rocker"], x=BARS["ground"])
    return ClosedLoopModel(model, [LoopClosure("a", "b")], ["a0"])


def wrapped(x: Array) -> Array:
    return (x + np.pi) % (2 * np.pi) - np.pi


def circles(a: Array, r: float, b: Array, s: float) -> list[Array]:
    """Where circles of radii r about a and s about b meet."""
    d = b - a
    length = float(np.hypot(*d))
    x = (r * r - s * s + length * length) / (2 * length)
    e, height = d / length, np.sqrt(r * r - x * x)
    return [a + x * e + side * height * np.array([-e[1], e[0]]) for side in (1, -1)]


def angle(v: Array) -> float:
    return float(np.arctan2(v[1], v[0]))


def same_sets(found: Array, exact: Array) -> float:
    """The largest distance between two sets of angles, each in the other."""
    apart = np.abs(wrapped(found[:, None] - exact)).max(axis=2)
    return worst(np.concatenate([apart.min(axis=0), apart.min(axis=1)]))


def test_four_bar_has_the_two_points_where_circles_meet() -> None:
    mechanism = four_bar()
    for crank in (-2.0, 0.3, 1.7, 100.0):
        found = mechanism.assembly_modes([crank])
        a = BARS["crank"] * np.array([np.cos(crank), np.sin(crank)])
        pivot = np.array([BARS["ground"], 0.0])
        points = circles(a, BARS["coupler"], pivot, BARS["rocker"])
        exact = [[crank, angle(b - a) - crank, angle(b - pivot)] for b in points]
        assert found.q.shape == (2, 3)
        assert same_sets(found.q, np.array(exact)) < 1e-12
        assert (found.q[:, 0] == crank).all()
        assert worst(np.abs(found.q[:, 1:])) <= np.pi
        assert (found.stopped, found.outside) == ("settled", 0)
        assert found.hits.sum() == found.closed


def test_five_bar_has_two_by_the_cranks_and_four_by_the_platform_of_its_links() -> None:
    model = pin.Model()
    chain(model, "a", 0.6, 0.9)
    chain(model, "b", 0.6, 0.9, x=0.5)
    mechanism = ClosedLoopModel(model, [LoopClosure("a", "b")], ["a0", "b0"])
    assert len(mechanism.assembly_modes([2.0, 1.0]).q) == 2
    # With the tip on a given point, each leg has its elbow on one side or the other.
    point = LoopClosure("a", "universe", placement_b=at(0.3, 0.9), name="tip")
    tip = mechanism.with_closures([point]).with_actuated([])
    found = tip.assembly_modes(q_guess=[2.0, -1.0, 1.0, 1.0])
    exact = []
    for left, right in itertools.product((0, 1), repeat=2):
        goal, ends = np.array([0.3, 0.9]), []
        for base, side in ((np.zeros(2), left), (np.array([0.5, 0.0]), right)):
            elbow = circles(base, 0.6, goal, 0.9)[side]
            ends += [angle(elbow - base), angle(goal - elbow) - angle(elbow - base)]
        exact.append(ends)
    assert found.q.shape == (4, 4)
    assert same_sets(found.q, np.array(exact)) < 1e-11


@pytest.mark.filterwarnings("ignore::rps_pin.errors.AccuracyWarning")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("turn", "aside"), [("1.5708", 0.0), ("1.571", 0.0), ("pi", 1e-6)])
def test_rounded_four_bar_has_those_of_the_exact_one(kind: str, turn: str, aside: float) -> None:
    """Hinges that are not quite parallel: circles of the plane, to the size of the rounding."""
    exact_turn = repr(np.pi / 2)
    mechanism = rounded_four_bar(kind, exact_turn if turn == "pi" else turn, aside)
    found = mechanism.assembly_modes([0.8])
    a, pivot = 0.5 * np.array([np.cos(0.8), np.sin(0.8)]), np.array([1.0, 0.0])
    points = circles(a, 1.2, pivot, 0.8)
    exact = [[0.8, angle(b - a) - 0.8, angle(b - pivot)] for b in points]
    assert found.q.shape == (2, 3)
    assert same_sets(found.q, np.array(exact)) < 1e-5
    assert worst(found.condition) < 10
    assert (found.stopped, found.outside, found.closed) == ("settled", 0, found.starts)


def test_rps_has_those_of_its_closed_form() -> None:
    """By the elimination of `RPSRobot`, which shares nothing with the search."""
    robot = RPSRobot.from_preset("sokolov")
    mechanism = loaded("rps")
    lengths = [0.45, 0.47, 0.46]
    found = mechanism.assembly_modes(lengths, within_limits=False)
    exact = robot.assembly_modes(lengths)
    places = np.array([mechanism.frame_placement(q, "platform")[:3, 3] for q in found.q])
    apart = np.linalg.norm(places[:, None] - exact.position, axis=2)
    assert len(found.q) == len(exact.angle) >= 8
    assert worst(np.concatenate([apart.min(axis=0), apart.min(axis=1)])) < 1e-9


def rrs_modes(arms: Array) -> Array:
    """Shank angles of the 3-RRS of urdf/ with given arm angles, (k, 3), by its three tips alone.

    The tips are on circles of radius b in the legs' planes, at angles p_i, and the platform says
    how far they are from each other. That is A cos p_2 + B sin p_2 = C for a given p_1, and so for
    p_3; where tips 2 and 3 are too, along all p_1, is found by changes of sign.
    """
    arm, b, out, side = 0.15, 0.25, 0.2, np.sqrt(3) * 0.12
    radius, height = out + arm * np.cos(arms), arm * np.sin(arms)

    def tip(i: int, p: Array) -> tuple[Array, Array]:
        return radius[i] + b * np.cos(p), height[i] + b * np.sin(p)

    def apart(one: tuple[Array, Array], other: tuple[Array, Array]) -> Array:
        (r, z), (s, w) = one, other  # the legs' planes are at 120 degrees
        return r * r + s * s + r * s + (z - w) ** 2 - side**2

    def reached(i: int, from_: tuple[Array, Array], sign: int) -> Array:
        r, z = from_
        first = 2 * radius[i] * b + r * b, 2 * b * (height[i] - z)
        rest = radius[i] ** 2 + b * b + r * r + r * radius[i] + (height[i] - z) ** 2 - side**2
        with np.errstate(invalid="ignore"):  # out of reach: no root
            turn = np.arccos(-rest / np.hypot(*first))
        return np.arctan2(first[1], first[0]) + sign * turn

    def left(p: Array, signs: tuple[int, int]) -> Array:
        one = tip(0, p)
        second, third = (reached(i, one, sign) for i, sign in zip((1, 2), signs, strict=True))
        return apart(tip(1, second), tip(2, third))

    found, grid = [], np.linspace(-np.pi, np.pi, 20_001)
    for signs in itertools.product((-1, 1), repeat=2):
        values = left(grid, signs)
        for k in np.flatnonzero(values[:-1] * values[1:] < 0):
            p = brentq(left, grid[k], grid[k + 1], args=(signs,), xtol=1e-15)
            one = tip(0, p)
            found.append([p, reached(1, one, signs[0]), reached(2, one, signs[1])])
    return np.array(found) - arms


@pytest.mark.parametrize("arms", [(0.6, 0.6, 0.6), (0.5, 0.9, 0.7), (-0.4, 0.3, 1.1)])
def test_rrs_has_those_of_its_tips_on_circles(arms: tuple[float, float, float]) -> None:
    mechanism = loaded("rrs")
    found = mechanism.assembly_modes(arms, within_limits=False)
    model = mechanism.model
    shanks = [model.joints[model.getJointId(f"shank_{k}_joint")].idx_q for k in (1, 2, 3)]
    exact = rrs_modes(np.array(arms))
    assert found.q.shape[0] == len(exact) >= 2
    assert same_sets(found.q[:, shanks], exact) < 1e-8


def sarrus(first: float, second: float, outward: float) -> ClosedLoopModel:
    """A platform on two legs of three hinges each, about x and about y: six rows of rank five."""
    model = pin.Model()
    for name, turn in (("a", np.eye(3)), ("b", pin.utils.rotate("z", np.pi / 2))):
        foot = pin.SE3(turn, turn @ np.array([0.0, outward, 0.0]))
        parent = 0
        for k, length in enumerate((0.0, first, second)):
            place = foot if parent == 0 else pin.SE3(np.eye(3), np.array([0.0, length, 0.0]))
            parent = model.addJoint(parent, pin.JointModelRX(), place, f"{name}{k}")
            model.appendBodyToJoint(parent, pin.Inertia.Random(), pin.SE3.Identity())
        centre = pin.SE3(turn.T, np.array([0.0, -outward, 0.0]))
        model.addFrame(pin.Frame(name, parent, centre, pin.FrameType.OP_FRAME))
    return ClosedLoopModel(model, [LoopClosure("a", "b", "rigid", name="platform")], ["a0"])


def test_sarrus_linkage_has_both_elbows_of_each_leg() -> None:
    """Its platform stands above the base, and each leg spans the height with links of 0.3 and 0.2.

    The height is that of leg a, whose second link leads back above the foot, upwards or downwards;
    leg b reaches it with its elbow out or in, if it is from 0.1 to 0.5.
    """
    mechanism, angle = sarrus(0.3, 0.2, 0.4), 1.1
    found = mechanism.assembly_modes([angle])
    exact = []
    for up in (1, -1):
        elbow = np.array([0.3 * np.cos(angle), 0.3 * np.sin(angle)])
        height = elbow[1] + up * np.sqrt(0.2**2 - elbow[0] ** 2)
        assert 0.1 < abs(height) < 0.5
        top = np.array([0.0, height])
        knees = [(elbow, top), *((knee, top) for knee in circles(np.zeros(2), 0.3, top, 0.2))]
        turns = []
        for knee, end in knees:
            one, two = np.arctan2(*knee[::-1]), np.arctan2(*(end - knee)[::-1])
            turns.append([one, two - one, -two])  # the platform stays level
        exact += [turns[0] + turns[1], turns[0] + turns[2]]
    assert found.q.shape == (4, 6)
    assert same_sets(found.q, np.array(exact)) < 1e-10
    assert worst(found.condition) < 1e3
    described = mechanism.describe(found.q[0])
    assert (described.mobility, described.rank) == (1, 5)


# Dietmaier, The Stewart-Gough platform of general geometry can have 40 real postures (1998).
BASE = [
    (0, 0, 0),
    (1.107915, 0, 0),
    (0.549094, 0.756063, 0),
    (0.735077, -0.223935, 0.525991),
    (0.514188, -0.526063, -0.368418),
    (0.590473, 0.094733, -0.205018),
]
PLATFORM = [
    (0, 0, 0),
    (0.542805, 0, 0),
    (0.956919, -0.528915, 0),
    (0.665885, -0.353482, 1.402538),
    (0.478359, 1.158742, 0.107672),
    (-0.137087, -0.235121, 0.353913),
]
LEGS = [1, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071]


def dietmaier() -> ClosedLoopModel:
    """A free platform whose points have given distances from points of the world."""
    model = pin.Model()
    body = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "platform")
    model.appendBodyToJoint(body, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame("top", body, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    legs = [
        LoopClosure(
            "top",
            "universe",
            "distance",
            f"leg {k}",
            distance=leg,
            placement_a=at(*PLATFORM[k]),
            placement_b=at(*BASE[k]),
        )
        for k, leg in enumerate(LEGS)
    ]
    return ClosedLoopModel(model, legs, [])


def test_the_platform_of_dietmaier_has_forty() -> None:
    mechanism = dietmaier()
    found = mechanism.assembly_modes()
    assert len(found.q) == 40
    assert found.stopped == "settled"
    assert 40 < found.expected <= 40.5
    for q in found.q:  # the legs, by the poses alone
        turn = pin.Quaternion(*q[[6, 3, 4, 5]]).toRotationMatrix()
        tops = q[:3] + np.array(PLATFORM) @ turn.T
        np.testing.assert_allclose(np.linalg.norm(tops - BASE, axis=1), LEGS, rtol=0, atol=1e-12)
    dots = np.abs(found.q[:, 3:] @ found.q[:, 3:].T)
    near = np.linalg.norm(found.q[:, None, :3] - found.q[:, :3], axis=2) < 1e-4
    np.fill_diagonal(near, False)
    assert not (near & (dots > 1 - 1e-8)).any()  # 40 different ones
    assert (found.q[:, 6] >= 0).all()


# What the search is told, and tells -------------------------------------------------------------


def test_idle_freedoms_make_no_further_modes() -> None:
    """A slider-crank whose rod spins between two balls has two modes; spun rods are the same."""
    model = pin.Model()
    crank = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "crank")
    rod = model.addJoint(crank, pin.JointModelSpherical(), at(0.1), "ball")
    slide = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    thin = pin.Inertia(0.1, np.array([0.15, 0.0, 0.0]), np.diag([1e-6, 1e-3, 1e-3]))
    for joint in (crank, rod, slide):
        model.appendBodyToJoint(joint, thin, pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", rod, at(0.3), pin.FrameType.OP_FRAME))
    model.addFrame(pin.Frame("pin", slide, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    mechanism = ClosedLoopModel(model, [LoopClosure("tip", "pin")], ["crank"])
    found = mechanism.assembly_modes([0.7])
    side, height = 0.1 * np.cos(0.7), 0.1 * np.sin(0.7)
    reach = np.sqrt(0.3**2 - height**2)
    np.testing.assert_allclose(np.sort(found.q[:, -1]), [side - reach, side + reach], atol=1e-12)


def test_joints_that_no_closure_moves_keep_their_values() -> None:
    """A four-bar on a floating base, with a tail: the modes are those of the fixed one."""
    model = pin.Model()
    base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    for name, bars, x in (("a", (0.5, 1.2), 0.0), ("b", (0.8,), 1.0), ("tail", (0.3,), -0.2)):
        parent, place = base, x
        for k, bar in enumerate(bars):
            parent = model.addJoint(parent, pin.JointModelRZ(), at(place), f"{name}{k}")
            model.appendBodyToJoint(parent, pin.Inertia.Random(), pin.SE3.Identity())
            place = bar
        model.addFrame(pin.Frame(name, parent, at(place), pin.FrameType.OP_FRAME))
    mechanism = ClosedLoopModel(model, [LoopClosure("a", "b")], ["a0", "tail0"])
    guess = np.concatenate([[1.0, 2.0, 3.0, 0.6, 0.0, 0.0, 0.8], [0.3, -0.5, 1.0, 0.7]])
    found = mechanism.assembly_modes({"a0": 0.3}, guess)
    fixed = four_bar().assembly_modes([0.3])
    np.testing.assert_array_equal(found.q[:, :8], np.array([guess[:8]] * 2))
    np.testing.assert_array_equal(found.q[:, 10], [0.7, 0.7])
    assert same_sets(found.q[:, 7:10], fixed.q) < 1e-12


def test_values_that_leave_motions_open_are_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"leave 1 motion\(s\) open, of joints 'a"):
        four_bar().assembly_modes({})


def test_values_that_no_configuration_has() -> None:
    model = pin.Model()
    chain(model, "a", 1.5, 0.8)
    chain(model, "b", 0.9, x=1.0)
    mechanism = ClosedLoopModel(model, [LoopClosure("a", "b", name="pin")], ["a0"])
    gap = 2.5 - 0.8 - 0.9  # crank end to pivot, less coupler and rocker
    with pytest.raises(ClosureError, match=rf"closure 'pin' stays open by {gap:.3g}") as caught:
        mechanism.assembly_modes([np.pi])
    assert caught.value.gap == pytest.approx(gap, rel=1e-6)


def test_limits_leave_modes_out_and_say_so() -> None:
    mechanism = four_bar()
    both = mechanism.assembly_modes([0.3]).q
    limited = four_bar()
    limited.model.lowerPositionLimit[2] = -np.pi
    limited.model.upperPositionLimit[2] = both[:, 2].mean()
    limited = ClosedLoopModel(limited.model, limited.closures, ["a0"])
    found = limited.assembly_modes([0.3])
    assert len(found.q) + found.outside <= 2
    np.testing.assert_allclose(found.q, [both[np.argmin(both[:, 2])]], rtol=0, atol=1e-12)
    assert len(limited.assembly_modes([0.3], within_limits=False).q) == 2


def test_the_search_repeats_ends_in_time_and_keeps_what_it_has_on_ctrl_c() -> None:
    mechanism = dietmaier()
    first, again = (mechanism.assembly_modes(starts=200, seed=3) for _ in range(2))
    np.testing.assert_array_equal(first.q, again.q)
    assert (first.starts, first.stopped) == (200, "starts")
    assert first.expected > len(first.q) + 0.5
    assert mechanism.assembly_modes(seconds=1e-9).stopped == "time"
    shares: list[float] = []

    def stop(share: float) -> None:
        shares.append(share)
        if len(shares) == 2:
            raise KeyboardInterrupt

    found = mechanism.assembly_modes(progress=stop)
    assert found.stopped == "interrupted"
    assert len(found.q) > 5
    assert "interrupted" in str(found)
    assert 0 < shares[0] < 1
    for wrong in ({"starts": 0}, {"seed": -1}, {"seconds": -1.0}, {"frames": []}):
        with pytest.raises(InputError):
            mechanism.assembly_modes(**wrong)  # type: ignore[arg-type]


def test_generated_code_finds_the_same() -> None:
    pytest.importorskip("casadi")
    mechanism = four_bar()
    one, other = mechanism.assembly_modes([0.4]), mechanism.compile().assembly_modes([0.4])
    np.testing.assert_allclose(one.q, other.q, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(one.hits, other.hits)
