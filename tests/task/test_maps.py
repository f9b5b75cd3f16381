"""Positions, velocities and accelerations of tasks, on every mechanism that has one."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.task.robots import EACH, NAMES, compiled, poses, slope, task
from tests.worst import worst

BOTH = pytest.mark.parametrize(("make", "name"), EACH)
ALL = pytest.mark.parametrize("name", NAMES)


@BOTH
def test_positions_go_there_and_back(make, name) -> None:
    one, (x, q) = make(name), poses(name)
    a = one.to_actuators(x)
    assert a.shape == (len(x), len(one.mechanism.actuated))
    assert worst(one.to_task(a, near=q) - x) < 1e-12
    assert worst(one.to_task(a) - x) < 1e-12  # from home
    assert worst(one.at(q) - x) < 1e-12
    singles = [one.to_actuators(each) for each in x]
    assert worst(np.array(singles) - a) < 1e-12


@ALL
def test_coordinates_are_those_of_the_frame_in_the_tree(name) -> None:
    one, (x, q) = task(name), poses(name)
    model = one.mechanism.model
    options = one._options
    for wanted, each in zip(x, q, strict=True):
        if options["frame"] is None:
            found = [each[model.joints[model.getJointId(joint)].idx_q] for joint in one.coordinates]
        else:
            placed = pin.SE3(one.mechanism.frame_placement(each, options["frame"]))
            whole = dict(zip(["x", "y", "z"], placed.translation, strict=True))
            whole |= dict(zip(["rx", "ry", "rz"], pin.log3(placed.rotation), strict=True))
            found = [whole[key] for key in one.coordinates]
        assert worst(np.array(found) - wanted) < 1e-11
        assert one.mechanism.loop_gap(each) < 1e-11


@BOTH
def test_jacobian_and_hessian_are_the_derivatives(make, name) -> None:
    one, (x, q) = make(name), poses(name)
    K, H = one.jacobian(q), one.hessian(q)
    assert worst(H - np.swapaxes(H, -1, -2)) == 0
    for i in range(2):
        of_position = slope(lambda y, i=i: one.to_actuators(y, near=q[i]), x[i])
        assert worst(K[i] - of_position) < 1e-7 * (1 + worst(H[i]))
        of_jacobian = slope(lambda y, i=i: one.jacobian(one.configuration(y, near=q[i])), x[i])
        assert worst(H[i] - of_jacobian) < 1e-7 * (1 + worst(H[i]))


@BOTH
def test_a_state_keeps_the_loops_closed_and_moves_the_task_as_asked(make, name) -> None:
    one, (x, q), rng = make(name), poses(name), np.random.default_rng(2)
    rate, acceleration = rng.normal(size=(2, *x.shape))
    state = one.state(x, rate, acceleration, near=q)
    K, H = one.jacobian(state.q), one.hessian(state.q)
    actuated = one.mechanism.actuated_indices
    assert worst(one.rate(state.q, state.v) - rate) < 1e-11
    assert worst(state.v[..., actuated] - np.einsum("kij,kj->ki", K, rate)) < 1e-10
    bias = np.einsum("kijl,kj,kl->ki", H, rate, rate)
    assert worst(one.bias(state.q, rate) - bias) < 1e-9 * (1 + worst(H))
    wanted = np.einsum("kij,kj->ki", K, acceleration) + bias
    assert worst(state.a[..., actuated] - wanted) < 1e-9 * (1 + worst(H))
    for each in zip(*state, strict=True):
        opening = one.mechanism.loop_errors(*each)
        assert worst(*opening) < 1e-9


@ALL
def test_a_path_is_followed_from_pose_to_pose(name) -> None:
    one, (x, _) = task(name), poses(name)
    path = np.linspace(one.home, x[0], 5)
    q = one.follow(path)
    assert worst(one.at(q) - path) < 1e-12
    assert worst(one.to_actuators(x[0], near=q[-1]) - one.to_actuators(x[0])) < 1e-11


@pytest.mark.parametrize("name", ["delta", "stewart"])
def test_what_cannot_be_reached_is_refused_or_masked(name) -> None:
    for one in (task(name), compiled(name)):
        x = np.array([one.home, one.home + 5.0 * (1 - np.array(one.angular))])
        with pytest.raises(Exception, match=r"sample \(1,\)"):
            one.to_actuators(x)
        a = one.to_actuators(x, errors="mask")
        assert np.isfinite(a[0]).all()
        assert np.isnan(a[1]).all()
        back = one.to_task(np.array([a[0], a[0] + 3.0]), errors="mask")
        assert worst(back[0] - x[0]) < 1e-12
        assert np.isnan(back[1]).all()


@ALL
def test_copies_and_other_processes_have_the_same_task(name) -> None:
    import pickle

    one, (x, q) = task(name), poses(name)
    other = pickle.loads(pickle.dumps(one))
    assert np.array_equal(other.to_actuators(x[0], q[0]), one.to_actuators(x[0], q[0]))
    assert repr(other) == repr(one)
