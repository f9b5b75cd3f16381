"""Trajectories by what a file says they are, and what is said about files that make no sense."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from rps_pin import InputError, RPSPinError, RPSRobot, helix
from rps_pin.config import read_yaml
from rps_pin.rps.motion.trajectory_file import load_trajectory
from rps_pin.rps.motion.trajectory_schema import KINDS
from rps_pin.task.sizing.sizing_sheet import ActuatorLimits
from rps_pin.trajectories import circle, lissajous, point_to_point, spline
from rps_pin.trajectories.csv_file import read_csv
from rps_pin.trajectories.path import Trajectory
from tests.each import each

ROBOT = RPSRobot.from_preset("micro")
STEP = "kind: point_to_point\nstart: [0.215, 0, 0]\nend: [0.225, 0.12, 0]\n"
CIRCLE = "kind: circle\nheight: 0.2\ntilt: 0.1\nduration: 2\n"
POSES = [[0.215, 0.0, 0.0], [0.225, 0.12, 0.0], [0.23, 0.0, 0.1]]
THROUGH = "kind: spline\nposes:\n- [0.215, 0, 0]\n- [0.225, 0.12, 0]\n- [0.23, 0, 0.1]\n"
SWINGS = "kind: lissajous\nheight: 0.2\nduration: 2\nfrequency: [3, 2]\n"
HELIX = "kind: helix\nradius: 2e-4\npitch: 5e-3\nheight: 0.22\n"

#: What a file says, and the same trajectory from its function.
DESCRIBED: list[tuple[str, Trajectory]] = [
    (HELIX, helix(ROBOT, radius=2e-4, pitch=5e-3, height=0.22)),
    (
        HELIX + "branch: '-'\nduration: 3\n",
        helix(ROBOT, radius=2e-4, pitch=5e-3, height=0.22, branch="-", duration=3),
    ),
    (STEP + "duration: 2.5\n", point_to_point(POSES[0], POSES[1], duration=2.5)),
    (
        STEP
        + "profile: s-curve\nmax_rate: [0.1, 1, 2]\nmax_acceleration: 2\nmax_jerk: [9, 8, 7]\n",
        point_to_point(
            *POSES[:2], profile="s-curve", max_rate=[0.1, 1, 2], max_acceleration=2,
            max_jerk=[9, 8, 7],
        ),
    ),
    (THROUGH + "times: [0, 0.4, 1]\n", spline(POSES, [0, 0.4, 1])),
    (
        THROUGH + "duration: 2\nprofile: quintic\ntilt_scale: 0.2\n",
        spline(POSES, duration=2, profile="quintic", tilt_scale=0.2),
    ),
    (CIRCLE, circle(height=0.2, tilt=0.1, duration=2)),
    (CIRCLE + "turns: null\nprofile:\n", circle(height=0.2, tilt=0.1, duration=2)),
    (
        CIRCLE + "turns: 2\nstart: -1\nprofile: quintic\n",
        circle(height=0.2, tilt=0.1, duration=2, turns=2, start=-1, profile="quintic"),
    ),
    (
        SWINGS + "amplitude: [0.1, 0.2]\n",
        lissajous(height=0.2, amplitude=[0.1, 0.2], frequency=[3, 2], duration=2),
    ),
    (
        SWINGS + "amplitude: [0, 0.2]\nphase: [1, 2.5]\nlift: [0.01, 2]\nturns: 2\n",
        lissajous(
            height=0.2, amplitude=[0, 0.2], frequency=[3, 2], phase=[1, 2.5], lift=(0.01, 2),
            turns=2, duration=2,
        ),
    ),
]  # fmt: skip


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def same(one: Trajectory, other: Trajectory) -> None:
    assert one.duration == other.duration
    t = np.linspace(0, one.duration, 50)
    for a, b in zip(one.sample(t), other.sample(t), strict=True):
        assert_array_equal(a, b)


def table(path: Path) -> Path:
    t = np.linspace(0, 2, 30)
    rows = np.column_stack([t, circle(height=0.22, tilt=0.1, duration=2.0).sample(t).pose])
    header = "time_s,z_m,tilt_x_rad,tilt_y_rad"
    np.savetxt(path, rows, fmt="%.17g", delimiter=",", header=header, comments="")
    return path


@each(("text", "expected"), DESCRIBED)
def test_a_file_describes_what_its_function_returns(
    tmp_path: Path, text: str, expected: Trajectory
) -> None:
    for name in ("path.yaml", "path.YML"):
        same(load_trajectory(write(tmp_path / name, text), ROBOT), expected)


def test_a_csv_is_read_as_such_or_through_a_yaml(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    file = table(tmp_path / "data" / "samples.csv")
    expected = read_csv(file)
    same(load_trajectory(str(file), ROBOT), expected)
    text = "kind: csv\nfile: data/samples.csv\n"
    same(load_trajectory(write(tmp_path / "path.yaml", text), ROBOT), expected)
    free = load_trajectory(write(tmp_path / "path.yaml", text + "ends: free\n"), ROBOT)
    same(free, read_csv(file, ends="free"))
    assert not np.array_equal(free.sample(0.0).rate, expected.sample(0.0).rate)
    text += "max_step: 0.01\n"
    words = r"path\.yaml, line 2: .*samples\.csv, line 3: a gap"
    with pytest.raises(InputError, match=words):
        load_trajectory(write(tmp_path / "path.yaml", text), ROBOT)


DOCUMENTED = sorted((Path(__file__).parents[2] / "docs" / "trajectories").glob("*.yaml"))


def test_every_kind_of_motion_is_documented() -> None:
    kinds = {read_yaml(file, "trajectory file").values["kind"] for file in DOCUMENTED}
    assert kinds == {*KINDS} - {"csv"}


@pytest.mark.parametrize("file", DOCUMENTED, ids=lambda file: file.stem)
def test_the_files_in_the_documents_move_from_rest_to_rest(file: Path) -> None:
    path = load_trajectory(file, ROBOT)
    fastest = np.abs(path.sample(np.linspace(0, path.duration, 1001)).rate).max()
    assert fastest > 1e-3
    assert np.abs(path.sample([0.0, path.duration]).rate).max() < 1e-12 * fastest


@each(
    ("text", "words"),
    [
        ("height: 1\n", " needs the key 'kind', one of helix, point_to_point, spline, circle"),
        ("# what\nkind: spiral\n", ", line 2: kind = 'spiral': .* one of helix, .*lissajous, csv$"),
        ("kind: [circle]\n", r", line 1: kind = \['circle'\]: it must be one of"),
        ("kind: circle\nheight: 1\nduration: 1\n", ", line 1: kind circle needs tilt"),
        (
            CIRCLE + "speed: 3\n",
            ", line 5: unknown key 'speed'; the keys of kind circle are: .*tilt",
        ),
        (
            "kind: circle\nhight: 1\nduration: 1\n",
            ", line 2: unknown key 'hight' .did you mean height.*height, tilt",
        ),
        (CIRCLE.replace("0.1", "'5.0e-3'"), ", line 3: tilt = '5.0e-3': must be a valid n"),
        (CIRCLE.replace("0.1", "steep"), ", line 3: tilt = 'steep': must be a valid num"),
        (CIRCLE.replace("0.1", ".nan"), ", line 3: tilt = nan: must be a finite number"),
        (CIRCLE.replace("0.1", "yes"), ", line 3: tilt = 'yes': "),
        (CIRCLE.replace("0.1", "true"), ", line 3: tilt = True: "),
        (CIRCLE.replace("0.1", "-0.1"), ", line 3: tilt = -0.1: it must be a positive number"),
        (CIRCLE.replace("2\n", "0\n"), ", line 4: duration = 0: .* greater than 0"),
        (
            CIRCLE.replace("2\n", "1e-320\n"),
            ", line 4: duration = 1e-320: it must be .*1e-50",
        ),
        (CIRCLE + "profile: cubic\n", ", line 5: profile = 'cubic': .*'quintic'.*'s-curve'"),
        (CIRCLE + "tilt: 0.2\n", ", line 5: not valid YAML: .*found duplicate key"),
        (STEP, ", line 1: give a duration, or limits .*neither is given"),
        (STEP + "duration: 1\nmax_rate: 1\n", ", line 1: give a duration, or limits .*both are"),
        (
            STEP + "max_rate: [1, 2]\n",
            r", line 4: max_rate = \[1, 2\]: .*positive number, or three",
        ),
        (STEP + "max_rate: [1, 2, x]\n", r", line 4: max_rate = \[1, 2, 'x'\]: .*or three"),
        (STEP + "max_rate: 0\n", ", line 4: max_rate = 0: .*or three"),
        (STEP.replace("0, 0]", "0, 0, 0]"), r", line 2: start = \[0.215, 0, 0, 0\]: .*at most 3"),
        (
            "kind: point_to_point\nstart: [1, 0, 0]\nend: [1, 0, 0]\nduration: 1\n",
            ", line 2: start and end are the same pose",
        ),
        (
            "kind: spline\ntimes: [0, 1]\nposes:\n- [1, 0, 0]\n- [1, 0, up]\n",
            r", line 5: poses\[1\]\[2\] = 'up': must be a valid number",
        ),
        (
            "kind: spline\nposes: [[1, 0, 0], [2, 0, 0]]\ntimes: [1, 0]\n",
            ", line 3: times must increase: 1 s, then 0 s",
        ),
        (THROUGH + "times: [0, 1, 2]\nprofile: quintic\n", ", line 7: profile = .*with a duration"),
        (THROUGH + "tilt_scale: 2\ntimes: [0, 1, 2]\n", ", line 6: tilt_scale = 2.*with a durat"),
        ("kind: helix\nradius: 9\npitch: 0\nheight: 1\n", ", line 2: radius = 9.0 m: .*reaches"),
        ("kind: helix\nradius: 0\npitch: 0\nheight: 1\nbranch: up\n", ", line 5: branch = 'up'"),
        (SWINGS + "amplitude: [0, 0]\n", ", line 5: amplitude and lift are zero: nothing moves"),
        (SWINGS + "amplitude: [1]\n", r", line 5: amplitude = \[1\]: .*at least 2"),
        (SWINGS + "amplitude: [1, 1]\nlift: [1, 1.5]\n", r", line 6: lift\[1\] = 1.5: .*integer"),
        (SWINGS + "amplitude: [1, 1]\nlift: [1]\n", r", line 6: lift = \[1\]: .*frequency"),
        (SWINGS + "amplitude: [1, 1]\nlift: [1, 2, 3]\n", r", line 6: lift = .*frequency"),
        (SWINGS + "amplitude: [1, 1]\nlift: !!set {0.1, 1}\n", ", line 6: .*tag !!set is not read"),
        (
            SWINGS.replace("3, 2]", "0, 2]") + "amplitude: [1, 1]\n",
            ", line 4: frequency = 0: .*whole",
        ),
        ("kind: csv\nfile: none.csv\n", ", line 2: cannot read the .*none.csv: No such file"),
        ("kind: csv\nfile: ''\n", ", line 2: file = '': "),
        (CIRCLE + "fastest: 3\n", ", line 5: fastest = 3: "),
        (CIRCLE + "fastest: {force: -3}\n", ", line 5: fastest.force = -3: .*greater than 0"),
        (
            CIRCLE + "fastest:\n  power: 3\n",
            ", line 6: unknown key 'power'; the keys of fastest are",
        ),
        ("", " must hold 'key: value' lines"),
    ],
)
def test_a_bad_file_is_told_with_line_and_key(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "path.yaml").write_text(text)
    with pytest.raises(InputError, match=rf"^\S+path\.yaml{words}"):
        load_trajectory(tmp_path / "path.yaml", ROBOT)


def test_other_names_and_things_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"path\.txt: its name must end in \.csv, \.yaml or \.yml"):
        load_trajectory(tmp_path / "path.txt", ROBOT)
    with pytest.raises(InputError, match=r"cannot read .*none\.yaml: No such file"):
        load_trajectory(tmp_path / "none.yaml", ROBOT)
    with pytest.raises(InputError, match="given by its path, not by None"):
        load_trajectory(None, ROBOT)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("fastest", "force", "speed"),
    [("{force: 80}", 80.0, 0.2), ("{force: 80, speed: 0.1}", 80.0, 0.1), ("{}", 100.0, 0.2)],
)
def test_the_fastest_is_asked_for_with_the_limits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fastest: str, force: float, speed: float
) -> None:
    """Those not given are the robot's own; what is found is what is returned."""
    asked = []

    def time_optimal(robot: RPSRobot, path: Trajectory, *, limits: ActuatorLimits) -> Trajectory:
        asked.append((robot, path.duration, limits.force, limits.speed))
        return circle(height=0.2, tilt=0.1, duration=0.5)

    module = ModuleType("rps_pin.rps.motion.time_optimal")
    module.time_optimal = time_optimal  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    (tmp_path / "path.yaml").write_text(f"{CIRCLE}fastest: {fastest}\n")
    assert load_trajectory(tmp_path / "path.yaml", ROBOT).duration == 0.5
    assert asked == [(ROBOT, 2.0, force, speed)]


