"""The local server, without a browser: whom it answers, what it tells, how it ends."""

import asyncio
import contextlib
import http.client
import itertools
import os
import signal
import socket
import sys
import textwrap
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import umsgpack
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from rps_pin.errors import InputError, RPSPinError
from rps_pin.viewer import LocalViewer, RawCommand, Scene, play, playback
from rps_pin.viewer.server import web
from tests.processes import start

ROOT = Path(__file__).parents[2]
PATIENCE = 120.0


UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Version": "13",
}


def port_of(viewer: LocalViewer) -> int:
    return int(viewer.url.rsplit(":", 1)[1].strip("/"))


def get(port: int, path: str = "/", **headers: str) -> tuple[int, str]:
    """Ask for a path with exactly these headers; return status and body."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    connection.putrequest("GET", path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read().decode()
    connection.close()
    return answer.status, body


def messages(viewer: LocalViewer, **headers: str) -> list[dict]:
    """Open a WebSocket as a browser does and return all that a new tab is told."""
    viewer.window.send(RawCommand({"type": "set_transform", "path": "/last"}))
    port = port_of(viewer)

    async def read() -> list[dict]:
        request = HTTPRequest(f"ws://127.0.0.1:{port}/socket", headers=headers)
        connection = await websocket_connect(request)
        told: list[dict] = []
        while not told or told[-1]["path"] != "/last":
            told.append(umsgpack.unpackb(await connection.read_message()))
        connection.close()
        while await connection.read_message() is not None:
            pass
        return told[:-1]

    return asyncio.run(asyncio.wait_for(read(), timeout=PATIENCE))


def open_files() -> int:
    return len(list(Path("/dev/fd").iterdir()))


def listening_addresses() -> set[str]:
    """Return this process's listening TCP sockets as Linux itself lists them."""
    own = {str(link.readlink()) for link in Path("/proc/self/fd").iterdir() if link.is_symlink()}
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/self/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and f"socket:[{fields[9]}]" in own:
                found.add(fields[1])
    return found


@pytest.mark.skipif(not Path("/proc/self/net/tcp").exists(), reason="needs Linux's /proc")
def test_listens_on_this_machine_only():
    before = listening_addresses()
    with LocalViewer() as viewer:
        port = port_of(viewer)
        assert listening_addresses() - before == {f"0100007F:{port:04X}"}  # 127.0.0.1
    assert listening_addresses() == before


def test_another_of_the_machines_addresses_is_refused():
    # 127.0.0.2 is this machine too (Linux), but not the address that is listened on.
    with LocalViewer() as viewer, socket.socket() as other:
        other.settimeout(5)
        with pytest.raises((ConnectionRefusedError, OSError)):
            other.connect(("127.0.0.2", port_of(viewer)))


def test_serves_the_page_and_the_library():
    with LocalViewer(title="A <robot>", note="1 & 2") as viewer:
        status, body = get(port_of(viewer))
        assert status == 200
        assert "<title>A &lt;robot&gt;</title>" in body
        assert "1 &amp; 2" in body
        status, body = get(port_of(viewer), "/meshcat.js")
        assert status == 200
        assert "MeshCat" in body
        assert get(port_of(viewer), "/etc/passwd")[0] == 404


@pytest.mark.parametrize("path", ["/", "/meshcat.js", "/socket"])
@pytest.mark.parametrize("host", ["evil.example", "evil.example:{port}", "127.0.0.1:1", "0.0.0.0"])
def test_a_foreign_host_is_refused(path, host):
    with LocalViewer() as viewer:
        port = port_of(viewer)
        status, body = get(port, path, Host=host.format(port=port))
        assert status == 403
        assert "MeshCat" not in body


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:1", "null"])
def test_a_foreign_origin_is_refused(origin):
    with LocalViewer() as viewer:
        assert get(port_of(viewer), "/", Origin=origin)[0] == 403
        assert get(port_of(viewer), "/socket", Origin=origin, **UPGRADE)[0] == 403


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_its_own_names_are_answered(name):
    with LocalViewer() as viewer:
        port = port_of(viewer)
        own = f"{name}:{port}"
        assert get(port, "/", Host=own, Origin=f"http://{own}")[0] == 200
        viewer.window.send(RawCommand({"type": "delete", "path": "/nothing"}))
        viewer.window.send(RawCommand({"type": "set_property", "path": "/a", "property": "p"}))
        told = messages(viewer, Host=own, Origin=f"http://{own}")
        assert [m["path"] for m in told] == ["/a"]


def test_a_late_tab_gets_the_whole_scene_as_it_is_now(sample):
    with LocalViewer() as viewer:
        scene = Scene(sample.model, sample.visual, viewer.window, sample.configurations[0])
        first = {m["path"]: m for m in messages(viewer) if m["type"] == "set_transform"}
        for q in sample.configurations[:1000:100]:
            scene.display(q)
        scene.display(sample.configurations[500])
        told = messages(viewer)
        kinds = {kind: sum(m["type"] == kind for m in told) for kind in {m["type"] for m in told}}
        second = {m["path"]: m for m in told if m["type"] == "set_transform"}
    assert kinds["set_object"] == 9  # six geometries, floor, grid, axes
    assert first["/world/robot/base"] == second["/world/robot/base"]
    assert first["/world/robot/rod"] != second["/world/robot/rod"]


