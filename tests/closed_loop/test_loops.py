"""The gaps of the loops, their rates and their rows."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, LoopClosure, MechanismError
from tests.closed_loop import mechanisms
from tests.closed_loop.mechanisms import (
    FOUR_BAR,
    closed_guess,
    derivative,
    joint,
    link,
    robot,
    second_derivative,
    spherical,
    three_rps,
    values,
)

Array = NDArray[np.float64]


@pytest.mark.parametrize("make", [spherical, mechanisms.spatial_four_bar, three_rps])
def test_rates_of_open_gaps_are_their_derivatives(make) -> None:
    """Any configuration, any motion: the tree swings freely."""
    mechanism = make()
    model = mechanism.model
    rng = np.random.default_rng(4)
    q = pin.normalize(model, rng.normal(size=model.nq))
    v, a = rng.normal(size=(2, model.nv))

    def gap(t: float) -> Array:
        # To second order this is the motion with this velocity and acceleration.
        return mechanism.loop_errors(pin.integrate(model, q, v * t + a * t**2 / 2)).position

    errors = mechanism.loop_errors(q, v, a)
    np.testing.assert_allclose(errors.velocity, derivative(gap), rtol=0, atol=1e-9)
    np.testing.assert_allclose(errors.acceleration, second_derivative(gap), rtol=0, atol=1e-7)


def two_bodies() -> ClosedLoopModel:
    """Two free bodies, welded at odd places and orientations, and a turntable to drive."""
    return ClosedLoopModel.from_urdf(
        robot(
            link("one", 1.0, "0 0 0", 0.1),
            link("two", 1.0, "0 0 0", 0.1),
            link("one_end"),
            link("two_end"),
            joint("floating", "base", "one"),
            joint("floating", "base", "two"),
            joint("fixed", "one", "one_end", "0.1 0.2 0.3"),
            joint("fixed", "two", "two_end", "-0.3 0.2 0.1"),
        ),
        [LoopClosure("one_end", "two_end", "rigid", name="weld")],
        ["one_joint"],
    )


def test_rates_of_a_rigid_closure_are_its_gap_s_derivatives() -> None:
    """From a closed configuration, moving apart in every direction; turning together."""
    mechanism = two_bodies()
    model = mechanism.model
    rng = np.random.default_rng(5)
    q = mechanism.close(pin.normalize(model, rng.normal(size=model.nq)))
    apart, a = rng.normal(size=(2, model.nv))

    def gap(t: float, v: Array) -> Array:
        return mechanism.loop_errors(pin.integrate(model, q, v * t + a * t**2 / 2)).position

    errors = mechanism.loop_errors(q, apart, a)
    np.testing.assert_allclose(
        errors.velocity, derivative(lambda t: gap(t, apart)), rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        errors.acceleration[:3], second_derivative(lambda t: gap(t, apart))[:3], rtol=0, atol=1e-7
    )
    together = mechanism.velocity(q, rng.normal(size=6))
    errors = mechanism.loop_errors(q, together, a)
    np.testing.assert_allclose(
        errors.acceleration, second_derivative(lambda t: gap(t, together)), rtol=0, atol=1e-7
    )


def test_rates_are_zero_if_left_out() -> None:
    mechanism = spherical()
    errors = mechanism.loop_errors(closed_guess(mechanism) + 0.1)
    assert np.abs(errors.position).max() > 1e-3
    assert not errors.velocity.any()
    assert not errors.acceleration.any()


def test_rows_are_those_of_the_closures_in_order() -> None:
    mechanism = three_rps()
    assert mechanism.constraint_size == 9
    assert [mechanism.rows(f"leg_{i}") for i in (1, 2, 3)] == [
        slice(0, 3),
        slice(3, 6),
        slice(6, 9),
    ]
    with pytest.raises(MechanismError, match="no closure 'leg_4'; there are: leg_1, leg_2, leg_3"):
        mechanism.rows("leg_4")


def test_gap_of_a_rigid_closure_counts_its_angle_at_the_characteristic_length() -> None:
    mechanism = FOUR_BAR.mechanism(characteristic_length=0.7)
    q = values(mechanism, FOUR_BAR.joint_values(1.0))
    names = list(mechanism.model.names)[1:]
    q[names.index("knee_joint")] += 0.01
    assert mechanism.loop_gap(q) == pytest.approx(0.007, rel=1e-12)
