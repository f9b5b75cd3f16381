"""viser's server behind the checks of the Meshcat server: Host, Origin, a token in the address.

viser lets any page of any site connect, and takes any message. Here its HTTP and WebSocket
server asks `Guard` first, and messages from a page are checked before viser sees them.
"""

from __future__ import annotations

import contextlib
import functools
import hmac
import http
import io
import logging
import math
import secrets
import threading
from collections.abc import Callable, Iterator
from typing import Any

from rps_pin.errors import RPSPinError
from rps_pin.viewer.server.local_only import HOST, REFUSAL, is_foreign, listener, local_hosts

_LARGEST_MESSAGE = 64 * 1024
"""Bytes of a message from a page, which sends cameras and numbers."""
_LONGEST_TEXT = 200
"""Characters."""
_FARTHEST = 1e4
"""Of a handle that is dragged, m."""
_STARTING = threading.Lock()
_SILENT = logging.getLogger("rps_pin.panel")
"""No lines on the terminal for connections that fail."""
_SILENT.addHandler(logging.NullHandler())
_SILENT.propagate = False


class Guard:
    """Answer requests in place of viser: 403 for those without the token or from other sites.

    The page's address is ``/TOKEN/``. viser's page has no further files, and opens its WebSocket
    at ``/TOKEN``.
    """

    def __init__(self) -> None:
        self.token = secrets.token_urlsafe(24)
        self.installed = False

    def answer(self, others: Callable[..., Any], connection: Any, request: Any) -> Any:
        """Return a refusal, or viser's own answer (None: it is a WebSocket)."""
        headers = request.headers
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        port: int = connection.local_address[1]
        path, _, query = request.path.partition("?")
        own = hmac.compare_digest(path.strip("/").encode(), self.token.encode())
        if not own or is_foreign(hosts, origins, local_hosts(port)):
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"{REFUSAL}\n")
        request.path = f"/?{query}"
        return others(connection, request)


def guarded_server(
    port: int | None, refused: Callable[[Any, float], object] | None = None
) -> tuple[Any, str]:
    """Return a ``viser.ViserServer`` on a port, and its address; default: a free one from 8080 on.

    `refused` is told a number beyond its slider that the page sends, in viser's thread.

    Raises
    ------
    InputError
        If the port is not between 1 and 65535, or cannot be listened on.
    RPSPinError
        If viser is not installed, or starts its server in a way that cannot be guarded.
    """
    try:
        import viser  # noqa: PLC0415
    except ImportError:
        raise RPSPinError("the panel needs viser: pip install 'rps-pin[panel]'") from None
    if port is not None:
        listener(port).close()  # viser would take another one
    guard = Guard()
    # viser prints its address.
    with _in_front_of_viser(guard), contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=HOST, port=port or 8080, verbose=False)
    try:
        if not guard.installed:
            raise RPSPinError(f"viser {viser.__version__} cannot be guarded: use viser 1.1")
        _check_messages(server, refused)
        # A page can ask viser for a tunnel to the internet: not from here.
        server.request_share_url = lambda *_, **__: None  # type: ignore[method-assign]
    except BaseException:
        stop(server)
        raise
    return server, f"http://{HOST}:{server.get_port()}/{guard.token}/"


def stop(server: Any) -> None:
    """End a viser server."""
    with contextlib.redirect_stdout(io.StringIO()):  # viser prints that it stops
        server.stop()


@contextlib.contextmanager
def _in_front_of_viser(guard: Guard) -> Iterator[None]:
    """Let the server that viser starts meanwhile ask the guard."""
    import websockets.asyncio.server as servers  # noqa: PLC0415 (of viser)

    serve: Any = servers.serve

    def guarded(handler: Any, *others: Any, **options: Any) -> Any:
        if handler.__module__.partition(".")[0] == "viser" and options.get("process_request"):
            guard.installed = True
            asked = functools.partial(guard.answer, options["process_request"])
            options |= {"process_request": asked, "max_size": _LARGEST_MESSAGE, "logger": _SILENT}
        return serve(handler, *others, **options)

    with _STARTING:
        servers.serve = guarded  # type: ignore[assignment, misc]
        try:
            yield
        finally:
            servers.serve = serve  # type: ignore[misc]


def _check_messages(server: Any, refused: Callable[[Any, float], object] | None) -> None:
    """Let only messages through that a page of the panel sends, with finite numbers in range."""
    from viser import _messages as messages  # noqa: PLC0415

    inputs = server.gui._gui_input_handle_from_uuid
    controls = server.scene._handle_from_transform_controls_name
    starts_or_ends = (
        messages.TransformControlsDragStartMessage,
        messages.TransformControlsDragEndMessage,
    )

    def may_pass(message: Any) -> bool:
        if isinstance(message, messages.GuiUpdateMessage):
            handle = inputs.get(message.uuid)
            if _is_sound(handle, message.updates):
                return True
            if refused and _is_beyond(handle, message.updates):
                refused(handle, float(message.updates["value"]))
            return False
        if isinstance(message, messages.TransformControlsUpdateMessage):
            return message.name in controls and _is_placement(message.wxyz, message.position)
        if isinstance(message, starts_or_ends):
            return message.name in controls
        return isinstance(message, messages.ViewerCameraMessage)

    def check(connections: Any) -> None:
        deliver = connections._handle_incoming_message

        async def checked(client: Any, message: Any) -> None:
            if may_pass(message):
                await deliver(client, message)

        connections._handle_incoming_message = checked

    check(server._websock_server)  # of all pages
    server._websock_server.on_client_connect(check)  # and of each


def _is_sound(handle: Any, updates: Any) -> bool:
    """Return whether a page may set an input so.

    A switch to true or false, a choice to one of its options, a text to a short one, a slider in
    range.
    """
    if handle is None or not isinstance(updates, dict) or set(updates) != {"value"}:
        return False
    value = updates["value"]
    if isinstance(handle.value, bool) or isinstance(value, bool):
        return isinstance(handle.value, bool) and isinstance(value, bool)
    if isinstance(handle.value, str):
        options = getattr(handle, "options", None)
        return isinstance(value, str) and (
            len(value) <= _LONGEST_TEXT if options is None else value in options
        )
    if not _is_number(value):
        return False
    low, high = getattr(handle, "min", math.nan), getattr(handle, "max", math.nan)
    return bool(low <= value <= high)  # not of a NaN


def _is_beyond(handle: Any, updates: Any) -> bool:
    """Return whether a page sets a slider to a number beyond it."""
    if not isinstance(updates, dict) or set(updates) != {"value"} or not hasattr(handle, "min"):
        return False
    value = updates["value"]
    return _is_number(value) and math.isfinite(value) and not _is_sound(handle, updates)


def _is_placement(wxyz: Any, position: Any) -> bool:
    """Return whether numbers are a quaternion of unit length, and a position not too far away."""
    if not all(isinstance(part, list | tuple) for part in (wxyz, position)):
        return False
    if (len(wxyz), len(position)) != (4, 3) or not all(map(_is_number, (*wxyz, *position))):
        return False
    near = all(abs(one) <= _FARTHEST for one in position)
    return near and abs(math.hypot(*wxyz) - 1.0) < 1e-3


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
