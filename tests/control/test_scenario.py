"""Scenario files: what they say is what runs, and mistakes are told with their line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rps_pin import InputError, RPSParameters, RPSRobot
from rps_pin.control import ComputedTorque, Gains, PDControl, effective_inertia
from rps_pin.control.simulation.scenario import load_scenario
from rps_pin.control.simulation.wrong_parameters import wrong_parameters
from rps_pin.errors import RPSPinError
from rps_pin.task import Task
from tests.each import each

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = sorted((ROOT / "docs" / "scenarios").glob("*.yaml"))
SMALLEST = """robot: micro
trajectory: {kind: circle, height: 0.223, tilt: 0.05, duration: 0.4}
controller: {bandwidth: 15.0}
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "scenario.yaml"
    path.write_text(text)
    return path


def test_the_least_that_a_scenario_needs(tmp_path: Path) -> None:
    scenario = load_scenario(written(tmp_path, SMALLEST))
    controller, plant = scenario.controller(), scenario.plant()
    assert isinstance(controller, ComputedTorque)
    assert controller.space == "task"
    assert controller.gains.rows == Gains.placed(15.0).rows
    assert controller.period == plant.period == 1e-3
    np.testing.assert_array_equal(plant.pose, scenario.trajectory.sample(0.0).pose)
    assert scenario.faults == ()
    run = scenario.run()
    assert run.time.size == 1400  # a second at rest, then the trajectory
    assert not run.status.any()


FULL = """
robot: mine.yaml
trajectory: path.yaml
period: 2.0e-3
settle: 0.1
duration: 0.15
controller:
  law: pd
  space: task
  compensation: feed_forward
  bandwidth: 10.0
  damping: 0.8
  integral: 0.1
  model: {platform: 1.1, prismatic_friction: 0.5}
  speeds: measured
  cut_off: 50.0
  force_limit: [10.0, 20.0, 30.0]
  near_singular: 0.1
  stop_singular: 0.02
  largest_jump: 1.0e-3
  most_lost: 5
plant:
  masses: 1.2
  prismatic_friction: 0.6
  payload: 0.3
  delay: 2
  substeps: 3
  encoder_resolution: 5.0e-8
  encoder_noise: 2.0e-8
  seed: 7
faults:
  - {kind: jump, start: 0.1, duration: 0.004, leg: 2, size: 5.0e-4}
  - {kind: target, start: 0.12, offset: [0.001, 0.0, 0.0]}
"""


def test_every_key_arrives_and_names_of_files_count_from_the_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, elsewhere = tmp_path / "given", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    mine = RPSParameters.from_preset("micro").replace(name="mine", platform_mass=2.0)
    mine.to_yaml(folder / "mine.yaml")
    (folder / "path.yaml").write_text("kind: circle\nheight: 0.223\ntilt: 0.05\nduration: 0.2\n")
    scenario = load_scenario(written(folder, FULL))
    believed = wrong_parameters(mine, platform=1.1, prismatic_friction=0.5)
    assert scenario.model.parameters.platform_mass == believed.platform_mass == 2.2
    assert scenario.model.parameters.prismatic_friction == 0.5
    assert scenario.machine.parameters.platform_mass == pytest.approx(2.4)
    assert scenario.machine.parameters.prismatic_friction == 0.6
    assert scenario.machine.payload is not None
    assert scenario.machine.payload.mass == 0.3

    controller, plant = scenario.controller(), scenario.plant()
    assert isinstance(controller, PDControl)
    assert (controller.space, controller.compensation) == ("task", "feed_forward")
    inertia = effective_inertia(scenario.model, scenario.begin, space="task")
    wanted = Gains.placed(10.0, damping=0.8, integral=0.1).times(inertia)
    assert controller.gains.rows == wanted.rows
    assert controller._limits.limit == (10.0, 20.0, 30.0)
    assert (controller._near, controller._stop, controller._most_lost) == (0.1, 0.02, 5)
    assert controller.estimate._jump == 1e-3
    assert plant.encoders.resolution == 5e-8
    assert plant.encoders.noise == 2e-8
    assert len(plant._queue) == 2
    assert plant._substeps == 3
    assert plant.period == controller.period == 2e-3
    jump, target = scenario.faults
    assert (jump.kind, jump.leg, jump.size) == ("jump", 2, 5e-4)
    assert target.offset == (0.001, 0.0, 0.0)
    run = scenario.run()
    assert run.time.size == 75
    assert np.isfinite(run.command).all()
    again = scenario.run()  # each starts anew, seeds too
    np.testing.assert_array_equal(run.command, again.command)


