"""ANYmal on four point feet: 18 velocities, 12 rows, mobility 6, 12 actuators.

Gravity compensation, checked by hand: the feet carry the weight, and their moments about the centre
of mass balance.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.linalg import null_space

from rps_pin import ClosedLoopModel, InfeasibleError, LoopClosure
from rps_pin.closed_loop.dynamics.force_bounds import ForceBound, friction_pyramid
from rps_pin.closed_loop.dynamics.force_distribution import DistributedForces, ForceDistribution
from tests.closed_loop import mechanisms
from tests.proofs import common, optima, robot_data
from tests.worst import worst

Array = NDArray[np.float64]

FEET = ["LF", "RF", "LH", "RH"]
#: Where they stand, m; not quite symmetric.
PLACES = [(0.17, 0.2, 0.0), (0.15, -0.19, 0.0), (-0.16, 0.21, 0.0), (-0.14, -0.2, 0.0)]
GRAVITY = 9.81


@cache
def standing() -> tuple[pin.Model, Array]:
    """The robot on its free-flyer, and roughly how it stands."""
    path = robot_data.path_of("anymal_b_simple_description/robots/anymal.urdf")
    model = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    q = pin.neutral(model)
    q[2] = 0.43
    q[7:] = [0.0, 0.9, -1.5, 0.0, 0.9, -1.5, 0.0, -0.9, 1.5, 0.0, -0.9, 1.5]
    return model, q


@cache
def quadruped() -> ClosedLoopModel:
    """Each foot on a ball fixed in the world, on level ground, nearer together than the hips."""
    robot, q = standing()
    model, closures = robot.copy(), []
    for foot, place in zip(FEET, PLACES, strict=True):
        ground = pin.Frame(
            f"{foot}_ground", 0, 0, pin.SE3(np.eye(3), np.array(place)), pin.FrameType.OP_FRAME
        )
        model.addFrame(ground)
        closures.append(LoopClosure(f"{foot}_FOOT", f"{foot}_ground", "spherical", name=foot))
    actuated = list(model.names)[2:]
    rough = ClosedLoopModel(model, closures, actuated)
    home = rough.complete({"root_joint": q[:7]}, q)
    return ClosedLoopModel(model, closures, actuated, home=home, name="quadruped")


def still() -> common.State:
    q = quadruped().home
    return q, np.zeros(18), np.zeros(18)


def check_feet(q: Array, forces: Array) -> None:
    """They carry the weight, and turn nothing about the centre of mass."""
    robot, _ = standing()
    data = robot.createData()
    centre = pin.centerOfMass(robot, data, q)
    pin.framesForwardKinematics(robot, data, q)
    force, moment = np.zeros(3), np.zeros(3)
    for foot in FEET:
        push = forces[quadruped().rows(foot)]
        force += push
        moment += np.cross(data.oMf[robot.getFrameId(f"{foot}_FOOT")].translation - centre, push)
    weight = pin.computeTotalMass(robot) * GRAVITY
    np.testing.assert_allclose(force, [0, 0, weight], rtol=0, atol=1e-9 * weight)
    np.testing.assert_allclose(moment, 0.0, rtol=0, atol=1e-9 * weight)


def check_legs(q: Array, tau: Array, forces: Array) -> None:
    """The joints of each leg hold its own weight and what the ground does to its foot."""
    robot, _ = standing()
    data = robot.createData()
    needed = pin.computeGeneralizedGravity(robot, data, q)[6:]
    for foot in FEET:
        jacobian = pin.computeFrameJacobian(
            robot,
            data,
            q,
            robot.getFrameId(f"{foot}_FOOT"),
            pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
        )[:3, 6:]
        needed = needed - jacobian.T @ forces[quadruped().rows(foot)]
    np.testing.assert_allclose(tau, needed, rtol=0, atol=1e-9 * max(1.0, np.abs(tau).max()))


@common.both_engines
def test_closes_from_rough_guesses(engine: str) -> None:
    mechanism = common.through(engine, quadruped())
    for guess in common.guesses(mechanism, 0.15, 8):
        q = mechanism.close(guess)
        assert mechanism.loop_gap(q) <= 1e-12
        assert common.distances(mechanism, q).max() <= 1e-12


@common.both_engines
def test_body_can_move_six_ways(engine: str) -> None:
    """And every motion of the body moves the legs as the inverse of each leg's Jacobian says."""
    mechanism, (q, _, _) = common.through(engine, quadruped()), still()
    robot, _ = standing()
    data = robot.createData()
    basis = mechanism.motion_basis(q, ["root_joint"])
    assert basis.shape == (18, 6)
    for foot in FEET:
        jacobian = pin.computeFrameJacobian(
            robot,
            data,
            q,
            robot.getFrameId(f"{foot}_FOOT"),
            pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
        )[:3]
        own = [robot.joints[robot.getJointId(f"{foot}_{j}")].idx_v for j in ("HAA", "HFE", "KFE")]
        expected = -np.linalg.solve(jacobian[:, own], jacobian[:, :6])
        np.testing.assert_allclose(basis[own], expected, rtol=0, atol=1e-10)


