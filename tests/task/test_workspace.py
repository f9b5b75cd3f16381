"""Workspaces of mechanisms against closed forms, in both engines, and what they refuse."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.ndimage import label

from rps_pin import ClosedLoopModel, InputError, MechanismError, RPSRobot, SingularityError
from rps_pin import errors as of
from rps_pin.rps import workspace as of_rps
from rps_pin.task import Cone, Payload, Task
from rps_pin.task.workspace import TaskWorkspace, task_grid, workspace
from rps_pin.task.workspace.reasons import INTERFERENCE, SINGULAR, UNREACHABLE, reason_names
from tests.quick import quick
from tests.task.robots import compiled, task
from tests.task.test_interference import OFFSET, OTHER, R, balls
from tests.task.workspaces import Closed, conditioning, delta_arms, five_bar, stewart_legs
from tests.worst import worst

FIVE_BAR = {"x": np.linspace(-0.803, 0.9, 97), "z": np.linspace(-0.811, 0.9, 101)}
DELTA = {
    "x": np.linspace(-0.61, 0.6, 31),
    "y": np.linspace(-0.61, 0.6, 30),
    "z": np.linspace(-0.9, -0.11, 27),
}
STEWART = {
    "x": np.linspace(-0.4, 0.41, 21),
    "y": np.linspace(-0.4, 0.41, 22),
    "z": np.linspace(0.35, 0.92, 20),
}
ROTATION = {"rx": 0.1, "ry": -0.15, "rz": 0.2}


@cache
def of_five_bar() -> TaskWorkspace:
    one = compiled("five_bar")
    return workspace(one, task_grid(one, FIVE_BAR))


@cache
def of_delta() -> TaskWorkspace:
    one = compiled("delta")
    return workspace(one, task_grid(one, DELTA))


def agree(found: TaskWorkspace, wanted: Closed, limits: tuple[float, float]) -> None:
    """Compare reach, actuators, gains, limits and singularities, away from the ends of each."""
    shape = found.grid.shape
    home = tuple(
        int(np.argmin(np.abs(axis - found.start[column])))
        for axis, column in zip(found.grid.axes, found.grid.columns, strict=True)
    )
    reached = ~found.mask(UNREACHABLE)
    parts, _ = label(wanted.exists.reshape(shape))  # by steps along the axes
    assert np.array_equal(reached, parts == parts[home])
    assert np.count_nonzero(reached) > 0.99 * np.count_nonzero(wanted.exists)
    a = wanted.actuators.reshape(found.actuators.shape)[reached]
    turned = (found.actuators[reached] - a + np.pi) % (2 * np.pi) - np.pi
    near_end = wanted.margin.reshape(shape)[reached] < 1e-6
    assert worst(turned[~near_end]) < 1e-9
    length = task(found.mechanism.replace("-", "_")).mechanism.characteristic_length
    measure, side = (part.reshape(shape) for part in conditioning(wanted.gain, length))
    assert worst((found.conditioning - measure)[reached][~near_end]) < 1e-7
    singular = (side != side[home]) | (measure < found.min_conditioning)
    sure = reached & (np.abs(measure - found.min_conditioning) > 1e-6)
    assert np.array_equal(found.mask(SINGULAR)[sure], singular[sure])
    for k, name in enumerate(found.actuated):
        for word, beyond in (("below", a[:, k] < limits[0]), ("above", a[:, k] > limits[1])):
            reason = f"{name} {word} {limits[word == 'above']:.6g} rad"
            apart = np.abs(a[:, k] - limits[word == "above"]) > 1e-9
            assert np.array_equal(found.mask(reason)[reached][apart], beyond[apart])


def test_a_five_bar_reaches_where_two_annuli_overlap_and_keeps_its_elbows() -> None:
    """Of all points: reach, both elbows' sides by the arms' angles, K, and the type II side."""
    found = of_five_bar()
    agree(found, five_bar(found.grid.points().reshape(-1, 2)), (-2 * np.pi, 2 * np.pi))


def test_a_delta_reaches_where_its_three_arms_do_and_keeps_its_elbows() -> None:
    found = of_delta()
    agree(found, delta_arms(found.grid.points().reshape(-1, 3)), (-1.2, 1.5))


def test_a_stewart_platform_is_where_six_spherical_shells_overlap() -> None:
    """At one orientation, which is held: each leg's reasons by its length."""
    one = compiled("stewart")
    found = workspace(one, task_grid(one, STEWART, ROTATION))
    points = found.grid.points()
    assert np.array_equal(
        points[..., 3:], np.broadcast_to(list(ROTATION.values()), (21, 22, 20, 3))
    )
    legs = stewart_legs(points[..., :3].reshape(-1, 3), np.array(list(ROTATION.values())))
    legs = legs.reshape(found.actuators.shape)
    assert worst(found.actuators - legs) < 1e-12
    assert not found.mask(UNREACHABLE).any()
    for k, name in enumerate(found.actuated):
        assert np.array_equal(found.mask(f"{name} below 0.45 m"), legs[..., k] < 0.45)
        assert np.array_equal(found.mask(f"{name} above 0.95 m"), legs[..., k] > 0.95)
    shells = ((legs >= 0.45) & (legs <= 0.95)).all(axis=-1)
    others = [name for name in found.reasons if "rod" not in name]
    assert np.array_equal(found.inside, shells & ~np.any([found.mask(n) for n in others], axis=0))
    assert 0.2 < found.inside.mean() < 0.8
    room = np.minimum(legs - 0.45, 0.95 - legs).min(axis=-1) / 0.5
    assert worst(found.stroke_left - room) < 1e-11


