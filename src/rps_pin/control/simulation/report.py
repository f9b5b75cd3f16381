"""Report of a control scenario in Markdown: settings, margins, errors and statuses."""

from __future__ import annotations

import html
from collections.abc import Mapping
from typing import Any

from rps_pin.control.simulation.loop_run import LoopRun
from rps_pin.control.simulation.loop_summary import LoopSummary, TaskSummary, status_name
from rps_pin.control.simulation.scenario import Scenario
from rps_pin.errors import InputError
from rps_pin.plain_text import plain

#: Most changes of the status in the report.
_MOST_SHOWN = 50


def report(
    title: str,
    scenario: Scenario,
    run: LoopRun,
    summary: LoopSummary | TaskSummary,
    figures: Mapping[str, str],
) -> str:
    """Return the report.

    Parameters
    ----------
    title
        Of the page.
    scenario, run, summary
        The scenario, its run, and the run's figures after settling.
    figures
        Captions by file name.
    """
    entry = scenario.entry
    lines = [
        *(f"# {html.escape(plain(title))}", ""),
        f"Robot {html.escape(plain(scenario.name))}; {run.time.size} ticks of "
        f"{1e3 * entry.period:g} ms, the first {entry.settle:g} s at rest.",
        "",
    ]
    same = "the same as the controller's model"
    for name, described in (("controller", entry.controller), ("plant", entry.plant)):
        given = described.model_dump(exclude_none=True).items()
        settings = ", ".join(f"{key} {_plain(value)}" for key, value in given if value != {})
        lines.append(f"- {name}: {settings or same}")
    lines += ["", "## Gains and margins", ""]
    names = ("proportional", "derivative", "integral")
    for name, row in zip(names, scenario.gains.rows, strict=True):
        lines.append(f"- {name}: {', '.join(f'{value:.6g}' for value in row)}")
    lines += ["", _margins(scenario), ""]
    lines += [f"## Errors, over {summary.ticks} ticks", ""]
    lines += ["| | RMS | largest | at the end | |", "|---|---:|---:|---:|---|"]
    lines += [f"| {' | '.join(row)} |" for row in summary.rows()]
    where = "type II" if run.task is None else "a singularity"
    lines += [
        "",
        f"Ticks at a force limit: {summary.saturated:.2%}. Smallest distance to {where}: "
        f"{summary.minimum_type_ii:.4g}. Largest gap of the plant's loops: {summary.gap:.2g} m.",
        "",
    ]
    lines += ["## Statuses", "", *_statuses(run, summary), ""]
    if scenario.faults:
        units = [unit for _, unit in run.of_pose]
        lines += ["Faults:", "", *(f"- {fault.text(units)}" for fault in scenario.faults), ""]
    for name, caption in figures.items():
        lines += [f"![{caption}]({name})", ""]
    return "\n".join(lines)


def _plain(value: Any) -> str:
    if isinstance(value, dict):
        return "(" + ", ".join(f"{key} {_plain(one)}" for key, one in value.items()) + ")"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _margins(scenario: Scenario) -> str:
    try:
        return f"One axis, by the model: {scenario.margins()}."
    except InputError as error:
        return f"Margins are not available: {error}."


def _statuses(run: LoopRun, summary: LoopSummary | TaskSummary) -> list[str]:
    lines = [
        f"- {name}: {count} ticks, first at {summary.first[name]:.6g} s"
        for name, count in summary.statuses.items()
    ]
    if not run.events:
        return ["ok in all ticks."]
    lines += ["", "| t (s) | status | text |", "|---:|---|---|"]
    lines += [
        f"| {event.time:.6g} | {status_name(event.status)} | {event.text} |"
        for event in run.events[:_MOST_SHOWN]
    ]
    more = len(run.events) - _MOST_SHOWN
    return [*lines, "", f"... and {more} further changes."] if more > 0 else lines
