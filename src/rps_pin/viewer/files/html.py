"""Pages that show a motion from disk, without a server, the network or any other file."""

from __future__ import annotations

import base64
import json
import os
from pathlib import Path

import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.errors import InputError
from rps_pin.files import write_text
from rps_pin.viewer.files.page import inline_script, licences, own_file, page, viewer_library
from rps_pin.viewer.motion import FRAME_RATE, Motion
from rps_pin.viewer.scene.scene import Scene
from rps_pin.viewer.writers.recorder import Recorder

# The page may run its own scripts and show pictures made of data. The browser lets it fetch
# nothing.
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
)


def write_html(
    path: str | os.PathLike[str],
    model: pin.Model,
    visual: pin.GeometryModel,
    times: ArrayLike,
    configurations: ArrayLike,
    *,
    title: str = "Robot motion",
    frame_rate: float = FRAME_RATE,
) -> None:
    """Write a page that plays a motion in a loop when it is opened from disk.

    The file is written whole or not at all; an existing file is replaced.

    Parameters
    ----------
    path
        The page to write, for instance ``viewer.html``.
    model
        The robot.
    visual
        Its geometry.
    times : array_like, shape (n,)
        Times in seconds, strictly increasing. With n = 1 the page shows a single pose.
    configurations : array_like, shape (n, nq)
        The configuration at each time.
    title
        Plain text for the browser's tab and the caption.
    frame_rate
        Keyframes per second that are stored; the browser interpolates between them.

    Raises
    ------
    InputError
        If the motion, the frame rate or the visual model cannot be shown, or `path` is a folder or
        in a folder that does not exist.
    OSError
        If the file cannot be written.
    """
    target = checked_target(path)
    motion = Motion(model, times, configurations)
    recorder = Recorder()
    scene = Scene(model, visual, recorder, motion.configurations)
    if motion.duration > 0.0:
        scene.animate(motion, frame_rate=frame_rate)
    write_text(target, recorded_page(recorder, scene, motion, title))


def checked_target(path: str | os.PathLike[str]) -> Path:
    """Return the path of a file, or raise `InputError` if it cannot be written there."""
    target = Path(path)
    if target.is_dir() or not target.parent.is_dir():
        raise InputError(f"cannot write {target}: it is a folder, or its folder does not exist")
    return target


def recorded_page(recorder: Recorder, scene: Scene, motion: Motion, title: str) -> str:
    """Return a page that carries out recorded commands when it is opened."""
    moves = motion.duration > 0.0
    grid = f"grid {1e3 * scene.grid_spacing:g} mm"
    note = f"{motion.duration:.3g} s, in a loop · {grid}" if moves else grid
    # The commands are data: JSON within a script that is not run.
    commands = [base64.b64encode(command).decode("ascii") for command in recorder.packed()]
    run = ["layout.js", "legend.js", "recorded.js", *(["controls.js"] if moves else [])]
    scripts = [
        inline_script(licences(), ' type="application/json" id="licences"'),
        inline_script(json.dumps(commands), ' type="application/json" id="commands"'),
        inline_script(viewer_library()),
        inline_script("".join(map(own_file, run))),
    ]
    return page(title=title, note=note, policy=_POLICY, scripts="\n".join(scripts))
