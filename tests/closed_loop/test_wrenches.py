"""Wrenches in closures and joints: every single body in equilibrium, by Newton and Euler."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from rps_pin import InputError, LoopClosure
from tests.closed_loop import mechanisms, random_mechanisms
from tests.closed_loop.mechanisms import FOUR_BAR, five_bar, values
from tests.closed_loop.random_mechanisms import (
    Case,
    case,
    force_of_bodies,
    inertia_wrenches,
    joint_of,
    pooled,
    random_placement,
    resisting_force,
    worst_error,
)

Array = NDArray[np.float64]

seeds = random_mechanisms.pool
yes_or_no = st.booleans()


def moved_to(wrench: Array, at: Array, to: Array) -> Array:
    """The same wrench about another point, in the same axes."""
    return np.concatenate([wrench[:3], wrench[3:] + np.cross(at - to, wrench[:3])])


def turned(wrench: Array, turn: Array) -> Array:
    return np.concatenate([turn @ wrench[:3], turn @ wrench[3:]])


def sums_on_bodies(c: Case, on_joints: dict[str, Array], on_closures: dict[str, Array]) -> Array:
    """All wrenches on each body but its weight and inertia, about the world's origin, (n, 6).

    The joint before a body acts on it, those after it act back; a closure's wrench acts on a's side
    and back on b's, at a; the surroundings act at their frames.
    """
    model = c.mechanism.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, c.q)
    sums, origin = np.zeros((model.njoints, 6)), np.zeros(3)
    for index in range(1, model.njoints):
        wrench = moved_to(on_joints[model.names[index]], data.oMi[index].translation, origin)
        sums[index] += wrench
        sums[model.parents[index]] -= wrench
    for closure in c.mechanism.closures:
        if isinstance(closure, LoopClosure):
            a, b = (model.getFrameId(name) for name in (closure.frame_a, closure.frame_b))
            wrench = moved_to(on_closures[closure.name], data.oMf[a].translation, origin)
            sums[model.frames[a].parentJoint] += wrench
            sums[model.frames[b].parentJoint] -= wrench
    for name, wrench in c.wrenches.items():
        frame = model.getFrameId(name)
        at = data.oMf[frame].translation
        sums[model.frames[frame].parentJoint] += moved_to(wrench, at, origin)
    return sums


def inertia_about_the_world_s_origin(c: Case) -> Array:
    model = c.mechanism.model
    data = model.createData()
    pin.forwardKinematics(model, data, c.q)
    rows = [np.zeros(6)]
    for index, wrench in enumerate(inertia_wrenches(model, c.q, c.v, c.a), start=1):
        placed = data.oMi[index]
        rows.append(moved_to(turned(wrench, placed.rotation), placed.translation, np.zeros(3)))
    return np.array(rows)


def solved(c: Case) -> tuple[dict[str, Array], dict[str, Array], Array]:
    """Wrenches in joints (world axes) and closures, and tau."""
    found = c.mechanism.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches)
    forces = found.constraint_forces
    on_joints = c.mechanism.joint_wrenches(c.q, c.v, c.a, forces, wrenches=c.wrenches, axes="world")
    return on_joints, c.mechanism.closure_wrenches(c.q, forces), found.tau


@given(seeds, yes_or_no)
def test_every_body_is_in_equilibrium(seed: int, planar: bool) -> None:
    c = pooled(seed, planar=planar, massless=bool(seed % 2), effects=bool(seed % 3))
    on_joints, on_closures, _ = solved(c)
    sums, inertia = sums_on_bodies(c, on_joints, on_closures), inertia_about_the_world_s_origin(c)
    size = max(np.abs(w).max() for w in [*on_joints.values(), *on_closures.values(), inertia])
    np.testing.assert_allclose(sums[1:], inertia[1:], rtol=0, atol=1e-11 * size)
    # The whole mechanism: what the ground and the surroundings exert moves it.
    ground = -sums[0]
    outside = [wrench for name, wrench in c.wrenches.items() if _on_world(c, name)]
    whole = sum(_at_origin(c, name) for name in c.wrenches if not _on_world(c, name))
    if outside:
        ground = ground + sum(_at_origin(c, name) for name in c.wrenches if _on_world(c, name))
    np.testing.assert_allclose(ground + whole, inertia.sum(axis=0), rtol=0, atol=1e-10 * size)


def _on_world(c: Case, name: str) -> bool:
    frame = c.mechanism.model.frames[c.mechanism.model.getFrameId(name)]
    return bool(frame.parentJoint == 0)


def _at_origin(c: Case, name: str) -> Array:
    model = c.mechanism.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, c.q)
    at = data.oMf[model.getFrameId(name)].translation
    return moved_to(np.asarray(c.wrenches[name]), at, np.zeros(3))


@given(seeds, yes_or_no)
@settings(max_examples=40)
def test_joints_carry_along_their_motion_what_drives_them(seed: int, planar: bool) -> None:
    """Projected on its motions, a joint's wrench is actuator less resistance, and couplings."""
    c = pooled(seed, planar=planar, effects=True)
    model = c.mechanism.model
    found = c.mechanism.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches)
    carried = c.mechanism.joint_wrenches(
        c.q, c.v, c.a, found.constraint_forces, wrenches=c.wrenches
    )
    expected = -resisting_force(model, c.mechanism.effects, c.q, c.v)
    expected[c.mechanism.actuated_indices] += found.tau
    for closure in c.mechanism.closures:
        if not isinstance(closure, LoopClosure):
            own = c.mechanism.rows(closure.name)
            expected += c.mechanism.jacobian(c.q)[own].T @ found.constraint_forces[own]
    data = model.createData()
    pin.computeJointJacobians(model, data, c.q)
    size = max(np.abs(wrench).max() for wrench in carried.values())
    for index in range(1, model.njoints):
        joint = model.joints[index]
        at = slice(joint.idx_v, joint.idx_v + joint.nv)
        local = pin.getJointJacobian(model, data, index, pin.ReferenceFrame.LOCAL)
        projected = np.array(local)[:, at].T @ carried[model.names[index]]
        np.testing.assert_allclose(projected, expected[at], rtol=0, atol=1e-10 * size)