@pytest.mark.parametrize("preset", quick(["micro", "sokolov"], ["micro"]))
def test_the_3_rps_has_the_numbers_of_its_own_workspace(preset: str) -> None:
    """By the generic way, without closed forms: reach, lengths, conditioning, determinant."""
    robot = RPSRobot.from_preset(preset)
    p = robot.parameters
    one = Task(
        robot.mechanism, "platform", ["z", "rx", "ry"], characteristic_length=p.platform_radius
    )
    middle = 0.19 if preset == "micro" else one.home[0]
    z, tilt = np.linspace(0.7, 1.3, 13) * middle, np.linspace(-1.1, 1.05, 20)
    start = [z[6], 0.0, 0.0]
    own = of_rps.workspace(robot, of_rps.pose_grid(z, tilt), start=start)
    fast = one.compile()
    found = workspace(fast, task_grid(fast, {"z": z, "rx": tilt, "ry": tilt}), start=start)
    assert worst(found.actuators - own.length) < 1e-9
    assert worst(found.conditioning - own.conditioning) < 1e-9
    assert worst(found.determinant - own.determinant) < 1e-9
    assert np.array_equal(found.mask(SINGULAR), own.mask(of_rps.Reason.SINGULAR))
    assert found.mask(SINGULAR).any()
    # The mechanism's joints have its limits of lengths and angles; the robot's task its cones too.
    closed = workspace(
        robot.task, task_grid(one, {"z": z, "rx": tilt[::4], "ry": tilt}), start=start
    )
    assert np.array_equal(closed.inside, own.inside[:, ::4])
    names = {f"leg {leg} length above 0.25 m": f"LEG_{leg}_LONG" for leg in (1, 2, 3)}
    names |= {
        f"leg {leg} spherical joint above {np.pi / 4:.6g} rad": f"LEG_{leg}_SPHERICAL"
        for leg in (1, 2, 3)
    }
    for name, reason in names.items() if preset == "micro" else ():
        wanted = own.mask(of_rps.Reason[reason])[:, ::4]
        assert wanted.any()
        assert np.array_equal(closed.mask(name), wanted)


@pytest.mark.parametrize(
    ("name", "over"),
    [
        ("five_bar", {"x": FIVE_BAR["x"][::16], "z": FIVE_BAR["z"][::16]}),
        ("delta", {"x": DELTA["x"][::8], "z": DELTA["z"][::6]}),
        ("stewart", {"x": STEWART["x"][::5], "z": STEWART["z"][::6], "rz": [-0.5, 0.0, 0.5]}),
    ],
)
def test_both_engines_agree(name: str, over) -> None:
    """Also beyond the end of the assembly mode, which each finds in its own way."""
    slow, fast = task(name), compiled(name)
    asked = {"holding": True, "payload": Payload(1.0, (0.05, 0, 0)), "speed": 0.5}
    one, other = (workspace(t, task_grid(t, over), **asked) for t in (slow, fast))
    assert np.array_equal(one.reason, other.reason)
    for part, same in zip(one.fields[1:], other.fields[1:], strict=True):
        assert part.any()
        assert worst(part - same) < 1e-9 * worst(part, 1.0)
    assert one.mask(UNREACHABLE).any() == (name != "stewart")


