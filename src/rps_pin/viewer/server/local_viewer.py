"""Meshcat server for this machine only, in a thread of this process.

Meshcat's own server runs in another process and listens on every network interface; this one
listens on 127.0.0.1 and ends with its ``with`` block.
"""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Mapping
from typing import Self

import tornado.httpserver
import umsgpack

from rps_pin.errors import RPSPinError
from rps_pin.viewer.server.local_only import HOST, checked_port, listener
from rps_pin.viewer.server.web import Hub, application
from rps_pin.viewer.writers.window import Command, Window

_START_SECONDS = 60.0
_FAREWELL_SECONDS = 0.5
"""Time for the open tabs to close their connections before these are cut."""


class LocalViewer:
    """Serve a scene to browsers on this machine for as long as a ``with`` block lasts.

    Parameters
    ----------
    port
        The port to listen on, 1 to 65535. Default: a free one.
    title
        Plain text for the browser's tab and the caption.
    note
        Plain text for the caption's second line.

    Attributes
    ----------
    window : Window
        The window to give to a `Scene`: this object.

    Examples
    --------
    >>> with LocalViewer() as viewer:  # doctest: +SKIP
    ...     print(viewer.url)
    ...     play(Scene(model, visual, viewer.window, qs), times, qs)
    """

    def __init__(self, port: int | None = None, *, title: str = "Robot", note: str = "") -> None:
        self._asked = None if port is None else checked_port(port)
        self._title, self._note = title, note
        self._hub = Hub()
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._end: asyncio.Event | None = None
        self._port = 0
        self.window: Window = self

    @property
    def url(self) -> str:
        """Address to open in a browser on this machine.

        Raises
        ------
        RPSPinError
            If the viewer is not running.
        """
        if self._loop is None:
            raise RPSPinError("the viewer is not running: it has an address inside its with block")
        return f"http://{HOST}:{self._port}/"

    def __enter__(self) -> Self:
        if self._thread is not None:
            raise RPSPinError("the viewer is running already, or has run: make a new one")
        waiting = listener(self._asked)
        waiting.setblocking(False)
        self._port = int(waiting.getsockname()[1])
        ready = threading.Event()
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._serve(waiting, ready)),
            name="rps_pin viewer",
            daemon=True,
        )
        self._thread.start()
        try:
            started = ready.wait(_START_SECONDS)
        except BaseException:
            self.__exit__()
            raise
        if not started:
            raise RPSPinError(f"the viewer did not start within {_START_SECONDS:g} s")
        return self

    def __exit__(self, *_: object) -> None:
        # The port is free again when this returns.
        loop, self._loop = self._loop, None
        if loop is not None and self._end is not None and self._thread is not None:
            loop.call_soon_threadsafe(self._end.set)
            self._thread.join()

    def send(self, command: Command) -> None:
        """Show a command in every open tab and keep it for those that open later.

        Raises
        ------
        RPSPinError
            If the viewer is not running.
        """
        message = command.lower()
        self.deliver(message, umsgpack.packb(message))

    def deliver(self, message: Mapping[str, object], packed: bytes) -> None:
        """Pass a message, and the same in wire format, to the server's thread; see `send`."""
        if self._loop is None:
            raise RPSPinError("the viewer is not running: nothing can be shown")
        self._loop.call_soon_threadsafe(self._hub.publish, message, packed)

    async def _serve(self, listener: socket.socket, ready: threading.Event) -> None:
        """Serve in the background thread until `_end` is set, then close all connections."""
        app = application(self._hub, port=self._port, title=self._title, note=self._note)
        server = tornado.httpserver.HTTPServer(app)
        server.add_socket(listener)
        self._end = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        ready.set()
        await self._end.wait()
        server.stop()
        await self._hub.close(_FAREWELL_SECONDS)
        await server.close_all_connections()
