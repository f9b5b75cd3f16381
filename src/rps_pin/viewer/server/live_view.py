"""Live view of a running control loop, without delaying the loop.

The viewer runs in its own process. The loop writes its pose to shared memory, which takes about a
microsecond and never waits; the viewer reads it at its own rate. (A viewer in a thread would hold
Python's interpreter lock for up to 5 ms at a time, and a loop at 1 kHz would wait for it.) The loop
goes on whatever happens to the viewer.

A pose that is read while it is being written is recognised by its checksum, in whatever order a
processor makes the writes visible, and is not shown. The viewer reads again for its next picture.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import struct
import zlib
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, Self

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError, RPSPinError
from rps_pin.rps.robot import RPSRobot
from rps_pin.validation import positive_number, real_vector
from rps_pin.viewer.motion import FRAME_RATE
from rps_pin.viewer.scene.scene import Scene
from rps_pin.viewer.server.local_viewer import LocalViewer

#: Number of the write, and the pose; its CRC-32 follows.
_RECORD = struct.Struct("4d")
_CHECKSUM = 4
#: A loaded machine may take a minute to import Pinocchio; a process that ends is seen at once.
_START_SECONDS = 300.0
_END_SECONDS = 5.0


class LiveView:
    """Show a loop's robot while a ``with`` block lasts, on this machine only.

    Parameters
    ----------
    robot
        The robot.
    pose
        The first pose, for which the camera is set, shape (3,).
    rate
        Pictures per second.
    port
        As for `LocalViewer`.
    title
        Plain text for the browser's tab.

    Attributes
    ----------
    url : str
        Address to open in a browser on this machine.

    Raises
    ------
    InputError
        If an argument does not fit.
    RPSPinError
        If the viewer does not start; says why.

    Notes
    -----
    Python spawns a process. A script that makes a live view must have its work below
    ``if __name__ == "__main__":``, or the new process would run it again.

    Examples
    --------
    >>> with LiveView(robot, pose) as view:  # doctest: +SKIP
    ...     print(view.url)
    ...     view.show(controller.estimate.answers.pose)  # in each tick
    """

    def __init__(
        self,
        robot: RPSRobot,
        pose: Any,
        *,
        rate: float = FRAME_RATE,
        port: int | None = None,
        title: str = "Robot",
    ) -> None:
        if not isinstance(robot, RPSRobot):
            raise InputError(f"robot is a {type(robot).__name__}; it must be an RPSRobot")
        positive_number(rate, "rate")
        start = real_vector(pose, 3, "pose")
        self._robot, self._asked = robot, (start, rate, port, title)
        # Not forked: Meshcat's server, and OpenBLAS, have threads.
        self._context = multiprocessing.get_context("spawn")
        self._slot = self._context.RawArray("B", _RECORD.size + _CHECKSUM)
        self._memory = memoryview(self._slot).cast("B")
        self._count = 0.0
        self.url = ""
        self._process: BaseProcess | None = None
        self._line: Connection | None = None
        self.show(start)

    def show(self, pose: Any) -> None:
        """Give the newest pose, an array of shape (3,); takes about a microsecond, and never waits.

        The numbers are not checked: a pose that cannot be shown is left out.

        Raises
        ------
        InputError
            If these are not three numbers.
        """
        self._count += 1.0
        try:
            z, tilt_x, tilt_y = pose
            record = _RECORD.pack(self._count, z, tilt_x, tilt_y)
        except (TypeError, ValueError, struct.error):
            raise InputError(f"pose = {pose!r}: it must be three numbers") from None
        self._memory[:] = _checked(record)

    @property
    def alive(self) -> bool:
        """Whether the viewer runs."""
        return self._process is not None and self._process.is_alive()

    def __enter__(self) -> Self:
        if self._process is not None:
            raise RPSPinError("the view is running already, or has run: make a new one")
        try:
            self.url = self._start()
        except BaseException:  # Ctrl-C too: __exit__ is not called
            self.__exit__()
            raise
        return self

    def _start(self) -> str:
        """Start the process and return its address."""
        self._line, theirs = self._context.Pipe()
        process = self._context.Process(
            target=_serve,
            args=(self._robot, self._asked, self._slot, theirs),
            name="rps_pin live view",
            daemon=True,
        )
        # Block SIGINT in the processes that are started here: Ctrl-C is for the loop. They inherit
        # the mask, and so show no traceback, not even while they import.
        resource_tracker.ensure_running()  # where it first has to start it unblocks the signal
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            with theirs:
                process.start()
            self._process = process
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        try:
            late = f"no answer within {_START_SECONDS:g} s"
            told = self._line.recv() if self._line.poll(_START_SECONDS) else late
        except (EOFError, OSError):
            told = 'its process ended (a script needs `if __name__ == "__main__":`)'
        if not told.startswith("http"):
            raise RPSPinError(f"the live view did not start: {told}")
        return str(told)

    def __exit__(self, *_: object) -> None:
        # The process ends when anything is sent, or the connection is closed.
        if self._line is not None:
            with contextlib.suppress(OSError):  # nobody listens any more
                self._line.send(None)
            self._line.close()
        if self._process is not None:
            self._process.join(_END_SECONDS)
            if self._process.is_alive():
                self._process.kill()
                self._process.join()


def _checked(record: bytes) -> bytes:
    """Return a record and its checksum."""
    return record + zlib.crc32(record).to_bytes(_CHECKSUM, "little")


# In the viewer's process --------------------------------------------------------------------------


def _serve(
    robot: RPSRobot, asked: tuple[Array, float, int | None, str], slot: Any, line: Connection
) -> None:
    """Show the newest pose at the rate, until the connection or the loop's process ends."""
    start, rate, port, title = asked
    memory, parent = memoryview(slot).cast("B"), os.getppid()
    # The shapes depend on the limits: they are those of the robot as it is.
    free, still, seen = RPSRobot(robot.parameters.without_limits()), np.zeros(3), 0.0
    try:
        first = free.state(start, still, still)[0]
        with LocalViewer(port, title=title) as viewer:
            scene = Scene(robot.mechanism.model, robot.visual_model(), viewer.window, first)
            line.send(viewer.url)
            # A line that is cut polls true, unless a process forked from the loop's holds it too.
            while not line.poll(1.0 / rate) and os.getppid() == parent:
                newest = _newest(memory)
                if newest is not None and newest[0] != seen:
                    seen, pose = newest
                    # One that cannot be shown is left out, overflows and all.
                    with contextlib.suppress(RPSPinError), np.errstate(all="ignore"):
                        scene.display(free.state(pose, still, still)[0])
    except (RPSPinError, OSError) as error:
        with contextlib.suppress(OSError):  # nobody listens any more
            line.send(str(error))


def _newest(memory: memoryview) -> tuple[float, tuple[float, float, float]] | None:
    """Return the number of the newest pose and the pose, or None while it is being written."""
    copy = bytes(memory)
    record = copy[: _RECORD.size]
    if copy != _checked(record):
        return None
    count, z, tilt_x, tilt_y = _RECORD.unpack(record)
    return count, (z, tilt_x, tilt_y)
