"""Steps one at a time: `simulate`, closed forms, order, and what is left after a refusal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel
from rps_pin.closed_loop import Stepper
from rps_pin.errors import ClosureError, InputError, RPSPinError, SingularityError
from tests.closed_loop.mechanisms import (
    FOUR_BAR,
    every_mechanism,
    joint,
    link,
    robot,
    state,
)

Array = NDArray[np.float64]
Make = Callable[[], ClosedLoopModel]

MASS = 1.7


def cart() -> ClosedLoopModel:
    """A mass on a rail across gravity: its motion is known in closed form."""
    urdf = robot(
        link("cart", MASS, inertia=0.1), joint("prismatic", "base", "cart", "0 0 0", "1 0 0")
    )
    return ClosedLoopModel.from_urdf(urdf, [], ["cart_joint"], gravity=(0, 0, 0))


def turning_four_bar() -> tuple[ClosedLoopModel, Array, Array]:
    mechanism = FOUR_BAR.spherical_mechanism()
    q, _, _ = state(mechanism)
    return mechanism, q, mechanism.velocity(q, [3.0])


def assert_state(found: Stepper, q: Array, v: Array, size: float) -> None:
    np.testing.assert_allclose(found.q, q, rtol=0, atol=size * max(1, np.abs(q).max()))
    np.testing.assert_allclose(found.v, v, rtol=0, atol=size * max(1, np.abs(v).max()))


# Beside simulate ----------------------------------------------------------------------------------


@every_mechanism
def test_steps_are_those_of_simulate(make: Make) -> None:
    mechanism = make()
    q, v, a = state(mechanism)
    tau = mechanism.inverse_dynamics(q, v, a).tau
    motion = mechanism.simulate(q, v, duration=0.02, step=1e-3, tau=tau)
    stepper = Stepper(mechanism, q, v)
    stepper.advance(tau, 0.02, steps=20)
    assert np.abs(motion.q[-1] - motion.q[0]).max() > 1e-3  # it moves at all
    assert_state(stepper, motion.q[-1], motion.v[-1], 1e-12)
    assert stepper.time == 0.02
    assert stepper.gap == pytest.approx(mechanism.loop_gap(stepper.q), abs=1e-15)
    assert stepper.gap < 1e-12


@every_mechanism
def test_forces_and_wrenches_that_change_are_those_of_simulate(make: Make) -> None:
    """As a controller's, held for a step; the wrench depends on time, place and speed."""
    mechanism = make()
    q, v, a = state(mechanism)
    frame = mechanism.model.frames[-1].name
    weight = mechanism.inverse_dynamics(q, v, a).tau
    rng = np.random.default_rng(1)
    forces = weight + rng.normal(size=(15, weight.size))

    def wrenches(t: float, q: Array, v: Array) -> dict[str, Array]:
        return {frame: np.array([np.sin(90 * t), q[0], -v[0], 0.1 * t, 0.0, -0.1 * v[-1]])}

    held = [*forces, forces[-1]]
    motion = mechanism.simulate(
        q,
        v,
        duration=15 * 2e-3,
        step=2e-3,
        controller=lambda t, *_: held[round(t / 2e-3)],
        wrenches=wrenches,
    )
    stepper = Stepper(mechanism, q, v, wrenches=wrenches)
    for k, tau in enumerate(forces):
        assert_state(stepper, motion.q[k], motion.v[k], 1e-12)
        assert stepper.time == pytest.approx(motion.time[k], abs=1e-15)
        stepper.advance(tau, 2e-3)
    assert_state(stepper, motion.q[-1], motion.v[-1], 1e-12)


