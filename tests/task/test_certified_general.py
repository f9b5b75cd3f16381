"""Certified boxes of mechanisms in general, against closed forms, and the 6-UPS's own way.

``python -m tests.task.test_certified_general`` hunts for counterexamples with more points.
"""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from scipy.optimize import brentq

from rps_pin.errors import InputError, MechanismError, SingularityError
from rps_pin.numerics.boxes import CertifiedBoxes
from rps_pin.task import certify
from rps_pin.task.certification.equations import Equations
from rps_pin.task.certification.general import certify_general
from rps_pin.task.certification.newton import sheets
from tests.reference import five_bar
from tests.task import test_certified as six_ups
from tests.task.robots import poses, task
from tests.worst import worst

FIVE_BAR = task("five_bar")


def five_bar_side(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sine between the forearms with home's elbows, (n,), and which points are reached.

    Circles about both base joints and the point; forearms in line are singular (type II).
    """
    found, reached = [], np.ones(len(x), dtype=bool)
    legs = (
        (0.0, five_bar.LEFT.length, five_bar.LEFT_ARM.length, -1.0),
        (five_bar.GROUND, five_bar.RIGHT.length, five_bar.RIGHT_ARM.length, 1.0),
    )
    for base, link, arm, bend in legs:
        d = x - [base, 0.0]
        cosine = ((d * d).sum(axis=-1) - link**2 - arm**2) / (2 * link * arm)
        reached &= np.abs(cosine) < 1
        turned = bend * np.arccos(np.clip(cosine, -1, 1))
        first = np.arctan2(d[:, 1], d[:, 0])
        first = first - np.arctan2(arm * np.sin(turned), link + arm * np.cos(turned))
        found.append(first + turned)
    return np.sin(found[1] - found[0]), reached


def five_bar_inside(x: np.ndarray) -> np.ndarray:
    """Return which points (n, 2) are reached with home's elbows, on home's side of type II."""
    side, reached = five_bar_side(x)
    return np.asarray(reached & (side * five_bar_side(FIVE_BAR.home[None])[0] > 0))


def drawn(boxes: np.ndarray, count: int, seed: int = 6) -> np.ndarray:
    """Return points of boxes (n, 2, m), many of them on faces, edges and corners."""
    random = np.random.default_rng(seed)
    which = random.integers(0, len(boxes), count)
    share = np.clip(random.uniform(-0.4, 1.4, (count, boxes.shape[2])), 0.0, 1.0)
    low, high = boxes[which, 0], boxes[which, 1]
    return np.minimum(low + (high - low) * share, high)


@pytest.fixture(scope="module")
def found() -> CertifiedBoxes:
    return certify(FIVE_BAR, [-0.1, 0.05], [0.7, 0.9], undecided=0.28, most_boxes=4000)


def test_no_counterexample_for_the_five_bar(found: CertifiedBoxes) -> None:
    assert found.verdict == "partly"
    assert found.share_undecided < 0.3
    assert math.isclose(sum(found.volumes), 0.8 * 0.85, rel_tol=1e-9)
    assert five_bar_inside(drawn(found.inside, 100_000)).all()
    assert not five_bar_inside(drawn(found.outside, 100_000)).any()
    x = drawn(found.inside, 40)
    assert np.isfinite(FIVE_BAR.to_actuators(x)).all()


def test_the_area_is_within_its_bounds(found: CertifiedBoxes) -> None:
    x = np.random.default_rng(9).uniform([-0.1, 0.05], [0.7, 0.9], (400_000, 2))
    share, (size, _, undecided) = five_bar_inside(x).mean(), found.volumes
    error = 5 * math.sqrt(0.25 / len(x))
    assert size / 0.68 - error < share < (size + undecided) / 0.68 + error


def test_no_certified_box_holds_a_singularity(found: CertifiedBoxes) -> None:
    """Points at which the forearms are in line, between neighbours on lines across the box."""
    crossed = 0
    for height in np.linspace(0.05, 0.3, 150):
        x = np.stack([np.linspace(-0.1, 0.7, 4001), np.full(4001, height)], axis=-1)
        side, reached = five_bar_side(x)
        at = np.flatnonzero((side[1:] * side[:-1] < 0) & reached[1:] & reached[:-1])
        for i in at:
            if abs(side[i]) < 0.1:  # not half a turn
                low = np.maximum(x[i], found.inside[:, 0])
                high = np.minimum(x[i + 1], found.inside[:, 1])
                whole = (low <= x[i]) & (high >= x[i + 1])
                assert not whole.all(axis=-1).any()
                crossed += 1
    assert crossed > 50


@pytest.mark.parametrize(
    "name", ["ankle", "delta", "linear_delta", "planar_rrr", "rrs", "minitaur_leg", "four_bar"]
)
def test_small_boxes_about_regular_poses_are_inside(name: str) -> None:
    """And what is proven of configurations holds of those that the task finds."""
    one, (x, q) = task(name), poses(name)
    equations = Equations(one)
    z = np.array([equations.state(each) for each in q])
    half = np.where(one.angular, 1e-3, 1e-3 * one.characteristic_length) * np.ones_like(x)
    proven = sheets(equations, equations.closed(z, x), x, half)
    assert proven.proven.all()
    random = np.random.default_rng(4)
    for k in range(len(x)):
        d = half[k] * random.choice([-1.0, 1.0], one.size)
        moved = one.configuration(x[k] + d, q[k], within_limits=False)
        away = equations.apart(proven.z[k : k + 1], equations.state(moved)[None])[0]
        assert (np.abs(away - proven.slopes[k] @ d) <= proven.within[k] + 1e-9).all()
    found = certify(one, x[0] - half[0], x[0] + half[0], start=q[0])
    assert found.verdict == "inside"


def test_slopes_hold_those_of_the_task() -> None:
    for name in ("delta", "rrs", "rotary_stewart"):
        one, (x, q) = task(name), poses(name)
        equations = Equations(one)
        z = equations.closed(np.array([equations.state(each) for each in q]), x)
        found = sheets(equations, z, x, np.zeros_like(x))
        at = [equations.symbols.unknown_of(int(k)) for k in one.of_actuators]
        units = [u.unit for u in equations.unknowns for k in at if u.y.start == k]
        K = found.slopes[:, at] * np.array(units)[:, None]
        assert worst(K - one.jacobian(q, x=x)) < 1e-8


@pytest.mark.slow
def test_the_general_way_agrees_with_the_closed_form() -> None:
    one = six_ups.TASK
    half = np.array([0.02, 0.02, 0.02, 0.04, 0.04, 0.04])
    options = {"start": None, "free": 0.0, "undecided": 0.0, "progress": iter}
    home = one.home
    good = certify_general(one, home - half, home + half, most_boxes=100, **options)
    assert good.verdict == "inside"
    held = np.array([0.3, 0.0, 0.25, 0.0, 0.0, 0.0])
    wide = certify_general(one, home - held, home + held, most_boxes=100, **options)
    assert wide.volumes[0] > 0
    assert wide.volumes[1] > 0
    assert six_ups.inside(drawn(wide.inside, 50_000)).all()
    assert not six_ups.inside(drawn(wide.outside, 50_000)).any()


def test_limits_by_whole_turns() -> None:
    """A joint is within limits if it is so by a whole turn: the five-bar with its limits moved."""
    mechanism = FIVE_BAR.mechanism
    for shift in (0.0, 2 * np.pi, -2 * np.pi):
        model = mechanism.model.copy()
        at = mechanism.home + shift
        model.lowerPositionLimit[:], model.upperPositionLimit[:] = at - 0.5, at + 0.5
        moved = FIVE_BAR.with_mechanism(mechanism.with_model(model))
        home = moved.home
        assert certify(moved, home - 1e-3, home + 1e-3).verdict == "inside"


def test_bad_boxes_starts_and_mechanisms_are_refused() -> None:
    home = FIVE_BAR.home
    with pytest.raises(InputError, match="is empty"):
        certify(FIVE_BAR, home, home)
    with pytest.raises(InputError, match="is not in the box"):
        certify(FIVE_BAR, home - 0.01, home + 0.01, start=home + 0.05)
    with pytest.raises(InputError, match="free"):
        certify(FIVE_BAR, home - 0.01, home + 0.01, free=-1.0)
    with pytest.raises(InputError, match="rotation vectors up to"):
        certify(task("rrs"), [0.2, -2.0, -1.0], [0.3, 2.0, 1.0])
    with pytest.raises(MechanismError, match="12 equations for 14 unknowns"):
        certify(task("cassie_leg"), task("cassie_leg").home - 0.01, task("cassie_leg").home + 0.01)
    with pytest.raises(SingularityError, match="singular"):
        certify(FIVE_BAR, [0.1, 0.1], [0.9, 0.9], start=_arms_in_line())


def _arms_in_line() -> np.ndarray:
    """Return a configuration of the five-bar whose forearms are one line: type II."""
    right = 0.4
    tip = five_bar.RIGHT.length * np.array([math.cos(right), math.sin(right)])
    tip[0] += five_bar.GROUND

    def between(left: float) -> np.ndarray:
        elbow = five_bar.LEFT.length * np.array([math.cos(left), math.sin(left)])
        return np.asarray(tip - elbow)

    reach = five_bar.LEFT_ARM.length + five_bar.RIGHT_ARM.length
    left = brentq(lambda x: np.linalg.norm(between(x)) - reach, 0.5, 3.0)
    x, z = between(left)
    angle = math.atan2(z, x)
    return np.array([left, angle - left, right, angle + math.pi - right])


def main() -> None:
    """Hunt for counterexamples in the five-bar's whole workspace."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000_000
    boxes = certify(FIVE_BAR, [-0.8, -0.8], [1.2, 0.8], most_boxes=30_000)
    print("volumes", boxes.volumes, "undecided", boxes.share_undecided)
    for k, (part, right) in enumerate(((boxes.inside, True), (boxes.outside, False))):
        wrong = 0
        for i in range(0, count, 1_000_000):
            x = drawn(part, min(1_000_000, count - i), seed=i + k)
            wrong += int((five_bar_inside(x) != right).sum())
        print("inside" if right else "outside", count, "points,", wrong, "wrong")


if __name__ == "__main__":
    main()
