"""Tolerances: closed forms with wrong lengths, rebuilt mechanisms, known indices, bad input."""

from __future__ import annotations

import re
import shutil
import warnings
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, InputError, MechanismError, RPSRobot, Task, UnreachableError
from rps_pin.arrays import Array
from rps_pin.codegen.build import tcc
from rps_pin.errors import AccuracyWarning
from rps_pin.plots import plot_tolerance_shares
from rps_pin.task.tolerances import (
    ToleranceAnalysis,
    load_tolerances,
    monte_carlo,
    names,
    sobol,
    table_text,
    tolerances,
    write_table,
)
from rps_pin.task.tolerances import tolerance as analysed
from rps_pin.task.tolerances.table import rows
from rps_pin.task.workspace import task_grid, workspace
from rps_pin.trajectories import point_to_point
from tests.reference import delta as delta_forms
from tests.reference import five_bar as five_bar_forms
from tests.worst import worst

#: Lengths of the five-bar and its encoders.
FIVE_BAR: dict[str, Any] = {
    "placement:*joint.[xz]": "0.05 mm",
    "closure:tips.?.x": "0.05 mm",
    "offset:*": "0.2 mrad",
    "scale:*": "200 ppm",
}
POSES = np.array([[0.19, 0.545], [0.25, 0.5], [0.12, 0.58]])


def tolerance(*given: Any, **options: Any) -> ToleranceAnalysis:
    """As it is called, with the compiler that is quick."""
    return analysed(*given, compiler="tcc" if tcc.is_here() else "auto", **options)


@cache
def five_bar() -> ToleranceAnalysis:
    return tolerance(ClosedLoopModel.load("urdf/five_bar.yaml"), FIVE_BAR, POSES)


@cache
def delta() -> ToleranceAnalysis:
    given = {"distance:*": "0.1 mm", "closure:*.a.x": "0.1 mm", "offset:*": "0.1 mrad"}
    task = ClosedLoopModel.load("urdf/delta.yaml").task
    return tolerance(
        task, given, task.home + np.array([[0, 0, 0], [0.1, -0.05, 0.05]]), coordinates="pose"
    )


@cache
def rps() -> ToleranceAnalysis:
    given = {
        "placement:leg_*.[xyz]": "0.05 mm",
        "placement:leg_*.??*": "0.5 mrad",
        "closure:leg_*.[ab].[xyz]": "0.05 mm",
        "offset:*": "0.01 mm",
    }
    robot = RPSRobot.from_preset("sokolov")
    return tolerance(robot, given, [[0.4, 0.1, -0.05]], coordinates="pose")


def errors(found: ToleranceAnalysis, rng: np.random.Generator, scale: float, s: int) -> Array:
    return scale * found.tolerances.limits * rng.normal(size=(s, len(found.labels)))


# Closed forms -------------------------------------------------------------------------------------


def tip(error: dict[str, float], angles: Array) -> Array:
    """The tip of the five-bar with wrong numbers by two circles, written here anew.

    A joint's frame turns with the joint before it; z of an arm is across the bar before it.
    """

    def at(joint: str, base: float, bar: float, q: float) -> tuple[Array, Array]:
        u = np.array([np.cos(q), np.sin(q)])
        across = np.array([-u[1], u[0]])
        shift = [error[f"placement:{joint}_joint.{axis}"] for axis in "xz"]
        near = np.array([base, 0.0]) + np.array(shift)
        far = bar + error[f"placement:{joint}_arm_joint.x"]
        return near + far * u + error[f"placement:{joint}_arm_joint.z"] * across, u

    forms = five_bar_forms
    q = angles * (1 + np.array([error["scale:left_joint"], error["scale:right_joint"]]))
    q = q + np.array([error["offset:left_joint"], error["offset:right_joint"]])
    left, _ = at("left", 0.0, forms.LEFT.length, q[0])
    right, _ = at("right", forms.GROUND, forms.RIGHT.length, q[1])
    a = forms.LEFT_ARM.length + error["closure:tips.a.x"]
    b = forms.RIGHT_ARM.length + error["closure:tips.b.x"]
    gap = right - left
    d = np.linalg.norm(gap)
    along = (a**2 - b**2 + d**2) / (2 * d)
    across = np.array([-gap[1], gap[0]]) / d
    # What is measured is the end of the left arm as drawn, not the point that is closed.
    end = left + along * gap / d + np.sqrt(a**2 - along**2) * across
    return left + (end - left) * forms.LEFT_ARM.length / a


