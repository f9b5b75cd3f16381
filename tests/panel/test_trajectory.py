"""Trajectories that a panel plays: as the robot's own dynamics has them, with a clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, InputError, RPSPinError, RPSRobot, helix
from rps_pin.panel import MechanismPanel, RPSPanel
from rps_pin.panel.history import WINDOW, History
from rps_pin.panel.page.charts import nice_range
from rps_pin.panel.recording import Player
from rps_pin.trajectories.point_to_point import point_to_point
from tests.worst import worst

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "src" / "rps_pin" / "cli" / "samples"
MICRO = RPSRobot.from_preset("micro")


def stewart() -> MechanismPanel:
    return MechanismPanel(ClosedLoopModel.load(ROOT / "urdf" / "stewart.yaml"))


def test_a_3rps_is_where_its_trajectory_is_and_needs_its_forces() -> None:
    panel, path = RPSPanel(MICRO), helix(MICRO, radius=4e-5, pitch=0.01, height=0.225)
    recording = panel.load(path)
    assert recording.duration == path.duration
    for share in (0.0, 0.31, 1.0):
        elapsed = share * path.duration
        assert panel.show(elapsed)
        x, rate, acceleration = (row[0] for row in path.sample([elapsed]))
        assert worst(panel.pose - x) < 1e-12
        assert worst(panel.force - MICRO.actuator_forces(x, rate, acceleration)) < 1e-9
        assert MICRO.mechanism.loop_gap(panel.configuration) < 1e-9
    forces = MICRO.actuator_forces(*path.sample(recording.time))
    assert worst(recording.force - forces) < 1e-9
    legs = MICRO.inverse_kinematics(path.sample(recording.time)[0]).length
    assert worst(recording.position - legs) < 1e-12


def test_a_mechanism_plays_a_file_and_its_forces_do_the_work_of_the_motion() -> None:
    """The actuators' power is the rate of kinetic and potential energy."""
    import pinocchio as pin

    panel = stewart()
    recording = panel.load(SAMPLES / "stewart.csv")
    model, data = panel.mechanism.model, panel.mechanism.model.createData()

    def energy(elapsed: float) -> float:
        assert panel.show(elapsed), panel.trouble
        kinetic = pin.computeKineticEnergy(model, data, panel.configuration, panel.velocity)
        return float(kinetic + pin.computePotentialEnergy(model, data, panel.configuration))

    step = 1e-4
    for elapsed in np.array([0.21, 0.43, 0.8]) * recording.duration:
        rate = (energy(elapsed + step) - energy(elapsed - step)) / (2 * step)
        panel.show(elapsed)
        speed = panel.velocity[panel.mechanism.actuated_indices]
        assert panel.forces @ speed == pytest.approx(rate, abs=1e-3 * np.abs(panel.forces).max())
        assert panel.mechanism.loop_gap(panel.configuration) < 1e-9
    panel.home()
    assert not panel.velocity.any()


def test_a_trajectory_beyond_limits_is_played_and_told() -> None:
    panel = RPSPanel(MICRO)
    panel.load(point_to_point([0.22, 0.0, 0.0], [0.255, 0.0, 0.0], duration=1.0))
    assert panel.show(0.0)
    assert panel.trouble == []
    assert panel.show(1.0)
    assert panel.outside == {f"leg_{leg}_prismatic" for leg in (1, 2, 3)}


def test_what_cannot_be_played_is_told() -> None:
    delta = MechanismPanel(ClosedLoopModel.load(ROOT / "urdf" / "delta.yaml"))
    home = delta.values("task")
    with pytest.raises(RPSPinError, match=r"at t = 0\.\d+ s: "):
        delta.load(point_to_point(home, home + np.array([0.6, 0.0, 0.0]), duration=1.0))
    assert delta.recording is None
    with pytest.raises(InputError, match="no trajectory is loaded"):
        stewart().show(0.0)
    gripper = MechanismPanel(ClosedLoopModel.load(ROOT / "urdf" / "gripper.yaml"))
    with pytest.raises(InputError, match="this mechanism has none"):
        gripper.load(SAMPLES / "stewart.csv")
    with pytest.raises(InputError, match="absent"):
        stewart().load("absent.csv")
    with pytest.raises(InputError, match="column"):
        stewart().load(SAMPLES / "path.csv")


def test_the_clock_plays_in_a_loop_pauses_and_keeps_its_time_at_another_speed() -> None:
    now = [10.0]
    player = Player(2.0, clock=lambda: now[0])
    now[0] += 5.0
    assert player.time == 0.0
    player.play()
    now[0] += 0.5
    assert player.time == pytest.approx(0.5)
    player.speed = 0.1
    now[0] += 1.0
    assert player.time == pytest.approx(0.6)
    player.play(False)
    now[0] += 1.0
    assert player.time == pytest.approx(0.6)
    player.time = 9.0
    assert player.time == 2.0
    player.play()
    assert player.time == 0.0
    player.speed = 1.0
    now[0] += 4.5
    assert player.time == pytest.approx(0.5)


def test_the_history_keeps_the_last_seconds_and_draws_pauses_as_steps() -> None:
    history = History()
    for k in range(300):
        history.add(0.1 * k, np.array([float(k)]))
    history.add(35.0, np.array([1000.0]))
    time, rows = history.arrays()
    assert time[0] >= -WINDOW
    assert time[-1] == 0.0
    assert (np.diff(time) > 0).all()
    assert rows[-2, 0] == 299.0
    assert time[-2] == pytest.approx(-0.02)


@pytest.mark.parametrize(
    ("values", "ends"),
    [
        ([213.0, 244.0], (210.0, 250.0)),
        ([4.905, 4.905], (4.84, 4.96)),
        ([0.0, 0.0], (-1.0, 1.0)),
        ([np.nan, np.nan], (0.0, 1.0)),
        ([-3.0, np.nan, 7.0], (-5.0, 10.0)),
    ],
)
def test_axes_have_round_ends_around_what_is_plotted(values, ends) -> None:
    low, high = nice_range(np.array(values))
    assert (low, high) == pytest.approx(ends)
    known = np.array(values)[np.isfinite(values)]
    assert ((low <= known) & (known <= high)).all()
