"""Positions, velocities and accelerations of closed mechanisms, random ones and by hand."""

from __future__ import annotations

import pickle
from copy import deepcopy

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import minimize

from rps_pin import (
    ClosedLoopModel,
    ClosureError,
    InputError,
    JointCoupling,
    LoopClosure,
    MechanismError,
    SingularityError,
)
from tests.closed_loop import mechanisms, random_mechanisms
from tests.closed_loop.mechanisms import FOUR_BAR, FourBar, derivative, five_bar, values
from tests.closed_loop.random_mechanisms import (
    EVERY_KIND,
    Case,
    case,
    gap_slope,
    pooled,
    random_tree,
    slopes,
    worst_error,
)
from tests.closed_loop.test_model import toggle
from tests.quick import quick

Array = NDArray[np.float64]

seeds = random_mechanisms.pool
plane = st.booleans()
every_kind = pytest.mark.parametrize("kind", EVERY_KIND)


def along(c: Case, t: float) -> Array:
    """A closed configuration at time t of a motion that has v and a at time 0."""
    return c.mechanism.close(pin.integrate(c.mechanism.model, c.q, t * c.v + t**2 / 2 * c.a))


# Rates --------------------------------------------------------------------------------------------


@every_kind
@pytest.mark.parametrize("seed", range(3))
def test_jacobian_is_the_slope_of_the_gaps(kind: str, seed: int) -> None:
    c = case(seed, kinds=[kind])
    assert c.mechanism.loop_gap(c.q) <= 1e-12
    found = c.mechanism.jacobian(c.q)
    assert worst_error(found, gap_slope(c.mechanism, c.q)) < 1e-9


@given(seeds, plane)
def test_velocities_and_accelerations_keep_the_loops_closed(seed: int, planar: bool) -> None:
    c = pooled(seed, planar=planar)
    errors = c.mechanism.loop_errors(c.q, c.v, c.a)
    for rows, size in zip(errors, (1.0, np.abs(c.v).max(), np.abs(c.a).max()), strict=True):
        np.testing.assert_allclose(rows, 0, rtol=0, atol=1e-11 * max(1, size))


@given(seeds, plane)
@settings(max_examples=25)
def test_velocities_and_accelerations_are_those_of_closed_paths(seed: int, planar: bool) -> None:
    """The path's first derivatives are v, and its deviation from v and a is of third order."""
    c = pooled(seed, planar=planar)

    def moved(t: float) -> Array:
        return pin.difference(c.mechanism.model, c.q, along(c, t))

    np.testing.assert_allclose(derivative(moved), c.v, rtol=0, atol=1e-8 * np.abs(c.v).max())
    off = [np.abs(moved(t) - t * c.v - t**2 / 2 * c.a).max() for t in (2e-3, 1e-3)]
    size = 1 + np.abs(c.v).max() ** 3 + np.abs(c.v).max() * np.abs(c.a).max()
    assert off[1] < max(off[0] / 6, 1e-12 * size)


@every_kind
@pytest.mark.parametrize("seed", range(3))
def test_drift_is_the_jacobian_s_derivative(kind: str, seed: int) -> None:
    """J a + J' v is the rows' acceleration; with a = 0, J' v alone. J by its own differences."""
    c = case(seed, kinds=[kind])
    model = c.mechanism.model
    changing = derivative(lambda t: c.mechanism.jacobian(pin.integrate(model, c.q, t * c.v)) @ c.v)
    found = c.mechanism.loop_errors(c.q, c.v, np.zeros(model.nv)).acceleration
    assert worst_error(found, changing, 1.0) < 1e-9


@given(seeds, plane)
def test_motions_complete_from_any_independent_joints(seed: int, planar: bool) -> None:
    """From other joints than the actuated ones, and from the actuated ones in another order."""
    c = pooled(seed, planar=planar)
    model, actuated = c.mechanism.model, list(c.mechanism.actuated)
    others = [actuated[::-1]]
    for name in list(model.names)[1:]:
        swapped = [name, *actuated[1:]]
        if name not in actuated and _determine(c, swapped):
            others.append(swapped)
    for independent in others:
        indices = _indices(model, independent)
        v = c.mechanism.velocity(c.q, c.v[indices], independent)
        np.testing.assert_allclose(v, c.v, rtol=0, atol=1e-10 * max(1, np.abs(c.v).max()))
        a = c.mechanism.acceleration(c.q, c.v, c.a[indices], independent)
        np.testing.assert_allclose(a, c.a, rtol=0, atol=1e-10 * max(1, np.abs(c.a).max()))
        basis = c.mechanism.motion_basis(c.q, independent)
        np.testing.assert_allclose(basis[indices], np.eye(len(indices)), rtol=0, atol=1e-11)
        np.testing.assert_allclose(basis @ c.v[indices], v, rtol=0, atol=1e-10 * np.abs(v).max())


