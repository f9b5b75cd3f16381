"""Forces and speeds that put points of a workspace out: against dynamics, polytopes, statics."""

from __future__ import annotations

import h5py
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from rps_pin import InputError, MechanismError
from rps_pin.task import DriveLimits, Payload, Task
from rps_pin.task.loads import Loads
from rps_pin.task.sizing.sizing import limits_of
from rps_pin.task.workspace import (
    TaskWorkspace,
    load_workspace,
    orientation_workspace,
    save_workspace,
    task_grid,
    workspace,
)
from rps_pin.task.workspace.reasons import SINGULAR, UNREACHABLE
from tests.reference import stewart
from tests.task.robots import compiled, task
from tests.worst import worst

#: Robots whose forces and speeds are looked at, and half the ends of a grid about home.
ROBOTS = {
    "five_bar": 0.12, "delta": 0.15, "stewart": 0.12, "rrs": 0.05, "planar_rrr": 0.05,
    "linear_delta": 0.05, "rotary_stewart": 0.02, "micro": 0.01, "rps": 0.02,
}  # fmt: skip
PAYLOAD = Payload(2.0, (0.03, -0.05, 0.04), np.diag([0.01, 0.02, 0.015]))
OFFSET = pin.SE3(pin.exp3(np.array([0.4, -0.3, 0.8])), np.array([0.05, 0.08, -0.1]))


def offset_stewart() -> Task:
    """Coordinates of a tool that stands askew on the platform."""
    mechanism = task("stewart").mechanism
    return Task(mechanism, "platform", ["x", "y", "z", "rx", "ry", "rz"], placement=OFFSET)


def one_of(name: str) -> Task:
    if name == "tool":
        return offset_stewart()
    return compiled(name) if name in ("five_bar", "delta", "stewart") else task(name)


def about_home(one: Task, half: float, count: int = 3) -> dict[str, np.ndarray]:
    """Return axes of up to three coordinates about home."""
    names = one.coordinates[-3:]
    at = dict(zip(one.coordinates, one.home, strict=True))
    return {n: at[n] + half * np.linspace(-1, 1.1, count) for n in names}


