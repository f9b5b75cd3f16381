"""``rps-pin reproduce``: the paper's equations, figures and tables beside ours, as one page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

if TYPE_CHECKING:
    from rps_pin.paper.compute import Reproduction


def reproduce_command(
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for the results; made if need be.")
    ] = Path("reproduction"),
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Coarser grids, fewer interpretations: seconds."),
    ] = False,
) -> None:
    """Reproduce the paper: every equation, figure and table of it beside what is computed here.

    Written to the output folder: the page (**reproduction.md**) and, in the folder
    **reproduction** beside it, its pictures and every interpretation of the paper's Table 1
    (**interpretations.csv**). Existing files are replaced. About a minute; Ctrl-C leaves no
    half-written file. The project's own page, docs/reproduction.md, is made by
    `rps-pin reproduce -o docs`.

    Exit status: 0 done; 1 not (why is said); 2 wrong usage.

    Example: `rps-pin reproduce --quick -o paper`
    """
    from rps_pin.paper.compute import compute
    from rps_pin.paper.write import write

    console = Console()
    tracked = _tracker(console)
    found = compute(quick=quick, track=tracked)
    files = write(found, output, track=tracked)
    console.print(_summary(found))
    console.print("Written:")
    for file in files:
        console.print(f"  {file}", highlight=False, soft_wrap=True)


def _tracker(console: Console) -> Callable[[Iterable[Any], str], Iterator[Any]]:
    """Return what wraps a loop with a progress bar, where someone watches."""

    def tracked(items: Iterable[Any], doing: str) -> Iterator[Any]:
        quiet = not console.is_terminal
        yield from track(list(items), doing, console=console, transient=True, disable=quiet)

    return tracked


def _summary(found: Reproduction) -> Table:
    from rps_pin.paper.page import summary_lines

    table = Table(show_header=False)
    for name, value in summary_lines(found):
        table.add_row(name, value)
    return table
