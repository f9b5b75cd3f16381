"""Robots in the browser, with Meshcat: a page on disk, or a server on this machine only.

`show`, `save_html`, `save_png` and `save_video` take a robot, what it does, and the layers to show
with it; `Scene` and what is below it know Pinocchio models only.
"""

from rps_pin.viewer.files.html import write_html
from rps_pin.viewer.layers import (
    LAYERS,
    Closures,
    Forces,
    Frames,
    Ghosts,
    Layer,
    Limits,
    Reactions,
    Singularity,
    Trail,
    WorkspaceSurface,
    fitting_layers,
)
from rps_pin.viewer.motion import FRAME_RATE, Motion
from rps_pin.viewer.save import LocalView, save_html, save_png, save_video, show
from rps_pin.viewer.scene.scene import Scene
from rps_pin.viewer.server.live_view import LiveView
from rps_pin.viewer.server.local_viewer import LocalViewer
from rps_pin.viewer.server.playback import play
from rps_pin.viewer.server.recorder import Recorder
from rps_pin.viewer.server.window import Command, RawCommand, Window
from rps_pin.viewer.view import View

__all__ = [
    "FRAME_RATE",
    "LAYERS",
    "Closures",
    "Command",
    "Forces",
    "Frames",
    "Ghosts",
    "Layer",
    "Limits",
    "LiveView",
    "LocalView",
    "LocalViewer",
    "Motion",
    "RawCommand",
    "Reactions",
    "Recorder",
    "Scene",
    "Singularity",
    "Trail",
    "View",
    "Window",
    "WorkspaceSurface",
    "fitting_layers",
    "play",
    "save_html",
    "save_png",
    "save_video",
    "show",
    "write_html",
]
