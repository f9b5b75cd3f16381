"""A live panel: sliders move a robot, and everything about it is read out.

`RPSPanel` and `MechanismPanel` know what sliders there are and what moving one means; they draw
nothing. `NotebookPanel` shows one in Jupyter (the extra ``jupyter``), `BrowserPanel` in a page of
its own (the extra ``panel``; ``rps-pin view --interactive``). Motions in time are shown by
`rps_pin.viewer`.
"""

from rps_pin.panel.browser import BrowserPanel
from rps_pin.panel.mechanism_panel import MechanismPanel
from rps_pin.panel.notebook import NotebookPanel
from rps_pin.panel.rps_panel import RPSPanel
from rps_pin.panel.sliders import Panel, Slider

__all__ = ["BrowserPanel", "MechanismPanel", "NotebookPanel", "Panel", "RPSPanel", "Slider"]
