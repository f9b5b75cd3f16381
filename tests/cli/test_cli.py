"""The commands as a person types them; a real process where the process is what is tested."""

from __future__ import annotations

import csv
import json
import os
import signal
import sys
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from rps_pin import InputError, RPSParameters, RPSRobot, __version__, helix
from rps_pin.cli.helix_options import middle_height
from tests import processes
from tests.cli.commands import rps_pin
from tests.processes import RPS_PIN, start
from tests.worst import worst

SAMPLES = Path(__file__).parents[2] / "src" / "rps_pin" / "cli" / "samples"
FIGURES = [
    f"{name}.{suffix}" for name in ("path", "lengths", "forces") for suffix in ("png", "svg")
]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the folder and the standard output of a helix run with defaults but its rate."""
    folder = tmp_path_factory.mktemp("helix")
    run = rps_pin("helix", "--rate", "100", folder=folder)
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    return folder, run.stdout


def test_helix_writes_table_figures_and_page(finished: tuple[Path, str]) -> None:
    folder, output = finished
    files = {"helix.csv", "viewer.html", *FIGURES}
    assert {path.name for path in (folder / "helix").iterdir()} == files
    for name in files:
        assert f"helix/{name}" in output


def test_helix_prints_what_was_asked_for_each_actuator_and_for_the_run(
    finished: tuple[Path, str],
) -> None:
    _, output = finished
    for words in (
        *("actuator 1", "actuator 2", "actuator 3"),
        *("force, minimum", "force, maximum", "force, RMS"),
        *("length, shortest", "length, longest", "speed, peak", "power, peak", "power, mean"),
        *("duration", "largest loop gap", "largest KKT residual", "smallest distance"),
    ):
        assert words in output


def test_helix_table_holds_the_paper_s_motion(finished: tuple[Path, str]) -> None:
    folder, _ = finished
    with (folder / "helix" / "helix.csv").open() as file:
        rows = list(csv.DictReader(file))
    robot = RPSRobot.from_preset("sokolov")
    path = helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4)
    times = np.array([float(row["time_s"]) for row in rows])
    assert times[-1] == path.duration
    expected = robot.inverse_kinematics(path.sample(times).pose).length
    written = np.array([[float(row[f"length_{i}_m"]) for i in (1, 2, 3)] for row in rows])
    assert_allclose(written, expected, rtol=1e-15)


def test_json_is_all_that_is_printed_and_complete(tmp_path: Path) -> None:
    run = rps_pin("helix", "--rate", "50", "--json", "-o", str(tmp_path / "out"))
    assert run.returncode == 0, run.stderr
    summary = json.loads(run.stdout)
    assert summary["robot"] == "sokolov"
    assert_allclose(summary["duration"], 0.5 + np.sqrt(1 + 9 * np.pi**2) / 2)
    assert summary["loop_gap_max"] <= 1e-12
    assert summary["residual_max"] <= 1e-10
    assert 0 < summary["minimum_distance"] < 1
    assert [one["actuator"] for one in summary["actuators"]] == [1, 2, 3]
    assert all(Path(file).is_file() for file in summary["files"])


def test_helix_takes_a_parameter_file_and_other_numbers(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    RPSParameters.from_preset("micro").replace(name="mine").to_yaml(file)
    run = rps_pin(
        *("helix", "--robot", str(file), "--radius", "0.001", "--pitch", "0.002"),
        *("--height", "0.225", "--branch", "-", "--rate", "20", "--json", "-o", str(tmp_path)),
    )
    assert run.returncode == 0, run.stderr
    summary = json.loads(run.stdout)
    assert summary["robot"] == "mine"
    assert summary["helix"]["radius"] == 0.001
    assert summary["helix"]["branch"] == "-"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["helix", "--robot", "nope"], "the presets are: micro, sokolov"),
        (["helix", "--robot", "micro", "--height", "0.4"], "leg 1: length would be"),
        (["helix", "--radius", "nan"], "radius = nan"),
        (["helix", "--radius", "75e-3", "--pitch", "50e-3"], "crosses a type II singularity"),
        (
            ["helix", "--radius", "0", "--pitch", "0", "--height", "0"],
            "stays for 5.23884 s in a type II",
        ),
        (["helix", "--rate", "0"], "must be a positive number of Hz"),
        (["helix", "--duration", "-1"], "positive number of seconds"),
        (["urdf", "--robot", "mine.yaml"], "base_radius"),
        (["urdf", "--output", "no/such/folder/x.urdf"], "No such file or directory"),
        (["view", "--port", "99999999"], "port = 99999999"),
        (["view", "--pose", "nan", "0", "0"], "not finite"),
        (["view", "--robot", "micro", "--pose", "0.4", "0", "0"], "out of reach"),
    ],
)
def test_an_error_is_one_clear_line(arguments: list[str], words: str, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("base_radius: -1\n")
    run = rps_pin(*arguments, folder=tmp_path)
    assert run.returncode == 1
    assert run.stdout == ""
    (line,) = run.stderr.strip().splitlines()
    assert line.startswith("error: ")
    assert words in line


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["ik", "--pose", "0.4", "0", "0", "--json"], 0, '"reachable": true'),
        (["ik", "--robot", "nope", "--pose", "0.4", "0", "0"], 1, "error: "),
        (["ik", "--no-such-option"], 2, "--no-such-option"),
    ],
)
def test_the_exit_status_of_the_process(arguments: list[str], status: int, words: str) -> None:
    ended = processes.run([*RPS_PIN, *arguments], env={**os.environ, "TERM": "dumb"})
    assert ended.returncode == status
    assert words in (ended.stderr if status else ended.stdout)
    assert (ended.stdout if status else ended.stderr) == ""
    assert "Traceback" not in ended.stderr


def test_a_reader_that_leaves_ends_the_process_quietly() -> None:
    """As ``rps-pin urdf | true`` does: its output has no reader any more."""
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as pipe:
        ended = processes.run([*RPS_PIN, "urdf"], stdout=pipe)
    assert ended.returncode == 1
    assert ended.stderr == ""


def test_output_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    run = rps_pin("helix", "--rate", "5", "-o", str(tmp_path / "taken"))
    assert run.returncode == 1
    (line,) = run.stderr.strip().splitlines()
    assert str(tmp_path / "taken") in line
    assert (tmp_path / "taken").read_text() == "a file"


def test_help_teaches() -> None:
    text = rps_pin("helix", "--help").stdout
    flat = " ".join(text.split())
    assert "the only interpretation that keeps away from the flat, singular pose" in flat
    assert "rps-pin helix --robot micro" in flat
    for option in ("--robot", "--radius", "--pitch", "--height", "--rate", "--output", "--json"):
        assert option in text
    assert __version__ in rps_pin("--version").stdout
    assert {"helix", "view", "urdf"} <= set(rps_pin("--help").stdout.split())


def test_urdf_is_written_to_standard_output_or_a_file(tmp_path: Path) -> None:
    expected = RPSRobot.from_preset("micro").urdf
    assert rps_pin("urdf", "--robot", "micro").stdout == expected
    file = tmp_path / "micro.urdf"
    run = rps_pin("urdf", "--robot", "micro", "-o", str(file))
    assert run.returncode == 0
    assert file.read_text() == expected


@pytest.mark.parametrize("preset", ["sokolov", "micro"])
def test_the_helix_starts_where_a_robot_can_climb(preset: str) -> None:
    p = RPSParameters.from_preset(preset)
    height = middle_height(p, 0.5e-3)
    if preset == "sokolov":
        assert height == 0.4  # the paper's, to the last digit
        return
    half = RPSRobot(p).inverse_kinematics([height + 0.25e-3, 0.0, 0.0]).length
    assert_allclose(half, np.mean(p.leg_length_limits), rtol=1e-14)


def test_a_robot_without_a_middle_is_told_to_give_a_height() -> None:
    p = RPSParameters.from_preset("micro").replace(base_radius=0.5)
    with pytest.raises(InputError, match=r"do not reach .* give --height"):
        middle_height(p, 0.5e-3)


@pytest.mark.parametrize(
    ("arguments", "in_page"),
    [
        ([], "meshcat"),
        pytest.param(["--pose", "0.4", "0.1", "0"], "meshcat", marks=pytest.mark.slow),
        pytest.param(["--interactive", "--robot", "micro"], "viser", marks=pytest.mark.slow),
        (["--interactive", "--mechanism", "stewart", str(SAMPLES / "stewart.csv")], "viser"),
    ],
)
def test_view_serves_this_machine_until_ctrl_c(arguments: list[str], in_page: str) -> None:
    number = signal.SIGINT if arguments else signal.SIGTERM
    process = start([*RPS_PIN, "view", *arguments])
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        address = line.split()[1]
        assert line.startswith("Open http://127.0.0.1:")
        with urllib.request.urlopen(address, timeout=240) as page:
            assert in_page in page.read().decode().lower()
        time.sleep(0.3)
        process.send_signal(number)
        output, errors = process.communicate(timeout=240)
    finally:
        process.kill()
    assert process.returncode == 0
    assert "ended" in output
    assert errors == ""


SLOW_WRITER = """
import sys, time
from pathlib import Path

