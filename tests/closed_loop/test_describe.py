"""What a mechanism says of itself, on mechanisms whose mobility is known."""

from __future__ import annotations

import json

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, ClosureError, JointCoupling, LoopClosure
from tests.closed_loop import mechanisms
from tests.closed_loop.mechanisms import FOUR_BAR, closed_guess


def homed(mechanism: ClosedLoopModel) -> ClosedLoopModel:
    return ClosedLoopModel(
        mechanism.model, mechanism.closures, mechanism.actuated, home=closed_guess(mechanism)
    )


@pytest.mark.parametrize(
    ("make", "rows", "rank", "mobility"),
    [
        (mechanisms.rigid, 6, 3, 1),
        (mechanisms.spherical, 3, 2, 1),
        (mechanisms.spatial_four_bar, 3, 3, 1),
        (mechanisms.five_bar, 3, 2, 2),
        (mechanisms.three_rps, 9, 9, 3),
    ],
)
def test_counts_are_those_of_the_textbook(make, rows: int, rank: int, mobility: int) -> None:
    found = homed(make()).describe()
    assert (found.rows, found.rank, found.mobility) == (rows, rank, mobility)
    assert found.redundant_rows == rows - rank
    assert found.actuation == "sufficient"
    assert found.actuated_rank == mobility
    assert len(found.singular_values) == min(rows, found.nv)
    assert (found.singular_values[:rank] > 1e-3).all()
    assert (found.singular_values[rank:] < 1e-12).all()
    assert sum(joint.nv for joint in found.joints) == found.nv
    assert set(found.actuated) | set(found.passive) == {joint.name for joint in found.joints}


def test_too_many_and_too_few_actuators_are_told() -> None:
    many = homed(mechanisms.five_bar(actuated=["left_joint", "right_joint", "left_arm_joint"]))
    assert many.describe().actuation == "redundant"
    assert "3 actuators, 1 more than needed" in str(many.describe())
    few = homed(mechanisms.five_bar(actuated=["left_joint"]))
    assert few.describe().actuation == "underactuated"
    assert "actuation underactuated: 1 of 2 motions have no actuator" in str(few.describe())


def test_the_former_name_of_underactuated_still_compares_equal() -> None:
    few = homed(mechanisms.five_bar(actuated=["left_joint"])).describe()
    enough = homed(mechanisms.five_bar()).describe()
    assert few.actuation == "lacking"
    assert enough.actuation not in {"lacking", "underactuated"}
    assert {few.actuation: 1}["underactuated"] == 1
    assert few.as_dict()["actuation"] == "underactuated"


def test_actuators_enough_in_number_may_not_determine_the_motion() -> None:
    """Two joints of one open chain, one of them driven twice over by a coupling."""
    model = pin.Model()
    for index, axis in enumerate("xyz"):
        joint = model.addJoint(
            index, getattr(pin, f"JointModelR{axis.upper()}")(), pin.SE3.Random(), axis
        )
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    found = ClosedLoopModel(model, [JointCoupling("y", "x", ratio=2.0)], ["x", "y"]).describe()
    assert (found.mobility, found.actuated_velocities, found.actuated_rank) == (2, 2, 1)
    assert found.actuation == "underactuated"
    assert found.closures[0].kind == "coupling"
    assert found.closures[0].between == ("y", "x")


def test_each_closure_tells_what_the_rank_needs_it_for() -> None:
    """The same pin twice: neither is needed."""
    mechanism = mechanisms.spherical()
    twice = ClosedLoopModel(
        mechanism.model,
        [*mechanism.closures, LoopClosure("rocker_tip", "coupler_tip", name="again")],
        mechanism.actuated,
        home=closed_guess(mechanism),
    )
    once = homed(mechanism).describe()
    assert [closure.needed for closure in once.closures] == [2]
    assert [closure.needed for closure in twice.describe().closures] == [0, 0]


def test_singular_home_is_left_for_a_regular_place() -> None:
    """A parallelogram folded flat: a change point, where the loop's two rows are one."""
    flat = mechanisms.FourBar(
        ground=0.4,
        crank=mechanisms.Bar(0.2, 1.0, 0.1, 0.0, 0.01),
        coupler=mechanisms.Bar(0.4, 1.0, 0.2, 0.0, 0.01),
        rocker=mechanisms.Bar(0.2, 1.0, 0.1, 0.0, 0.01),
    )
    mechanism = flat.spherical_mechanism()
    found = mechanism.describe()  # home is zero: all bars along x
    assert mechanism.loop_gap(mechanism.home) < 1e-15
    assert found.home_is_singular
    assert (found.rank, found.mobility) == (2, 1)
    assert mechanism.describe(mechanism.home).rank == 1
    assert "the home configuration is singular" in str(found)


def double_pendulum(closures: list[LoopClosure]) -> ClosedLoopModel:
    """Two links that swing in one plane, which stands askew."""
    model, turn, last = pin.Model(), pin.exp3(np.array([0.3, 0.4, 0.5])), 0
    model.gravity.linear = turn @ np.array([0.0, 0.0, -9.81])
    down = np.array([0.0, 0.0, -0.5])
    for index in range(2):
        placement = pin.SE3(np.eye(3), down) if index else pin.SE3(turn, np.zeros(3))
        last = model.addJoint(last, pin.JointModelRY(), placement, f"joint_{index}")
        model.appendBodyToJoint(last, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3(np.eye(3), down))
    base, tip = pin.SE3(turn, np.zeros(3)), pin.SE3(np.eye(3), np.array([0.1, 0.0, -0.5]))
    model.addFrame(pin.Frame("base", 0, 0, base, pin.FrameType.OP_FRAME))
    model.addFrame(pin.Frame("tip", last, 0, tip, pin.FrameType.OP_FRAME))
    return ClosedLoopModel(model, closures, ["joint_0", "joint_1"])


def test_describe_and_simulate_have_one_rank() -> None:
    """A closure that keeps a planar mechanism in its plane: its row is rounding error, rank 0."""
    plane = LoopClosure("base", "tip", "point_on_plane", axis=[0.0, 1.0, 0.0])
    held, free = double_pendulum([plane]), double_pendulum([])
    q = np.array([0.3, 0.4])
    assert 0 < np.abs(held.jacobian(q)).max() < 1e-15
    found = held.describe(q)
    assert (found.rank, found.mobility, found.actuation) == (0, 2, "sufficient")
    moved, expected = (each.simulate(q, duration=0.5) for each in (held, free))
    np.testing.assert_allclose(moved.q, expected.q, rtol=0, atol=1e-12)
    assert np.ptp(expected.q) > 0.5  # it swings


def test_as_data_it_is_plain_json() -> None:
    found = homed(mechanisms.three_rps()).describe()
    again = json.loads(json.dumps(found.as_dict(), allow_nan=False))
    assert again["mobility"] == 3
    assert again["joints"][-1]["kind"] == "free"
    assert again["joints"][-1]["lower"] == [None] * 7
    np.testing.assert_array_equal(again["singular_values"], found.singular_values)


def test_limits_and_kinds_of_joints_are_told() -> None:
    joints = {
        joint.name: joint for joint in homed(FOUR_BAR.spherical_mechanism()).describe().joints
    }
    crank = joints["crank_joint"]
    assert (crank.kind, crank.nq, crank.nv, crank.actuated) == ("revolute", 1, 1, True)
    assert (crank.lower, crank.upper) == ((-9.0,), (9.0,))


def test_what_cannot_close_has_no_description() -> None:
    with pytest.raises(ClosureError, match=r"stays open by 0\.4 m"):
        mechanisms.wide_apart().describe()
