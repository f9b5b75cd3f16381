"""Mechanisms and states of `generated_code_table`: what is measured, on what."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from benchmarks.bench_chains import chain
from benchmarks.legged import biped, leg
from benchmarks.peers import URDF
from rps_pin import ClosedLoopModel, RPSParameters, RPSRobot

Array = NDArray[np.float64]

LOOPS = (1, 2, 4, 8, 16, 32, 64)


def three_rps() -> ClosedLoopModel:
    """Return the sokolov 3-RPS with rods of 30 g and a platform that MuJoCo accepts.

    The preset's rods have no mass, and its platform is flatter than a rigid body can be.
    """
    given = RPSParameters.from_preset("sokolov")
    fields = {name: getattr(given, name) for name in type(given).model_fields}
    fields |= {"platform_inertia": np.diag([0.093, 0.093, 0.185])}
    fields |= {"rod_mass": 0.03, "rod_com": -0.1, "rod_inertia": 5e-4}
    robot = RPSRobot(RPSParameters(**fields))
    bare = robot.mechanism
    home = robot.state([0.41, 0.1, -0.05], [0, 0, 0], [0, 0, 0])[0]
    return ClosedLoopModel(bare.model, bare.closures, bare.actuated, home=home, name="3-RPS")


def _file(name: str) -> Callable[[], ClosedLoopModel]:
    return lambda: ClosedLoopModel.load(URDF / f"{name}.yaml")


MECHANISMS: dict[str, Callable[[], ClosedLoopModel]] = {
    "3-RPS": three_rps,
    "Delta with rods": _file("delta_rods"),
    "Stewart": _file("stewart"),
    "five-bar": _file("five_bar"),
    "leg": leg,
    "biped": biped,
}


class Case:
    """A mechanism, closed states around its home, and one that it is simulated from."""

    def __init__(self, name: str, make: Callable[[], ClosedLoopModel]) -> None:
        self.name, self.mechanism = name, make()
        mechanism = self.mechanism
        self.floating = mechanism.model.existJointName("base")
        base = ["base"] if self.floating else []
        self.independent = [*mechanism.actuated, *base]
        self.size = mechanism.system.independent(self.independent).size
        self.home = mechanism.home
        self.q, self.v, self.a, self.tau = self.states(1, 0.02, np.random.default_rng(1))[0]

    def states(
        self, count: int, spread: float, rng: np.random.Generator
    ) -> list[tuple[Array, Array, Array, Array]]:
        """Return closed configurations, velocities, accelerations and the forces between them."""
        found, mechanism = [], self.mechanism
        for _ in range(count):
            q = self._near_home(spread * rng.normal(size=self.size))
            v = mechanism.velocity(q, rng.normal(size=self.size), self.independent)
            if self.floating:  # not every acceleration is one that the actuators can give
                tau = rng.normal(size=len(mechanism.actuated))
                a = mechanism.forward_dynamics(q, v, tau)
            else:
                a = mechanism.acceleration(q, v, rng.normal(size=self.size))
                tau = mechanism.inverse_dynamics(q, v, a).tau
            found.append((q, v, a, tau))
        return found

    def _near_home(self, moved: Array) -> Array:
        """Return the closed configuration where the independent joints have moved about so far."""
        mechanism = self.mechanism
        step = mechanism.velocity(self.home, moved, self.independent)
        return mechanism.close(pin.integrate(mechanism.model, self.home, step))

    def start(self) -> tuple[Array, Array, Array]:
        """Return q, a slow v, and the forces of a simulation.

        They hold the mechanism as if it stood; on a floating base a twentieth of that, in free
        fall.
        """
        rest = np.zeros(self.mechanism.model.nv)
        tau = self.mechanism.inverse_dynamics(self.q, rest, rest).tau
        return self.q, 0.1 * self.v, 0.05 * tau if self.floating else tau


def case(name: str) -> Case:
    """Return a mechanism of `MECHANISMS`."""
    return Case(name, MECHANISMS[name])


def chain_case(loops: int, kind: str = "spherical") -> Case:
    """Return a chain of four-bars, its cranks 1 rad below the horizontal."""
    bare = chain(loops, kind)
    angles = {"crank": -1.0, "rocker": -1.0, "coupler": 1.0}
    home = [angles[name.split("_")[0]] for name in list(bare.model.names)[1:]]
    name = f"{loops} four-bar" + "s" * (loops > 1)
    made = ClosedLoopModel(bare.model, bare.closures, bare.actuated, home=home, name=name)
    return Case(name, lambda: made)