def test_what_a_start_decides_is_the_assembly_mode() -> None:
    """A five-bar whose right elbow is on the other side: its angles, and its own inside."""
    one = compiled("five_bar")
    grid = task_grid(one, {"x": FIVE_BAR["x"][::6], "z": FIVE_BAR["z"][::6]})
    x = np.array([0.2, 0.5])
    q = one.configuration(x)
    away = q.copy()
    # The right arm mirrored about the line from its base to the tip.
    line = np.arctan2(x[1], x[0] - 0.4)
    away[2], away[3] = 2 * line - q[2], -q[3]
    found = workspace(one, grid, start=away)
    assert worst(found.start - x) < 1e-12
    there = ~found.mask(UNREACHABLE)
    usual = workspace(one, grid, start=x)
    assert np.array_equal(there, ~usual.mask(UNREACHABLE))
    points = grid.points()[there]
    line = np.arctan2(points[:, 1], points[:, 0] - 0.4)
    mirrored = 2 * line - usual.actuators[there][:, 1]
    turned = (found.actuators[there][:, 1] - mirrored + np.pi) % (2 * np.pi) - np.pi
    assert worst(turned) < 1e-9
    assert worst(found.actuators[there][:, 0] - usual.actuators[there][:, 0]) % (2 * np.pi) < 1e-9
    assert (found.inside != usual.inside).any()


def test_forces_at_rest_are_those_that_hold_the_weight() -> None:
    """Of the five-bar, by virtual work of all bodies' weights: the gradient of the energy."""
    one = compiled("five_bar")
    grid = task_grid(one, {"x": np.linspace(0.1, 0.3, 5), "z": np.linspace(0.45, 0.55, 5)})
    found = workspace(one, grid, holding=True)
    assert found.inside.all()
    h = 1e-5
    for k in np.ndindex(5, 5):
        x = grid.points()[k]
        steps = np.concatenate([h * np.eye(2), -h * np.eye(2)])
        q = one.configuration(x + steps)
        energy = np.array([one.mechanism.energy(each, np.zeros(4))[1] for each in q])
        slope = (energy[:2] - energy[2:]) / (2 * h)
        K = one.jacobian(one.configuration(x))
        assert worst(K.T @ found.holding[k] - slope) < 1e-6 * worst(slope)


def test_planes_counts_and_extents_are_those_of_the_points() -> None:
    found = of_delta()
    counts = found.counts()
    assert counts["inside"] == np.count_nonzero(found.inside)
    assert sum(counts.values()) >= found.grid.size  # a point can have several reasons
    plane = found.plane("z", -0.5)
    number = int(np.argmin(np.abs(DELTA["z"] + 0.5)))
    assert plane.grid.over == ("x", "y")
    assert plane.grid.held == {"z": DELTA["z"][number]}
    assert np.array_equal(plane.reason, found.reason[..., number])
    assert np.array_equal(plane.gains, found.gains[..., number, :])
    assert np.array_equal(plane.grid.points()[..., 2], np.full((31, 30), DELTA["z"][number]))
    low, high = found.extents()["x"]
    inside = found.grid.points()[found.inside][:, 0]
    assert (low, high) == (inside.min(), inside.max())


@pytest.mark.parametrize("make", [lambda one: one, Task.compile], ids=["pinocchio", "generated"])
def test_links_that_are_too_near_put_points_out(make) -> None:
    """Two balls on slides, without any loop: by the distance of their centres."""
    one, axis = make(balls()), np.linspace(-0.4, 0.42, 15)
    grid = task_grid(one, {"xa": axis, "xb": axis})
    xa, xb = np.moveaxis(grid.points(), -1, 0)
    apart = np.hypot(xa - xb, OFFSET) - R - OTHER
    for least in (0.0, 0.1):
        found = workspace(one, grid, clearance=least)
        assert np.array_equal(found.mask(INTERFERENCE), apart < least)
        assert np.array_equal(found.inside, apart >= least)
        assert 0.1 < found.inside.mean() < 0.95
    ignored = workspace(one, grid, clearance=0.1, ignore=[("a", "b")])
    assert ignored.inside.all()


def test_cones_put_points_out_by_name() -> None:
    """A cone between the platform and the base of a Stewart: the tilt's angle."""
    one = compiled("stewart")
    over = {"rx": np.linspace(-0.5, 0.5, 11), "ry": np.linspace(-0.5, 0.5, 11)}
    cone = Cone("universe", "platform", 0.33, name="tilt")
    found = workspace(one, task_grid(one, over), cones=[cone])
    tilt = np.linalg.norm(
        found.grid.points()[..., 3:5], axis=-1
    )  # rz is zero: the axis stays level
    assert np.array_equal(found.mask("tilt cone above 0.33 rad"), tilt > 0.33)


