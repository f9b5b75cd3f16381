"""Mutants of trajectories in CSV files: columns, rows and cells changed as a whole."""

from __future__ import annotations

import math
from random import Random

from tests.fuzz import hostile

_RATES = ["z_rate_m_per_s", "tilt_x_rate_rad_per_s", "tilt_y_rate_rad_per_s"]
_HEADER = ["time_s", "z_m", "tilt_x_rad", "tilt_y_rad"]


def start(rows: int, rates: bool) -> list[list[str]]:
    """Return the cells of a smooth motion of the micro robot, at rest at its ends."""
    cells = [[*_HEADER, *(_RATES if rates else [])]]
    for row in range(rows):
        t = row / 50
        phase, speed = 2 * math.pi * row / (rows - 1), 100 * math.pi / (rows - 1)
        size = (0.002, 0.03, -0.02)
        pose = [0.223 + size[0] * (1 - math.cos(phase))]
        pose += [one * (1 - math.cos(phase)) for one in size[1:]]
        rate = [one * speed * math.sin(phase) for one in size]
        cells.append([repr(round(x, 12)) for x in [t, *pose, *(rate if rates else [])]])
    return cells


def mutant(rng: Random) -> tuple[bytes, str]:
    """Return a mutant, and why it must be refused, if it must."""
    cells = start(rng.choice([12, 25]), rng.random() < 0.5)
    for _ in range(rng.choice([0, 1, 1, 2, 3])):
        _changed(cells, rng)
    why = _spoilt(cells, rng) if rng.random() < 0.4 else ""
    mark = rng.choice([",", ",", ",", ";", "\t", ", "])
    lines = [mark.join(row) for row in cells]
    if rng.random() < 0.1:
        lines.insert(rng.randrange(len(lines)), rng.choice(["", "# a comment", " ", "#"]))
    content = rng.choice(["\n", "\n", "\r\n"]).join(lines).encode("utf-8", "surrogatepass")
    if rng.random() < 0.12:
        return hostile.with_bytes_changed(content, rng), ""
    return content, why


def _changed(cells: list[list[str]], rng: Random) -> None:
    row, column = rng.randrange(1, len(cells)), rng.randrange(len(cells[0]))
    kind = rng.randrange(9)
    if kind < 3:
        cells[row][column] = hostile.number(rng)
    elif kind == 3:
        for one in cells:
            del one[column]
    elif kind == 4:
        for one in cells:
            one.append(one[column])
    elif kind == 5:
        del cells[row]
    elif kind == 6:
        factor = rng.choice([1e-9, 1e-3, 57.2957795, 1e3, 1e9, -1, 0])
        for one in cells[1:]:
            one[column] = repr(_float(one[column]) * factor)
    elif kind == 7:
        cells[0][column] = rng.choice([hostile.text(rng), "force_1_N", "z_mm", "time_ms", "x_m"])
    else:
        cells[row][column] = f'"{cells[row][column]}"'


def _float(cell: str) -> float:
    try:
        return float(cell.strip('"'))
    except ValueError:
        return 1.0


def _spoilt(cells: list[list[str]], rng: Random) -> str:
    row, column = rng.randrange(1, len(cells)), rng.randrange(len(cells[0]))
    kind = rng.randrange(5)
    if kind == 0:
        if cells[0][column] not in [*_HEADER, *_RATES]:
            return ""
        cells[0][column] = name = hostile.misspelt(cells[0][column], rng)
        return "" if name == "z_mm" else "a misspelt column"  # a metre that became a millimetre
    if kind == 1:
        cells[row][column] = rng.choice([one for one in hostile.NO_NUMBERS if "," not in one])
        return "a number that is none"
    if kind == 2 and len(cells) > 2:
        cells[row][cells[0].index("time_s") if "time_s" in cells[0] else column] = "-1e3"
        return "times that do not increase" if "time_s" in cells[0] and row > 1 else ""
    if kind == 3:
        cells[row].pop()
        return "a missing cell"
    cells[row][column] = ""
    return "an empty cell"