@every_mechanism
def test_what_the_mechanism_is_asked_between_steps_does_not_matter(make: Make) -> None:
    """Its scratch memory is shared; the parting of its rows is the stepper's own."""
    mechanism = make()
    q, v, a = state(mechanism)
    tau = mechanism.inverse_dynamics(q, v, a).tau
    alone, among = Stepper(mechanism, q, v), Stepper(mechanism, q, v)
    alone.advance(tau, 0.02, steps=10)
    for _ in range(10):
        among.advance(tau, 2e-3)
        mechanism.inverse_dynamics(q, -v, 2 * a)
        mechanism.jacobian(q)
    assert_state(among, alone.q, alone.v, 1e-13)


# Closed forms, order, energy ----------------------------------------------------------------------


def test_a_cart_under_constant_forces_and_one_that_grows() -> None:
    """x'' = (F + g t) / m: a cubic, which order 4 meets exactly, if stages see their own times."""
    force, growth, x, v = 2.3, 70.0, 0.1, -0.4

    def wrenches(t: float, *_: Array) -> dict[str, list[float]]:
        return {"cart": [growth * t, 0.0, 0.0, 0.0, 0.0, 0.0]}

    stepper = Stepper(cart(), [x], [v], wrenches=wrenches)
    t = 0.0
    for duration, steps in ((0.1, 1), (0.05, 7), (0.3, 2)):
        stepper.advance([force], duration, steps)
        t += duration
        assert stepper.time == pytest.approx(t, rel=1e-15)
        there = x + v * t + force * t**2 / (2 * MASS) + growth * t**3 / (6 * MASS)
        speed = v + force * t / MASS + growth * t**2 / (2 * MASS)
        np.testing.assert_allclose([*stepper.q, *stepper.v], [there, speed], rtol=1e-13)


def test_the_error_falls_with_the_fourth_power_of_the_step() -> None:
    mechanism, q, v = turning_four_bar()

    def after(steps: int) -> Array:
        stepper = Stepper(mechanism, q, v)
        stepper.advance([0.7], 0.2, steps)
        return np.concatenate([stepper.q, stepper.v])

    best = after(512)
    errors = np.array([np.abs(after(steps) - best).max() for steps in (8, 16, 32)])
    orders = np.log2(errors[:-1] / errors[1:])
    assert np.abs(orders - 4).max() < 0.4
    assert errors[-1] > 1e-11  # above what rounding and the projection leave


@every_mechanism
def test_the_actuators_work_is_the_energy_gained(make: Make) -> None:
    """Constant forces do the work tau' (d - d_0) in single-coordinate actuators."""
    mechanism = make()
    q, v, a = state(mechanism)
    tau = mechanism.inverse_dynamics(q, v, a).tau + 0.5
    stepper = Stepper(mechanism, q, v)
    motion = mechanism.simulate(q, v, duration=0.05, step=1e-4, tau=tau)
    speeds = motion.v[:, mechanism.actuated_indices] @ tau
    work = np.sum(speeds[:-1] + speeds[1:]) / 2 * 1e-4  # error T h^2 / 12 (tau' v)''
    bend = np.abs(np.diff(speeds, 2)).max() / 1e-8
    stepper.advance(tau, 0.05, steps=100)
    gained = sum(mechanism.energy(stepper.q, stepper.v)) - sum(mechanism.energy(q, v))
    assert abs(gained - work) < 1e-8 * 0.05 / 12 * bend + 1e-8 * abs(work)


# What it keeps ------------------------------------------------------------------------------------


def test_states_are_new_arrays_and_arguments_stay_whole() -> None:
    mechanism, q, v = turning_four_bar()
    given, tau = (q.copy(), v.copy()), np.array([0.3])
    stepper = Stepper(mechanism, q, v)
    kept = stepper.q, stepper.v
    before = kept[0].copy(), kept[1].copy()
    stepper.advance(tau, 0.01, 3)
    tau[:] = np.nan  # the forces were copied
    for old, new in zip(kept, before, strict=True):
        np.testing.assert_array_equal(old, new)
    assert stepper.q is not kept[0]
    np.testing.assert_array_equal(q, given[0])
    np.testing.assert_array_equal(v, given[1])


