"""The robot as a whole: against Newton and Euler, energy, limits, symmetry and singular poses."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import (
    ClosureError,
    InputError,
    RPSParameters,
    RPSRobot,
    SingularityError,
    UnreachableError,
    helix,
)
from tests import strategies
from tests.quick import quick
from tests.reference import newton_euler as ne
from tests.strategies import LEG_ANGLES, Motion, relative_error
from tests.worst import worst

Array = NDArray[np.float64]

WELL_CONDITIONED = 1e4


def sokolov() -> RPSRobot:
    return RPSRobot.from_preset("sokolov")


# 1,000 states of 100 robots -----------------------------------------------------------------------


class Equations:
    """The KKT equations, J built from the frames' Jacobians, not Pinocchio's constraint models."""

    def __init__(self, robot: RPSRobot) -> None:
        self.model = robot.mechanism.model
        self.data = self.model.createData()
        self.actuated = robot.mechanism.actuated_indices
        self.frames = [
            (
                self.model.getFrameId(f"platform_ball_{leg}"),
                self.model.getFrameId(f"leg_{leg}_ball"),
            )
            for leg in (1, 2, 3)
        ]

    def error(self, q: Array, v: Array, a: Array, tau: Array, forces: Array) -> float:
        """Error of S' tau + J' lambda = rnea over the largest generalised force."""
        needed = pin.rnea(self.model, self.data, q, v, a)
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)
        rest = needed.copy()
        rest[self.actuated] -= tau
        for (on_platform, on_rod), force in zip(self.frames, forces, strict=True):
            rest -= self.jacobian(on_platform).T @ force
            rest += self.jacobian(on_rod).T @ force
        return float(np.abs(rest).max() / np.abs(needed).max())

    def jacobian(self, frame: int) -> Array:
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return pin.getFrameJacobian(self.model, self.data, frame, axes)[:3]


def check_motions(robot: RPSRobot, motions: Motion) -> tuple[dict[str, float], int]:
    """Largest errors over the well-conditioned states, and how many states were left out.

    What is slow to compute is computed at every fifth state.
    """
    mechanism, equations = robot.mechanism, Equations(robot)
    largest: dict[str, float] = {}
    kept, tau, reactions = [], [], []
    for index, (q, v, a) in enumerate(zip(*robot.state(*motions), strict=True)):
        solved = mechanism.inverse_dynamics(q, v, a)
        if solved.condition > WELL_CONDITIONED:
            continue
        kept.append(index)
        tau.append(solved.tau)
        reactions.append(solved.constraint_forces.reshape(3, 3))
        found = {
            "gap": mechanism.loop_gap(q),
            "residual": solved.residual / np.abs(solved.constraint_forces).max(),
        }
        if index % 5 == 0:
            loops = mechanism.loop_errors(q, v, a)
            found["gap rate"] = np.abs(loops.velocity).max()
            found["gap acceleration"] = np.abs(loops.acceleration).max()
            found["KKT"] = equations.error(q, v, a, tau[-1], reactions[-1])
        for name, value in found.items():
            largest[name] = worst(largest.get(name, 0.0), value)

    chosen = tuple(x[kept] for x in motions)
    expected = ne.inverse_dynamics(robot.parameters, *chosen)
    rates = ne.kinematics(robot.parameters, *chosen).leg_length_rates
    gain = ne.power(robot.parameters, *chosen)
    work = np.array(tau) * rates
    size = np.abs(work).sum(axis=-1) + np.abs(gain)
    size[size == 0] = 1  # nothing moves: no power on either side
    largest["power"] = worst((work.sum(axis=-1) - gain) / size)
    largest["forces"] = relative_error(np.array(tau), expected.forces)
    largest["reactions"] = relative_error(np.array(reactions), expected.reactions, axes=2)
    return largest, len(motions[0]) - len(kept)


BOUNDS = {
    "gap": 1e-12,
    "gap rate": 1e-11,
    "gap acceleration": 1e-9,
    "KKT": 1e-10,
    "residual": 1e-10,
    "power": 1e-8,
    "forces": 1e-9,
    "reactions": 1e-9,
}


@pytest.mark.parametrize("tilted_gravity", [False, True], ids=["vertical", "tilted gravity"])
@pytest.mark.parametrize("heavy_rods", [False, True], ids=["massless rods", "heavy rods"])
@pytest.mark.parametrize("states", quick([200, 1000], [200]))
def test_states_of_25_random_robots(states: int, heavy_rods: bool, tilted_gravity: bool) -> None:
    rng = np.random.default_rng([1, heavy_rods, tilted_gravity])
    robots, skipped = 25, 0
    largest: dict[str, float] = {}
    for _ in range(robots):
        parameters = strategies.random_parameters(
            rng, heavy_rods=heavy_rods, tilted_gravity=tilted_gravity
        )
        motions = strategies.random_motions(rng, parameters, states)
        found, left_out = check_motions(RPSRobot(parameters), motions)
        skipped += left_out
        largest = {name: worst(largest.get(name, 0.0), value) for name, value in found.items()}
    print({name: f"{value:.1e}" for name, value in largest.items()}, f"skipped: {skipped}")
    assert skipped < 0.01 * robots * states
    assert {name: value for name, value in largest.items() if not value <= BOUNDS[name]} == {}
    assert largest.keys() == BOUNDS.keys()


@pytest.mark.parametrize("branch", ["+", "-"])
def test_along_the_paper_s_helix(branch: str) -> None:
    robot = sokolov()
    path = helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4, branch=branch)
    found, skipped = check_motions(robot, path.sample(np.linspace(0, path.duration, 1001)))
    print({name: f"{value:.1e}" for name, value in found.items()})
    assert skipped == 0
    assert {name: value for name, value in found.items() if not value <= BOUNDS[name]} == {}


def test_condition_of_an_answer_is_that_of_its_configuration() -> None:
    robot = sokolov()
    q, v, a = robot.state([0.4, 0.1, -0.2], [0.1, 0.2, 0.3], [0.4, 0.5, 0.6])
    found = robot.inverse_dynamics(q, v, a).condition
    assert found == pytest.approx(robot.mechanism.condition(q), rel=1e-12)


# States -------------------------------------------------------------------------------------------


def test_states_of_a_batch_are_those_of_its_members() -> None:
    rng = np.random.default_rng(5)
    parameters = strategies.random_parameters(rng)
    robot = RPSRobot(parameters)
    motions = tuple(x.reshape(2, 3, 3) for x in strategies.random_motions(rng, parameters, 6))
    together = robot.state(*motions)
    assert [x.shape for x in together] == [(2, 3, 13), (2, 3, 12), (2, 3, 12)]
    for i in np.ndindex(2, 3):
        alone = robot.state(*(x[i] for x in motions))
        for one, of_many in zip(alone, together, strict=True):
            np.testing.assert_allclose(of_many[i], one, rtol=1e-14, atol=1e-14)


def test_state_broadcasts_rate_and_acceleration() -> None:
    robot = sokolov()
    poses = np.array([[0.4, 0.1, 0.2], [0.5, -0.1, 0.0]])
    _, v, a = robot.state(poses, np.zeros(3), np.zeros(3))
    assert v.shape == a.shape == (2, 12)
    assert not v.any()
    assert not a.any()


def test_state_of_an_empty_batch_is_empty() -> None:
    q, v, a = sokolov().state(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)))
    assert (q.shape, v.shape, a.shape) == ((0, 13), (0, 12), (0, 12))


def test_state_velocity_and_acceleration_are_the_derivatives_of_its_configuration() -> None:
    """q(t) along pose + rate t + acceleration t^2/2, differentiated on the manifold."""
    rng = np.random.default_rng(6)
    parameters = strategies.random_parameters(rng)
    robot = RPSRobot(parameters)
    pose, rate, acceleration = (x[0] for x in strategies.random_motions(rng, parameters, 1))
    rate, acceleration = rate / 3, acceleration / 20
    q, v, a = robot.state(pose, rate, acceleration)
    h = 2e-3
    times = h * np.array([-2, -1, 1, 2])
    nearby = pose + rate * times[:, None] + acceleration * times[:, None] ** 2 / 2
    moved = robot.state(nearby, np.zeros(3), np.zeros(3))[0]
    steps = np.array([pin.difference(robot.mechanism.model, q, x) for x in moved])
    first = np.array([1, -8, 8, -1]) @ steps / (12 * h)
    second = np.array([-1, 16, 16, -1]) @ steps / (12 * h**2)
    np.testing.assert_allclose(v, first, rtol=0, atol=1e-8)
    np.testing.assert_allclose(a, second, rtol=0, atol=1e-6)


# Placement ----------------------------------------------------------------------------------------


def test_platform_placement_is_the_reference_s() -> None:
    rng = np.random.default_rng(7)
    parameters = strategies.random_parameters(rng)
    pose = strategies.random_motions(rng, parameters, 100)[0]
    position, rotation = RPSRobot(parameters).platform_placement(pose)
    expected = ne.kinematics(parameters, pose, np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(position, expected.position, rtol=0, atol=1e-15)
    np.testing.assert_allclose(rotation, expected.rotation, rtol=0, atol=2e-15)


# Inverse kinematics and limits --------------------------------------------------------------------


def test_legs_satisfy_equation_7() -> None:
    """Tip = (g - d cos(phi)) e + d sin(phi) z, and tip = P + h R e."""
    rng = np.random.default_rng(8)
    e = np.stack([np.cos(LEG_ANGLES), np.sin(LEG_ANGLES), np.zeros(3)], axis=-1)
    for _ in range(10):
        parameters = strategies.random_parameters(rng)
        robot = RPSRobot(parameters)
        pose = strategies.random_motions(rng, parameters, 100, largest_tilt=3.0)[0]
        legs = robot.inverse_kinematics(pose)
        position, rotation = robot.platform_placement(pose)
        from_platform = position[:, None] + parameters.platform_radius * e @ rotation.mT
        d, phi = legs.length[..., None], legs.angle[..., None]
        up = np.array([0.0, 0.0, 1.0])
        from_base = (parameters.base_radius - d * np.cos(phi)) * e + d * np.sin(phi) * up
        np.testing.assert_allclose(from_base, from_platform, rtol=0, atol=2e-15)
        assert legs.reachable.all()


def test_level_legs_form_a_right_triangle() -> None:
    """A 3-4-5 triangle: g - h = 0.3 m, z = 0.4 m."""
    robot = RPSRobot(RPSParameters.from_preset("sokolov").replace(platform_radius=0.16))
    legs = robot.inverse_kinematics([0.4, 0.0, 0.0])
    np.testing.assert_allclose(legs.length, [0.5] * 3, rtol=1e-15)
    np.testing.assert_allclose(np.tan(legs.angle), [4 / 3] * 3, rtol=1e-15)


def test_turning_a_tilt_by_120_degrees_permutes_the_legs() -> None:
    """Leg 1 then does what leg 3 did, leg 2 what 1 did, leg 3 what 2 did."""
    rng = np.random.default_rng(9)
    parameters = strategies.random_parameters(rng)
    robot = RPSRobot(parameters)
    pose = strategies.random_motions(rng, parameters, 50)[0]
    turned = pose.copy()
    cosine, sine = -0.5, np.sqrt(3) / 2
    turned[:, 1:] = pose[:, 1:] @ np.array([[cosine, sine], [-sine, cosine]])
    before, after = robot.inverse_kinematics(pose), robot.inverse_kinematics(turned)
    order = [2, 0, 1]
    np.testing.assert_allclose(after.length, before.length[:, order], rtol=1e-14)
    np.testing.assert_allclose(after.angle, before.angle[:, order], rtol=1e-13)


def test_mirroring_a_tilt_swaps_legs_2_and_3() -> None:
    """The mirror y -> -y turns the axial rotation vector (x, y) into (-x, y)."""
    robot = sokolov()
    legs = robot.inverse_kinematics([[0.4, 0.2, 0.3], [0.4, -0.2, 0.3]])
    np.testing.assert_allclose(legs.length[1], legs.length[0][[0, 2, 1]], rtol=1e-15)
    np.testing.assert_allclose(legs.angle[1], legs.angle[0][[0, 2, 1]], rtol=1e-14)


def limited(**limits: object) -> RPSRobot:
    """A robot with h = g: level legs are vertical, as long as the platform is high."""
    parameters = RPSParameters.from_preset("sokolov")
    return RPSRobot(parameters.replace(platform_radius=parameters.base_radius, **limits))


def test_message_of_a_leg_beyond_its_limit_says_which_and_by_how_much() -> None:
    robot = limited(leg_length_limits=(0.2, 0.25))
    with pytest.raises(UnreachableError) as caught:
        robot.inverse_kinematics([0.261, 0.0, 0.0])
    assert "leg 2: length would be 0.261 m; its limits are 0.2 to 0.25 m" in str(caught.value)
    violations = caught.value.violations
    assert [v.leg for v in violations] == [1, 2, 3]
    assert {(v.quantity, v.lower, v.upper, v.unit) for v in violations} == {
        ("length", 0.2, 0.25, "m")
    }
    assert [v.value for v in violations] == pytest.approx([0.261] * 3, rel=1e-15)


@pytest.mark.parametrize("function", ["motion", "state"])
def test_motions_out_of_reach_are_refused_too(function: str) -> None:
    robot = limited(leg_length_limits=(0.2, 0.25))
    with pytest.raises(UnreachableError, match=r"leg 1: length would be 0\.3 m"):
        getattr(robot, function)([0.3, 0, 0], [0, 0, 0], [0, 0, 0])


def test_leg_angle_limits_are_kept() -> None:
    """g - h = z: every leg stands at 45 degrees."""
    parameters = RPSParameters.from_preset("sokolov")
    pose = [parameters.base_radius - parameters.platform_radius, 0.0, 0.0]
    ok = RPSRobot(parameters.replace(leg_angle_limits=(0.78, 0.79)))
    assert ok.inverse_kinematics(pose).reachable
    for limits in ((0.79, 1.0), (0.5, 0.78)):
        robot = RPSRobot(parameters.replace(leg_angle_limits=limits))
        with pytest.raises(UnreachableError, match=r"leg 1: angle would be 0\.785398 rad"):
            robot.inverse_kinematics(pose)


def test_spherical_joint_limit_is_the_angle_between_leg_and_normal() -> None:
    """Level platform, legs at 45 degrees: 45 degrees from the normal as well."""
    parameters = RPSParameters.from_preset("sokolov")
    pose = [parameters.base_radius - parameters.platform_radius, 0.0, 0.0]
    assert RPSRobot(parameters.replace(spherical_cone_limit=0.786)).inverse_kinematics(pose)
    robot = RPSRobot(parameters.replace(spherical_cone_limit=0.785))
    with pytest.raises(UnreachableError, match=r"spherical joint would be 0\.785398 rad") as caught:
        robot.inverse_kinematics(pose)
    assert [v.quantity for v in caught.value.violations] == ["spherical joint"] * 3


@pytest.mark.parametrize("height", [0.2, 0.25])
def test_limits_themselves_are_within_reach(height: float) -> None:
    assert limited(leg_length_limits=(0.2, 0.25)).inverse_kinematics([height, 0, 0]).reachable


@pytest.mark.parametrize("height", [0.2 - 1e-9, 0.25 + 1e-9])
def test_a_nanometre_beyond_a_limit_is_out_of_reach(height: float) -> None:
    robot = limited(leg_length_limits=(0.2, 0.25))
    assert not robot.inverse_kinematics([height, 0, 0], errors="mask").reachable


def test_mask_marks_what_raise_refuses_and_changes_no_number() -> None:
    rng = np.random.default_rng(10)
    free, bound = limited(), limited(leg_length_limits=(0.2, 0.25))
    pose = np.stack([rng.uniform(0.15, 0.3, 40), *rng.uniform(-0.1, 0.1, (2, 40))], axis=-1)
    masked, all_of_them = (
        bound.inverse_kinematics(pose, errors="mask"),
        free.inverse_kinematics(pose),
    )
    np.testing.assert_array_equal(masked.length, all_of_them.length)
    np.testing.assert_array_equal(masked.angle, all_of_them.angle)
    inside = ((masked.length >= 0.2) & (masked.length <= 0.25)).all(axis=-1)
    np.testing.assert_array_equal(masked.reachable, inside)
    assert 0 < inside.sum() < 40
    for row, fits in zip(pose, inside, strict=True):
        if fits:
            bound.inverse_kinematics(row)
        else:
            with pytest.raises(UnreachableError):
                bound.inverse_kinematics(row)


def test_first_refused_pose_of_a_batch_is_named() -> None:
    robot = limited(leg_length_limits=(0.2, 0.25))
    poses = np.zeros((2, 3, 3))
    poses[..., 0] = 0.22
    poses[1, 2, 0] = 0.3
    with pytest.raises(UnreachableError, match=r"entry \(1, 2\).*would be 0\.3 m"):
        robot.inverse_kinematics(poses)


def test_leg_without_length_is_refused_or_masked() -> None:
    """h = g, level, z = 0: every tip lies on its revolute joint."""
    with pytest.raises(UnreachableError, match="leg 1 would have length 0 m"):
        limited().inverse_kinematics([0.0, 0.0, 0.0])
    legs = limited().inverse_kinematics([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]], errors="mask")
    assert not legs.reachable[0]
    np.testing.assert_array_equal(legs.length[0], 0.0)
    assert np.isfinite(legs.angle).all()


def test_lengths_that_cannot_be_followed_are_masked() -> None:
    robot, pose = sokolov(), np.array([[0.5, 0.0, 0.0], [0.5, 0.1, -0.2]])
    length = robot.inverse_kinematics(pose).length
    length[1] *= [1.0, 1.0, 9.0]
    with pytest.raises(ClosureError):
        robot.forward_kinematics(length, pose[0])
    found = robot.forward_kinematics(length, pose[0], errors="mask")
    np.testing.assert_array_equal(np.ma.getmaskarray(found), [[False] * 3, [True] * 3])
    np.testing.assert_allclose(found[0], pose[0], rtol=0, atol=1e-14)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("entry", range(3))
@pytest.mark.parametrize("errors", ["raise", "mask"])
def test_poses_that_are_not_finite_are_refused(bad: float, entry: int, errors: str) -> None:
    pose = np.array([0.4, 0.0, 0.0])
    pose[entry] = bad
    with pytest.raises(InputError, match=rf"pose is not finite: entry {entry} is"):
        sokolov().inverse_kinematics(pose, errors=errors)


@pytest.mark.parametrize("bad", [0.4, [0.4], [0.4, 0, 0, 0], np.zeros((3, 2)), "level", None, [[]]])
def test_things_that_are_no_poses_are_refused(bad: object) -> None:
    for function in ("inverse_kinematics", "platform_placement"):
        with pytest.raises(InputError, match="pose"):
            getattr(sokolov(), function)(bad)


@pytest.mark.parametrize("name", ["pose", "rate", "acceleration"])
@pytest.mark.parametrize("function", ["motion", "state"])
def test_bad_motions_are_named(function: str, name: str) -> None:
    for bad in ([0.4, np.nan, 0.0], [0.4, 0.0]):
        arguments = {"pose": [0.4, 0, 0], "rate": [0, 0, 0], "acceleration": [0, 0, 0], name: bad}
        with pytest.raises(InputError, match=name):
            getattr(sokolov(), function)(*arguments.values())


def test_shapes_that_do_not_go_together_are_refused() -> None:
    with pytest.raises(InputError, match=r"do not go together.*\(2, 3\).*\(4, 3\)"):
        sokolov().state(np.full((2, 3), 0.1), np.zeros((4, 3)), np.zeros(3))


def test_unknown_way_of_treating_errors_is_refused() -> None:
    with pytest.raises(InputError, match=r"ignore.*'raise' or 'mask'"):
        sokolov().inverse_kinematics([0.4, 0, 0], errors="ignore")


def test_unknown_preset_is_refused() -> None:
    with pytest.raises(InputError, match="no preset 'nobody'; there are: micro, sokolov"):
        RPSRobot.from_preset("nobody")


# Singular poses -----------------------------------------------------------------------------------


def length_jacobian(parameters: RPSParameters, pose: Array) -> Array:
    """d(leg length)/d(pose), column by column, by the reference's jets."""
    still = np.zeros(3)
    columns = [ne.kinematics(parameters, pose, e, still).leg_length_rates for e in np.eye(3)]
    return np.stack(columns, axis=-1)


