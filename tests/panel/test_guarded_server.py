"""Nobody but the panel's own page reads or drives it, and that page sends sound numbers only."""

from __future__ import annotations

import contextlib
import math
import socket
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from rps_pin import InputError, RPSPinError, RPSRobot
from rps_pin.panel import BrowserPanel, RPSPanel, guarded_server

viser = pytest.importorskip("viser")
import msgspec  # noqa: E402
from websockets.exceptions import InvalidStatus  # noqa: E402
from websockets.sync import client  # noqa: E402

#: For answers of a loaded machine, s.
PATIENCE = 120.0

pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]


@pytest.fixture(scope="module")
def served() -> Iterator[BrowserPanel]:
    title = "<img src=x onerror=alert(1)>\x1b[31m"
    with BrowserPanel(RPSPanel(RPSRobot.from_preset("micro")), title=title) as panel:
        yield panel


def status(panel: BrowserPanel, path: str | None = None, *lines: str) -> int:
    """Return the status of an HTTP request with these header lines."""
    url = urlsplit(panel.url)
    assert url.port is not None
    asked = url.path if path is None else path
    with socket.create_connection(("127.0.0.1", url.port), 10) as connection:
        text = "\r\n".join([f"GET {asked} HTTP/1.1", "Connection: close", *lines, "", ""])
        connection.sendall(text.encode())
        return int(connection.recv(1000).split()[1])


def connected(panel: BrowserPanel, url: str | None = None, **options: Any) -> Any:
    """Open the WebSocket as viser's page does: at the page's address."""
    address = (panel.url if url is None else url).replace("http:", "ws:").rstrip("/")
    version = f"viser-v{viser.__version__}"
    options = {"subprotocols": [version], "max_size": None, "proxy": None} | options
    return client.connect(address, **options)


def test_the_page_is_served_to_its_own_address_only(served: BrowserPanel) -> None:
    port = urlsplit(served.url).port
    own, token = f"Host: 127.0.0.1:{port}", urlsplit(served.url).path.strip("/")
    assert len(token) >= 22  # 128 bits
    assert status(served, None, own) == 200
    assert status(served, None, f"Host: localhost:{port}") == 200
    assert status(served, None, own, f"Origin: http://127.0.0.1:{port}") == 200
    for path in ("/", "/index.html", f"/{token[:-1]}/", f"/x?{token}", f"/{token}/../"):
        assert status(served, path, own) == 403


@pytest.mark.parametrize(
    "host", ["evil.com", "evil.com:{port}", "127.0.0.1", "127.0.0.1:1", "127.0.0.1.evil.com:{port}"]
)
def test_another_name_of_this_machine_is_refused(served: BrowserPanel, host: str) -> None:
    """DNS rebinding: evil.com leads to 127.0.0.1, and the browser sends its name."""
    line = "Host: " + host.format(port=urlsplit(served.url).port)
    assert status(served, None, line) == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.com", "null", "https://127.0.0.1:{port}", "http://localhost:1", ""]
)
def test_pages_of_other_origins_are_refused(served: BrowserPanel, origin: str) -> None:
    origin = origin.format(port=urlsplit(served.url).port)
    own = f"Host: 127.0.0.1:{urlsplit(served.url).port}"
    assert status(served, None, own, f"Origin: {origin}") == 403
    assert status(served, None, own, own) == 403
    with pytest.raises(InvalidStatus) as refused:
        connected(served, additional_headers={"Origin": origin})
    assert refused.value.response.status_code == 403


def test_a_connection_needs_the_token(served: BrowserPanel) -> None:
    port = urlsplit(served.url).port
    for url in (f"http://127.0.0.1:{port}", f"http://127.0.0.1:{port}/no"):
        with pytest.raises(InvalidStatus) as refused:
            connected(served, url, origin=f"http://127.0.0.1:{port}")
        assert refused.value.response.status_code == 403


