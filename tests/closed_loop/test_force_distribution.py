"""Forces within limits: optimality, SciPy's SLSQP on the same problem, statics by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog, minimize

from rps_pin import (
    ClosedLoopModel,
    InfeasibleError,
    InputError,
    LoopClosure,
    MechanismError,
    RPSRobot,
)
from rps_pin.closed_loop.dynamics.force_bounds import ForceBound, friction_pyramid
from rps_pin.closed_loop.dynamics.force_distribution import DistributedForces, ForceDistribution
from tests.closed_loop import mechanisms
from tests.closed_loop.mechanisms import GRAVITY, State, joint, link, robot

Array = NDArray[np.float64]

FIVE = ["left_joint", "left_arm_joint", "right_joint", "right_arm_joint"]


def five_bar(actuators: int) -> tuple[ClosedLoopModel, State]:
    mechanism = mechanisms.five_bar(actuated=FIVE[:actuators])
    return mechanism, mechanisms.state(mechanisms.five_bar())


def four_bar() -> tuple[ClosedLoopModel, State]:
    """Six rows of rank 3; two actuators for one motion."""
    mechanism = mechanisms.FOUR_BAR.mechanism(actuated=["crank_joint", "rocker_joint"])
    return mechanism, mechanisms.state(mechanisms.rigid())


def three_rps() -> tuple[ClosedLoopModel, State]:
    """Prismatic and revolute actuators together: six for three motions."""
    plain = RPSRobot.from_preset("sokolov").mechanism
    hinges = [name for name in list(plain.model.names)[1:] if name.endswith("_revolute")]
    mechanism = ClosedLoopModel(plain.model, plain.closures, [*plain.actuated, *hinges])
    return mechanism, mechanisms.state(plain)


CASES: dict[str, Callable[[], tuple[ClosedLoopModel, State]]] = {
    "five-bar, 3": lambda: five_bar(3),
    "five-bar, 4": lambda: five_bar(4),
    "four-bar": four_bar,
    "3-RPS": three_rps,
}
every_case = pytest.mark.parametrize("case", CASES)


def equations(mechanism: ClosedLoopModel, state: State) -> tuple[Array, Array]:
    """[S' J'] and f of S' tau + J' lambda = f."""
    selection = np.eye(mechanism.model.nv)[mechanism.actuated_indices]
    force = mechanism.generalised_force(*state)
    return np.hstack([selection.T, mechanism.jacobian(state[0]).T]), force


def check_equations(mechanism: ClosedLoopModel, state: State, found: DistributedForces) -> None:
    matrix, force = equations(mechanism, state)
    rest = force - matrix @ np.concatenate([found.tau, found.constraint_forces])
    assert np.linalg.norm(rest) <= 1e-11 * np.linalg.norm(force)
    assert found.residual == pytest.approx(np.linalg.norm(rest), abs=1e-12 * np.linalg.norm(force))


def check_optimal(distribution: ForceDistribution, state: State, found: DistributedForces) -> None:
    """W^2 tau is balanced by what the motions feel and by torque limits of the right sign."""
    mechanism, tau = distribution.mechanism, found.tau
    own = mechanism.allowed_motions(state[0])[mechanism.actuated_indices]
    gradient = distribution.weights**2 * tau
    size = 1e-9 * np.abs(gradient).max()
    span = np.abs(tau).max()
    at_upper = np.abs(tau - distribution.upper) < 1e-9 * span
    at_lower = np.abs(tau - distribution.lower) < 1e-9 * span
    free = ~(at_upper | at_lower)
    through, *_ = np.linalg.lstsq(own[free], gradient[free], rcond=None)
    rest = gradient - own @ through  # minus the multipliers of the limits
    np.testing.assert_allclose(rest[free], 0, atol=size)
    assert (rest[at_upper] <= size).all()
    assert (rest[at_lower] >= -size).all()
    assert (tau <= distribution.upper + 1e-9 * span).all()
    assert (tau >= distribution.lower - 1e-9 * span).all()


@every_case
@pytest.mark.parametrize("weighted", [False, True])
def test_without_limits_the_equations_hold_at_least_effort(case: str, weighted: bool) -> None:
    mechanism, state = CASES[case]()
    weights = np.linspace(0.5, 2, len(mechanism.actuated)) if weighted else None
    distribution = ForceDistribution(mechanism, weights=weights)
    found = distribution.solve(*state)
    check_equations(mechanism, state, found)
    check_optimal(distribution, state, found)
    assert found.effort == pytest.approx(np.linalg.norm(distribution.weights * found.tau))
    assert found.at_limit == () and found.iterations == 0


@every_case
def test_within_torque_limits(case: str) -> None:
    """One limit after another is tightened to half of what the actuator did."""
    mechanism, state = CASES[case]()
    free = ForceDistribution(mechanism).solve(*state)
    limited = 0
    for i in range(len(mechanism.actuated)):
        limits = np.full(len(mechanism.actuated), np.inf)
        limits[i] = abs(free.tau[i]) / 2
        distribution = ForceDistribution(mechanism, torque_limits=limits)
        try:
            found = distribution.solve(*state)
        except InfeasibleError:
            assert not possible(mechanism, state, -limits, limits)
            continue
        limited += 1
        check_equations(mechanism, state, found)
        check_optimal(distribution, state, found)
        assert found.at_limit == (f"actuator {mechanism.actuated[i]!r}",)
        assert found.effort > free.effort
    assert limited


def possible(mechanism: ClosedLoopModel, state: State, lower: Array, upper: Array) -> bool:
    matrix, force = equations(mechanism, state)
    rows = np.linalg.norm(matrix, axis=1)
    free = [(None, None)] * mechanism.constraint_size
    answer = linprog(
        np.zeros(matrix.shape[1]),
        A_eq=matrix / rows[:, None],
        b_eq=force / rows,
        bounds=[*zip(lower, upper, strict=True), *free],
    )
    return bool(answer.status == 0)


@pytest.mark.filterwarnings("ignore:Values in x were outside bounds:RuntimeWarning")  # of SLSQP
@pytest.mark.parametrize("seed", range(25))
def test_random_limits_and_bounds_against_slsqp(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mechanism, state = five_bar(3 + seed % 2)
    na = len(mechanism.actuated)
    upper, lower = rng.uniform(0.5, 4, na), -rng.uniform(0.5, 4, na)
    bound = ForceBound("tips", direction=rng.normal(size=3), lower=-1, upper=rng.uniform(-0.5, 2))
    preferred = rng.normal(size=na)
    weights = rng.uniform(0.5, 2, na)
    distribution = ForceDistribution(
        mechanism, weights=weights, torque_limits=(lower, upper), bounds=[bound]
    )
    matrix, force = equations(mechanism, state)
    direction = np.concatenate([np.zeros(na), bound.combination(3)])
    both = [*zip(lower, upper, strict=True), *[(None, None)] * 3]
    # The loop's row across its plane is redundant: its force costs nothing in the peer's problem.
    peer = minimize(
        lambda x: np.sum((weights * (x[:na] - preferred)) ** 2) / 2,
        np.zeros(matrix.shape[1]),
        jac=lambda x: np.concatenate([weights**2 * (x[:na] - preferred), np.zeros(3)]),
        bounds=both,
        constraints=[
            {"type": "eq", "fun": lambda x: matrix @ x - force, "jac": lambda _: matrix},
            {"type": "ineq", "fun": lambda x: bound.upper - direction @ x},
            {"type": "ineq", "fun": lambda x: direction @ x - bound.lower},
        ],
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 300},
    )
    try:
        found = distribution.solve(*state, preferred=preferred)
    except InfeasibleError:
        assert not peer.success
        return
    check_equations(mechanism, state, found)
    assert peer.success
    np.testing.assert_allclose(found.tau, peer.x[:na], rtol=0, atol=2e-6)
    value = bound.combination(3) @ found.constraint_forces
    assert bound.lower - 1e-8 <= value <= bound.upper + 1e-8


def test_a_path_warm_started_is_what_it_is_cold() -> None:
    plain = mechanisms.five_bar()
    mechanism, _ = five_bar(4)
    bounds = [ForceBound("tips", row=0, lower=-0.8, upper=0.8)]
    limits = [4.0, 0.8, 4.0, 0.8]
    warm = ForceDistribution(mechanism, torque_limits=limits, bounds=bounds)
    q, solved, held = mechanisms.closed_guess(plain), 0, set()
    for step in range(1000):
        phase = 2 * np.pi * step / 500
        v = plain.velocity(q, 0.5 * np.array([np.cos(phase), np.sin(2 * phase)]))
        a = plain.acceleration(q, v, [np.sin(3 * phase), np.cos(phase)])
        found = warm.solve(q, v, a)
        check_equations(mechanism, (q, v, a), found)
        solved += found.iterations > 0
        held.add(found.at_limit)
        if step % 25 == 0:
            cold = ForceDistribution(mechanism, torque_limits=limits, bounds=bounds)
            expected = cold.solve(q, v, a)
            np.testing.assert_allclose(found.tau, expected.tau, rtol=0, atol=1e-9)
            assert found.at_limit == expected.at_limit
        q = plain.close(pin.integrate(plain.model, q, 5e-3 * v))
    assert len(held) > 2  # limits came and went
    assert 0 < solved < 100  # ProxQP was needed where they did


def test_reset_makes_the_next_call_a_first_one() -> None:
    mechanism, state = five_bar(4)
    distribution = ForceDistribution(mechanism, torque_limits=[4, 0.6, 9, 9])
    first, second = distribution.solve(*state), distribution.solve(*state)
    distribution.reset()
    third = distribution.solve(*state)
    assert first.iterations == third.iterations > second.iterations == 0
    np.testing.assert_allclose(second.tau, first.tau, rtol=1e-12)


# Redundant rows, and bounds on what they carry ----------------------------------------------------


def test_bounds_on_redundant_rows_cost_no_effort() -> None:
    """The five-bar's closure carries a force across its plane, which no motion feels."""
    mechanism, state = five_bar(4)
    free = ForceDistribution(mechanism).solve(*state)
    bound = ForceBound("tips", row=1, lower=0.7)
    found = ForceDistribution(mechanism, bounds=[bound]).solve(*state)
    check_equations(mechanism, state, found)
    assert free.constraint_forces[1] == pytest.approx(0, abs=1e-12)
    assert found.constraint_forces[1] == pytest.approx(0.7, rel=1e-9)
    np.testing.assert_allclose(found.tau, free.tau, rtol=1e-10)


