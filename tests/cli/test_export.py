"""``rps-pin export c`` as a person types it."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from tests.cli.commands import rps_pin
from tests.programs import output_of, program

FOUR_BAR = Path(__file__).resolve().parents[2] / "urdf" / "four_bar.yaml"


def test_it_writes_what_it_says_and_the_self_test_passes(tmp_path: Path) -> None:
    run = rps_pin("export", "c", "four_bar", "-o", "made/c", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("four-bar: 15 functions in C99, double precision, each with ")
    folder = tmp_path / "made" / "c"
    names = ["CMakeLists.txt", "README.md", "four_bar.c", "four_bar.h", "four_bar_test.c"]
    assert sorted(path.name for path in folder.iterdir()) == names
    assert all(f"made/c/{name}" in run.stdout for name in names)
    # As the page says it.
    page = (folder / "README.md").read_text("utf-8")
    command = "cc -O2 -std=c99 four_bar.c four_bar_test.c -o four_bar_test -lm && ./four_bar_test"
    assert f"    {command}\n" in page
    program("cc")
    assert "all functions agree" in output_of("sh", "-c", command, folder=folder)
    again = rps_pin("export", "c", "four_bar", "-o", "made/c", folder=tmp_path)
    assert again.stdout == run.stdout


def test_options_come_together_as_json(tmp_path: Path) -> None:
    options = "--name my_bar --real float --functions gaps --functions inverse_dynamics"
    options += " --frames rocker --parameters gravity --wrench-frames rocker --json"
    run = rps_pin("export", "c", str(FOUR_BAR), "-o", str(tmp_path), *options.split())
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    files = [str(tmp_path / name) for name in ("my_bar.h", "my_bar.c", "my_bar_test.c")]
    assert found.pop("files")[:3] == files
    assert found == {
        "mechanism": "four-bar",
        "name": "my_bar",
        "real": "float",
        "functions": ["gaps", "inverse_dynamics", "frame_rocker"],
        "constants": {"NQ": 3, "NV": 3, "NA": 1, "NC": 5, "NI": 1, "NP": 3},
        "parameters": {"gravity[0]": 0.0, "gravity[1]": 0.0, "gravity[2]": -9.81},
    }
    header = (tmp_path / "my_bar.h").read_text("utf-8")
    assert "int my_bar_inverse_dynamics(const float q[3]" in header
    assert "const float wrenches[6], const float parameters[3]" in header


def test_without_masses_there_is_kinematics_alone(tmp_path: Path) -> None:
    (tmp_path / "bare.yaml").write_text("name: bare\nbase_radius: 0.12\nplatform_radius: 0.1\n")
    refused = rps_pin("export", "c", "bare.yaml", "-o", "c", folder=tmp_path)
    assert refused.returncode == 1
    assert "no mass moves with leg_1_prismatic, leg_2_prismatic, leg_3_pris" in refused.stderr
    assert "forward dynamics needs the masses of the links" in refused.stderr
    said = rps_pin("export", "c", "bare.yaml", "-o", "c", "--functions", "closed", folder=tmp_path)
    assert said.stdout.startswith("bare: 1 functions in C99"), said.stderr
    program("cc")
    built = "cc -O1 -std=c99 bare.c bare_test.c -o bare_test -lm && ./bare_test"
    assert "all functions agree" in output_of("sh", "-c", built, folder=tmp_path / "c")


def test_a_3_rps_has_its_kinematics_and_computed_torque(tmp_path: Path) -> None:
    options = ["export", "c", "--robot", "micro", "-o", str(tmp_path)]
    run = rps_pin(*options, "--functions", "computed_torque", "--functions", "gravity_forces")
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("3-RPS micro: 2 functions in C99, double precision")
    header = (tmp_path / "micro.h").read_text("utf-8")
    assert "int micro_computed_torque(const double length[3], const double speed[3]" in header
    for more in (["four_bar"], ["--parameters", "gravity"]):
        found = rps_pin(*options, *more)
        assert found.returncode == 2
        assert "Invalid value" in found.stderr
    found = rps_pin(*options, "--functions", "direct_kinematic")
    assert found.returncode == 1
    assert "did you mean direct_kinematics?" in found.stderr


def test_a_name_that_c_does_not_take_gives_way_to_the_file_s(tmp_path: Path) -> None:
    run = rps_pin("export", "c", "rps", "-o", str(tmp_path), "--functions", "gaps")
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "rps.h").is_file()
    file = tmp_path / "4bar.yaml"
    text = FOUR_BAR.read_text("utf-8").replace("four-bar", "4-bar")
    file.write_text(text.replace("four_bar.urdf", str(FOUR_BAR.with_suffix(".urdf"))), "utf-8")
    run = rps_pin("export", "c", str(file), "-o", str(tmp_path / "c"))
    assert run.returncode == 1
    assert "'4-bar' would be 4_bar, which begins with a digit; '4bar'" in run.stderr
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["four_bar"], 2, "Missing option"),
        (["for_bar", "-o", "c"], 1, "those are: ankle, "),
        (["four_bar", "-o", "c", "--real", "half"], 2, "half"),
        (["four_bar", "-o", "c", "--functions", "gap"], 1, "did you mean gaps?"),
        (["four_bar", "-o", "c", "--frames", "gap"], 1, "'gap'"),
        (["four_bar", "-o", "c", "--name", "int"], 1, "a keyword of C"),
        (["four_bar", "-o", "file"], 1, "file is a file: "),
    ],
)
def test_mistakes_are_told_and_nothing_is_written(
    tmp_path: Path, arguments: list[str], status: int, words: str
) -> None:
    (tmp_path / "file").write_text("")
    run = rps_pin("export", "c", *arguments, folder=tmp_path)
    assert run.returncode == status
    assert words in run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_files_of_others_stay_unless_they_are_to_go(tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("mine")
    options = ["export", "c", "four_bar", "-o", str(tmp_path), "--functions", "gaps"]
    run = rps_pin(*options)
    assert run.returncode == 1
    assert "README.md: there already, and not written by rps-pin export c" in run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["README.md"]
    assert rps_pin(*options, "--overwrite").returncode == 0
    assert (tmp_path / "README.md").read_text("utf-8") != "mine"


def test_without_casadi_it_says_what_to_install(tmp_path: Path, monkeypatch) -> None:
    for name in [one for one in sys.modules if one.startswith("rps_pin.codegen.export")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "casadi", None)
    run = rps_pin("export", "c", "four_bar", "-o", str(tmp_path / "c"))
    assert run.returncode == 1
    assert "pip install 'rps-pin[compile]'" in run.stderr


@pytest.mark.parametrize("words", [["export"], ["export", "c"]])
def test_the_help_reads_at_80_columns(words: list[str]) -> None:
    run = rps_pin(*words, "--help", COLUMNS="80", TERM="dumb")
    assert run.returncode == 0
    assert max(map(len, run.stdout.splitlines())) <= 80
    assert "…" not in run.stdout
    assert "Exit status" in run.stdout