def slowly(*given):
    write(*given)
    print("under way", flush=True)
    while True:  # a wait without end would miss a signal that comes just before it (CPython)
        time.sleep(0.05)

write, Path.write_text = Path.write_text, slowly
sys.argv[0] = "rps-pin"
from rps_pin.cli import main; main()
"""


@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_command_that_a_signal_ends_leaves_no_half_result(
    tmp_path: Path, number: signal.Signals, status: int
) -> None:
    """The command is slowed down where it writes: a file is under way when the signal comes."""
    command = [sys.executable, "-c", SLOW_WRITER, "urdf", "-o", "robot.urdf"]
    process = start(command, cwd=tmp_path)
    assert process.stdout is not None
    assert process.stdout.readline() == "under way\n"
    assert len(list(tmp_path.iterdir())) == 1
    process.send_signal(number)
    _, errors = process.communicate(timeout=240)
    assert process.returncode == status
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


def test_ik_prints_lengths_and_refuses_what_is_out_of_reach() -> None:
    pose = ("--pose", "0.22", "0.1", "-0.05")
    answer = json.loads(rps_pin("ik", "--robot", "micro", *pose, "--json").stdout)
    expected = RPSRobot.from_preset("micro").inverse_kinematics([0.22, 0.1, -0.05])
    assert_allclose(answer["length"], expected.length, rtol=1e-15)
    assert answer["reachable"] is True
    assert "spherical joint" in rps_pin("ik", "--robot", "micro", *pose).stdout

    far = rps_pin("ik", "--robot", "micro", "--pose", "0.3", "0", "0")
    assert far.returncode == 1
    assert "leg 1: length would be 0.3 m; its limits are 0.2 to 0.25 m" in far.stderr
    out = rps_pin("ik", "--robot", "micro", "--pose", "0.3", "0", "0", "--json")
    assert out.returncode == 1
    violations = json.loads(out.stdout)["violations"]
    assert [one["leg"] for one in violations] == [1, 2, 3]


def test_fk_lists_the_eight_solutions_of_equal_legs() -> None:
    lengths = ("--lengths", "0.46", "0.46", "0.46")
    assert "8 real solutions" in rps_pin("fk", *lengths).stdout
    modes = json.loads(rps_pin("fk", *lengths, "--json").stdout)["modes"]
    assert [mode["above"] for mode in modes] == [True] * 4 + [False] * 4
    robot = RPSRobot.from_preset("sokolov")
    for k, mode in enumerate(modes):
        assert_allclose(robot.inverse_kinematics(mode["pose"]).length, 0.46, rtol=1e-12)
        partner = modes[mode["mirror"]]
        assert partner["mirror"] == k
        assert_allclose(partner["position"], np.multiply(mode["position"], [1, 1, -1]), atol=1e-12)


def test_fk_near_a_pose_follows_it_and_refuses_what_it_cannot() -> None:
    near = ("--near", "0.4", "0", "0", "--json")
    answer = json.loads(rps_pin("fk", "--lengths", "0.45", "0.47", "0.46", *near).stdout)
    robot = RPSRobot.from_preset("sokolov")
    assert_allclose(robot.inverse_kinematics(answer["pose"]).length, [0.45, 0.47, 0.46], rtol=1e-12)
    far = rps_pin("fk", "--lengths", "0.05", "0.07", "0.96", *near)
    assert far.returncode == 1
    (line,) = far.stderr.strip().splitlines()
    assert line.startswith("error: ")
    assert rps_pin("fk", "--lengths", "0.05", "0.07", "0.96").returncode == 1


@pytest.mark.parametrize(("branch", "crossings"), [("+", 2), ("-", 0)])
def test_check_finds_the_crossings_of_the_large_helix(branch: str, crossings: int) -> None:
    size = ("--radius", "0.075", "--pitch", "0.05")
    run = rps_pin("check", *size, "--branch", branch, "--json")
    assert run.returncode == (1 if crossings else 0)
    found = json.loads(run.stdout)
    assert found["ok"] is (crossings == 0)
    assert [event["kind"] for event in found["singularities"]] == ["crosses"] * crossings
    assert all(event["width"] <= 1e-9 for event in found["singularities"])


def test_check_says_when_a_limit_is_left() -> None:
    run = rps_pin("check", "--robot", "micro", "--height", "0.218")
    assert run.returncode == 1
    assert "leaves its lower limit of length, 0.2 m" in run.stdout
    assert rps_pin("check", "--robot", "micro", "--height", "0.225").returncode == 0


def test_workspace_writes_figures_data_and_what_the_paper_states(tmp_path: Path) -> None:
    run = rps_pin("workspace", "--points", "11", "--json", "-o", str(tmp_path / "out"))
    assert run.returncode == 0, run.stderr
    summary = json.loads(run.stdout)
    assert summary["points"] == summary["inside"] == 11**3
    assert worst(summary["x"], summary["y"]) <= 2.5e-3
    (given, *others) = summary["paper"]
    assert given["base_radius"] == 0.120
    assert given["holds"]
    assert not any(row["holds"] for row in others)
    assert summary["volume"] < 1e-3 * summary["cylinder_volume"]
    names = {Path(file).name for file in summary["files"]}
    assert {"workspace.h5", "boundary.stl", "assembly_modes.png"} <= names
    assert all(Path(file).stat().st_size > 1000 for file in summary["files"])

    before = (tmp_path / "out" / "workspace.h5").read_bytes()
    again = rps_pin("workspace", "--points", "5", "-o", str(tmp_path / "out"))
    assert again.returncode == 1
    assert "--overwrite" in again.stderr
    assert (tmp_path / "out" / "workspace.h5").read_bytes() == before
