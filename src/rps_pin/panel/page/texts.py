"""Texts of the panel's page: its style, the state, tables; as HTML without anything of a user's."""

from __future__ import annotations

import html
import math

from rps_pin.panel.page.charts import COLOURS, UNITS
from rps_pin.panel.panel import Panel
from rps_pin.plain_text import plain

_TEXT = "font-size: 85%; line-height: 1.35; margin: 0 0.8em 0.5em"
#: Number boxes are as wide as their numbers; names are not cut into letters; the canvas has the
#: background of the exported page; a mark is drawn over viser's plots; and viser's note that there
#: is no GPU, which covers the robot, is not shown.
STYLE = """<style>
.mantine-NumberInput-root {width: 4.6rem !important}
.mantine-NumberInput-input {text-align: right; letter-spacing: 0 !important}
div:has(> .mantine-Text-root > label) {width: 8.2em !important; padding-right: 0.3em}
#webgl-software-rendering {display: none}
canvas[data-engine] {background: linear-gradient(#DBE6F0, #FCFCFF)}
.uplot .u-title {font-size: 12px; font-weight: 500; text-align: left; padding-left: 46px}
.u-over::after {content: ""; position: absolute; top: 0; bottom: 0; left: var(--now, 100%);
  border-left: 1.5px solid #333333; display: var(--mark, none)}
.rps-table {border-collapse: collapse; width: 100%}
.rps-table td, .rps-table th {padding: 1px 4px; text-align: right;
  font-variant-numeric: tabular-nums}
.rps-table td:first-child, .rps-table th:first-child {text-align: left}
.rps-table th {font-weight: 500; color: #666666}
.rps-remarks {font-size: 92%}
.rps-remarks td:last-child {text-align: left}
.rps-table td {white-space: nowrap}
.rps-remarks td {white-space: normal}
.rps-swatch {display: inline-block; width: 0.7em; height: 0.7em; margin-right: 0.5em}
</style>"""


def escaped(text: str) -> str:
    """Return plain text as HTML."""
    return html.escape(plain(text))


def heading(title: str) -> str:
    """Return the page's title."""
    return f'<h2 style="{_TEXT}; font-size: 105%; margin-top: 0.5em">{escaped(title)}</h2>'


def group(name: str, units: set[str]) -> str:
    """Return the heading of a group of sliders, with their unit if they have one."""
    unit = f", {UNITS[next(iter(units))]}" if len(units) == 1 else ""
    return f'<div style="{_TEXT}; margin-bottom: 0.3em; font-weight: 500">{name}{unit}</div>'


def state(panel: Panel, notice: str = "") -> str:
    """Return broken limits and refusals, or that there are none."""
    words = [*panel.trouble, *([notice] if notice else [])]
    said = "<br>".join(map(escaped, words)) or "within all limits"
    colour = "#B00000" if words else "#006000"
    return f'<div style="{_TEXT}; color: {colour}">{said}</div>'


def actuators(panel: Panel) -> str:
    """Return a table of positions and forces, with the colours of the plots."""
    units = [UNITS.get(one.unit, one.unit) for one in panel.actuators]
    forces = [one.force_unit for one in panel.actuators]
    rows = []
    for k, one in enumerate(panel.actuators):
        colour = COLOURS[k % len(COLOURS)]
        position = f"{one.scale * panel.position[k] + 0.0:.3f}{_beside(units, k)}"
        force = panel.forces[k]
        held = f"{force + 0.0:.3f}{_beside(forces, k)}" if math.isfinite(force) else "-"
        red = ' style="color: #B00000"' if panel.mechanism.actuated[k] in panel.outside else ""
        rows.append(
            f'<tr{red}><td><span class="rps-swatch" style="background: {colour}"></span>'
            f"{escaped(one.name)}</td><td>{position}</td><td>{held}</td></tr>"
        )
    heads = ["actuator", f"position{_above(units)}", f"force{_above(forces)}"]
    head = "".join(f"<th>{one}</th>" for one in heads)
    table = f'<table class="rps-table"><tr>{head}</tr>{"".join(rows)}</table>'
    return f'<div style="{_TEXT}">{table}</div>'


def _above(units: list[str]) -> str:
    """Return the unit of all numbers of a column, for its head."""
    return f", {units[0]}" if len(set(units)) == 1 else ""


def _beside(units: list[str], k: int) -> str:
    """Return the unit of one number of a column where they differ."""
    return "" if len(set(units)) == 1 else f" {units[k]}"


def remarks(panel: Panel) -> str:
    """Return a table of the other readings."""
    rows = "".join(
        f"<tr><td>{escaped(name)}</td><td>{escaped(value)}</td></tr>"
        for name, value in panel.remarks()
    )
    return f'<div style="{_TEXT}"><table class="rps-table rps-remarks">{rows}</table></div>'


def clock(elapsed: float, duration: float) -> str:
    """Return the time in a trajectory."""
    return (
        f'<div style="{_TEXT}; font-size: 100%; font-variant-numeric: tabular-nums">'
        f"t = {elapsed:.2f} s <span style='color: #666666'>of {duration:.2f} s</span></div>"
    )


def mark(share: float | None) -> str:
    """Return the place of the mark in the plots, as a share of the time axis; None: no mark."""
    if share is None:
        return "<style>:root {--mark: none}</style>"
    return f"<style>:root {{--mark: block; --now: {100.0 * share:.2f}%}}</style>"
