"""Mechanisms that nothing drives: described, closed, moved by their weight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel
from tests.closed_loop.mechanisms import FOUR_BAR
from tests.worst import worst

#: 1 kg at 0.1 m from its hinge; a sphere of 0.02 m.
PASSIVE = """<mujoco model="passive">
  <worldbody><body name="bob" pos="0 0 0.2"><joint name="hinge" axis="0 1 0"/>
  <geom type="sphere" size="0.02" pos="0.1 0 0" mass="1"/></body></worldbody>
</mujoco>"""
INERTIA = 0.1**2 + 0.4 * 0.02**2


def passive_four_bar() -> ClosedLoopModel:
    driven = FOUR_BAR.mechanism()
    return ClosedLoopModel(driven.model, driven.closures, [], home=driven.home)


@pytest.mark.parametrize("engine", ["pinocchio", "generated"])
def test_a_pendulum_falls_and_nothing_holds_it(engine: str) -> None:
    mechanism = ClosedLoopModel.from_mjcf(PASSIVE)
    assert mechanism.actuated == ()
    solver = mechanism if engine == "pinocchio" else mechanism.compile(compiler="tcc")
    still = np.zeros(1)
    for angle in (0.0, 0.7, -2.0):
        q = np.array([angle])
        weight = -9.81 * 0.1 * np.cos(angle)  # about the hinge; y turns x downwards
        found = solver.inverse_dynamics(q, still, still)
        assert found.tau.shape == (0,)
        assert worst(found.unproduced - weight) < 1e-12
        assert worst(solver.forward_dynamics(q, still, []) + weight / INERTIA) < 1e-10
    motion = solver.simulate(np.zeros(1), duration=0.3)
    assert np.ptp(motion.kinetic) > 0.1
    assert worst(motion.energy - motion.energy[0]) < 1e-8
    assert motion.tau.shape == (len(motion.time), 0)


def test_its_description_says_that_nothing_is_driven(tmp_path: Path) -> None:
    (tmp_path / "passive.xml").write_text(PASSIVE)
    (tmp_path / "passive.yaml").write_text("mjcf: passive.xml\nactuated: []\n")
    for found in (
        ClosedLoopModel.from_mjcf(PASSIVE).describe(),
        ClosedLoopModel.load(tmp_path / "passive.yaml").describe(),
        passive_four_bar().describe(),
    ):
        assert found.mobility == 1
        assert (found.actuated, found.actuated_rank) == ((), 0)
        assert found.actuation == "underactuated"
        assert "mobility 1, actuation underactuated: nothing driven" in str(found)


@pytest.mark.parametrize("engine", ["pinocchio", "generated"])
def test_a_four_bar_without_a_motor_is_one_whose_motor_gives_no_torque(engine: str) -> None:
    driven, passive = FOUR_BAR.mechanism(), passive_four_bar()
    solver = passive if engine == "pinocchio" else passive.compile(compiler="tcc")
    q = driven.close(pin.neutral(driven.model) + 0.3)
    v = driven.velocity(q, [1.3])
    wanted = driven.forward_dynamics(q, v, [0.0])
    assert worst(solver.forward_dynamics(q, v, np.zeros(0)) - wanted) < 1e-9
    assert worst(solver.complete([], q) - q) < 1e-12
    # What is missing does the motor's work: T' (unproduced) is the motor's torque.
    a = driven.acceleration(q, v, [0.4])
    T = driven.motion_basis(q)
    found = solver.inverse_dynamics(q, v, a)
    assert worst(T.T @ found.unproduced - driven.inverse_dynamics(q, v, a).tau) < 1e-9
    moving = solver.velocity(q, [1.3], independent=["crank_joint"])
    assert worst(moving - v) < 1e-12
