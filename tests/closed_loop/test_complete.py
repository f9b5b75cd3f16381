"""Completion keeps the assembly mode of its guess, or refuses: against closed forms.

Planar points are found where circles meet, on a side that is fixed once: a solution of the same
side is the same assembly mode as long as the circles meet all along the way. Where they do not,
the way must be refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, JointCoupling, LoopClosure
from rps_pin.errors import ClosureError, InputError, SingularityError
from tests.proofs.common import both_engines, through
from tests.worst import worst

Array = NDArray[np.float64]
Rng = np.random.Generator

#: Squared height of an intersection, m^2, below which its side is not certain.
_TOUCH = 2e-3


def at(*point: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([*point, 0.0, 0.0, 0.0])[:3])


class Tree:
    """A tree of bars that turn in the x-y plane."""

    def __init__(self) -> None:
        self.model = pin.Model()

    def turn(self, name: str, parent: int = 0, *point: float, kind: Any = None) -> int:
        index = self.model.addJoint(parent, kind or pin.JointModelRZ(), at(*point), name)
        self.model.appendBodyToJoint(index, pin.Inertia.Random(), pin.SE3.Identity())
        return int(index)

    def tip(self, name: str, joint: int, *point: float) -> None:
        self.model.addFrame(pin.Frame(name, joint, at(*point), pin.FrameType.OP_FRAME))

    def closed(self, pairs: str, actuated: Sequence[str], home: Array) -> ClosedLoopModel:
        """Frames A and a, B and b and so on are pinned together."""
        closures = [LoopClosure(pair.upper(), pair, "spherical", name=pair) for pair in pairs]
        return ClosedLoopModel(self.model, closures, actuated, home=home)


def meeting(c: Array, r: float, d: Array, s: float, side: float) -> tuple[Array, float]:
    """Where circles about c and d meet, to the left of c d if side is 1; and h^2 (lacking: < 0)."""
    along = d - c
    length = float(np.hypot(*along))
    x = (r * r - s * s + length * length) / (2 * length)
    height = r * r - x * x
    across = np.array([-along[1], along[0]]) / length
    return c + x * along / length + side * np.sqrt(max(height, 0.0)) * across, height


def angle(v: Array) -> float:
    return float(np.arctan2(v[1], v[0]))


def polar(length: float, turned: float) -> Array:
    return length * np.array([np.cos(turned), np.sin(turned)])


def wrapped(x: Array) -> Array:
    return (x + np.pi) % (2 * np.pi) - np.pi


@dataclass
class Linkage:
    """A mechanism with its closed form: q of given coordinates, and the least h^2."""

    mechanism: ClosedLoopModel
    given: list[str]
    exact: Callable[[Array], tuple[Array, float]]
    start: Array

    def checked(self, goal: Array) -> str:
        """Complete the goal from the start, and say what came of it."""
        way = [self.exact(self.start + s * (goal - self.start))[1] for s in np.linspace(0, 1, 301)]
        q, least = self.exact(self.start)[0], min(way)
        values = dict(zip(self.given, goal, strict=True))
        try:
            found = self.mechanism.complete(values, q)
        except (SingularityError, ClosureError):
            return "refused" if least < _TOUCH else "needlessly refused"
        if least < -_TOUCH:
            return "taken through a gap"
        error = np.abs(wrapped(found - self.exact(goal)[0])).max()
        return "right" if error < 1e-6 else "wrong" if least > _TOUCH else "undecided"


def four_bar(rng: Rng) -> Linkage | None:
    ground, crank, coupler, rocker = rng.uniform(0.2, 1.2, 4)
    side, start = rng.choice([-1.0, 1.0]), rng.uniform(-np.pi, np.pi, 1)
    pivot = np.array([ground, 0.0])

    def exact(x: Array) -> tuple[Array, float]:
        a = polar(crank, x[0])
        b, height = meeting(a, coupler, pivot, rocker, side)
        return np.array([x[0], angle(b - a) - x[0], angle(b - pivot)]), height

    tree = Tree()
    first = tree.turn("crank")
    tree.tip("A", tree.turn("coupler", first, crank), coupler)
    tree.tip("a", tree.turn("rocker", 0, ground), rocker)
    return linkage(tree, "a", ["crank"], exact, start)


def five_bar(rng: Rng) -> Linkage | None:
    ground, left, left_arm, right, right_arm = rng.uniform(0.2, 1.2, 5)
    side, start = rng.choice([-1.0, 1.0]), rng.uniform(-np.pi, np.pi, 2)

    def exact(x: Array) -> tuple[Array, float]:
        a, c = polar(left, x[0]), np.array([ground, 0.0]) + polar(right, x[1])
        b, height = meeting(a, left_arm, c, right_arm, side)
        return np.array([x[0], angle(b - a) - x[0], x[1], angle(b - c) - x[1]]), height

    tree = Tree()
    tree.tip("A", tree.turn("left_arm", tree.turn("left"), left), left_arm)
    tree.tip("a", tree.turn("right_arm", tree.turn("right", 0, ground), right), right_arm)
    return linkage(tree, "a", ["left", "right"], exact, start)


def slider_crank(rng: Rng) -> Linkage | None:
    crank, rod, offset = *rng.uniform(0.2, 1.2, 2), rng.uniform(-0.3, 0.3)
    side, start = rng.choice([-1.0, 1.0]), rng.uniform(-np.pi, np.pi, 1)

    def exact(x: Array) -> tuple[Array, float]:
        a = polar(crank, x[0])
        height = rod**2 - (a[1] - offset) ** 2
        end = np.array([a[0] + side * np.sqrt(max(height, 0.0)), offset])
        return np.array([x[0], angle(end - a) - x[0], end[0]]), height

    tree = Tree()
    tree.tip("A", tree.turn("rod", tree.turn("crank"), crank), rod)
    tree.tip("a", tree.turn("slider", 0, 0.0, offset, kind=pin.JointModelPX()))
    return linkage(tree, "a", ["crank"], exact, start)


def jansen(rng: Rng) -> Linkage | None:
    """The leg of Theo Jansen (his numbers, cm), three loops; its crank turns all the way."""
    b, c, d, e, f, g, j, k = 0.415, 0.393, 0.401, 0.558, 0.394, 0.367, 0.5, 0.619
    crank, pivot = 0.15, np.array([-0.38, -0.078])

    def exact(x: Array) -> tuple[Array, float]:
        end = polar(crank, x[0])
        y, h1 = meeting(end, j, pivot, b, -1.0)
        z, h2 = meeting(pivot, d, y, e, 1.0)
        w, h3 = meeting(end, k, pivot, c, 1.0)
        v, h4 = meeting(z, f, w, g, -1.0)
        triangle, lower = angle(y - pivot), angle(w - pivot)
        turns = [angle(y - end) - x[0], angle(w - end) - x[0], triangle]
        turns += [angle(v - z) - triangle, lower, angle(v - w) - lower]
        return np.array([x[0], *turns]), min(h1, h2, h3, h4)

    inner = np.arccos((b * b + d * d - e * e) / (2 * b * d))
    tree = Tree()
    first = tree.turn("crank")
    tree.tip("A", tree.turn("upper", first, crank), j)
    tree.tip("B", tree.turn("lower", first, crank), k)
    triangle = tree.turn("triangle", 0, *pivot)
    tree.tip("a", triangle, b)
    tree.tip("C", tree.turn("link", triangle, *polar(d, inner)), f)
    lower = tree.turn("thigh", 0, *pivot)
    tree.tip("b", lower, c)
    tree.tip("c", tree.turn("shin", lower, c), g)
    return linkage(tree, "abc", ["crank"], exact, rng.uniform(-np.pi, np.pi, 1))


def linkage(
    tree: Tree, pairs: str, given: list[str], exact: Callable[..., Any], start: Array
) -> Linkage | None:
    """The linkage, if it closes well at the start."""
    q, height = exact(start)
    if height < 1e-3:
        return None
    return Linkage(tree.closed(pairs, given, q), given, exact, start)


def drawn(make: Callable[[Rng], Linkage | None], seed: int) -> tuple[Linkage, Rng]:
    rng = np.random.default_rng(seed)
    while True:
        if (found := make(rng)) is not None:
            return found, rng


@pytest.fixture
def without_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """A refusal need not look for configurations elsewhere, which takes most of its time."""

    def nowhere(*_: object, **__: object) -> Array:
        raise ClosureError("not looked for", np.inf)

    monkeypatch.setattr("rps_pin.closed_loop.assembly.completion.close", nowhere)


@pytest.mark.usefixtures("without_search")
@pytest.mark.parametrize(
    ("make", "mechanisms"), [(four_bar, 20), (five_bar, 15), (slider_crank, 15), (jansen, 3)]
)
def test_never_another_branch_and_no_needless_refusal(
    make: Callable[[Rng], Linkage | None], mechanisms: int
) -> None:
    counts: dict[str, int] = {}
    for seed in range(mechanisms):
        one, rng = drawn(make, seed)
        for _ in range(5):
            goal = one.start + rng.uniform(-4.0, 4.0, one.start.size)
            outcome = one.checked(goal)
            counts[outcome] = counts.get(outcome, 0) + 1
    assert counts.keys() <= {"right", "refused", "undecided"}, counts
    assert counts["right"] >= mechanisms
    assert counts.get("undecided", 0) <= max(1, 0.02 * sum(counts.values()))


def crank_rocker() -> tuple[ClosedLoopModel, Callable[[Array], tuple[Array, float]]]:
    """Bars of 1.0, 0.5, 1.2, 0.8 m, from a field report; and its closed form."""
    tree, pivot = Tree(), np.array([1.0, 0.0])
    tree.tip("A", tree.turn("coupler", tree.turn("crank"), 0.5), 1.2)
    tree.tip("a", tree.turn("rocker", 0, 1.0), 0.8)

    def exact(x: Array) -> tuple[Array, float]:
        a = polar(0.5, x[0])
        b, height = meeting(a, 1.2, pivot, 0.8, 1.0)
        return np.array([x[0], angle(b - a) - x[0], angle(b - pivot)]), height

    return tree.closed("a", ["crank"], exact(np.array([0.6]))[0]), exact


@both_engines
def test_four_bar_of_a_field_report(engine: str) -> None:
    """From home, 78 of 181 crank angles came on the other branch."""
    mechanism, exact = crank_rocker()
    model, jumped = through(engine, mechanism), 0
    for x in np.linspace(-np.pi, np.pi, 91):
        right = exact(np.array([x]))[0]
        assert worst(np.abs(wrapped(model.complete([x]) - right))) < 1e-9
        jumped += worst(np.abs(wrapped(model.complete([x], jump=True) - right))) > 1e-6
    assert jumped > 10  # the option does what it says


@both_engines
def test_jansen_leg_of_a_field_report(engine: str) -> None:
    """From home, 44 of 91 crank angles came on another branch; and one after the other, around."""
    leg, _ = drawn(jansen, 0)
    model = through(engine, leg.mechanism)
    home = leg.mechanism.home
    at_ = leg.mechanism.model.joints[leg.mechanism.model.getJointId("crank")].idx_q
    q = home
    for x in home[at_] + np.linspace(0.0, 2 * np.pi, 46):
        right = leg.exact(np.array([x]))[0]
        assert worst(np.abs(wrapped(model.complete([x]) - right))) < 1e-9
        q = model.complete([x], q)
        assert worst(np.abs(wrapped(q - right))) < 1e-9


def test_determinant_of_the_passive_joints_keeps_its_sign() -> None:
    """That of the plane closure's Jacobian by coupler and rocker, along a way of two turns.

    With the end B, the coupler's joint A and the pivot O, its columns are the velocities of B by
    either joint, at a right angle to B - A and to O - B: their cross product is (B - A) x (O - B).
    """
    mechanism, _ = crank_rocker()
    q, signs, pivot = mechanism.home, set(), np.array([1.0, 0.0])
    for x in np.linspace(0.6, 0.6 + 4 * np.pi, 60):
        q = mechanism.complete([x], q)
        a, b = polar(0.5, q[0]), pivot + polar(0.8, q[2])
        determinant = np.linalg.det(np.array([b - a, pivot - b]))
        np.testing.assert_allclose(a + polar(1.2, q[0] + q[1]), b, rtol=0, atol=1e-12)
        assert abs(determinant) > 0.1
        signs.add(float(np.sign(determinant)))
    assert len(signs) == 1


def spherical_four_bar() -> tuple[ClosedLoopModel, Callable[[Array], tuple[Array, Array]]]:
    """Axes through one point, arcs of 60, 35, 80, 70 degrees; rows of its closure are redundant."""
    ground, crank, coupler, rocker = np.radians([60.0, 35.0, 80.0, 70.0])
    model = pin.Model()

    def arc(of: float) -> pin.SE3:
        return pin.SE3(pin.utils.rotate("y", float(of)), np.zeros(3))

    def turning(parent: int, placement: pin.SE3, name: str) -> int:
        index = model.addJoint(parent, pin.JointModelRZ(), placement, name)
        model.appendBodyToJoint(index, pin.Inertia.Random(), pin.SE3.Identity())
        return int(index)

    first = turning(0, pin.SE3.Identity(), "crank")
    second = turning(first, arc(crank), "coupler")
    third = turning(0, arc(ground), "rocker")
    ends = {"A": (second, coupler), "a": (third, rocker)}
    for name, (joint, of) in ends.items():
        place = arc(of) * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.3]))
        model.addFrame(pin.Frame(name, joint, place, pin.FrameType.OP_FRAME))

    def axes(q: Array) -> tuple[Array, Array]:
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        common = data.oMf[model.getFrameId("A")].translation / 0.3
        other = data.oMf[model.getFrameId("a")].translation / 0.3
        first_end, pivot = data.oMi[second].rotation[:, 2], data.oMi[third].rotation[:, 2]
        side = np.linalg.det(np.column_stack([first_end, pivot, common]))
        return np.array([side]), common - other

    mechanism = ClosedLoopModel(model, [LoopClosure("A", "a", name="arc")], ["crank"])
    return mechanism, axes


def test_spherical_linkage_stays_on_its_side() -> None:
    """The sign of the triple product of crank end, pivot and common axis tells the branch."""
    mechanism, axes = spherical_four_bar()
    home = mechanism.close([0.5, 1.0, 1.0])
    side = axes(home)[0]
    assert abs(side) > 0.1
    for goal in home[0] + np.linspace(-2 * np.pi, 2 * np.pi, 41):
        q = mechanism.complete([goal], home)
        found, apart = axes(q)
        assert q[0] == goal
        assert np.abs(apart).max() < 1e-11
        assert found * side > 0


def test_stewart_platform_against_small_steps_of_its_length_equations() -> None:
    """Newton's method on |p + R b - a| = l, in 200 steps, shares nothing with the package."""
    from tests.proofs.common import loaded

    mechanism = loaded("stewart")
    model, home = mechanism.model, mechanism.home
    platform = model.getJointId("platform_joint")
    data = model.createData()
    pin.framesForwardKinematics(model, data, home)
    legs = []
    for closure in mechanism.closures:
        frames = [model.frames[model.getFrameId(f)] for f in (closure.frame_a, closure.frame_b)]
        on = next(f for f in frames if f.parentJoint == platform)
        leg = next(f for f in frames if f.parentJoint != platform)
        lower = leg.parentJoint
        while model.parents[lower] != 0:
            lower = model.parents[lower]
        legs.append((np.array(on.placement.translation), np.array(data.oMi[lower].translation)))
    place = pin.SE3(data.oMi[platform])
    tops, bottoms = map(np.array, zip(*legs, strict=True))
    names = mechanism.actuated
    at_ = [model.joints[model.getJointId(name)].idx_q for name in names]
    first = np.linalg.norm(place.translation + tops @ place.rotation.T - bottoms, axis=1)
    rng = np.random.default_rng(0)
    for _ in range(6):
        stroke = rng.uniform(-0.08, 0.08, 6)
        t, rotation = place.translation.copy(), place.rotation.copy()
        for s in np.linspace(0, 1, 201)[1:]:
            for _ in range(4):
                arms = tops @ rotation.T
                rods = t + arms - bottoms
                length = np.linalg.norm(rods, axis=1)
                u = rods / length[:, None]
                slope = np.hstack([u, np.cross(arms, u)])
                step = np.linalg.solve(slope, first + s * stroke - length)
                t, rotation = t + step[:3], pin.exp3(step[3:]) @ rotation
        q = mechanism.complete(home[at_] + stroke, home)
        pin.forwardKinematics(model, data, q)
        np.testing.assert_allclose(data.oMi[platform].translation, t, rtol=0, atol=1e-9)
        np.testing.assert_allclose(data.oMi[platform].rotation, rotation, rtol=0, atol=1e-9)


