"""Why boxes are outside: at points of them just that is broken, by closed forms and Pinocchio."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

from rps_pin.errors import InputError
from rps_pin.numerics.bits import distinct, holds
from rps_pin.task import Task, certify
from rps_pin.task.certification import reasons
from rps_pin.task.certification.equations import Equations
from rps_pin.task.certification.exclusion import Exclusion
from rps_pin.task.certification.leg_angles import AngleRoom
from rps_pin.task.workspace.reasons import SINGULAR
from tests.reference import five_bar
from tests.task import test_certified as six_ups
from tests.task.robots import task
from tests.task.test_certified_general import FIVE_BAR, drawn, five_bar_side

Truth = Callable[[np.ndarray], np.ndarray]


def with_limits(one: Task, limits: dict[str, tuple[float, float]]) -> Task:
    """Return a task with other limits of joints."""
    model = one.mechanism.model.copy()
    for name, ends in limits.items():
        at = model.joints[model.getJointId(name)].idx_q
        model.lowerPositionLimit[at], model.upperPositionLimit[at] = ends
    return one.with_mechanism(one.mechanism.with_model(model))


def beyond(value: np.ndarray, ends: tuple[float, float], side: str) -> np.ndarray:
    """Return which angles are not between limits, and beyond one by less than half a turn."""
    turn = 2 * np.pi
    out = (value - ends[0]) % turn > ends[1] - ends[0]
    by = (ends[0] - value) if side == "below" else (value - ends[1])
    return np.asarray(out & (by % turn < np.pi))


def some_limits(home: float, random: np.random.Generator) -> tuple[float, float]:
    """Return limits of an angle about home, narrow or of nearly a turn, by whole turns."""
    shift = 2 * np.pi * random.integers(-1, 2)
    width = random.choice([random.uniform(0.1, 1.5), random.uniform(3.2, 6.2)])
    lower = home - width * random.uniform(0.2, 0.8)
    return lower + shift, lower + width + shift


def test_limits_of_six_legs() -> None:
    """Universal joints of any range: of more than half a turn too, and moved by whole turns."""
    random, seen = np.random.default_rng(12), set[str]()
    one = six_ups.TASK
    model, home = one.mechanism.model, one.mechanism.home
    half = np.array([0.7, 0.7, 0.5, 0.0, 0.0, 0.0])
    for _ in range(2):
        limits = {
            name: some_limits(home[model.joints[model.getJointId(name)].idx_q], random)
            for name in model.names
            if name.endswith(("cross_joint", "cylinder_joint"))
        }
        limits |= dict.fromkeys(one.mechanism.actuated, (0.2, 1.1))
        moved = with_limits(one, limits)
        found = certify(moved, one.home - half, one.home + half, most_boxes=30)
        seen |= set(found.reason_shares())
        for name in found.reason_shares():
            points = drawn(found.outside[found.mask(name)], 2000)
            assert broken(moved, limits, name)(points).all(), name
        if len(found.inside):
            points = drawn(found.inside, 2000)
            for name in set(found.reasons) - {SINGULAR}:
                assert not broken(moved, limits, name)(points).any(), name
    assert len([name for name in seen if "cross" in name or "cylinder" in name]) > 15


@pytest.mark.parametrize("most", [20, 3])
def test_too_many_limits_share_their_words(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """The limits of a joint, or those of all: the boxes are the same, and what is said is true."""
    one = six_ups.TASK
    half = np.array([0.7, 0.7, 0.5, 0.0, 0.0, 0.0])
    limits = dict.fromkeys(one.mechanism.actuated, (0.2, 1.1))
    limited = with_limits(one, limits)
    before = certify(limited, one.home - half, one.home + half, most_boxes=30)
    monkeypatch.setattr(reasons, "_MOST_TOLD", most)
    after = certify(limited, one.home - half, one.home + half, most_boxes=30)
    np.testing.assert_array_equal(after.outside, before.outside)
    shared: dict[str, list[np.ndarray]] = {}
    for name in set(before.reasons) - {SINGULAR}:
        who = name.split()[0] if most == 20 else "a joint"
        shared.setdefault(f"{who} beyond a limit", []).append(before.mask(name))
    assert set(after.reasons) == {*shared, SINGULAR}
    for name, masks in shared.items():
        np.testing.assert_array_equal(after.mask(name), np.any(masks, axis=0))
    assert len(before.outside)


def broken(one: Task, limits: dict[str, tuple[float, float]], reason: str) -> Truth:
    """Return which poses of a 6-UPS break a limit, by NumPy."""
    if reason == SINGULAR:
        start = six_ups.legs_of(one.home[None])[2]
        return lambda x: six_ups.legs_of(x)[2] * start < 0
    joint, side = reason.split()[:2]
    ends, leg = limits[joint], int(joint.split("_")[1]) - 1
    model, second = one.mechanism.model, six_ups.LEGS.angles[leg, 1, 0]
    old = six_ups.MECHANISM.model
    shift = (
        second
        - old.lowerPositionLimit[old.joints[old.getJointId(f"leg_{leg + 1}_cylinder_joint")].idx_q]
    )
    assert model.nq == old.nq

    def of(x: np.ndarray) -> np.ndarray:
        length, angles, _ = six_ups.legs_of(x)
        if "rod" in joint:
            room = length[:, leg] - six_ups.LEGS.offset[leg]
            return np.asarray(room < ends[0] if side == "below" else room > ends[1])
        value = angles[:, leg, 0] if "cross" in joint else angles[:, leg, 1] - shift
        return beyond(value, ends, side)

    return of


def test_universal_joints_with_limits_of_a_whole_turn_have_none() -> None:
    """Limits of pi to either side, as files give them, or one alone, exclude nothing."""
    one = six_ups.TASK
    names = [n for n in one.mechanism.model.names if n.endswith(("cross_joint", "cylinder_joint"))]
    for ends in ((-math.pi, math.pi), (-0.1, math.inf), (-math.inf, 0.1)):
        moved = with_limits(one, dict.fromkeys(names, ends))
        assert certify(moved, one.home - 1e-3, one.home + 1e-3).verdict == "inside"


def test_rooms_of_angles_hold_between_their_limits() -> None:
    """Signs of the rooms, of random limits, against the angle itself."""
    random = np.random.default_rng(3)
    for _ in range(300):
        second = bool(random.integers(2))
        lower = random.uniform(-7, 7)
        ends = lower, lower + random.uniform(0.05, 6.2)
        room = AngleRoom(*ends, ("low", "high"), second)
        angle = random.uniform(-1.5, 1.5, 60) if second else random.uniform(-3.1, 3.1, 60)
        r = np.cos(angle) if second else random.uniform(0.1, 1.0, 60)
        x = np.sin(angle) if second else np.sqrt(1 - r**2)
        y, z = (0.0 * r, r) if second else (-r * np.sin(angle), r * np.cos(angle))
        numbers = np.array(room.numbers(x, y, z, r))
        below, above = numbers if room.simple else np.maximum(numbers[0], numbers[1:])
        inside = (angle - ends[0]) % (2 * np.pi) < ends[1] - ends[0]
        assert (((below > 0) & (above > 0)) == inside).all()
        assert ((below < 0) <= beyond(angle, ends, "below")).all()
        assert ((above < 0) <= beyond(angle, ends, "above")).all()


LEGS = {
    "left": (0.0, five_bar.LEFT.length, five_bar.LEFT_ARM.length, -1.0),
    "right": (five_bar.GROUND, five_bar.RIGHT.length, five_bar.RIGHT_ARM.length, 1.0),
}


def leg_angles(leg: str, x: np.ndarray, bend: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return both joints of a leg of the five-bar, home's elbow or the other; NaN out of reach."""
    base, link, arm, own = LEGS[leg]
    d = x - [base, 0.0]
    with np.errstate(invalid="ignore"):
        turned = (
            own * bend * np.arccos(((d * d).sum(axis=-1) - link**2 - arm**2) / (2 * link * arm))
        )
    first = np.arctan2(d[:, 1], d[:, 0])
    return first - np.arctan2(arm * np.sin(turned), link + arm * np.cos(turned)), turned