def test_it_starts_at_rest_if_not_told() -> None:
    mechanism, q, _ = turning_four_bar()
    stepper = Stepper(mechanism, q)
    np.testing.assert_array_equal(stepper.v, 0.0)
    assert stepper.time == 0.0
    assert stepper.gap == pytest.approx(mechanism.loop_gap(stepper.q), abs=1e-15)


@pytest.mark.parametrize(
    ("tau", "duration", "steps", "kind"),
    [
        ([np.nan], 1e-3, 1, InputError),
        ([np.inf], 1e-3, 1, InputError),
        ([0.0, 1.0], 1e-3, 1, InputError),
        ("fast", 1e-3, 1, InputError),
        ([0.0], 0.0, 1, InputError),
        ([0.0], -1e-3, 1, InputError),
        ([0.0], np.nan, 1, InputError),
        ([0.0], np.inf, 1, InputError),
        ([0.0], 1e-3, 0, InputError),
        ([1e200], 1.0, 4, RPSPinError),
        ([1e12], 10.0, 5, (SingularityError, ClosureError)),
    ],
)
def test_what_is_refused_changes_nothing(tau: Any, duration: float, steps: int, kind: Any) -> None:
    mechanism, q, v = turning_four_bar()
    stepper, other = Stepper(mechanism, q, v), Stepper(mechanism, q, v)
    for each in (stepper, other):
        each.advance([0.2], 0.01, 4)
    before = stepper.q.copy(), stepper.v.copy(), stepper.gap, stepper.time
    with pytest.raises(kind):
        stepper.advance(tau, duration, steps)
    np.testing.assert_array_equal(stepper.q, before[0])
    np.testing.assert_array_equal(stepper.v, before[1])
    assert (stepper.gap, stepper.time) == before[2:]
    for each in (stepper, other):
        each.advance([0.2], 0.01, 4)
    assert_state(stepper, other.q, other.v, 1e-12)


def test_what_fails_in_the_middle_changes_nothing() -> None:
    """Of ten steps four are taken, and not kept."""
    mechanism, q, v = turning_four_bar()
    broken = False

    def wrenches(t: float, *_: Array) -> dict[str, Array]:
        if broken and t > 0.0141:
            raise ZeroDivisionError("the wind has broken")
        return {"crank": np.full(6, 0.1 * t)}

    stepper, other = (Stepper(mechanism, q, v, wrenches=wrenches) for _ in range(2))
    for each in (stepper, other):
        each.advance([0.2], 0.01, 4)
    before = stepper.q.copy(), stepper.v.copy(), stepper.gap, stepper.time
    broken = True
    with pytest.raises(ZeroDivisionError, match="the wind has broken"):
        stepper.advance([9.0], 0.01, 10)
    broken = False
    np.testing.assert_array_equal(stepper.q, before[0])
    np.testing.assert_array_equal(stepper.v, before[1])
    assert (stepper.gap, stepper.time) == before[2:]
    for each in (stepper, other):
        each.advance([0.2], 0.01, 4)
    assert_state(stepper, other.q, other.v, 1e-12)


def test_the_gap_is_that_of_now() -> None:
    mechanism, q, v = turning_four_bar()
    stepper, gaps = Stepper(mechanism, q, v), set()
    for _ in range(20):
        stepper.advance([0.3], 0.01)
        gaps.add(stepper.gap)
        assert stepper.gap == pytest.approx(mechanism.loop_gap(stepper.q), abs=1e-16)
    assert len(gaps) > 5  # rounding, anew at each step


def test_an_open_start_is_refused() -> None:
    mechanism, q, v = turning_four_bar()
    with pytest.raises(ClosureError, match="the loops are open by"):
        Stepper(mechanism, q + 1e-3, v)
    with pytest.raises(ClosureError, match="v opens the loops"):
        Stepper(mechanism, q, v + 0.1)
    with pytest.raises(InputError, match="q has shape"):
        Stepper(mechanism, q[:-1], v)
