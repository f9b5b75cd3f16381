"""Live panel: sliders move a robot, and its lengths, forces and limits are read out.

`RPSPanel` and `MechanismPanel` hold the sliders and compute the readings; they draw nothing.
`BrowserPanel` serves one as a page (``rps-pin view --interactive``), `NotebookPanel` shows that
page in a notebook; both need the extra ``panel``. Motions in time are shown by `rps_pin.viewer`.
"""

from rps_pin.panel.browser_panel import BrowserPanel
from rps_pin.panel.mechanism_panel import MechanismPanel
from rps_pin.panel.notebook_panel import NotebookPanel
from rps_pin.panel.panel import Panel, Slider
from rps_pin.panel.rps_panel import RPSPanel

__all__ = ["BrowserPanel", "MechanismPanel", "NotebookPanel", "Panel", "RPSPanel", "Slider"]