def test_what_redundant_rows_weigh_shifts_effort_by_less_than_a_hundred_millionth() -> None:
    """A bound that effort or a redundant row can meet: the row does, but for its small weight."""
    mechanism, state = five_bar(4)
    free = ForceDistribution(mechanism).solve(*state)
    direction = np.array([1.0, 1.0, 0.0])
    bound = ForceBound("tips", direction=direction, lower=5.0)
    found = ForceDistribution(mechanism, bounds=[bound]).solve(*state)
    check_equations(mechanism, state, found)
    assert direction @ found.constraint_forces == pytest.approx(5.0, rel=1e-9)
    np.testing.assert_allclose(found.tau, free.tau, rtol=1e-6)
    assert found.effort == pytest.approx(free.effort, rel=1e-8)


# Statics by hand ----------------------------------------------------------------------------------


def hanging() -> ClosedLoopModel:
    """2 kg on a vertical slide, hung from a rod 0.5 m long."""
    urdf = robot(
        link("mass", 2.0, "0 0 0", 0.01),
        link("ceiling"),
        joint("prismatic", "base", "mass", axis="0 0 1"),
        joint("fixed", "base", "ceiling", "0 0 0.5"),
    )
    rod = LoopClosure("mass", "ceiling", "distance", name="rod", distance=0.5)
    return ClosedLoopModel.from_urdf(urdf, [rod], ["mass_joint"])