BAD = [
    ({"x": [0.1]}, {}, "2 to 6"),
    ({"x": [0.1, 0.2], "y": [0.0, 0.1], "w": [0.1]}, {}, "no coordinate 'w'"),
    ({"x": [], "y": [0.1]}, {}, "x has shape"),
    ({"x": [0.0, np.inf], "y": [0.1]}, {}, "x"),
    ({"x": [0.0, np.nan], "y": [0.1]}, {}, "x"),
    ({"x": [0.2, 0.1], "y": [0.1]}, {}, "increase"),
    ({"x": [0.1, 0.2], "y": [0.1]}, {"x": 0.1}, "both varied and held"),
    ({"x": [0.1, 0.2], "y": [0.1]}, {"rx": np.nan}, "held rx"),
    ({"rx": [0.0, 4.0], "ry": [0.0, 5.0]}, {}, "whole turn"),
]


@pytest.mark.parametrize(("over", "held", "told"), BAD)
def test_bad_grids_are_refused(over, held, told: str) -> None:
    with pytest.raises(InputError, match=told):
        task_grid(task("stewart"), over, held)


def test_bad_starts_and_arguments_are_refused() -> None:
    one = compiled("delta")
    grid = task_grid(one, {"x": np.linspace(-0.1, 0.1, 3), "z": np.linspace(-0.6, -0.5, 3)})
    for options, kind, told in [
        ({"start": [0.2, 0.0, -0.55]}, InputError, "outside the grid: x = 0.2"),
        ({"start": [0.0, 0.0, -1.5]}, of.ClosureError, "the start: no closed"),
        ({"start": [0.0, 0.0]}, InputError, "3 finite task coordinates"),
        ({"start": [0.0, np.nan, -0.5]}, InputError, "finite"),
        ({"start": one.mechanism.home + 0.01}, of.ClosureError, "the start: "),
        ({"min_conditioning": 1.5}, InputError, "from 0 to 1"),
        ({"clearance": 0.01}, InputError, "collision"),
        ({"cones": [Cone("nowhere", "platform", 0.3)]}, MechanismError, "nowhere"),
    ]:
        with pytest.raises(kind, match=told):
            workspace(one, grid, **options)
    far = task_grid(one, {"x": np.linspace(1, 2, 3), "z": np.linspace(-0.6, -0.5, 3)})
    with pytest.raises(of.UnreachableError, match=r"x = 1, y = .*is not reached"):
        workspace(one, far)
    with pytest.raises(InputError, match="the grid is of a task of x, y, z, not of one of x, z"):
        workspace(task("five_bar"), grid)
    huge = task_grid(one, {name: np.linspace(-0.6, -0.5, 2000) for name in "xyz"}, {})
    with pytest.raises(InputError, match="do not go into memory"):
        workspace(one, huge)


def test_a_singular_start_decides_no_mode() -> None:
    """The five-bar with its arms in line, between its two sides."""
    from tests.task.test_parallel_robots import five_bar_with_its_arms_in_line

    one, x = compiled("five_bar"), np.array(five_bar_with_its_arms_in_line())
    grid = task_grid(
        one, {"x": x[0] + np.linspace(-0.1, 0.1, 3), "z": x[1] + np.linspace(-0.1, 0.1, 3)}
    )
    with pytest.raises(SingularityError, match="decides no assembly mode"):
        workspace(one, grid, start=x)


def test_limits_beyond_the_bits_are_refused() -> None:
    limits = task("stewart").position_limits().signals
    with pytest.raises(InputError, match=r"72 limits; .* at most 61"):
        reason_names([*limits, *limits], interference=True)
    assert len(set(reason_names([*limits, *limits][:60], interference=False))) == 62


def test_progress_is_told_to_its_end() -> None:
    one, seen = compiled("five_bar"), []

    def progress(steps):
        for step in steps:
            seen.append(step)
            yield step

    workspace(one, task_grid(one, {k: v[::20] for k, v in FIVE_BAR.items()}), progress=progress)
    assert seen == list(range(1000))


def test_a_mechanism_of_fewer_actuators_than_coordinates_is_refused() -> None:
    mechanism = ClosedLoopModel.load("urdf/five_bar.yaml").with_actuated(["left_joint"])
    one = Task(mechanism, "left_tip", ["x", "z"])
    with pytest.raises(MechanismError, match="1 actuators do not determine 2 coordinates"):
        workspace(one, task_grid(one, {k: v[::20] for k, v in FIVE_BAR.items()}))
