"""``rps-pin assembly-modes``: the closed configurations with given joint values."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import pinocchio as pin
import typer

from rps_pin.arrays import Array
from rps_pin.cli import console as common
from rps_pin.cli import mechanism_options as options
from rps_pin.closed_loop.assembly.every.found_modes import FoundModes
from rps_pin.closed_loop.column_names import column_names
from rps_pin.plain_text import short

#: Modes in the printed table at most, and the width of one.
_MOST, _WIDTH = 8, 15
_CONDITION = "condition number"


def assembly_modes_command(
    file: options.FileArgument,
    at: Annotated[
        options.JointValues,
        options.joint_values(
            "Value of a joint, rad or m; default: home's values of the actuated joints."
        ),
    ] = None,
    frame: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Tell modes apart by this frame alone; can be given several times.",
        ),
    ] = None,
    every: Annotated[
        bool,
        typer.Option(
            "--all",
            help="Follow all complex solutions, and certify the modes among them.",
        ),
    ] = False,
    probability: Annotated[
        float | None,
        typer.Option(help="End the search where all are found with this probability."),
    ] = None,
    starts: Annotated[int, typer.Option(help="Most random starts.")] = 20_000,
    seconds: Annotated[float, typer.Option(help="Longest time, s.")] = 60.0,
    seed: Annotated[int, typer.Option(help="Of the random numbers.")] = 0,
    ignore_limits: options.IgnoreLimitsOption = False,
    accuracy: options.AccuracyOption = None,
    as_json: common.JsonOption = False,
) -> None:
    """Find all closed configurations of a mechanism with given joint values.

    The loops are closed from random starts until no further mode is expected. That is no proof that
    there is none: the output says how many starts led to each mode, and how many modes are expected
    in all. Ctrl-C ends the search and keeps what it has found.

    With --all, all complex solutions are followed instead, where the closures are polynomials of a
    known kind: the output says how many there are, how that is known, and which modes are proven.

    Exit status: 0 found; 1 not found (the error says why); 2 wrong usage.

    Examples:

    - `rps-pin assembly-modes four_bar --at crank_joint=1.2`

    - `rps-pin assembly-modes stewart --frame platform --ignore-limits`

    - `rps-pin assembly-modes stewart --all --ignore-limits`
    """
    mechanism, _ = options.load_mechanism(file, ignore_limits, accuracy)
    console = common.text_console(as_json, soft_wrap=True)
    with common.share_bar(console, "searching") as progress:
        found = mechanism.assembly_modes(
            options.by_joint(at, "--at") if at else None,
            frames=frame,
            method="all" if every else "search",
            probability=probability,
            starts=starts,
            seconds=seconds,
            seed=seed,
            progress=progress,
        )
    if as_json:
        common.print_json({"mechanism": mechanism.name} | _as_json(mechanism.model, found))
        return
    names = column_names(mechanism.model)[0]
    room = console.width - max(map(len, [*names, _CONDITION])) - 4
    shown = max(1, min(room // _WIDTH, _MOST))
    marks = found.hits
    title = "mode (starts)"
    if found.certified is not None:
        marks, title = np.where(found.certified, "certified", "not certified"), "mode"
    columns = [f"{k + 1} ({mark})" for k, mark in enumerate(marks[:shown])]
    rows = [(name, *(short(q[i]) for q in found.q[:shown])) for i, name in enumerate(names)]
    rows.append((_CONDITION, *(f"{c:.3g}" for c in found.condition[:shown])))
    if found.hits.size:
        console.print(common.table_of(rows, title, *columns))
    if found.hits.size > shown:
        console.print(
            f"{found.hits.size - shown} more: --json prints all"
            + ("" if frame else "; --frame NAME tells modes apart by that frame alone")
        )
    console.print(str(found))


def _as_json(model: pin.Model, found: FoundModes) -> dict[str, Any]:
    """Return what was found as plain values."""
    modes = [
        {"home": _by_joint(model, q), "hits": int(hits), "condition": _plain(c)}
        for q, hits, c in zip(found.q, found.hits, found.condition, strict=True)
    ]
    if found.certified is not None:
        for mode, certified in zip(modes, found.certified, strict=True):
            mode["certified"] = bool(certified)
    counts = found._asdict()
    names = (
        "starts",
        "closed",
        "outside",
        "stopped",
        "complex_count",
        "paths",
        "singular",
        "known",
    )
    told = {name: counts[name] for name in names}
    numbers = {name: _plain(counts[name]) for name in ("expected", "probability")}
    return {"modes": modes} | told | numbers


def _plain(number: float) -> float | None:
    return float(number) if np.isfinite(number) else None


def _by_joint(model: pin.Model, q: Array) -> dict[str, Any]:
    """Return a configuration as a description's ``home`` has it."""
    home = {}
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        values = q[joint.idx_q : joint.idx_q + joint.nq].tolist()
        home[name] = values[0] if len(values) == 1 else values
    return home