def test_a_five_bar_with_wrong_lengths_is_two_circles() -> None:
    """Errors up to 5 mm, 20 mrad and 2 %: poses to rounding; slopes by differences."""
    found, rng = five_bar(), np.random.default_rng(0)
    wrong = errors(found, rng, 100.0, 30)
    x, reached = found.model.poses(found.nominal, wrong)
    assert reached.all()
    for one, there in zip(wrong, x, strict=True):
        named = dict(zip(found.labels, one, strict=True))
        for k in range(len(POSES)):
            assert worst(tip(named, found.nominal.actuators[k]) - there[k]) < 1e-10
    h = 1e-5
    for j, label in enumerate(found.labels):
        for k in range(len(POSES)):
            each = [
                tip(dict.fromkeys(found.labels, 0.0) | {label: s * h}, found.nominal.actuators[k])
                for s in (1, -1)
            ]
            slope = found.slopes[k, :, j]
            assert worst((each[0] - each[1]) / (2 * h) - slope) < 1e-8 * max(worst(slope), 1.0)


def test_a_delta_with_wrong_rods_and_arms_is_three_spheres() -> None:
    """Both rods of a leg longer, both elbows farther out, encoders off: it only translates."""
    found, rng = delta(), np.random.default_rng(1)
    f, places = delta_forms, {label: k for k, label in enumerate(found.labels)}
    for _ in range(10):
        rod, arm, off = 5e-3 * rng.normal(size=(3, 3))
        wrong = np.zeros((1, len(found.labels)))
        for i in range(3):
            for side in ("left", "right"):
                wrong[0, places[f"distance:rod_{i + 1}_{side}"]] = rod[i]
                wrong[0, places[f"closure:rod_{i + 1}_{side}.a.x"]] = arm[i]
            wrong[0, places[f"offset:arm_{i + 1}_joint"]] = off[i]
        x, _ = found.model.poses(found.nominal, wrong)
        for there, angles in zip(x[0], found.nominal.actuators, strict=True):
            centres = [
                T @ [f.BASE - f.PLATFORM + length * np.cos(t), 0, -length * np.sin(t)]
                for T, t, length in zip(f.TURNS, angles + off, f.ARM + arm, strict=True)
            ]
            both = meeting(centres, f.ROD + rod)
            assert worst(there[3:]) < 1e-9
            assert min(worst(one - there[:3]) for one in both) < 1e-9


def meeting(centres: list[Array], radii: Array) -> list[Array]:
    """The two points of three spheres."""
    c = np.array(centres)
    A = 2 * (c[1:] - c[0])
    right = (c[1:] ** 2).sum(axis=1) - (c[0] ** 2).sum() - radii[1:] ** 2 + radii[0] ** 2
    point = np.linalg.lstsq(A, right, rcond=None)[0]
    n = np.cross(A[0], A[1])
    n /= np.linalg.norm(n)
    away = point - c[0]
    half = np.sqrt((away @ n) ** 2 - away @ away + radii[0] ** 2)
    return [point + (-away @ n + s * half) * n for s in (1, -1)]


def test_a_3_rps_with_other_radii_by_its_closed_forms() -> None:
    """All legs' base joints moved outwards, or all balls: what `RPSRobot` of that radius has."""
    found, robot = rps(), RPSRobot.from_preset("sokolov")
    lengths, h = found.nominal.actuators[0], 1e-5
    columns = [found.coordinates.index(name) for name in ("z", "rx", "ry")]
    angles = np.deg2rad([0.0, 120.0, -120.0])
    for radius in ("base_radius", "platform_radius"):
        each = []
        for s in (1, -1):
            value = getattr(robot.parameters, radius) + s * h
            other = RPSRobot(robot.parameters.without_limits().replace(**{radius: value}))
            each.append(other.forward_kinematics(lengths, near=[0.4, 0.1, -0.05]))
        wanted = (np.array(each[0]) - np.array(each[1])) / (2 * h)
        outwards = np.zeros(len(found.labels))
        for leg, angle in zip((1, 2, 3), angles, strict=True):
            if radius == "base_radius":  # x of the joint's frame is inwards
                outwards[found.labels.index(f"placement:leg_{leg}_revolute.x")] = -1.0
            else:  # frame a has the platform's axes
                outwards[found.labels.index(f"closure:leg_{leg}.a.x")] = np.cos(angle)
                outwards[found.labels.index(f"closure:leg_{leg}.a.y")] = np.sin(angle)
        assert worst(found.slopes[0][columns] @ outwards - wanted) < 1e-8, radius


