"""Numbers as the page prints them, and tables in Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from rps_pin.paper.paper_data import ForceRange

#: Head of the columns that `forces` fills.
FORCES = tuple(f"F_{leg} {which}" for which in ("min", "max") for leg in (1, 2, 3))


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def error(value: float) -> str:
    """Return an error; small ones as a power of ten that bounds them with room for another machine.

    Rounding errors differ from machine to machine, and the page shall not.
    """
    if value > 1e-3:
        return f"{value:.3g}"
    return f"< 1e{max(-12, math.ceil(math.log10(3 * value)))}" if value > 0 else "< 1e-12"


def forces(ranges: ForceRange) -> list[str]:
    """Return six forces, N, to three digits, or whole newtons."""
    return [f"{x:.3g}" if abs(x) < 1000 else f"{x:.0f}" for x in ranges.numbers()]


def between(values: Iterable[float], unit: float = 1e-3, digits: int = 3) -> str:
    """Return the least and the greatest of values, in a unit."""
    numbers = list(values)
    return f"{min(numbers) / unit:.{digits}f} to {max(numbers) / unit:.{digits}f}"
