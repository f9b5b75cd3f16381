"""Certified boxes: no counterexample among random poses, and bounds of the volume."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rps_pin import RPSParameters, RPSRobot
from rps_pin.errors import InputError, SingularityError
from rps_pin.rps.workspace import (
    CertifiedBoxes,
    Reason,
    certify,
    free_tilt,
    leg_grid,
    volume,
    workspace,
)
from rps_pin.rps.workspace.evaluate import evaluate, side_of_singularity
from rps_pin.task.design import RoundPart

MICRO = RPSRobot.from_preset("micro").parameters
#: Its workspace fits into this box.
BOX = (0.19, -0.3, -0.3), (0.26, 0.3, 0.3)
START = (0.22, 0.0, 0.0)


def inside(parameters: RPSParameters, pose: np.ndarray) -> np.ndarray:
    """Return which poses (n, 3) are inside by floats."""
    side = side_of_singularity(parameters, np.array(START))
    parts = np.array_split(pose, max(1, len(pose) // 50_000))
    reasons = [evaluate(parameters, part, side, min_conditioning=0.0).reason for part in parts]
    return np.concatenate(reasons) == 0


def drawn(boxes: np.ndarray, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return poses of boxes (n, 2, 3): corners, points of faces and inner ones; and which box."""
    random = np.random.default_rng(seed)
    which = random.integers(0, len(boxes), count)
    share = np.clip(random.uniform(-0.4, 1.4, (count, 3)), 0.0, 1.0)  # many at the ends
    low, high = boxes[which, 0], boxes[which, 1]
    return np.minimum(low + (high - low) * share, high), which


@pytest.fixture(scope="module")
def found() -> CertifiedBoxes:
    return certify(MICRO, *BOX, undecided=0.003)


def test_less_than_one_per_cent_of_the_volume_is_undecided(found: CertifiedBoxes) -> None:
    assert found.share_undecided < 0.003
    assert found.verdict == "partly"
    total = float(np.prod(np.subtract(*BOX[::-1])))
    assert math.isclose(sum(found.volumes), total, rel_tol=1e-9)
    sizes = [np.prod(one[:, 1] - one[:, 0], axis=1).sum() for one in (found.inside, found.outside)]
    rest = np.prod(found.undecided[:, 1] - found.undecided[:, 0], axis=1).sum()
    assert math.isclose(sum(sizes) + rest, total, rel_tol=1e-9)


def test_no_counterexample_is_found(found: CertifiedBoxes) -> None:
    """In CI 10^6 poses; `python -m tests.rps.workspace.test_certified` draws 10^7 and more."""
    hunt(found, 500_000, 1)


def hunt(boxes: CertifiedBoxes, count: int, seed: int) -> None:
    """Draw poses of the proven boxes, and look at each by floats."""
    pose, _ = drawn(boxes.inside, count, seed)
    assert inside(MICRO, pose).all()
    pose, _ = drawn(boxes.outside, count, seed + 1)
    assert not inside(MICRO, pose).any()


def test_the_parts_of_cut_boxes_are_no_larger_than_counted(found: CertifiedBoxes) -> None:
    random = np.random.default_rng(4)
    boxes, parts = found.undecided, found.parts
    assert len(boxes) == len(parts) > 1000
    which = random.integers(0, len(boxes), 400_000)
    low, high = boxes[which, 0], boxes[which, 1]
    within = inside(MICRO, low + (high - low) * random.random((len(which), 3)))
    slack = 5 * math.sqrt(0.25 / len(which))
    assert parts[which, 0].mean() <= within.mean() + slack
    assert parts[which, 1].mean() <= 1.0 - within.mean() + slack
    assert parts.sum(axis=1).mean() > 0.9  # and they are most of them
    sure = parts[which, 0] > 1.0 - 1e-6
    assert within[sure].all()


def test_the_volume_of_the_workspace_is_within_the_bounds(found: CertifiedBoxes) -> None:
    size, _, undecided = found.volumes
    by_grid = volume(workspace(MICRO, leg_grid(MICRO, 61), min_conditioning=0.0)).pose
    error = abs(by_grid - volume(workspace(MICRO, leg_grid(MICRO, 31))).pose)
    assert size - error < by_grid < size + undecided + error
    assert error < 1e-3 * size


def test_boxes_that_are_wholly_inside_or_outside() -> None:
    good = certify(MICRO, (0.22, -0.02, -0.02), (0.23, 0.02, 0.02))
    assert good.verdict == "inside"
    assert good.volumes[1:] == (0.0, 0.0)
    assert good.share_undecided == 0.0
    bad = certify(MICRO, (0.22, 0.4, -0.02), (0.23, 0.5, 0.02))
    assert bad.verdict == "outside"
    assert bad.share_undecided == math.inf
    touching = certify(MICRO, (0.22, -0.02, -0.02), (0.2499, 0.02, 0.02), most_boxes=1)
    assert touching.verdict in ("undecided", "partly")


