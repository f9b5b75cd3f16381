"""The newest pose of a running loop in the browser, without disturbing the loop.

The viewer is a process of its own. Between it and the loop lies a small shared memory: the loop
writes a pose there, which takes a microsecond and never waits; the viewer looks at its own rate,
and shows what is new. (A thread would not do: it holds Python's interpreter lock for up to 5 ms at
a time, and a loop at 1 kHz waits for it.) Whatever happens to the viewer, the loop goes on.
"""

from __future__ import annotations

import math
import multiprocessing
import signal
import struct
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any, Self

import numpy as np

from rps_pin.errors import InputError, RPSPinError
from rps_pin.rps.robot import RPSRobot
from rps_pin.viewer.motion import FRAME_RATE, check_frame_rate

#: Number of the write, pose, and the number once more: unequal numbers mark a pose being written.
_SLOT = struct.Struct("5d")
_START_SECONDS = 60.0
_END_SECONDS = 5.0


class LiveView:
    """Show a loop's robot while a ``with`` block lasts, on this machine only.

    Parameters
    ----------
    robot
        The robot.
    pose
        Where it is at first, and what the camera is set for, shape (3,).
    rate
        Pictures a second.
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
        check_frame_rate(rate)
        start = np.asarray(pose, dtype=np.float64)
        if start.shape != (3,) or not np.isfinite(start).all():
            raise InputError(f"pose = {pose!r}: it must be three finite numbers")
        self._asked = (robot, rate, port, title)
        # Not forked: Meshcat's server, and OpenBLAS, have threads.
        self._context = multiprocessing.get_context("spawn")
        self._slot = self._context.RawArray("d", 5)
        self._memory = memoryview(self._slot).cast("B")
        self._count = 0.0
        self.url = ""
        self._process: BaseProcess | None = None
        self._line: Connection | None = None
        self.show(start)

    def show(self, pose: Any) -> None:
        """Give the newest pose, an array of shape (3,); takes about a microsecond, and never waits.

        Nothing is checked here: a pose that cannot be shown is left out.
        """
        self._count += 1.0
        z, tilt_x, tilt_y = pose
        _SLOT.pack_into(self._memory, 0, self._count, z, tilt_x, tilt_y, self._count)

    @property
    def alive(self) -> bool:
        """Whether the viewer runs."""
        return self._process is not None and self._process.is_alive()

    def __enter__(self) -> Self:
        if self._process is not None:
            raise RPSPinError("the view is running already, or has run: make a new one")
        self._line, theirs = self._context.Pipe()
        self._process = self._context.Process(
            target=_serve,
            args=(*self._asked, self._slot, theirs),
            name="rps_pin live view",
            daemon=True,
        )
        self._process.start()
        theirs.close()
        try:
            told = self._line.recv() if self._line.poll(_START_SECONDS) else None
        except EOFError:
            told = None
        if not (isinstance(told, str) and told.startswith("http")):
            self._stop()
            raise RPSPinError(f"the live view did not start: {told or 'its process ended'}")
        self.url = told
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stop()

    def _stop(self) -> None:
        """End the process: it does when its line is cut."""
        if self._line is not None:
            self._line.close()
        if self._process is not None:
            self._process.join(_END_SECONDS)
            if self._process.is_alive():
                self._process.kill()
                self._process.join()


# In the viewer's process --------------------------------------------------------------------------


def _serve(
    robot: RPSRobot, rate: float, port: int | None, title: str, slot: Any, line: Connection
) -> None:
    """Show what the slot holds, at the rate, until the line is cut."""
    from rps_pin.viewer.scene import Scene  # noqa: PLC0415
    from rps_pin.viewer.server import LocalViewer  # noqa: PLC0415

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the loop's; the line tells of its end
    memory = memoryview(slot).cast("B")
    robot, still = _unlimited(robot), np.zeros(3)
    try:
        seen, pose = _newest(memory)
        start = robot.state(pose, still, still)[0]
        with LocalViewer(port, title=title) as viewer:
            scene = Scene(robot.mechanism.model, robot.visual_model(), viewer.window, start[None])
            line.send(viewer.url)
            while not line.poll(1.0 / rate):  # a line that is cut polls true
                count, pose = _newest(memory)
                if count != seen and all(map(math.isfinite, pose)):
                    seen = count
                    _display(scene, robot, pose)
    except (RPSPinError, OSError) as error:
        _tell(line, str(error))


def _display(scene: Any, robot: RPSRobot, pose: tuple[float, float, float]) -> None:
    still = np.zeros(3)
    try:
        scene.display(robot.state(pose, still, still)[0])
    except RPSPinError:
        return  # a pose that cannot be shown is left out


def _unlimited(robot: RPSRobot) -> RPSRobot:
    """Return the robot without limits: beyond them is when people look."""
    return RPSRobot(
        robot.parameters.replace(
            leg_length_limits=(0.0, math.inf),
            leg_angle_limits=(-math.pi, math.pi),
            spherical_cone_limit=math.pi,
        )
    )


def _newest(memory: memoryview) -> tuple[float, tuple[float, float, float]]:
    """Return the newest pose that is not being written, and its number."""
    while True:
        begin, z, tilt_x, tilt_y, end = _SLOT.unpack_from(memory, 0)
        if begin == end:
            return begin, (z, tilt_x, tilt_y)


def _tell(line: Connection, words: str) -> None:
    try:
        line.send(words)
    except OSError:
        return  # nobody listens any more
