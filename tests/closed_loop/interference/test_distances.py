"""Distances of links against closed forms, and their rates against differences."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pinocchio as pin
import pytest
from pinocchio import coal
from scipy.optimize import lsq_linear

from rps_pin import ClosedLoopModel, InputError
from tests.closed_loop.interference import shaped
from tests.closed_loop.interference.shaped import floating, link, place, robot, shape
from tests.worst import worst

RNG = np.random.default_rng(11)


def random_places(count: int, spread: float) -> list[tuple[pin.SE3, pin.SE3]]:
    def one() -> pin.SE3:
        turn = pin.exp3(RNG.uniform(-3, 3, 3) / 2)
        return pin.SE3(turn, spread * RNG.uniform(-1, 1, 3))

    return [(one(), one()) for _ in range(count)]


def distance(mechanism: ClosedLoopModel, q: np.ndarray) -> float:
    found = mechanism.interference(q)
    assert found.pairs == 1
    assert found.nearest is not None
    return found.nearest.distance


def of_segments(a: pin.SE3, la: float, b: pin.SE3, lb: float) -> float:
    """The distance of two segments along z about the origins of placements."""
    ends = np.array([-la / 2, -lb / 2]), np.array([la / 2, lb / 2])
    matrix = np.stack([a.rotation[:, 2], -b.rotation[:, 2]], axis=1)
    found = lsq_linear(matrix, b.translation - a.translation, ends, tol=1e-15, max_iter=500)
    return float(np.sqrt(2 * found.cost))


def of_boxes(a: pin.SE3, sa: np.ndarray, b: pin.SE3, sb: np.ndarray) -> float:
    half = np.concatenate([sa, sb]) / 2
    matrix = np.concatenate([a.rotation, -b.rotation], axis=1)
    gap = b.translation - a.translation
    found = lsq_linear(matrix, gap, (-half, half), method="bvls", tol=1e-15, max_iter=500)
    return float(np.sqrt(2 * found.cost))


# Closed forms -------------------------------------------------------------------------------------


def test_balls() -> None:
    two = floating('<sphere radius="0.3"/>', '<sphere radius="0.2"/>')
    errors = [
        distance(two, place(a, b)) - (np.linalg.norm(a.translation - b.translation) - 0.5)
        for a, b in random_places(50, 0.5)
    ]
    assert worst(errors) < 1e-12


@pytest.mark.parametrize("kinds", ["sphere capsule", "capsule capsule", "capsule sphere"])
def test_capsules(kinds: str) -> None:
    forms = {"sphere": '<sphere radius="0.1"/>', "capsule": '<capsule radius="0.2" length="0.7"/>'}
    sizes = {"sphere": (0.1, 1e-13), "capsule": (0.2, 0.7)}
    one, other = kinds.split()
    two = floating(forms[one], forms[other])
    (ra, la), (rb, lb) = sizes[one], sizes[other]
    errors = []
    for a, b in random_places(50, 0.8):
        apart = of_segments(a, la, b, lb)
        if apart > 1e-6:  # else the axes cross: another depth
            errors.append(distance(two, place(a, b)) - (apart - ra - rb))
    assert len(errors) > 40
    assert worst(errors) < 1e-9


def test_boxes_that_are_apart() -> None:
    sa, sb = np.array([0.3, 0.2, 0.5]), np.array([0.4, 0.1, 0.2])
    two = floating('<box size="0.3 0.2 0.5"/>', '<box size="0.4 0.1 0.2"/>')
    errors, touching = [], 0
    for a, b in random_places(60, 0.5):
        wanted, found = of_boxes(a, sa, b, sb), distance(two, place(a, b))
        if wanted < 1e-6:
            touching += 1
            assert found < 1e-9
        else:
            errors.append(found - wanted)
    assert touching > 5
    assert len(errors) > 20
    assert worst(errors) < 1e-8


def test_boxes_that_overlap_by_a_known_depth() -> None:
    two = floating('<box size="1 1 1"/>', '<box size="1 1 1"/>')
    at = pin.SE3(np.eye(3), np.array([0.9, 0.2, -0.1]))
    turned = pin.SE3(pin.exp3(np.array([0.3, -1.0, 0.5])), np.array([2.0, 1.0, 0.0]))
    found = two.interference(place(turned, turned * at))
    assert [one.distance for one in found.found] == [pytest.approx(-0.1, abs=1e-8)]
    assert not found.ok
    assert "a and b: -0.1 m" in str(found)


def test_an_ellipsoid_and_cylinders_by_their_supports() -> None:
    """On an axis of symmetry, and crossed rods: the axes' distance less both radii."""
    two = floating('<ellipsoid a="0.3" b="0.2" c="0.1"/>', '<cylinder radius="0.05" length="2"/>')
    away = place(pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([0.5, 0, 0])))
    assert distance(two, away) == pytest.approx(0.5 - 0.3 - 0.05, abs=1e-9)
    rods = floating('<cylinder radius="0.1" length="2"/>', '<cylinder radius="0.05" length="2"/>')
    for angle in (0.2, 1.0, 2.0):
        for gap in (0.3, 1e-3, -1e-3, -0.05):
            turned = pin.SE3(pin.exp3(np.array([angle, 0, 0])), np.array([0.15 + gap, 0.0, 0.0]))
            found = distance(rods, place(pin.SE3.Identity(), turned))
            assert found == pytest.approx(gap, abs=1e-8), (angle, gap)


