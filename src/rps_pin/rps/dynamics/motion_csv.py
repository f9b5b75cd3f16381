"""CSV table of a motion: one line a sample, units in the column names."""

from __future__ import annotations

import os

import numpy as np

from rps_pin.arrays import Array
from rps_pin.files import whole_file
from rps_pin.rps.dynamics.motion_run import MotionRun
from rps_pin.trajectories.csv_columns import table_in_degrees

#: How many columns `motion_columns` returns.
COLUMNS = 24


def motion_columns(run: MotionRun) -> dict[str, Array]:
    """Return the columns of the table by name; each name ends in its unit."""
    columns = {"time_s": run.time}
    x, y, _ = run.position.T
    for suffix, length, angle, values in (
        ("", "m", "rad", run.pose),
        ("_rate", "m_per_s", "rad_per_s", run.rate),
        ("_acceleration", "m_per_s2", "rad_per_s2", run.acceleration),
    ):
        z, tilt_x, tilt_y = values.T
        columns[f"z{suffix}_{length}"] = z
        columns[f"tilt_x{suffix}_{angle}"] = tilt_x
        columns[f"tilt_y{suffix}_{angle}"] = tilt_y
    columns |= {"x_m": x, "y_m": y}
    for name, unit, values in (
        ("length", "m", run.length),
        ("speed", "m_per_s", run.speed),
        ("leg_acceleration", "m_per_s2", run.leg_acceleration),
        ("force", "N", run.force),
    ):
        for leg in range(3):
            columns[f"{name}_{leg + 1}_{unit}"] = values[:, leg]
    return columns


def write_csv(path: str | os.PathLike[str], run: MotionRun, *, degrees: bool = False) -> None:
    """Write a motion as CSV, all digits, whole or not at all; angles in radians or degrees."""
    columns = motion_columns(run)
    names, table = list(columns), np.column_stack(list(columns.values()))
    if degrees:
        names, table = table_in_degrees(names, table)
    with whole_file(path) as scratch:
        np.savetxt(scratch, table, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
