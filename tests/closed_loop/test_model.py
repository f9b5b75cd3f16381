"""Closed-loop mechanisms in general, on some that are not the 3-RPS."""

from __future__ import annotations

import pickle
from copy import deepcopy
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rps_pin import (
    ClosedLoopModel,
    ClosureError,
    InputError,
    LoopClosure,
    MechanismError,
    RPSRobot,
    SingularityError,
)
from rps_pin.numerics.linear_algebra import null_space
from tests import strategies
from tests.closed_loop import mechanisms
from tests.closed_loop.mechanisms import (
    FOUR_BAR,
    Bar,
    FourBar,
    build,
    closed_guess,
    derivative,
    every_mechanism,
    joint,
    link,
    loop_jacobian,
    rigid,
    robot,
    second_derivative,
    spherical,
    state,
    three_rps,
    values,
)

Array = NDArray[np.float64]

#: Crank angles, rates and accelerations.
CRANKS = [(angle, 3.0 - angle, 5.0 * angle - 2.0) for angle in np.linspace(-3, 3, 25)]

URDF = Path(__file__).resolve().parents[2] / "urdf"


# The planar four-bar against its closed form ------------------------------------------------------


@pytest.mark.parametrize("make", [rigid, spherical])
@pytest.mark.parametrize(("angle", "rate", "acceleration"), CRANKS)
def test_four_bar_follows_lagrange_newton_and_euler(
    make, angle: float, rate: float, acceleration: float
) -> None:
    mechanism = make()
    q = values(mechanism, FOUR_BAR.joint_values(angle))
    assert mechanism.loop_gap(q) < 1e-15

    rates = values(mechanism, FOUR_BAR.joint_rates(angle))
    v = mechanism.velocity(q, [rate])
    np.testing.assert_allclose(v, rates * rate, rtol=0, atol=1e-13)

    bend = derivative(lambda x: values(mechanism, FOUR_BAR.joint_rates(x)), angle)
    a = mechanism.acceleration(q, v, [acceleration])
    np.testing.assert_allclose(a, rates * acceleration + bend * rate**2, rtol=0, atol=1e-9)

    found = mechanism.inverse_dynamics(q, v, a)
    torque = FOUR_BAR.torque(angle, rate, acceleration)
    assert found.tau == pytest.approx([torque], rel=1e-10, abs=1e-10)
    # The force of frame b's side (the rocker) on frame a's side (the coupler), in world axes.
    force = FOUR_BAR.knee_force(angle, rate, acceleration)
    np.testing.assert_allclose(found.constraint_forces[[0, 2]], force, rtol=1e-9, atol=1e-9)
    # A plane problem, and redundant rows of least norm: nothing across, and no moments.
    np.testing.assert_allclose(np.delete(found.constraint_forces, [0, 2]), 0, rtol=0, atol=1e-10)
    assert found.residual < 1e-12


def test_rigid_closure_bears_what_a_point_and_a_knee_bear() -> None:
    """A bar welded in two: the closure's force and moment are the cut's, by free-body balance."""
    urdf = robot(
        link("arm", 1.0, "0.3 0 0", 0.02),
        link("load", 2.0, "0.1 0.2 0.05", 0.03),
        link("arm_end"),
        link("load_start"),
        joint("revolute", "base", "arm"),
        joint("floating", "base", "load"),
        joint("fixed", "arm", "arm_end", "0.5 0 0"),
        joint("fixed", "load", "load_start", "-0.1 0 0"),
    )
    closures = [LoopClosure("load_start", "arm_end", "rigid", name="weld")]
    mechanism = ClosedLoopModel.from_urdf(urdf, closures, ["arm_joint"])
    q = mechanism.close(pin.neutral(mechanism.model))
    still = np.zeros(mechanism.model.nv)
    found = mechanism.inverse_dynamics(q, still, still)
    # The arm holds the load: 2 kg, its centre of mass (0.2, 0.2, 0.05) from the weld.
    weight = 2.0 * mechanisms.GRAVITY
    np.testing.assert_allclose(found.constraint_forces[:3], [0, 0, weight], rtol=0, atol=1e-12)
    moment = -np.cross([0.2, 0.2, 0.05], [0, 0, -weight])
    np.testing.assert_allclose(found.constraint_forces[3:], moment, rtol=0, atol=1e-12)
    # About the joint's axis -y, lifting x: 1 kg at 0.3 m, 2 kg at 0.7 m.
    assert found.tau == pytest.approx([(0.3 + 2 * 0.7) * mechanisms.GRAVITY], rel=1e-13)


