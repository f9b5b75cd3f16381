"""Cones of certified boxes, in closed form and in general, against closed forms and `ConeRooms`."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from rps_pin.errors import InputError, MechanismError
from rps_pin.numerics.boxes import CertifiedBoxes
from rps_pin.numerics.intervals import Interval
from rps_pin.task import Cone, Task, certify
from rps_pin.task.certification.cones import Cones
from rps_pin.task.certification.equations import Equations
from rps_pin.task.certification.general import certify_general
from rps_pin.task.certification.newton import sheets
from rps_pin.task.certification.six_legs import LegMargins
from rps_pin.task.paths.limits import ConeRooms
from rps_pin.task.point_legs import point_legs
from tests.reference import five_bar
from tests.task.robots import poses, task
from tests.task.test_certified import TASK as STEWART
from tests.task.test_certified_general import FIVE_BAR, drawn, five_bar_inside
from tests.worst import worst

GENERAL = {"start": None, "free": 0.0, "undecided": 0.0, "progress": iter}


def rooms(one: Task, cones: list[Cone], x: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the rooms of cones by Pinocchio, shape (n, cones)."""
    still = np.zeros((len(q), one.mechanism.model.nv))
    return ConeRooms(one.mechanism, cones).rooms(q, still, x, np.zeros_like(x))[0]


def random_cones(one: Task, count: int, random: np.random.Generator) -> list[Cone]:
    """Return cones between links chosen at random, and the world."""
    names = ["universe", *list(one.mechanism.model.names)[1:]]
    return [
        Cone(
            *random.choice(names, 2, replace=False),
            random.uniform(0.2, 3.0),
            tuple(random.normal(size=3)),
            tuple(random.normal(size=3)),
        )
        for _ in range(count)
    ]


def test_the_closed_form_gives_the_rooms_of_cones_of_all_links() -> None:
    random = np.random.default_rng(8)
    cones = random_cones(STEWART, 40, random)
    x = STEWART.home + random.uniform(-1.0, 1.0, (10, 6)) * [0.1, 0.1, 0.1, 0.4, 0.4, 0.4]
    margins = LegMargins(STEWART, point_legs(STEWART), STEWART.home, cones)
    found = np.stack([one.lower for one in margins.cone_rooms(tuple(map(Interval, x.T)))], axis=-1)
    q = STEWART.configuration(x, within_limits=False)
    assert worst(found - rooms(STEWART, cones, x, q)) < 1e-10


@pytest.mark.parametrize("name", ["delta", "rrs", "rotary_stewart", "ankle"])
def test_bounds_of_any_mechanism_hold_its_cones(name: str) -> None:
    one, (x, q) = task(name), poses(name)
    random = np.random.default_rng(5)
    cones = random_cones(one, 12, random)
    equations = Equations(one)
    z = equations.closed(np.array([equations.state(each) for each in q]), x)
    half = np.where(one.angular, 2e-3, 2e-3 * one.characteristic_length) * np.ones_like(x)
    proven = sheets(equations, z, x, half)
    assert proven.proven.all()
    bounds = Cones(equations, cones).rooms(proven)
    assert worst(bounds.middle - rooms(one, cones, x, q)) < 1e-8
    for k in range(len(x)):
        d = half[k] * random.choice([-1.0, 1.0], one.size)
        moved = one.configuration(x[k] + d, q[k], within_limits=False)
        away = rooms(one, cones, (x[k] + d)[None], moved[None])[0] - bounds.middle[k]
        assert (np.abs(away - bounds.slopes[k] @ d) <= bounds.error[k] + 1e-9).all()
    small = Cones(equations, cones).rooms(sheets(equations, z, x, half / 4))
    assert (small.error < 0.08 * bounds.error).all()  # of second order


def tilted(x: np.ndarray) -> np.ndarray:
    """Return the angle of the platform's axis from the vertical, (n,): rz is zero."""
    return np.asarray(np.linalg.norm(x[:, 3:5], axis=-1))


