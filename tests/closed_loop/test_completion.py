"""Forces of any number of actuators by completed velocities: those of the null space."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, JointCoupling, SingularityError
from rps_pin.closed_loop.constraints.least_squares import PassiveLeastSquares
from rps_pin.closed_loop.dynamics.inverse_dynamics import InverseDynamics, null_space_solution
from rps_pin.numerics.linear_algebra import Decomposition
from tests.closed_loop import mechanisms
from tests.closed_loop.random_mechanisms import Case, case, force_of_bodies
from tests.worst import worst

Array = NDArray[np.float64]

SEEDS = range(20)


def by_null_space(c: Case, of: ClosedLoopModel) -> tuple[Array, Array, Array | None]:
    """tau, lambda and residual force of a case, other joints being actuated."""
    factors = Decomposition(of.system.scaled(of.jacobian(c.q)))
    force = force_of_bodies(c, c.v, c.a)
    indices = of.actuated_indices
    tau, scaled, rest = null_space_solution(factors, indices, force, of.velocity_scale)
    return tau, of.row_scale * scaled, rest


def with_actuators(c: Case, names: list[str]) -> ClosedLoopModel:
    m = c.mechanism
    return ClosedLoopModel(
        m.model,
        m.closures,
        names,
        home=c.q,
        effects=m.effects,
        characteristic_length=m.characteristic_length,
    )


def some_actuators(c: Case, seed: int) -> list[str]:
    """Fewer or more joints than needed, or others; also such as are fixed by the closures."""
    rng = np.random.default_rng(seed)
    names = list(c.mechanism.model.names)[1:]
    return [str(name) for name in rng.permutation(names)[: rng.integers(1, len(names) + 1)]]


def error(
    found: InverseDynamics, expected: tuple[Array, Array, Array | None], size: float
) -> float:
    tau, multipliers, rest = expected
    assert (found.unproduced is None) == (rest is None)
    parts = [found.tau - tau, found.constraint_forces - multipliers]
    if rest is not None and found.unproduced is not None:
        parts.append(found.unproduced - rest)
    return worst(*parts) / size


@pytest.mark.parametrize("planar", [False, True])
def test_any_actuators_get_the_forces_of_the_null_space(planar: bool) -> None:
    """Also where rows are redundant; and most of them by the factorisation."""
    errors, by_factors = [], 0
    for seed in SEEDS:
        c = case(seed, planar=planar, effects=seed % 2 == 0, armature=seed % 3 == 0)
        m = with_actuators(c, some_actuators(c, seed))
        size = 1.0 + np.linalg.norm(force_of_bodies(c, c.v, c.a))
        for _ in range(2):  # the first call chooses velocities
            found = m.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches)
        errors.append(error(found, by_null_space(c, m), size))
        completion = m.system.completion
        if completion is not None:
            force = force_of_bodies(c, c.v, c.a)
            by_factors += completion.forces(m.jacobian(c.q), force) is not None
    assert worst(errors) < 1e-9
    assert by_factors > 12


def test_least_squares_and_factors_give_the_same_forces() -> None:
    """Passive velocities that meet all rows; units differ where joints slide."""
    errors, scaled = [], 0
    for seed in range(30):
        c = case(seed, effects=seed % 2 == 0)
        m = with_actuators(c, some_actuators(c, seed)[:2])
        m.inverse_dynamics(c.q, c.v, c.a)  # which chooses velocities
        completion = m.system.completion
        if completion is None or completion._squares is None:
            continue
        scaled += completion._squares._scaling is not None
        force, jacobian = force_of_bodies(c, c.v, c.a), m.jacobian(c.q)
        found = completion._by_least_squares(completion._squares, jacobian, force)
        wanted = completion._by_factors(jacobian, force)
        assert found is not None and wanted is not None
        assert found[3] is not None and wanted[3] is not None
        size = np.linalg.norm(force)
        errors += [worst(*(one - other for one, other in zip(found, wanted, strict=True))) / size]
    assert len(errors) > 3 and scaled > 0
    assert worst(errors) < 1e-10


def test_least_squares_want_full_row_rank() -> None:
    squares = PassiveLeastSquares(np.arange(3), np.ones(2), np.ones(4), 1e8)
    assert squares.multipliers(np.array([[1.0, 2, 3, 4], [2, 4, 6, 8]]), np.ones(4)) is None


def test_two_actuators_on_one_freedom_share_its_force() -> None:
    """Two arms that turn as one, a balanced wheel beside them: as many motors as motions."""
    model = pin.Model()
    for name, y in (("left", 0.0), ("right", 0.1), ("idler", 0.2)):
        place = pin.SE3(np.eye(3), np.array([0.0, y, 0.0]))
        joint = model.addJoint(0, pin.JointModelRY(), place, name)
        lever = np.array([0.0 if name == "idler" else 0.1, 0.0, 0.0])
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.05), pin.SE3(np.eye(3), lever))
    closures, still = [JointCoupling("left", "right")], np.zeros(3)
    both = ClosedLoopModel(model, closures, ["left", "right"])
    found = both.inverse_dynamics(both.home, still, still)
    np.testing.assert_allclose(found.tau, [-0.981, -0.981], rtol=1e-12)
    assert found.unproduced is None
    assert found.condition == 1.0
    one = ClosedLoopModel(model, closures, ["left"])
    found = one.inverse_dynamics(one.home, still, still)
    np.testing.assert_allclose(found.tau, [-1.962], rtol=1e-12)
    assert found.unproduced is None
    # To turn the wheel takes a force that nobody has: its inertia, by 2 rad/s^2.
    found = both.inverse_dynamics(both.home, still, np.array([0.0, 0.0, 2.0]))
    inertia = model.inertias[3].inertia[1, 1]
    np.testing.assert_allclose(found.unproduced, [0.0, 0.0, 2 * inertia], rtol=1e-12)


def flat_parallelogram(actuated: list[str]) -> tuple[ClosedLoopModel, Array]:
    """All bars along x: the two rows of its loop are one there."""
    flat = mechanisms.FourBar(
        ground=0.4,
        crank=mechanisms.Bar(0.2, 1.0, 0.1, 0.0, 0.01),
        coupler=mechanisms.Bar(0.4, 1.0, 0.2, 0.0, 0.01),
        rocker=mechanisms.Bar(0.2, 1.0, 0.1, 0.0, 0.01),
    )
    return flat.spherical_mechanism(actuated=actuated), np.zeros(3)


def stretched_four_bar(actuated: list[str]) -> tuple[ClosedLoopModel, Array]:
    """Coupler and rocker in one line: the crank stands still in the one motion there."""
    bar = mechanisms.FourBar(
        ground=0.4,
        crank=mechanisms.Bar(0.5, 1.0, 0.2, 0.0, 0.01),
        coupler=mechanisms.Bar(0.2, 1.0, 0.1, 0.0, 0.01),
        rocker=mechanisms.Bar(0.3, 1.0, 0.1, 0.0, 0.01),
    )
    mechanism = bar.spherical_mechanism(actuated=actuated)
    crank = np.arccos(0.4)  # 0.4^2 + 0.5^2 - 0.4 cos = (0.2 + 0.3)^2
    line = np.array([0.4, 0.0]) - 0.5 * np.array([np.cos(crank), np.sin(crank)])
    along = float(np.arctan2(line[1], line[0]))
    angles = {"crank_joint": crank, "coupler_joint": along - crank, "rocker_joint": along + np.pi}
    return mechanism, mechanisms.values(mechanism, angles)


@pytest.mark.parametrize("make", [flat_parallelogram, stretched_four_bar])
@pytest.mark.parametrize("actuated", [["crank_joint"], []])
def test_a_singular_configuration_is_refused(make, actuated: list[str]) -> None:
    """Exactly there, as beside it; also if an actuator is there twice: gears couple a motor."""
    mechanism, q = make(["crank_joint"])
    if not actuated:  # a second motor, geared to the crank
        model = pin.Model(mechanism.model)
        motor = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "motor")
        model.appendBodyToJoint(motor, pin.Inertia.FromSphere(0.1, 0.02), pin.SE3.Identity())
        gear = JointCoupling("motor", "crank_joint", ratio=3.0, offset=0.1)
        closures = [*mechanism.closures, gear]
        mechanism = ClosedLoopModel(model, closures, ["motor", "crank_joint"])
        at = model.joints[model.getJointId("crank_joint")].idx_q
        q = np.append(q, 3.0 * q[at] + 0.1)
    still = np.zeros(mechanism.model.nv)
    assert mechanism.loop_gap(q) < 1e-12
    with pytest.raises(SingularityError):
        mechanism.inverse_dynamics(q, still, still)
    moved = q.copy()
    moved[mechanism.model.joints[mechanism.model.getJointId("rocker_joint")].idx_q] += 0.3
    beside = mechanism.close(moved, fixed=["rocker_joint"])
    found = mechanism.inverse_dynamics(beside, still, still)
    assert found.unproduced is None
    with pytest.raises(SingularityError):  # still, after velocities were chosen
        mechanism.inverse_dynamics(q, still, still)