def test_gains_in_the_law_s_own_units(tmp_path: Path) -> None:
    text = SMALLEST.replace(
        "bandwidth: 15.0", "gains: {proportional: [1.0, 2.0, 3.0], derivative: 4.0, integral: 5.0}"
    )
    scenario = load_scenario(written(tmp_path, text))
    rows = scenario.controller().gains.rows
    assert rows == ((1.0, 2.0, 3.0), (4.0, 4.0, 4.0), (5.0, 5.0, 5.0))
    with pytest.raises(InputError, match="equal for all three"):
        scenario.margins()


@each(
    ("wrong", "right", "words"),
    [
        ("robot: micro", "", r"a scenario needs robot"),
        ("robot: micro", "robot: nano", "'nano' is not a file or a preset; the presets are: "),
        ("robot: micro", "robot: 5", r"line 1: robot = 5: must be a valid string"),
        (
            "controller:",
            "kontroller:",
            r"line 3: unknown key 'kontroller' .did you mean controller.*; the keys of a scenario",
        ),
        (
            "bandwidth: 15.0",
            "bandwidt: 15.0",
            "unknown key 'bandwidt' .did you mean bandwidth.*; the keys of controller are",
        ),
        ("bandwidth: 15.0", "bandwidth: -1.0", "controller.bandwidth = -1.0: .*greater than 0"),
        ("bandwidth: 15.0", "bandwidth: fast", "controller.bandwidth = 'fast'"),
        ("bandwidth: 15.0", "law: pd", "either bandwidth .Hz. or gains"),
        ("bandwidth: 15.0", "bandwidth: 9.0, law: lqr", "controller.law = 'lqr': .*'pd'"),
        (
            "bandwidth: 15.0",
            "bandwidth: 9.0, compensation: none",
            "compensation is for law: pd",
        ),
        (
            "bandwidth: 15.0",
            "damping: 1.0, gains: {proportional: 1.0, derivative: 1.0}",
            "go with bandwidth",
        ),
        ("bandwidth: 15.0", "gains: {proportional: 1.0}", "controller.gains needs derivative"),
        ("kind: circle", "kind: square", "kind = 'square'"),
        ("tilt: 0.05, ", "", "needs tilt"),
    ],
)
def test_mistakes_are_told_with_their_place(
    tmp_path: Path, wrong: str, right: str, words: str
) -> None:
    assert wrong in SMALLEST
    path = written(tmp_path, SMALLEST.replace(wrong, right))
    with pytest.raises(RPSPinError, match=words) as told:
        load_scenario(path)
    if "preset" not in words:
        assert "scenario.yaml" in str(told.value)


@each(
    ("line", "words"),
    [
        ("plant: {masses: 0.0}", "line 4: plant.masses = 0.0: .*greater than 0"),
        ("plant: {delay: 1.5}", "line 4: plant.delay = 1.5"),
        ("plant: {delay: true}", "line 4: plant.delay = True"),
        ("plant: {colour: red}", "line 4: unknown key 'colour'; the keys of plant are: masses, "),
        ("faults: [{kind: fire, start: 1.0}]", r"line 4: faults\[0\].kind = 'fire': .*'lost'"),
        ("faults: [{kind: lost}]", r"line 4: faults\[0\] needs start"),
        ("faults: [{kind: jump, start: 1.0}]", "line 4: fault size = 0.0: a size"),
        ("faults: [{kind: lost, start: 1.0, leg: 4}]", r"faults\[0\].leg = 4"),
        ("faults:\n  - {kind: lost, start: 1.0}\n  - {kind: lost, begin: 1.0}", "line 6: unknown"),
        ("period: .nan", "line 4: period = nan"),
        ("duration: 0.0", "line 4: duration = 0.0"),
    ],
)
def test_mistakes_in_what_may_be_left_out(tmp_path: Path, line: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_scenario(written(tmp_path, SMALLEST + line + "\n"))


def test_a_file_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot read the scenario"):
        load_scenario(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="it holds nothing"):
        load_scenario(written(tmp_path, ""))


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_those_of_the_documentation_load(path: Path) -> None:
    scenario: Any = load_scenario(path)
    assert isinstance(scenario.model, Task if path.stem == "delta" else RPSRobot)
    assert scenario.margins().gain_up > 1.0