# The Pinocchio engine -----------------------------------------------------------------------------


@pytest.mark.parametrize("of", [five_bar, delta, rps])
def test_slopes_by_differences_of_rebuilt_mechanisms(of: Any) -> None:
    """All numbers at random at once, the mechanism rebuilt, and its loops closed by Pinocchio."""
    found, rng, h = of(), np.random.default_rng(2), 1e-5
    model, at = found.model, found.nominal
    direction = rng.normal(size=len(found.labels))
    direction /= np.linalg.norm(direction)
    k, sides = len(at.x) - 1, []
    for s in (1, -1):
        wrong = s * h * direction
        geometric = np.array([label in model.output.own for label in found.labels])
        p = model.calibration.nominal.copy()
        for label, one in zip(found.labels, wrong, strict=True):
            if label in model.output.own:
                p[model.calibration.labels.index(model.output.own[label])] += one
        a = at.actuators[k].copy()
        for label, one in zip(np.array(found.labels)[~geometric], wrong[~geometric], strict=True):
            kind, _, name = label.partition(":")
            j = model.output.held.index(name)
            a[j] += one * (at.actuators[k, j] if kind == "scale" else 1.0)
        other = model.engine.reference(p).with_actuated(model.output.held)
        q = other.complete(a, at.q[k], within_limits=False)
        sides.append(q[model.output.extension.idx_q])
    slope = found.slopes[k] @ direction
    assert worst((sides[0] - sides[1]) / (2 * h) - slope) < 2e-8 * worst(found.slopes[k])


# Sizes and shares ---------------------------------------------------------------------------------


def test_deviations_bounds_and_shares() -> None:
    found = five_bar()
    S, t = found.slopes, found.tolerances.limits
    assert worst(found.deviations - np.sqrt(((S * t / 3) ** 2).sum(axis=-1))) < 1e-15
    # The largest error is that of one corner.
    for k in range(2):
        corner = np.sign(S[0, k]) * t
        assert abs(S[0, k] @ corner - found.worst[0, k]) < 1e-15
    shares = found.shares("position")
    assert abs(shares.sum() - 1) < 1e-12
    k = int(np.argmax(shares))
    half = tolerances(FIVE_BAR)
    single = {label: float(value) for label, value in zip(found.labels, t, strict=True)}
    single[found.labels[k]] /= 2
    again = tolerance(found.model.task, single, POSES)
    assert abs(again.rms("position") - found.halved("position")[k]) < 1e-12
    assert len(half) == 4


def test_distributions() -> None:
    """A uniform error spreads t / sqrt(3), a normal one t / k; machines do, too."""
    task = five_bar().model.task
    for distribution, divided in (("uniform", np.sqrt(3)), ("normal", 2.0)):
        given = tolerances(FIVE_BAR, distribution=distribution, sigmas=2.0)
        found = tolerance(task, given, POSES)
        assert worst(found.tolerances.deviations * divided - found.tolerances.limits) < 1e-18
        machines = monte_carlo(found, 4000)
        scaled = machines.numbers / found.tolerances.limits
        assert worst(scaled.std(axis=0) * divided - 1) < 0.05  # four deviations
        if distribution == "uniform":
            assert 0.99 < worst(scaled) <= 1.0
        assert worst(machines.deviations / found.deviations - 1) < 0.05
        assert abs(machines.ratio("position") - 1) < 4 * machines.spread("position") < 0.1


@pytest.mark.parametrize("of", [five_bar, delta, rps])
def test_first_order_is_enough_at_the_tolerances_of_a_workshop(of: Any) -> None:
    found = of()
    machines = monte_carlo(found, 2000)
    assert machines.failures == 0
    assert not machines.doubts
    for part in found.parts:
        assert abs(machines.ratio(part.name) - 1) < 0.05
        assert 0 < machines.remainder(part.name) < 0.01
        # Of the second order: twice as large when all is.
        double = monte_carlo(found.scaled(2.0), 2000)
        assert abs(double.remainder(part.name) / machines.remainder(part.name) - 2) < 0.1
    nearly_all = machines.percentile("position", 99.0)
    assert 2 < nearly_all / found.rms("position") < 4