SUPPORTS = {  # how far they reach in directions (n, 3)
    '<box size="0.3 0.5 0.2"/>': lambda n: np.abs(n) @ [0.15, 0.25, 0.1],
    '<sphere radius="0.2"/>': lambda n: np.full(len(n), 0.2),
    '<cylinder radius="0.1" length="0.6"/>': lambda n: (
        0.1 * np.hypot(n[:, 0], n[:, 1]) + 0.3 * np.abs(n[:, 2])
    ),
    '<capsule radius="0.1" length="0.5"/>': lambda n: 0.1 + 0.25 * np.abs(n[:, 2]),
    '<ellipsoid a="0.1" b="0.2" c="0.3"/>': lambda n: np.linalg.norm(n * [0.1, 0.2, 0.3], axis=1),
}


@pytest.mark.parametrize("one", SUPPORTS)
@pytest.mark.parametrize("other", SUPPORTS)
def test_depths_are_the_shortest_ways_out(one: str, other: str) -> None:
    """The least of h_a(n) + h_b(-n) - n . x over directions n, here over 20,000."""
    two = floating(one, other)
    directions = RNG.normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for a, b in random_places(4, 0.07):
        reach = SUPPORTS[one](directions @ a.rotation)
        reach = reach + SUPPORTS[other](-directions @ b.rotation)
        out = float((reach - directions @ (b.translation - a.translation)).min())
        depth = -distance(two, place(a, b))
        assert out > 0.02
        assert out - 0.01 < depth < out + 1e-6, (depth, out)


