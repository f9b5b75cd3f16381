"""The box of joint limits, by hand."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin.closed_loop.assembly.joint_limits import JointLimits

Array = NDArray[np.float64]


def tree() -> pin.Model:
    """A ball, a hinge of [-1, 2], a slider of [0, 0.5], an unbounded turn, a free slider."""
    model = pin.Model()
    joints = {
        "ball": pin.JointModelSpherical(),
        "hinge": pin.JointModelRX(),
        "slider": pin.JointModelPX(),
        "turn": pin.JointModelRUBZ(),
        "loose": pin.JointModelPY(),
    }
    parent = 0
    for name, joint in joints.items():
        parent = model.addJoint(parent, joint, pin.SE3.Identity(), name)
    model.lowerPositionLimit[:] = -np.inf
    model.upperPositionLimit[:] = np.inf
    for name, lower, upper in (("hinge", -1.0, 2.0), ("slider", 0.0, 0.5)):
        at = model.joints[model.getJointId(name)].idx_q
        model.lowerPositionLimit[at], model.upperPositionLimit[at] = lower, upper
    return model


def configuration(hinge: float, slider: float, loose: float = 0.0) -> Array:
    """Of the tree, the ball and the turn somewhere."""
    return np.array([0.6, 0, 0, 0.8, hinge, slider, 0.28, 0.96, loose])


def test_only_plain_coordinates_have_limits() -> None:
    limits = JointLimits(tree())
    assert limits.names == ["hinge", "slider", "loose"]
    np.testing.assert_array_equal(limits.q, [4, 5, 8])
    np.testing.assert_array_equal(limits.v, [3, 4, 6])


@pytest.mark.parametrize(
    ("given", "expected"),
    [((0.5, 0.2), (0.5, 0.2)), ((3.0, 0.2), (2.0, 0.2)), ((-9.0, -1.0), (-1.0, 0.0))],
)
def test_clipping_brings_coordinates_to_the_nearest_limit(
    given: tuple[float, float], expected: tuple[float, float]
) -> None:
    q = configuration(*given, loose=1e6)
    kept = q.copy()
    np.testing.assert_array_equal(JointLimits(tree()).clip(q), configuration(*expected, loose=1e6))
    np.testing.assert_array_equal(q, kept)


@pytest.mark.parametrize(
    ("hinge", "slider", "expected"),
    [
        (2.0, 0.2, {"up": [3], "down": []}),
        (-1.0, 0.0, {"up": [], "down": [3, 4]}),
        (2.0, 0.0, {"up": [3], "down": [4]}),
        (2.0 - 1e-6, 1e-6, {"up": [], "down": []}),
    ],
)
def test_blocked_is_what_would_leave_through_a_limit(
    hinge: float, slider: float, expected: dict[str, list[int]]
) -> None:
    limits, q = JointLimits(tree()), configuration(hinge, slider)
    for way, step in (("up", np.ones(7)), ("down", -np.ones(7))):
        np.testing.assert_array_equal(np.flatnonzero(limits.blocked(q, step)), expected[way])
    assert not limits.blocked(q, np.zeros(7)).any()


def test_joints_at_a_limit_are_named_with_it() -> None:
    limits = JointLimits(tree())
    assert limits.reached(configuration(0.0, 0.25)) == []
    assert limits.reached(configuration(2.0, 0.0)) == [
        "joint 'slider' at its limit 0",
        "joint 'hinge' at its limit 2",
    ]


def test_trees_without_limits_block_nothing() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    limits, q = JointLimits(model), pin.neutral(model)
    np.testing.assert_array_equal(limits.clip(q), q)
    assert not limits.blocked(q, np.ones(6)).any()
    assert limits.reached(q) == []


def test_limits_stay_those_of_the_beginning() -> None:
    """They are copies: a model changed later does not move them halfway through."""
    model = tree()
    limits = JointLimits(model)
    model.upperPositionLimit[:] = 100.0
    assert limits.clip(configuration(50.0, 0.2))[4] == 2.0