def test_sobol_indices_are_the_shares_where_all_is_linear() -> None:
    found = five_bar()
    indices = sobol(found, samples=256)
    shares = found.shares("position")
    assert indices.labels == found.labels
    assert worst(indices.total - shares) < 0.03
    assert worst((indices.first - shares) / (indices.first_bounds + 1e-4)) < 2.0
    assert indices.machines == 256 * (len(shares) + 2)


def test_sobol_indices_of_a_product() -> None:
    """y = (a + b c, 2 d) of uniform numbers of variance 1/3: b and c only together."""
    labels = tuple("abcd")

    def poses(_: Any, wrong: Array) -> tuple[Array, Array]:
        a, b, c, d = wrong.T
        x = np.stack([a + b * c, 2 * d], axis=-1)[:, None]
        return x, np.ones(x.shape[:2], dtype=bool)

    one = np.ones(4)
    chosen = SimpleNamespace(labels=labels, limits=one, deviations=one, normal=one < 0)
    fake: Any = SimpleNamespace(
        labels=labels,
        tolerances=chosen,
        nominal=SimpleNamespace(x=np.zeros((1, 2))),
        model=SimpleNamespace(poses=poses),
        part=lambda _: SimpleNamespace(columns=np.arange(2)),
    )
    found = sobol(fake, samples=4096)
    whole = 1 / 3 + 1 / 9 + 4 / 3
    assert worst(found.first - np.array([1 / 3, 0, 0, 4 / 3]) / whole) < 0.02
    assert worst(found.total - np.array([1 / 3, 1 / 9, 1 / 9, 4 / 3]) / whole) < 0.02


# Poses --------------------------------------------------------------------------------------------


def test_poses_of_motions_grids_and_workspaces() -> None:
    task = ClosedLoopModel.load("urdf/five_bar.yaml").task.compile(
        compiler="tcc" if tcc.is_here() else "auto"
    )
    motion = point_to_point(task.home, [0.22, 0.52], duration=0.4)
    found = tolerance(task, FIVE_BAR, motion)
    assert worst(found.poses.x[[0, -1]] - [task.home, [0.22, 0.52]]) < 1e-12
    grid = task_grid(task, {"x": np.linspace(0.0, 0.6, 4), "z": np.linspace(0.3, 0.7, 4)})
    inside = workspace(task, grid)
    of_grid, of_inside = (tolerance(task, FIVE_BAR, one) for one in (grid, inside))
    assert 0 < len(of_inside.poses.x) <= len(of_grid.poses.x) < 16
    assert set(of_inside.poses.points) == set(np.flatnonzero(inside.inside))
    at = grid.points(of_grid.poses.points)
    assert worst(at - of_grid.poses.x) == 0.0
    assert worst(of_grid.nominal.x - at) < 1e-10
    with pytest.raises(UnreachableError, match="pose 1"):
        tolerance(task, FIVE_BAR, [task.home, [3.0, 0.5]])
    with pytest.raises(InputError, match="expected \\(n, 2\\)"):
        tolerance(task, FIVE_BAR, [0.1, 0.2, 0.3])


def test_machines_that_cannot_be_closed_are_counted() -> None:
    """Arms that are nearly in line, with errors that take their ends apart."""
    found = tolerance(five_bar().model.task, FIVE_BAR, [[0.19, 0.25]]).scaled(300.0)
    machines = monte_carlo(found, 300)
    assert 50 < machines.failures < 200
    assert np.isnan(machines.errors[~machines.reached]).all()
    assert np.isfinite(machines.errors[machines.reached]).all()
    assert 0 < machines.spread("position") < 0.2
    too_large, lost = machines.doubts
    assert "take those of the machines" in too_large
    assert f"{machines.failures} of 300 machines cannot be closed" in lost
    with pytest.raises(UnreachableError, match="machines do not reach"):
        sobol(found, samples=16)


# What is refused, and what is named ---------------------------------------------------------------


