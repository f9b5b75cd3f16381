"""The table of a motion: complete, exact, and never half written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rps_pin import RPSRobot, helix
from rps_pin.rps.dynamics import motion_csv
from rps_pin.rps.dynamics.motion_run import MotionRun, run_motion


@pytest.fixture(scope="module")
def run() -> MotionRun:
    robot = RPSRobot.from_preset("sokolov")
    return run_motion(robot, helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4), 20.0)


def test_what_is_read_back_is_what_was_computed(run: MotionRun, tmp_path: Path) -> None:
    motion_csv.write_csv(tmp_path / "motion.csv", run)
    table = np.genfromtxt(tmp_path / "motion.csv", delimiter=",", names=True)
    assert np.array_equal(table["time_s"], run.time)
    assert np.array_equal(table["z_m"], run.pose[:, 0])
    assert np.array_equal(table["tilt_y_rad"], run.pose[:, 2])
    assert np.array_equal(table["tilt_x_rate_rad_per_s"], run.rate[:, 1])
    assert np.array_equal(table["z_acceleration_m_per_s2"], run.acceleration[:, 0])
    assert np.array_equal(table["y_m"], run.position[:, 1])
    for leg in range(3):
        assert np.array_equal(table[f"length_{leg + 1}_m"], run.length[:, leg])
        assert np.array_equal(table[f"speed_{leg + 1}_m_per_s"], run.speed[:, leg])
        column = f"leg_acceleration_{leg + 1}_m_per_s2"
        assert np.array_equal(table[column], run.leg_acceleration[:, leg])
        assert np.array_equal(table[f"force_{leg + 1}_N"], run.force[:, leg])
    assert len(table.dtype.names) == 1 + 9 + 2 + 12


def test_an_interrupted_writing_leaves_the_old_file(
    run: MotionRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "motion.csv"
    path.write_text("old")

    def interrupted(file: Path, *_: object, **__: object) -> None:
        Path(file).write_text("half a li")
        raise KeyboardInterrupt

    monkeypatch.setattr(motion_csv.np, "savetxt", interrupted)
    with pytest.raises(KeyboardInterrupt):
        motion_csv.write_csv(path, run)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