def five_bar_broken(
    limits: dict[str, tuple[float, float]], reason: str, x: np.ndarray
) -> np.ndarray:
    """Return at which points of a five-bar a reason holds."""
    words, leg = reason.split(), "left" if "left" in reason else "right"
    joints = f"{leg}_joint", f"{leg}_arm_joint"
    if reason == SINGULAR:
        side, reached = five_bar_side(x)
        return np.asarray(reached & (side * five_bar_side(FIVE_BAR.home[None])[0] < 0))
    if reason.startswith("out of reach"):
        return np.isnan(leg_angles(leg, x)[1])
    if reason.startswith("no closure within"):
        out = np.ones(len(x), dtype=bool)
        for bend in (-1.0, 1.0):
            values = leg_angles(leg, x, bend)
            found = [
                beyond(v, limits[n], s) | np.isnan(v)
                for n, v in zip(joints, values, strict=True)
                for s in ("below", "above")
            ]
            out &= np.any(found, axis=0)
        return out
    value = dict(zip(joints, leg_angles(leg, x), strict=True))[words[0]]
    return beyond(value, limits[words[0]], words[1])


def test_limits_reach_and_singularities_of_a_five_bar() -> None:
    random, seen, model = np.random.default_rng(2), set[str](), FIVE_BAR.mechanism.model
    home = FIVE_BAR.mechanism.home
    x = FIVE_BAR.home[None]
    values = [v[0] for leg in LEGS for v in leg_angles(leg, x)]
    assert np.allclose(values, home, atol=1e-9)
    limits = {
        name: some_limits(home[model.joints[model.getJointId(name)].idx_q], random)
        for name in list(model.names)[1:]
    }
    found = certify(with_limits(FIVE_BAR, limits), [-0.1, 0.1], [0.5, 0.7], most_boxes=250)
    for name in found.reason_shares():
        points = drawn(found.outside[found.mask(name)], 2000)
        assert five_bar_broken(limits, name, points).all(), name
        seen.add(" ".join(name.split()[:2]) if name.startswith(("out", "no")) else name)
    points = drawn(found.inside, 2000)
    for name in found.reasons:
        assert not five_bar_broken(limits, name, points).any(), name
    assert {"out of", "no closure"} <= seen
    assert len(seen) > 5


