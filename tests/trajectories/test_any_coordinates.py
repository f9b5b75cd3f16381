"""Trajectories of any number of coordinates, and their files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from rps_pin import InputError
from rps_pin.trajectories import SampledPath, end_states, point_to_point, read_csv, spline
from rps_pin.trajectories.resampled import ResampledCurve
from tests.trajectories.differences import difference
from tests.worst import worst

SIZES = pytest.mark.parametrize("size", [1, 2, 4, 6, 7])


class Stage(NamedTuple):
    coordinates: tuple[str, ...]
    angular: tuple[bool, ...]


HAND = Stage(("x", "z", "ry"), (False, False, True))
FOOT = Stage(("ankle_pitch", "ankle roll"), (True, True))


@SIZES
def test_every_kind_takes_them_and_agrees_with_each_coordinate_alone(size: int) -> None:
    rng = np.random.default_rng(size)
    poses, times = rng.normal(size=(7, size)), np.cumsum(rng.uniform(0.2, 0.5, 7))
    rates, accelerations = rng.normal(size=(2, 7, size))
    t = np.linspace(0.01, times[-1] - times[0] - 0.01, 40)
    made: list[Any] = [
        lambda i: SampledPath(times, poses[:, i]),
        lambda i: SampledPath(times, poses[:, i], rates[:, i]),
        lambda i: SampledPath(times, poses[:, i], rates[:, i], accelerations[:, i]),
        lambda i: SampledPath(times, poses[:, i], ends="free"),
        lambda i: spline(poses[:, i], times),
        lambda i: point_to_point(poses[0, i], poses[1, i], duration=3.0),
    ]
    for make in made:
        whole = make(range(size)).sample(t)
        alone = [make([i]).sample(t) for i in range(size)]
        for field, parts in zip(whole, zip(*alone, strict=True), strict=True):
            assert worst(field - np.concatenate(parts, axis=-1)) < 1e-9 * (1 + worst(field))


@SIZES
def test_chords_count_by_the_scale_that_is_given(size: int) -> None:
    rng = np.random.default_rng(size)
    poses, scale = rng.normal(size=(5, size)), rng.uniform(0.1, 2, size)
    path = spline(poses, duration=2.0, scale=scale)
    chords = np.linalg.norm(np.diff(poses, axis=0) * scale, axis=-1)
    assert path.curve.length == pytest.approx(chords.sum())
    in_units = spline(poses * scale, duration=2.0, scale=np.ones(size))
    t = np.linspace(0.1, 1.9, 20)
    assert worst(in_units.sample(t).pose - path.sample(t).pose * scale) < 1e-13
    rate = difference(lambda x: path.sample(x).pose, t[:1], 1e-4)
    assert worst(rate - path.sample(t[:1]).rate) < 1e-9
    assert end_states(path) == ("at rest", "at rest")
    if size > 1:
        curve = ResampledCurve(path, np.linspace(0, 2.0, 5), scale=scale)
        along = curve.at(np.linspace(0, curve.length, 50))
        assert worst(np.linalg.norm(along.first * scale, axis=-1) - 1) < 1e-2


def test_limits_are_for_all_or_one_for_each() -> None:
    path = point_to_point([0, 0], [1, 2], max_rate=[1, 4])
    assert path.duration == pytest.approx(15 / 8)
    with pytest.raises(InputError, match=r"max_rate = .*: it must be a number, or 2"):
        point_to_point([0, 0], [1, 2], max_rate=[1, 4, 1])


# Files --------------------------------------------------------------------------------------------


def write(tmp_path: Path, header: str, rows: Any) -> Path:
    path = tmp_path / "path.csv"
    np.savetxt(path, rows, fmt="%.17g", delimiter=",", header=header, comments="")
    return path


def test_a_file_names_the_coordinates_of_a_task_in_any_order(tmp_path: Path) -> None:
    t = np.linspace(0, 1, 21)
    x, z, ry = 0.1 * np.sin(t), 0.3 + 0.05 * np.cos(t), 0.2 * t**2
    rows = np.stack([np.degrees(ry), 1e3 * t, z, 1e3 * x], axis=-1)
    found = read_csv(write(tmp_path, "ry_deg,time_ms,z_m,x_mm", rows), HAND)
    assert worst(found.poses - np.stack([x, z, ry], axis=-1)) < 1e-15
    assert worst(found.times - t) < 1e-15


def test_a_file_has_rates_of_a_task_and_joints_have_their_names(tmp_path: Path) -> None:
    t = np.linspace(0, 1, 21)
    rows = np.stack([t, 8 * t, 0.1 * np.sin(t), 8 + 0 * t, 0.1 * np.cos(t)], axis=-1)
    names = "ankle_pitch_rad,ankle roll_rad,ankle_pitch_rate_rad_per_s,ankle roll_rate_rad_per_s"
    found = read_csv(write(tmp_path, f"time_s,{names}", rows), FOOT)
    assert worst(found.poses - rows[:, 1:3]) == 0  # a joint may turn many times
    assert worst(found.rates - rows[:, 3:]) == 0


@pytest.mark.parametrize(
    ("header", "line", "message"),
    [
        ("time_s,x_m,z_m", 1, r"column ry_rad .or ry_mrad, .* ry_deg. missing; .* x, z and ry$"),
        ("time_s,x_m,z_m,ry_rad,y_m", 1, "'y_m' is not known|did you mean"),
        ("time_s,x_m,z_m,ry_m", 1, "'m' is not a unit of ry; it can be ry_rad"),
        ("time_s,x_m,z_m,ry", 1, "'ry' has no unit: it can be ry_rad, ry_mrad, ry_urad, ry_deg"),
        ("time_s,x_m,z_m,tilt_x_rad", 1, "'tilt_x_rad' is not known. .* x, z, ry"),
        ("time_s,x_m,z_m,ry_rad", 2, "ry_rad = 7: it cannot be beyond 6.283 rad; .* ry_deg"),
        ("time_s,ry_rad,z_m,x_m", 2, None),
    ],
)
def test_other_columns_are_refused_with_the_line_and_what_is_possible(
    tmp_path: Path, header: str, line: int, message: str | None
) -> None:
    count = header.count(",") + 1
    rows = np.arange(12.0)[:, None] * np.ones(count) / 100
    rows[:, -1] = 7.0
    path = write(tmp_path, header, rows)
    if message is None:
        read_csv(path, HAND)  # x = 7 m is possible
        return
    with pytest.raises(InputError, match=message) as caught:
        read_csv(path, HAND)
    assert str(caught.value).startswith(f"{path}, line {line}: ")


def test_joints_whose_columns_would_mean_two_things_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a column's name would mean two of them"):
        read_csv(tmp_path / "none.csv", Stage(("time", "a"), (True, True)))