def infinite_force_times(robot: RPSRobot, branch: str) -> list[float]:
    """When a helix of r = 75 mm crosses det d(leg length)/d(pose) = 0, bisected to rounding."""
    path = helix(robot, radius=75e-3, pitch=50e-3, height=0.4, branch=branch)

    def sign(t: float) -> float:
        return np.sign(np.linalg.det(length_jacobian(robot.parameters, path.sample(t).pose)))

    times = np.linspace(0, path.duration, 500)
    signs = [sign(t) for t in times]
    found = []
    for index in np.flatnonzero(np.diff(signs)):
        low, high = times[index], times[index + 1]
        while low < (middle := (low + high) / 2) < high:
            low, high = (middle, high) if sign(middle) == signs[index] else (low, middle)
        found.append(low)
    return found


def test_poses_of_infinite_force_are_refused_and_their_neighbours_are_not() -> None:
    robot = sokolov()
    path = helix(robot, radius=75e-3, pitch=50e-3, height=0.4)
    times = infinite_force_times(robot, "+")
    assert len(times) == 2
    for t in times:
        with pytest.raises(SingularityError) as caught:
            robot.inverse_dynamics(*robot.state(*path.sample(t)))
        assert caught.value.condition > 1e10
        assert caught.value.condition > caught.value.limit == robot.mechanism.max_condition
        for near in (t - 1e-3, t + 1e-3):
            state = robot.state(*path.sample(near))
            expected = ne.inverse_dynamics(robot.parameters, *path.sample(near)).forces
            found = robot.inverse_dynamics(*state).tau
            np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_other_branch_of_that_helix_meets_no_singularity() -> None:
    robot = sokolov()
    assert infinite_force_times(robot, "-") == []
    path = helix(robot, radius=75e-3, pitch=50e-3, height=0.4, branch="-")
    conditions = [
        robot.mechanism.condition(q)
        for q in robot.state(*path.sample(np.linspace(0, path.duration, 200)))[0]
    ]
    assert worst(conditions) < 1e3


