"""Playback of a motion in real time, in a loop."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from numpy.typing import ArrayLike

from rps_pin.validation import positive_number
from rps_pin.viewer.motion import FRAME_RATE, Motion
from rps_pin.viewer.scene.scene import Scene


def play(
    scene: Scene,
    times: ArrayLike,
    configurations: ArrayLike,
    stop: threading.Event | None = None,
    *,
    frame_rate: float = FRAME_RATE,
) -> None:
    """Show a motion at the speed of its times, in a loop.

    The picture follows the clock: a slow machine skips frames.

    Parameters
    ----------
    scene
        The scene to show it in.
    times : array_like, shape (n,)
        Times in seconds, strictly increasing. With n = 1 the pose is shown and kept.
    configurations : array_like, shape (n, nq)
        The configuration at each time.
    stop
        An event that ends the playback. Default: it ends with an exception, such as Ctrl-C's
        `KeyboardInterrupt`, which is passed on.
    frame_rate
        Pictures per second.

    Raises
    ------
    InputError
        If the motion or the frame rate cannot be played.
    """
    positive_number(frame_rate, "frame_rate")
    motion = Motion(scene.model, times, configurations)
    stop = threading.Event() if stop is None else stop
    if motion.duration == 0.0:
        scene.display(motion.configurations[0])
        stop.wait()
        return
    follow_clock(
        motion.duration, lambda elapsed: scene.display(motion.at(elapsed)), stop, frame_rate
    )


def follow_clock(
    duration: float, show: Callable[[float], None], stop: threading.Event, frame_rate: float
) -> None:
    """Call `show` with the time since now modulo the duration, s, until `stop` is set."""
    start = time.monotonic()
    while not stop.is_set():
        show((time.monotonic() - start) % duration)
        stop.wait(1.0 / frame_rate)
