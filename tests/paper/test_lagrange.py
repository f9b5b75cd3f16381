"""Lagrange's equations of the first kind: against SymPy's, energies by steps, and the paper."""

from __future__ import annotations

import re
import runpy
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, RPSParameters, RPSRobot, SingularityError, UnreachableError, helix
from rps_pin.paper.lagrange import LagrangeDynamics, lagrange_forces
from rps_pin.paper.lagrange_terms import (
    PRINTED,
    Energies,
    LagrangeTerms,
    constraints,
    energies,
    lagrange_terms,
)
from rps_pin.trajectories.path import PathSample
from tests.reference import newton_euler as ne
from tests.reference.lagrange_by_steps import inertia_forces, slopes
from tests.strategies import LEG_ANGLES, random_motions, random_parameters, relative_error

Array = NDArray[Any]

SCRIPT = Path(__file__).parents[2] / "docs" / "derive_lagrange.py"
RADIAL = np.stack([np.cos(LEG_ANGLES), np.sin(LEG_ANGLES), 0 * LEG_ANGLES], axis=-1)
UP = np.array([0.0, 0.0, 1.0])
LEVEL = [0.4, 0.0, 0.0]
STILL = [0.0, 0.0, 0.0]


def sokolov() -> RPSParameters:
    return RPSParameters.from_preset("sokolov")


def anywhere(rng: np.random.Generator, parameters: RPSParameters, count: int) -> list[Array]:
    """d, phi, d' and phi' that close nothing."""
    return [
        parameters.base_radius * rng.uniform(0.3, 3.0, (count, 3)),
        rng.uniform(-np.pi, np.pi, (count, 3)),
        rng.normal(size=(count, 3)),
        rng.normal(scale=3.0, size=(count, 3)),
    ]


def closed(parameters: RPSParameters, motion: tuple[Array, Array, Array]) -> tuple[Array, ...]:
    """x = (d, phi), x' and x'' of a motion, from the reference."""
    k = ne.kinematics(parameters, *motion)
    return (
        np.concatenate([k.leg_lengths, k.leg_angles], axis=-1),
        np.concatenate([k.leg_length_rates, k.leg_angle_rates], axis=-1),
        np.concatenate([k.leg_length_accelerations, k.leg_angle_accelerations], axis=-1),
    )


def halves(x: Array, rate: Array) -> tuple[Array, Array, Array, Array]:
    return x[..., :3], x[..., 3:], rate[..., :3], rate[..., 3:]


# Against SymPy ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def derived() -> Callable[..., Any]:
    """docs/derive_lagrange.py, evaluated with numbers."""
    evaluate: Callable[..., Any] = runpy.run_path(str(SCRIPT))["compiled"]()
    return evaluate


def test_the_derivation_starts_from_right_equations(capsys: pytest.CaptureFixture[str]) -> None:
    """Eq. 8 as printed is that of the tips' distances; the second moments give w' I w."""
    runpy.run_path(str(SCRIPT))["print_checks"]()
    differences = re.findall(r": (\S+)$", capsys.readouterr().out, re.MULTILINE)
    assert differences == ["0", "0", "0", "0"]


def numbers(parameters: RPSParameters) -> list[float]:
    p, inertia = parameters, parameters.platform_inertia
    return [
        *(p.base_radius, p.platform_radius, p.platform_mass),
        *np.diag(inertia),
        *(inertia[0, 1], inertia[0, 2], inertia[1, 2]),
        *(p.leg_mass, p.leg_com, p.leg_inertia_about_com),
        *(p.rod_mass, p.rod_com, p.rod_inertia),
        *p.gravity,
    ]


