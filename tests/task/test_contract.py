"""What every robot with a task gives: the same assertions of every tool, for all of them.

Maps and forces have suites of their own over the same robots (`test_maps`, `test_forces`).
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from benchmarks.task_peers import ByHand, Mujoco, NumPy, Pinocchio
from rps_pin import ClosedLoopModel, InputError, MechanismError, RPSPinError, RPSRobot
from rps_pin.control import ComputedTorque, Gains, Plant, Status
from rps_pin.panel import MechanismPanel
from rps_pin.task import DriveLimits, MotionLimits, Task, check_path, size_trajectory, time_optimal
from rps_pin.trajectories import point_to_point, read_csv
from rps_pin.trajectories.point_to_point import LineCurve
from rps_pin.viewer import Recorder, View, fitting_layers
from tests.task.robots import EACH, GENERATED, NAMES, ROBOTS, compiled, poses, task
from tests.worst import worst

BOTH = pytest.mark.parametrize(("make", "name"), EACH)
ALL = pytest.mark.parametrize("name", NAMES)
#: Each once, in generated code where the tests build it.
QUICK = pytest.mark.parametrize(
    ("make", "name"), [(compiled if name in GENERATED else task, name) for name in NAMES], ids=NAMES
)
#: Closures of points and rods, joints of one coordinate or free: what is written by hand.
BY_HAND = [name for name in NAMES if name not in ("cassie_leg", "differential", "four_bar",
                                                  "minitaur_leg", "slider_crank")]  # fmt: skip


@cache
def line(name: str):
    """A motion from home to a pose within reach, from rest to rest."""
    return point_to_point(task(name).home, poses(name)[0][0], duration=0.5)


# Maps ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BY_HAND)
def test_maps_are_those_of_newtons_method_by_hand(name) -> None:
    """In plain NumPy, which shares nothing with the package, and by MuJoCo's kinematics."""
    one, (x, q) = task(name), poses(name)
    for kinematics in (NumPy, Mujoco, Pinocchio):
        hand = ByHand(one, kinematics)
        near = hand.tree.start(one.mechanism.home)
        for k in range(2):
            a = one.to_actuators(x[k])
            assert worst(hand.to_actuators(x[k], near) - a) < 1e-10
            assert worst(hand.to_task(a, near) - x[k]) < 1e-10
            K = one.jacobian(q[k])
            assert worst(hand.jacobian(hand.tree.start(q[k])) - K) < 1e-9 * worst(K)


@BOTH
def test_actuators_lead_to_configurations_and_velocities(make, name) -> None:
    one, (x, q), rng = make(name), poses(name), np.random.default_rng(0)
    a, rate = one.to_actuators(x, near=q), rng.normal(size=x.shape)
    found = one.configuration_of(a, near=q)
    assert worst(one.at(found) - x) < 1e-12
    v = one.motion(q, rate, 0 * rate).v
    speed = v[..., one.mechanism.actuated_indices]
    assert worst(one.velocity_of(q, speed) - v) < 1e-9 * worst(v)


@BOTH
def test_forces_of_a_motion_are_those_of_the_mechanism(make, name) -> None:
    one, (x, q), rng = make(name), poses(name), np.random.default_rng(1)
    state = one.motion(q, *rng.normal(size=(2, *x.shape)))
    wanted = [one.mechanism.inverse_dynamics(*each).tau for each in zip(*state, strict=True)]
    assert worst(one.actuator_forces(*state) - np.array(wanted)) < 1e-9 * worst(np.array(wanted), 1)


@BOTH
def test_gains_go_there_and_back(make, name) -> None:
    one, (_, q), rng = make(name), poses(name), np.random.default_rng(2)
    count = one.mechanism.actuated_indices.size
    gains, tau = 1 + rng.uniform(size=count), rng.normal(size=(len(q), count))
    found = one.gains_to_task(q, gains, forces=tau)
    back = one.gains_to_actuators(q, found, forces=tau)
    assert worst(back - np.diag(gains)) < 1e-8 * worst(one.hessian(q), 1)
    assert worst(found - np.swapaxes(found, -1, -2)) < 1e-12 * worst(found)


@BOTH
def test_polytopes_are_what_actuators_within_limits_do(make, name) -> None:
    """Corners are made by actuators at their limits, as many of them as there are coordinates."""
    one, q, rng = make(name), poses(name)[1][0], np.random.default_rng(3)
    count = one.mechanism.actuated_indices.size
    lower, upper = -rng.uniform(1, 2, count), rng.uniform(1, 2, count)
    K = one.jacobian(q)
    for polytope, of_actuators in (
        (one.force_polytope(q, (lower, upper)), lambda f: one.forces_to_actuators(q, f)),
        (one.speed_polytope(q, (lower, upper)), lambda rate: K @ rate),
    ):
        assert polytope.ball().radius > 0
        for corner in polytope.vertices:
            used = of_actuators(corner)
            assert worst(np.maximum(lower - used, used - upper).max()) < 1e-9
            at = np.isclose(used, lower, atol=1e-8) | np.isclose(used, upper, atol=1e-8)
            assert at.sum() >= one.size
        assert polytope.contains(0.99 * polytope.vertices.mean(axis=0))
        assert not polytope.contains(1.01 * polytope.vertices[0])