# Any mechanism against its own energy, and central differences ------------------------------------


def path(mechanism: ClosedLoopModel, q: Array, v: Array, t: float) -> Array:
    """A closed configuration at time t: the straight path through q, closed."""
    return mechanism.close(pin.integrate(mechanism.model, q, t * v))


@every_mechanism
def test_velocity_and_acceleration_are_those_of_closed_paths(make) -> None:
    mechanism = make()
    q, v, _ = state(mechanism)

    def moved(t: float) -> Array:
        return pin.difference(mechanism.model, q, path(mechanism, q, v, t))

    np.testing.assert_allclose(v, derivative(moved), rtol=0, atol=1e-9)
    bend = second_derivative(moved)
    a = mechanism.acceleration(q, v, bend[mechanism.actuated_indices])
    np.testing.assert_allclose(a, bend, rtol=0, atol=1e-7)


@every_mechanism
def test_actuators_do_the_work_that_the_energy_gains(make) -> None:
    """Along a closed path, whose velocities and energies come from differences alone."""
    mechanism = make()
    model = mechanism.model
    data = model.createData()
    q, v, _ = state(mechanism)

    def velocity(t: float) -> Array:
        now = path(mechanism, q, v, t)
        return derivative(lambda s: pin.difference(model, now, path(mechanism, q, v, t + s)))

    def energy(t: float) -> Array:
        return np.array(
            pin.computeMechanicalEnergy(model, data, path(mechanism, q, v, t), velocity(t))
        )

    acceleration = derivative(velocity, h=2e-3)
    found = mechanism.inverse_dynamics(q, v, acceleration)
    power = found.tau @ v[mechanism.actuated_indices]
    assert power == pytest.approx(float(derivative(energy, h=2e-3)), rel=1e-7, abs=1e-8)


@every_mechanism
def test_velocities_and_accelerations_keep_the_loops_closed(make) -> None:
    mechanism = make()
    for seed in range(5):
        q, v, a = state(mechanism, seed)
        errors = mechanism.loop_errors(q, v, a)
        np.testing.assert_allclose(errors.position, 0, rtol=0, atol=1e-12)
        np.testing.assert_allclose(errors.velocity, 0, rtol=0, atol=1e-12)
        np.testing.assert_allclose(errors.acceleration, 0, rtol=0, atol=1e-11)


@every_mechanism
def test_answers_satisfy_the_kkt_equations(make) -> None:
    """With a Jacobian from the frames, not from Pinocchio's constraint models."""
    mechanism = make()
    model = mechanism.model
    for seed in range(5):
        q, v, a = state(mechanism, seed)
        found = mechanism.inverse_dynamics(q, v, a)
        rest = pin.rnea(model, model.createData(), q, v, a)
        size = np.abs(rest).max()
        rest[mechanism.actuated_indices] -= found.tau
        rest -= loop_jacobian(mechanism, q).T @ found.constraint_forces
        np.testing.assert_allclose(rest, 0, rtol=0, atol=1e-12 * size)
        assert found.residual < 1e-12 * size


# Closing ------------------------------------------------------------------------------------------