NOISE = [
    *"0123456789.-+e,:;\n\t#_ []{}'\"&*!|>", "nan", ".inf", "1e308", "1e-320", "\x00", "é", "null",
    "true", "\n- ", ": ", "<<: *a", "!!python/name:os", "9" * 400, "kind",
]  # fmt: skip


def damaged(text: str, rng: np.random.Generator) -> bytes:
    """Delete, repeat or replace a piece of a text, once or twice."""
    raw = text.encode()
    for _ in range(rng.integers(1, 3)):
        start = int(rng.integers(0, len(raw) + 1))
        end = start + int(rng.choice([0, 1, 1, 1, 2, 5, 20]))
        middle = [b"", raw[start:end] * 2, str(rng.choice(NOISE)).encode(), rng.bytes(1)]
        raw = raw[:start] + middle[rng.choice(4, p=[0.25, 0.25, 0.45, 0.05])] + raw[end:]
    return raw


EXTREMES = [
    *("0", "-1", "7", "1e-320", "1e-49", "1e-20", "1e-9", "1e9", "1e20", "1e49", "1e308", "-1e308"),
    *(".inf", "-.inf", ".nan", "9" * 40, "9" * 400, "1.5", "true", "null", "[]", "[1, 2, 3]"),
]


def strange(text: str, rng: np.random.Generator) -> bytes:
    """Replace a number in a text, or two."""
    for _ in range(rng.integers(1, 3)):
        numbers = list(re.finditer(r"(?<=[ \[])-?[0-9.][0-9.e-]*", text))
        if numbers:
            one = numbers[rng.integers(len(numbers))]
            text = text[: one.start()] + str(rng.choice(EXTREMES)) + text[one.end() :]
    return text.encode()


@pytest.mark.parametrize(("change", "fewest"), [(damaged, 20), (strange, 60)])
def test_a_changed_file_is_finite_or_refused(tmp_path: Path, change: Any, fewest: int) -> None:
    table(tmp_path / "samples.csv")
    texts = [*(text for text, _ in DESCRIBED), "kind: csv\nfile: samples.csv\nmax_step: 1\n"]
    outcomes = {True: 0, False: 0}
    for seed in range(400):
        text = change(texts[seed % len(texts)], np.random.default_rng(seed))
        (tmp_path / "path.yaml").write_bytes(text)
        try:
            found = load_trajectory(tmp_path / "path.yaml", ROBOT)
        except RPSPinError as error:
            assert str(tmp_path / "path.yaml") in str(error)
            outcomes[False] += 1
            continue
        outcomes[True] += 1
        for part in found.sample(np.linspace(0, found.duration, 50)):
            assert np.isfinite(part).all()
    assert min(outcomes.values()) > fewest
