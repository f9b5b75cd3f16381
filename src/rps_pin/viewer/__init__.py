"""Robots in the browser, with Meshcat: a page on disk, or a server on this machine only."""

from rps_pin.viewer.html import write_html
from rps_pin.viewer.live_view import LiveView
from rps_pin.viewer.motion import FRAME_RATE, Motion
from rps_pin.viewer.playback import play
from rps_pin.viewer.recorder import Recorder
from rps_pin.viewer.scene import Scene
from rps_pin.viewer.server import LocalViewer
from rps_pin.viewer.window import Command, RawCommand, Window

__all__ = [
    "FRAME_RATE",
    "Command",
    "LiveView",
    "LocalViewer",
    "Motion",
    "RawCommand",
    "Recorder",
    "Scene",
    "Window",
    "play",
    "write_html",
]
