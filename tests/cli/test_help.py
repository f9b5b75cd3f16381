"""What the command line says of itself: on a screen, and to the shell's completion."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rps_pin.cli.app import app
from tests.cli.commands import rps_pin
from tests.processes import RPS_PIN, run

COMMANDS = sorted(str(one.name) for one in app.registered_commands)


def said(*arguments: str, folder: Path | None = None, **environment: str) -> str:
    found = rps_pin(*arguments, folder=folder, **{"COLUMNS": "80", "TERM": "dumb"} | environment)
    assert found.stderr == ""
    return found.stdout


def test_the_help_fits_a_screen() -> None:
    lines = said("--help").rstrip().splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 80
    text = "\n".join(lines)
    for command in COMMANDS:
        assert sum(line.startswith(f"│ {command} ") for line in lines) == 1, text


def completed(folder: Path, *words: str) -> set[str]:
    line = "rps-pin " + " ".join(words)
    found = said(
        folder=folder,
        _RPS_PIN_COMPLETE="complete_bash",
        COMP_WORDS=line,
        COMP_CWORD=str(len(words)),
    )
    return set(found.split())


def test_the_shell_is_told_how_to_complete(tmp_path: Path) -> None:
    """As ``--install-completion`` writes it down; bash must understand it, and get its answer."""
    script = said(_RPS_PIN_COMPLETE="source_bash")
    assert "complete -o default -F _rps_pin_completion rps-pin" in script
    (tmp_path / "completion.sh").write_text(script)
    subprocess.run(["bash", "-n", tmp_path / "completion.sh"], check=True)
    asked = {"_RPS_PIN_COMPLETE": "complete_bash", "COMP_WORDS": "rps-pin he", "COMP_CWORD": "1"}
    answered = run(RPS_PIN, env=os.environ | asked)
    assert (answered.stdout.split(), answered.stderr) == (["helix"], "")


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["he"], {"helix"}),
        (["view", "--rob"], {"--robot"}),
        (["view", "--robot", "m"], {"micro", "mine.yaml"}),
        (["describe", "de"], {"delta", "delta_rods"}),
        (["describe", "m"], {"minitaur_leg", "mine.yaml", "more/"}),
        (["describe", "more/"], {"more/two.xml"}),
    ],
)
def test_the_shell_completes(tmp_path: Path, words: list[str], wanted: set[str]) -> None:
    (tmp_path / "mine.yaml").touch()
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "two.xml").touch()
    (tmp_path / "music.mp3").touch()
    found = completed(tmp_path, *words)
    if words[-1] == "m" and words[0] == "view":
        wanted = wanted | {"more/"}
    assert found == wanted


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_a_command_reads_at_80_columns(command: str) -> None:
    """In this process: what a command's help costs is its imports."""
    run = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "80", "TERM": "dumb"})
    assert run.exit_code == 0
    lines = run.output.splitlines()
    assert max(map(len, lines)) <= 80
    assert "…" not in run.output  # nothing is cut off
    assert any("Exit status" in line for line in lines) or command in ("view", "urdf"), run.output


def test_help_and_version_import_no_robot() -> None:
    code = "import sys, rps_pin.cli.app; print(sorted({'pinocchio', 'scipy'} & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "[]\n"
