"""Identification: the regressor, base parameters, least squares and physically possible answers."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, InputError, MechanismError
from rps_pin.arrays import Array
from rps_pin.closed_loop import JointEffects
from rps_pin.numerics.linear_algebra import singular_values
from rps_pin.task.identification import DynamicsModel, States, identify
from rps_pin.task.identification.base import base_parameters
from rps_pin.task.identification.evidence import evidence_of, fit
from rps_pin.task.identification.filtering import Filter
from rps_pin.task.identification.physical import LEAST, body_scale, possible, pseudo_inertia
from rps_pin.task.identification.result import with_parameters
from tests.task.identified import RATE, log_of, model_of, noise_of, task_of, truth
from tests.worst import worst

MECHANISMS = ("delta", "five_bar", "stewart", "rps", "four_bar")


def forces_of(mechanism: ClosedLoopModel, states: States) -> Array:
    motions = zip(states.q, states.v, states.a, strict=True)
    return np.array([mechanism.inverse_dynamics(*one).tau for one in motions])


def some_states(model: DynamicsModel, seed: int, count: int = 12) -> States:
    found = model.random_states(np.random.default_rng(seed), 2 * count)
    assert len(found.q) >= count
    return found


# The regressor ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_regressor_gives_the_pinocchio_engines_forces(name: str) -> None:
    """Of the mechanism as it is, and with other bodies and friction."""
    model = model_of(name)
    states = some_states(model, 1)
    rows, known = model.regressor(states)
    for p in (model.nominal, truth(model, np.random.default_rng(2))):
        wanted = forces_of(with_parameters(model, p), states)
        assert worst(rows @ p + known - wanted) < 1e-10 * worst(wanted)
        base = rows[..., model.base.independent] @ (model.base.matrix @ p)
        assert worst(base + known - wanted) < 1e-10 * worst(wanted)


def test_springs_and_rotors_of_passive_joints() -> None:
    """Damping, friction, springs and armature of all joints of a five-bar, against the engine."""
    mechanism = task_of("five_bar").mechanism
    joints = list(mechanism.model.names)[1:]
    rest = dict.fromkeys(joints, 0.3)
    old = JointEffects.named(mechanism.model, stiffness={joints[1]: 2.0}, rest=rest)
    changed = ClosedLoopModel(
        mechanism.model,
        mechanism.closures,
        mechanism.actuated,
        home=mechanism.home,
        effects=old,
        task=mechanism._task,
    )
    model = DynamicsModel(
        changed, bodies=[], damping=joints, friction=joints, stiffness=joints, armature=joints
    )
    p = np.random.default_rng(3).uniform(0.5, 2.0, model.nominal.size)
    states = some_states(model, 4)
    rows, known = model.regressor(states)
    wanted = forces_of(with_parameters(model, p), states)
    assert worst(rows @ p + known - wanted) < 1e-10 * worst(wanted)
    assert model.nominal[model.labels.index(f"stiffness:{joints[1]}")] == 2.0


def test_an_offset_is_a_constant_force() -> None:
    model = DynamicsModel(
        task_of("delta"), bodies=[], damping=[], friction=[], offsets=["arm_2_joint"]
    )
    rows, _ = model.regressor(some_states(model, 5))
    assert np.array_equal(rows[..., 0], np.broadcast_to([0.0, 1.0, 0.0], rows.shape[:2]))


# Base parameters ----------------------------------------------------------------------------------


def test_base_parameters_of_a_delta_are_those_counted_by_hand() -> None:
    """Three arms that turn about fixed axes: mx, mz, Iyy of each; a platform that translates: m.

    The rods have no mass. Three dampings and three frictions are to be added.
    """
    model = model_of("delta")
    assert len(model.base.independent) == 3 * 3 + 1 + 6


@pytest.mark.parametrize("name", ["five_bar", "rps"])
def test_as_many_base_parameters_as_the_engines_forces_tell_apart(name: str) -> None:
    """The rank of differences of the engine's forces, one parameter changed at a time."""
    model = model_of(name)
    states = some_states(model, 6, 24)
    p = truth(model, np.random.default_rng(7))
    before = forces_of(with_parameters(model, p), states)
    columns = []
    for k in range(p.size):
        step = np.zeros(p.size)
        step[k] = 0.1
        columns.append((forces_of(with_parameters(model, p + step), states) - before).ravel())
    matrix = np.stack(columns, axis=-1)
    lengths = np.linalg.norm(matrix, axis=0)
    there = lengths > 1e-9 * lengths.max()
    values = singular_values(matrix[:, there] / lengths[there])
    count = len(model.base.independent)
    assert np.count_nonzero(values > 1e-7) == count
    assert values[count - 1] > 1e-4