def least_norm(q: Array) -> Array:
    """Of all torques that keep it standing, those of least sum of squares, by own algebra."""
    robot, _ = standing()
    motions = null_space(mechanisms.loop_jacobian(quadruped(), q), rcond=1e-10)
    weight = pin.computeGeneralizedGravity(robot, robot.createData(), q)
    return np.linalg.pinv(motions[6:].T) @ (motions.T @ weight)


@common.both_engines
def test_stands_by_the_least_norm_torques(engine: str) -> None:
    mechanism = common.through(engine, quadruped())
    for guess in common.guesses(mechanism, 0.05, 5):
        q = mechanism.close(guess)
        tau = least_norm(q)
        none = np.zeros(18)
        pull = mechanism.forward_dynamics(q, none, tau)
        np.testing.assert_allclose(pull, 0.0, rtol=0, atol=1e-9)
        forces = mechanism.constraint_forces(q, none, none, tau)
        check_feet(q, forces)
        check_legs(q, tau, forces)


@common.both_engines
def test_sinks_without_torques(engine: str) -> None:
    """The legs give way; the body goes down, slower than it would fall, and the feet stay."""
    mechanism, (q, v, _) = common.through(engine, quadruped()), still()
    pull = mechanism.forward_dynamics(q, v, np.zeros(12))
    assert -GRAVITY < pull[2] < -0.5
    np.testing.assert_allclose(mechanism.loop_errors(q, v, pull).acceleration, 0.0, atol=1e-10)


def test_describes_redundant_actuation() -> None:
    common.check_description(quadruped(), rows=12, rank=12, mobility=6, actuation="redundant")


# Shared between the actuators ---------------------------------------------------------------------

NO_PULL = [ForceBound(foot, direction=(0.0, 0.0, 1.0), lower=0.0) for foot in FEET]


def leaning(forward: float, left: float) -> Array:
    """The stance with the body moved over its feet."""
    q = quadruped().home
    q[:2] += forward, left
    return quadruped().complete({"root_joint": q[:7]}, q)


def over_the_feet(q: Array) -> float:
    """How far the centre of mass is inside the feet's polygon, m; negative outside."""
    robot, _ = standing()
    centre = pin.centerOfMass(robot, robot.createData(), q)[:2]
    ring = [
        np.array(p[:2])
        for p in common.points(
            quadruped(), q, *(f"{foot}_FOOT" for foot in ("LF", "LH", "RH", "RF"))
        )
    ]  # anticlockwise, seen from above
    inside = []
    for one, other in zip(ring, ring[1:] + ring[:1], strict=True):
        along = (other - one) / np.linalg.norm(other - one)
        inside.append(along[0] * (centre - one)[1] - along[1] * (centre - one)[0])
    return float(min(inside))


def problem_of(q: Array) -> optima.Distribution:
    """Standing still, no foot pulling."""
    problem = optima.Distribution(quadruped(), q, np.zeros(18), np.zeros(18))
    for foot in FEET:
        problem.limit_forces(np.eye(12)[quadruped().rows(foot).start + 2], 0.0)
    return problem


