"""Generated code keeps the assembly mode also where two modes come near each other."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin.errors import RPSPinError
from tests.task.robots import compiled, task

#: A Delta whose third arm is nearly stretched, beside a singularity of type I and of the closures.
BESIDE = [
    *(0.2151112801067157, 1.7045486349726828, -2.7150728779020525),
    *(0.03533333333333333, -0.48482758620689653, -0.11, 0.0, 0.0, 0.0, 1.0),
]


def test_a_delta_does_not_change_its_elbow() -> None:
    """The way passes a bifurcation: Newton's steps contract, and lead to the other elbow."""
    slow, fast = task("delta"), compiled("delta")
    goal = np.array([0.0756667, -0.4848276, -0.11])
    for one in (slow, fast):
        with pytest.raises(RPSPinError, match="assembly mode"):
            one.to_actuators(goal, BESIDE, within_limits=False)


def test_both_engines_agree_on_ways_beside_it() -> None:
    """Some of the ways that generated code refuses, and some of those that it goes."""
    random = np.random.default_rng(21)
    slow, fast = task("delta"), compiled("delta")
    start = np.array(slow.mechanism.close(BESIDE, within_limits=False))
    goals = slow.at(start) + random.uniform(-0.06, 0.06, (60, 3))
    other = fast.configuration(goals, start, within_limits=False, errors="mask")
    refused = np.isnan(other[:, 0])
    assert 5 < refused.sum() < 58
    some = np.concatenate([np.flatnonzero(refused)[:12], np.flatnonzero(~refused)[:8]])
    one = slow.configuration(goals[some], start, within_limits=False, errors="mask")
    assert (np.isnan(one[:, 0]) == refused[some]).all()
    assert np.abs(one - other[some])[~refused[some]].max() < 1e-8