@every_mechanism
def test_rough_guesses_close(make) -> None:
    mechanism = make()
    rng = np.random.default_rng(6)
    start = closed_guess(mechanism)
    for _ in range(20):
        step = rng.uniform(-0.3, 0.3, size=mechanism.model.nv)
        guess = pin.integrate(mechanism.model, start, step)
        found = mechanism.close(guess)
        assert np.abs(mechanism.loop_errors(found).position).max() <= 1e-12
        assert mechanism.loop_gap(found) <= 1e-12
        moved = np.abs(pin.difference(mechanism.model, guess, found)).max()
        assert moved < 1.5  # near the guess, not somewhere


@given(st.lists(strategies.floats(-3, 3), min_size=4, max_size=4))
def test_any_guess_closes_or_is_refused(angles: list[float]) -> None:
    mechanism = rigid()
    try:
        found = mechanism.close(angles)
    except ClosureError as error:
        assert error.gap > 1e-12
        assert "closure 'knee' stays open by" in str(error)
    else:
        assert mechanism.loop_gap(found) <= 1e-12


def test_axes_that_do_not_agree_are_told_from_points_that_do_not_meet() -> None:
    """A planar four-bar with its knee's axis in the plane: the axes cannot be parallel."""
    mechanism = ClosedLoopModel.load(URDF / "four_bar.yaml")
    across = LoopClosure(
        "coupler_tip", "rocker_tip", "revolute", axis=[0.0, 1.0, 0.0], axis_b=[0.0, 0.999, 0.02]
    )
    with pytest.raises(ClosureError, match=r"m between its points, 0\.0\d+ rad between its axes"):
        ClosedLoopModel(mechanism.model, [across], mechanism.actuated).close(mechanism.home)


def test_loop_that_cannot_close_is_named_with_its_gap() -> None:
    """Bars of 1.1 m across 1.5 m: at least 0.4 m stay open."""
    with pytest.raises(ClosureError, match=r"closure 'tips' stays open by 0\.4") as caught:
        mechanisms.wide_apart().close([0.2, 0.1, 3.0])
    assert 0.4 - 1e-12 <= caught.value.gap < 0.41


def test_worst_of_several_closures_is_named() -> None:
    robot_ = RPSRobot.from_preset("sokolov")
    q = robot_.state([0.4, 0, 0], [0, 0, 0], [0, 0, 0])[0]
    model = robot_.mechanism.model
    q[model.joints[model.getJointId("leg_2_prismatic")].idx_q] += 0.1
    gaps = robot_.mechanism.loop_errors(q).position
    assert np.linalg.norm(gaps[robot_.mechanism.rows("leg_2")]) == pytest.approx(0.1)
    assert robot_.mechanism.loop_gap(q) == pytest.approx(0.1)


def test_closed_configurations_stay_as_they_are() -> None:
    mechanism = spherical()
    q = closed_guess(mechanism)
    np.testing.assert_allclose(mechanism.close(q), q, rtol=0, atol=1e-14)


def test_quaternions_of_a_guess_may_have_any_length() -> None:
    mechanism = three_rps()
    q = closed_guess(mechanism)
    guess = q.copy()
    start = mechanism.model.joints[mechanism.model.getJointId("platform_free")].idx_q
    guess[start + 3 : start + 7] *= 3
    np.testing.assert_allclose(mechanism.close(guess), q, rtol=0, atol=1e-13)
    assert guess[start + 6] == 3 * q[start + 6]  # left as it was


def test_quaternion_without_length_is_no_orientation() -> None:
    mechanism = three_rps()
    with pytest.raises((InputError, ClosureError)):
        mechanism.close(np.zeros(13))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_mechanisms_of_any_size_close(scale: float) -> None:
    def bar(b: Bar) -> Bar:
        return Bar(b.length * scale, b.mass, b.along * scale, b.across * scale, b.inertia)

    small = FourBar(0.45 * scale, *map(bar, (FOUR_BAR.crank, FOUR_BAR.coupler, FOUR_BAR.rocker)))
    mechanism = small.spherical_mechanism()
    closed = values(mechanism, small.joint_values(1.0))
    found = mechanism.close(closed + np.array([0.1, -0.2, 0.1]))
    assert mechanism.loop_gap(found) <= 1e-12 * scale


