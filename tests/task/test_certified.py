"""Certified boxes of 6-UPS platforms, against inverse kinematics in NumPy and the task itself."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rps_pin import ClosedLoopModel, RPSRobot, Task
from rps_pin.errors import InputError, MechanismError, SingularityError
from rps_pin.numerics.boxes import Ball
from rps_pin.numerics.intervals import Interval
from rps_pin.task import CertifiedBoxes, certify
from rps_pin.task.design import RoundPart
from rps_pin.task.point_legs import point_legs
from tests.worst import worst

URDF = Path(__file__).parents[2] / "urdf"
MECHANISM = ClosedLoopModel.load(URDF / "stewart.yaml")
TASK = MECHANISM.task
LEGS = point_legs(TASK)
HOME = TASK.home
#: A slice at home's orientation, larger than the workspace.
SLICE = np.array([0.4, 0.4, 0.35, 0.0, 0.0, 0.0])


def legs_of(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return lengths (n, 6), both angles (n, 6, 2) and the determinant (n,) of poses, by NumPy."""
    R = Rotation.from_rotvec(x[:, 3:]).as_matrix()
    arms = np.einsum("nij,kj->nki", R, LEGS.platform)
    along = x[:, None, :3] + arms - LEGS.base
    length = np.linalg.norm(along, axis=-1)
    u = along / length[..., None]
    local = np.einsum("kij,nkj->nki", LEGS.axes, u)
    angles = np.stack(
        [np.arctan2(-local[..., 1], local[..., 2]), np.arcsin(local[..., 0])], axis=-1
    )
    rows = np.concatenate([u, np.cross(arms, u) / TASK.characteristic_length], axis=-1)
    return length, angles, np.linalg.det(rows)


def inside(x: np.ndarray) -> np.ndarray:
    """Return which poses keep the limits, on home's side of the singularities."""
    length, angles, determinant = legs_of(x)
    at = TASK.of_actuators
    least = MECHANISM.model.lowerPositionLimit[at] + LEGS.offset
    most = MECHANISM.model.upperPositionLimit[at] + LEGS.offset
    kept = ((length >= least) & (length <= most)).all(axis=-1)
    low, high = LEGS.angles[..., 0], LEGS.angles[..., 1]
    kept &= ((angles >= low) & (angles <= high)).all(axis=(-1, -2))
    return np.asarray(kept & (determinant * legs_of(HOME[None])[2] > 0))


def drawn(boxes: np.ndarray, count: int) -> np.ndarray:
    """Return poses of boxes (n, 2, 6), many of them on faces, edges and corners."""
    random = np.random.default_rng(6)
    which = random.integers(0, len(boxes), count)
    share = np.clip(random.uniform(-0.4, 1.4, (count, 6)), 0.0, 1.0)
    low, high = boxes[which, 0], boxes[which, 1]
    return np.minimum(low + (high - low) * share, high)


@pytest.fixture(scope="module")
def found() -> CertifiedBoxes:
    return certify(TASK, HOME - SLICE, HOME + SLICE, undecided=0.05)


def test_the_points_of_the_legs_give_the_tasks_lengths_and_angles() -> None:
    random = np.random.default_rng(3)
    x = HOME + random.uniform(-1.0, 1.0, (40, 6)) * [0.1, 0.1, 0.1, 0.4, 0.4, 0.4]
    q = TASK.configuration(x, within_limits=False)
    length, angles, _ = legs_of(x)
    assert worst(length - LEGS.offset - q[:, TASK.of_actuators]) < 1e-10
    model = MECHANISM.model
    for k, name in enumerate(MECHANISM.actuated):
        second = model.parents[model.getJointId(name)]
        first = model.parents[second]
        turned = [q[:, model.joints[one].idx_q] for one in (first, second)]
        shift = LEGS.angles[k, 1, 0] - model.lowerPositionLimit[model.joints[second].idx_q]
        assert worst(angles[:, k, 0] - turned[0]) < 1e-10
        assert worst(angles[:, k, 1] - shift - turned[1]) < 1e-10


def test_no_counterexample_in_a_slice(found: CertifiedBoxes) -> None:
    assert found.verdict == "partly"
    assert found.share_undecided <= 0.05
    assert math.isclose(sum(found.volumes), np.prod(2 * SLICE[:3]), rel_tol=1e-9)
    assert inside(drawn(found.inside, 100_000)).all()
    assert not inside(drawn(found.outside, 100_000)).any()
    x = np.unique(drawn(found.inside, 40), axis=0)
    assert np.isfinite(TASK.to_actuators(x, errors="mask")).all()  # the task's own limits


def test_the_volume_of_a_slice_is_within_its_bounds(found: CertifiedBoxes) -> None:
    random = np.random.default_rng(9)
    x = HOME + random.uniform(-1.0, 1.0, (400_000, 6)) * SLICE
    share = inside(x).mean()
    size, _, undecided = found.volumes
    whole, error = np.prod(2 * SLICE[:3]), 5 * math.sqrt(0.25 / len(x))
    assert size / whole - error < share < (size + undecided) / whole + error


def test_boxes_of_all_six_coordinates() -> None:
    half = np.array([0.02, 0.02, 0.02, 0.04, 0.04, 0.04])
    good = certify(TASK, HOME - half, HOME + half)
    assert good.verdict == "inside"
    assert inside(drawn(good.inside, 100_000)).all()
    far = HOME + np.eye(6)[2]
    assert certify(TASK, far - half, far + half).verdict == "outside"
    wide = certify(TASK, HOME - 5 * half, HOME + 5 * half, most_boxes=3_000)
    assert wide.verdict in ("undecided", "partly")
    for boxes, right in ((wide.inside, True), (wide.outside, False)):
        if len(boxes):
            assert (inside(drawn(boxes, 50_000)) == right).all()