def test_a_taken_port_is_refused_clearly():
    with LocalViewer() as viewer:
        port = port_of(viewer)
        with pytest.raises(InputError, match=f"port {port} of 127.0.0.1 cannot be used"):
            LocalViewer(port).__enter__()


@pytest.mark.parametrize("port", [0, -1, 65536])
def test_an_impossible_port_is_refused(port):
    with pytest.raises(InputError, match="between 1 and 65535"):
        LocalViewer(port)


def test_leaves_nothing_behind_and_frees_the_port():
    threads, before = threading.active_count(), open_files()
    with LocalViewer() as viewer:
        port = port_of(viewer)
        assert threading.active_count() == threads + 1
    assert threading.active_count() == threads
    assert open_files() == before
    with LocalViewer(port) as again:
        assert port_of(again) == port


def silent_tab(port: int) -> socket.socket:
    """Open a WebSocket that is never read from."""
    tab = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
    headers = {"Host": f"127.0.0.1:{port}", **UPGRADE}
    lines = ["GET /socket HTTP/1.1", *(f"{name}: {value}" for name, value in headers.items())]
    tab.sendall("\r\n".join([*lines, "", ""]).encode())
    assert b" 101 " in tab.recv(15)
    return tab


def test_ends_with_a_silent_tab_still_open():
    """A tab that never answers the goodbye must not keep the server."""
    before = open_files()
    with LocalViewer() as viewer, silent_tab(port_of(viewer)):
        start = time.monotonic()
        viewer.__exit__(None, None, None)
        assert time.monotonic() - start < PATIENCE
    assert open_files() == before


def test_a_tab_that_stops_reading_is_cut_off(monkeypatch):
    monkeypatch.setattr(web, "_MOST_UNSENT", 100)
    with LocalViewer() as viewer, silent_tab(port_of(viewer)) as tab:
        heavy = {"type": "set_property", "path": "/a", "property": "p", "value": "x" * 100_000}
        for _ in range(1000):  # far more than the system's own buffers hold
            viewer.window.send(RawCommand(heavy))
        received = 0
        with contextlib.suppress(ConnectionResetError):
            while part := tab.recv(1_000_000):
                received += len(part)
        assert received < 90_000_000
        # Others are served as before.
        assert [m["path"] for m in messages(viewer)] == ["/a"]


def test_outside_its_block_it_says_so():
    viewer = LocalViewer()
    with pytest.raises(RPSPinError, match="not running"):
        _ = viewer.url
    with pytest.raises(RPSPinError, match="not running"):
        viewer.window.send(RawCommand({"type": "delete", "path": "/a"}))
    with viewer:
        pass
    with pytest.raises(RPSPinError, match="make a new one"):
        viewer.__enter__()


def test_play_follows_the_clock_in_a_loop_until_stopped(sample, monkeypatch):
    # A clock that goes on by 21 ms each time it is read: at the start, and before each picture.
    clock = itertools.count(7.0, 0.021)
    monkeypatch.setattr(playback, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    shown: list[np.ndarray] = []

    class Watching(Scene):
        def display(self, q):
            shown.append(np.array(q))
            if len(shown) == 30:
                stop.set()

    stop = threading.Event()
    with LocalViewer() as viewer:
        scene = Watching(sample.model, sample.visual, viewer.window, sample.configurations[0])
        # A motion of 0.4 s: 30 pictures pass its end once.
        play(scene, sample.times / 5.0, sample.configurations, stop, frame_rate=1000.0)
    slide = sample.model.joints[sample.model.getJointId("slide")].idx_q
    elapsed = (0.021 * np.arange(1, 31)) % 0.4
    expected = 0.05 * (1.0 - np.cos(np.pi * elapsed * 5.0))
    np.testing.assert_allclose([q[slide] for q in shown], expected, atol=1e-6)


def test_a_single_pose_is_played_by_standing_still(sample):
    stop = threading.Event()
    timer = threading.Timer(0.2, stop.set)
    with LocalViewer() as viewer:
        scene = Scene(sample.model, sample.visual, viewer.window, sample.configurations[0])
        start = time.monotonic()
        timer.start()
        play(scene, [0.0], sample.configurations[500:501], stop)
        assert 0.1 < time.monotonic() - start < 60.0


PROGRAM = """
import numpy as np, pinocchio as pin
from rps_pin.viewer import LocalViewer, Scene, play

urdf = '''<robot name="r"><link name="a"/><link name="b"><visual><geometry>
  <box size="1 1 1"/></geometry></visual></link>
  <joint name="j" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
  <limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>'''
model = pin.buildModelFromXML(urdf)
visual = pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.VISUAL)
try:
    with LocalViewer() as viewer:
        print(viewer.url, flush=True)
        qs = [[0.0], [1.0]]
        play(Scene(model, visual, viewer.window, qs), [0.0, 1.0], qs)
except KeyboardInterrupt:
    print("ended", flush=True)
raise SystemExit(0)  # as in test_live_view.py
"""


def test_ctrl_c_ends_it_cleanly():
    process = start(
        [sys.executable, "-c", textwrap.dedent(PROGRAM)],
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
    )
    try:
        address = process.stdout.readline().strip()
        port = int(address.rsplit(":", 1)[1].strip("/"))
        assert get(port)[0] == 200
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
        process.communicate()
    assert (process.returncode, out, err) == (0, "ended\n", "")
    with LocalViewer(port) as viewer:
        assert port_of(viewer) == port
