"""``rps-pin reproduce``: the paper's equations, figures and tables compared with the package."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from rps_pin.cli import console as common
from rps_pin.cli.outputs import OverwriteOption, check_outputs


def reproduce_command(
    output: common.FolderOption = Path("reproduction"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Coarser grids and fewer interpretations: seconds.")
    ] = False,
    overwrite: OverwriteOption = False,
) -> None:
    """Reproduce the paper: each equation, figure and table compared with what is computed here.

    Output: the page (**reproduction.md**) and, in the folder **reproduction** next to it, its
    pictures and all interpretations of the paper's Table 1 (**interpretations.csv**) that were
    tried. A whole earlier reproduction is replaced. It takes about a minute; Ctrl-C leaves no
    incomplete file. The project's own page, docs/reproduction.md, is made by `rps-pin reproduce
    -o docs`.

    Exit status: 0 done; 1 an error; 2 wrong usage.

    Example: `rps-pin reproduce --quick -o paper`
    """
    from rps_pin.paper.compute import compute
    from rps_pin.paper.page import summary_lines
    from rps_pin.paper.write import results, write

    check_outputs(results(output), overwrite, renewed=True)
    console = common.text_console()

    def track(items: Iterable[Any], task: str) -> Iterable[Any]:
        yield from common.progress_bar(console, task)(list(items))

    found = compute(quick=quick, track=track)
    files = write(found, output, track=track)
    console.print(common.table_of(summary_lines(found)))
    common.print_files(console, files)