@pytest.mark.parametrize(
    ("lower", "upper", "push", "tension"),
    [
        (-np.inf, np.inf, 0.0, 2 * GRAVITY),
        (-np.inf, 5.0, 0.0, 5.0),  # a weak rod: the actuator carries the rest
        (0.0, np.inf, 30.0, 0.0),  # pushed up: a rod that only pulls is slack
        (-np.inf, np.inf, 30.0, 2 * GRAVITY - 30),
    ],
)
def test_a_rod_that_may_only_pull(lower: float, upper: float, push: float, tension: float) -> None:
    mechanism = hanging()
    bound = ForceBound("rod", row=0, lower=lower, upper=upper)
    found = ForceDistribution(mechanism, bounds=[bound]).solve(
        [0.0], [0.0], [0.0], wrenches={"mass": [0, 0, push, 0, 0, 0]}
    )
    assert found.constraint_forces == pytest.approx([tension], abs=1e-9)
    assert found.tau == pytest.approx([2 * GRAVITY - push - tension], abs=1e-9)


def table() -> ClosedLoopModel:
    """A floating 10 kg table, 1 x 1 m, its centre of mass 0.3 m up, on four points; a small arm."""
    corners = {"a": "0.5 0.5 0", "b": "-0.5 0.5 0", "c": "-0.5 -0.5 0", "d": "0.5 -0.5 0"}
    urdf = robot(
        link("table", 10.0, "0 0 0.3", 0.5),
        joint("floating", "base", "table"),
        link("arm", 1e-6, "0 0 0.1", 1e-9),
        joint("revolute", "table", "arm", "0 0 0.5"),
        *(link(f"foot_{name}") + link(f"ground_{name}") for name in corners),
        *(joint("fixed", "table", f"foot_{name}", xyz) for name, xyz in corners.items()),
        *(joint("fixed", "base", f"ground_{name}", xyz) for name, xyz in corners.items()),
    )
    feet = [LoopClosure(f"foot_{name}", f"ground_{name}", name=name) for name in corners]
    return ClosedLoopModel.from_urdf(urdf, feet, ["arm_joint"], characteristic_length=1.0)