# Condition and singularities ----------------------------------------------------------------------


@every_mechanism
def test_condition_is_that_of_the_scaled_passive_jacobian(make) -> None:
    """Angles times the characteristic length, which is the longest lever of a closure."""
    mechanism = make()
    model = mechanism.model
    q = closed_guess(mechanism)
    length = mechanism.characteristic_length
    J = loop_jacobian(mechanism, q)
    prismatic = [
        model.joints[model.getJointId(name)].idx_v for name in model.names if "prismatic" in name
    ]
    if model.existJointName("platform_free"):
        start = model.joints[model.getJointId("platform_free")].idx_v
        prismatic += [start, start + 1, start + 2]
    angular = np.setdiff1d(np.arange(model.nv), prismatic)
    J[:, angular] /= length
    start = 0
    for closure in mechanism.closures:
        J[start + 3 : start + closure.size] *= length
        start += closure.size
    passive = np.setdiff1d(np.arange(model.nv), mechanism.actuated_indices)
    expected = np.linalg.cond(J[:, passive])
    assert mechanism.condition(q) == pytest.approx(expected, rel=1e-10)


def test_characteristic_length_is_the_longest_lever() -> None:
    assert spherical().characteristic_length == FOUR_BAR.coupler.length
    assert three_rps().characteristic_length == 0.23  # h, as the robot asks
    assert FOUR_BAR.mechanism(characteristic_length=2.0).characteristic_length == 2.0


def test_condition_does_not_depend_on_the_unit_of_length() -> None:
    conditions = []
    for scale in (1.0, 1000.0):
        bars = [
            Bar(b.length * scale, b.mass, b.along, b.across, b.inertia)
            for b in (FOUR_BAR.crank, FOUR_BAR.coupler, FOUR_BAR.rocker)
        ]
        scaled = FourBar(0.45 * scale, *bars)
        mechanism = scaled.mechanism()
        conditions.append(mechanism.condition(values(mechanism, scaled.joint_values(1.0))))
    assert conditions[0] == pytest.approx(conditions[1], rel=1e-10)


def toggle(make: str) -> tuple[ClosedLoopModel, Array]:
    """Coupler and rocker in line: 0.3 m + 0.25 m from the crank's end to the rocker's joint."""
    bars = (FOUR_BAR.crank, Bar(0.3, 1, 0.1, 0, 0.01), Bar(0.25, 1, 0.1, 0, 0.01))
    stretched = FourBar(0.45, *bars)
    angle = np.arccos((0.2**2 + 0.45**2 - 0.55**2) / (2 * 0.2 * 0.45))
    towards = np.array([0.45 - 0.2 * np.cos(angle), -0.2 * np.sin(angle)])
    coupler = np.arctan2(towards[1], towards[0])
    rocker = coupler + np.pi
    mechanism = getattr(stretched, make)()
    joints = {
        "crank_joint": angle,
        "coupler_joint": coupler - angle,
        "rocker_joint": rocker,
        "knee_joint": rocker - coupler,
    }
    return mechanism, values(mechanism, joints)


@pytest.mark.parametrize("make", ["mechanism", "spherical_mechanism"])
def test_four_bar_in_toggle_is_singular(make: str) -> None:
    mechanism, q = toggle(make)
    assert mechanism.loop_gap(q) < 1e-15
    assert mechanism.condition(q) > 1e14
    still = np.zeros(mechanism.model.nv)
    with pytest.raises(SingularityError, match="condition number is") as caught:
        mechanism.inverse_dynamics(q, still, still)
    assert caught.value.condition > 1e14
    assert caught.value.limit == mechanism.max_condition
    with pytest.raises(SingularityError):
        mechanism.velocity(q, [1.0])
    with pytest.raises(SingularityError):
        mechanism.acceleration(q, still, [1.0])


