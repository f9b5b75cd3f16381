"""Forces, gains and inertia of tasks, by virtual work, energy, and the mechanism's own dynamics."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin import MechanismError
from tests.task.robots import EACH, NAMES, poses, slope, task
from tests.worst import worst

ALL = pytest.mark.parametrize("name", NAMES)
BOTH = pytest.mark.parametrize(("make", "name"), EACH)
OF_FRAMES = pytest.mark.parametrize(
    "name", [name for name in NAMES if task(name)._options["frame"]]
)


@BOTH
def test_forces_do_the_same_work(make, name) -> None:
    one, (x, q), rng = make(name), poses(name), np.random.default_rng(3)
    f, rate = rng.normal(size=(2, *x.shape))
    tau = one.forces_to_actuators(q, f)
    speeds = one.motion(q, rate, 0 * rate).v[..., one.mechanism.actuated_indices]
    power = (f * rate).sum(axis=-1)
    assert worst((tau * speeds).sum(axis=-1) - power) < 1e-9 * (1 + worst(power))
    assert worst(one.forces_to_task(q, tau) - f) < 1e-9 * worst(f)


@OF_FRAMES
def test_actuators_bear_a_wrench_as_inverse_dynamics_says(name) -> None:
    one, (_, q), rng = task(name), poses(name), np.random.default_rng(4)
    m, frame = one.mechanism, one._options["frame"]
    still = np.zeros(m.model.nv)
    for each in q[:3]:
        wrench = rng.normal(size=6)
        own = m.inverse_dynamics(each, still, still).tau
        loaded = m.inverse_dynamics(each, still, still, wrenches={frame: -wrench}).tau
        assert worst(one.wrench_to_actuators(each, wrench) - (loaded - own)) < 1e-9 * worst(own, 1)


@OF_FRAMES
def test_the_twist_is_the_rate_of_the_frame(name) -> None:
    one, (x, q) = task(name), poses(name)
    m, frame = one.mechanism, one._options["frame"]
    E = one.twist_map(q)
    for i in range(2):
        placed = m.frame_placement(q[i], frame)
        moved = slope(
            lambda y, i=i: m.frame_placement(one.configuration(y, near=q[i]), frame), x[i]
        )
        assert worst(moved[:3, 3] - E[i, :3]) < 1e-7 * (1 + worst(one.hessian(q[i])))
        for k in range(one.size):
            spin = moved[:3, :3, k] @ placed[:3, :3].T
            found = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
            assert worst(found - E[i, 3:, k]) < 1e-7 * (1 + worst(one.hessian(q[i])))


@ALL
def test_gains_are_the_slopes_of_forces(name) -> None:
    one, (x, q), rng = task(name), poses(name), np.random.default_rng(6)
    count = one.mechanism.actuated_indices.size
    gains = rng.normal(size=(count, count))
    gains = gains @ gains.T + np.eye(count)
    tau = rng.normal(size=count)
    a0 = one.to_actuators(x[0], near=q[0])

    def force(y):  # of springs at the actuators that push with tau at x[0]
        there = one.configuration(y, near=q[0])
        a = one.to_actuators(y, near=q[0])
        return one.forces_to_task(there, tau + gains @ (a - a0))

    found = one.gains_to_task(q[0], gains, forces=tau)
    assert worst(found - slope(force, x[0])) < 1e-6 * worst(found)
    assert worst(one.gains_to_actuators(q[0], found, forces=tau) - gains) < 1e-8 * worst(gains)
    plain = one.gains_to_task(q[0], np.ones(count))
    assert worst(plain - one.jacobian(q[0]).T @ one.jacobian(q[0])) < 1e-12 * worst(plain)


@BOTH
def test_the_mass_matrix_gives_the_kinetic_energy(make, name) -> None:
    one, (x, q), rng = make(name), poses(name), np.random.default_rng(7)
    rate = rng.normal(size=x.shape)
    M = one.mass_matrix(q)
    state = one.motion(q, rate, 0 * rate)
    energy = [one.mechanism.energy(each, v)[0] for each, v in zip(q, state.v, strict=True)]
    found = np.einsum("kij,ki,kj->k", M, rate, rate) / 2
    assert worst(found - np.array(energy)) < 1e-9 * worst(found)


@ALL
def test_dynamics_of_the_task_is_that_of_the_actuators(name) -> None:
    """f = K' tau of a motion: the extended mechanism's own inverse dynamics."""
    one, (x, q), rng = task(name), poses(name), np.random.default_rng(8)
    rate, acceleration = rng.normal(size=(2, *x.shape))
    state = one.motion(q, rate, acceleration)
    for i in range(3):
        tau = one.mechanism.inverse_dynamics(state.q[i], state.v[i], state.a[i]).tau
        whole = one.extended
        start = np.concatenate([q[i], x[i][np.argsort(one._x.idx_q)]]) if one._x.added else q[i]
        v = whole.velocity(start, rate[i])
        a = whole.acceleration(start, v, acceleration[i])
        found = whole.inverse_dynamics(start, v, a).tau
        wanted = one.forces_to_task(q[i], tau)
        assert worst(found - wanted) < 1e-9 * (1 + worst(wanted))


def test_more_actuators_than_coordinates_share_a_force_of_least_norm() -> None:
    """A 3-RRR whose actuators are six: K' tau = f, tau in the range of K."""
    m = task("rrs").mechanism
    both = m.with_actuated([*m.actuated, *(f"shank_{i}_joint" for i in (1, 2, 3))])
    one, rng = both.task, np.random.default_rng(9)
    q = both.home
    f = rng.normal(size=3)
    K, tau = one.jacobian(q), one.forces_to_actuators(q, f)
    assert worst(K.T @ tau - f) < 1e-10
    assert worst(tau - K @ np.linalg.lstsq(K, tau, rcond=None)[0]) < 1e-10
    with pytest.raises(MechanismError, match="6 actuators have no determined gains"):
        one.gains_to_actuators(q, np.ones(3))