TABLE_WEIGHT = (10.0 + 1e-6) * GRAVITY


def pushed_table(friction: float, force: Array, height: float) -> DistributedForces:
    mechanism = table()
    bounds = [bound for name in "abcd" for bound in friction_pyramid(name, friction)]
    moment = np.cross([0.0, 0.0, height], force)
    return ForceDistribution(mechanism, bounds=bounds).solve(
        mechanism.home, np.zeros(7), np.zeros(7), wrenches={"table": np.append(force, moment)}
    )


def test_a_table_at_rest_stands_on_all_feet() -> None:
    found = pushed_table(0.5, np.zeros(3), 0.0)
    np.testing.assert_allclose(
        found.constraint_forces.reshape(4, 3), [[0, 0, TABLE_WEIGHT / 4]] * 4, atol=1e-5
    )


@pytest.mark.parametrize("angle", [0.0, np.pi / 4])
def test_a_table_slides_when_pushed_beyond_its_friction(angle: float) -> None:
    """Edges of the pyramid touch the cone; between them, it holds cos 45 degrees of it."""
    held = 0.5 * TABLE_WEIGHT * (1 if angle == 0 else np.cos(np.pi / 4))
    push = held * np.array([np.cos(angle), np.sin(angle), 0.0])
    found = pushed_table(0.5, 0.999 * push, 0.0)
    forces = found.constraint_forces.reshape(4, 3)
    np.testing.assert_allclose(forces.sum(axis=0)[:2], -0.999 * push[:2], atol=1e-8)
    across = np.abs(forces[:, 0]) + np.abs(forces[:, 1])  # the pyramid's edges are along x and y
    assert (across <= 0.5 * forces[:, 2] + 1e-6).all()
    with pytest.raises(InfeasibleError, match=r"friction, face"):
        pushed_table(0.5, 1.001 * push, 0.0)


def test_a_table_tips_when_pushed_too_high() -> None:
    """Moments about an edge: force times height is at most weight times half the side."""
    held = TABLE_WEIGHT * 0.5 / 0.8
    found = pushed_table(2.0, np.array([0.999 * held, 0, 0]), 0.8)
    assert found.constraint_forces.reshape(4, 3)[[1, 2], 2] == pytest.approx(
        [0.001 * TABLE_WEIGHT / 4] * 2, rel=0.05, abs=TABLE_WEIGHT * 1e-3
    )
    with pytest.raises(InfeasibleError):
        pushed_table(2.0, np.array([1.001 * held, 0, 0]), 0.8)


# What cannot be -----------------------------------------------------------------------------------


def test_limits_too_tight_are_named_with_how_far_they_would_have_to_give() -> None:
    """The least sum of excesses, found once more by a linear program on the full equations."""
    mechanism, state = five_bar(4)
    limits = np.array([0.1, 0.1, 0.2, 0.1])
    with pytest.raises(InfeasibleError, match="no forces within the limits: actuator") as caught:
        ForceDistribution(mechanism, torque_limits=limits).solve(*state)
    violations = caught.value.violations
    matrix, force = equations(mechanism, state)
    nc = mechanism.constraint_size
    cost = np.concatenate([np.zeros(4 + nc), np.ones(4)])
    slack = np.hstack([np.eye(4), np.zeros((4, nc)), -np.eye(4)])
    mirrored = np.hstack([-np.eye(4), np.zeros((4, nc)), -np.eye(4)])
    peer = linprog(
        cost,
        A_eq=np.hstack([matrix, np.zeros((len(force), 4))]),
        b_eq=force,
        A_ub=np.vstack([slack, mirrored]),
        b_ub=np.concatenate([limits, limits]),
        bounds=[(None, None)] * (4 + nc) + [(0, None)] * 4,
    )
    assert sum(one.excess for one in violations) == pytest.approx(peer.fun, rel=1e-6)
    for one in violations:
        i = FIVE.index(one.name.split("'")[1])
        assert abs(one.limit) == limits[i] and one.unit == "N m"
        assert one.excess == pytest.approx(abs(one.value) - limits[i])
    # With just that much more, there is a way.
    for one in violations:
        limits[FIVE.index(one.name.split("'")[1])] += one.excess * (1 + 1e-6)
    check_equations(
        mechanism,
        state,
        ForceDistribution(mechanism, torque_limits=limits).solve(*state),
    )


