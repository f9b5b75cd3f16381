"""Frequencies of a five-bar on soft drives, from MuJoCo's energies and masses of the same URDF.

Its loop is closed here in two ways: by eliminating the passive joints (energies at poses that are
closed by Newton's method, masses reduced by the loop's Jacobian), and by a spring between its tips.
Stiffness is the second difference of the energy about its own minimum.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import least_squares

from rps_pin import ClosedLoopModel
from rps_pin.arrays import Array
from rps_pin.task.stiffness import Compliances, StiffnessModel
from tests.reference.mujoco_loops import MujocoLoops

DRIVES = ("left_joint", "right_joint")
JOINTS = ("left_joint", "left_arm_joint", "right_joint", "right_arm_joint")
#: N m/rad, weak: the weight turns the drives by some 10 mrad; N/m between the tips.
STIFFNESS, BEARING = {"left_joint": 150.0, "right_joint": 240.0}, 4e4
LEFT, RIGHT = np.array([0.42, 0.0, 0.0]), np.array([0.45, 0.0, 0.0])


@cache
def mechanism() -> ClosedLoopModel:
    return ClosedLoopModel.load(Path(__file__).parents[2] / "urdf" / "five_bar.yaml")


class Twin(MujocoLoops):
    """The five-bar in MuJoCo with springs of its drives, at rest at q."""

    def __init__(self, q: Array) -> None:
        super().__init__("five_bar", [(("left_arm", LEFT), ("right_arm", RIGHT))])
        self.rest = q
        self.model.opt.enableflags |= self.mujoco.mjtEnableBit.mjENBL_ENERGY
        self.at = [int(self.model.joint(name).qposadr[0]) for name in JOINTS]
        assert self.model.nq == self.model.nv == len(JOINTS)
        for name, k in STIFFNESS.items():
            self.model.joint(name).stiffness[0] = k
            self.model.qpos_spring[self.model.joint(name).qposadr[0]] = q[JOINTS.index(name)]

    def energy(self, q: Array) -> float:
        """Of weight and drives, J."""
        self.data.qpos[self.at] = q
        self.mujoco.mj_fwdPosition(self.model, self.data)
        self.mujoco.mj_energyPos(self.model, self.data)
        return float(self.data.energy[0])

    def open(self, q: Array) -> Array:
        """From the right tip to the left one, x and z, m."""
        self.data.qpos[self.at] = q
        self.mujoco.mj_kinematics(self.model, self.data)
        (a, b), *_ = self.pairs
        return np.asarray((self._at(a) - self._at(b))[[0, 2]])

    def closed(self, drives: Array) -> Array:
        """All joints, with the loop closed at positions of the drives."""

        def gap(passive: Array) -> Array:
            return self.open(np.array([drives[0], passive[0], drives[1], passive[1]]))

        found: Any = least_squares(gap, self.rest[[1, 3]], xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert np.abs(found.fun).max() < 1e-13
        return np.array([drives[0], found.x[0], drives[1], found.x[1]])

    def mass(self) -> Array:
        """Of all joints, at the pose taken on."""
        full = np.zeros((4, 4))
        self.mujoco.mj_fullM(self.model, self.data, full)
        return full[np.ix_(self.at, self.at)]


def slopes(energy: Callable[[Array], float], at: Array, h: float) -> tuple[Array, Array]:
    """Gradient and Hessian by differences of order 4 (Richardson's extrapolation)."""
    n, found = at.size, []
    for step in (h, 2 * h):
        e = step * np.eye(n)
        first = [(energy(at + a) - energy(at - a)) / (2 * step) for a in e]
        second = [
            [
                energy(at + a + b) - energy(at + a - b) - energy(at - a + b) + energy(at - a - b)
                for b in e
            ]
            for a in e
        ]
        found.append((np.array(first), np.array(second) / (4 * step**2)))
    fine, coarse = found
    return (4 * fine[0] - coarse[0]) / 3, (4 * fine[1] - coarse[1]) / 3


def minimum(energy: Callable[[Array], float], start: Array, h: float) -> tuple[Array, Array]:
    """Where the gradient is zero, and the Hessian there."""
    at = start.copy()
    for _ in range(6):
        gradient, hessian = slopes(energy, at, h)
        at = at - np.linalg.solve(hessian, gradient)
    assert np.abs(gradient).max() < 1e-7
    return at, slopes(energy, at, h)[1]


def frequencies(K: Array, M: Array) -> Array:
    return np.asarray(np.sqrt(eigh(K, M, eigvals_only=True)) / (2 * np.pi))


@pytest.mark.parametrize("shift", [[0.0, 0.0], [0.06, -0.08]])
def test_frequencies_with_the_loop_eliminated(shift: list[float]) -> None:
    task = mechanism().task
    q = task.configuration(task.home + shift)
    twin = Twin(q)
    found = StiffnessModel(task, Compliances(actuators=STIFFNESS)).deflection(q)
    at, K = minimum(lambda a: twin.energy(twin.closed(a)), q[[0, 2]], 1e-3)
    sag = at - q[[0, 2]]
    assert np.abs(sag).max() > 5e-3  # so that the geometric part counts
    assert np.allclose(found.stretch, sag, rtol=0, atol=1e-8)
    twin.energy(twin.closed(at))
    M = twin.reduced_mass(DRIVES)
    assert np.allclose(found.frequencies, frequencies(K, M), rtol=1e-6)
    alone = frequencies(np.diag(list(STIFFNESS.values())), M)
    assert np.abs(alone / found.frequencies - 1).max() > 1e-3  # without the geometric part


def test_frequencies_with_a_spring_that_closes_the_loop() -> None:
    task = mechanism().task
    q = task.configuration(task.home + np.array([0.03, -0.05]))
    twin = Twin(q)
    soft = Compliances(actuators=STIFFNESS, closures={"tips": {"x": BEARING, "z": BEARING}})
    found = StiffnessModel(task, soft).deflection(q)

    def energy(joints: Array) -> float:
        gap = twin.open(joints)
        return twin.energy(joints) + BEARING * float(gap @ gap) / 2

    at, K = minimum(energy, q, 1e-3)
    twin.energy(at)
    finite = found.frequencies[np.isfinite(found.frequencies)]
    assert np.allclose(finite, frequencies(K, twin.mass()), rtol=1e-6)