@BOTH
def test_singularity_measures_are_those_of_the_motions(make, name) -> None:
    """Of the task's and the actuators' speeds, in m/s, of a motion of length 1: its two factors."""
    one, (_, q) = make(name), poses(name)
    found = one.singularities(q)
    scale = one.mechanism.velocity_scale[one.mechanism.actuated_indices]
    K = one.jacobian(q) / one.scale / scale[:, None]
    if name not in ROBOTS:  # measures in closed form, of other motions
        assert worst(found.type_ii - np.linalg.svd(K, compute_uv=False)[..., -1]) < 1e-9
        assert worst(found.determinant - np.linalg.det(K)) < 1e-9 * worst(found.determinant)
    least = np.minimum(found.type_i, np.minimum(found.type_ii, found.constraint))
    assert (found.distance <= least * (1 + 1e-12)).all()
    assert (found.distance > 0).all()
    other = task(name).singularities(q)
    for one_part, other_part in zip(found, other, strict=True):
        assert worst(one_part - other_part) < 1e-9


# Tools --------------------------------------------------------------------------------------------


@QUICK
def test_a_path_is_checked(make, name) -> None:
    """Its least distance is that of dense samples; nothing is met on it."""
    one, path = make(name), line(name)
    found = check_path(one, path, least_steps=8, max_step=0.2)
    assert not found.singularities
    t = np.linspace(0, path.duration, 12)
    dense = task(name).singularities(task(name).follow(path.sample(t).pose)).distance
    assert found.minimum_distance <= dense.min() * (1 + 1e-9)
    assert found.minimum_distance > 0.9 * dense.min()


@QUICK
def test_a_motion_is_sized(make, name) -> None:
    """Energy: what the actuators drive and take back is the change of weight; forces at rest."""
    one = make(name)
    path = line(name)
    sheet = size_trajectory(one, path, 60.0, limits=DriveLimits(force=1e9))
    assert [each.name for each in sheet.actuators] == list(one.mechanism.actuated)
    q, v, a = sheet.motion.state
    work = sum(each.energy_driven - each.energy_regenerated for each in sheet.actuators)
    ends = [sum(one.mechanism.energy(q[k], v[k])) for k in (0, -1)]
    moved = sum(each.energy_driven + each.energy_regenerated for each in sheet.actuators)
    assert work == pytest.approx(ends[1] - ends[0], abs=0.01 * moved + 1e-12)
    for k in (0, 10, 30):
        tau = one.mechanism.inverse_dynamics(q[k], v[k], a[k]).tau
        assert worst(sheet.force[k] - tau) < 1e-9 * worst(tau, 1)
    assert sheet.kept


@pytest.mark.parametrize("name", GENERATED)
def test_the_shortest_time_uses_the_limits(name) -> None:
    one = compiled(name)
    curve = LineCurve(one.home, poses(name)[0][0])
    still = 0 * one.home
    held = np.abs(one.actuator_forces(*one.state(curve.start, still, still))).max()
    limits = MotionLimits(force=2 * held + 10, speed=1.0)
    found = time_optimal(one, curve, limits=limits, intervals=16)
    t = np.linspace(0, found.duration, 101)
    sample = found.sample(t)
    state = one.motion(one.follow(sample.pose), sample.rate, sample.acceleration)
    force = np.abs(one.actuator_forces(*state)).max(axis=-1) / (2 * held + 10)
    speed = np.abs(state.v[..., one.mechanism.actuated_indices]).max(axis=-1)
    use = np.maximum(force, speed)
    assert worst(use) < 1 + 1e-4
    assert (use > 0.99).mean() > 0.9


@ALL
def test_computed_torque_holds_and_follows(name) -> None:
    """A perfect model, from rest: no error beyond those of forces that are held for a tick."""
    one, path = task(name), line(name)
    if name in ROBOTS:
        one = Task(one.mechanism, "platform", ["z", "rx", "ry"])
    options = {"force_limit": 1e6, "near_singular": 0.01, "stop_singular": 0.005}
    controller = ComputedTorque(one, one.home, Gains.placed(15.0), **options)
    plant = Plant(one, one.home, force_limit=1e6, substeps=1)
    for k in range(25):
        status = controller.tick(plant.reading(), path.sample(k * 1e-3), plant.speed)
        assert status == Status.OK
        plant.step(controller.forces)
    errors = (plant.pose - path.sample(25e-3).pose) * one.scale
    moved = (path.sample(25e-3).pose - one.home) * one.scale
    assert 0 < worst(errors) < 0.2 * worst(moved)


