"""The examples as people run them: what they print and write, how they end, what they leave."""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import runpy
import signal
import socket
import struct
import subprocess
import sys
import time
import urllib.request
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.control import ComputedTorque, Gains
from rps_pin.trajectories import PathSample, circle
from tests.processes import start, wait_for_work
from tests.worst import worst

EXAMPLES = Path(__file__).parent.parent / "examples"
NAMES = sorted(path.name for path in EXAMPLES.glob("*.py"))
PATIENCE = 120.0
#: A variable of the environment, by which an example's processes are found.
MARK = "RPS_PIN_TEST_MARK"
#: Of every example; the path turns once a second.
TILT, HEIGHT, REST, PERIOD = 0.1, 0.223, 0.5, 1e-3

pytestmark = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs /proc")


class Example:
    """Starts an example; what it starts in turn can be found by a mark in its environment."""

    def __init__(self, folder: Path) -> None:
        self.mark, self._folder = uuid.uuid4().hex, folder
        self.process: subprocess.Popen[str] | None = None

    def start(self, name: str, *options: str) -> subprocess.Popen[str]:
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", MARK: self.mark}
        self.process = start(
            [sys.executable, EXAMPLES / name, *options],
            cwd=self._folder,
            env=environment,
            stdin=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # as in a terminal of its own, for its Ctrl-C
        )
        return self.process

    def run(self, name: str, *options: str) -> str:
        """Run to the end, which must be a good one, and return what it printed."""
        printed, _ = self.start(name, *options).communicate(timeout=PATIENCE)
        assert self.process is not None
        assert self.process.returncode == 0, printed
        return printed

    def alive(self) -> list[int]:
        """Return the ids of its processes."""
        found = []
        for path in Path("/proc").glob("[0-9]*/environ"):
            try:
                # One that has ended, and is not yet waited for, has no environment any more.
                if self.mark.encode() in path.read_bytes():
                    found.append(int(path.parent.name))
            except OSError:  # ended meanwhile, or somebody else's
                continue
        return found

    def gone(self) -> bool:
        """Return whether all its processes end."""
        return waits_until(lambda: not self.alive())


@pytest.fixture
def example(tmp_path) -> Iterator[Example]:
    running = Example(tmp_path)
    yield running
    for process in running.alive():
        os.kill(process, signal.SIGKILL)
    if running.process is not None:
        running.process.communicate()