@pytest.mark.parametrize("seed", range(6))
def test_every_term_is_sympy_s(derived: Callable[..., Any], seed: int) -> None:
    rng = np.random.default_rng(seed)
    parameters = random_parameters(rng, heavy_rods=seed % 3 > 0, tilted_gravity=seed % 2 == 0)
    states = anywhere(rng, parameters, 50)
    found: dict[str, Array] = lagrange_terms(parameters, *states)._asdict()
    found["constraints"] = constraints(parameters, *states[:2])
    found["energies"] = np.stack(energies(parameters, *states), axis=-1)
    expected = [
        derived(*numbers(parameters), *np.concatenate(x)) for x in zip(*states, strict=True)
    ]
    for name, values in found.items():
        wanted = np.array([one[name] for one in expected]).reshape(values.shape)
        assert relative_error(values, wanted, axes=values.ndim - 1) < 1e-12, name


def effort(terms: LagrangeTerms, acceleration: Array) -> Array:
    """M x'' + c."""
    return (terms.mass_matrix @ acceleration[..., None])[..., 0] + terms.coriolis


# Against energies, written down anew --------------------------------------------------------------


def axes_and_rates(parameters: RPSParameters, x: Array, rate: Array) -> tuple[Array, Array]:
    """(u, v, n) and their time derivatives, (..., 3 axes, 3): Eq. 2 and 7."""
    d, phi, dd, dphi = (part[..., None] for part in halves(x, rate))
    g, h = parameters.base_radius, parameters.platform_radius
    tip = (g - d * np.cos(phi)) * RADIAL + d * np.sin(phi) * UP
    moving = (d * np.sin(phi) * dphi - dd * np.cos(phi)) * RADIAL + (
        d * np.cos(phi) * dphi + dd * np.sin(phi)
    ) * UP
    found = []
    for b in (tip, moving):
        u = (b[..., 0, :] - b.mean(axis=-2)) / h
        v = (b[..., 1, :] - b[..., 2, :]) / (np.sqrt(3) * h)
        found.append((u, v))
    (u, v), (du, dv) = found
    n, dn = np.cross(u, v), np.cross(du, v) + np.cross(u, dv)
    return np.stack([u, v, n], axis=-2), np.stack([du, dv, dn], axis=-2)


def turning_energy(parameters: RPSParameters, x: Array, rate: Array, *, literally: bool) -> Array:
    """Omega' (R I R') Omega/2, or with R I R as Eq. 14 is printed."""
    axes, rates = axes_and_rates(parameters, x, rate)
    spin = np.cross(axes, rates).sum(axis=-2) / 2
    R = np.swapaxes(axes, -1, -2)
    inertia = R @ parameters.platform_inertia @ (R if literally else axes)
    energy: Array = (spin * (inertia @ spin[..., None])[..., 0]).sum(axis=-1) / 2
    return energy


def test_energies_are_the_reference_s_where_the_robot_is_closed() -> None:
    rng = np.random.default_rng(20)
    for _ in range(10):
        parameters = random_parameters(rng, tilted_gravity=True)
        motion = random_motions(rng, parameters, 200)
        x, rate, _ = closed(parameters, motion)
        found = energies(parameters, *halves(x, rate))
        kinetic = found.platform_kinetic + found.legs_kinetic
        potential = found.platform_potential + found.legs_potential
        at_rest = ne.energy(parameters, motion[0], np.zeros(3))
        moving = ne.energy(parameters, *motion[:2]) - at_rest
        np.testing.assert_allclose(kinetic, moving, rtol=1e-11)
        size = np.abs(found.platform_potential) + np.abs(found.legs_potential)
        assert (np.abs(potential - at_rest) < 1e-13 * size.max()).all()