def _indices(model: pin.Model, names: list[str]) -> list[int]:
    joints = [model.joints[model.getJointId(name)] for name in names]
    return [index for joint in joints for index in range(joint.idx_v, joint.idx_v + joint.nv)]


def _determine(c: Case, names: list[str]) -> bool:
    rows = c.mechanism.allowed_motions(c.q)[_indices(c.mechanism.model, names)]
    square = rows.shape[0] == rows.shape[1]
    return square and np.linalg.svd(rows, compute_uv=False)[-1] > 0.02


@given(seeds, plane)
def test_allowed_motions_are_all_and_only_those(seed: int, planar: bool) -> None:
    """J by differences of the gaps; orthonormal once angles are lengths."""
    c = pooled(seed, planar=planar)
    motions = c.mechanism.allowed_motions(c.q)
    jacobian = gap_slope(c.mechanism, c.q)
    rank = np.linalg.matrix_rank(jacobian, tol=1e-7 * np.abs(jacobian).max())
    assert motions.shape == (c.mechanism.model.nv, c.mechanism.model.nv - rank)
    np.testing.assert_allclose(jacobian @ motions, 0, rtol=0, atol=1e-8)
    angular = _turns(c.mechanism.model)
    units = np.where(angular, c.mechanism.characteristic_length, 1.0)[:, None]
    gram = (units * motions).T @ (units * motions)
    np.testing.assert_allclose(gram, np.eye(motions.shape[1]), rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_rows_of_rounding_errors_take_no_freedom_away(seed: int) -> None:
    """A planar linkage on a table it never leaves: the closure's rows are zero but for rounding."""
    rng = np.random.default_rng(seed)
    model = random_tree(rng, ["revolute"], planar=True)
    q = rng.normal(size=model.nv)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    tip = model.getFrameId("body_4")
    normal = data.oMf[tip].rotation.T @ [0, 0, 1]
    placed = pin.SE3(np.eye(3), data.oMf[tip].translation)
    model.addFrame(pin.Frame("table", 0, 0, placed, pin.FrameType.OP_FRAME))
    closure = LoopClosure("body_4", "table", "planar", axis=normal, axis_b=[0, 0, 1])
    mechanism = ClosedLoopModel(model, [closure], list(model.names)[1:])
    assert mechanism.loop_gap(q) < 1e-14
    assert mechanism.allowed_motions(q).shape == (model.nv, model.nv)
    v, tau = rng.normal(size=(2, model.nv))
    expected = pin.aba(model, data, q, v, tau)
    assert worst_error(mechanism.forward_dynamics(q, v, tau), expected) < 1e-9


def _turns(model: pin.Model) -> NDArray[np.bool_]:
    """Which velocities are angular, by the joints' names."""
    linear = {"prismatic": [0], "free": [0, 1, 2], "planar": [0, 1], "translation": [0, 1, 2]}
    angular = np.ones(model.nv, dtype=bool)
    for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:
        for index in linear.get(name.split("_")[0], []):
            angular[joint.idx_v + index] = False
    return angular


@pytest.mark.parametrize("axes", ["world", "frame"])
@given(seeds)
@settings(max_examples=20)
def test_frame_jacobian_is_the_frame_s_motion_along_closed_paths(axes: str, seed: int) -> None:
    """The twist by differences of the placement, of a path that starts with v."""
    c = pooled(seed)
    model = c.mechanism.model
    data = model.createData()
    frame = model.getFrameId("body_2")

    def placement(t: float) -> pin.SE3:
        pin.framesForwardKinematics(model, data, along(c, t))
        return pin.SE3(data.oMf[frame])

    here = placement(0.0)
    twist = derivative(lambda t: pin.log6(here.actInv(placement(t))).vector)
    if axes == "world":
        twist = np.concatenate([here.rotation @ twist[:3], here.rotation @ twist[3:]])
    found = c.mechanism.frame_jacobian(c.q, "body_2", axes=axes)
    speed = c.v[c.mechanism.actuated_indices]
    assert worst_error(found @ speed, twist, 1e-2 * np.abs(c.v).max()) < 1e-7


def test_frame_jacobian_of_a_tree_of_one_velocity_is_a_column() -> None:
    """Pinocchio's Jacobians come flat there."""
    urdf = mechanisms.robot(
        mechanisms.link("arm", 1.0, "0.5 0 0", 0.1),
        mechanisms.link("tip"),
        mechanisms.joint("revolute", "base", "arm"),
        mechanisms.joint("fixed", "arm", "tip", "0.7 0 0"),
    )
    mechanism = ClosedLoopModel.from_urdf(urdf, [], ["arm_joint"])
    found = mechanism.frame_jacobian(np.zeros(1), "tip")
    np.testing.assert_allclose(found, [[0], [0], [0.7], [0], [-1], [0]], rtol=0, atol=1e-15)


# Closing ------------------------------------------------------------------------------------------


@given(seeds, plane)
def test_random_guesses_close(seed: int, planar: bool) -> None:
    """Every mechanism can be closed: it was, where it was made."""
    c = pooled(seed, planar=planar)
    rng = np.random.default_rng(seed)
    guess = pin.integrate(c.mechanism.model, c.q, 0.3 * rng.normal(size=c.mechanism.model.nv))
    found = c.mechanism.close(guess)
    assert c.mechanism.loop_gap(found) <= 1e-12 * max(1.0, c.mechanism.characteristic_length)
    assert pin.isNormalized(c.mechanism.model, found, 1e-12)
    np.testing.assert_array_equal(c.mechanism.close(guess), found)  # chance is always the same


@given(seeds)
def test_fixed_joints_keep_their_values_exactly(seed: int) -> None:
    c = pooled(seed)
    model = c.mechanism.model
    fixed = list(c.mechanism.actuated)
    rng = np.random.default_rng(seed)
    step = 0.1 * rng.normal(size=model.nv)
    step[c.mechanism.actuated_indices] = 0.0
    guess = pin.integrate(model, c.q, step)
    found = c.mechanism.close(guess, fixed=fixed)
    for name in fixed:
        joint = model.joints[model.getJointId(name)]
        own = slice(joint.idx_q, joint.idx_q + joint.nq)
        exactly = joint.nq == joint.nv
        np.testing.assert_allclose(found[own], guess[own], rtol=0, atol=0 if exactly else 1e-14)
    assert c.mechanism.loop_gap(found) <= 1e-12 * max(1.0, c.mechanism.characteristic_length)


def limited_five_bar(**limits: tuple[float, float]) -> ClosedLoopModel:
    """The five-bar with narrower limits."""
    model = five_bar().model.copy()
    for name, (lower, upper) in limits.items():
        at = model.joints[model.getJointId(f"{name}_joint")].idx_q
        model.lowerPositionLimit[at], model.upperPositionLimit[at] = lower, upper
    return ClosedLoopModel(model, five_bar().closures, five_bar().actuated)


def test_closing_stays_within_the_limits() -> None:
    """From guesses anywhere, outside the limits too; they leave both elbows one way."""
    mechanism = limited_five_bar(left=(1.8, 2.6), left_arm=(-2.5, -0.3), right_arm=(0.3, 2.5))
    model = mechanism.model
    rng = np.random.default_rng(1)
    for _ in range(60):
        found = mechanism.close(rng.uniform(-3, 3, size=4))
        assert mechanism.loop_gap(found) <= 1e-12
        assert (found >= model.lowerPositionLimit).all()
        assert (found <= model.upperPositionLimit).all()
    free = mechanism.close([0.5, 1.0, 2.0, -1.0], within_limits=False)
    assert mechanism.loop_gap(free) <= 1e-12
    assert (free > model.upperPositionLimit).any() or (free < model.lowerPositionLimit).any()


def test_limits_that_leave_no_way_are_named_with_the_gap() -> None:
    """Arms stretched away from each other; the left turns in by 0.1, the right not at all."""
    mechanism = limited_five_bar(
        left=(np.pi - 0.1, np.pi), left_arm=(0, 0), right=(-0.1, 0), right_arm=(0, 0)
    )
    with pytest.raises(ClosureError) as caught:
        mechanism.close(np.zeros(4))
    least = np.hypot(0.4 + 0.7 + 0.7 * np.cos(0.1), 0.7 * np.sin(0.1))
    assert caught.value.gap == pytest.approx(least, rel=1e-9)
    assert "closure 'tips' stays open by" in str(caught.value)
    for name in ("left_joint", "left_arm_joint", "right_arm_joint"):
        assert f"joint '{name}' at its limit" in str(caught.value)


def test_fixed_joint_outside_its_limits_is_named() -> None:
    mechanism = limited_five_bar(left=(1.8, 2.6))
    with pytest.raises(ClosureError, match="left_joint"):
        mechanism.close([3.0, -1.0, 1.0, 1.0], fixed=["left_joint"])
    with pytest.raises(ClosureError, match="left_joint"):
        mechanism.complete({"left_joint": 3.0})


@pytest.mark.parametrize("ground", quick([1.2, 1.5, 3.0], [1.2, 3.0]))
def test_gap_of_a_four_bar_that_is_too_short_is_what_is_missing(ground: float) -> None:
    """Crank, coupler and rocker are 1.1 m together: the rest of the ground stays open."""
    mechanism = FourBar(ground=ground).spherical_mechanism()
    for guess in ([0.2, 0.1, 3.0], [1.0, 1.0, 1.0]):
        with pytest.raises(ClosureError, match="closure 'tips' stays open by") as caught:
            mechanism.close(guess)
        assert caught.value.gap == pytest.approx(ground - 1.1, rel=1e-5)
        assert f"by {caught.value.gap:.6g} m" in str(caught.value)


def test_restarts_find_what_lies_far_away() -> None:
    """From the four-bar's folded, gradient-free guesses the first steps end nowhere."""
    mechanism = limited_five_bar(left=(1.8, 2.6), left_arm=(-2.5, -0.3), right_arm=(0.3, 2.5))
    rng = np.random.default_rng(2)
    guesses = rng.uniform(-3, 3, size=(60, 4))
    dead_ends = 0
    for guess in guesses:
        try:
            mechanism.close(guess, restarts=0)
        except ClosureError as error:
            dead_ends += 1
            assert error.gap > 1e-12
            assert mechanism.loop_gap(mechanism.close(guess)) <= 1e-12
    assert dead_ends > 0


def test_opposite_axes_are_turned_round() -> None:
    """A revolute closure of bodies that point apart closes with the axes the same way."""
    model = pin.Model()
    for name in ("one", "two"):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"{name}_joint")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        model.addFrame(pin.Frame(name, joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    closures = [LoopClosure("one", "two", "revolute", axis=[1.0, 2.0, 3.0])]
    mechanism = ClosedLoopModel(model, closures, ["one_joint"])
    guess = pin.neutral(model)
    across = np.array([2.0, -1.0, 0.0]) / np.sqrt(5)
    guess[10:14] = [*across, 0.0]  # a half turn about an axis across
    q = mechanism.close(guess)
    one, two = (pin.Quaternion(q[at : at + 4]).matrix() for at in (3, 10))
    axis = np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(one @ axis, two @ axis, rtol=0, atol=1e-11)


@given(seeds)
@settings(max_examples=30)
def test_complete_takes_the_joints_where_they_are_asked(seed: int) -> None:
    """From the actuated joints, by names in any order, near the guess: back to the same place."""
    c = pooled(seed)
    model = c.mechanism.model
    target = along(c, 0.05)
    named = {}
    for name in reversed(c.mechanism.actuated):
        joint = model.joints[model.getJointId(name)]
        named[name] = target[joint.idx_q : joint.idx_q + joint.nq]
    found = c.mechanism.complete(named, c.q)
    for name, value in named.items():
        joint = model.joints[model.getJointId(name)]
        own = found[joint.idx_q : joint.idx_q + joint.nq]
        np.testing.assert_allclose(own, value, rtol=0, atol=1e-14)
    assert c.mechanism.loop_gap(found) <= 1e-12 * max(1.0, c.mechanism.characteristic_length)


def test_complete_takes_actuated_values_in_order_and_starts_from_home() -> None:
    home = values(FOUR_BAR.mechanism(), FOUR_BAR.joint_values(1.0))
    mechanism = FOUR_BAR.mechanism(home=home)
    expected = values(mechanism, FOUR_BAR.joint_values(1.3))
    np.testing.assert_allclose(mechanism.complete([1.3]), expected, rtol=0, atol=1e-12)
    by_rocker = {"rocker_joint": FOUR_BAR.joint_values(1.3)["rocker_joint"]}
    np.testing.assert_allclose(mechanism.complete(by_rocker), expected, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(mechanism.home, home)


# The nearest --------------------------------------------------------------------------------------


def distance(c: Case, q: Array, guess: Array) -> float:
    """In the norm that makes angles lengths."""
    units = np.where(_turns(c.mechanism.model), c.mechanism.characteristic_length, 1.0)
    return float(np.linalg.norm(units * pin.difference(c.mechanism.model, q, guess)))


def check_nearest(c: Case, guess: Array) -> Array:
    """No allowed motion leads nearer: the distance's slope along all of them vanishes."""
    q = c.mechanism.project(guess)
    assert c.mechanism.loop_gap(q) <= 1e-12 * max(1.0, c.mechanism.characteristic_length)
    motions = c.mechanism.allowed_motions(q)

    def off(step: Array) -> Array:
        moved = c.mechanism.close(pin.integrate(c.mechanism.model, q, motions @ step))
        return np.array(distance(c, moved, guess))

    slope = slopes(off, motions.shape[1], h=1e-3)
    np.testing.assert_allclose(slope, 0, rtol=0, atol=1e-6)
    return q


def displaced(c: Case, seed: int, size: float) -> Array:
    rng = np.random.default_rng(seed)
    step: Array = size * rng.normal(size=c.mechanism.model.nv)
    return np.asarray(pin.integrate(c.mechanism.model, c.q, step))


@given(seeds, plane)
@settings(max_examples=25)
def test_projection_is_nearest_among_its_neighbours(seed: int, planar: bool) -> None:
    c = pooled(seed, planar=planar, joints=("revolute", "revolute", "prismatic", "turn", "ball"))
    check_nearest(c, displaced(c, seed, 0.1))


@pytest.mark.parametrize(
    ("sort", "seed"), [("free", 0), ("free", 6), ("free", 7), ("planar", 0), ("planar", 4)]
)
def test_projection_of_bodies_that_turn_and_move_is_nearest(sort: str, seed: int) -> None:
    """Their coordinates are curved: a turn moves a body's own axes of translation."""
    c = case(seed, joints=[sort, "revolute", "revolute", "prismatic"])
    check_nearest(c, displaced(c, seed, 0.8))


@pytest.mark.parametrize("seed", range(6))
def test_projection_is_as_near_as_a_general_optimiser_gets(seed: int) -> None:
    """SciPy's SLSQP on the same problem, and half of the limits in the way."""
    c = limited(seed)
    guess = displaced(c, seed, 0.3)
    q = c.mechanism.project(guess)
    model = c.mechanism.model
    units = np.where(_turns(model), c.mechanism.characteristic_length, 1.0)
    assert c.mechanism.loop_gap(q) <= 1e-12 * max(1.0, c.mechanism.characteristic_length)
    assert (q <= model.upperPositionLimit).all()
    assert (q >= model.lowerPositionLimit).all()
    other = minimize(
        lambda x: 0.5 * np.sum((units * (x - guess)) ** 2),
        q,
        jac=lambda x: units**2 * (x - guess),
        bounds=list(zip(model.lowerPositionLimit, model.upperPositionLimit, strict=True)),
        constraints={
            "type": "eq",
            "fun": lambda x: c.mechanism.loop_errors(x).position,
            "jac": c.mechanism.jacobian,
        },
        method="SLSQP",
        options={"maxiter": 300, "ftol": 1e-14},
    )
    feasible = np.clip(other.x, model.lowerPositionLimit, model.upperPositionLimit)
    assert np.abs(c.mechanism.loop_errors(feasible).position).max() < 1e-6
    assert distance(c, q, guess) <= distance(c, feasible, guess) * (1 + 1e-5) + 1e-7


def limited(seed: int) -> Case:
    """A mechanism of plain joints that stands close to many of its limits."""
    c = case(seed, kinds=["distance", "point_on_plane", "point_on_line"], joints=["revolute"])
    model = c.mechanism.model.copy()
    rng = np.random.default_rng(seed)
    model.lowerPositionLimit = c.q - rng.uniform(0.0, 0.3, size=model.nq)
    model.upperPositionLimit = c.q + rng.uniform(0.0, 0.3, size=model.nq)
    mechanism = ClosedLoopModel(model, c.mechanism.closures, c.mechanism.actuated)
    return c._replace(mechanism=mechanism)


def two_sliders() -> ClosedLoopModel:
    """x, y and z, with z tied to y: the mobility is 2, and the limits are those of a box."""
    model = pin.Model()
    parent = 0
    for name, joint, upper in (
        ("x", pin.JointModelPX(), 1.0),
        ("y", pin.JointModelPY(), 5.0),
        ("z", pin.JointModelPZ(), 0.5),
    ):
        parent = model.addJoint(parent, joint, pin.SE3.Identity(), name)
        model.appendBodyToJoint(parent, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        at = model.joints[parent].idx_q
        model.lowerPositionLimit[at], model.upperPositionLimit[at] = -5.0, upper
    return ClosedLoopModel(model, [JointCoupling("z", "y", name="tie")], ["x", "y"])


def test_projection_within_limits_is_the_corner_s_foot() -> None:
    """Nearest to (3, 2, 2) is (1, 1/2, 1/2): x and z at their limits, y tied to z."""
    mechanism = two_sliders()
    np.testing.assert_allclose(mechanism.project([3.0, 2.0, 2.0]), [1, 0.5, 0.5], atol=1e-9)
    free = mechanism.project([3.0, 2.0, 1.0], within_limits=False)
    np.testing.assert_allclose(free, [3, 1.5, 1.5], rtol=0, atol=1e-9)


def test_projection_of_a_closed_configuration_is_itself() -> None:
    c = case(3)
    difference = pin.difference(c.mechanism.model, c.mechanism.project(c.q), c.q)
    np.testing.assert_allclose(difference, 0, rtol=0, atol=1e-12)


# Refusals -----------------------------------------------------------------------------------------


def test_wrong_names_are_refused_with_those_there_are() -> None:
    mechanism = five_bar()
    q = mechanism.close(mechanisms.guess(mechanism))
    joints = "left_joint, left_arm_joint, right_joint, right_arm_joint"
    calls = {
        "to fix": lambda: mechanism.close(q, fixed=["elbow"]),
        "to give a value": lambda: mechanism.complete({"elbow": 1.0}),
        "to move independently": lambda: mechanism.velocity(q, [1.0], ["elbow"]),
        "to actuate": lambda: ClosedLoopModel(mechanism.model, mechanism.closures, ["elbow"]),
    }
    for purpose, call in calls.items():
        with pytest.raises(
            MechanismError, match=f"no joint 'elbow' {purpose}; there are: {joints}"
        ):
            call()
    with pytest.raises(MechanismError, match=r"no frame 'hand'; there are: universe, .*left_tip"):
        mechanism.frame_jacobian(q, "hand")
    with pytest.raises(MechanismError, match="independent joint 'left_joint' is named twice"):
        mechanism.motion_basis(q, ["left_joint", "left_joint"])
    with pytest.raises(InputError, match="axes = 'body': it must be 'world' or 'frame'"):
        mechanism.frame_jacobian(q, "left_tip", axes="body")


def test_wrong_shapes_and_numbers_are_refused_by_name() -> None:
    mechanism = five_bar()
    q = mechanism.close(mechanisms.guess(mechanism))
    nan = np.full(4, np.nan)
    for method in (mechanism.close, mechanism.project):
        with pytest.raises(InputError, match=r"q_guess has shape \(3,\); it must be \(4,\)"):
            method(q[:3])
        with pytest.raises(InputError, match="q_guess is not finite: entry 0 is nan"):
            method(nan)
    for method in (mechanism.jacobian, mechanism.allowed_motions, mechanism.motion_basis):
        with pytest.raises(InputError, match=r"q has shape \(3,\)"):
            method(q[:3])
        with pytest.raises(InputError, match="q is not finite"):
            method(nan)
    with pytest.raises(InputError, match=r"values has shape \(3,\); it must be \(2,\)"):
        mechanism.complete([1.0, 2.0, 3.0])
    with pytest.raises(InputError, match=r"the value of joint 'left_joint' has shape \(2,\)"):
        mechanism.complete({"left_joint": [1.0, 2.0]})
    with pytest.raises(InputError, match="the value of joint 'left_joint' is not finite"):
        mechanism.complete({"left_joint": np.nan})
    with pytest.raises(InputError, match="v_actuated"):
        mechanism.velocity(q, [1.0], ["left_joint", "right_joint"])
    with pytest.raises(InputError, match=r"home has shape"):
        ClosedLoopModel(mechanism.model, mechanism.closures, mechanism.actuated, home=q[:2])


def test_joints_that_do_not_determine_the_motion_are_refused() -> None:
    mechanism = five_bar()
    q = mechanism.close(mechanisms.guess(mechanism))
    with pytest.raises(SingularityError, match="1 independent velocities are named, for a mobil"):
        mechanism.motion_basis(q, ["left_joint"])
    with pytest.raises(SingularityError, match="3 independent velocities are named"):
        mechanism.motion_basis(q, ["left_joint", "left_arm_joint", "right_joint"])
    c = two_sliders()
    with pytest.raises(SingularityError, match="these joints do not determine the motion"):
        c.motion_basis(np.zeros(3), ["y", "z"])


@pytest.mark.parametrize("make", ["mechanism", "spherical_mechanism"])
def test_joints_that_do_not_move_here_determine_nothing(make: str) -> None:
    """In toggle the crank stands still, to first order, while coupler and rocker move."""
    mechanism, q = toggle(make)
    for call in (mechanism.motion_basis, mechanism.mass_matrix, mechanism.gravity_forces):
        with pytest.raises(SingularityError):
            call(q)
    with pytest.raises(SingularityError):
        mechanism.frame_jacobian(q, "coupler_joint")


def test_locked_joints_determine_nothing() -> None:
    """Also where rounding errors make them move by 1e-17 of the others."""
    found = 0
    for seed in range(1500, 1540):
        c = case(seed)
        motions = c.mechanism.allowed_motions(c.q)
        for name, joint in list(
            zip(c.mechanism.model.names, c.mechanism.model.joints, strict=True)
        )[1:]:
            own = motions[joint.idx_v : joint.idx_v + joint.nv]
            if own.shape[0] == motions.shape[1] and np.abs(own).max() < 1e-13:
                found += 1
                with pytest.raises(SingularityError):
                    c.mechanism.motion_basis(c.q, [str(name)])
    assert found > 1


@given(st.lists(st.floats(-1e3, 1e3), min_size=4, max_size=4))
@settings(max_examples=30)
def test_no_guess_is_closed_silently_wrong(guess: list[float]) -> None:
    """Whatever comes back is closed and within limits; else an error says by how much not."""
    mechanism = limited_five_bar(left=(1.8, 2.6), right=(-0.1, 0.1), right_arm=(-0.1, 0.1))
    try:
        q = mechanism.close(guess, restarts=3)
    except ClosureError as error:
        assert error.gap > 1e-12
    else:
        assert mechanism.loop_gap(q) <= 1e-12
        assert (q <= mechanism.model.upperPositionLimit).all()


# Copies -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("copy", [deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies_keep_all_they_were_made_with(copy) -> None:
    c = case(1, effects=True, armature=True)
    twin = copy(c.mechanism)
    assert twin.name == c.mechanism.name
    assert twin.closures == c.mechanism.closures
    assert twin.actuated == c.mechanism.actuated
    assert twin.max_condition == c.mechanism.max_condition
    assert twin.characteristic_length == c.mechanism.characteristic_length
    np.testing.assert_array_equal(twin.home, c.mechanism.home)
    for what in ("damping", "friction", "stiffness", "rest", "friction_speed"):
        expected = getattr(c.mechanism.effects, what)
        np.testing.assert_array_equal(getattr(twin.effects, what), expected)
    found = twin.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches)
    expected = c.mechanism.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches)
    np.testing.assert_array_equal(found.tau, expected.tau)