def test_base_parameters_of_a_random_matrix() -> None:
    rng = np.random.default_rng(8)
    rows = rng.normal(size=(60, 5)) @ rng.normal(size=(5, 9)) * rng.uniform(1e-3, 1e3, 9)
    rows[:, 4] = 0.0
    base = base_parameters(rows)
    p = rng.normal(size=9) / np.linalg.norm(rows, axis=0).clip(1e-3)
    assert len(base.independent) == 5
    assert 4 not in base.independent
    assert worst(rows[:, base.independent] @ (base.matrix @ p) - rows @ p) < 1e-11 * worst(rows @ p)


# The answer ---------------------------------------------------------------------------------------


def test_exact_logs_give_the_machines_parameters() -> None:
    """To what the filter takes from the dry friction."""
    model = model_of("rps")
    found = identify(model, log_of("rps", 1, 1, 0.0, np.random.default_rng()), cut_off=12.0)
    wanted = model.base.matrix @ truth(model, np.random.default_rng(1))
    assert worst(found.values - wanted) < 2e-4 * worst(wanted)
    assert found.alone.all()


def test_errors_are_those_that_the_covariance_says() -> None:
    """Sums of squared errors over their covariance, 60 logs of a 3-RPS, and coverage."""
    model = model_of("rps")
    wanted = model.base.matrix @ truth(model, np.random.default_rng(1))
    exact = log_of("rps", 1, 1, 0.0, np.random.default_rng())
    doubts: list[str] = []
    (one,) = evidence_of(model, [exact], 10.0, None, doubts)
    deviation = noise_of("rps", 1, 0.02)
    squares, within, noise = 0.0, [], []
    for seed in range(60):
        own = deviation * np.random.default_rng(seed).normal(size=one.forces.shape)
        forces = one.forces + one.filtered(own) * one.used[:, None]
        found = fit(model, [one._replace(forces=forces)])
        error = found.values - wanted
        squares += float(error @ np.linalg.solve(found.covariance, error))
        within.append(np.abs(error) < 1.96 * np.sqrt(np.diag(found.covariance)))
        noise.append(found.noise / deviation)
    # Chi squared of 60 x 25 degrees of freedom: 0.1 % and 99.9 %; 4 % for the estimated noise.
    assert 1335 < squares < 1674 * 1.04
    assert 0.93 < np.mean(within) < 0.97
    assert worst(np.mean(noise, axis=0) - 1) < 0.03
    assert not doubts


def test_prediction_of_another_log_is_at_the_noise() -> None:
    model, rng = model_of("rps"), np.random.default_rng(9)
    found = identify(model, [log_of("rps", seed, 1, 0.02, rng) for seed in (1, 2)], cut_off=10.0)
    assert not found.doubts
    other = found.predict(log_of("rps", 3, 1, 0.02, rng))
    left = noise_of("rps", 1, 0.02) * np.sqrt(Filter(10.0, 1 / RATE).noise)
    assert (other.expected > 0.9 * left).all()
    assert (other.expected < 1.5 * left).all()
    for of in ("free", "possible"):
        ratio = float(np.sqrt(np.mean((other.errors(of) / other.expected) ** 2)))
        assert 0.85 < ratio < 1.15  # about 230 independent numbers: 5 %
    assert (other.percent("believed") > 10 * other.percent()).all()


# Physically possible parameters -------------------------------------------------------------------


