"""Time of the 3-RPS's inverse dynamics, and of plain Pinocchio and NumPy, in one run.

Run with ``make bench``. The goal: a third of the plain way, or less.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from rps_pin import RPSRobot

Array = NDArray[np.float64]
Solver = Callable[[Array, Array, Array], Array]

POSE = [0.4, 0.1, -0.05]
RATE = [0.02, 0.3, 0.2]
ACCELERATION = [0.5, -1.0, 2.0]


def plain(robot: RPSRobot) -> Solver:
    """Closed-loop inverse dynamics as in Pinocchio's examples."""
    mechanism = robot.mechanism
    model = mechanism.model
    data = model.createData()
    constraint_models = pin.StdVec_RigidConstraintModel()
    constraint_datas = pin.StdVec_RigidConstraintData()
    for closure in mechanism.closures:
        constraint_models.append(closure.constraint_model(model))
    for constraint_model in constraint_models:
        constraint_datas.append(constraint_model.createData())
    actuated = [model.joints[model.getJointId(name)].idx_v for name in mechanism.actuated]
    passive = [i for i in range(model.nv) if i not in actuated]

    def inverse_dynamics(q: Array, v: Array, a: Array) -> Array:
        force = pin.rnea(model, data, q, v, a)
        pin.computeJointJacobians(model, data, q)
        for constraint_model, constraint_data in zip(
            constraint_models, constraint_datas, strict=True
        ):
            constraint_model.calc(model, data, constraint_data)
        jacobian = pin.getConstraintsJacobian(model, data, constraint_models, constraint_datas)
        multipliers = np.linalg.solve(jacobian[:, passive].T, force[passive])
        tau: Array = force[actuated] - jacobian[:, actuated].T @ multipliers
        return tau

    return inverse_dynamics


@pytest.fixture(scope="module")
def robot() -> RPSRobot:
    return RPSRobot.from_preset("sokolov")


@pytest.mark.benchmark(group="3-RPS inverse dynamics, one call", warmup=True, min_rounds=2000)
@pytest.mark.parametrize("role", ["ours", "plain Pinocchio and NumPy"])
def bench_inverse_dynamics(benchmark: BenchmarkFixture, robot: RPSRobot, role: str) -> None:
    state = robot.state(POSE, RATE, ACCELERATION)
    peer = plain(robot)
    np.testing.assert_allclose(robot.inverse_dynamics(*state).tau, peer(*state), rtol=1e-10)
    benchmark.extra_info["role"] = role
    benchmark(robot.inverse_dynamics if role == "ours" else peer, *state)
