"""Files of the reproduction: the page, its pictures and a CSV of all interpretations."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from rps_pin.files import write_text
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.figures import NAMES, write_figures
from rps_pin.paper.page import render
from rps_pin.paper.tables import interpretations_csv


def results(folder: Path) -> list[Path]:
    """Return the files that `write` writes, the page first."""
    beside = folder / "reproduction"
    pictures = [beside / f"{name}.png" for name in NAMES]
    return [folder / "reproduction.md", *pictures, beside / "interpretations.csv"]


def write(
    found: Reproduction,
    folder: Path,
    track: Callable[[Iterable[str], str], Iterable[str]] = lambda items, _: items,
) -> list[Path]:
    """Write ``reproduction.md``, and its pictures and the CSV into ``reproduction/`` beside it.

    Each file is written whole or not at all, the page last. Existing files are replaced.

    Parameters
    ----------
    found
        What `compute` returned.
    folder
        Made if need be.
    track
        Wraps the loop over the pictures, for a progress bar.

    Returns
    -------
    list of Path
        The files, the page first.
    """
    page, *_, interpretations = files = results(folder)
    interpretations.parent.mkdir(parents=True, exist_ok=True)
    write_figures(found, interpretations.parent, track)
    for path, text in ((interpretations, interpretations_csv(found)), (page, render(found))):
        write_text(path, text)
    return files
