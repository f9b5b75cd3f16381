"""From a slider to the scene: how many updates a second the live panel makes.

    .venv/bin/python -m pytest benchmarks/bench_panel.py --benchmark-only

Twenty a second are asked for: 50 ms each.
"""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from rps_pin import RPSRobot
from rps_pin.panel import NotebookPanel, RPSPanel

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.mark.parametrize("group", ["pose", "lengths"])
def bench_a_slider_in_a_notebook(benchmark: Any, group: str) -> None:
    panel = RPSPanel(RPSRobot.from_preset("micro"))
    with NotebookPanel(panel) as face:
        slider = face._sliders[group][0]
        values = itertools.cycle([218.0 + k for k in range(12)])
        benchmark(lambda: setattr(slider, "value", next(values)))
