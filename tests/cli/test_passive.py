"""A mechanism that nothing drives, in every command: an answer, or a sentence that says why not."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from tests.cli.commands import rps_pin

URDF = Path(__file__).resolve().parents[2] / "urdf"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The four-bar of the package without its motor."""
    found = tmp_path_factory.mktemp("passive")
    text = (URDF / "four_bar.yaml").read_text().replace("[crank_joint]", "[]")
    assert "actuated: []" in text
    (found / "passive.yaml").write_text(text)
    (found / "four_bar.urdf").write_text((URDF / "four_bar.urdf").read_text())
    return found


def done(folder: Path, *words: str) -> str:
    run = rps_pin(*words, folder=folder)
    assert run.returncode == 0, run.stderr
    return run.stdout + run.stderr


def test_describe(folder: Path) -> None:
    said = done(folder, "describe", "passive.yaml")
    assert "mobility 1, actuation underactuated: nothing driven" in said


@pytest.mark.parametrize("hold", [False, True])
def test_simulate(folder: Path, hold: bool) -> None:
    output = folder / f"motion_{hold}"
    words = ["simulate", "passive.yaml", "--duration", "0.2", "--output", str(output)]
    said = done(folder, *words, *(["--hold"] if hold else []))
    table = np.genfromtxt(output / "simulation.csv", delimiter=",", names=True)
    energy = table["kinetic"] + table["potential"]
    assert np.ptp(table["kinetic"]) > 0.1
    assert np.ptp(energy) < 1e-8
    assert (output / "viewer.html").is_file()
    assert ("not held are" in said) == hold


@pytest.mark.parametrize("option", ["--tau", "--speed"])
def test_a_force_or_speed_of_what_is_not_driven_is_refused(folder: Path, option: str) -> None:
    run = rps_pin("simulate", "passive.yaml", option, "crank_joint=1", folder=folder)
    assert run.returncode == 1
    assert f"{option}: " in run.stderr
    assert "nothing is driven" in run.stderr


def test_convert(folder: Path) -> None:
    done(folder, "convert", "passive.yaml", "--to", "urdf", "--output", str(folder / "urdf"))
    back = ClosedLoopModel.load(folder / "urdf" / "passive.yaml")
    assert (back.actuated, back.describe().mobility) == ((), 1)
    done(folder, "convert", "passive.yaml", "--to", "mjcf", "--output", str(folder / "mjcf"))
    assert mujoco.MjModel.from_xml_path(str(folder / "mjcf" / "passive.xml")).nu == 0


def test_export(folder: Path) -> None:
    said = done(folder, "export", "c", "passive.yaml", "--output", str(folder / "c"))
    assert "functions in C99" in said


@pytest.mark.parametrize(
    "command",
    [
        ["view"],
        ["ik", "--pose", "0.4", "0", "0"],
        ["fk", "--lengths", "0.4", "0.4", "0.4"],
        ["workspace"],
        ["urdf"],
        ["helix"],
        ["dynamics", "path.csv"],
        ["check"],
    ],
    ids=lambda words: words[0],
)
@pytest.mark.parametrize("file", ["passive.yaml", "four_bar.urdf"])
def test_commands_of_the_3_rps_say_what_they_are_for(
    folder: Path, command: list[str], file: str
) -> None:
    run = rps_pin(*command, "--robot", file, folder=folder)
    assert run.returncode == 1
    assert f"{file} is the file of a mechanism, not of the parameters of a 3-RPS" in run.stderr
    assert "rps-pin describe, simulate" in " ".join(run.stderr.split())
