"""A control loop that communicates with its drive by UDP, with lost packets.

    OPENBLAS_NUM_THREADS=1 python examples/drive_over_socket.py --loss 0.01

The drive and the simulated robot run in another process (this file, `--drive PORT`) with its own
clock. Each millisecond the drive sends a reading; the controller waits for it and answers with a
command, which is applied from the drive's next tick. Messages are UDP packets on 127.0.0.1,
little-endian, without padding; packets of another size are ignored.

    reading, 41 bytes, from the drive       uint64    sequence: 0, 1, 2, ..., one a tick
                                            double    time of the drive's clock, s
                                            uint8     state: 0 ready, 1 running, 2 safe
                                            3 double  leg lengths, m
    command, 40 bytes, to the drive         uint64    sequence of the reading it answers
                                            double    time of that reading, s
                                            3 double  forces of the legs, N

Ready, the drive has its brakes on, until the first command. Running, it holds its last force
while no command comes, and passes over commands that are not finite or not newer than the last.
When the reading that was answered last is older than the watchdog time, it is safe: no force,
brakes on, for good. For the controller, a reading that did not come is a lost sample (None): a
few are bridged, more stop it, by its status.

`--loss` drops packets on purpose, both ways; `--silent-from` ends the answers, to see the
watchdog. Prints what both sides counted, and the errors as the encoders see them. The drive
ends with its standard input, and so with the controller, however that ends. Exit status: 0
done, Ctrl-C too; 1 the controller stopped, or the drive is safe or silent; 2 wrong usage.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import select
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rps_pin import RPSRobot
from rps_pin.control import (
    ComputedTorque,
    Encoders,
    Gains,
    LoopClock,
    Plant,
    Status,
    wrong_parameters,
)
from rps_pin.errors import RPSPinError
from rps_pin.trajectories import PathSample, circle

READING, COMMAND = struct.Struct("<QdB3d"), struct.Struct("<Qd3d")
READY, RUNNING, SAFE = range(3)
HOST = "127.0.0.1"
PERIOD = 1e-3  # s
REST = 0.5  # s at the start, before it moves: the integral learns the weight
START, PATIENCE = 30.0, 0.5  # s without a reading: at the start, and later


def main() -> int:
    """Run the controller, or the drive; return the exit status."""
    parser = argparse.ArgumentParser(description="Control a drive in another process.")
    parser.add_argument("--duration", type=float, default=3.0, help="of the path, s (default 3)")
    parser.add_argument("--loss", type=float, default=0.0, help="share of packets, 0 to 1")
    parser.add_argument("--watchdog", type=float, default=0.02, help="s (default 0.02)")
    parser.add_argument("--silent-from", type=float, default=np.inf, help="no answers from then, s")
    parser.add_argument("--drive", type=int, metavar="PORT", help="be the drive of a controller")
    args = parser.parse_args()
    for name in ("duration", "watchdog"):
        if not 0 < getattr(args, name) < np.inf:
            parser.error(f"--{name} {getattr(args, name)}: it must be a positive time, in s")
    if not 0 <= args.loss <= 1:
        parser.error(f"--loss {args.loss}: it must be a share, 0 to 1")
    return control(args) if args.drive is None else drive(args)


# The controller -----------------------------------------------------------------------------------


def control(args: argparse.Namespace) -> int:
    """Start a drive and follow the path with it; return the exit status."""
    robot = RPSRobot.from_preset("micro")
    path = circle(height=0.223, tilt=0.1, turns=args.duration, duration=args.duration)
    time = PERIOD * np.arange(round((REST + args.duration) / PERIOD))
    targets = path.sample(np.maximum(time - REST, 0.0))
    gains = Gains.placed(15.0, integral=0.2)
    controller = ComputedTorque(robot, targets.pose[0], gains, period=PERIOD)
    reached = np.full_like(targets.pose, np.nan)  # NaN where the reading was lost
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind((HOST, 0))
        options = ["--drive", str(line.getsockname()[1]), "--loss", str(args.loss)]
        command = [sys.executable, __file__, *options, "--watchdog", str(args.watchdog)]
        # The end of this pipe is the end of the drive. Ctrl-C goes to all processes of a session,
        # so the drive has its own.
        with subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True):
            try:
                failed = follow(line, controller, targets, reached, args)
            except KeyboardInterrupt:
                failed = ""
                print("Ctrl-C")
            except (TimeoutError, ConnectionRefusedError):
                failed = "the drive is silent"
    seen = np.isfinite(reached[:, 0])
    ticks = 1 + int(np.flatnonzero(seen).max(initial=-1))
    print(f"controller: {ticks} ticks, {ticks - seen.sum()} readings lost")
    seen &= time >= REST
    if seen.any():
        is_at, should_be = reached[seen], targets.pose[seen]
        centre = robot.platform_placement(is_at)[0] - robot.platform_placement(should_be)[0]
        tilt = (is_at - should_be)[:, 1:]
        print(f"centre error: at most {1e6 * np.linalg.norm(centre, axis=1).max():.3g} um")
        print(f"tilt error: at most {1e6 * np.linalg.norm(tilt, axis=1).max():.3g} urad")
    if failed:
        print(failed)
    return 1 if failed else 0


def follow(
    line: socket.socket,
    controller: ComputedTorque,
    targets: PathSample,
    reached: NDArray[np.float64],
    args: argparse.Namespace,
) -> str:
    """Answer each reading, until the targets end; return what went wrong, or nothing."""
    chance, done = random.Random(1), 0
    line.settimeout(START)
    address = line.recvfrom(1, socket.MSG_PEEK)[1]
    line.connect(address)  # nobody else is heard from now on
    print(f"controller: the drive is at {address}", flush=True)
    line.settimeout(PATIENCE)
    while done < len(reached):
        packet = line.recv(64)
        if len(packet) != READING.size:
            continue
        sequence, time, state, *length = READING.unpack(packet)
        if sequence >= len(reached):
            break
        if state == SAFE:
            return "the drive is safe: its watchdog has seen no answer"
        if sequence < done:
            continue  # overtaken by a newer one
        for lost in range(done, sequence):
            controller.tick(None, [part[lost] for part in targets])
        status = controller.tick(length, [part[sequence] for part in targets])
        reached[sequence], done = controller.estimate.answers.pose, sequence + 1
        if status & Status.STOPPED:
            return controller.status_text
        if chance.random() >= args.loss and time < args.silent_from:
            line.send(COMMAND.pack(sequence, time, *controller.forces))
    return ""


# The drive ----------------------------------------------------------------------------------------


def drive(args: argparse.Namespace) -> int:
    """Stand for a drive and its machine until standard input ends; return the exit status."""
    robot = RPSRobot.from_preset("micro")
    start = circle(height=0.223, tilt=0.1, duration=1.0).sample(0.0).pose
    machine = RPSRobot(wrong_parameters(robot.parameters, masses=1.2))
    encoders = Encoders(resolution=50e-9, noise=20e-9)
    plant = Plant(machine, start, period=PERIOD, substeps=1, encoders=encoders)
    chance, state, newest, answered, held = random.Random(2), READY, -1, 0.0, 0
    force = np.zeros(3)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line, LoopClock(PERIOD) as clock:
        line.connect((HOST, args.drive))
        line.setblocking(False)
        for tick, _ in enumerate(clock.ticks()):
            time, before = tick * PERIOD, newest
            for sequence, answers, *forces in commands(line):
                # A time that is not a number, or to come, is none.
                if sequence > newest and answers <= time and np.isfinite(forces).all():
                    newest, answered, force = sequence, answers, np.array(forces)
                    state = RUNNING if state == READY else state
            if state == RUNNING and time - answered > args.watchdog:
                state = SAFE
                print(f"drive: no answer for {args.watchdog:g} s: no force, brakes on", flush=True)
            if state == RUNNING:
                held += newest == before
            if chance.random() >= args.loss:
                with contextlib.suppress(ConnectionRefusedError):  # the controller is gone
                    line.send(READING.pack(tick, time, state, *plant.reading()))
            if state == RUNNING:  # else the brakes hold it
                plant.step(force)
            if select.select([sys.stdin], [], [], 0.0)[0]:
                break
    print(f"drive: {tick + 1} ticks, the last force held in {held} of them", flush=True)
    return 0


def commands(line: socket.socket) -> Iterator[tuple[Any, ...]]:
    """Yield the commands that have come."""
    with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
        while True:
            packet = line.recv(64)
            if len(packet) == COMMAND.size:
                yield COMMAND.unpack(packet)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except RPSPinError as error:
        sys.exit(f"error: {error}")