@given(seeds)
@settings(max_examples=30)
def test_closures_exert_nothing_along_the_motions_they_leave(seed: int) -> None:
    """The wrench of frame b's side, on a's, in a's axes, does no work on the joint's twists."""
    c = pooled(seed)
    _, on_closures, _ = solved(c)
    model = c.mechanism.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, c.q)
    for closure in c.mechanism.closures:
        if not isinstance(closure, LoopClosure):
            assert closure.name not in on_closures
            continue
        a, b = (data.oMf[model.getFrameId(f)] for f in (closure.frame_a, closure.frame_b))
        wrench = turned(on_closures[closure.name], a.rotation.T)
        placement = a.actInv(b)
        free = _free_twists(closure, placement)
        np.testing.assert_allclose(free.T @ wrench, 0, atol=1e-10 * (1 + np.abs(wrench).max()))
        assert free.shape[1] >= 6 - closure.size


def _free_twists(closure: LoopClosure, placement: pin.SE3) -> Array:
    """Twists of b in a's axes at a's origin that the joint leaves, where b stands at M, (6, k)."""
    p, axis = placement.translation, np.array(closure.axis or (0.0, 0.0, 1.0))
    about_b = [np.concatenate([np.cross(p, w), w]) for w in np.eye(3)]  # turns about b's origin
    slides = [np.concatenate([u, np.zeros(3)]) for u in np.linalg.svd(axis[None])[2]]
    turn, slide = np.concatenate([np.cross(p, axis), axis]), slides[0]
    if closure.kind == "universal":
        second = placement.rotation @ np.array(closure.axis_b)
        return np.array([turn, np.concatenate([np.cross(p, second), second])]).T
    if closure.kind == "distance":
        across = [np.concatenate([np.cross(w, p), np.zeros(3)]) for w in np.eye(3)]
        return np.array([*about_b, *across]).T
    kinds = {
        "spherical": about_b,
        "rigid": [],
        "revolute": [turn],
        "prismatic": [slide],
        "cylindrical": [turn, slide],
        "planar": [turn, *slides[1:]],
        "point_on_line": [*about_b, slide],
        "point_on_plane": [*about_b, *slides[1:]],
    }
    return np.array(kinds[closure.kind]).reshape(-1, 6).T


def test_free_twists_of_this_file_are_those_of_the_joint() -> None:
    """The check of the check: as many as the joint of the kind has."""
    for kind, freedom in (("revolute", 1), ("planar", 3), ("point_on_plane", 5)):
        closure = LoopClosure("a", "b", kind)
        assert joint_of(closure)[0].nv == freedom
        assert _free_twists(closure, pin.SE3.Identity()).shape == (6, freedom)