def waits_until(condition: Callable[[], bool]) -> bool:
    """Return whether a condition comes true at last."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def at_most(printed: str, what: str) -> float:
    """Return the largest error that was printed, in m or rad."""
    found = re.search(rf"{what} error: .*at most (\S+) u", printed)
    assert found, printed
    return 1e-6 * float(found[1])


def largest_tilt_error(duration: float) -> float:
    """Return a bound of the tilt's error with computed torque, rad, from the loop's equation.

    Inertia that is a share s more than believed leaves, where the target accelerates by a,
    (1 + s) e'' + Kd e' + Kp e + integral = s a. Without integral a step of s a goes to s a / Kp;
    with it, there and back to nothing, which makes at most twice that for any a of that size.
    """
    path = circle(height=HEIGHT, tilt=TILT, turns=duration, duration=duration)
    acceleration = path.sample(np.linspace(0.0, duration, 1000)).acceleration[:, 1:]
    stiffness = Gains.placed(15.0).rows[0][0]
    return float(2 * 0.2 * np.linalg.norm(acceleration, axis=1).max() / stiffness)


def test_there_is_an_example_of_each_kind_and_a_page_that_names_it():
    loops = ["control_loop.py", "drive_over_socket.py", "logging_and_live_view.py"]
    assert [*loops, "plan_swing.py", "standing.py"] == NAMES
    page = (EXAMPLES / "README.md").read_text("utf-8")
    assert all(name in page for name in NAMES)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "standing.py"])
@pytest.mark.parametrize("duration", ["0", "-1", "nan", "inf"])
def test_an_impossible_duration_is_wrong_usage(name, duration, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [name, "--duration", duration])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    assert ended.value.code == 2
    assert "it must be a positive time" in capsys.readouterr().err


def test_the_control_loop_follows_its_path(example):
    printed = example.run("control_loop.py", "--duration", "0.4")
    assert "OK: 900 ticks" in printed  # and nothing else was said
    bound = largest_tilt_error(0.4)
    assert 0.0 < at_most(printed, "tilt") <= bound
    # The centre goes sideways by h tilt^2 / 4: a tilt that is wrong moves it by at most
    # h tilt / 2 times that; as much again for its height, which the tilt's forces disturb.
    h = RPSRobot.from_preset("micro").parameters.platform_radius
    assert 0.0 < at_most(printed, "centre") <= h * TILT * bound
    assert "900 ticks of 1 ms" in printed


def test_ctrl_c_ends_the_loop_and_its_view_and_leaves_the_log(example, tmp_path):
    process = example.start("logging_and_live_view.py", "--duration", "60")
    url = process.stdout.readline().split()[-1]
    with urllib.request.urlopen(url, timeout=PATIENCE) as page:
        assert page.status == 200
    wait_for_work(process.pid, 0.5)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all of them
    printed, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, printed
    assert "Traceback" not in printed
    assert example.gone()

    ticks = int(re.search(r"Ctrl-C: (\d+) ticks are logged", printed)[1])
    table = np.genfromtxt(tmp_path / "log" / "loop.csv", delimiter=",", names=True)
    assert table.size == ticks > 0
    np.testing.assert_allclose(table["time_s"], PERIOD * np.arange(ticks), atol=1e-12)
    assert not table["status"].any()
    # What is logged belongs together: the pose's legs are as long as was read.
    pose = np.stack([table[f"estimate_{name}"] for name in ("z_m", "tilt_x_rad", "tilt_y_rad")], 1)
    length = np.stack([table[f"reading_{leg}_m"] for leg in (1, 2, 3)], 1)
    legs = RPSRobot.from_preset("micro").inverse_kinematics(pose)
    np.testing.assert_allclose(legs.length, length, rtol=0.0, atol=1e-9)
    with Image.open(tmp_path / "log" / "loop.png") as picture:
        assert len(picture.convert("L").getcolors()) > 2  # drawn upon
    assert sorted(path.name for path in (tmp_path / "log").iterdir()) == ["loop.csv", "loop.png"]


def test_lost_packets_are_bridged_and_ctrl_c_ends_the_controller_and_its_drive(example):
    # However slow this machine is, the drive is not to give up.
    options = ("--duration", "60", "--loss", "0.05", "--watchdog", "30")
    process = example.start("drive_over_socket.py", *options)
    assert "the drive is at" in process.stdout.readline()
    assert len(example.alive()) == 2
    wait_for_work(process.pid, 0.5)
    os.killpg(process.pid, signal.SIGINT)
    printed, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, printed
    assert "Ctrl-C" in printed
    assert "Traceback" not in printed
    assert example.gone()

    ticks, lost = map(int, re.search(r"(\d+) ticks, (\d+) readings lost", printed).groups())
    assert lost > 0
    assert abs(lost - 0.05 * ticks) <= 4 * np.sqrt(0.05 * 0.95 * ticks) + 1
    held = int(re.search(r"held in (\d+) of them", printed)[1])
    assert held >= lost - 1  # a reading that is lost has no answer
    # The answers of a busy machine are late, by nobody knows how much: it follows, that is all.
    if ticks > REST / PERIOD + 1:
        assert 0.0 < at_most(printed, "tilt") <= 0.1 * TILT


class Drive:
    """The drive, and the protocol as its page says it, read and written here anew."""

    def __init__(self, line: socket.socket, example: Example, *options: str) -> None:
        self._line = line
        self._line.bind(("127.0.0.1", 0))
        self._line.settimeout(PATIENCE)
        port = str(self._line.getsockname()[1])
        self.process = example.start("drive_over_socket.py", "--drive", port, *options)

    def read(self) -> tuple[int, float, int, np.ndarray]:
        packet, self._address = self._line.recvfrom(1000)
        assert len(packet) == 41
        sequence, at, state = struct.unpack("<QdB", packet[:17])
        return sequence, at, state, np.frombuffer(packet[17:], "<f8")

    def reads(self, state: int) -> tuple[int, float, int, np.ndarray]:
        """Read until it is in a state, which comes after the one it is in."""
        while (reading := self.read())[2] < state:
            pass
        return reading

    def send(self, sequence: int, at: float, *force: float) -> None:
        self.send_packet(struct.pack("<Qd3d", sequence, at, *force))

    def send_packet(self, packet: bytes) -> None:
        self._line.sendto(packet, self._address)


@pytest.fixture
def line() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        yield opened


def test_the_drive_keeps_to_its_protocol(example, line):
    drive = Drive(line, example, "--watchdog", "0.1")
    sequence, at, state, start = drive.read()
    assert (sequence, at, state) == (0, 0.0, 0)
    # Nothing of this is a command: its brakes stay on.
    drive.send(sequence, at, np.nan, 5.0, 5.0)
    drive.send(sequence, at, np.inf, 5.0, 5.0)
    drive.send(sequence, np.nan, 5.0, 5.0, 5.0)
    drive.send(sequence, 1e6, 5.0, 5.0, 5.0)
    drive.send_packet(b"")
    drive.send_packet(struct.pack("<Qd4d", 0, 0.0, 5.0, 5.0, 5.0, 5.0))
    for k in range(1, 20):
        sequence, at, state, length = drive.read()
        assert (sequence, state) == (k, 0)
        assert at == pytest.approx(k * PERIOD)
        np.testing.assert_allclose(length, start, atol=3e-7)  # noise and steps of the encoders
    # The first command is taken, and those that are not newer are not: 8 N lift it, 0 N would not.
    drive.send(sequence, at, 8.0, 8.0, 8.0)
    drive.send(sequence, at, 0.0, 0.0, 0.0)
    drive.send(sequence - 1, at, 0.0, 0.0, 0.0)
    first, *_ = drive.reads(1)
    for _ in range(50):
        drive.send(sequence, at, 0.0, 0.0, 0.0)
        now, _, state, length = drive.read()
        assert state == 1
    assert now > first
    assert (length > start + 1e-4).all()
    # None of these answered a newer reading: it gives up 0.1 s after the one that was answered.
    for _ in range(1000):
        drive.send(sequence, at, 8.0, 8.0, 8.0)
        now, when, state, length = drive.read()
        if state != 1:
            break
    assert state == 2
    assert when == pytest.approx(at + 0.1, abs=1.5 * PERIOD)
    # Safe, for good.
    for _ in range(20):
        drive.send(now, when, 8.0, 8.0, 8.0)
        now, when, state, stays = drive.read()
        assert state == 2
        np.testing.assert_allclose(stays, length, atol=3e-7)
    printed, _ = drive.process.communicate(timeout=PATIENCE)  # ends its standard input
    assert drive.process.returncode == 0
    assert "no answer for 0.1 s" in printed
    assert example.gone()


class Controller:
    """The controller's loop in this process, with a drive whose readings have all been sent."""

    def __init__(self, line: socket.socket, ticks: int) -> None:
        self._line, self._drive = line, socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._drive.bind(("127.0.0.1", 0))
        self._drive.setblocking(False)
        line.bind(("127.0.0.1", 0))
        self._robot = RPSRobot.from_preset("micro")
        self.pose = np.array([HEIGHT, TILT, 0.0])
        still = np.zeros((ticks, 3))
        self._targets = PathSample(still + self.pose, still, still)
        self.reached = np.full((ticks, 3), np.nan)

    def follow(self, *packets: bytes, loss: float = 0.0) -> str:
        """Return what the loop makes of packets, all there from the beginning."""
        for packet in packets:
            self._drive.sendto(packet, self._line.getsockname())
        controller = ComputedTorque(self._robot, self.pose, Gains.placed(15.0, integral=0.2))
        example = runpy.run_path(str(EXAMPLES / "drive_over_socket.py"))
        args = argparse.Namespace(loss=loss, silent_from=np.inf)
        return example["follow"](self._line, controller, self._targets, self.reached, args)

    def reading(self, sequence: int, state: int = 1) -> bytes:
        length = self._robot.inverse_kinematics(self.pose).length
        return struct.pack("<QdB3d", sequence, PERIOD * sequence, state, *length)

    def answers(self) -> list[tuple[float, ...]]:
        """Return the commands that were sent."""
        found = []
        with contextlib.suppress(BlockingIOError):
            while True:
                packet = self._drive.recv(1000)
                assert len(packet) == 40
                found.append(struct.unpack("<Qd3d", packet))
        return found

    def close(self) -> None:
        self._drive.close()