def test_points_are_the_nearest_ones_and_the_order_of_links_does_not_matter() -> None:
    forms = '<sphere radius="0.1"/>', '<capsule radius="0.2" length="0.7"/>'
    one, other = floating(*forms), floating(*forms[::-1])
    for a, b in random_places(20, 0.8):
        first, second = one.interference(place(a, b)), other.interference(place(b, a))
        assert first.nearest is not None
        assert second.nearest is not None
        assert first.nearest.distance == pytest.approx(second.nearest.distance, abs=1e-12)
        assert worst(first.nearest.point_a - second.nearest.point_b) < 1e-9
        apart = float(np.linalg.norm(first.nearest.point_b - first.nearest.point_a))
        assert apart == pytest.approx(abs(first.nearest.distance), abs=1e-12)
        on_ball = float(np.linalg.norm(first.nearest.point_a - a.translation))
        assert on_ball == pytest.approx(0.1, abs=1e-12)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_the_unit_of_length_does_not_matter(scale: float) -> None:
    """Boxes at the same places in other units."""
    sides = np.array([0.3, 0.2, 0.5])

    def boxes(by: float) -> ClosedLoopModel:
        form = f'<box size="{" ".join(map(repr, map(float, by * sides)))}"/>'
        parts = [link("base"), link("a", shape(form)), link("b"), link("c", shape(form))]
        joints = [
            shaped.joint("x", "base", "a", "prismatic", axis="1 0 0"),
            shaped.joint("y", "base", "b", "continuous", xyz=f"0 {by} 0", axis="1 1 0"),
            shaped.joint("z", "b", "c", "continuous", xyz=f"{0.4 * by} 0 0", axis="0 1 1"),
        ]
        return ClosedLoopModel.from_urdf(robot(*parts, *joints), [], ["x"])

    one, other = boxes(1.0), boxes(scale)
    for _ in range(10):
        q = RNG.uniform(-1, 1, 3)
        wanted, found = (
            m.interference(r * [s, 1, 1]) for m, r, s in ((one, q, 1), (other, q, scale))
        )
        assert wanted.nearest is not None
        assert found.nearest is not None
        assert found.nearest.distance == pytest.approx(scale * wanted.nearest.distance, rel=1e-6)


# Rates --------------------------------------------------------------------------------------------

FORMS = [
    ('<sphere radius="0.1"/>', '<capsule radius="0.1" length="0.7"/>'),
    ('<cylinder radius="0.1" length="0.3"/>', '<box size="0.1 0.2 0.3"/>'),
    ('<ellipsoid a="0.1" b="0.2" c="0.3"/>', '<box size="0.1 0.2 0.3"/>'),
]


@pytest.mark.parametrize("forms", FORMS, ids=["capsule", "cylinder", "ellipsoid"])
def test_rates_are_those_of_differences_and_within_the_bound(forms: tuple[str, str]) -> None:
    two = floating(*forms)
    distances = two.link_distances()
    errors = []
    for a, b in random_places(40, 0.6):
        q, v = place(a, b), RNG.uniform(-1, 1, 12)
        distances.set_state(q, v)
        value, rate = distances.with_rate(0)
        assert distances.bounds()[0] <= value + 1e-12
        h, near = 1e-5, []
        for step in (-h, h):
            distances.set_state(pin.integrate(two.model, q, step * v))
            near.append(distances.distance(0).distance)
        slope = (near[1] - near[0]) / (2 * h)
        distances.set_state(q, v)
        assert abs(slope) <= distances.largest_speeds()[0] * (1 + 1e-6)
        if value > 0 and abs(near[1] - 2 * value + near[0]) < 1e-7:  # no edge between
            errors.append(rate - slope)
    assert len(errors) > 15
    assert worst(errors) < 1e-4


# Copies and bad input -----------------------------------------------------------------------------


def test_copies_have_the_shapes() -> None:
    two = floating('<sphere radius="0.3"/>', '<sphere radius="0.2"/>')
    q = place(pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.0])))
    again = [copy.deepcopy(two), pickle.loads(pickle.dumps(two)), two.with_actuated(["ja"])]
    again += [two.without_effects(), two.with_model(two.model), two.with_closures([])]
    for one in again:
        assert distance(one, q) == pytest.approx(-0.1, abs=1e-12)
    assert len(two.collision_model.geometryObjects) == 2


def test_a_geometry_model_can_be_given() -> None:
    two = floating('<sphere radius="0.3"/>', '<box size="0.2 0.3 0.4"/>')
    given = ClosedLoopModel(two.model, [], [], collision=two.collision_model)
    bare = ClosedLoopModel(two.model, [], [])
    assert bare.interference(bare.home).pairs == 0
    assert bare.interference(bare.home).nearest is None
    for a, b in random_places(5, 0.6):
        q = place(a, b)
        for one in (given, bare.with_collision(two.collision_model), copy.deepcopy(given)):
            assert distance(one, q) == pytest.approx(distance(two, q), abs=1e-12)
    ignored = bare.with_collision(two.collision_model, ignore=[("b", "a")])
    assert ignored.interference(ignored.home).pairs == 0
    stray = two.collision_model.copy()
    stray.geometryObjects[0].parentJoint = 7
    with pytest.raises(InputError, match=r"shape 'a_0' is on joint 7, of 3"):
        ClosedLoopModel(two.model, [], [], collision=stray)