@given(seeds)
@settings(max_examples=40)
def test_wrenches_may_be_given_at_any_frame_of_the_same_body(seed: int) -> None:
    """Moved to another point of the body with the moment that takes, nothing changes."""
    c = pooled(seed)
    rng = np.random.default_rng(seed)
    model = c.mechanism.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, c.q)
    joint = int(rng.integers(1, model.njoints))
    frames = [frame.name for frame in model.frames if frame.parentJoint == joint]
    joint_frame = model.addFrame(
        pin.Frame("elsewhere", joint, 0, random_placement(rng), pin.FrameType.OP_FRAME)
    )
    mechanism = type(c.mechanism)(model, c.mechanism.closures, c.mechanism.actuated)
    data = model.createData()
    pin.framesForwardKinematics(model, data, c.q)
    here = data.oMf[model.getFrameId(frames[0])].translation
    there = data.oMf[joint_frame].translation
    wrench = rng.normal(size=6)
    results = [
        mechanism.inverse_dynamics(c.q, c.v, c.a, wrenches=given)
        for given in ({frames[0]: wrench}, {"elsewhere": moved_to(wrench, here, there)})
    ]
    assert worst_error(results[1].tau, results[0].tau) < 1e-10
    forces = [result.constraint_forces for result in results]
    assert worst_error(forces[1], forces[0], np.abs(results[0].tau).max()) < 1e-9


@given(seeds, yes_or_no)
@settings(max_examples=40)
def test_actuators_and_wrenches_do_the_work_of_every_virtual_motion(
    seed: int, planar: bool
) -> None:
    """Without the closures: whatever they exert, it vanishes from N' (F - S' tau) = 0."""
    c = pooled(seed, planar=planar, effects=True)
    tau = c.mechanism.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches).tau
    rest = force_of_bodies(c, c.v, c.a)
    rest[c.mechanism.actuated_indices] -= tau
    motions = c.mechanism.allowed_motions(c.q)
    size = np.abs(motions).max() * max(np.abs(rest).max(), np.abs(tau).max())
    np.testing.assert_allclose(motions.T @ rest, 0, rtol=0, atol=1e-10 * size)


# By hand ------------------------------------------------------------------------------------------


def test_wrenches_on_the_world_change_nothing() -> None:
    c = case(0)
    plain = c.mechanism.inverse_dynamics(c.q, c.v, c.a)
    pushed = c.mechanism.inverse_dynamics(c.q, c.v, c.a, wrenches={"universe": np.ones(6)})
    np.testing.assert_array_equal(pushed.tau, plain.tau)
    np.testing.assert_array_equal(pushed.constraint_forces, plain.constraint_forces)


def test_four_bar_s_knee_carries_the_force_of_its_closed_form() -> None:
    mechanism = FOUR_BAR.spherical_mechanism()
    q = values(mechanism, FOUR_BAR.joint_values(1.0))
    v = mechanism.velocity(q, [2.0])
    a = mechanism.acceleration(q, v, [3.0])
    found = mechanism.inverse_dynamics(q, v, a)
    wrench = mechanism.closure_wrenches(q, found.constraint_forces)["tips"]
    x, z = FOUR_BAR.knee_force(1.0, 2.0, 3.0)
    np.testing.assert_allclose(wrench, [x, 0, z, 0, 0, 0], rtol=0, atol=1e-8)


def test_joint_s_axes_are_those_of_the_link_after_it() -> None:
    c = case(2)
    model = c.mechanism.model
    data = model.createData()
    pin.forwardKinematics(model, data, c.q)
    forces = c.mechanism.inverse_dynamics(c.q, c.v, c.a).constraint_forces
    own = c.mechanism.joint_wrenches(c.q, c.v, c.a, forces)
    world = c.mechanism.joint_wrenches(c.q, c.v, c.a, forces, axes="world")
    assert list(own) == list(world) == [str(name) for name in model.names][1:]
    for index in range(1, model.njoints):
        name = model.names[index]
        expected = turned(own[name], data.oMi[index].rotation)
        np.testing.assert_allclose(world[name], expected, rtol=0, atol=1e-12)


def test_wrong_arguments_are_refused_by_name() -> None:
    mechanism = five_bar()
    q, v, a = mechanisms.state(mechanism)
    forces = np.zeros(mechanism.constraint_size)
    with pytest.raises(InputError, match="axes = 'body': it must be 'world' or 'joint'"):
        mechanism.joint_wrenches(q, v, a, forces, axes="body")
    with pytest.raises(InputError, match="constraint_forces has shape"):
        mechanism.joint_wrenches(q, v, a, forces[1:])
    with pytest.raises(InputError, match="constraint_forces is not finite"):
        mechanism.closure_wrenches(q, forces * np.nan)
    with pytest.raises(InputError, match="the wrench at frame 'left_tip' is not finite"):
        mechanism.joint_wrenches(q, v, a, forces, wrenches={"left_tip": [np.nan] * 6})
