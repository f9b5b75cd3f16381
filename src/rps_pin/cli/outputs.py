"""One rule for all commands that write: what they replace, and what they never do.

Never an input, and never what is no regular file: a device or FIFO is written to, of a link the
file that it leads to. What exists is replaced with ``--overwrite`` only; but a command whose
results are a folder of several files renews them if all of them are there from its last run.
"""

from __future__ import annotations

import stat
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from rps_pin.errors import InputError, few
from rps_pin.output_places import is_stream, was_read

OverwriteOption = Annotated[
    bool, typer.Option("--overwrite", help="Replace files that exist (never an input).")
]


def check_outputs(
    files: Sequence[Path],
    overwrite: bool,
    *,
    inputs: Iterable[Path] = (),
    renewed: bool = False,
) -> None:
    """Check, before the work, that files may be written.

    Parameters
    ----------
    files
        All files of the command.
    overwrite
        Whether files that exist may be replaced.
    inputs
        Further inputs, besides those that were read.
    renewed
        Whether files that are all there are an earlier run's, and replaced.

    Raises
    ------
    InputError
        If one is an input, write-protected or no file, or exists and may not be replaced.
    """
    for file in files:
        there_is = next((one for one in file.parents if one.exists()), None)
        if there_is is not None and not there_is.is_dir():
            raise InputError(f"{there_is} is a file: {file} cannot be in it")
    there = [file for file in files if not is_stream(file) and (file.exists() or file.is_symlink())]
    for file in filter(Path.exists, there):
        if was_read(file) or any(one.exists() and file.samefile(one) for one in inputs):
            raise InputError(f"{file} is an input of this command: choose another --output")
        if not file.stat().st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH):
            raise InputError(f"{file} is write-protected")
    if there and not overwrite and not (renewed and len(there) == len(files)):
        words = "exists; --overwrite replaces it", "exist; --overwrite replaces them"
        raise InputError(f"{few([*map(str, there)], 4)} {words[len(there) > 1]}")


def figures_in(folder: Path, *names: str) -> list[Path]:
    """Return the files of figures, as `rps_pin.plots.save_figure` writes them."""
    return [folder / f"{name}{suffix}" for name in names for suffix in (".png", ".svg")]
