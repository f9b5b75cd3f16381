"""Coordinates of a frame as a closure: rotation vectors, rates, and dynamics with them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, MechanismError
from rps_pin.closed_loop.constraints import rotation_vector
from rps_pin.closed_loop.constraints.frame_coordinates import FrameCoordinates
from rps_pin.task import Task
from tests.closed_loop.random_mechanisms import random_inertia, random_placement
from tests.task.robots import poses, slope, task
from tests.worst import worst


def vectors(count: int, most: float = 6.0) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    drawn = rng.normal(size=(count, 3))
    lengths = most * np.concatenate([rng.uniform(size=count - 3), [1e-9, 1e-5, 2 / most]])
    return list(drawn / np.linalg.norm(drawn, axis=1)[:, None] * lengths[:, None])


@pytest.mark.parametrize("r", vectors(40))
def test_rates_of_rotation_vectors_are_derivatives(r) -> None:
    rng = np.random.default_rng(1)
    spin, along, again = rng.normal(size=(3, 3))
    h, R = 1e-4, pin.exp3(r)

    def slope(f):
        return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)

    rate = slope(lambda t: rotation_vector.rotation_vector(pin.exp3(t * spin) @ R, near=r))
    A = rotation_vector.rate_matrix(r)
    assert worst(rate - A @ spin) < 1e-8 * worst(A, 1)
    slope_of_A = rotation_vector.rate_slope(r, along)
    found = slope(lambda t: rotation_vector.rate_matrix(r + t * along))
    assert worst(found - slope_of_A) < 1e-7 * worst(slope_of_A, 1)
    curvature = rotation_vector.rate_curvature(r, along, again)
    found = slope(lambda t: rotation_vector.rate_slope(r + t * again, along))
    assert worst(found - curvature) < 1e-6 * worst(curvature, 1)


def test_series_and_closed_form_of_beta_meet() -> None:
    for t in (3.999999999, 4.000000001, 0.0, 1e-12, 39.0):
        beta, first, second = rotation_vector.beta(t)
        h = np.sqrt(t) / 2
        expected = (1 - h / np.tan(h)) / t if t > 1e-3 else 1 / 12 + t / 720
        assert abs(beta - expected) < 1e-13 * max(abs(expected), 1)
        assert np.isfinite([first, second]).all()


def ball() -> ClosedLoopModel:
    """A body on a ball joint in the air, its base turned."""
    rng, model = np.random.default_rng(2), pin.Model()
    joint = model.addJoint(0, pin.JointModelSpherical(), random_placement(rng), "ball")
    model.appendBodyToJoint(joint, random_inertia(rng), random_placement(rng))
    model.addFrame(pin.Frame("hand", joint, 0, random_placement(rng), pin.FrameType.BODY))
    return ClosedLoopModel(model, [], ["ball"])


def test_rotations_up_to_a_whole_turn_are_reached_and_continued() -> None:
    m = ball()
    one = Task(m, "hand", ["rx", "ry", "rz"])
    first = one.configuration(one.home + 0.1)
    for r in vectors(40):
        q = one.configuration(r, near=first)
        turn = m.frame_placement(q, "hand")[:3, :3]
        assert worst(turn - pin.exp3(r)) < 1e-11
        assert worst(one.at(q, near=r) - r) < 1e-9
        assert np.linalg.norm(one.at(q)) <= np.pi + 1e-9


def two_bodies() -> ClosedLoopModel:
    """One body on a slide, another on a slide and a hinge; all axes are random."""
    rng, model = np.random.default_rng(5), pin.Model()
    for name, chain in (("one", ["slide"]), ("other", ["slide", "hinge"])):
        joint = 0
        for sort in chain:
            axis = rng.normal(size=3)
            axis /= np.linalg.norm(axis)
            kinds = {
                "slide": pin.JointModelPrismaticUnaligned,
                "hinge": pin.JointModelRevoluteUnaligned,
            }
            made = kinds[sort](axis)
            joint = model.addJoint(joint, made, random_placement(rng), f"{name}_{sort}")
            model.appendBodyToJoint(joint, random_inertia(rng), pin.SE3.Identity())
        model.addFrame(pin.Frame(name, joint, 0, random_placement(rng), pin.FrameType.BODY))
    return ClosedLoopModel(model, [], ["one_slide", "other_slide", "other_hinge"])


def test_reference_frames_and_offsets_are_those_of_rigid_placements() -> None:
    rng = np.random.default_rng(3)
    m, offset = two_bodies(), random_placement(rng)
    names = ["ry", "x", "z"]  # any order
    one = Task(m, "other", names, reference="one", placement=offset)
    for _ in range(5):
        q = rng.uniform(-0.3, 0.3, 3)
        a, b = (pin.SE3(m.frame_placement(q, f)) for f in ("one", "other"))
        found = a.inverse() * b * offset
        whole = dict(zip(["x", "y", "z"], found.translation, strict=True))
        whole |= dict(zip(["rx", "ry", "rz"], pin.log3(found.rotation), strict=True))
        x = one.at(q)
        assert worst(x - [whole[name] for name in names]) < 1e-12
        assert worst(one.to_actuators(x, near=q + 0.01) - q) < 1e-10
        K, E, wrench = one.jacobian(q), one.twist_map(q), rng.normal(size=6)
        of_task = slope(lambda y, q=q: one.to_actuators(y, near=q), x)
        assert worst(of_task - K) < 1e-7 * worst(K)
        world = pin.SE3(m.frame_placement(q, "other")) * offset
        moved = slope(lambda y: (pin.SE3(m.frame_placement(y, "other")) * offset).translation, q)
        assert worst(moved @ K - E[:3]) < 1e-8 * worst(E), world
        tau = one.wrench_to_actuators(q, wrench)
        assert worst(K.T @ tau - E.T @ wrench) < 1e-10 * worst(E)


@pytest.mark.parametrize("name", ["rrs", "delta", "five_bar"])
def test_dynamics_with_coordinates_has_its_derivatives(name) -> None:
    """Those of the task's forces by x, x' and x'', against differences of them."""
    one, (x, q) = task(name), poses(name)
    m, rng = one.extended, np.random.default_rng(4)
    rate, acceleration = rng.normal(size=(2, one.size))

    def motion(x, rate):
        start = one.joined(one.configuration(x, near=q[0]), x)
        v = m.velocity(start, rate)
        return start, v, m.acceleration(start, v, acceleration)

    def forces(x, rate):
        return m.inverse_dynamics(*motion(x, rate)).tau

    found = m.inverse_dynamics_derivatives(*motion(x[0], rate))
    by_x = slope(lambda y: forces(y, rate), x[0], 1e-4)
    by_rate = slope(lambda u: forces(x[0], u), rate, 1e-3)
    assert worst(found.position - by_x) < 1e-6 * worst(found.position, 1)
    assert worst(found.velocity - by_rate) < 1e-8 * worst(found.velocity, 1)
    assert worst(found.acceleration - one.mass_matrix(q[0])) < 1e-10 * worst(found.acceleration)
    if name == "rrs":
        code = m.compile(functions="derivatives")
        generated = code.inverse_dynamics_derivatives(*motion(x[0], rate))
        for part, expected in zip(generated, found, strict=True):
            assert worst(part - expected) < 1e-9 * worst(expected, 1)


def test_coordinates_out_of_order_or_without_joints_are_refused() -> None:
    for coordinates, joints in ((("z", "x"), ("a", "b")), (("x",), ()), ((), ()), (("w",), ("a",))):
        with pytest.raises(MechanismError, match="each once and in this order"):
            FrameCoordinates("universe", "hand", coordinates=coordinates, joints=joints)
