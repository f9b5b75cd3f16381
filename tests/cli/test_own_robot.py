"""A robot of one's own: `rps-pin new` and `examples`, and what they print, as typed."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from matplotlib.figure import Figure

from rps_pin import ClosedLoopModel, RPSParameters, RPSRobot
from rps_pin.control.simulation.scenario import load_scenario
from rps_pin.rps.motion.trajectory_file import load_trajectory
from rps_pin.task import check_path
from rps_pin.task.trajectory_file import load_task_trajectory
from rps_pin.viewer import Motion
from rps_pin.viewer.show import LocalView
from tests.cli.commands import rps_pin
from tests.cli.typed import (
    NAMES,
    all_commands,
    commands_of_help,
    commands_of_new,
    exit_status,
)
from tests.quick import quick

ROOT = Path(__file__).parents[2]
URDF = ROOT / "urdf"
#: Slow, or they need a browser: their files are loaded by others.
SLOW = re.compile(r"rps-pin (workspace|reproduce|control|export)|--png|--fastest|--duration 3")
TASKS = {"path.yaml": "delta", "stewart.csv": "stewart"}


def run_as_typed(line: str, folder: Path) -> None:
    """Run a command; a server ends at once, as by Ctrl-C."""
    program, *words = shlex.split(line)
    assert program == "rps-pin"
    with (
        mock.patch.object(LocalView, "play", side_effect=KeyboardInterrupt),
        mock.patch("rps_pin.cli.view.threading") as threading,
    ):
        threading.Event.return_value.wait.side_effect = KeyboardInterrupt
        ended = rps_pin(*words, folder=folder)
    assert ended.returncode == exit_status(line), (line, ended.stdout, ended.stderr)


@pytest.mark.parametrize(
    "kind", quick(["3rps", "stewart", "delta", "five-bar"], ["3rps", "five-bar"])
)
def test_a_new_robot_works_at_once_as_typed(kind: str, tmp_path: Path) -> None:
    tmp_path /= kind
    tmp_path.mkdir()
    ended = rps_pin("new", kind, "--output", "mine", folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    commands = commands_of_new(ended.stdout)
    assert [line.split()[1] for line in commands] == ["view", "describe", "ik", "fk", "dynamics"]
    for line in commands:
        run_as_typed(line, tmp_path)
    again = rps_pin("new", kind, "--output", "mine", folder=tmp_path)
    assert again.returncode == 1
    assert "exist; --overwrite replaces them" in again.stderr


@pytest.mark.parametrize("kind", ["stewart", "delta", "five-bar"])
def test_it_is_the_robot_of_the_package_but_for_its_name(kind: str, tmp_path: Path) -> None:
    assert rps_pin("new", kind, "--name", "my-own", folder=tmp_path).returncode == 0
    own = ClosedLoopModel.load(tmp_path / "my-own" / "my-own.yaml")
    theirs = ClosedLoopModel.load(URDF / f"{kind.replace('-', '_')}.yaml")
    assert own.name == "my-own"
    np.testing.assert_array_equal(own.home, theirs.home)
    assert own.actuated == theirs.actuated
    assert list(own.model.names) == list(theirs.model.names)
    for one, other in zip(own.model.inertias, theirs.model.inertias, strict=True):
        assert one == other
    text = (tmp_path / "my-own" / "my-own.urdf").read_text()
    for words in ("Mass (kg)", "What is drawn", "A frame:", "Limits of position"):
        assert text.count(f"<!-- {words}") == 1
    assert "tools/" not in text
    described = (tmp_path / "my-own" / "my-own.yaml").read_text()
    for line in re.findall(r"^(\w+):", described, re.MULTILINE):
        assert re.search(rf"^# .*\n{line}:", described, re.MULTILINE), line


def test_a_new_3rps_is_the_preset_with_a_comment_for_each_field(tmp_path: Path) -> None:
    assert rps_pin("new", "3rps", "--name", "lab", folder=tmp_path).returncode == 0
    file = tmp_path / "lab" / "lab.yaml"
    assert RPSParameters.from_yaml(file) == RPSParameters.from_preset("micro").replace(name="lab")
    assert file.read_text().count("\n# ") >= len(RPSParameters.model_fields)


def test_a_name_that_is_none_is_told_the_rule() -> None:
    for name in ("my robot", "../x", "7", ""):
        ended = rps_pin("new", "3rps", "--name", name)
        assert ended.returncode == 2
        assert "a name begins with a letter" in " ".join(ended.stderr.split())


def test_every_command_has_an_example() -> None:
    for name in NAMES:
        assert commands_of_help(name), name


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("samples")
    assert rps_pin("examples", "-o", ".", folder=folder).returncode == 0
    return folder


@pytest.fixture
def place(samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the samples; figures stay empty, as drawing takes most of the time."""
    monkeypatch.setattr(Figure, "savefig", lambda _, path, **options: path.write_text("<svg/>"))
    shutil.copytree(samples, tmp_path, dirs_exist_ok=True)
    return tmp_path


