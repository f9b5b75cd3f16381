"""Calibration from files: readings in CSV, instruments, the description that is written, words."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import null_space

from rps_pin import ClosedLoopModel, InputError
from rps_pin.arrays import Array
from rps_pin.task.calibration import (
    BallBar,
    CalibrationModel,
    Height,
    Inclinometer,
    Readings,
    Tracker,
    calibrate,
    calibrated_mechanism,
    candidate_poses,
    cross_validate,
    geometric_groups,
    load_instruments,
    plan_poses,
    pose_deviations,
    read_readings,
    readings,
    unseen_in_words,
    write_calibrated,
)
from tests.cli.commands import rps_pin
from tests.task.test_calibration import DEVIATIONS, five_bar, measured, read, wrong
from tests.worst import worst

ROOT = Path(__file__).parents[2]
HEADER = "pose,left_joint_deg,right_joint_mrad,x_mm,z_m,x_deviation_um\n"


def written(values: Array, path: Path) -> Path:
    """Readings as a file, in other units."""
    factors = 180 / np.pi, 1e3, 1e3, 1.0
    rows = [
        ",".join([str(i), *(repr(float(one)) for one in row * factors), "30"])
        for i, row in enumerate(values)
    ]
    path.write_text("# a comment\n" + HEADER + "\n".join(rows) + "\n")
    return path


def others() -> dict[str, float]:
    return {name: value for name, value in DEVIATIONS.items() if name != "x"}


# CSV ----------------------------------------------------------------------------------------------


def test_readings_of_a_file(tmp_path: Path) -> None:
    values, _ = measured(five_bar().model.nominal, np.random.default_rng(0))
    path = written(values, tmp_path / "r.csv")
    found = read_readings(path, five_bar().task, others())
    assert found.sensors == tuple(DEVIATIONS)
    assert worst(found.values - values) < 1e-14
    assert worst(found.deviations / list(DEVIATIONS.values()) - 1) < 1e-14
    path.write_text(HEADER + "0,120,,10,0.5,30\n1,,900,,0.5,\n")
    found = read_readings(path, five_bar().task, others())
    assert np.isnan(found.values).tolist() == [[False, True, False, False], [True, False, True, 0]]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "is empty"),
        ("left_joint_deg,x_mm\n", "no poses after the header"),
        ("left_joint\n1\n", "line 1: column 'left_joint' is not known: columns of left_joint are"),
        ("left_joint_mm\n1\n", "one of the units rad, mrad, urad, deg"),
        ("left_jiont_deg\n1\n", r"did you mean left_joint_deg\?"),
        ("x_mm,x_m\n1,1\n", "two columns hold the same as 'x_m'"),
        ("x_mm,z_deviation_um\n1,1\n", "a deviation of z, and no column of its readings"),
        ("x_mm,z_mm\n1,1\n,\n", "line 3: nothing was read at this pose"),
        ("x_mm;z_mm\n1;0,5\n", "line 2: z_mm = '0,5'.*with a point"),
        ("x_mm\nnan\n", "line 2: x_mm = 'nan': it must be a finite number"),
        ("x_mm,z_mm\n1\n", "line 2: 1 cells, where the header names 2"),
        ("x_mm,x_deviation_um\n1,0\n", "a standard deviation is positive"),
        ("x_m\n110.5\n120\n", "line 2: x_m = 110.5, as most .* name it so: x_mm"),
        ("left_joint_rad\n120\n90\n", "name it so: left_joint_deg"),
        ("x_mm\n1\n", "the standard deviation of x is missing: add a column .*x_deviation_m"),
        ("x_mm,x_deviation_um\n1,\n", "pose 0 of x has none"),
        ("1,2\n", "where the header must name the columns"),
    ],
)
def test_faults_of_a_file(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=told):
        read_readings(path, five_bar().task)


# The description ----------------------------------------------------------------------------------


def test_the_description_is_the_calibrated_mechanism(tmp_path: Path) -> None:
    """Read again, its actuators stand where the calibration says; with a comment at each change."""
    case = five_bar()
    values, _ = measured(wrong(np.random.default_rng(1)), np.random.default_rng(1))
    found = calibrate(case.model, read(values))
    path = write_calibrated(case.model, found, tmp_path / "mine.urdf")
    again = ClosedLoopModel.load(path)
    q = case.model.closed(case.x, case.q, found.parameters)
    at = case.task.of_actuators
    assert worst(again.task.to_actuators(case.x, near=again.home) - q[:, at]) < 1e-12
    urdf, yaml = (tmp_path / "mine.urdf").read_text("utf-8"), path.read_text("utf-8")
    k = found.labels.index("placement:right_joint.x")
    change = f"{found.parameters[k] - found.before[k]:.6g} m"
    assert f"calibrated: x changed by {change}" in urdf
    assert "was xyz 0.4 0 0, rpy 0 0 0" in urdf
    assert yaml.count("# calibrated: closure:tips") + yaml.count("# calibrated: a.x") == 1
    assert "#   offset:left_joint: " in yaml
    with pytest.raises(InputError, match="exist; overwrite=True"):
        write_calibrated(case.model, found, tmp_path / "mine.urdf")
    assert worst(calibrated_mechanism(case.model, found).home - again.home) < 1e-12


def test_the_command(tmp_path: Path) -> None:
    values, _ = measured(five_bar().model.nominal, np.random.default_rng(2))
    values[7, 3] = 9.0
    written(values, tmp_path / "r.csv")
    words = ["calibrate", "r.csv", "--mechanism", str(ROOT / "urdf" / "five_bar.yaml"), "--json"]
    words += [f"--deviation={name}={value}" for name, value in others().items()]
    words += [f"--parameters={group}" for group in five_bar().model.groups]
    ended = rps_pin(*words, folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    told = json.loads(ended.stdout)
    assert told["identifiable"] == 11
    assert [(one["pose"], one["sensor"]) for one in told["outliers"]] == [(7, "z")]
    assert 0.8 < told["cross_validation_ratio"] < 1.3
    assert [one["name"] for one in told["by_kind"]] == ["actuators", "coordinates"]
    described = tmp_path / "calibration" / "five_bar_calibrated.yaml"
    for command in (["describe", str(described)], ["ik", "-m", str(described), "--json"]):
        assert rps_pin(*command, folder=tmp_path).returncode == 0
    ended = rps_pin(*words, folder=tmp_path)
    assert (ended.returncode, "exist; --overwrite" in ended.stderr) == (1, True)
    ended = rps_pin(*words[:-9], "--overwrite", folder=tmp_path)
    assert "the standard deviation of" in ended.stderr
    theirs = tmp_path / "calibration" / "parameters.csv"
    theirs.write_text("an instruments' file")
    ended = rps_pin(*words, "--instruments", str(theirs), "--overwrite", folder=tmp_path)
    assert "parameters.csv is an input of this command" in ended.stderr
    assert theirs.read_text() == "an instruments' file"


# Words --------------------------------------------------------------------------------------------


def test_what_cannot_be_told_is_told_in_words() -> None:
    task = five_bar().task
    model = CalibrationModel(
        task, ["placement:left_joint"], tuple(DEVIATIONS), offsets=["left_joint"]
    )
    x = five_bar().x
    values = model.predict(x, model.home(x, model.nominal), model.nominal).readings
    told = unseen_in_words(model, calibrate(model, read(values)).identifiable)
    own = "placement:left_joint.pitch (about its axis)"
    assert any(
        one
        in (
            f"{own} by 1 rad has the effect of offset:left_joint by -1 rad",
            f"offset:left_joint by 1 rad has the effect of {own} by -1 rad",
        )
        for one in told
    )


def test_directions_in_words_change_no_reading() -> None:
    """Each sentence, read back, is a direction along which the slopes are zero."""
    model, x, q = five_bar().model, five_bar().x, five_bar().q
    values = model.predict(x, q, model.nominal).readings
    found = calibrate(model, read(values))
    slopes = model.predict(x, q, model.nominal)
    checked = 0
    for one in unseen_in_words(model, found.identifiable):
        if " by 1 " not in one or " more" in one:
            continue
        direction = np.zeros(len(model.labels))
        first, _, rest = one.partition(" has the effect of ")
        for sign, term in ((1, first), *((-1, term) for term in rest.split(" with "))):
            name, _, amount = term.rpartition(" by ")
            k = model.labels.index(name.partition(" (")[0])
            direction[k] += sign * float(amount.split()[0])
        r = slopes.by_parameters @ direction
        A = slopes.by_pose
        r -= np.einsum("nsm,nm->ns", A, (np.linalg.pinv(A) @ r[..., None])[..., 0])
        if worst(slopes.opening @ direction) < 1e-3:  # four digits are printed
            checked += 1
            assert worst(r) < 1e-3
    assert checked > 3


# Instruments --------------------------------------------------------------------------------------

TARGETS = {"A": [0.1, 0.02, 0.01], "B": [-0.05, 0.09, 0.02], "C": [-0.06, -0.08, 0.0]}
STANDS = pin.SE3(pin.exp3(np.array([0.3, -0.4, 2.0])), np.array([1.5, -0.4, 0.3]))


@cache
def instruments() -> CalibrationModel:
    """A 3-RPS seen by a tracker of unknown placement, a ball bar, a gauge and a level."""
    task = ClosedLoopModel.load(ROOT / "urdf" / "rps.yaml").task
    several = (
        Tracker(TARGETS, "platform", unknown_targets=True),
        BallBar("bar", "platform", [0.05, 0, 0], [0.2, 0.1, 0.0]),
        Height("gauge", "platform", [0.03, 0.05, 0.0], [0.1, 0.0, 1.0]),
        Inclinometer("level", "platform", [1.0, 0.2, 0.0]),
    )
    names = [*task.mechanism.actuated, *(name for one in several for name in one.sensors)]
    groups = ["placement:leg_1_revolute", "closure:leg_2"]
    return CalibrationModel(task, groups, names, ["gauge"], ["level"], several)


def there(model: CalibrationModel, n: int) -> tuple[Array, Array, Array]:
    """Poses, configurations, and parameters with the tracker where it stands."""
    rng = np.random.default_rng(7)
    p = model.nominal + 2e-3 * rng.normal(size=model.nominal.size)
    first = model.labels.index("tracker.x")
    p[first : first + 6] = [*STANDS.translation, *pin.log3(STANDS.rotation)]
    x = model.task.home + rng.uniform(-1, 1, (n, 3)) * [0.05, 0.2, 0.2]
    return x, model.home(x, model.nominal), p


def test_slopes_of_what_instruments_read() -> None:
    model, h = instruments(), 1e-6
    x, q, p = there(model, 4)
    found = model.predict(x, q, p)
    for k in range(p.size):
        step = h * np.eye(p.size)[k]
        sides = [model.predict(x, q, p + s * step).readings for s in (1, -1)]
        assert worst((sides[0] - sides[1]) / (2 * h) - found.by_parameters[..., k]) < 2e-8
    for k in range(3):
        step = h * np.eye(3)[k]
        sides = [model.predict(x + s * step, q, p).readings for s in (1, -1)]
        assert worst((sides[0] - sides[1]) / (2 * h) - found.by_pose[..., k]) < 2e-8


def test_what_instruments_read_is_the_pinocchio_engines() -> None:
    model = instruments()
    x, q, p = there(model, 3)
    found = model.predict(x, q, p)
    other = model.engine.reference(p[: len(model.engine.parameters)])
    own = dict(zip(model.labels, p, strict=True))
    for one, readings_ in zip(found.q, found.readings, strict=True):
        at = pin.SE3(other.frame_placement(one, "platform"))
        for name in TARGETS:
            target = np.array([own[f"{name}.{axis}"] for axis in "xyz"])
            k = model.sensors.index(f"{name}_x")
            seen = STANDS.actInv(at.act(target))
            assert worst(readings_[k : k + 3] - seen) < 1e-9
        target, centre = (
            np.array([own[f"bar.{end}.{axis}"] for axis in "xyz"]) for end in ("target", "centre")
        )
        length = np.linalg.norm(at.act(target) - centre)
        assert abs(readings_[model.sensors.index("bar")] - length) < 1e-9
        n = np.array([0.1, 0.0, 1.0]) / np.hypot(0.1, 1.0)
        height = n @ at.act(np.array([0.03, 0.05, 0.0])) - own["offset:gauge"]
        assert abs(readings_[model.sensors.index("gauge")] - height) < 1e-9
        axis = at.rotation @ (np.array([1.0, 0.2, 0.0]) / np.hypot(1.0, 0.2))
        level = np.arcsin(axis[2]) / own["scale:level"]
        assert abs(readings_[model.sensors.index("level")] - level) < 1e-9


def test_a_tracker_of_unknown_placement() -> None:
    """Found from encoders and targets; its errors are those that the covariance says."""
    task = ClosedLoopModel.load(ROOT / "urdf" / "rps.yaml").task
    tracker = Tracker(TARGETS, "platform")
    names = (*task.mechanism.actuated, *tracker.sensors)
    model = CalibrationModel(task, (), names, task.mechanism.actuated, (), [tracker])
    x, q, _ = there(instruments(), 25)
    q = model.home(x, model.nominal)
    truth = model.nominal.copy()
    truth[:6] = [*STANDS.translation, *pin.log3(STANDS.rotation)]
    truth[6:] = 1e-3, -2e-3, 5e-4
    rng, deviation = np.random.default_rng(3), 2e-5
    values = model.predict(x, q, truth).readings
    values = values + deviation * rng.normal(size=values.shape)
    values[4, 5] += 0.01
    given = readings(
        task, dict(zip(names, values.T, strict=True)), dict.fromkeys(names, deviation), names
    )
    found = calibrate(model, given)
    assert np.argwhere(found.outliers).tolist() == [[4, 5]]
    assert found.alone.all()
    error = found.parameters - truth
    squares = float(error @ np.linalg.solve(found.covariance, error))
    assert squares < 27.9  # chi squared of 9 degrees of freedom, 0.1 %
    assert 0.8 < cross_validate(model, given, folds=3).ratio < 1.25
    with pytest.raises(InputError, match="in a line or too few"):
        one = Tracker({"A": TARGETS["A"]}, "platform")
        one.placed(np.zeros((2, 6)), np.zeros((2, 3)))


def test_instruments_of_a_file(tmp_path: Path) -> None:
    task = ClosedLoopModel.load(ROOT / "urdf" / "rps.yaml").task
    path = tmp_path / "i.yaml"
    path.write_text(
        "trackers:\n  laser: {frame: platform, targets: {A: [0.1, 0, 0]}, "
        "placement: {xyz: [1, 2, 3], rpy: [0, 0, 1]}}\n"
        "ball_bars:\n  bar: {frame: platform, target: [0, 0, 0], centre: [1, 0, 0]}\n"
        "heights:\n  gauge: {frame: platform}\ninclinometers:\n"
        "  level: {frame: platform, axis: [1, 0, 0]}\n"
    )
    found = load_instruments(path, task)
    assert [name for one in found for name in one.sensors] == [
        *("A_x", "A_y", "A_z", "bar", "gauge", "level")
    ]
    assert worst(found[0].nominal - [1, 2, 3, 0, 0, 1]) < 1e-15
    path.write_text("heights:\n  gauge: {frame: platfrom}\n")
    with pytest.raises(InputError, match=r"line 2.*platfrom"):
        load_instruments(path, task)
    path.write_text("heights:\n  gauge: {frame: platform, axis: 1}\n")
    with pytest.raises(InputError, match="unknown key 'axis'"):
        load_instruments(path, task)


# Planning -----------------------------------------------------------------------------------------


def test_planned_poses() -> None:
    """Better than any random set and than any exchange of one; what is predicted comes true."""
    model, task = five_bar().model, five_bar().task
    ranges = {"x": (0.05, 0.35), "z": (0.4, 0.6)}
    x = candidate_poses(task, ranges, 60, seed=3)
    plan = plan_poses(model, x, 12, DEVIATIONS, widest=0.05)
    assert (x[plan.chosen] == plan.x).all()
    assert len(set(plan.chosen)) == 12
    assert (plan.random[:, 0] > plan.deviation).all()
    assert min(plan.factors) > 1.2
    # log det of the information about what all candidates tell, anew from the residuals' slopes.
    spread = np.array(list(DEVIATIONS.values()))
    slopes = model.predict(x, model.home(x, model.nominal), model.nominal)
    blocks = []
    for A, B in zip(slopes.by_pose, slopes.by_parameters, strict=True):
        own = B / spread[:, None] / model.units
        free = null_space((A / spread[:, None]).T).T @ own
        blocks.append(free.T @ free)
    opening = np.vstack([*(slopes.opening / model.units)])
    closing = null_space(opening, rcond=1e-9)
    total = closing.T @ np.sum(blocks, axis=0) @ closing
    values, across = np.linalg.eigh(total)
    seen = closing @ across[:, values > 1 / 0.05**2]

    def determinant(chosen: Array) -> float:
        M = np.sum([blocks[i] for i in chosen], axis=0)
        return float(np.linalg.slogdet(seen.T @ M @ seen + np.eye(seen.shape[1]) / 0.05**2)[1])

    assert abs(determinant(plan.chosen) - plan.log_determinant) < 1e-6 * plan.log_determinant
    rng = np.random.default_rng(0)
    for k in range(12):
        other = plan.chosen.copy()
        other[k] = rng.choice(np.setdiff1d(np.arange(len(x)), plan.chosen))
        assert determinant(other) <= plan.log_determinant + 1e-5


def test_what_is_measured_already_counts_as_it_was_read() -> None:
    """Readings of all sensors as their poses; those that were not read tell nothing."""
    model, task, x = five_bar().model, five_bar().task, five_bar().x[:20]
    values = model.predict(x, model.home(x, model.nominal), model.nominal).readings
    candidates = candidate_poses(task, {"x": (0.05, 0.35), "z": (0.4, 0.6)}, 30, seed=3)

    def determinant(measured: Array | Readings | None) -> float:
        return plan_poses(
            model, candidates, 4, DEVIATIONS, measured=measured, widest=0.05
        ).log_determinant

    whole = determinant(x)
    assert abs(determinant(read(values)) - whole) < 1e-6 * whole
    half = values.copy()
    half[10:, 2:] = np.nan  # without a task coordinate a five-bar's encoders tell nothing
    half[10:, 1] = np.nan
    assert abs(determinant(read(half)) - determinant(x[:10])) < 1e-6 * whole
    assert determinant(None) < determinant(x[:10]) < whole
    with pytest.raises(InputError, match="measured: readings of"):
        determinant(readings(task, {"x": values[:, 2]}, {"x": 1e-5}))


def test_a_plan_from_the_terminal_is_filled_in_and_read(tmp_path: Path) -> None:
    words = ["calibrate", "--plan", "9", "-m", str(ROOT / "urdf" / "five_bar.yaml")]
    words += ["--over", "x=0.05:0.35", "--over", "z=0.4:0.6"]
    given = [f"--deviation={name}={value}" for name, value in DEVIATIONS.items()]
    ended = rps_pin(*words, *given, "--json", folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    told = json.loads(ended.stdout)
    x, path = np.array(told["poses"]), tmp_path / "calibration" / "poses.csv"
    assert (told["parameters"], told["fitted"]) == (len(five_bar().model.labels), 11)
    assert told["random_over_planned"]["deviation"] > 1
    header, *rows = (line.split(",") for line in path.read_text().splitlines())
    assert worst([float(row[1]) / 1e3 for row in rows] - x[:, 0]) < 1e-9
    model = five_bar().model
    values = model.predict(x, model.home(x, model.nominal), model.nominal).readings
    k = header.index("planned_left_joint_deg")
    off = worst([np.radians(float(row[k])) for row in rows] - values[:, 0])
    assert off < np.radians(0.51e-6)  # the last of nine digits
    with pytest.raises(InputError, match="line 2: nothing was read at this pose"):
        read_readings(path, five_bar().task)
    filled = written_plan(header, rows, values)
    path.write_text(filled)
    found = read_readings(path, five_bar().task)
    assert worst(found.values - values) < 1e-12
    assert worst(found.deviations / list(DEVIATIONS.values()) - 1) < 1e-9
    more = ["calibrate", str(path), *words[1:], "-o", "next"]
    ended = rps_pin(*more, folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert "poses measured before" in ended.stdout
    assert (tmp_path / "next" / "poses.csv").read_text().splitlines()[0] == ",".join(header)


def written_plan(header: list[str], rows: list[list[str]], values: Array) -> str:
    """The plan with readings in its empty columns."""
    lines = [",".join(header)]
    for row, read_ in zip(rows, values, strict=True):
        filled = row.copy()
        for name, value in zip(DEVIATIONS, read_, strict=True):
            unit, factor = ("deg", np.degrees(1)) if "joint" in name else ("mm", 1e3)
            filled[header.index(f"{name}_{unit}")] = repr(float(factor * value))
        lines.append(",".join(filled))
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([], "--plan needs ranges .* --over NAME=FROM:TO.*home: x 0.19"),
        (["--over", "y=0:1"], "--over y=0:1: no coordinate 'y'"),
        (["--over", "x=0:0.1:5"], "it must be NAME=FROM:TO"),
        (["--over", "x=1:0"], "FROM must be below TO"),
        (["--over", "x=0:1", "--over", "x=0:1"], "x is given twice"),
        (["--over", "x=0.1:0.3"], "say what will be read.*--deviation SENSOR=VALUE"),
        (["--over", "x=0.1:0.3", "--deviation", "q=1"], "called 'q'"),
        (["--over", "x=0.1:0.3", "--deviation", "x=1e-5", "--folds", "3"], "calibrates nothing"),
    ],
)
def test_faults_of_a_plan(words: list[str], told: str, tmp_path: Path) -> None:
    ended = rps_pin("calibrate", "--plan", "5", "-m", "five_bar", *words, folder=tmp_path)
    assert ended.returncode in (1, 2)
    assert re.search(told, re.sub(r"[\s│]+", " ", ended.stderr)), ended.stderr
    assert not (tmp_path / "calibration").exists()


def test_a_cross_validation_that_fails_loses_no_calibration(tmp_path: Path) -> None:
    """Two poses make two parts; one of them does not tell what both do."""
    values, _ = measured(five_bar().model.nominal, np.random.default_rng(2))
    written(values[:2], tmp_path / "r.csv")
    words = ["calibrate", "r.csv", "-m", str(ROOT / "urdf" / "five_bar.yaml"), "--widest=1"]
    words += [f"--deviation={name}={value}" for name, value in others().items()]
    words += ["--parameters=placement:right_joint", "--offset=left_joint"]
    ended = rps_pin(*words, folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert "note: no cross-validation, from the poses of all parts but one: 4 read" in ended.stderr
    assert (tmp_path / "calibration" / "five_bar_calibrated.yaml").exists()
    ended = rps_pin(*words, "--folds=5", "--overwrite", folder=tmp_path)
    assert "--folds 5: 2 to 2, the poses; 0: none" in ended.stderr


def test_a_calibration_needs_readings() -> None:
    for words, told in ([], "give a file of readings, or a --plan"), (["r.csv"], "of a --plan"):
        more = ["--over", "x=0:1"] if words else []
        ended = rps_pin("calibrate", *words, "-m", "five_bar", *more)
        assert ended.returncode == 2
        assert told in re.sub(r"[\s│]+", " ", ended.stderr)


def test_candidates_are_in_the_workspace() -> None:
    task = five_bar().task
    x = candidate_poses(task, {"x": (0, 0.7), "z": (0.4, 0.65)}, 20, min_distance=0.1)
    assert 0 < len(x) < 20
    q = task.configuration(x)
    assert (task.singularities(q).distance >= 0.1).all()
    with pytest.raises(InputError, match="none of 2 random poses is in the workspace"):
        candidate_poses(task, {"x": (0.9, 1)}, 2)
    with pytest.raises(InputError, match="no coordinate 'y'"):
        candidate_poses(task, {"y": (5, 6)}, 5)
    with pytest.raises(InputError, match="candidates have shape"):
        plan_poses(five_bar().model, x[:3], 5, DEVIATIONS)


def test_deviations_of_the_pose() -> None:
    """Of what the calibrated mechanism says, against errors of calibrations of one machine."""
    model, case = five_bar().model, five_bar()
    p, unused = wrong(np.random.default_rng(0)), case.x[:6] * 0.999
    errors = []
    for seed in range(30):
        values, _ = measured(p, np.random.default_rng(seed))
        found = calibrate(model, read(values), widest=1.0)
        q = model.closed(unused, model.home(unused, model.nominal), p)
        slopes = model.predict(unused, q, p)
        gain = np.linalg.inv(slopes.by_pose[:, :2])
        errors.append(-gain @ (slopes.by_parameters[:, :2] @ (found.parameters - p))[..., None])
    size = np.sqrt(np.mean(np.array(errors)[..., 0] ** 2, axis=0))
    ratio = size / pose_deviations(model, found, unused)
    assert 0.8 < np.sqrt(np.mean(ratio**2)) < 1.25


def test_all_groups() -> None:
    assert geometric_groups(five_bar().task) == five_bar().model.groups