# Refusals -----------------------------------------------------------------------------------------


def double_rocker() -> tuple[ClosedLoopModel, Array]:
    """Crank 1.5, coupler 0.8, rocker 0.9, ground 1.0: the crank swings, and meets dead points."""
    tree, pivot = Tree(), np.array([1.0, 0.0])
    tree.tip("A", tree.turn("coupler", tree.turn("crank"), 1.5), 0.8)
    tree.tip("a", tree.turn("rocker", 0, 1.0), 0.9)
    a = polar(1.5, 0.6)
    b, _ = meeting(a, 0.8, pivot, 0.9, 1.0)
    q = np.array([0.6, angle(b - a) - 0.6, angle(b - pivot)])
    return tree.closed("a", ["crank"], q), q


def test_says_where_the_assembly_mode_ends() -> None:
    """From 0.6 to 0.6 - 2 pi the crank would pass its dead point, where d = 0.8 + 0.9."""
    mechanism, q = double_rocker()
    reach = np.arccos((1.0 + 1.5**2 - 1.7**2) / (2 * 1.5))  # |crank end - pivot| = 1.7
    share = (reach - 0.6) / (2 * np.pi)
    with pytest.raises(SingularityError, match=r"jump=True") as caught:
        mechanism.complete([0.6 + 2 * np.pi], q)
    assert f"after {share:.3%}"[:10] in str(caught.value)
    assert caught.value.condition > 1e4
    jumped = mechanism.complete([0.6 + 2 * np.pi], q, jump=True)
    assert mechanism.loop_gap(jumped) < 1e-12