@pytest.mark.parametrize("line", [line for line in all_commands() if not SLOW.search(line)])
def test_every_command_of_readme_and_help_runs_as_typed(line: str, place: Path) -> None:
    run_as_typed(line, place)


def test_the_files_that_commands_name_are_there_and_load(samples: Path) -> None:
    """Also those of slow commands; each file is what its name says."""
    named = {word for line in all_commands() for word in line.split() if "." in word}
    inputs = {word for word in named if Path(word).suffix in (".yaml", ".csv", ".xml")}
    inputs -= {"poses.yaml"}  # which the panel makes
    assert inputs <= {file.name for file in samples.iterdir()}
    mine = RPSRobot(RPSParameters.from_yaml(samples / "mine.yaml"))
    for file in ("path.csv", "circle.yaml", "spline.yaml", "step.yaml"):
        path = load_trajectory(samples / file, mine)
        mine.inverse_kinematics(path.sample(np.linspace(0.0, path.duration, 200)).pose)
    for name in ("path.yaml", "stewart.csv"):
        task = ClosedLoopModel.load(URDF / f"{TASKS[name]}.yaml").task
        path = load_task_trajectory(samples / name, task)
        assert check_path(task, path).ok
    for name in ("scenario.yaml", "faults.yaml"):
        assert load_scenario(samples / name).duration > 0


def test_samples_are_never_replaced_unless_asked(samples: Path, tmp_path: Path) -> None:
    shutil.copytree(samples, tmp_path, dirs_exist_ok=True)
    (tmp_path / "mine.yaml").write_text("PRECIOUS")
    ended = rps_pin("examples", "-o", ".", folder=tmp_path)
    assert ended.returncode == 1
    assert "exist; --overwrite replaces them" in ended.stderr
    assert (tmp_path / "mine.yaml").read_text() == "PRECIOUS"
    assert rps_pin("examples", "-o", ".", "--overwrite", folder=tmp_path).returncode == 0
    assert (tmp_path / "mine.yaml").read_text() == (samples / "mine.yaml").read_text()


SHOWN = {
    "parameters": "mine.yaml",
    "a preset": "micro",
    "a mechanism's name": "five_bar",
    "a description": "bar.yaml",
    "a URDF": "five_bar.urdf",
    "a MuJoCo file": "robot.xml",
}


@pytest.mark.parametrize("file", SHOWN.values(), ids=SHOWN)
def test_view_shows_the_home_of_anything(file: str, place: Path) -> None:
    shutil.copy(URDF / "five_bar.yaml", place / "bar.yaml")
    shutil.copy(URDF / "five_bar.urdf", place)
    seen: list[Motion] = []

    def play(view: LocalView) -> None:
        seen.append(view.motion)
        raise KeyboardInterrupt

    with mock.patch.object(LocalView, "play", play):
        ended = rps_pin("view", file, folder=place)
    assert ended.returncode == 0, ended.stderr
    (motion,) = seen
    assert motion.duration == 0.0
    q = motion.configurations[0]
    wanted = {
        "mine.yaml": RPSRobot.from_preset("micro").mechanism.home,
        "micro": RPSRobot.from_preset("micro").mechanism.home,
        "five_bar": ClosedLoopModel.load(URDF / "five_bar.yaml").home,
        "bar.yaml": ClosedLoopModel.load(URDF / "five_bar.yaml").home,
    }
    if file in wanted:
        mechanism = (
            RPSRobot.from_preset("micro").mechanism
            if q.size == 13
            else ClosedLoopModel.load(URDF / "five_bar.yaml")
        )
        np.testing.assert_allclose(q, mechanism.close(wanted[file]), atol=1e-9)


def test_view_says_what_it_cannot_show(tmp_path: Path) -> None:
    (tmp_path / "x.yaml").write_text("a: 1\nbb: 2\n")
    (tmp_path / "loop.yaml").write_text("robot: micro\ncontroller: {bandwidth: 1}\n")
    for file, words in (
        ("x.yaml", "a trajectory has the key kind, a mechanism urdf or mjcf, a 3-RPS base_radius"),
        ("x.yaml", "this file has: a, bb"),
        ("loop.yaml", "is a control scenario: rps-pin control loop.yaml"),
        ("nobody", "is not a file or a robot of the package; those are: micro, sokolov, ankle"),
        ("none.yaml", "cannot read the file none.yaml: No such file"),
    ):
        ended = rps_pin("view", file, folder=tmp_path)
        assert ended.returncode == 1
        assert words in ended.stderr
