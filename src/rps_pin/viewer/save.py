"""Files of a robot with its layers: a page, a picture, a film."""

from __future__ import annotations

import os
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError
from rps_pin.files import whole_file, write_text
from rps_pin.rps.robot import RPSRobot
from rps_pin.validation import positive_number
from rps_pin.viewer.files.browser import in_own_thread
from rps_pin.viewer.files.film import check_film, write_film
from rps_pin.viewer.files.html import checked_target, recorded_page
from rps_pin.viewer.files.pictures import Progress, picture_style, take_pictures
from rps_pin.viewer.layers.base import Layer
from rps_pin.viewer.motion import FRAME_RATE
from rps_pin.viewer.view import View
from rps_pin.viewer.writers.recorder import Recorder

SIZE = (1000, 620)
"""Default width and height of a picture in pixels."""


def save_html(
    path: str | os.PathLike[str],
    what: RPSRobot | ClosedLoopModel,
    motion: Any = None,
    *,
    visual: pin.GeometryModel | None = None,
    layers: Sequence[str | Layer] = (),
    hidden: Sequence[str | Layer] = (),
    title: str | None = None,
    frame_rate: float = FRAME_RATE,
) -> None:
    """Write a page that shows a robot with its layers; it opens from disk and needs no other file.

    The file is written whole or not at all.

    Parameters
    ----------
    path
        The page to write, for instance ``viewer.html``.
    what, motion, visual, layers, hidden
        As for `View`. The page has a switch for each layer.
    title
        Plain text for the browser's tab and the caption. Default: the robot's name.
    frame_rate
        Keyframes per second that are stored; the browser interpolates between them.

    Raises
    ------
    InputError
        If something cannot be shown, or the file cannot be written there.
    """
    target = checked_target(path)
    text, _ = recorded_view(
        what, motion, title, frame_rate, visual=visual, layers=layers, hidden=hidden
    )
    write_text(target, text)


def save_png(
    path: str | os.PathLike[str],
    what: RPSRobot | ClosedLoopModel,
    motion: Any = None,
    *,
    time: float = 0.0,
    visual: pin.GeometryModel | None = None,
    layers: Sequence[str | Layer] = (),
    title: str | None = None,
    size: tuple[int, int] = SIZE,
    scale: float = 1.0,
    background: str | None = None,
    captions: bool = True,
) -> None:
    """Write a picture of one moment, drawn by a headless Chromium.

    Parameters
    ----------
    path
        The picture to write, ``.png``.
    what, motion, visual, layers
        As for `View`.
    time
        Seconds since the motion's beginning.
    title
        As for `save_html`.
    size
        Width and height, in pixels of the page.
    scale
        Pixels of the picture to one of the page: 2 or 3 for print.
    background
        A colour, for instance ``"white"``, or ``"transparent"``. Default: the viewer's sky.
    captions
        Whether the title and the key of the layers are in the picture.

    Raises
    ------
    InputError
        If something cannot be shown, or the file cannot be written there.
    RPSPinError
        If Playwright or Chromium is missing; says how to install them.
    """
    target = checked_target(path)
    if target.suffix.lower() != ".png":
        raise InputError(f"{target.name}: a picture is written as .png")
    style = picture_style(size, scale, background, captions)
    text, view = recorded_view(what, motion, title, visual=visual, layers=layers)
    if not 0.0 <= time <= view.motion.duration:
        raise InputError(f"time = {time} s; the motion lasts from 0 to {view.motion.duration:g} s")
    [picture] = in_own_thread(lambda stop: list(take_pictures(text, [time], stop, style)))
    with whole_file(target) as scratch:
        scratch.write_bytes(picture)


def save_video(
    path: str | os.PathLike[str],
    what: RPSRobot | ClosedLoopModel,
    motion: Any,
    *,
    visual: pin.GeometryModel | None = None,
    layers: Sequence[str | Layer] = (),
    title: str | None = None,
    size: tuple[int, int] = (800, 500),
    scale: float = 1.0,
    background: str | None = None,
    captions: bool = True,
    frame_rate: float = FRAME_RATE,
    progress: Progress = iter,
) -> None:
    """Write a film of a motion: ``.mp4``, or an animated ``.gif`` or ``.webp``.

    Parameters
    ----------
    path
        The film to write; its suffix is its format.
    what, motion, visual, layers, title, size, scale, background, captions
        As for `save_png`; a film is never transparent.
    frame_rate
        Pictures per second. GIF stores hundredths of a second, and most players are slow below
        two of them.
    progress
        Wraps the loop over the times of the pictures.

    Raises
    ------
    InputError
        If something cannot be shown, the motion has no duration, or the file cannot be written
        there.
    RPSPinError
        If Playwright, Chromium or imageio is missing; says how to install them.
    """
    target = checked_target(path)
    check_film(target)
    positive_number(frame_rate, "frame_rate")
    style = picture_style(size, scale, background, captions)
    if background == "transparent":
        raise InputError("a film has no transparent background: give a colour, or none")
    text, view = recorded_view(what, motion, title, visual=visual, layers=layers)
    duration = view.motion.duration
    if duration <= 0.0:
        raise InputError("a single pose makes no film: give a motion, or write a picture")
    # The end is the beginning of the next round: one picture of the two.
    times = np.arange(0.0, duration - 0.5 / frame_rate, 1.0 / frame_rate)

    def film(scratch: Path, stop: threading.Event) -> None:
        moments = progress([float(time) for time in times])
        write_film(scratch, take_pictures(text, moments, stop, style), frame_rate)

    with whole_file(target) as scratch:
        in_own_thread(lambda stop: film(scratch, stop))


def recorded_view(
    what: RPSRobot | ClosedLoopModel,
    motion: Any,
    title: str | None,
    frame_rate: float = FRAME_RATE,
    **shown: Any,
) -> tuple[str, View]:
    """Return the page and the view that was recorded on it."""
    recorder = Recorder()
    view = View(recorder, what, motion, **shown)
    if view.motion.duration > 0.0:
        view.animate(frame_rate=frame_rate)
    return recorded_page(recorder, view.scene, view.motion, title or view.subject.title), view