@every_mechanism
def test_limit_of_the_condition_is_the_user_s(make) -> None:
    mechanism = make()
    q, v, a = state(mechanism)
    condition = mechanism.condition(q)
    mechanism.inverse_dynamics(q, v, a)
    for limit, refused in ((condition * 1.01, False), (condition * 0.99, True)):
        strict = ClosedLoopModel(
            mechanism.model,
            mechanism.closures,
            mechanism.actuated,
            characteristic_length=mechanism.characteristic_length,
            max_condition=limit,
        )
        if refused:
            with pytest.raises(SingularityError) as caught:
                strict.inverse_dynamics(q, v, a)
            assert caught.value.condition == pytest.approx(condition)
            assert caught.value.limit == limit
        else:
            np.testing.assert_array_equal(
                strict.inverse_dynamics(q, v, a).tau, mechanism.inverse_dynamics(q, v, a).tau
            )


# Actuation ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", ["mechanism", "spherical_mechanism"])
def test_two_actuators_of_a_four_bar_share_its_torque(make: str) -> None:
    """Of all pairs with t_1 w_1 + t_2 w_2 = power, that of least norm is along the rates."""
    mechanism = getattr(FOUR_BAR, make)(actuated=["crank_joint", "rocker_joint"])
    angle, rate = 1.0, 2.0
    q = values(mechanism, FOUR_BAR.joint_values(angle))
    rates = FOUR_BAR.joint_rates(angle)
    asked = rate * np.array([rates["crank_joint"], rates["rocker_joint"]])
    v = mechanism.velocity(q, asked)
    bend = derivative(lambda x: values(mechanism, FOUR_BAR.joint_rates(x)), angle)
    a = values(mechanism, rates) * 3.0 + bend * rate**2
    found = mechanism.inverse_dynamics(q, v, a)
    torque = FOUR_BAR.torque(angle, rate, 3.0)
    expected = torque * rate * asked / (asked @ asked)
    np.testing.assert_allclose(found.tau, expected, rtol=1e-9)
    assert found.residual < 1e-11
    assert found.unproduced is None


def test_redundant_actuators_must_agree_about_the_motion() -> None:
    mechanism = FOUR_BAR.mechanism(actuated=["crank_joint", "rocker_joint"])
    q = values(mechanism, FOUR_BAR.joint_values(1.0))
    rates = FOUR_BAR.joint_rates(1.0)
    asked = np.array([rates["crank_joint"], rates["rocker_joint"]])
    v = mechanism.velocity(q, asked)
    np.testing.assert_allclose(v, values(mechanism, rates), rtol=0, atol=1e-13)
    asked[1] += 0.1
    with pytest.raises(ClosureError, match="no motion of the mechanism has these 2") as caught:
        mechanism.velocity(q, asked)
    assert caught.value.gap > 1e-3
    with pytest.raises(ClosureError, match="no motion"):
        mechanism.acceleration(q, np.zeros(4), asked)


def test_fewer_actuators_than_mobility_do_not_determine_the_motion() -> None:
    mechanism = mechanisms.five_bar(actuated=["left_joint"])
    q = mechanism.close(mechanisms.guess(mechanism))
    assert mechanism.condition(q) > 1e12
    with pytest.raises(SingularityError):
        mechanism.velocity(q, [1.0])
    still = np.zeros(4)
    found = mechanism.inverse_dynamics(q, still, still)
    assert found.unproduced is not None
    assert found.residual < 1e-12
    assert "unproduced" in repr(found)
    # What is missing bears the weight in the motion that leaves the actuator at rest.
    motions = mechanism.allowed_motions(q)
    at_rest = motions @ null_space(motions[mechanism.actuated_indices])
    weight = mechanism.generalised_force(q, still, still)
    np.testing.assert_allclose(at_rest.T @ found.unproduced, at_rest.T @ weight, rtol=1e-10)