@pytest.mark.parametrize(
    ("name", "far", "reasons"),
    [
        ("delta", 3.0, ("out of reach of arm_", "no closure within the limits of arm_")),
        ("linear_delta", 15.0, ("no closure within the limits of carriage_",)),
    ],
)
def test_legs_that_do_not_close(name: str, far: float, reasons: tuple[str, ...]) -> None:
    """Rods that are too long or short at all positions of their drive, by Pinocchio."""
    one, random = task(name), np.random.default_rng(7)
    equations, length = Equations(one), one.characteristic_length
    z = equations.closed(equations.state(one.mechanism.home)[None], one.home[None])
    exclusion = Exclusion(equations, z[0], 0.0)
    x = one.home + far * random.uniform(-1.0, 1.0, (80, 3)) * length
    half = np.full(x.shape, 0.05 * length)
    why = exclusion.excluded(x, half)
    assert 20 < np.count_nonzero(why) < len(x)
    for each in exclusion.reasons:
        assert each.startswith(reasons)
        out = holds(why, exclusion.reasons, each)
        assert out.any()
        boxes = np.stack([x[out] - half[out], x[out] + half[out]], axis=1)
        gaps = rod_gaps(one, each.split()[-1], drawn(boxes, 300), limited="limits" in each)
        assert (np.sign(gaps) == np.sign(gaps[:1])).all()
    assert len(exclusion.reasons) == 3 * len(reasons)


def rod_gaps(one: Task, drive: str, x: np.ndarray, *, limited: bool) -> np.ndarray:
    """Return how much too long a leg's first rod would be, at positions of its drive, (400, n)."""
    model = one.mechanism.model
    joint = model.getJointId(drive)
    at = model.joints[joint].idx_q
    ends = (model.lowerPositionLimit[at], model.upperPositionLimit[at])
    closure = next(c for c in one.mechanism.closures if c.closed_frames(model)[0].joint == joint)
    tip, ball = closure.closed_frames(model)
    data, gaps = model.createData(), []
    for value in np.linspace(*(ends if limited else (-np.pi, np.pi)), 400):
        q = one.mechanism.home.copy()
        q[at] = value
        pin.forwardKinematics(model, data, q)
        away = x + ball.placement.translation - data.oMi[joint].act(tip.placement.translation)
        gaps.append(np.linalg.norm(away, axis=-1) - closure.distance)
    return np.array(gaps)


def test_reasons_that_are_not_there_and_too_many() -> None:
    home = FIVE_BAR.home
    found = certify(FIVE_BAR, home - 1e-3, home + 1e-3)
    assert found.reason.shape == (0,)
    assert found.reason_shares() == {}
    with pytest.raises(InputError, match="no reason 'rain'"):
        found.mask("rain")
    with pytest.raises(InputError, match="65 limits"):
        distinct(map(str, range(65)))
