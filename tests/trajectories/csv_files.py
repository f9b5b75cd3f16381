"""Trajectory files for tests, good ones, and how they are read or refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import InputError
from rps_pin.trajectories.csv_file import read_csv

Array = NDArray[np.float64]

QUANTITIES = [
    f"{coordinate}{suffix}"
    for suffix in ("", "_rate", "_acceleration")
    for coordinate in ("z", "tilt_x", "tilt_y")
]
SI = [
    f"{quantity}_{'m' if quantity.startswith('z') else 'rad'}{over}"
    for quantity, over in zip(
        QUANTITIES, [*3 * [""], *3 * ["_per_s"], *3 * ["_per_s2"]], strict=True
    )
]
HEADER = "time_s,z_m,tilt_x_rad,tilt_y_rad"


def swings(seed: int) -> Any:
    """Return a smooth motion, as a function of times to an array (n, 9) of pose and derivatives."""
    rng = np.random.default_rng(seed)
    size, w, phase = rng.normal(size=3) * [0.1, 1, 1], rng.uniform(0.5, 4, 3), rng.uniform(0, 7, 3)

    def at(t: Array) -> Array:
        angle = w * t[:, None] + phase
        parts = [size * np.sin(angle), size * w * np.cos(angle), -size * w**2 * np.sin(angle)]
        return np.hstack(parts)

    return at


def save(path: Path, header: str, rows: Array) -> Path:
    np.savetxt(path, rows, fmt="%.17g", delimiter=",", header=header, comments="")
    return path


def good_lines(count: int = 12) -> list[str]:
    """Return the lines of a small file: poses only, ten samples a second."""
    t = np.arange(count) / 10
    poses = 0.1 * np.sin(np.stack([2 * t + 1, t, 1.5 * t + 2], axis=-1))
    rows = [
        f"{time:.1f}," + ",".join(f"{x:.9f}" for x in pose)
        for time, pose in zip(t, poses, strict=True)
    ]
    return [HEADER, *rows]


def read(tmp_path: Path, content: str | bytes, **options: Any) -> Any:
    path = tmp_path / "path.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_csv(path, **options)


def refuse(
    tmp_path: Path, content: str | bytes, line: int | None, words: str, **options: Any
) -> None:
    """See that a file is refused at a line (or as a whole), in such words."""
    with pytest.raises(InputError, match=words) as caught:
        read(tmp_path, content, **options)
    where = str(tmp_path / "path.csv") + (f", line {line}: " if line else "")
    assert str(caught.value).startswith(where)
