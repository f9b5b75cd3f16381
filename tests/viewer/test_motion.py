"""Motions: interpolation on the manifold, sampling, and what is refused."""

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel
from rps_pin.errors import InputError
from rps_pin.trajectories import point_to_point
from rps_pin.viewer import Motion
from rps_pin.viewer.displayed_mechanism import displayed, motion_of
from rps_pin.viewer.layers.trail import _default_frame
from rps_pin.viewer.scene.keyframes import continuous_quaternions
from tests.viewer.robots import joint


def test_half_way_a_turn_is_half_made(sample):
    model = sample.model
    start, end = pin.neutral(model), pin.neutral(model)
    first = joint(model, "float")
    end[first : first + 7] = [1.0, 0.0, 0.0, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    end[joint(model, "slide")] = 0.1
    q = Motion(model, [2.0, 4.0], [start, end]).at(1.0)
    assert q[joint(model, "slide")] == pytest.approx(0.05, rel=1e-12)
    expected = [0.0, 0.0, np.sin(np.pi / 8), np.cos(np.pi / 8)]
    np.testing.assert_allclose(q[first + 3 : first + 7], expected, atol=1e-12)


def test_outside_its_times_it_stands_still(sample):
    motion = Motion(sample.model, sample.times, sample.configurations)
    np.testing.assert_array_equal(motion.at(-1.0), sample.configurations[0])
    np.testing.assert_array_equal(motion.at(5.0), sample.configurations[-1])
    np.testing.assert_array_equal(motion.at(motion.duration), sample.configurations[-1])


def test_sampling_keeps_the_ends_and_the_rate(sample):
    motion = Motion(sample.model, sample.times + 7.0, sample.configurations)
    elapsed, configurations = motion.sampled(30.0)
    assert elapsed.shape == (61,)
    np.testing.assert_allclose(np.diff(elapsed), 1.0 / 30.0, rtol=1e-9)
    np.testing.assert_array_equal(configurations[0], sample.configurations[0])
    np.testing.assert_array_equal(configurations[-1], sample.configurations[-1])
    np.testing.assert_allclose(configurations[30], sample.configurations[1000], atol=1e-9)


def test_one_configuration_is_one_sample(sample):
    motion = Motion(sample.model, [3.0], sample.configurations[:1])
    elapsed, configurations = motion.sampled()
    assert (motion.duration, elapsed.tolist(), configurations.shape) == (0.0, [0.0], (1, 9))


@pytest.mark.parametrize(
    ("times", "complaint"),
    [
        ([0.0, 1.0], r"must be \(3,\)"),
        ([0.0, 1.0, 1.0], "increasing"),
        ([0.0, 1.0, np.inf], "finite"),
        (0.0, "must be"),
    ],
)
def test_times_that_do_not_fit_are_refused(sample, times, complaint):
    with pytest.raises(InputError, match=complaint):
        Motion(sample.model, times, sample.configurations[:3])


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_a_frame_rate_that_is_none_is_refused(sample, rate):
    with pytest.raises(InputError, match="frame_rate"):
        Motion(sample.model, sample.times, sample.configurations).sampled(rate)


def test_quaternions_do_not_jump_through_a_whole_turn():
    angles = np.linspace(0.0, 4.0 * np.pi, 97)
    rotations = np.array([pin.utils.rotate("x", angle) for angle in angles])
    quaternions = continuous_quaternions(rotations)
    expected = np.stack([np.sin(angles / 2), 0 * angles, 0 * angles, np.cos(angles / 2)], axis=1)
    np.testing.assert_allclose(quaternions, expected, atol=1e-12)


def test_a_trajectory_of_a_task_is_followed_from_home() -> None:
    mechanism = ClosedLoopModel.load("urdf/stewart.yaml")
    task = mechanism.task
    end = task.home + np.array([0.02, 0.01, 0.02, 0.1, 0.0, 0.05])
    path = point_to_point(task.home, end, duration=0.5)
    subject = displayed(mechanism)
    motion = motion_of(subject, path)
    assert np.abs(task.at(motion.configurations[-1]) - end).max() < 1e-12
    assert motion.times[-1] == path.duration


def test_the_trail_is_that_of_the_tasks_frame() -> None:
    mechanism = ClosedLoopModel.load("urdf/delta.yaml")
    assert _default_frame(displayed(mechanism)) == "platform"
    assert _default_frame(displayed(ClosedLoopModel.load("urdf/ankle.yaml"))) == "left_rod_tip"