@pytest.mark.parametrize("clearance", [-1e-3, np.nan, np.inf, "wide"])
def test_a_clearance_must_be_a_length(clearance: object) -> None:
    two = floating('<sphere radius="0.3"/>', '<sphere radius="0.2"/>')
    with pytest.raises(InputError, match="clearance"):
        two.interference(two.home, clearance=clearance)  # type: ignore[arg-type]


def test_clearance_counts() -> None:
    two = floating('<sphere radius="0.3"/>', '<sphere radius="0.2"/>')
    q = place(pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([0.55, 0.0, 0.0])))
    assert two.interference(q, clearance=0.049).ok
    found = two.interference(q, clearance=0.051)
    assert [(one.link_a, one.link_b) for one in found.found] == [("a", "b")]
    with pytest.raises(InputError, match="q has shape"):
        two.interference(q[:-1])


def test_shapes_on_a_model_without_links_can_be_given() -> None:
    """A model that was made by hand has joints' frames only, and perhaps none."""
    model, shapes = pin.Model(), pin.GeometryModel()
    for k, name in enumerate("ab"):
        at = pin.SE3(np.eye(3), np.array([0.0, 0.1 * k, 0.0]))
        number = model.addJoint(0, pin.JointModelPX(), at, name)
        model.addJointFrame(number)
        ball = pin.GeometryObject(f"ball {name}", number, pin.SE3.Identity(), coal.Sphere(0.08))
        shapes.addGeometryObject(ball)
    one = ClosedLoopModel(model, [], ["a", "b"], collision=shapes)
    nearest = one.interference([0.0, 0.3]).nearest
    assert nearest is not None
    assert nearest[:2] == ("a", "b")
    assert nearest.distance == pytest.approx(np.hypot(0.1, 0.3) - 0.16, abs=1e-12)
    assert one.interference([0, 0], ignore=[("a", "b")]).pairs == 0
    again = pickle.loads(pickle.dumps(one))
    assert not again.interference([0.0, 0.0]).ok
    with pytest.raises(InputError, match=r"collision = 3: it must be CollisionShapes or"):
        ClosedLoopModel(model, [], ["a"], collision=3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="it must be CollisionShapes"):
        one.with_collision("shapes")  # type: ignore[arg-type]
    plane = pin.GeometryObject("plane", 1, pin.SE3.Identity(), coal.Plane(np.eye(3)[2], 0.0))
    shapes.addGeometryObject(plane)
    odd = ClosedLoopModel(model, [], ["a", "b"], collision=shapes)
    with pytest.raises(InputError, match="shapes of the kind Plane are not checked"):
        odd.interference([0.0, 0.0])


def test_distances_of_many_configurations_refuse_what_does_not_fit() -> None:
    distances = floating('<sphere radius="0.3"/>', '<sphere radius="0.2"/>').link_distances()
    assert distances.distance(0).distance == pytest.approx(-0.5, abs=1e-12)  # the neutral one
    with pytest.raises(InputError, match=r"rates need a velocity: set_state\(q, v\)"):
        distances.with_rate(0)
    for wrong in (1, -1):
        with pytest.raises(InputError, match="no pair of links"):
            distances.distance(wrong)
    for q, v in ((np.zeros(3), None), (np.full(14, np.nan), None), (np.zeros(14), np.zeros(3))):
        with pytest.raises(InputError):
            distances.set_state(q, v)
    with pytest.raises(InputError, match="pair = 'a': it must be int"):
        distances.distance("a")  # type: ignore[arg-type]