def test_a_ball_of_turns_is_inside_where_its_box_is_not() -> None:
    """Of the corners of the box that the ball does not reach, nothing is said."""
    half = np.array([0.01, 0.0, 0.0, 0.3, 0.3, 0.3])
    box, turns = (HOME - half, HOME + half), RoundPart(["rx", "ry", "rz"], [0, 0, 0], 0.3)
    part = certify(TASK, *box, most_boxes=2_000, undecided=0.0, round=[turns])
    assert len(part.inside) > 20
    random = np.random.default_rng(4)
    x = HOME + random.uniform(-1, 1, (4_000, 6)) * half
    within = np.linalg.norm(x[:, 3:], axis=-1) <= 0.3
    held = sum(
        ((x >= one[0]) & (x <= one[1])).all(axis=-1).astype(int) for one in part.inside
    ).astype(bool)
    assert inside(x[within & held]).all()
    left = np.concatenate([part.outside, part.undecided])
    kept = [((x >= one[0]) & (x <= one[1])).all(axis=-1) for one in left]
    assert (held | np.any([*kept, ~within], axis=0)).all()  # no point of the ball is lost
    assert part.verdict == "inside"
    with pytest.raises(InputError, match="'phi'"):
        certify(TASK, *box, round=[RoundPart(["rx", "phi"], [0, 0], 0.3)])
    for bad in (math.nan, "a"):
        with pytest.raises(InputError, match="the centre's ry"):
            RoundPart(["rx", "ry"], [0, bad], 0.3)  # type: ignore[list-item]
    with pytest.raises(InputError, match="is not in the box"):
        certify(TASK, *box, round=[RoundPart(["rx", "ry"], [0, 1], 0.3)])


def test_boxes_that_do_not_meet_a_ball_are_told_and_others_keep_its_points() -> None:
    random = np.random.default_rng(7)
    ball = Ball([0, 2], np.array([0.3, -0.2]), 0.5)
    middle, half = random.uniform(-1.5, 1.5, (3, 400)), random.uniform(0, 0.6, (3, 400))
    meets, hull = ball.met(Interval(middle - half, middle + half))
    x = middle[:, None] + half[:, None] * random.uniform(-1, 1, (3, 300, 400))
    within = np.hypot(x[0] - 0.3, x[2] + 0.2) <= 0.5
    assert not within[:, ~meets].any()
    kept = ((x >= hull.lower[:, None]) & (x <= hull.upper[:, None])).all(axis=0)
    assert kept[within].all()
    assert 50 < meets.sum() < 350
    assert ((hull.upper - hull.lower) < 1.9 * half)[:, meets].any(axis=0).sum() > 50


def test_a_singular_pose_is_in_no_certified_box() -> None:
    """Turned by a right angle about z, a platform of equal hexagons is singular (Fichter, 1986)."""
    quarter = HOME.copy()
    quarter[5] = math.pi / 2
    assert abs(legs_of(quarter[None])[2][0]) < 1e-12 * abs(legs_of(HOME[None])[2][0])
    free = _without_limits()
    low, high = HOME.copy(), HOME.copy()
    low[5], high[5] = 0.0, 1.9
    boxes = certify(free, low, high, most_boxes=8)
    holding = (boxes.inside[:, 0, 5] <= math.pi / 2) & (boxes.inside[:, 1, 5] >= math.pi / 2)
    assert not holding.any()
    before, beyond, undecided = boxes.volumes
    assert before < math.pi / 2 < before + undecided
    assert beyond < 1.9 - math.pi / 2 < beyond + undecided
    assert undecided < 0.01


def _without_limits() -> Task:
    model = MECHANISM.model.copy()
    model.lowerPositionLimit[:], model.upperPositionLimit[:] = -np.inf, np.inf
    return TASK.with_mechanism(MECHANISM.with_model(model))


@pytest.mark.parametrize(
    ("task", "words"),
    [
        (ClosedLoopModel.load(URDF / "delta.yaml").task, "its coordinates are x, y, z"),
        (
            ClosedLoopModel.load(URDF / "rotary_stewart.yaml").task,
            "joint 'rod_1_joint' turns",
        ),
        (RPSRobot.from_preset("micro").task, "its coordinates are z, rx, ry"),
    ],
)
def test_other_mechanisms_are_no_such_platform(task: Task, words: str) -> None:
    with pytest.raises(MechanismError, match=words):
        point_legs(task)


def test_bad_boxes_and_starts_are_refused() -> None:
    with pytest.raises(InputError, match="is empty"):
        certify(TASK, HOME, HOME)
    with pytest.raises(InputError, match="rotation vectors up to"):
        certify(TASK, HOME - 2.0, HOME + 2.0)
    with pytest.raises(InputError, match=r"round = 3: it must be Sequence\[RoundPart\]"):
        certify(TASK, HOME - 0.01, HOME + 0.01, round=3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="lower"):
        certify(TASK, HOME[:3], HOME[:3] + 1)
    flat = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # all legs in one plane
    with pytest.raises(SingularityError, match="start pose is singular"):
        certify(TASK, HOME - 0.01, HOME + 0.01, start=flat)