def configurations(one: Task, found: TaskWorkspace) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of the points (n,) that are reached, as indices, and configurations."""
    where = np.flatnonzero((~found.mask(UNREACHABLE)).ravel())
    x = found.grid.points(where)
    near = np.broadcast_to(one.mechanism.home, (len(x), one.mechanism.model.nq))
    return where, one.configuration(x, near, within_limits=False)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("delta", "micro", "tool") else pytest.mark.slow)
        for name in [*ROBOTS, "tool"]
    ],
)
def test_forces_are_those_of_the_loaded_mechanism(name: str) -> None:
    """By the constrained dynamics of a mechanism with the payload as a body, point by point."""
    one, rng = one_of(name), np.random.default_rng(1)
    wrenches = rng.normal(size=(3, 6)) * [20, 20, 20, 1, 1, 1]
    limits = [DriveLimits(force=f) for f in rng.uniform(20, 60, len(one.mechanism.actuated))]
    half = ROBOTS.get(name, 0.1)
    found = workspace(
        one,
        task_grid(one, about_home(one, half)),
        holding=True,
        payload=PAYLOAD,
        wrench=wrenches,
        limits=limits,
    )
    where, q = configurations(one, found)
    assert len(where) > 6
    at_rest = Loads(one, PAYLOAD)
    loads = [Loads(one, PAYLOAD, wrench) for wrench in wrenches]
    still = np.zeros(one.mechanism.model.nv)
    share = found.force_share.reshape(-1, len(limits))
    holding = found.holding.reshape(share.shape)
    for k, each in zip(where, q, strict=True):
        tau = at_rest.dynamics(each, still, still).tau
        assert worst(holding[k] - tau) < 1e-7 * worst(tau, 1.0)
        tau = [load.dynamics(each, still, still).tau for load in loads]
        wanted = np.abs(tau).max(axis=0) / [one.force for one in limits]
        assert worst(share[k] - wanted) < 1e-7 * worst(wanted, 1.0)
    for k, (actuator, limit) in enumerate(zip(found.actuated, limits, strict=True)):
        unit = "N m" if one.mechanism.angular_velocities[one.mechanism.actuated_indices[k]] else "N"
        out = found.mask(f"{actuator} force beyond {limit.force:.6g} {unit}")
        assert np.array_equal(out, found.force_share[..., k] > 1)
        assert not (found.inside & out).any()
    assert np.array_equal(found.force_left, 1 - found.force_share.max(axis=-1))
    assert not found.speed_share.size
    assert (found.speed_left == 1).all()


def test_a_stewart_platforms_legs_bear_a_wrench_as_six_two_force_members() -> None:
    """What payload and wrench add: sum f_i (u_i, (B_i - P) x u_i) = -wrench, by hand."""
    one, rng = compiled("stewart"), np.random.default_rng(2)
    wrench = rng.normal(size=6) * [200, 200, 200, 30, 30, 30]
    over = {"x": [-0.1, 0.0, 0.15], "z": [0.6, 0.7], "ry": [-0.2, 0.0, 0.3]}
    grid = task_grid(one, over, {"rx": 0.1, "rz": -0.2})
    found = workspace(one, grid, holding=True, payload=PAYLOAD, wrench=wrench)
    alone = workspace(one, grid, holding=True)
    for k in np.ndindex(grid.shape):
        x = found.grid.points()[k]
        R = Rotation.from_rotvec(x[3:]).as_matrix()
        arms = np.array(stewart.BALLS) @ R.T
        legs = x[:3] + arms - stewart.ANCHORS
        u = legs / np.linalg.norm(legs, axis=-1)[:, None]
        A = np.concatenate([u, np.cross(arms, u)], axis=-1).T
        weight = np.array([0, 0, -9.81 * PAYLOAD.mass])
        carried = np.concatenate([weight, np.cross(R @ PAYLOAD.centre, weight)])
        added = np.linalg.solve(A, -carried)
        assert worst(found.holding[k] - alone.holding[k] - added) < 1e-9 * worst(added)
        whole = alone.holding[k] + np.linalg.solve(A, -carried - wrench)
        assert worst(found.force_share[k] - np.abs(whole) / 2000) < 1e-10


@pytest.mark.parametrize("name", ["five_bar", "delta", "linear_delta"])
def test_speeds_in_all_directions_are_balls_in_the_polytope_of_speeds(name: str) -> None:
    """Of tasks of lengths: the largest ball about zero has the speed that is possible."""
    one = one_of(name)
    speed = 0.8 if name != "linear_delta" else 0.5
    found = workspace(one, task_grid(one, about_home(one, ROBOTS[name])), speed=speed)
    where, q = configurations(one, found)
    for k, each in zip(where, q, strict=True):
        radius = one.speed_polytope(each).ball().radius
        assert found.speed_left.ravel()[k] == pytest.approx(1 - speed / radius, abs=1e-9)
    assert not found.force_share.size
    assert (found.force_left == 1).all()


@pytest.mark.parametrize(
    "name",
    ["planar_rrr", *(pytest.param(k, marks=pytest.mark.slow) for k in ("stewart", "rrs", "micro"))],
)
def test_lengths_and_angles_move_in_all_directions_at_once(name: str) -> None:
    """Of random directions none is faster for an actuator, and one is as fast to 2 %."""
    one, rng = one_of(name), np.random.default_rng(3)
    v, w = 0.05, 0.2
    found = workspace(
        one, task_grid(one, about_home(one, ROBOTS[name], 2)), speed=v, turning_speed=w
    )
    where, q = configurations(one, found)
    turns = np.array(one.angular)
    rates = np.zeros((30_000, one.size))
    for which, size in ((~turns, v), (turns, w)):
        way = rng.normal(size=(len(rates), which.sum()))
        rates[:, which] = size * way / np.linalg.norm(way, axis=-1)[:, None]
    limits = [limit.speed for limit in limits_of(one)]
    for k, each in zip(where, q, strict=True):
        K = one.jacobian(each, x=found.grid.points([k])[0])
        share = np.abs(rates @ K.T).max(axis=0) / limits
        most = found.speed_share.reshape(-1, len(limits))[k]
        assert (share <= most * (1 + 1e-12)).all()
        assert (share > 0.9 * most).all()


def test_rates_are_each_within_the_polytope_of_speeds_or_not() -> None:
    one, rng = compiled("stewart"), np.random.default_rng(4)
    rates = rng.normal(size=(6, 6)) * [0.8, 0.8, 0.8, 1, 1, 1]
    grid = task_grid(one, about_home(one, 0.3))
    each = [workspace(one, grid, rates=rate) for rate in rates]
    both = workspace(one, grid, rates=rates)
    assert np.array_equal(both.speed_share, np.max([f.speed_share for f in each], axis=0))
    seen = set()
    where, q = configurations(one, both)
    for k, at in zip(where[::3], q[::3], strict=True):
        polytope = one.speed_polytope(at)
        for rate, found in zip(rates, each, strict=True):
            fits = polytope.contains(rate)
            assert fits == (found.speed_left.ravel()[k] >= 0)
            seen.add(fits)
    assert seen == {True, False}


def test_corners_bound_all_wrenches_between_them() -> None:
    """Random mixtures of corners put no point out that the corners leave in."""
    one, rng = compiled("delta"), np.random.default_rng(5)
    corners = np.zeros((4, 6))
    corners[:, :3] = rng.normal(size=(4, 3)) * 90
    grid = task_grid(one, about_home(one, 0.25, 5))
    found = workspace(one, grid, wrench=corners)
    assert 0.05 < found.inside.mean() < 0.95
    for share in rng.dirichlet(np.ones(4), 12):
        between = workspace(one, grid, wrench=share @ corners)
        assert (between.force_share <= found.force_share * (1 + 1e-9) + 1e-12).all()
        assert (between.inside | ~found.inside).all()


def test_forces_in_any_direction_are_those_of_the_worst_wrenches() -> None:
    """Of random directions none is harder to bear, and one is as hard to some per cent."""
    one, rng = compiled("stewart"), np.random.default_rng(6)
    grid = task_grid(one, about_home(one, 0.1, 2))
    ways = rng.normal(size=(2, 4000, 3))
    ways /= np.linalg.norm(ways, axis=-1)[..., None]
    corners = np.concatenate([300 * ways[0] - [0, 0, 500], 40 * ways[1]], axis=-1)
    load = {"payload": PAYLOAD, "wrench": [0, 0, -500, 0, 0, 0]}
    found = workspace(one, grid, **load, force=300.0, moment=40.0)
    several = workspace(one, grid, payload=PAYLOAD, wrench=corners)
    assert (several.force_share <= found.force_share * (1 + 1e-12)).all()
    assert (several.force_share > 0.95 * found.force_share).all()


def test_forces_at_a_singularity_are_beyond_every_limit() -> None:
    """The five-bar where its forearms are in line: type II."""
    one = compiled("five_bar")
    x = np.linspace(-0.6, 0.8, 29)
    found = workspace(one, task_grid(one, {"x": x, "z": x}), wrench=[0, 0, -300, 0, 0, 0])
    singular = found.mask(SINGULAR) & ~found.mask(UNREACHABLE)
    assert singular.any()
    assert not np.isnan(found.force_share).any()
    near = found.conditioning < 2e-2
    assert (found.force_left[near & ~found.mask(UNREACHABLE)] < 0).all()
    name = "left_joint force beyond 40 N m"
    assert found.counts()[name] == np.count_nonzero(found.force_share[..., 0] > 1) > 0


def test_sets_of_orientations_take_demands_too() -> None:
    one = compiled("stewart")
    grid = task_grid(one, {"x": np.linspace(-0.2, 0.2, 5), "z": np.linspace(0.55, 0.8, 4)})
    turns = {"rx": [0.0, 0.2], "ry": [0.1, 0.0]}
    load = {"payload": Payload(250.0), "wrench": [2000, 0, 0, 0, 0, 0]}
    found = orientation_workspace(one, grid, turns, **load)
    free = orientation_workspace(one, grid, turns)
    assert 0 < found.inside.sum() < free.inside.sum()


BAD = [
    ({"wrench": [1, 2, 3]}, InputError, "wrench has shape"),
    ({"wrench": np.zeros((0, 6))}, InputError, "wrench has shape"),
    ({"wrench": np.zeros((2, 2, 6))}, InputError, "wrench has shape"),
    ({"wrench": [np.nan] * 6}, InputError, "wrench"),
    ({"force": 0.0}, InputError, "force"),
    ({"moment": np.inf}, InputError, "moment"),
    ({"speed": 0.0}, InputError, "speed"),
    ({"speed": -1.0}, InputError, "speed"),
    ({"turning_speed": 1.0}, InputError, "no coordinate of the task is an angle"),
    ({"rates": [1.0]}, InputError, "rates has shape"),
    ({"limits": DriveLimits(force=3.0)}, InputError, "there are none"),
    ({"wrench": np.zeros(6), "limits": [DriveLimits(force=1.0)]}, InputError, "of 1 actuators"),
    ({"wrench": np.zeros(6), "limits": DriveLimits(speed=3.0)}, InputError, "limit of force"),
    ({"speed": 1.0, "limits": DriveLimits(force=3.0)}, InputError, "limit of speed"),
    ({"speed": 1.0, "limits": DriveLimits(speed=1.0, power=3.0)}, InputError, "needs a motion"),
    ({"speed": 1.0, "limits": DriveLimits(speed=1, length=(0, 1))}, InputError, "positions"),
]


@pytest.mark.parametrize(("asked", "kind", "told"), BAD)
def test_bad_demands_are_refused(asked, kind, told: str) -> None:
    one = task("delta")
    with pytest.raises(kind, match=told):
        workspace(one, task_grid(one, about_home(one, 0.1)), **asked)


def test_a_task_of_joints_carries_no_load_but_has_speeds() -> None:
    one = task("ankle")
    grid = task_grid(one, {name: np.linspace(-0.2, 0.2, 3) for name in one.coordinates})
    with pytest.raises(MechanismError, match="no output frame"):
        workspace(one, grid, payload=Payload(1.0))
    with pytest.raises(InputError, match="no coordinate of the task is a length"):
        workspace(one, grid, speed=1.0)
    fast, slow = (workspace(one, grid, turning_speed=w) for w in (100.0, 1.0))
    assert slow.inside.all()
    assert not fast.inside.any()
    assert worst(fast.speed_share - 100 * slow.speed_share) < 1e-9 * worst(fast.speed_share)


def test_shares_come_back_from_files_and_old_files_have_none(tmp_path) -> None:
    one, file = compiled("delta"), tmp_path / "w.h5"
    grid = task_grid(one, about_home(one, 0.4))
    found = workspace(one, grid, wrench=[0, 0, -100, 0, 0, 0], rates=[1.0, 0.0, 0.0])
    save_workspace(found, file)
    back = load_workspace(file)
    assert np.array_equal(back.force_share, found.force_share)
    assert np.array_equal(back.speed_share, found.speed_share)
    assert back.reasons == found.reasons
    plain = workspace(one, grid)
    save_workspace(plain, file, overwrite=True)
    with h5py.File(file, "r+") as opened:
        del opened["force_share"], opened["speed_share"]
    assert load_workspace(file).force_share.shape == (*grid.shape, 0)