def test_power_of_the_equations_is_the_energies_rate() -> None:
    """x' . (M x'' + c + gravity) = dE/dt, closed or not."""
    rng = np.random.default_rng(21)
    parameters = random_parameters(rng, tilted_gravity=True)
    state = anywhere(rng, parameters, 30)
    x, rate = np.concatenate(state[:2], -1), np.concatenate(state[2:], -1)
    terms = lagrange_terms(parameters, *state)
    acceleration = rng.normal(size=(30, 6))
    force = effort(terms, acceleration) + terms.gravity

    def energy(t: float) -> Array:
        moved = x + rate * t + acceleration * t**2 / 2
        found: Array = sum(energies(parameters, *halves(moved, rate + acceleration * t)))
        return found

    step = 1e-3
    change = (8 * (energy(step) - energy(-step)) - (energy(2 * step) - energy(-2 * step))) / (
        12 * step
    )
    size = np.abs(rate * force).sum(axis=-1)
    assert (np.abs((rate * force).sum(axis=-1) - change) < 1e-8 * size).all()


def test_eq_14_as_printed_is_the_equation_of_its_energy() -> None:
    rng = np.random.default_rng(22)
    for _ in range(5):
        parameters = random_parameters(rng)
        state = anywhere(rng, parameters, 40)
        x, rate = np.concatenate(state[:2], -1), np.concatenate(state[2:], -1)
        acceleration = rng.normal(size=(40, 6))
        literally = partial(turning_energy, parameters, literally=True)
        expected = inertia_forces(literally, x, rate, acceleration)
        # All that turns, less what a platform (nearly) without inertia leaves.
        point = parameters.replace(platform_inertia=1e-12 * np.eye(3))
        turning = lagrange_terms(parameters, *state, as_printed=["eq_14"])
        rest = lagrange_terms(point, *state)
        found = effort(turning, acceleration) - effort(rest, acceleration)
        assert relative_error(found, expected) < 1e-8


def test_forces_do_not_depend_on_how_the_energy_is_continued_and_multipliers_do() -> None:
    """Eq. 13 by Omega agrees with the terms' energy on closed motions only."""
    rng = np.random.default_rng(23)
    parameters = random_parameters(rng)
    motion = random_motions(rng, parameters, 200)
    solved = lagrange_forces(parameters, *motion)
    x, rate, acceleration = closed(parameters, motion)
    moments = np.trace(parameters.platform_inertia) / 2 * np.eye(3) - parameters.platform_inertia

    def by_moments(y: Array, v: Array) -> Array:
        _, r = axes_and_rates(parameters, y, v)
        energy: Array = np.einsum("...ak,ab,...bk->...", r, moments, r) / 2
        return energy

    def by_spin(y: Array, v: Array) -> Array:
        return turning_energy(parameters, y, v, literally=False)

    np.testing.assert_allclose(by_spin(x, rate), by_moments(x, rate), rtol=1e-10)
    exchanged = inertia_forces(by_spin, x, rate, acceleration) - inertia_forces(
        by_moments, x, rate, acceleration
    )
    A = np.swapaxes(solved.constraint_jacobian, -1, -2)
    more = np.linalg.solve(A[..., 3:, :], exchanged[..., 3:, None])
    change = exchanged[..., :3] - (A[..., :3, :] @ more)[..., 0]
    assert np.median(np.abs(more[..., 0] / solved.multipliers)) > 1e-2
    assert (np.abs(change).max(-1) < 1e-9 * np.abs(solved.force).max(-1)).all()


# The paper's equations ----------------------------------------------------------------------------


def test_forces_and_multipliers_solve_equation_22() -> None:
    rng = np.random.default_rng(24)
    for _ in range(5):
        parameters = random_parameters(rng)
        motion = random_motions(rng, parameters, 100)
        _, _, acceleration = closed(parameters, motion)
        found = lagrange_forces(parameters, *motion)
        left = (found.mass_matrix @ acceleration[..., None])[..., 0]
        left = left + found.coriolis + found.gravity
        right = (np.swapaxes(found.constraint_jacobian, -1, -2) @ found.multipliers[..., None])[
            ..., 0
        ]
        right[..., :3] += found.force
        assert relative_error(right, left) < 1e-9