def test_errors_that_open_loops_are_refused_or_named() -> None:
    task = five_bar().model.task
    given = {"placement:*joint.?": "0.05 mm", "closure:tips.a.x": "0.05 mm"}
    with pytest.raises(InputError, match=r"placement:left_joint\.y, .* open loops"):
        tolerance(task, given)
    found = tolerance(task, given, opening="leave out")
    assert found.left_out == tuple(
        f"placement:{one}.y"
        for one in ("left_joint", "left_arm_joint", "right_joint", "right_arm_joint")
    )
    assert not set(found.left_out) & set(found.labels)
    assert "would open loops" in found.doubts[0]
    assert "would open loops" in table_text(found)
    with pytest.raises(InputError, match="all of these numbers open loops"):
        tolerance(task, {"placement:*joint.y": 1e-3, "closure:tips.?.y": 1e-3}, opening="leave out")


def test_a_file_with_rounded_numbers(tmp_path: Path) -> None:
    """An axis that is off by 2e-5 rad: what opens loops is told from that, and nothing else."""
    text = Path("urdf/five_bar.urdf").read_text()
    place = '<origin xyz="0.4 0 0"/>'
    assert place in text
    rounded = text.replace(place, '<origin xyz="0.4 0 0" rpy="1e-5 0 2e-5"/>')
    (tmp_path / "five_bar.urdf").write_text(rounded)
    shutil.copy("urdf/five_bar.yaml", tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AccuracyWarning)
        model = ClosedLoopModel.load(tmp_path / "five_bar.yaml")
        found = tolerance(model, {"placement:left_joint.?": 1e-4}, POSES, opening="leave out")
    assert found.left_out == ("placement:left_joint.y",)
    at = [five_bar().labels.index(label) for label in found.labels]
    assert worst(found.slopes - five_bar().slopes[..., at]) < 1e-4


def test_numbers_that_change_nothing_are_named() -> None:
    """A ball's frame may be turned as it likes."""
    given = {"placement:leg_*.x": 1e-3, "closure:leg_*.a.x": 1e-3, "closure:leg_1.b.roll": 1e-3}
    found = tolerance(RPSRobot.from_preset("sokolov"), given, coordinates="pose")
    assert found.unseen == ("closure:leg_1.b.roll",)
    assert "no error of these changes the output" in table_text(found)


def test_faults_of_names_and_sizes() -> None:
    kinds = names(ClosedLoopModel.load("urdf/five_bar.yaml"))
    assert kinds["placement:left_joint.x"] == "length"
    assert kinds["frame:left_tip.yaw"] == kinds["offset:left_joint"] == "angle"
    assert kinds["scale:right_joint"] == "ratio"
    task = five_bar().model.task
    for given, told in (
        ({"placement:left_jiont.x": 1e-3}, "did you mean placement:left_joint.x"),
        ({"placement:left_*.x": "0.05 mrad"}, "placement:left_joint.x is a length"),
        ({"offset:*": "0.05"}, "it has no unit"),
        ({"offset:*": "5 inch"}, "no unit 'inch'"),
        ({"offset:*": "about 5 mm"}, "it must be a number and a unit"),
        ({"offset:*": -1e-3}, "offset:\\*"),
        ({"offset:*": np.nan}, "offset:\\*"),
        ({"offset:*": 0.0}, "all tolerances are 0"),
        ({"offset:*": 1e-3, "offset:l*": 1e-3}, "both stand for offset:left_joint"),
        ({}, "no tolerances"),
    ):
        with pytest.raises(InputError, match=told):
            tolerance(task, given)
    # A name goes before a pattern; 0 is exact.
    found = tolerance(task, {"offset:*": "1 mrad", "offset:left_joint": "0 mrad"})
    assert found.labels == ("offset:right_joint",)
    with pytest.raises(MechanismError, match="has no task"):
        tolerance(ClosedLoopModel.load("urdf/cassie_leg_free.yaml"), {"offset:*": 1e-3})
    with pytest.raises(InputError, match="power of 2"):
        sobol(five_bar(), samples=100)
    with pytest.raises(InputError, match="no part 'angle'"):
        five_bar().shares("angle")


