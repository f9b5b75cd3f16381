"""Live panel: a robot is moved by sliders and a handle, its lengths, forces and limits are read.

`RPSPanel` and `MechanismPanel` hold the sliders and compute the readings; they draw nothing.
`BrowserPanel` serves one as a page (``rps-pin view --interactive``), `NotebookPanel` shows that
page in a notebook; both need the extra ``panel``. `PoseFile` keeps named poses.
"""

from rps_pin.panel.browser_panel import BrowserPanel
from rps_pin.panel.mechanism_panel import MechanismPanel
from rps_pin.panel.notebook_panel import NotebookPanel
from rps_pin.panel.panel import Panel
from rps_pin.panel.pose_file import PoseFile
from rps_pin.panel.rps_panel import RPSPanel
from rps_pin.panel.slider import Slider

__all__ = [
    "BrowserPanel",
    "MechanismPanel",
    "NotebookPanel",
    "Panel",
    "PoseFile",
    "RPSPanel",
    "Slider",
]
