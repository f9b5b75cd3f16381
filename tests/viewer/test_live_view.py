"""The view of a running loop: what it shows, whom it serves, and how it ends in every case."""

import asyncio
import contextlib
import gc
import itertools
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from multiprocessing import active_children, get_context
from pathlib import Path

import numpy as np
import pytest
import umsgpack
from tornado.websocket import websocket_connect

from rps_pin import RPSRobot
from rps_pin.errors import InputError, RPSPinError
from rps_pin.viewer import LiveView, LocalViewer, Recorder, Scene
from rps_pin.viewer.server import live_view
from tests.processes import start
from tests.quick import quick

POSE = (0.22, 0.0, 0.0)
PLATFORM = "/world/robot/platform"
PATIENCE = 300.0
needs_proc = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs Linux's /proc")


@pytest.fixture(scope="module")
def robot() -> RPSRobot:
    return RPSRobot.from_preset("micro")


@pytest.fixture(scope="module")
def view(robot) -> Iterator[LiveView]:
    """One view for all tests that leave it as it is: each start takes seconds."""
    with LiveView(robot, POSE, title="Watched <loop>", rate=100.0) as running:
        yield running


def told(view: LiveView, enough: Callable[[list[dict]], bool]) -> list[dict]:
    """Open a tab and return what it is told until that is enough."""

    async def read() -> list[dict]:
        connection = await websocket_connect(f"{view.url.replace('http', 'ws')}socket")
        messages: list[dict] = []
        while not enough(messages):
            messages.append(umsgpack.unpackb(await connection.read_message()))
        connection.close()
        while await connection.read_message() is not None:
            pass
        return messages

    return asyncio.run(asyncio.wait_for(read(), timeout=PATIENCE))


def placed(messages: list[dict], path: str) -> np.ndarray | None:
    """Return the last transform of a path, (4, 4)."""
    found = [m for m in messages if m["type"] == "set_transform" and m["path"] == path]
    return np.reshape(found[-1]["matrix"], (4, 4)).T if found else None


