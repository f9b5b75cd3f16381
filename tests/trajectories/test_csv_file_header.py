"""Columns by their names: units, and what is said about names that are none."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from rps_pin import InputError, RPSRobot, helix
from rps_pin.rps.dynamics.motion_csv import motion_columns
from rps_pin.rps.dynamics.motion_run import run_motion
from rps_pin.trajectories.csv_columns import OF_RPS
from rps_pin.trajectories.csv_file import read_csv
from tests.each import each
from tests.trajectories.csv_files import QUANTITIES, SI, good_lines, refuse, save, swings


def test_every_column_that_is_written_is_known() -> None:
    robot = RPSRobot.from_preset("sokolov")
    run = run_motion(robot, helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4), 5.0)
    names = set(motion_columns(run))
    assert names <= {*OF_RPS.read, *OF_RPS.ignored}
    assert {name for name in names if name not in OF_RPS.read} == OF_RPS.ignored


UNITS = {
    "s": (1.0, "s"), "ms": (1e3, "s"), "us": (1e6, "s"),
    "m": (1.0, "m"), "mm": (1e3, "m"), "um": (1e6, "m"),
    "rad": (1.0, "rad"), "mrad": (1e3, "rad"), "urad": (1e6, "rad"), "deg": (180 / math.pi, "rad"),
}  # fmt: skip


@each("length", ["m", "mm", "um"])
@each("angle", ["rad", "mrad", "urad", "deg"])
@each("time", ["s", "ms", "us"])
def test_units_are_converted(tmp_path: Path, time: str, length: str, angle: str) -> None:
    t, at = np.linspace(0, 2, 60), swings(3)
    units = [length if name.startswith("z") else angle for name in QUANTITIES]
    names = [
        SI[i].replace("_m", f"_{unit}", 1).replace("_rad", f"_{unit}", 1)
        for i, unit in enumerate(units)
    ]
    factors = [UNITS[unit][0] for unit in units]
    rows = np.column_stack([t * UNITS[time][0], at(t) * factors])
    found = read_csv(save(tmp_path / "path.csv", ",".join([f"time_{time}", *names]), rows))
    assert_allclose(found.times, t, rtol=1e-15, atol=1e-15)
    assert found.rates is not None
    assert found.accelerations is not None
    table = np.hstack([found.poses, found.rates, found.accelerations])
    assert_allclose(table, at(t), rtol=1e-14, atol=1e-15)


def test_columns_may_stand_in_any_order(tmp_path: Path) -> None:
    t, at = np.linspace(0, 2, 60), swings(4)
    order = np.random.default_rng(0).permutation(10)
    rows, names = np.column_stack([t, at(t)]), ["time_s", *SI]
    found = read_csv(save(tmp_path / "path.csv", ",".join(names[i] for i in order), rows[:, order]))
    assert_array_equal(found.poses, at(t)[:, :3])


@each(
    ("header", "words"),
    [
        ("time_s,z,tilt_x_rad,tilt_y_rad", "'z' has no unit: it can be z_m, z_mm, z_um$"),
        (
            "time_s,z_inch,tilt_x_rad,tilt_y_rad",
            "'z_inch': 'inch' is not a unit of z.*z_m, z_mm, z_um",
        ),
        ("time_s,z_m,tilt_x,tilt_y_rad", "'tilt_x' has no unit: .*tilt_x_rad.*tilt_x_deg"),
        ("time,z_m,tilt_x_rad,tilt_y_rad", "'time' has no unit: it can be time_s, time_ms"),
        ("time_s,z_m,tilt_X_rad,tilt_y_rad", "'tilt_X_rad' is not known; .* 'tilt_x_rad'"),
        ("time_s,z_m,titl_x_rad,tilt_y_rad", "'titl_x_rad' is not known; .* 'tilt_x_rad'"),
        ("time_s,z_m,tilt_x_rad_per_s,tilt_y_rad", "not known; .* 'tilt_x_rate_rad_per_s'"),
        ("time_s,z_m,tilt_x_rad,tilt_y_grad", "'grad' is not a unit of tilt_y; .*tilt_y_deg"),
        ("time_s,z_cm,tilt_x_rad,tilt_y_rad", "'cm' is not a unit of z; .* z_m, z_mm, z_um"),
        ("time_s,z_m,tilt_x_rad,note", "'note' is not known. .*time_s"),
        ("time_s,z_m,tilt_x_rad,", "column 4 has no name"),
        ("time_s,z_m,tilt_x_rad,z_m", "'z_m' is there twice"),
        ("time_s,z_m,tilt_x_rad,z_mm", "'z_m' and 'z_mm' both hold z"),
        ("time_s,z_m,tilt_x_rad,x_m", "column tilt_y_rad .or .*tilt_y_deg.* missing"),
        ("x_m,y_m,z_m,force_1_N", "columns time_s .*, tilt_x_rad .*, tilt_y_rad .* missing"),
        ("time_s,z_m,tilt_x_rad;tilt_y_rad", "commas and semicolons in the header"),
        ("time_s z_m tilt_x_rad tilt_y_rad", "'time_s z_m tilt_x_rad tilt_y_rad'"),
        ("0.0,0.1,0.1,0.1", "numbers, where the header must name the columns"),
    ],
)
def test_a_bad_header_is_told_with_its_line(tmp_path: Path, header: str, words: str) -> None:
    rows = good_lines()[1:]
    refuse(tmp_path, "\n".join([header, *rows]), 1, words)
    refuse(tmp_path, "\n".join(["# by hand", "", header, *rows]), 3, words)


@pytest.mark.parametrize("kept", [[4], [4, 5], [7, 8, 9], [4, 5, 6, 7], [4, 5, 6, 7, 8]])
def test_rates_and_accelerations_come_whole(tmp_path: Path, kept: list[int]) -> None:
    """And accelerations only beside rates."""
    t = np.linspace(0, 2, 60)
    kept = [0, 1, 2, 3, *kept]
    rows = np.column_stack([t, swings(3)(t)])[:, kept]
    names = [["time_s", *SI][i] for i in kept]
    file = save(tmp_path / "path.csv", ",".join(names), rows)
    with pytest.raises(InputError, match=r"path.csv, line 1: columns? .* missing") as caught:
        read_csv(file)
    needed = SI[3:6] if max(kept) < 7 else SI[3:]
    listed = str(caught.value).split(" missing")[0]
    for name in SI:
        assert (f" {name} " in listed) == (name in needed and name not in names)