def test_unsound_numbers_do_not_arrive(served: BrowserPanel) -> None:
    handle = served._sliders["pose"][0][1]
    before = handle.value

    def send(connection: Any, **message: Any) -> None:
        connection.send(msgspec.msgpack.encode(message))

    def update(connection: Any, **updates: Any) -> None:
        send(connection, type="GuiUpdateMessage", uuid=handle._impl.uuid, updates=updates)

    origin = f"http://127.0.0.1:{urlsplit(served.url).port}"
    with connected(served, origin=origin) as page:
        assert len(page.recv(timeout=PATIENCE)) > 100  # the scene
        for value in (math.nan, math.inf, 1e308, -1e9, "abc", "230", None, [1], True, 2**62):
            update(page, value=value)
        update(page, min=-1e9)
        update(page, value=230.0, removed=True)
        send(page, type="ShareUrlRequest")
        sizes = {"part_count": 1, "size_bytes": 2**40}
        words = ("source_component_uuid", "transfer_uuid", "filename", "mime_type")
        send(page, type="FileTransferStartUpload", **dict.fromkeys(words, "x"), **sizes)
        update(page, value=(low := round(handle.min + 1.0, 3)))
        deadline = time.monotonic() + PATIENCE
        while handle.value != low and time.monotonic() < deadline:
            time.sleep(0.01)
        assert handle.value == low != before  # all before it had no effect
        assert not handle._impl.removed
        assert handle.min > 0
    assert np.isfinite(served._panel.configuration).all()


def test_a_handle_is_dragged_to_sound_places_only(served: BrowserPanel) -> None:
    gizmo, before = served._gizmo, served._panel.configuration.copy()
    name, upright = gizmo.controls[0].name, [1.0, 0.0, 0.0, 0.0]
    nan, far = math.nan, 1e9

    def send(connection: Any, kind: str, **message: Any) -> None:
        whole = {"type": f"TransformControls{kind}Message", "name": name, "owner": ""} | message
        connection.send(msgspec.msgpack.encode(whole))

    with connected(served, origin=f"http://127.0.0.1:{urlsplit(served.url).port}") as page:
        assert len(page.recv(timeout=PATIENCE)) > 100
        for wxyz, position in (
            (upright, [0.0, 0.0, nan]),
            (upright, [0.0, 0.0, far]),
            ([0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.23]),
            ([2.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.23]),
            ([nan, 0.0, 0.0, 0.0], [0.0, 0.0, 0.23]),
        ):
            send(page, "Update", wxyz=wxyz, position=position)
        send(page, "Update", name="/world", wxyz=upright, position=[0.0, 0.0, 0.23])
        send(page, "DragStart", name="/world")
        time.sleep(0.3)
        np.testing.assert_array_equal(served._panel.configuration, before)
        send(page, "DragStart")
        send(page, "Update", wxyz=upright, position=[0.0, 0.0, 0.233])
        deadline = time.monotonic() + PATIENCE
        while served._panel.pose[0] != 0.233 and time.monotonic() < deadline:
            time.sleep(0.01)
        assert served._panel.pose[0] == pytest.approx(0.233)
        send(page, "DragEnd")


def test_a_placement_is_seven_numbers() -> None:
    sound, upright = guarded_server._is_placement, (1.0, 0.0, 0.0, 0.0)
    assert sound(upright, (0.0, 1, -2.0))
    for position in ((0.0, 0.0), (0.0, 0.0, "1"), (0.0, 0.0, True), None, (0.0, 0.0, math.inf)):
        assert not sound(upright, position)
    assert not sound((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_texts_and_choices_are_short_and_known() -> None:
    sound = guarded_server._is_sound
    text = SimpleNamespace(value="")
    choice = SimpleNamespace(value="a", options=("a", "b"))
    assert sound(text, {"value": "upper"})
    assert sound(choice, {"value": "b"})
    for handle, value in ((text, "x" * 201), (text, 1.0), (text, None), (choice, "c"), (choice, 1)):
        assert not sound(handle, {"value": value})


def test_names_are_text_in_the_page(served: BrowserPanel) -> None:
    assert "&lt;img src=x onerror=alert(1)&gt;\\x1b[31m" in served._heading.content
    assert "<img" not in served._heading.content


def test_a_port_that_cannot_be_used_is_told() -> None:
    panel = RPSPanel(RPSRobot.from_preset("micro"))
    for port in (0, -1, 65536, 99999, True, "80"):
        with pytest.raises(InputError, match="it must be between 1 and 65535"):
            BrowserPanel(panel, port=port)  # type: ignore[arg-type]
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(InputError, match=f"port {port} of 127.0.0.1 cannot be used"):
            BrowserPanel(panel, port=port)


def test_a_viser_that_cannot_be_guarded_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if a later viser started its server in another way."""
    monkeypatch.setattr(guarded_server, "_in_front_of_viser", contextlib.nullcontext)
    with pytest.raises(RPSPinError, match="cannot be guarded"):
        BrowserPanel(RPSPanel(RPSRobot.from_preset("micro")))
