"""Web application of `LocalViewer`: one page, Meshcat's script, and one WebSocket."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping

import tornado.web
import tornado.websocket
from tornado.iostream import IOStream

from rps_pin.viewer.files.page import inline_script, own_file, page, viewer_library
from rps_pin.viewer.server.local_only import REFUSAL, is_foreign, local_hosts
from rps_pin.viewer.server.store import SceneStore

_SOCKET_PATH = "/socket"
"""As in live.js."""
_SCRIPT_PATH = "/meshcat.js"
_MOST_UNSENT = 20_000
"""Messages, besides the scene itself, that may wait for one tab: a few megabytes."""
_GOING_AWAY = 1001
"""WebSocket status of a server that ends."""


class Hub:
    """The open tabs and the scene that they show; for the server's thread only."""

    def __init__(self) -> None:
        self._store = SceneStore()
        self._tabs: set[Tab] = set()

    def publish(self, message: Mapping[str, object], packed: bytes) -> None:
        """Send a message to every tab and keep it for later ones.

        A tab that has stopped reading is closed: its unread messages would fill the memory.
        """
        self._store.apply(message, packed)
        most = _MOST_UNSENT + len(self._store)
        for tab in list(self._tabs):
            if tab.unsent < most:
                tab.show(packed)
            else:
                tab.cut()

    def join(self, tab: Tab) -> None:
        """Send the scene to a new tab, and all later messages."""
        self._tabs.add(tab)
        for packed in self._store:
            tab.show(packed)

    def leave(self, tab: Tab) -> None:
        """Remove a tab."""
        self._tabs.discard(tab)

    async def close(self, patience: float) -> None:
        """Close every tab's connection; cut those that are still open after `patience` s."""
        for tab in list(self._tabs):
            tab.close(_GOING_AWAY, "the viewer has ended")
        deadline = asyncio.get_running_loop().time() + patience
        while self._tabs and asyncio.get_running_loop().time() < deadline:
            await asyncio.sleep(0.01)
        for tab in list(self._tabs):
            tab.cut()


class _LocalHandler(tornado.web.RequestHandler):
    """Refuses requests that do not come from a page of this server; see `local_only`."""

    def prepare(self) -> None:
        hosts, origins = map(self.request.headers.get_list, ("Host", "Origin"))
        if is_foreign(hosts, origins, self.settings["hosts"]):
            self.set_status(403)
            self.finish(REFUSAL)


class _Text(_LocalHandler):
    """Handler of one text."""

    def initialize(self, content: str, kind: str) -> None:
        self._content, self._kind = content, kind

    def get(self) -> None:
        self.set_header("Content-Type", f"{self._kind}; charset=utf-8")
        self.set_header("Cache-Control", "no-store")
        self.write(self._content)


class Tab(_LocalHandler, tornado.websocket.WebSocketHandler):
    """One browser tab."""

    def initialize(self) -> None:
        """Start with nothing sent."""
        self._hub: Hub = self.settings["hub"]
        self.unsent = 0
        self._stream: IOStream | None = None

    def check_origin(self, origin: str) -> bool:
        """Return True: `prepare` has refused other pages."""
        return True

    def open(self, *args: str, **kwargs: str) -> None:
        """Join the hub."""
        assert self.ws_connection is not None
        self._stream = self.ws_connection.stream
        self._hub.join(self)

    def on_message(self, message: str | bytes) -> None:
        """Ignore messages from a tab."""

    def on_close(self) -> None:
        """Leave the hub."""
        self._hub.leave(self)

    def show(self, packed: bytes) -> None:
        """Send one message."""
        try:
            sent = asyncio.ensure_future(self.write_message(packed, binary=True))
        except tornado.websocket.WebSocketClosedError:
            self._hub.leave(self)
            return
        self.unsent += 1
        sent.add_done_callback(self._count_sent)

    def cut(self) -> None:
        """Cut the connection."""
        self._hub.leave(self)
        if self._stream is not None:
            self._stream.close()

    def _count_sent(self, sent: asyncio.Future[None]) -> None:
        self.unsent -= 1
        # A tab that closed meanwhile is not an error: on_close removes it.
        if not sent.cancelled():
            sent.exception()


def application(hub: Hub, *, port: int, title: str, note: str) -> tornado.web.Application:
    """Return the application that serves `hub` on `port` of this machine.

    Parameters
    ----------
    hub
        The scene and its tabs.
    port
        The server's port, part of every permitted Host and Origin.
    title, note
        Plain text for the page's caption.
    """
    hosts = local_hosts(port)
    sockets = " ".join(f"ws://{host}" for host in sorted(hosts))
    policy = (
        "default-src 'none'; script-src 'self' 'unsafe-inline'; style-src 'unsafe-inline'; "
        f"img-src data: blob:; connect-src {sockets}"
    )
    own = inline_script("".join(map(own_file, ("layout.js", "legend.js", "live.js"))))
    scripts = f'<script src="{_SCRIPT_PATH}"></script>\n{own}'
    text = page(title=title, note=note, policy=policy, scripts=scripts)
    return tornado.web.Application(
        [
            ("/", _Text, {"content": text, "kind": "text/html"}),
            (_SCRIPT_PATH, _Text, {"content": viewer_library(), "kind": "text/javascript"}),
            (_SOCKET_PATH, Tab),
        ],
        hosts=hosts,
        hub=hub,
        # No line on the terminal for each request.
        log_function=lambda handler: None,
        websocket_max_message_size=1024,
    )