def test_a_file_of_tolerances(tmp_path: Path) -> None:
    file = tmp_path / "tolerances.yaml"
    text = (
        "distribution: normal\nsigmas: 2\ntolerances:\n  placement:left_*.x: 0.05 mm\n"
        "  placement:right_*.x: 1 mm\n  closure:tips.a.x: 1 mm\n"
        "  offset:left_joint: {tolerance: 20 arcsec, distribution: uniform}\n"
    )
    file.write_text(text)
    one, *_, other = load_tolerances(file)
    assert (one.size, one.sigmas, one.distribution) == (5e-5, 2.0, "normal")
    assert (other.distribution, other.pattern) == ("uniform", "offset:left_joint")
    assert abs(other.size - 20 * np.pi / 180 / 3600) < 1e-15
    task = five_bar().model.task
    assert tolerance(task, file).labels[-2:] == ("closure:tips.a.x", "offset:left_joint")
    for old, new, told in (
        ("0.05 mm", "0.05 mn", "line 4: .*no unit 'mn'"),
        ("0.05 mm", "0.05", "line 4: .*must be"),
        ("left_*.x", "lift_*.x", "line 4: no number 'placement:lift_\\*.x'"),
        ("left_*.x", "left_*.roll", "line 4: .*an angle, such as"),
        ("uniform}", "flat}", "line 7"),
        ("sigmas: 2", "sigmas: 0", "line 2"),
        ("sigmas", "sigma", "line 2: unknown key 'sigma'"),
    ):
        file.write_text(text.replace(old, new))
        with pytest.raises(InputError, match=told):
            tolerance(task, file)


def test_actuators_that_hold() -> None:
    """Of a mechanism with more actuators than motions, it is said which of them hold."""
    model = ClosedLoopModel.load("urdf/five_bar.yaml")
    more = model.with_actuated(["left_joint", "right_joint", "left_arm_joint"])
    task = Task(more, frame="left_tip", coordinates=["x", "z"])
    with pytest.raises(MechanismError, match=r"held=\[\.\.\.\] says which"):
        tolerance(task, {"offset:*": 1e-3})
    found = tolerance(task, {"offset:*": 1e-3}, held=["left_joint", "left_arm_joint"])
    assert found.labels == ("offset:left_joint", "offset:left_arm_joint")
    # An open arm of two bars: its Jacobian is known.
    x, z = found.nominal.x[0]
    angle, arm = found.nominal.actuators[0].sum(), five_bar_forms.LEFT_ARM.length
    wanted = [[-z, -arm * np.sin(angle)], [x, arm * np.cos(angle)]]
    # Joints turn about -y: angles from x towards z.
    assert worst(found.slopes[0] - wanted) < 1e-9


def test_the_table(tmp_path: Path) -> None:
    found = five_bar()
    columns, table = rows(found)
    assert len(table) == len(found.labels)
    shares = [row[columns.index("position_share_percent")] for row in table]
    assert shares == sorted(shares, reverse=True)
    assert abs(sum(shares) - 100) < 1e-9
    for row in table:
        k = found.labels.index(row[0])
        unit = {"mm": 1e-3, "mrad": 1e-3, "ppm": 1e-6}[row[2]]
        assert abs(row[1] * unit - found.tolerances.limits[k]) < 1e-12
    write_table(found, tmp_path / "table.csv")
    head, *lines = (tmp_path / "table.csv").read_text().splitlines()
    assert head.split(",")[:4] == ["number", "tolerance", "unit", "distribution"]
    assert len(lines) == len(table)
    assert "and 10 more" in table_text(found, len(table) - 10)


def test_poses_beyond_limits_are_named() -> None:
    """A Stewart platform below its base: its legs are too long there, or too short."""
    task = ClosedLoopModel.load("urdf/stewart.yaml").task
    lower = task.home - np.array([0, 0, 0.3, 0, 0, 0])
    found = tolerance(task, {"offset:*": "0.01 mm"}, [task.home, lower])
    assert found.doubts == ("1 of 2 poses are beyond joints' limits of position",)
    assert not tolerance(task, {"offset:*": "0.01 mm"}).doubts


def test_labels_of_shares_are_inside_and_no_line_crosses_them() -> None:
    """Of a number that makes the whole error, and of one that makes most of it."""
    task = ClosedLoopModel.load("urdf/five_bar.yaml").task
    for drawing in ({"offset:left_joint": 1e-4}, {"offset:left_joint": 1e-4, "offset:r*": 7e-5}):
        figure = plot_tolerance_shares(tolerance(task, drawing))
        figure.canvas.draw()
        (axes,) = figure.axes
        assert len(axes.texts) == len(drawing)
        assert re.fullmatch(r"(100|\d\d) %", axes.texts[0].get_text())
        for label in axes.texts:
            patch = label.get_bbox_patch()
            assert patch is not None
            assert patch.get_facecolor() == (1, 1, 1, 1)
            assert label.get_window_extent().x1 <= axes.get_window_extent().x1