def test_too_few_actuators_are_told_what_they_cannot_produce() -> None:
    mechanism, state = five_bar(1)
    with pytest.raises(InfeasibleError, match="cannot produce this motion") as caught:
        ForceDistribution(mechanism).solve(*state)
    unproduced = caught.value.unproduced
    assert unproduced is not None and caught.value.violations == ()
    matrix, force = equations(mechanism, state)
    found, *_ = np.linalg.lstsq(matrix, force - unproduced, rcond=None)
    np.testing.assert_allclose(matrix @ found, force - unproduced, atol=1e-10)
    np.testing.assert_allclose(matrix.T @ unproduced, 0, atol=1e-10)  # all joints are of one unit


def test_too_few_actuators_do_where_nothing_is_missing() -> None:
    """Without gravity, at rest."""
    mechanism, (q, v, _) = five_bar(1)
    model = mechanism.model.copy()
    model.gravity.linear = np.zeros(3)
    weightless = ClosedLoopModel(model, mechanism.closures, mechanism.actuated)
    found = ForceDistribution(weightless, torque_limits=1.0).solve(q, 0 * v, 0 * v)
    np.testing.assert_allclose(found.tau, 0, atol=1e-12)


# What is given ------------------------------------------------------------------------------------


def test_the_models_own_limits_are_taken_when_asked_for() -> None:
    mechanism, state = five_bar(4)
    distribution = ForceDistribution(mechanism, torque_limits="model")
    np.testing.assert_array_equal(distribution.upper, [9, 9, 9, 9])  # of the URDF
    np.testing.assert_array_equal(distribution.lower, [-9, -9, -9, -9])
    check_equations(mechanism, state, distribution.solve(*state))


def test_one_limit_for_all_or_a_pair() -> None:
    mechanism, _ = five_bar(3)
    one = ForceDistribution(mechanism, torque_limits=2.0)
    np.testing.assert_array_equal([one.lower, one.upper], [[-2] * 3, [2] * 3])
    pair = ForceDistribution(mechanism, torque_limits=(-1.0, [1, 2, 3]))
    np.testing.assert_array_equal([pair.lower, pair.upper], [[-1] * 3, [1, 2, 3]])


@pytest.mark.parametrize(
    "options",
    [
        {"torque_limits": "file"},
        {"torque_limits": [1.0, 2.0]},
        {"torque_limits": (1.0, -1.0)},
        {"torque_limits": np.nan},
        {"weights": [1, 1, 0]},
        {"weights": [1, 1]},
        {"bounds": [ForceBound("tips", row=3)]},
        {"bounds": [ForceBound("tips", direction=(1, 2))]},
        {"bounds": [ForceBound("tips", direction=(0, 0, 0))]},
    ],
)
def test_what_does_not_fit_is_refused(options: dict[str, object]) -> None:
    with pytest.raises(InputError):
        ForceDistribution(five_bar(3)[0], **options)


def test_an_unknown_closure_is_refused_with_those_there_are() -> None:
    with pytest.raises(MechanismError, match="there are: tips"):
        ForceDistribution(five_bar(3)[0], bounds=[ForceBound("foot", row=0)])


@pytest.mark.parametrize(
    "bound",
    [
        lambda: ForceBound("tips"),
        lambda: ForceBound("tips", row=0, direction=(1, 0, 0)),
        lambda: ForceBound("tips", row=0, lower=1.0, upper=0.0),
        lambda: ForceBound("tips", row=0, lower=np.nan),
        lambda: friction_pyramid("tips", -0.1),
        lambda: friction_pyramid("tips", 0.5, sides=2),
        lambda: friction_pyramid("tips", 0.5, normal=(0, 0, 0)),
    ],
)
def test_bounds_that_make_no_sense_are_refused(bound: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        bound()