@ALL
def test_it_is_shown_with_a_trail_of_its_frame(name) -> None:
    one, path, recorder = task(name), line(name), Recorder()
    what = RPSRobot.from_preset(name) if name in ROBOTS else one.mechanism
    view = View(recorder, what, path, layers=fitting_layers(what, path))
    view.show_moment(path.duration)
    places = [m["matrix"] for m in recorder.messages if m["type"] == "set_transform"]
    assert np.isfinite(np.array(places, dtype=float)).all()
    if one.frame is not None and "trail" in view.drawings:
        assert one.frame in view.drawings["trail"].legend.text
    view.animate()


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ROBOTS])
def test_a_panel_has_sliders_of_the_task_and_of_the_actuators(name) -> None:
    one, (x, _) = task(name), poses(name)
    panel = MechanismPanel(one.mechanism)
    assert panel.move("task", x[0])
    assert worst(panel.values("task") - x[0]) < 1e-12
    assert worst(one.at(panel.configuration) - x[0]) < 1e-11
    assert panel.move("joints", one.to_actuators(one.home))
    assert worst(panel.values("task") - one.home) < 1e-9


@ALL
def test_a_file_of_its_coordinates_is_read(name, tmp_path) -> None:
    one, path = task(name), line(name)
    units = ["rad" if turns else "m" for turns in one.angular]
    header = ",".join(["time_s", *map("_".join, zip(one.coordinates, units, strict=True))])
    t = np.linspace(0, path.duration, 101)
    table = np.column_stack([t, path.sample(t).pose])
    np.savetxt(tmp_path / "path.csv", table, delimiter=",", header=header, comments="")
    found = read_csv(tmp_path / "path.csv", one)
    assert worst(found.sample(t).pose - path.sample(t).pose) < 1e-12


# Bad input ----------------------------------------------------------------------------------------


@BOTH
def test_bad_input_is_an_error_and_nothing_is_lost(make, name) -> None:
    one, (x, q) = make(name), poses(name)
    before = one.to_actuators(x[0], near=q[0])
    m, size = one.mechanism, one.size
    short, none = x[0][:-1], np.full(size, np.nan)
    far = x[0] + 5 * one.characteristic_length * (1 - np.array(one.angular))
    for call in (one.to_actuators, one.configuration, lambda y: one.follow([y, y]),
                 lambda y: one.state(y, x[0], x[0])):  # fmt: skip
        for wrong in (short, none, "pose"):
            with pytest.raises(InputError):
                call(wrong)
        if name not in (*ROBOTS, "rps") and not all(one.angular):  # whose lengths have no limits
            with pytest.raises(RPSPinError):
                call(far)
    with pytest.raises(InputError, match="q has shape"):
        one.jacobian(q[0][:-1])
    frame = one.frame
    if frame is None:
        with pytest.raises(MechanismError, match="no joint 'elbows'; there are"):
            Task(m, joints=[*one.coordinates[:-1], "elbows"])
        with pytest.raises(MechanismError, match="no output frame"):
            one.twist_map(q[0])
    else:
        with pytest.raises(MechanismError, match="no frame 'hands'; there are: universe"):
            Task(m, "hands", one.coordinates)
        with pytest.raises(MechanismError, match="no coordinate 'w'; there are: x, y, z"):
            Task(m, frame, [*one.coordinates, "w"])
        more = [c for c in ("x", "y", "z", "rx", "ry", "rz") if c not in one.coordinates]
        if more:
            with pytest.raises(MechanismError, match="too many: the mechanism has"):
                Task(m, frame, [*one.coordinates, more[0]])
        if size > 1:
            with pytest.raises(MechanismError, match="too few: the mechanism has"):
                Task(m, frame, one.coordinates[:-1])
    assert np.array_equal(one.to_actuators(x[0], near=q[0]), before)


@pytest.mark.parametrize("name", ["rps", "rrs"])
def test_coordinates_that_do_not_move_independently_are_named(name) -> None:
    m = task(name).mechanism
    with pytest.raises(MechanismError, match="coordinates x, y of the task do not move indep"):
        Task(m, "platform", ["x", "y", "z"])
    with pytest.raises(MechanismError, match="coordinate x of the task does not move"):
        Task(m, "platform", ["z", "rx", "x"])


def test_a_mechanism_that_has_a_task_says_so() -> None:
    for name in NAMES:
        if name not in ROBOTS:
            assert ClosedLoopModel.load(f"urdf/{name}.yaml").has_task