def stand(q: Array, solver: ForceDistribution) -> DistributedForces:
    """Solve, and check what holds for any answer."""
    found = solver.solve(q, np.zeros(18), np.zeros(18))
    check_feet(q, found.constraint_forces)
    check_legs(q, found.tau, found.constraint_forces)
    return found


def test_gravity_compensation_without_limits_is_the_least() -> None:
    solver = ForceDistribution(quadruped())
    for forward, left in ((0.0, 0.0), (0.1, 0.0), (-0.05, 0.08)):
        q = leaning(forward, left)
        expected = least_norm(q)
        found = stand(q, solver).tau
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_no_foot_pulls() -> None:
    """Leaning until the least torques would have a foot pull: it just lifts, and no more."""
    held = 0
    solver = ForceDistribution(quadruped(), torque_limits="model", bounds=NO_PULL)
    for forward in np.linspace(-0.12, 0.12, 5):
        for left in np.linspace(-0.12, 0.12, 5):
            q = leaning(forward, left)
            if over_the_feet(q) < 0.01:
                continue
            found = stand(q, solver)
            pushes = found.constraint_forces.reshape(4, 3)[:, 2]
            assert pushes.min() >= -1e-7
            assert np.abs(found.tau).max() <= 80.0
            problem = problem_of(q)
            problem.limit_torques(80.0)
            assert worst(*problem.quality(found.tau, found.constraint_forces)) < 1e-7
            held += any("closure" in name for name in found.at_limit)
    assert held >= 3


def test_stands_while_its_centre_of_mass_is_over_its_feet() -> None:
    """Whatever the torques: feet on level ground that only push hold nothing outside of them."""
    solver = ForceDistribution(quadruped(), bounds=NO_PULL)
    seen = []
    for forward in np.linspace(-0.2, 0.2, 11):
        q = leaning(forward, 0.0)
        margin = over_the_feet(q)
        seen.append(margin > 0)
        assert problem_of(q).is_feasible() == (margin > 0)
        if margin > 0:
            stand(q, solver)
            continue
        with pytest.raises(InfeasibleError, match="beyond its lower limit") as refused:
            stand(q, solver)
        assert all("closure" in one.name for one in refused.value.violations)
    assert {True, False} <= set(seen)


@pytest.mark.parametrize(("forward", "left"), [(0.0, 0.0), (0.08, 0.05), (-0.1, 0.02)])
def test_torque_limits_down_to_the_least_peak(forward: float, left: float) -> None:
    """That peak by linear programming: 0.1 percent above it stands, 0.1 percent below falls."""
    q = leaning(forward, left)
    peak = problem_of(q).least_peak()
    free = np.abs(least_norm(q)).max()
    assert peak < free
    for limit in (1.001 * peak, (peak + free) / 2):
        solver = ForceDistribution(quadruped(), torque_limits=limit, bounds=NO_PULL)
        found = stand(q, solver)
        assert np.abs(found.tau).max() <= limit * (1 + 1e-9)
        assert found.at_limit
        problem = problem_of(q)
        problem.limit_torques(limit)
        assert worst(*problem.quality(found.tau, found.constraint_forces)) < 1e-7
    with pytest.raises(InfeasibleError, match="beyond its") as refused:
        stand(q, ForceDistribution(quadruped(), torque_limits=0.999 * peak, bounds=NO_PULL))
    assert refused.value.violations


def test_feet_do_not_slip() -> None:
    """Within friction pyramids the sideways force stays within the cone."""
    q, friction = leaning(0.05, 0.03), 0.15
    pyramids = [bound for foot in FEET for bound in friction_pyramid(foot, friction)]
    free = stand(q, ForceDistribution(quadruped())).constraint_forces.reshape(4, 3)
    assert (np.hypot(free[:, 0], free[:, 1]) > friction * free[:, 2]).any()
    found = stand(q, ForceDistribution(quadruped(), bounds=pyramids))
    forces = found.constraint_forces.reshape(4, 3)
    slip = np.hypot(forces[:, 0], forces[:, 1]) - friction * forces[:, 2]
    assert slip.max() <= 1e-6