def test_both_ways_prove_a_cone_of_a_tilt() -> None:
    """The disc of the tilt, in both ways; the share undecided falls with the number of boxes."""
    cone = Cone("universe", "platform", 0.12)
    low, high = STEWART.home.copy(), STEWART.home.copy()
    low[3:5], high[3:5] = -0.14, 0.16
    assert certify(STEWART, low, high).verdict == "inside"
    shares = []
    for most in (8, 400):
        found = certify(STEWART, low, high, cones=[cone], undecided=0.0, most_boxes=most)
        shares.append(found.share_undecided)
        _check(found, lambda x: tilted(x) < 0.12)
        assert list(found.reason_shares()) == ["universe, platform cone above 0.12 rad"]
        size, _, undecided = found.volumes
        assert size <= np.pi * 0.12**2 <= size + undecided
    assert shares[1] < 0.02 < shares[0]
    one = certify_general(STEWART, low, high, cones=[cone], most_boxes=40, **GENERAL)
    _check(one, lambda x: tilted(x) < 0.12)
    assert one.reason_shares() == found.reason_shares()
    assert one.volumes[0] > 0.9 * np.pi * 0.12**2
    for boxes, other in ((one.inside, found.outside), (one.outside, found.inside)):
        middles = other.mean(axis=1)[:, None]
        within = (middles > boxes[:, 0]) & (middles < boxes[:, 1])
        assert not within[..., 3:5].all(axis=-1).any()


def _check(found: CertifiedBoxes, inside) -> None:
    assert found.verdict == "partly"
    assert inside(drawn(found.inside, 100_000)).all()
    assert not inside(drawn(found.outside, 100_000)).any()


def test_no_counterexample_with_a_cone_of_an_elbow() -> None:
    """A five-bar whose left elbow may bend by 1.5 rad: a circle about its base joint."""
    mechanism = FIVE_BAR.mechanism
    model = mechanism.model
    elbow = model.jointPlacements[model.getJointId("left_arm_joint")]
    tip = model.frames[model.getFrameId("left_tip")]
    bend = 1.5
    cone = Cone("left_joint", "left_arm_joint", bend, elbow.translation, tip.placement.translation)

    def inside(x: np.ndarray) -> np.ndarray:
        one, two = five_bar.LEFT.length, five_bar.LEFT_ARM.length
        least = one**2 + two**2 + 2 * one * two * np.cos(bend)
        return np.asarray(five_bar_inside(x) & ((x * x).sum(axis=-1) > least))

    low, high = [0.1, 0.25], [0.5, 0.65]
    found = certify(FIVE_BAR, low, high, cones=[cone], undecided=0.08)
    assert found.share_undecided < 0.08
    _check(found, inside)
    x = np.random.default_rng(2).uniform(low, high, (200_000, 2))
    assert (five_bar_inside(x) & ~inside(x)).mean() > 0.05
    share, (size, _, undecided) = inside(x).mean(), found.volumes
    error = 5 * np.sqrt(0.25 / len(x))
    assert size / 0.16 - error < share < (size + undecided) / 0.16 + error


def test_unknown_frames_are_refused_in_both_ways() -> None:
    for one in (STEWART, FIVE_BAR):
        with pytest.raises(InputError, match="no_such"):
            certify(one, one.home - 1e-3, one.home + 1e-3, cones=[Cone("universe", "no_such", 1)])


def test_a_cone_of_a_link_beside_the_legs_is_refused() -> None:
    mechanism = STEWART.mechanism
    model = mechanism.model.copy()
    added = model.addJoint(0, type(model.joints[2])(), model.jointPlacements[2], "beside")
    model.addJointFrame(added)
    moved = STEWART.with_mechanism(
        ClosedLoopModel(model, mechanism.closures, actuated=mechanism.actuated)
    )
    with pytest.raises(MechanismError, match="'beside' is on joint 'beside'"):
        certify(
            moved, STEWART.home - 1e-3, STEWART.home + 1e-3, cones=[Cone("beside", "platform", 1)]
        )