@pytest.fixture
def controller(line) -> Iterator[Controller]:
    made = Controller(line, ticks=10)
    yield made
    made.close()


def test_the_controller_answers_each_reading(controller):
    # One twice, one late, and what is no reading.
    order = [controller.reading(k) for k in (0, 1, 1, 3, 2, 4, 5, 6, 7, 8, 9)]
    order[3:3] = [b"", b"hello", controller.reading(2) + b"more"]
    assert controller.follow(*order) == ""
    answers = controller.answers()
    assert [answer[0] for answer in answers] == [0, 1, 3, 4, 5, 6, 7, 8, 9]
    assert [answer[1] for answer in answers] == [PERIOD * answer[0] for answer in answers]
    # It is where it should be, and the forces bear the weight.
    robot = RPSRobot.from_preset("micro")
    weight = robot.actuator_forces(controller.pose, np.zeros(3), np.zeros(3))
    for answer in answers:
        np.testing.assert_allclose(answer[2:], weight, rtol=0.0, atol=1e-6)
    was_seen = np.arange(10) != 2
    expected = np.where(was_seen[:, None], controller.pose, np.nan)
    np.testing.assert_allclose(controller.reached, expected, rtol=0.0, atol=1e-9, equal_nan=True)


def test_three_lost_readings_are_bridged_and_four_stop_the_controller(controller):
    assert controller.follow(*map(controller.reading, (0, 1, 5, 6, 9))) == ""
    assert [answer[0] for answer in controller.answers()] == [0, 1, 5, 6, 9]
    failed = controller.follow(*map(controller.reading, (0, 5, 6)))
    assert "4 readings in a row were refused" in failed
    assert [answer[0] for answer in controller.answers()] == [0]