def test_closed_motions_keep_equation_8() -> None:
    rng = np.random.default_rng(25)
    parameters = random_parameters(rng)
    motion = random_motions(rng, parameters, 100)
    x, rate, _ = closed(parameters, motion)
    A = lagrange_forces(parameters, *motion).constraint_jacobian
    assert np.abs(constraints(parameters, x[:, :3], x[:, 3:])).max() < 1e-13
    assert np.abs(A @ rate[..., None]).max() < 1e-12


def test_both_readings_of_equation_16() -> None:
    """I_leg about the joint: I phi'^2/2. About the com: m r^2 phi'^2/2 more, as printed."""
    rng = np.random.default_rng(26)
    for about, more in (("joint", 0.0), ("com", 1.0)):
        parameters = sokolov().replace(leg_inertia_about=about)
        state = anywhere(rng, parameters, 20)
        m, r, inertia = 0.09, 0.2, 0.05
        expected = (more * m * r**2 + inertia) * (state[3] ** 2).sum(axis=-1) / 2
        np.testing.assert_allclose(energies(parameters, *state).legs_kinetic, expected, rtol=1e-14)


def test_eq_19_as_printed_weighs_the_platform_as_one_kilogram() -> None:
    rng = np.random.default_rng(27)
    parameters = sokolov()
    d, phi, dd, dphi = anywhere(rng, parameters, 20)
    printed = energies(parameters, d, phi, dd, dphi, as_printed=["eq_19"])
    correct = energies(parameters, d, phi, dd, dphi)
    height = (d * np.sin(phi)).mean(axis=-1)  # Eq. 20
    np.testing.assert_allclose(printed.platform_potential, 9.81 * height, rtol=1e-13)
    np.testing.assert_allclose(correct.platform_potential, 9.81 * 0.18 * height, rtol=1e-13)

    def potential(x: Array) -> Array:
        lengths, angles = x[..., :3], x[..., 3:]
        legs = 9.81 * 0.2 * 0.09 * np.sin(angles).sum(axis=-1)  # Eq. 21
        return 9.81 * (lengths * np.sin(angles)).mean(axis=-1) + legs

    found = lagrange_terms(parameters, d, phi, dd, dphi, as_printed=["eq_19"]).gravity
    expected = slopes(potential, np.concatenate([d, phi], axis=-1))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


def test_equations_as_printed_move_the_energy_they_print() -> None:
    """Along the helix the actuators' power is the rate of the energy of the printed equations."""
    parameters = sokolov()
    path = helix(RPSRobot(parameters), radius=75e-3, pitch=50e-3, height=0.5, branch="-")
    motion: PathSample = path.sample(np.linspace(0.01, path.duration - 0.01, 60))
    speed = ne.kinematics(parameters, *motion).leg_length_rates
    for printed in ([], ["eq_14"], ["eq_19"], ["eq_14", "eq_19"]):
        force = lagrange_forces(parameters, *motion, as_printed=printed).force
        change = energy_rate(parameters, motion, printed)
        assert np.abs((force * speed).sum(-1) - change).max() < 1e-9 * np.abs(force * speed).max()


def energy_rate(parameters: RPSParameters, motion: PathSample, printed: list[str]) -> Array:
    """dE/dt along pose + rate t + acceleration t^2/2, by central differences."""
    step = 1e-4

    def energy(t: float) -> Array:
        pose = motion.pose + motion.rate * t + motion.acceleration * t**2 / 2
        rate = motion.rate + motion.acceleration * t
        x, dx, _ = closed(parameters, (pose, rate, np.zeros(3)))
        found: Array = sum(energies(parameters, *halves(x, dx), as_printed=printed))
        return found

    near, far = energy(step) - energy(-step), energy(2 * step) - energy(-2 * step)
    return (8 * near - far) / (12 * step)


# Single states, batches and bad input -------------------------------------------------------------