def test_flat_robot_is_singular() -> None:
    """All legs in one plane: nothing bears the weight."""
    robot = sokolov()
    q, v, a = robot.state([0, 0, 0], [0, 0, 0], [0, 0, 0])
    assert robot.mechanism.condition(q) > 1e15
    with pytest.raises(SingularityError) as caught:
        robot.inverse_dynamics(q, v, a)
    assert caught.value.condition > 1e15
    with pytest.raises(SingularityError):
        robot.mechanism.velocity(q, [0.1, 0.1, 0.1])


def test_condition_grows_as_the_robot_flattens() -> None:
    robot = sokolov()
    heights = np.geomspace(0.2, 1e-6, 20)
    states = robot.state(
        np.stack([heights, 0 * heights, 0 * heights], -1), np.zeros(3), np.zeros(3)
    )
    conditions = np.array([robot.mechanism.condition(q) for q in states[0]])
    assert (np.diff(conditions) > 0).all()
    # ... like 1 / height, by which the vertical parts of the legs shrink.
    assert conditions[-1] * heights[-1] == pytest.approx(conditions[-4] * heights[-4], rel=1e-3)


def test_the_cone_is_measured_from_the_joint_s_own_rest_axis() -> None:
    """A leg that leans by 30 degrees needs a socket that leans too, if its cone is narrow."""
    parameters = RPSParameters.from_preset("sokolov").replace(spherical_cone_limit=0.4)
    pose = [np.sqrt(3) * (parameters.base_radius - parameters.platform_radius), 0.0, 0.0]
    with pytest.raises(UnreachableError) as caught:
        RPSRobot(parameters).inverse_kinematics(pose)
    assert [v.quantity for v in caught.value.violations] == ["spherical joint"] * 3
    np.testing.assert_allclose([v.value for v in caught.value.violations], np.pi / 6)
    leaning = RPSRobot(parameters.replace(spherical_rest_angle=np.pi / 6))
    assert leaning.inverse_kinematics(pose).reachable


@pytest.mark.parametrize("given", ["micro", {"base_radius": 0.1}, None])
def test_a_robot_is_made_of_parameters(given) -> None:
    with pytest.raises(InputError, match=r"not of .*RPSRobot\.from_preset\(name\)"):
        RPSRobot(given)


def test_a_pose_is_no_configuration() -> None:
    robot = RPSRobot.from_preset("micro")
    with pytest.raises(InputError, match="as a pose has; it must be"):
        robot.inverse_dynamics([0.22, 0.0, 0.0], [0.0] * 3, [0.0] * 3)
