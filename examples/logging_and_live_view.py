"""A control loop with a log of every tick and a live view in the browser.

    OPENBLAS_NUM_THREADS=1 python examples/logging_and_live_view.py --output log

The loop of `control_loop.py`. The log contains encoder readings, setpoints, estimated poses,
forces, status and `type_ii`. It is one array, allocated before the loop; files are written
after it. The view is another process that does not delay the loop; its address, on this machine
only, is printed. `--no-view` disables it.

Ctrl-C ends the loop, and the log is kept. Prints the tracking error as measured by the
encoders, the clock's report, and the files: `loop.csv` (a row for each tick) and `loop.png`.
Exit status: 0 done, Ctrl-C too; 1 the controller stopped; 2 wrong usage.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from pathlib import Path

import numpy as np
import rich
from matplotlib.figure import Figure
from numpy.lib.recfunctions import structured_to_unstructured
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
from rps_pin.files import whole_file
from rps_pin.plots import COLUMN, LEG_COLOURS, LEG_STYLES, styled
from rps_pin.trajectories import circle
from rps_pin.viewer import LiveView

Array = NDArray[np.float64]

PERIOD = 1e-3  # s
REST = 0.5  # s at the start, before it moves: the integral learns the weight

#: A tick. Poses are (z, tilt_x, tilt_y) in m and rad; lengths in m, forces in N, of legs 1 to 3.
ROW = np.dtype(
    [
        ("time", float),
        ("reading", float, 3),
        ("target", float, 3),
        ("estimate", float, 3),
        ("force", float, 3),
        ("type_ii", float),
        ("status", float),
    ]
)
COLUMNS = (
    "time_s,reading_1_m,reading_2_m,reading_3_m,target_z_m,target_tilt_x_rad,target_tilt_y_rad,"
    "estimate_z_m,estimate_tilt_x_rad,estimate_tilt_y_rad,force_1_N,force_2_N,force_3_N,"
    "type_ii,status"
)


def main() -> int:
    """Run the loop and write its log; return the exit status."""
    parser = argparse.ArgumentParser(description="Log a control loop, and watch it.")
    parser.add_argument("--duration", type=float, default=10.0, help="of the path, s (default 10)")
    parser.add_argument("--output", type=Path, default=Path("log"), help="folder (default log)")
    parser.add_argument("--no-view", action="store_true", help="no live view")
    args = parser.parse_args()
    if not 0 < args.duration < np.inf:
        parser.error(f"--duration {args.duration}: it must be a positive time, in s")
    args.output.mkdir(parents=True, exist_ok=True)

    robot = RPSRobot.from_preset("micro")
    path = circle(height=0.223, tilt=0.1, turns=args.duration, duration=args.duration)
    time = PERIOD * np.arange(round((REST + args.duration) / PERIOD))
    targets = path.sample(np.maximum(time - REST, 0.0))
    start = targets.pose[0]

    controller = ComputedTorque(robot, start, Gains.placed(15.0, integral=0.2), period=PERIOD)
    machine = RPSRobot(wrong_parameters(robot.parameters, masses=1.2))
    encoders = Encoders(resolution=50e-9, noise=20e-9)
    plant = Plant(machine, start, period=PERIOD, substeps=1, delay=1, encoders=encoders)

    log, logged = np.zeros(time.size, ROW), 0
    clock = LoopClock(PERIOD)
    # Made here, started by the `with` block.
    live = contextlib.nullcontext() if args.no_view else LiveView(robot, start)
    try:
        with live as view, clock:
            if view:
                print(f"live view: {view.url}", flush=True)
            for k, (*target, _) in enumerate(zip(*targets, clock.ticks(), strict=False)):
                reading = plant.reading()
                status = controller.tick(reading, target)
                plant.step(controller.forces)  # yours: send them to the drives
                pose, type_ii = controller.estimate.answers.pose, controller.estimate.type_ii
                log[k] = time[k], reading, target[0], pose, controller.forces, type_ii, status
                logged = k + 1
                if view:
                    view.show(pose)
                if status & Status.STOPPED:
                    print(controller.status_text)
                    break
    except KeyboardInterrupt:
        print(f"Ctrl-C: {logged} ticks are logged", flush=True)
    rich.print(clock.report().table())
    if logged:
        for file in write(args.output, robot, log[:logged]):
            print(file)
    return 1 if controller.status & Status.STOPPED else 0


def write(folder: Path, robot: RPSRobot, log: NDArray[np.void]) -> list[Path]:
    """Write a log as CSV and as a figure; return the files."""
    table = folder / "loop.csv"
    with whole_file(table) as scratch:
        rows = structured_to_unstructured(log)
        np.savetxt(scratch, rows, fmt="%.12g", delimiter=",", header=COLUMNS, comments="")

    is_at, should_be = (robot.platform_placement(log[name])[0] for name in ("estimate", "target"))
    centre = 1e6 * np.linalg.norm(is_at - should_be, axis=1)
    tilt = 1e6 * np.linalg.norm((log["estimate"] - log["target"])[:, 1:], axis=1)
    moving = log["time"] >= REST
    if moving.any():
        print(f"centre error: at most {centre[moving].max():.3g} um")
        print(f"tilt error: at most {tilt[moving].max():.3g} urad")

    figure = drawn(log["time"], centre, tilt, log["force"])
    picture = folder / "loop.png"
    with whole_file(picture) as scratch:
        figure.savefig(scratch, dpi=300)
    return [table, picture]


@styled
def drawn(time: Array, centre: Array, tilt: Array, force: Array) -> Figure:
    """Return a figure of both errors (um, urad) and of the forces (N) over time (s)."""
    figure = Figure(figsize=(COLUMN, 4.4), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    axes[0].plot(time, centre, color="black")
    axes[1].plot(time, tilt, color="black")
    for leg, (colour, style) in enumerate(zip(LEG_COLOURS, LEG_STYLES, strict=True)):
        axes[2].plot(time, force[:, leg], style, color=colour, label=f"leg {leg + 1}")
    axes[2].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
    for own, label in zip(
        axes, ("centre error (µm)", "tilt error (µrad)", "force (N)"), strict=True
    ):
        own.set_ylabel(label)
        own.margins(x=0)
    axes[2].set_xlabel("time (s)")
    return figure


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (RPSPinError, OSError) as error:  # OSError: of the files
        sys.exit(f"error: {error}")