def platform(robot: RPSRobot, pose) -> np.ndarray:
    """Return the platform's placement by its closed form, (4, 4)."""
    position, rotation = robot.platform_placement(pose)
    return np.block([[rotation, np.reshape(position, (3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]])


def waits_until(condition: Callable[[], bool]) -> bool:
    """Return whether a condition comes true at last."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def shows(view: LiveView, expected: np.ndarray) -> bool:
    """Return whether the platform comes to stand where it is expected."""

    def there(messages: list[dict]) -> bool:
        at = placed(messages, PLATFORM)
        return at is not None and np.allclose(at, expected, rtol=0.0, atol=1e-12)

    return there(told(view, there))


# What is shown ------------------------------------------------------------------------------------


def test_the_scene_follows_the_newest_pose(view, robot):
    random = np.random.default_rng(5)
    for _ in range(5):
        pose = random.uniform([0.215, -0.1, -0.1], [0.235, 0.1, 0.1])
        for k in range(200):  # only the last one is to stay
            view.show((0.21 + 1e-5 * k, 0.0, 0.0))
        view.show(pose)
        assert shows(view, platform(robot, pose))


def test_the_robot_is_drawn_as_it_is(view, robot):
    still = np.zeros(3)
    recorder = Recorder()
    Scene(
        robot.mechanism.model,
        robot.visual_model(),
        recorder,
        robot.state(POSE, still, still)[0],
    )
    own = {
        m["path"]: {k: v for k, v in m["object"]["geometries"][0].items() if k != "uuid"}
        for m in recorder.messages
        if m["type"] == "set_object" and m["path"].startswith("/world/robot")
    }
    shown: dict[str, dict] = {}

    def all_there(messages: list[dict]) -> bool:
        for m in messages[-1:]:
            if m["type"] == "set_object" and m["path"] in own:
                geometry = m["object"]["geometries"][0]
                shown[m["path"]] = {k: v for k, v in geometry.items() if k != "uuid"}
        return shown.keys() == own.keys()

    told(view, all_there)
    assert len(own) > 10
    assert shown == own


def test_a_pose_beyond_the_limits_is_shown(view, robot):
    beyond = (0.4, 0.0, 0.0)  # the legs reach 0.25 m
    with pytest.raises(RPSPinError, match="out of reach"):
        robot.state(beyond, np.zeros(3), np.zeros(3))
    view.show(beyond)
    assert shows(view, platform(robot, beyond))


@pytest.mark.parametrize(
    "pose",
    [
        (np.nan, 0.0, 0.0),
        (0.22, np.inf, 0.0),
        (0.0, 0.0, 0.0),
        (0.22, 1e200, 1e200),
        (1e308, 1e308, 1e308),
    ],
)
def test_a_pose_that_cannot_be_shown_is_left_out(view, robot, pose):
    view.show(pose)
    time.sleep(0.1)  # ten pictures
    assert view.alive
    view.show((0.225, 0.03, 0.0))
    assert shows(view, platform(robot, (0.225, 0.03, 0.0)))


def test_the_title_is_on_the_page(view):
    from urllib.request import urlopen

    with urlopen(view.url, timeout=PATIENCE) as answer:
        assert "<title>Watched &lt;loop&gt;</title>" in answer.read().decode()


@needs_proc
def test_listens_on_this_machine_only(view):
    process = Path(f"/proc/{view._process.pid}")
    own = {str(link.readlink()) for link in (process / "fd").iterdir()}
    found = set()
    for table in ("tcp", "tcp6"):
        for line in (process / "net" / table).read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and f"socket:[{fields[9]}]" in own:
                found.add(fields[1])
    port = int(view.url.rsplit(":", 1)[1].strip("/"))
    assert view.url == f"http://127.0.0.1:{port}/"
    assert found == {f"0100007F:{port:04X}"}


# The shared memory --------------------------------------------------------------------------------


def slot_of(view: LiveView) -> memoryview:
    return memoryview(view._slot).cast("B")


def test_the_slot_holds_the_newest_pose_and_counts_the_writes(robot):
    quiet = LiveView(robot, POSE)
    assert live_view._newest(slot_of(quiet)) == (1.0, POSE)
    random = np.random.default_rng(11)
    for k in range(1000):
        pose = random.standard_normal(3) * 10.0 ** random.integers(-9, 9)
        quiet.show(pose if k % 2 else list(pose))
        assert live_view._newest(slot_of(quiet)) == (k + 2.0, tuple(pose))


def test_a_half_written_pose_is_told_from_a_whole_one(robot):
    quiet = LiveView(robot, POSE)
    random = np.random.default_rng(13)
    memory = slot_of(quiet)
    size = len(memory)
    for _ in range(50):
        quiet.show(random.standard_normal(3))
        old = bytes(memory)
        quiet.show(random.standard_normal(3))
        new = bytes(memory)
        for cut in range(size + 1):
            for mixed in (new[:cut] + old[cut:], old[:cut] + new[cut:]):
                memory[:] = mixed
                assert (live_view._newest(memory) is None) == (mixed not in (old, new))
            if 0 < cut < size:  # a copy that clears the memory first
                memory[:] = new[:cut] + bytes(size - cut)
                assert live_view._newest(memory) is None
    memory[:] = bytes(size)
    assert live_view._newest(memory) is None


def write_always(slot) -> None:
    """Write poses whose numbers agree, as `LiveView.show` does, in another process."""
    writer = LiveView.__new__(LiveView)
    writer._memory = memoryview(slot).cast("B")
    writer._count = 0.0
    for k in itertools.count(1):
        writer.show((float(k), float(k), float(k)))


def test_no_pose_is_torn_while_another_process_writes(robot):
    context = get_context("spawn")
    quiet = LiveView(robot, (1.0, 1.0, 1.0))
    memory = slot_of(quiet)
    writer = context.Process(target=write_always, args=(quiet._slot,), daemon=True)
    writer.start()
    reads, numbers = 0, set()
    deadline = time.monotonic() + PATIENCE
    try:
        # Thirty turns on one core, where the two alternate; many reads where they do not.
        while (len(numbers) < 30 or reads < 200_000) and time.monotonic() < deadline:
            newest = live_view._newest(memory)
            if newest is not None:
                count, pose = newest
                assert pose == (count, count, count)
                numbers.add(count)
                reads += 1
    finally:
        writer.terminate()
        writer.join()
    assert len(numbers) >= 30


@pytest.mark.parametrize("pose", [None, (1.0, 2.0), np.zeros(4), np.zeros((3, 3)), ("a", "b", "c")])
def test_what_is_no_pose_is_refused_and_the_last_one_stays(robot, pose):
    quiet = LiveView(robot, POSE)
    with pytest.raises(InputError, match="three numbers"):
        quiet.show(pose)
    assert live_view._newest(slot_of(quiet)) == (1.0, POSE)


# How it starts and ends ---------------------------------------------------------------------------


def test_leaves_nothing_behind_even_after_a_crash_of_the_loop(robot):
    def open_files() -> int:
        gc.collect()  # what other tests left to the collector may be closed meanwhile
        return len(list(Path("/dev/fd").iterdir()))

    LiveView(robot, POSE)  # multiprocessing's own helper and first arena stay open
    counts = []
    for _ in range(3):
        with pytest.raises(ZeroDivisionError), LiveView(robot, POSE) as running:
            pid = running._process.pid
            1 / 0  # noqa: B018
        assert not running.alive
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
        del running
        counts.append(open_files())
    # What is left behind is left each time; multiprocessing may open a file of its own once.
    assert counts[2] < counts[0] + 2, counts


def test_a_crash_of_the_viewer_leaves_the_loop_alone(robot):
    with LiveView(robot, POSE) as running:
        os.kill(running._process.pid, signal.SIGKILL)
        running._process.join(PATIENCE)
        assert not running.alive
        for k in range(1000):
            running.show((0.22, 1e-4 * k, 0.0))
    assert running._process not in active_children()


def test_a_taken_port_is_told_of(robot):
    before = active_children()
    with LocalViewer() as other:
        port = int(other.url.rsplit(":", 1)[1].strip("/"))
        with pytest.raises(RPSPinError, match=f"port {port} of 127.0.0.1 cannot be used"):
            LiveView(robot, POSE, port=port).__enter__()
    assert active_children() == before


def test_a_view_runs_once(view):
    with pytest.raises(RPSPinError, match="make a new one"):
        view.__enter__()
    assert view.alive


@pytest.mark.parametrize(
    ("pose", "why"),
    [
        ((0.22, 0.0), r"pose has shape \(2,\); it must be \(3,\)"),
        (np.full(3, np.nan), "pose is not finite: entry 0 is nan"),
        ((np.inf, 0.0, 0.0), "pose is not finite: entry 0 is inf"),
    ],
)
def test_a_first_pose_that_is_none_is_refused(robot, pose, why):
    with pytest.raises(InputError, match=why):
        LiveView(robot, pose)


@pytest.mark.parametrize("rate", [0.0, -30.0, np.nan, np.inf])
def test_an_impossible_rate_is_refused(robot, rate):
    with pytest.raises(InputError, match="rate ="):
        LiveView(robot, POSE, rate=rate)


def test_what_is_no_robot_is_refused(robot):
    with pytest.raises(InputError, match="RPSParameters"):
        LiveView(robot.parameters, POSE)


SCRIPT = """
    import gc
    import os
    import sys

    from rps_pin import RPSRobot
    from rps_pin.control.loop.clock import LoopClock
    from rps_pin.viewer import LiveView

    if __name__ == "__main__":
        try:
            robot = RPSRobot.from_preset("micro")
            print("begins", flush=True)
            with LiveView(robot, (0.22, 0.0, 0.0)) as view, LoopClock(2e-3) as clock:
                print("runs", view._process.pid, flush=True)
                for k in clock.ticks():
                    view.show((0.22, 1e-6 * k, 0.0))
        except KeyboardInterrupt:
            print("stopped", gc.isenabled(), gc.get_freeze_count(), flush=True)
        # Without this, CPython ends with SIGINT's status where Ctrl-C came in an exec of a text, as
        # in an import of a dataclass, though the exception was caught.
        sys.exit(0)
"""


@pytest.fixture
def script(tmp_path) -> Iterator[subprocess.Popen]:
    """A loop with a view, as a terminal starts it: in a process group of its own."""
    path = tmp_path / "loop.py"
    path.write_text(textwrap.dedent(SCRIPT))
    with start([sys.executable, path], process_group=0) as process:
        yield process
        if group_lives(process.pid):
            os.killpg(process.pid, signal.SIGKILL)


def group_lives(group: int) -> bool:
    """Return whether a process of a group runs; those that only wait to be counted do not."""
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            # After the name, which may hold spaces: state, parent, group.
            state, _, its_group = (process / "stat").read_text().rsplit(")", 1)[1].split()[:3]
            if int(its_group) == group and state not in "ZX":
                return True
    return False


@needs_proc
@pytest.mark.parametrize(
    ("word", "pause"),
    quick([("begins", 0.0), ("begins", 0.4), ("runs", 0.2)], [("begins", 0.0), ("runs", 0.2)]),
)
def test_ctrl_c_ends_both_cleanly(script, word, pause):
    while not script.stdout.readline().startswith(word):
        assert script.poll() is None
    time.sleep(pause)
    os.killpg(script.pid, signal.SIGINT)  # what a terminal does: to both processes
    out, err = script.communicate(timeout=PATIENCE)
    assert out.splitlines()[-1] == "stopped True 0"
    assert err == ""
    assert script.returncode == 0
    assert waits_until(lambda: not group_lives(script.pid))


@needs_proc
def test_the_view_ends_with_a_loop_that_is_killed(script):
    while not (line := script.stdout.readline()).startswith("runs"):
        assert script.poll() is None
    os.kill(int(line.split()[1]), 0)  # it is there
    script.kill()
    script.communicate(timeout=PATIENCE)
    assert waits_until(lambda: not group_lives(script.pid))
