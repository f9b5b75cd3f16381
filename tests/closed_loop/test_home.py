"""Closed homes, and open configurations that dynamics refuses."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, ClosureError, InputError, LoopClosure
from rps_pin.closed_loop import ForceDistribution
from tests.closed_loop import mechanisms
from tests.closed_loop.mechanisms import FOUR_BAR, closed_guess, joint, link, robot
from tests.closed_loop.random_mechanisms import EVERY_KIND, Case, case

Array = NDArray[np.float64]

every_kind = pytest.mark.parametrize("kind", EVERY_KIND)


# Home ---------------------------------------------------------------------------------------------


def bars() -> str:
    """A four-bar of the plane x-z whose neutral configuration is open by 0.2 m."""
    return robot(
        link("left", 1.0, "0 0 0.1", 0.01),
        link("top", 1.0, "0.2 0 0", 0.01),
        link("right", 1.0, "0 0 0.1", 0.01),
        link("top_tip"),
        link("right_tip"),
        joint("revolute", "base", "left"),
        joint("revolute", "left", "top", "0 0 0.2"),
        joint("revolute", "base", "right", "0.4 0 0"),
        joint("fixed", "top", "top_tip", "0.4 0 0"),
        joint("fixed", "right", "right_tip", "0 0 0.4"),
    )


def described(folder: Path, urdf: str, home: str = "") -> Path:
    (folder / "bars.urdf").write_text(urdf, "utf-8")
    path = folder / "bars.yaml"
    path.write_text(
        "urdf: bars.urdf\nactuated: [left_joint]\nclosures:\n"
        f"  - {{frame_a: top_tip, frame_b: right_tip, kind: spherical, name: tips}}\n{home}",
        "utf-8",
    )
    return path


def test_a_description_without_home_is_closed(tmp_path: Path) -> None:
    """It was left open by 0.2 m, where forces were 1e16 N."""
    mechanism = ClosedLoopModel.load(described(tmp_path, bars()))
    assert mechanism.loop_gap(pin.neutral(mechanism.model)) == pytest.approx(0.2)
    assert mechanism.loop_gap(mechanism.home) < 1e-12
    still = np.zeros(mechanism.model.nv)
    assert np.abs(mechanism.inverse_dynamics(mechanism.home, still, still).tau).max() < 100


def test_a_description_that_does_not_close_says_why(tmp_path: Path) -> None:
    apart = bars().replace('xyz="0.4 0 0"', 'xyz="1.4 0 0"', 1)
    for home in ("", "home: {left_joint: 0.3}\n"):
        with pytest.raises(ClosureError, match="closure 'tips' stays open by") as caught:
            ClosedLoopModel.load(described(tmp_path, apart, home))
        assert caught.value.gap > 0.1


def test_an_open_home_is_closed_when_the_mechanism_is_built() -> None:
    closed = closed_guess(mechanisms.spherical())
    mechanism = FOUR_BAR.spherical_mechanism(home=closed + 0.05)
    assert mechanism.loop_gap(closed + 0.05) > 1e-3
    assert mechanism.loop_gap(mechanism.home) < 1e-12
    assert 0 < np.abs(mechanism.home - closed).max() < 0.2


def test_a_closed_home_is_kept_as_it_is() -> None:
    closed = closed_guess(mechanisms.spherical())
    mechanism = FOUR_BAR.spherical_mechanism(home=closed)
    np.testing.assert_array_equal(mechanism.home, closed)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(mechanism)).home, closed)


def test_a_home_that_does_not_close_is_refused_at_once() -> None:
    apart = mechanisms.wide_apart()
    home = pin.neutral(apart.model)
    with pytest.raises(ClosureError, match=r"stays open by 0\.4 m"):
        ClosedLoopModel(apart.model, apart.closures, apart.actuated, home=home)


def test_without_a_home_the_neutral_configuration_is_closed_when_asked_for() -> None:
    apart = mechanisms.wide_apart()  # can be built, for a guess of the caller's
    with pytest.raises(ClosureError, match="no home was given, and for the neutral configuration"):
        _ = apart.home
    mechanism = ClosedLoopModel.from_urdf(
        bars(), [LoopClosure("top_tip", "right_tip")], ["left_joint"]
    )
    assert mechanism.loop_gap(mechanism.home) < 1e-12
    mechanism.home[:] = 0.0
    assert mechanism.loop_gap(mechanism.home) < 1e-12


def test_a_copy_starts_where_the_original_does() -> None:
    """Whether its home was asked for before or not."""
    mechanism = ClosedLoopModel.from_urdf(
        bars(), [LoopClosure("top_tip", "right_tip")], ["left_joint"]
    )
    before = mechanism.complete([0.3])
    home = mechanism.home
    again = pickle.loads(pickle.dumps(mechanism))
    np.testing.assert_array_equal(mechanism.complete([0.3]), before)
    np.testing.assert_array_equal(again.complete([0.3]), before)
    np.testing.assert_array_equal(again.home, home)


# Open configurations ------------------------------------------------------------------------------


def calls(c: Case, q: Array) -> dict[str, Callable[[], object]]:
    """All of dynamics that takes a closed configuration."""
    m, tau = c.mechanism, np.zeros(c.mechanism.actuated_indices.size)
    return {
        "inverse": lambda: m.inverse_dynamics(q, c.v, c.a),
        "forward": lambda: m.forward_dynamics(q, c.v, tau),
        "constraint": lambda: m.constraint_forces(q, c.v, c.a, tau),
        "mass": lambda: m.mass_matrix(q),
        "bias": lambda: m.bias(q, c.v),
        "gravity": lambda: m.gravity_forces(q),
        "inverse derivatives": lambda: m.inverse_dynamics_derivatives(q, c.v, c.a),
        "forward derivatives": lambda: m.forward_dynamics_derivatives(q, c.v, tau),
        "distribution": lambda: ForceDistribution(m).solve(q, c.v, c.a),
        "linearize": lambda: m.linearize(q, c.v, tau),
    }


def opened(c: Case, gap: float) -> Array:
    """A configuration off the closed one, open by about a gap, in characteristic lengths."""
    model, length = c.mechanism.model, c.mechanism.characteristic_length
    rng = np.random.default_rng(0)
    while True:
        away = rng.normal(size=model.nv) * c.mechanism.velocity_scale
        per_step = c.mechanism.loop_gap(pin.integrate(model, c.q, 1e-6 * away)) / 1e-6
        if per_step > 0.1 * length:  # most directions open the loops
            q: Array = pin.integrate(model, c.q, gap * length / per_step * away)
            return q


@every_kind
def test_dynamics_refuses_open_configurations_of_every_kind(kind: str) -> None:
    c = case(1, kinds=[kind])
    names = "|".join(re.escape(closure.name) for closure in c.mechanism.closures)
    for name, call in calls(c, opened(c, 2e-4)).items():
        with pytest.raises(ClosureError, match=rf"closure '({names})' stays open by") as caught:
            call()
        expected = 2e-4 * c.mechanism.characteristic_length
        assert caught.value.gap == pytest.approx(expected, rel=0.1), name


@every_kind
def test_dynamics_takes_closed_configurations_and_nearly_closed_ones(kind: str) -> None:
    """Those of `close`, and those a step of finite differences away."""
    c = case(1, kinds=[kind])
    for q in (c.q, c.mechanism.close(opened(c, 1e-2)), opened(c, 5e-5)):
        assert np.isfinite(c.mechanism.inverse_dynamics(q, c.v, c.a).tau).all()


@every_kind
def test_fast_gap_is_the_gap_to_second_order(kind: str) -> None:
    c = case(2, kinds=[kind])
    equations = c.mechanism.system.equations
    for gap in (9e-5, 1.1e-4):  # either side of the limit
        q = opened(c, gap)
        largest = c.mechanism.loop_gap(q) / c.mechanism.characteristic_length
        equations.jacobian(q)
        # Both parts of a gap add up in the fast one, which may be larger by a factor of sqrt(2).
        assert equations.is_open(q) or largest <= 1e-4
        assert not equations.is_open(q) or largest > 1e-4 / np.sqrt(2) - 1e-8


def test_a_configuration_that_is_not_finite_is_an_input_error() -> None:
    c = case(0, kinds=["spherical"])
    with pytest.raises(InputError, match="q is not finite"):
        c.mechanism.inverse_dynamics(np.nan * c.q, c.v, c.a)