def test_batches_are_their_single_states() -> None:
    rng = np.random.default_rng(28)
    parameters = random_parameters(rng)
    motion = tuple(x.reshape(2, 3, 3) for x in random_motions(rng, parameters, 6))
    for printed in ([], ["eq_14"]):
        batch = lagrange_forces(parameters, *motion, as_printed=printed)
        assert isinstance(batch, LagrangeDynamics)
        for index in np.ndindex(2, 3):
            one = lagrange_forces(parameters, *(x[index] for x in motion), as_printed=printed)
            for whole, single in zip(batch, one, strict=True):
                np.testing.assert_allclose(whole[index], single, rtol=1e-10, atol=1e-11)
    shapes = [part.shape for part in lagrange_forces(parameters, *(np.zeros((0, 3)),) * 3)]
    assert shapes == [(0, 3), (0, 3), (0, 6, 6), (0, 6), (0, 6), (0, 3, 6)]


def test_level_robot_at_rest_carries_its_weight() -> None:
    """By hand: 3 F sin(phi) dz = weight dz + 3 m_leg r g cos(phi) dphi, d dphi = cos(phi) dz."""
    p = sokolov()
    phi = np.arctan2(0.4, p.base_radius - p.platform_radius)
    d = 0.4 / np.sin(phi)
    legs = p.leg_mass * p.leg_com * np.cos(phi) ** 2 / d
    expected = 9.81 * (p.platform_mass / 3 + legs) / np.sin(phi)
    np.testing.assert_allclose(lagrange_forces(p, LEVEL, STILL, STILL).force, expected, rtol=1e-13)


@pytest.mark.parametrize("pose", [[0.0, 0.0, 0.0], [0.4, np.pi, 0.0]], ids=["flat", "half a turn"])
def test_poses_that_do_not_determine_the_multipliers_are_refused(pose: list[float]) -> None:
    with pytest.raises(SingularityError, match=r"Eq\. 25 does not determine") as caught:
        lagrange_forces(sokolov(), pose, STILL, STILL)
    assert caught.value.condition > caught.value.limit == 1e8
    with pytest.raises(SingularityError, match=r"entry \(1,\) of 2"):
        lagrange_forces(sokolov(), [LEVEL, pose], STILL, STILL)


def test_bad_input_is_refused_by_name() -> None:
    p = sokolov()
    with pytest.raises(InputError, match="as_printed = 'eq_12': it must be 'eq_14' or 'eq_19'"):
        lagrange_forces(p, LEVEL, STILL, STILL, as_printed=["eq_12"])
    with pytest.raises(InputError, match="rate is not finite"):
        lagrange_forces(p, LEVEL, [0, np.nan, 0], STILL)
    with pytest.raises(InputError, match="length of leg 2 is -1 m"):
        lagrange_terms(p, [1, -1, 1], STILL, STILL, STILL)
    with pytest.raises(InputError, match="angle has shape"):
        lagrange_terms(p, [1, 1, 1], [0.0], STILL, STILL)
    with pytest.raises(InputError, match="do not go together"):
        energies(p, np.ones((2, 3)), STILL, np.ones((4, 3)), STILL)
    with pytest.raises(InputError, match="max_gain = -1: it must be positive"):
        lagrange_forces(p, LEVEL, STILL, STILL, max_gain=-1)
    upright = p.replace(platform_radius=p.base_radius)
    with pytest.raises(UnreachableError, match="leg 1 would have length 0 m"):
        lagrange_forces(upright, [0.0, 0.0, 0.0], STILL, STILL)


def test_one_name_is_as_good_as_a_list_of_one() -> None:
    state = ([0.5] * 3, [1.0, 1.1, 1.2], [0.1] * 3, [0.2] * 3)
    for name in PRINTED:
        one: Energies = energies(sokolov(), *state, as_printed=name)
        np.testing.assert_array_equal(one, energies(sokolov(), *state, as_printed=[name]))
        assert one != energies(sokolov(), *state)
