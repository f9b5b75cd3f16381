"""The 3-RPS's forces three ways: Lagrange's equations with multipliers, virtual work with moving
rods, and constraint models; and Newton and Euler's, which share no code with any of them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import RPSRobot, helix
from rps_pin.paper.lagrange import lagrange_forces
from rps_pin.paper.virtual_work import virtual_work_forces
from rps_pin.rps.motion.time_optimal import time_optimal
from rps_pin.rps.motion.trajectory_file import load_trajectory
from tests.proofs import common
from tests.reference import newton_euler as ne
from tests.strategies import Motion, random_motions, random_parameters
from tests.worst import worst

Array = NDArray[np.float64]

#: Of the largest force of the state.
AGREEMENT = 1e-9
WELL_CONDITIONED = 1e4

#: Beside the helices, what docs/dynamics.md shows.
SHOWN = sorted((Path(__file__).parents[2] / "docs" / "trajectories").glob("*.yaml"))

#: Helices of the presets: radius, pitch and height, m.
HELICES = {
    "the README's": ("sokolov", 0.75e-3, 0.5e-3, 0.4),
    "75 mm, from 0.5 m": ("sokolov", 75e-3, 50e-3, 0.5),
    "75 mm, from 0.4 m": ("sokolov", 75e-3, 50e-3, 0.4),
    "75 mm, from 0.38 m, near singularities": ("sokolov", 75e-3, 50e-3, 0.38),
    "small": ("micro", 0.2e-3, 0.1e-3, 0.225),
}


def by_constraints(
    robot: RPSRobot, motion: Motion, engine: str = "pinocchio"
) -> tuple[Array, Array]:
    """Forces (n, 3) by constraint models, and the condition numbers (n,)."""
    if engine == "generated":
        whole = common.through(engine, robot.mechanism).inverse_dynamics(*robot.state(*motion))
        return whole.tau, whole.condition
    solved = [robot.inverse_dynamics(*x) for x in zip(*robot.state(*motion), strict=True)]
    return np.array([one.tau for one in solved]), np.array([one.condition for one in solved])


def disagreements(
    robot: RPSRobot, motion: Motion, engine: str = "pinocchio"
) -> tuple[dict[str, float], int]:
    """Largest difference between any two ways over the state's force; how many states are left out.

    Left out are states near singularities.
    """
    tau, condition = by_constraints(robot, motion, engine)
    kept = condition <= WELL_CONDITIONED
    chosen = tuple(x[kept] for x in motion)
    p = robot.parameters
    ways = {
        "constraints": tau[kept],
        "lagrange": lagrange_forces(p, *chosen).force,
        "virtual work": virtual_work_forces(p, *chosen),
        "newton-euler": ne.inverse_dynamics(p, *chosen).forces,
    }
    size = np.abs(ways["newton-euler"]).max(axis=-1)
    names = list(ways)
    apart = {
        f"{one} - {other}": float((np.abs(ways[one] - ways[other]).max(axis=-1) / size).max())
        for index, one in enumerate(names)
        for other in names[index + 1 :]
    }
    return apart, int((~kept).sum())


@pytest.mark.parametrize("tilted_gravity", [False, True], ids=["vertical", "tilted gravity"])
@pytest.mark.parametrize("heavy_rods", [False, True], ids=["massless rods", "heavy rods"])
def test_three_ways_agree_on_2500_states_of_50_random_robots(
    heavy_rods: bool, tilted_gravity: bool
) -> None:
    """Four times: 10,000 states of 200 robots."""
    rng = np.random.default_rng([5, heavy_rods, tilted_gravity])
    robots, states, skipped = 50, 50, 0
    largest: dict[str, float] = {}
    for _ in range(robots):
        parameters = random_parameters(rng, heavy_rods=heavy_rods, tilted_gravity=tilted_gravity)
        motion = random_motions(rng, parameters, states)
        apart, left_out = disagreements(RPSRobot(parameters), motion)
        skipped += left_out
        largest = {name: worst(largest.get(name, 0.0), value) for name, value in apart.items()}
    print({name: f"{value:.1e}" for name, value in largest.items()}, f"skipped: {skipped}")
    assert skipped < 0.01 * robots * states
    assert {name: value for name, value in largest.items() if not value < AGREEMENT} == {}
    assert len(largest) == 6


@common.both_engines
@pytest.mark.parametrize("branch", ["+", "-"])
@pytest.mark.parametrize("name", HELICES)
def test_three_ways_agree_along_helices(name: str, branch: str, engine: str) -> None:
    preset, radius, pitch, height = HELICES[name]
    robot = RPSRobot.from_preset(preset)
    path = helix(robot, radius=radius, pitch=pitch, height=height, branch=branch)
    apart, skipped = disagreements(robot, path.sample(np.linspace(0, path.duration, 500)), engine)
    print({key: f"{value:.1e}" for key, value in apart.items()}, f"skipped: {skipped}")
    assert skipped <= 5
    assert {key: value for key, value in apart.items() if not value < AGREEMENT} == {}


@pytest.mark.parametrize("fastest", [False, True], ids=["as it is", "fastest"])
@pytest.mark.parametrize("file", SHOWN, ids=lambda file: file.stem)
def test_three_ways_agree_along_every_trajectory_the_documentation_shows(
    file: Path, fastest: bool
) -> None:
    robot = RPSRobot.from_preset("micro")
    path = load_trajectory(file, robot)
    if fastest:
        path = time_optimal(robot, path)
    apart, skipped = disagreements(robot, path.sample(np.linspace(0, path.duration, 500)))
    assert skipped == 0
    assert {key: value for key, value in apart.items() if not value < AGREEMENT} == {}


@pytest.mark.parametrize(
    "field",
    [
        *("platform_mass", "platform_inertia", "leg_mass", "leg_com", "leg_inertia"),
        *("rod_mass", "rod_com", "rod_inertia"),
    ],
)
def test_every_parameter_counts_in_every_way(field: str) -> None:
    """A thousandth more of it moves the forces, far beyond the agreement and by as much."""
    rng = np.random.default_rng(6)
    parameters = random_parameters(rng)
    motion = random_motions(rng, parameters, 20)
    other = parameters.replace(**{field: 1.001 * getattr(parameters, field)})
    moved = [
        lagrange_forces(other, *motion).force - lagrange_forces(parameters, *motion).force,
        virtual_work_forces(other, *motion) - virtual_work_forces(parameters, *motion),
        by_constraints(RPSRobot(other), motion)[0]
        - by_constraints(RPSRobot(parameters), motion)[0],
    ]
    size = np.abs(virtual_work_forces(parameters, *motion)).max()
    for one in moved:
        assert np.abs(one).max() > 1e-6 * size
        np.testing.assert_allclose(one, moved[0], rtol=0, atol=1e-9 * size)


def test_massless_rods_are_the_paper_s_robot() -> None:
    """As the rods' masses vanish, forces go to those of the paper's bodies, in every way."""
    rng = np.random.default_rng(7)
    parameters = random_parameters(rng)
    motion = random_motions(rng, parameters, 50)
    paper_s = parameters.replace(rod_mass=0.0, rod_com=0.0, rod_inertia=0.0)
    expected = ne.inverse_dynamics(paper_s, *motion).forces
    size = np.abs(expected).max(axis=-1, keepdims=True)
    for force in (lagrange_forces(paper_s, *motion).force, virtual_work_forces(paper_s, *motion)):
        assert (np.abs(force - expected) / size).max() < AGREEMENT
    for share in (1e-3, 1e-6):
        light = parameters.replace(
            rod_mass=share * parameters.rod_mass, rod_inertia=share * parameters.rod_inertia
        )
        more = virtual_work_forces(light, *motion) - expected
        all_of_it = virtual_work_forces(parameters, *motion) - expected
        # forces are linear in the bodies' masses
        assert (np.abs(more - share * all_of_it) / size).max() < AGREEMENT
