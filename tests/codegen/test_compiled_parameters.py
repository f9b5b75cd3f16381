"""Parameters of generated code against mechanisms that are built with those numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, ClosureError, InputError, MechanismError
from rps_pin.arrays import Array
from rps_pin.codegen.engine.applied import with_parameters
from rps_pin.codegen.engine.proof import ACCEPTED
from tests.closed_loop import mechanisms
from tests.closed_loop.random_mechanisms import case
from tests.codegen.engines import ALL, CALLS, QUICK, difference, states
from tests.worst import worst


class Given:
    """An engine that is called with parameters."""

    def __init__(self, engine: object, values: Array) -> None:
        self._engine, self._values = engine, values

    def __getattr__(self, name: str) -> object:
        method = getattr(self._engine, name)
        return lambda *given, **options: method(*given, parameters=self._values, **options)


def moved(nominal: Array, seed: int) -> Array:
    """Numbers some percent from the nominal ones, and some thousandths from zero."""
    rng = np.random.default_rng(seed)
    size = np.where(nominal, 0.05 * np.abs(nominal), 2e-3)
    return nominal + size * rng.uniform(0.2, 1.0, size=nominal.size)


def check(exact: ClosedLoopModel, groups: Sequence[str], calls: Sequence[str] = ALL) -> None:
    fast = exact.compile(compiler=QUICK, parameters=groups, functions=["dynamics"])
    differences, count = {}, 0
    for seed in range(2):
        values = moved(fast.nominal_parameters, seed)
        other = with_parameters(exact, groups, values)
        other._start = other._home = other.close(exact.home, within_limits=False)
        changed = Given(fast, values)
        for s in states(other, 2, seed, 0.05):
            for group in calls:
                for name, call in CALLS[group].items():
                    if name == "condition":
                        continue  # of attributes, below
                    error = difference(call(changed, s), call(other, s))
                    differences[name] = worst(error, differences.get(name, 0.0))
                    count += 1
            forces = fast.inverse_dynamics(s.q, s.v, s.a, parameters=values)
            assert difference(forces.condition, other.condition(s.q)) <= ACCEPTED
    bad = {name: error for name, error in differences.items() if not error <= ACCEPTED}
    assert not bad, bad
    assert count > 40
    # Nominal numbers, given or not, are those of the mechanism.
    s = next(states(exact, 1, spread=0.05))
    wanted = exact.forward_dynamics(s.q, s.v, s.tau)
    assert difference(fast.forward_dynamics(s.q, s.v, s.tau), wanted) <= ACCEPTED
    nominal = fast.nominal_parameters
    found = fast.forward_dynamics(s.q, s.v, s.tau, parameters=nominal)
    assert difference(found, wanted) <= ACCEPTED


@pytest.mark.parametrize(
    "groups",
    [
        ["gravity"],
        ["inertia:left_arm_joint", "mass:right_joint"],
        ["payload:left_tip"],
    ],
    ids=" ".join,
)
def test_every_group(groups: list[str]) -> None:
    exact = mechanisms.five_bar()
    check(mechanisms.five_bar(home=exact.close(mechanisms.guess(exact))), groups)


def test_lengths_and_directions() -> None:
    """No row is redundant: the loop closes with other lengths too."""
    rough = mechanisms.spatial_four_bar()
    exact = mechanisms.spatial_four_bar(home=rough.close(mechanisms.guess(rough)))
    check(exact, ["placement:rocker_joint", "closure:ball"])


def test_many_at_once_of_a_random_mechanism() -> None:
    """With closures along axes."""
    c = case(3, kinds=["cylindrical", "universal"])
    model = c.mechanism.model
    groups = [
        "gravity",
        f"inertia:{model.names[1]}",
        f"mass:{model.names[3]}",
        "payload:body_2",
    ]
    check(c.mechanism, groups, ("dynamics", "kinematics", "forces"))


def five_bar() -> ClosedLoopModel:
    rough = mechanisms.five_bar()
    return mechanisms.five_bar(home=rough.close(mechanisms.guess(rough)))


def test_each_sample_has_its_own_numbers() -> None:
    """And a batch of them broadcasts with states."""
    exact = five_bar()
    groups = ["gravity", "mass:left_joint"]
    fast = exact.compile(compiler=QUICK, parameters=groups, functions=["dynamics"])
    assert fast.parameters == ("gravity[0]", "gravity[1]", "gravity[2]", "mass:left_joint")
    np.testing.assert_array_equal(fast.nominal_parameters, [0, 0, -9.81, 1.0])
    s = next(states(exact))
    values = np.array([[0, 0, -9.81, 1.0], [0, 0, -1.62, 1.0], [1, 2, 3, 4.0]])
    found = fast.inverse_dynamics(s.q, s.v, s.a, parameters=values)
    assert found.tau.shape == (3, 2)
    for tau, condition, one in zip(found.tau, found.condition, values, strict=True):
        model = exact.model.copy()
        model.gravity.linear = one[:3]
        body = model.inertias[1]
        model.inertias[1] = pin.Inertia(one[3], body.lever, body.inertia * one[3] / body.mass)
        other = ClosedLoopModel(model, exact.closures, exact.actuated)
        assert difference(tau, other.inverse_dynamics(s.q, s.v, s.a).tau) <= ACCEPTED
        assert difference(condition, other.condition(s.q)) <= ACCEPTED
    assert fast.mass_matrix(np.array([[s.q]] * 2), parameters=values).shape == (2, 3, 2, 2)


def test_samples_that_the_pinocchio_engine_answers_have_these_numbers_too() -> None:
    exact = five_bar()
    groups = ["closure:tips"]
    fast = exact.compile(compiler=QUICK, parameters=groups, functions=["dynamics"])
    s = next(states(exact))
    values = np.zeros(12)
    values[0] = 0.01  # opens s.q
    with pytest.raises(ClosureError, match=r"stays open by 0.01\d* m"):
        fast.inverse_dynamics(s.q, s.v, s.a, parameters=values)
    closed = fast.project(s.q, parameters=values)
    assert fast.loop_gap(closed, parameters=values) <= 1e-12
    assert fast.loop_gap(closed) > 1e-3
    near = fast.close(s.q, parameters=values)
    assert fast.loop_gap(near, parameters=values) <= 1e-12
    completed = fast.complete(s.q[exact.actuated_indices], s.q, parameters=values)
    assert fast.loop_gap(completed, parameters=values) <= 1e-12
    np.testing.assert_allclose(
        completed[exact.actuated_indices], s.q[exact.actuated_indices], rtol=0, atol=1e-15
    )
    by_joint = fast.complete({"left_arm_joint": s.q[1]}, s.q, parameters=values)
    assert fast.loop_gap(by_joint, parameters=values) <= 1e-12


def test_numbers_by_name() -> None:
    fast = five_bar().compile(compiler=QUICK, parameters="gravity", functions="dynamics")
    np.testing.assert_array_equal(fast.parameter_values({"gravity[2]": -1.62}), [0, 0, -1.62])
    np.testing.assert_array_equal(fast.parameter_values({"gravity": [1, 2, 3]}), [1, 2, 3])
    np.testing.assert_array_equal(fast.nominal_parameters, [0, 0, -9.81])
    with pytest.raises(InputError, match="gravity"):
        fast.parameter_values({"gravty": 1.0})


def test_a_simulation_with_other_numbers() -> None:
    """On the moon a mechanism swings slower."""
    exact = five_bar()
    fast = exact.compile(compiler=QUICK, parameters=["gravity"], functions=["dynamics"])
    moon = np.array([0.0, 0.0, -1.62])
    other = with_parameters(exact, ["gravity"], moon)
    options = {"duration": 0.15, "step": 1e-3, "forces": True}
    found = fast.simulate(exact.home, parameters=moon, **options)
    wanted = other.simulate(exact.home, **options)
    for name in ("q", "v", "a", "kinetic", "potential", "work", "constraint_forces"):
        assert difference(getattr(found, name), getattr(wanted, name)) <= 1e-9, name
    adaptive = fast.simulate(exact.home, parameters=moon, duration=0.05, method="adaptive")
    assert difference(adaptive.q[-1], found.q[50]) <= 1e-8
    with pytest.raises(InputError, match="parameters"):
        fast.simulate(exact.home, parameters=[moon, moon], **options)


@pytest.mark.parametrize(
    ("groups", "words"),
    [
        (["gravty"], "gravity"),
        (["mass:left"], "left_joint"),
        (["closure:tip"], "tips"),
        (["payload:nowhere"], "nowhere"),
        (["inertia"], "inertia"),
        (["gravity", "gravity"], "gravity"),
        ([1], "1"),
    ],
)
def test_groups_that_are_not_there(groups: list[str], words: str) -> None:
    with pytest.raises((InputError, MechanismError), match=words):
        five_bar().compile(compiler=QUICK, parameters=groups)


def test_wrong_numbers() -> None:
    fast = five_bar().compile(compiler=QUICK, parameters=["gravity"], functions=["dynamics"])
    s = next(states(fast.mechanism))
    for wrong in ([0.0, 1.0], 1.0, ["a", "b", "c"], [[0.0] * 4]):
        with pytest.raises(InputError, match="parameters"):
            fast.forward_dynamics(s.q, s.v, s.tau, parameters=wrong)
    with pytest.raises(InputError, match=r"parameters is not finite: entry 2 is nan"):
        fast.forward_dynamics(s.q, s.v, s.tau, parameters=[0.0, 0.0, np.nan])