def test_more_passive_joints_than_rows_are_never_determined() -> None:
    robot_ = RPSRobot.from_preset("sokolov")
    two = ClosedLoopModel(
        robot_.mechanism.model, robot_.mechanism.closures, robot_.mechanism.actuated[:2]
    )
    q, v, a = robot_.state([0.4, 0, 0], [0, 0, 0], [0, 0, 0])
    assert two.condition(q) == np.inf
    with pytest.raises(SingularityError) as caught:
        two.velocity(q, [0.0, 0.0])
    assert caught.value.condition == np.inf
    assert two.inverse_dynamics(q, v, a).unproduced is not None


def test_open_chain_with_every_joint_driven_is_plain_rnea() -> None:
    """No closures: nothing is closed, and nothing is missing."""
    urdf = FOUR_BAR.urdf()
    names = [f"{name}_joint" for name in ("rocker", "crank", "coupler", "knee")]
    mechanism = ClosedLoopModel.from_urdf(urdf, [], names)
    rng = np.random.default_rng(7)
    q, v, a = rng.normal(size=(3, 4))
    found = mechanism.inverse_dynamics(q, v, a)
    model = mechanism.model
    expected = pin.rnea(model, model.createData(), q, v, a)
    np.testing.assert_allclose(found.tau, expected[mechanism.actuated_indices], rtol=1e-13)
    assert found.constraint_forces.shape == (0,)
    assert found.condition == 1.0
    assert mechanism.loop_gap(q) == 0.0
    np.testing.assert_array_equal(mechanism.close(q), q)


def test_forces_come_in_the_order_of_the_actuators() -> None:
    one = mechanisms.five_bar()
    other = mechanisms.five_bar(actuated=["right_joint", "left_joint"])
    q, v, a = state(one)
    tau = one.inverse_dynamics(q, v, a).tau
    np.testing.assert_allclose(other.inverse_dynamics(q, v, a).tau, tau[::-1], rtol=1e-12)
    np.testing.assert_allclose(other.velocity(q, v[other.actuated_indices]), v, rtol=1e-12)


def test_forces_of_the_square_way_come_in_that_order_too() -> None:
    one = three_rps()
    names = [one.actuated[i] for i in (2, 0, 1)]
    other = ClosedLoopModel(one.model, one.closures, names, characteristic_length=0.23)
    q, v, a = state(one)
    tau = one.inverse_dynamics(q, v, a).tau
    np.testing.assert_allclose(other.inverse_dynamics(q, v, a).tau, tau[[2, 0, 1]], rtol=1e-12)


def test_v_that_opens_the_loops_is_refused() -> None:
    mechanism = spherical()
    q = closed_guess(mechanism)
    with pytest.raises(ClosureError, match=r"v opens the loops at .* m/s") as caught:
        mechanism.acceleration(q, [1.0, 0.0, 0.0], [0.0])
    errors = mechanism.loop_errors(q, [1.0, 0.0, 0.0])
    assert caught.value.gap == pytest.approx(np.abs(errors.velocity).max())


# Arguments ----------------------------------------------------------------------------------------


@every_mechanism
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_refused_wherever_they_stand(make, bad: float) -> None:
    mechanism = make()
    good = state(mechanism)
    for which in range(3):
        for entry in range(good[which].size):
            arguments = [x.copy() for x in good]
            arguments[which][entry] = bad
            with pytest.raises(InputError, match="finite"):
                mechanism.inverse_dynamics(*arguments)
            with pytest.raises(InputError, match=f"{'qva'[which]} is not finite: entry {entry}"):
                mechanism.loop_errors(*arguments)
            with pytest.raises(InputError, match="finite"):
                mechanism.inverse_dynamics(*[x.tolist() for x in arguments])


@every_mechanism
def test_wrong_shapes_are_refused_by_name(make) -> None:
    mechanism = make()
    good = state(mechanism)
    for which, name in enumerate("qva"):
        for wrong in (
            good[which][:-1],
            np.append(good[which], 0.0),
            np.stack([good[which]] * 2),
            np.zeros(0),
            0.0,
            None,
            "q",
        ):
            arguments = [*good]
            arguments[which] = wrong
            with pytest.raises(InputError, match=f"^{name} "):
                mechanism.inverse_dynamics(*arguments)
            if wrong is None and name != "q":
                continue  # means zero
            with pytest.raises(InputError, match=f"^{name} "):
                mechanism.loop_errors(*arguments)