def test_pseudo_inertia_of_points() -> None:
    """Sum of m (x, 1)(x, 1)' of points, against Pinocchio's parameters of the same points."""
    rng = np.random.default_rng(10)
    body, wanted = pin.Inertia.Zero(), np.zeros((4, 4))
    for mass, x in zip(rng.uniform(1, 2, 6), rng.normal(size=(6, 3)), strict=True):
        body += pin.Inertia(mass, x, np.zeros((3, 3)))
        wanted += mass * np.outer([*x, 1], [*x, 1])
    assert worst(pseudo_inertia(np.array(body.toDynamicParameters())) - wanted) < 1e-12


def test_an_impossible_answer_is_moved_to_the_nearest_possible_one() -> None:
    """A body seen with a negative moment of inertia; nearest among 2000 random possible ones."""
    rng = np.random.default_rng(11)
    body = pin.Inertia(2.0, np.array([0.1, 0.0, 0.2]), np.diag([0.03, 0.04, 0.05]))
    believed = np.array(body.toDynamicParameters())
    sizes = body_scale(believed)
    labels = [f"inertia:body.{k}" for k in ("mass", *"abcdefghi")]
    seen = believed.copy()
    seen[4] -= 2 * believed[4]
    deviation = 0.05 * sizes
    found = possible(labels, believed, sizes, np.eye(10), seen, np.diag(deviation**2))
    assert found is not None
    assert found.least[0] > 0.99 * LEAST

    def cost(p: Array) -> float:
        return float(np.sum(((p - seen) / deviation) ** 2) + np.sum(((p - believed) / sizes) ** 2))

    least, tried = cost(found.parameters), 0
    for _ in range(2000):
        p = found.parameters + rng.choice([1e-3, 1e-2, 0.1]) * sizes * rng.normal(size=10)
        turn = 1 / np.sqrt(np.array([sizes[4]] * 3 + [sizes[0]]))
        if np.linalg.eigvalsh(pseudo_inertia(p) * np.outer(turn, turn))[0] >= LEAST:
            tried += 1
            assert cost(p) > least - 1e-6
    assert tried > 100


def test_the_identified_mechanism_is_possible_and_predicts() -> None:
    """Its bodies have positive masses, and inertias that `pinocchio` takes; noise of 20 %."""
    model = model_of("rps")
    found = identify(model, log_of("rps", 1, 1, 0.2, np.random.default_rng(12)))
    assert found.possible is not None
    assert min(found.possible.least) > 0.99 * LEAST
    mechanism = found.mechanism
    bodies = [label for label in model.labels if label.endswith(".mass")]
    assert len(bodies) == 4
    for label in bodies:
        name = label.removeprefix("inertia:").removesuffix(".mass")
        body = mechanism.model.inertias[mechanism.model.getJointId(name)]
        assert body.mass > 0
        principal = np.linalg.eigvalsh(body.inertia)
        assert principal[0] > 0
        assert principal[2] < principal[0] + principal[1]
    states = some_states(model, 13)
    rows, known = model.regressor(states)
    wanted = rows @ found.possible.parameters + known
    assert worst(forces_of(mechanism, states) - wanted) < 1e-10 * worst(wanted)


# Faults -------------------------------------------------------------------------------------------


def test_faults_of_a_model() -> None:
    task = task_of("five_bar")
    with pytest.raises(InputError, match="no parameters 'damping:left_jiont' \\(did you mean"):
        DynamicsModel(task, damping=["left_jiont"])
    with pytest.raises(InputError, match="nothing is to be estimated"):
        DynamicsModel(task, bodies=[], damping=[], friction=[])
    with pytest.raises(InputError, match="named twice"):
        DynamicsModel(task, bodies=["left_joint", "left_joint"])
    with pytest.raises(MechanismError, match="2 actuators for 1 motions"):
        mechanism = task_of("four_bar").mechanism
        joints = list(mechanism.model.names)[1:]
        DynamicsModel(mechanism.with_actuated([*mechanism.actuated, joints[-1]]))