def test_a_way_too_long_is_no_singularity(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rps_pin.closed_loop.assembly.continuation._MOST_STEPS", 200)
    mechanism, _ = crank_rocker()
    with pytest.raises(InputError, match=r"too long to be followed: \d\.\d+% of it was"):
        mechanism.complete([1e4])


def test_values_that_no_configuration_has() -> None:
    mechanism, q = double_rocker()
    with pytest.raises(ClosureError, match=r"closure 'a' stays open by .* assembly mode ends"):
        mechanism.complete([3.0], q)


def test_a_singular_guess_is_refused_but_not_for_its_own_values() -> None:
    """A parallelogram, flat: it may go on as a parallelogram or as an antiparallelogram."""
    tree = Tree()
    tree.tip("A", tree.turn("coupler", tree.turn("crank"), 0.3), 0.6)
    tree.tip("a", tree.turn("rocker", 0, 0.6), 0.3)
    flat = np.zeros(3)
    mechanism = tree.closed("a", ["crank"], flat)
    np.testing.assert_array_equal(mechanism.complete([0.0], flat), flat)
    with pytest.raises(SingularityError, match="the guess itself is singular"):
        mechanism.complete([0.3], flat)
    beside = mechanism.complete([0.3], [0.01, -0.01, 0.01])
    np.testing.assert_allclose(beside, [0.3, -0.3, 0.3], rtol=0, atol=1e-10)
    with pytest.raises(SingularityError, match=r"after 50\.0000%"):
        mechanism.complete([-0.3], beside)


# The guess, the limits, and how many values -------------------------------------------------------


def test_an_open_guess_is_closed_first() -> None:
    one, _ = drawn(four_bar, 3)
    exact = one.exact(one.start)[0]
    rng = np.random.default_rng(0)
    for _ in range(5):
        rough = exact + 0.03 * rng.normal(size=3)
        goal = one.start + 0.2
        found = one.mechanism.complete(goal, rough)
        np.testing.assert_allclose(wrapped(found - one.exact(goal)[0]), 0, rtol=0, atol=1e-9)


def test_limits_hold_at_the_end_and_angles_may_be_turned_into_them() -> None:
    """The coupler of a crank-rocker turns all the way relative to the crank."""
    tree, pivot = Tree(), np.array([1.0, 0.0])
    tree.tip("A", tree.turn("coupler", tree.turn("crank"), 0.4), 1.1)
    tree.tip("a", tree.turn("rocker", 0, 1.0), 0.8)
    tree.model.lowerPositionLimit[:] = [-9.0, -np.pi, 0.0]
    tree.model.upperPositionLimit[:] = [9.0, np.pi, np.pi]
    a = polar(0.4, 0.6)
    b, _ = meeting(a, 1.1, pivot, 0.8, 1.0)
    home = np.array([0.6, angle(b - a) - 0.6, angle(b - pivot)])
    mechanism = tree.closed("a", ["crank"], home)
    for goal in (5.0, 8.0, -5.0):
        q = mechanism.complete([goal])
        assert -np.pi <= q[1] <= np.pi
        free = mechanism.complete([goal], within_limits=False)
        assert abs(free[1]) > np.pi
        np.testing.assert_allclose(wrapped(q - free), 0, rtol=0, atol=1e-12)
    tree.model.upperPositionLimit[2] = home[2] + 0.05
    narrow = tree.closed("a", ["crank"], home)
    rocker = mechanism.complete([2.5])[2]
    assert rocker > home[2] + 0.05
    with pytest.raises(ClosureError, match=rf"'rocker' at {rocker:.5g}.*within_limits=False"):
        narrow.complete([2.5])
    with pytest.raises(ClosureError, match="given joints are outside their limits: 'crank' at 20"):
        narrow.complete([20.0])


def test_fewer_values_than_motions() -> None:
    """The right crank of a five-bar is free: its motion is the least, and the branch is kept."""
    one, rng = drawn(five_bar, 5)
    q = one.exact(one.start)[0]
    for _ in range(5):
        turn = rng.uniform(-0.3, 0.3)
        found = one.mechanism.complete({"left": q[0] + turn}, q)
        assert found[0] == q[0] + turn
        assert one.mechanism.loop_gap(found) <= 1e-12
        assert np.abs(found - q).max() <= 4 * abs(turn)


def test_more_values_than_motions() -> None:
    """Crank and rocker of a four-bar both: consistent values are reached, others refused."""
    one, rng = drawn(four_bar, 3)
    q = one.exact(one.start)[0]
    for _ in range(5):
        goal = one.exact(one.start + rng.uniform(-0.3, 0.3))[0]
        found = one.mechanism.complete({"crank": goal[0], "rocker": goal[2]}, q)
        np.testing.assert_allclose(wrapped(found - goal), 0, rtol=0, atol=1e-9)
    with pytest.raises(ClosureError):
        one.mechanism.complete({"crank": goal[0], "rocker": goal[2] + 0.2}, q)


def test_balls_and_couplings() -> None:
    """A body turned by a geodesic that a coupling and a ball allow."""
    model = pin.Model()
    ball = model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(ball, pin.Inertia.Random(), pin.SE3.Identity())
    pairs = []
    for name in ("one", "two"):
        index = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(index, pin.Inertia.Random(), pin.SE3.Identity())
        pairs.append(name)
    coupling = JointCoupling("one", "two", ratio=2.0, name="gear")
    mechanism = ClosedLoopModel(model, [coupling], ["one", "ball"])
    turn = pin.Quaternion(pin.exp3(np.array([0.3, -2.0, 1.5]))).coeffs()
    q = mechanism.complete({"one": 3.0, "ball": turn})
    np.testing.assert_allclose(q, [*turn, 3.0, 1.5], rtol=0, atol=1e-14)
