"""Viewer: robots and their motions in 3D, as pages, pictures, films, or live on this machine only.

`show`, `save_html`, `save_png`, `save_video` and `NotebookView` take a robot or mechanism, its
motion, and layers; `Scene`, `play` and `write_html` take Pinocchio models. Meshcat draws all of
these. The panel of `rps_pin.panel` draws the same scenes with viser.
"""

from rps_pin.viewer.files.html import write_html
from rps_pin.viewer.layers import LAYERS, fitting_layers
from rps_pin.viewer.layers.base import Layer
from rps_pin.viewer.layers.closures import Closures
from rps_pin.viewer.layers.forces import Forces, Reactions
from rps_pin.viewer.layers.frames import Frames
from rps_pin.viewer.layers.ghosts import Ghosts
from rps_pin.viewer.layers.limits import Limits
from rps_pin.viewer.layers.singularity import Singularity
from rps_pin.viewer.layers.trail import Trail
from rps_pin.viewer.layers.workspace import WorkspaceSurface
from rps_pin.viewer.motion import FRAME_RATE, Motion
from rps_pin.viewer.notebook_view import NotebookView
from rps_pin.viewer.playback import play
from rps_pin.viewer.save import save_html, save_png, save_video
from rps_pin.viewer.scene.scene import Scene
from rps_pin.viewer.server.live_view import LiveView
from rps_pin.viewer.server.local_viewer import LocalViewer
from rps_pin.viewer.show import LocalView, show
from rps_pin.viewer.view import View
from rps_pin.viewer.writers.recorder import Recorder
from rps_pin.viewer.writers.window import Command, RawCommand, Window

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
    "NotebookView",
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
