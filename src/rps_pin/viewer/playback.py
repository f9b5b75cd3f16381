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
    follow_clock(motion, lambda elapsed: scene.display(motion.at(elapsed)), stop, frame_rate)


def follow_clock(
    motion: Motion,
    show: Callable[[float], None],
    stop: threading.Event | None,
    frame_rate: float,
) -> None:
    """Call `show` with the time since now modulo the duration, s, until `stop` is set.

    A motion without a duration is shown once.
    """
    duration, start = motion.duration, time.monotonic()
    stop = threading.Event() if stop is None else stop
    while not stop.is_set():
        show((time.monotonic() - start) % duration if duration else 0.0)
        stop.wait(1.0 / frame_rate if duration else None)
