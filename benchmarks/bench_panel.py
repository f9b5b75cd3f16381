"""Time of an update of the live panel: from a slider's new value to the scene and the readings.

    .venv/bin/python -m pytest benchmarks/bench_panel.py --benchmark-only

Twenty a second are asked for: 50 ms each.
"""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from rps_pin import RPSRobot
from rps_pin.panel import BrowserPanel, RPSPanel

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.mark.parametrize("group", ["pose", "lengths"])
@pytest.mark.parametrize("layers", [(), ("forces", "limits", "singularity")])
def bench_a_slider_of_the_panel(benchmark: Any, group: str, layers: tuple[str, ...]) -> None:
    panel = RPSPanel(RPSRobot.from_preset("micro"))
    with BrowserPanel(panel, layers=layers) as face:
        heights = itertools.cycle([[218.0 + k, 0.0, 0.0] for k in range(12)])
        lengths = itertools.cycle([[218.0 + k, 223.0, 223.0] for k in range(12)])

        def move() -> None:
            """Set the first slider, and follow it: here, not in the page's own thread."""
            face.move(group, next(heights if group == "pose" else lengths))
            face._follow(group)

        face._worker.end()
        benchmark(move)