def test_the_controller_ends_with_a_drive_that_is_safe_or_silent(controller):
    packets = controller.reading(0), controller.reading(1, state=2), controller.reading(2)
    assert "the drive is safe" in controller.follow(*packets)
    assert [answer[0] for answer in controller.answers()] == [0]
    with pytest.raises(TimeoutError):
        controller.follow(controller.reading(3))


def test_the_last_readings_may_be_lost(controller):
    assert controller.follow(controller.reading(0), controller.reading(11)) == ""


# A plan -------------------------------------------------------------------------------------------


def numbers(printed: str, line: str) -> list[float]:
    """Return the numbers of a line that begins with some words."""
    found = next(one for one in printed.splitlines() if one.startswith(line))
    return [float(x) for x in re.findall(r"(?<![\w.])-?\d[\d.]*(?:e[-+]\d+)?", found)]


def test_a_swing_is_planned_that_the_simulations_follow(example, tmp_path):
    printed = example.run("plan_swing.py", "--output", "figures")
    assert "IPOPT: Solve_Succeeded" in printed
    energy, plain, saved = numbers(printed, "energy")
    assert saved == pytest.approx(100 * (1 - energy / plain), abs=0.1)
    assert saved > 80
    assert worst(numbers(printed, "largest torque")[:2]) <= 2.0
    assert numbers(printed, "largest gap at the nodes")[0] <= 1e-9
    for engine in ("Pinocchio", "generated code"):
        place, speed, gap, _ = numbers(printed, f"simulation, {engine}")
        assert place < 1e-4
        assert speed < 1e-3
        assert gap < 1e-12
    written = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert written == ["swing.png", "swing.svg"]
    with Image.open(tmp_path / "figures" / "swing.png") as picture:
        assert len(picture.convert("L").getcolors()) > 2  # drawn upon


@pytest.fixture(scope="module")
def swing() -> dict[str, Any]:
    """What the example defines."""
    return runpy.run_path(str(EXAMPLES / "plan_swing.py"))


def test_energy_that_nothing_lowers_and_an_error_of_fourth_order(swing):
    """A plan is the best of its neighbours' limits; half the step leaves a sixteenth of the error.

    The error is that of the simulated end, without what the torques' steps in time add.
    """
    robot = ClosedLoopModel.load(swing["MECHANISM"])
    start, goal = (swing["closed"](robot, swing[end]) for end in ("START", "GOAL"))
    plans, errors = {}, {}
    for intervals in (20, 40):
        nodes = np.linspace(0.0, 1.0, 2 * intervals + 1)
        guess = swing["minimum_jerk"](robot, start, goal, nodes)
        for limit in (2.0, 2.5, np.inf):
            plan, stats = swing["planned"](robot, guess, limit)
            assert stats["success"]
            plans[limit] = plan
            assert worst([robot.loop_gap(q) for q in plan.q]) < 1e-9
            assert abs(plan.tau).max() < limit * (1 + 1e-6)
            np.testing.assert_allclose(plan.q[[0, -1]], [start, goal], atol=1e-8)
            assert not plan.u[[0, -1]].any()
        energies = [plan.energy() for plan in plans.values()]
        assert energies == sorted(energies, reverse=True)
        assert guess.energy() > energies[0]
        simulation = swing["simulated"](robot, plans[np.inf])
        errors[intervals] = abs(simulation.q[-1] - goal).max()
    assert errors[40] < errors[20] / 8


def test_too_little_torque_is_no_plan(example):
    process = example.start("plan_swing.py", "--limit", "0.5", "--intervals", "10")
    printed, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "no plan: try a longer duration or a higher limit" in printed


@pytest.mark.parametrize("option", ["--limit", "--intervals"])
def test_an_impossible_option_is_wrong_usage(option, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["plan_swing.py", option, "0"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(EXAMPLES / "plan_swing.py"), run_name="__main__")
    assert ended.value.code == 2
    assert f"{option} 0" in capsys.readouterr().err