def test_arguments_of_the_other_functions_are_checked_and_named() -> None:
    mechanism = spherical()
    q = closed_guess(mechanism)
    for name, call in {
        "q": lambda: mechanism.condition([1.0]),
        "q_guess": lambda: mechanism.close([np.nan, 0, 0]),
        "v_actuated": lambda: mechanism.velocity(q, [1.0, 2.0]),
        "v": lambda: mechanism.acceleration(q, [1.0], [1.0]),
        "a_actuated": lambda: mechanism.acceleration(q, np.zeros(3), [np.inf]),
    }.items():
        with pytest.raises(InputError, match=f"^{name} "):
            call()


@every_mechanism
def test_lists_integers_single_precision_and_views_are_numbers_too(make) -> None:
    mechanism = make()
    good = state(mechanism)
    expected = mechanism.inverse_dynamics(*good).tau
    views = [np.repeat(x, 2)[::2] for x in good]
    columns = [np.stack([x, x], axis=-1)[:, 0] for x in good]
    for same in ([x.tolist() for x in good], [tuple(x) for x in good], views, columns):
        np.testing.assert_array_equal(mechanism.inverse_dynamics(*same).tau, expected)
    single = mechanism.inverse_dynamics(*[x.astype(np.float32) for x in good]).tau
    np.testing.assert_allclose(single, expected, rtol=1e-3, atol=1e-4)
    still = np.zeros(mechanism.model.nv)
    at_rest = mechanism.inverse_dynamics(good[0], still, still).tau
    found = mechanism.inverse_dynamics(good[0], still.astype(int), [0] * still.size).tau
    np.testing.assert_array_equal(found, at_rest)


@every_mechanism
def test_answers_are_not_overwritten_by_the_next_call(make) -> None:
    mechanism = make()
    first, second = state(mechanism, 0), state(mechanism, 1)

    def answers(q: Array, v: Array, a: Array) -> list[Array]:
        solved = mechanism.inverse_dynamics(q, v, a)
        return [
            solved.tau,
            solved.constraint_forces,
            *mechanism.loop_errors(q, v, a),
            mechanism.close(q),
            mechanism.velocity(q, v[mechanism.actuated_indices]),
            mechanism.acceleration(q, v, a[mechanism.actuated_indices]),
        ]

    kept = answers(*first)
    copies = [x.copy() for x in kept]
    answers(*second)
    for value, copy in zip(kept, copies, strict=True):
        np.testing.assert_array_equal(value, copy)


@every_mechanism
def test_condition_of_an_answer_is_that_of_its_own_configuration(make) -> None:
    """Computed when asked for, which may be after other calls."""
    mechanism = make()
    q, v, a = state(mechanism)
    solved = mechanism.inverse_dynamics(q, v, a)
    expected = mechanism.condition(q)
    other = mechanism.close(pin.integrate(mechanism.model, q, 0.05 * np.ones(v.size)))
    still = np.zeros(v.size)
    mechanism.inverse_dynamics(other, still, still)
    assert mechanism.condition(other) != pytest.approx(expected)
    assert solved.condition == pytest.approx(expected, rel=1e-12)


@every_mechanism
def test_arguments_are_not_changed(make) -> None:
    mechanism = make()
    good = state(mechanism)
    copies = [x.copy() for x in good]
    mechanism.inverse_dynamics(*good)
    mechanism.loop_errors(*good)
    mechanism.close(good[0])
    for value, copy in zip(good, copies, strict=True):
        np.testing.assert_array_equal(value, copy)


# Descriptions that do not hold together -----------------------------------------------------------


def test_unknown_frame_is_refused_with_those_there_are() -> None:
    with pytest.raises(MechanismError, match=r"no frame 'elbow'; there are: .*rocker_tip"):
        build(closures=[LoopClosure("knee", "elbow")])