def test_random_robots_have_no_counterexample() -> None:
    """And what is said to put a box out is broken at all of its points."""
    random, seen = np.random.default_rng(8), Reason.INSIDE
    bits = {one.text: one for one in Reason}
    for _ in range(6):
        g, h = random.uniform(0.5, 2.0, 2)
        shortest = random.uniform(0.5, 1.5) * max(g, h)
        robot = MICRO.replace(
            base_radius=g,
            platform_radius=h,
            leg_length_limits=(shortest, shortest * random.uniform(1.1, 1.6)),
            leg_angle_limits=(random.uniform(0.3, 1.4), random.uniform(1.6, 2.8)),
            spherical_cone_limit=random.uniform(0.4, 1.2),
            spherical_rest_angle=random.uniform(-0.3, 0.3),
        )
        low = np.array([0.5 * shortest, -1.0, -1.0])
        start = (shortest, 0.0, 0.0)
        boxes = certify(robot, low, (1.6 * shortest, 1.0, 1.0), start=start, most_boxes=600)
        side = side_of_singularity(robot, np.array(start))
        for proven, right in ((boxes.inside, True), (boxes.outside, False)):
            if len(proven):
                pose, _ = drawn(proven, 20_000, 3)
                reason = evaluate(robot, pose, side, min_conditioning=0.0).reason
                assert ((reason == 0) == right).all()
        for name in boxes.reason_shares():
            pose, _ = drawn(boxes.outside[boxes.mask(name)], 2_000, 4)
            reason = evaluate(robot, pose, side, min_conditioning=0.0).reason
            assert ((reason & bits[name]) != 0).all(), name
            seen |= bits[name]
    assert len(seen) == 12  # all limits


def test_a_singularity_inside_is_not_certified() -> None:
    """Without limits only the singularities are left; the determinant changes sign in the box."""
    free = MICRO.without_limits()
    boxes = certify(free, (-0.05, -0.2, -0.2), (0.2, 0.2, 0.2), start=START, most_boxes=8_000)
    assert boxes.verdict == "partly"
    assert boxes.reason_shares() == {"singular": 1.0}
    pose, _ = drawn(boxes.inside, 50_000, 5)
    assert inside(free, pose).all()
    assert not inside(free, np.array([[0.0, 0.0, 0.0]])).any()
    holding = (boxes.inside[:, 0] <= 0.0).all(axis=1) & (boxes.inside[:, 1] >= 0.0).all(axis=1)
    assert not holding.any()


def test_a_disc_of_tilts_is_inside_up_to_the_free_tilt() -> None:
    """`free_tilt` follows rays; the corners of the disc's box are outside."""
    free = float(free_tilt(MICRO, [0.218])[0])
    for share, verdicts in ((0.99, {"inside"}), (1.01, {"partly", "undecided"})):
        radius = share * free
        box = (0.217999, -radius, -radius), (0.218001, radius, radius)
        disc = RoundPart(["rx", "ry"], [0.0, 0.0], radius)
        found = certify(MICRO, *box, round=[disc], undecided=0.0, most_boxes=2_000)
        assert found.verdict in verdicts
        assert certify(MICRO, *box, most_boxes=500).verdict == "partly"
        pose, _ = drawn(found.inside, 20_000, 2)
        assert inside(MICRO, pose[np.linalg.norm(pose[:, 1:], axis=1) <= radius]).all()


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["z", "rx"], "lengths and angles have no common radius"),
        (["tilt_x", "ry"], "no coordinate 'tilt_x' of the task"),
        (["rx", "rx"], "names a coordinate twice"),
        (["rx", "ry"], r"the centre \(0.5, 0.5\) rad of a round part is not in the box, from"),
    ],
)
def test_round_parts_that_are_none_of_the_tilts_are_refused(names: list[str], words: str) -> None:
    with pytest.raises(InputError, match=words):
        certify(MICRO, *BOX, round=[RoundPart(names, [0.5, 0.5], 0.1)])


@pytest.mark.parametrize(
    ("lower", "upper", "words"),
    [
        ((0.2, 0.0, 0.0), (0.2, 0.1, 0.1), "is empty"),
        ((0.2, 0.0, 0.0), (0.3, 1.5, 0.1), "at most 1.4 rad"),
        ((0.2, 0.0), (0.3, 0.1), "lower"),
        ((0.2, 0.0, 0.0), (math.inf, 0.1, 0.1), "upper"),
    ],
)
def test_bad_boxes_are_refused(
    lower: tuple[float, ...], upper: tuple[float, ...], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        certify(MICRO, lower, upper)


def test_a_singular_start_is_refused() -> None:
    with pytest.raises(SingularityError, match="start pose is singular"):
        certify(MICRO, *BOX, start=(0.0, 0.0, 0.0))


if __name__ == "__main__":
    certified = certify(MICRO, *BOX, undecided=0.001)
    for round_ in range(10):
        hunt(certified, 1_000_000, 100 + 2 * round_)
        print(f"{2 * (round_ + 1)}e6 poses, no counterexample", flush=True)
