"""Logs from files, the identified description, exciting motions, and ``rps-pin identify``."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rps_pin import ClosedLoopModel, InputError, Task
from rps_pin.cli.app import app
from rps_pin.task.identification import (
    DynamicsModel,
    Identification,
    exciting_motion,
    identify,
    read_log,
    write_identified,
)
from rps_pin.task.identification.exciting.fourier import FourierMotion, free_coefficients
from rps_pin.task.identification.model import condition_of
from tests.task.identified import log_of, model_of
from tests.task.robots import compiled
from tests.worst import worst


def written(path: Path, name: str = "five_bar", seed: int = 1) -> Path:
    """Write a log in milliseconds and degrees, with a column that is not used."""
    model = model_of(name)
    log = log_of(name, seed, 1, 0.02, np.random.default_rng(seed))
    names = [
        "time_ms",
        *(f"{one}_position_deg" for one in model.actuators),
        *(f"applied_{one}_mNm" for one in model.actuators),
        "temperature_C",
    ]
    table = [log.time * 1e3, *np.degrees(log.position).T, *1e3 * log.force.T, 20 + 0 * log.time]
    np.savetxt(path, np.transpose(table), "%.12g", ",", header=",".join(names), comments="")
    return path


@cache
def found() -> Identification:
    log = log_of("five_bar", 1, 1, 0.02, np.random.default_rng(1))
    return identify(model_of("five_bar"), log, cut_off=10.0)


def test_a_log_is_read(tmp_path: Path) -> None:
    log = read_log(written(tmp_path / "log.csv"), model_of("five_bar"))
    wanted = log_of("five_bar", 1, 1, 0.02, np.random.default_rng(1))
    for one, other in zip(log[:3], wanted[:3], strict=True):
        assert worst(one - other) < 1e-9
    assert log.notes == (f"{tmp_path / 'log.csv'}: columns that are not used: temperature_C",)


@pytest.mark.parametrize(
    ("header", "rows", "words"),
    [
        ("time_s,left_joint_position_rad,right_joint_position_rad", "", "left_joint_force_Nm"),
        ("time_s,left_joint_position_rad,left_joint_position_deg", "", "two columns hold the same"),
        ("0,1,2", "", "numbers, where the header must name"),
        ("HEADER", "0,1,1,0,0\n0.1,1,,0,0", "line 3: right_joint_position_rad = ''"),
        ("HEADER", "0,1,1,0,0\n0.1,1,1,0,nan", "line 3: right_joint_force_Nm = 'nan'"),
        ("HEADER", "0,1,1,0,0\n0.1,1,1,0", "line 3: 4 cells, where the header names 5"),
        ("HEADER", "0.2,1,1,0,0\n0.1,1,1,0,0", "line 3: times must increase, but 0.1 s comes"),
        ("", "", "is empty"),
    ],
)
def test_faults_of_files(header: str, rows: str, words: str, tmp_path: Path) -> None:
    names = "time_s,left_joint_position_rad,right_joint_position_rad"
    header = header.replace("HEADER", f"{names},left_joint_force_Nm,right_joint_force_Nm")
    path = tmp_path / "log.csv"
    path.write_text(f"{header}\n{rows}\n")
    with pytest.raises(InputError, match=words):
        read_log(path, model_of("five_bar"))


def test_the_identified_description_is_the_identified_mechanism(tmp_path: Path) -> None:
    description = write_identified(found(), tmp_path / "mine.urdf")
    again, mechanism = ClosedLoopModel.load(description), found().mechanism
    states = model_of("five_bar").random_states(np.random.default_rng(2), 5)
    for q, v, a in zip(states.q, states.v, states.a, strict=True):
        wanted = mechanism.inverse_dynamics(q, v, a).tau
        assert worst(again.inverse_dynamics(q, v, a).tau - wanted) < 1e-9 * worst(wanted)
    assert isinstance(again.task, Task)
    text = description.read_text("utf-8")
    assert "# identified: left_joint" in text
    assert "was 0" in text
    assert "<!-- identified, its body: mass " in (tmp_path / "mine.urdf").read_text("utf-8")
    with pytest.raises(InputError, match="overwrite=True replaces"):
        write_identified(found(), tmp_path / "mine.urdf")


def test_the_command(tmp_path: Path) -> None:
    logs = [str(written(tmp_path / f"log{seed}.csv", seed=seed)) for seed in (1, 2)]
    words = ["identify", logs[0], "-m", "five_bar", "--validate", logs[1], "--cut-off", "10"]
    words += ["-o", str(tmp_path / "out"), "--json"]
    run = CliRunner().invoke(app, words)
    assert run.exit_code == 0, run.output
    answer = json.loads(run.stdout)
    assert len(answer["base_parameters"]) == 15
    for errors in answer["validation"].values():
        assert errors["free"]["percent"] < 3
        assert errors["believed"]["percent"] > 20
    again = CliRunner().invoke(app, words)
    assert isinstance(again.exception, InputError)
    assert "--overwrite replaces them" in str(again.exception)
    mechanism = ClosedLoopModel.load(tmp_path / "out" / "five_bar_identified.yaml")
    masses = [one.mass for one in mechanism.model.inertias][1:]
    given = [
        answer["parameters"][f"inertia:{name}.mass"] for name in list(mechanism.model.names)[1:]
    ]
    assert worst(np.array(masses) - given) < 1e-9
    assert (tmp_path / "out" / "base_parameters.csv").read_text().count("\n") == 16


def test_a_constant_is_found(tmp_path: Path) -> None:
    """Of the right drive, whose current makes 0.8 of what its constant says."""
    model = model_of("five_bar")
    log = log_of("five_bar", 1, 1, 2e-4, np.random.default_rng(1))
    names = [f"{one}_{what}" for what in ("position_rad", "current_A") for one in model.actuators]
    table = [log.time, *log.position.T, *(log.force / [2.0, 2.0 * 0.8]).T]
    header = ",".join(["time_s", *names])
    np.savetxt(tmp_path / "log.csv", np.transpose(table), "%.12g", ",", header=header, comments="")
    words = ["identify", str(tmp_path / "log.csv"), "-m", "five_bar", "--cut-off", "10", "--json"]
    words += [f"--constant={one}=2" for one in model.actuators]
    words += ["--unknown-constant", model.actuators[1], "-o", str(tmp_path / "out")]
    run = CliRunner().invoke(app, words)
    assert run.exit_code == 0, run.output
    rows = (tmp_path / "out" / "base_parameters.csv").read_text().splitlines()
    (row,) = (one for one in rows if one.startswith("constant_factor:"))
    name, believed, value, deviation = row.removeprefix("constant_factor:").split(",")
    assert (name, float(believed)) == (model.actuators[1], 1.0)
    assert 0 < float(deviation) < 0.02
    assert abs(float(value) - 0.8) < 4 * float(deviation)


# Exciting motions ---------------------------------------------------------------------------------


def test_fourier_motions_start_and_end_at_rest() -> None:
    rng = np.random.default_rng(3)
    bases = free_coefficients(4)
    motion = FourierMotion(
        rng.normal(size=2), *(b @ rng.normal(size=(3, 2)) for b in bases), 2.0, 3
    )
    assert motion.duration == 6.0
    for t in (0.0, 2.0, 6.0):
        x, rate, acceleration = motion.sample(t)
        assert worst(x - motion.start) < 1e-12
        assert worst(rate, acceleration) < 1e-10
    t, h = rng.uniform(0.1, 5.9, 10), 1e-5
    sides = [motion.sample(t + s * h) for s in (1, -1)]
    found = motion.sample(t)
    assert worst((sides[0].pose - sides[1].pose) / (2 * h) - found.rate) < 1e-7
    assert worst((sides[0].rate - sides[1].rate) / (2 * h) - found.acceleration) < 1e-6


def test_an_exciting_motion_keeps_limits_and_tells_more() -> None:
    """Than the motion of the other tests; the determinant by NumPy from the engine's states."""
    model = DynamicsModel(compiled("five_bar"), bodies=["left_joint", "right_joint"])
    options = {"amplitude": 0.06, "harmonics": 3, "starts": 4}
    found = exciting_motion(model, iterations=2, period=4.0, seed=1, **options)
    assert found.log_determinant > found.start_log_determinant
    assert not [*found.check.limits, *found.check.singularities]
    task = model.task
    x, rate, acceleration = found.trajectory.sample(np.linspace(0, 4.0, 41)[:-1])
    assert worst(x - task.home) < 0.06 * 1.02  # between the samples of the search
    rows, _ = model.regressor(model.states_of_task(x, rate, acceleration))
    base = rows[..., model.base.independent].reshape(-1, model.believed.size)
    assert 0.3 < condition_of(base) / found.condition < 3
    same = exciting_motion(model, iterations=2, period=4.0, seed=1, **options)
    # To rounding, which differences of the search make larger.
    assert worst(same.trajectory.sines - found.trajectory.sines) < 1e-5 * 0.06
    with pytest.raises(InputError, match="amplitude = 0"):
        exciting_motion(model, amplitude=0.0)
    with pytest.raises(InputError, match="start = "):
        exciting_motion(model, start=[0.0])