@pytest.mark.parametrize("name", ["elbow_joint", "universe", "", "coupler_tip_joint"])
def test_unknown_joint_is_refused_with_those_there_are(name: str) -> None:
    with pytest.raises(
        MechanismError, match=f"no joint '{name}' to actuate; there are: "
    ) as caught:
        build(actuated=[name])
    joints = str(caught.value).split("there are: ")[1].split(", ")
    assert sorted(joints) == ["coupler_joint", "crank_joint", "knee_joint", "rocker_joint"]


def test_names_may_not_come_twice() -> None:
    with pytest.raises(MechanismError, match="actuated joint 'crank_joint' is named twice"):
        build(actuated=["crank_joint", "rocker_joint", "crank_joint"])
    with pytest.raises(MechanismError, match="closure 'knee = rocker_tip' is named twice"):
        build(closures=[LoopClosure("knee", "rocker_tip", kind) for kind in ("rigid", "spherical")])


def test_tree_without_joints_is_refused() -> None:
    with pytest.raises(MechanismError, match="'stone' has no joints: nothing can move"):
        ClosedLoopModel(named(pin.Model(), "stone"), [], [])


def named(model: pin.Model, name: str) -> pin.Model:
    model.name = name
    return model


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_characteristic_length_is_positive(bad: float) -> None:
    with pytest.raises(InputError, match="characteristic_length"):
        build(characteristic_length=bad)


@pytest.mark.parametrize("bad", [[0, 0, np.nan], [0, 0, np.inf], [0, -9.81], "down", None, 9.81])
def test_gravity_is_a_finite_vector(bad: object) -> None:
    with pytest.raises(InputError, match="gravity"):
        build(gravity=bad)


def test_gravity_is_the_user_s() -> None:
    np.testing.assert_array_equal(build().model.gravity.linear, [0, 0, -9.81])
    mechanism = build(gravity=(0, 0, 0))
    q = values(mechanism, FOUR_BAR.joint_values(1.0))
    still = np.zeros(4)
    np.testing.assert_allclose(mechanism.inverse_dynamics(q, still, still).tau, 0, atol=1e-15)


def test_description_is_kept() -> None:
    mechanism = build()
    assert mechanism.actuated == ("crank_joint",)
    assert [closure.name for closure in mechanism.closures] == ["knee = rocker_tip"]
    indices = mechanism.actuated_indices
    indices[:] = 99
    assert (mechanism.actuated_indices < 4).all()


def test_copies_work_on_their_own() -> None:
    mechanism = three_rps()
    q = closed_guess(mechanism)
    for twin in (pickle.loads(pickle.dumps(mechanism)), deepcopy(mechanism)):
        assert twin.actuated == mechanism.actuated
        assert twin.characteristic_length == mechanism.characteristic_length
        v = mechanism.velocity(q, [0.1, 0.2, -0.1])
        a = mechanism.acceleration(q, v, np.zeros(3))
        expected = mechanism.inverse_dynamics(q, v, a).tau
        assert np.array_equal(twin.inverse_dynamics(q, v, a).tau, expected)


@pytest.mark.parametrize("bad", [0.5, -1.0, np.nan])
def test_condition_limits_that_make_no_sense_are_refused(bad: float) -> None:
    with pytest.raises(InputError, match="max_condition"):
        build(max_condition=bad)


def test_one_actuated_joint_may_be_given_by_its_bare_name() -> None:
    assert build(actuated="crank_joint").actuated == ("crank_joint",)


def test_mimic_joints_of_a_pinocchio_model_are_refused() -> None:
    model = pin.Model()
    lead = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "lead")
    mimic = pin.JointModelMimic(model.joints[lead].extract(), 2.0, 0.0)
    model.addJoint(lead, mimic, pin.SE3.Identity(), "follower")
    with pytest.raises(MechanismError, match=r"joint 'follower' mimics .*give a JointCoupling"):
        ClosedLoopModel(model, [], [])
