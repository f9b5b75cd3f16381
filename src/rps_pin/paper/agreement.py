"""Agreement of the three ways to the forces, and of the closed forms with the loop closures.

The constraint models (a constrained RNEA on Pinocchio's rigid-body algorithms), Lagrange's
equations of the first kind in the paper's coordinates, and virtual work share the kinematics of a
pose and nothing of the dynamics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array
from rps_pin.paper.interpretations import BRANCHES
from rps_pin.paper.lagrange import lagrange_forces
from rps_pin.paper.paper_helix import regular_helix
from rps_pin.paper.virtual_work import virtual_work_forces
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity.measures import singularity_measures

Progress = Callable[[Iterable[int]], Iterable[int]]

SEED = 29

#: States nearer than this to a singularity (`SingularityMeasures`) are left out and counted: there
#: all three ways lose as many digits as the forces gain.
NEAREST = 1e-3


class Agreement(NamedTuple):
    """The largest errors over a set of states."""

    states: int
    left_out: int
    """Too near to a singularity, see `NEAREST`."""
    gap: float
    """Of the loops, m."""
    rate: float
    """At which the loops would open, m/s."""
    acceleration: float
    """m/s^2."""
    residual: float
    """Of the constrained RNEA, over the largest generalised force."""
    lagrange: float
    """Largest difference to the constraint models' forces, over the state's largest force."""
    virtual_work: float
    """Likewise."""
    lagrange_virtual_work: float
    """Between those two, likewise."""

    @property
    def drawn(self) -> int:
        """All states, those left out among them."""
        return self.states + self.left_out

    @property
    def forces(self) -> float:
        """The largest difference of any two ways to the forces."""
        ways = (self.lagrange, self.virtual_work, self.lagrange_virtual_work)
        return float(np.max(ways))


def random_agreement(
    robots: int = 20, states: int = 100, *, progress: Progress = iter
) -> Agreement:
    """Return the agreement at random states of random robots, with rods, gravity in any direction.

    Parameters
    ----------
    robots, states
        How many, and of each how many; drawn from a fixed seed.
    progress
        Wraps the loop over the robots, for a progress bar.
    """
    rng = np.random.default_rng(SEED)
    found = []
    for _ in progress(range(robots)):
        robot = RPSRobot(_random_parameters(rng))
        found.append(_agreement(robot, *_random_motion(rng, robot.parameters, states)))
    return _joined(found)


def helix_agreement(samples: int = 500) -> dict[str, Agreement]:
    """Return the agreement along the helix of Table 1, z_0 = 0.4 m, by branch."""
    robot = RPSRobot.from_preset("sokolov")
    found: dict[str, Agreement] = {}
    for branch in BRANCHES:
        path = regular_helix(robot, branch)
        times = np.linspace(0.0, path.duration, samples)
        found[branch] = _agreement(robot, *path.sample(times))
    return found


def _agreement(robot: RPSRobot, pose: Array, rate: Array, acceleration: Array) -> Agreement:
    measures = singularity_measures(robot.parameters, pose)
    near = np.minimum(measures.type_ii, np.abs(measures.constraint)) < NEAREST
    motion = pose[~near], rate[~near], acceleration[~near]
    q, v, a = robot.state(*motion)
    n = len(q)
    force, loops, residual = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    for i in range(n):
        solved = robot.inverse_dynamics(q[i], v[i], a[i])
        largest = max(np.abs(solved.tau).max(), np.abs(solved.constraint_forces).max())
        force[i], residual[i] = solved.tau, solved.residual / largest
        loops[i] = [np.abs(part).max() for part in robot.mechanism.loop_errors(q[i], v[i], a[i])]
    first = lagrange_forces(robot.parameters, *motion).force
    second = virtual_work_forces(robot.parameters, *motion)
    scale = np.abs(force).max(axis=-1, keepdims=True)

    def differ(one: Array, other: Array) -> float:
        return float((np.abs(one - other) / scale).max())

    gap, opening, apart = map(float, loops.max(axis=0))
    ways = differ(first, force), differ(second, force), differ(first, second)
    return Agreement(n, int(near.sum()), gap, opening, apart, float(residual.max()), *ways)


def _joined(parts: list[Agreement]) -> Agreement:
    states, left_out = sum(p.states for p in parts), sum(p.left_out for p in parts)
    largest = np.max([part[2:] for part in parts], axis=0)  # NaN if one is
    return Agreement(states, left_out, *map(float, largest))


def _random_parameters(rng: np.random.Generator) -> RPSParameters:
    """Return a robot with all its masses, a full inertia tensor, and gravity in any direction."""
    base_radius, mass = rng.uniform(0.2, 0.8), rng.uniform(0.5, 20.0)
    platform_radius = base_radius * rng.uniform(0.3, 1.2)
    points = rng.normal(scale=platform_radius / 2, size=(8, 3))  # of mass / 8 each
    second_moment = mass / 8 * points.T @ points
    down = rng.normal(size=3)
    return RPSParameters(
        name="random",
        base_radius=base_radius,
        platform_radius=platform_radius,
        platform_mass=mass,
        platform_inertia=np.trace(second_moment) * np.eye(3) - second_moment,
        leg_mass=rng.uniform(0.5, 10.0),
        leg_com=rng.uniform(0.05, 0.5),
        leg_inertia=rng.uniform(0.01, 0.5),
        leg_inertia_about="com",
        rod_mass=rng.uniform(0.5, 10.0),
        rod_com=rng.uniform(-0.1, 0.5),
        rod_inertia=rng.uniform(0.01, 0.5),
        gravity=9.81 * down / np.linalg.norm(down),
    )


def _random_motion(
    rng: np.random.Generator, parameters: RPSParameters, count: int
) -> tuple[Array, Array, Array]:
    """Return pose, rate and acceleration, so fast that Coriolis forces rival gravity."""
    height = parameters.base_radius * rng.uniform(0.7, 3.0, count)
    size, way = rng.uniform(0.0, 1.0, count), rng.uniform(-math.pi, math.pi, count)
    pose = np.stack([height, size * np.cos(way), size * np.sin(way)], axis=-1)
    return pose, rng.normal(scale=3.0, size=(count, 3)), rng.normal(scale=20.0, size=(count, 3))
