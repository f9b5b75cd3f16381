"""``rps-pin examples``: the files that the commands' examples name."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rps_pin.cli.completion import MECHANISMS
from rps_pin.cli.outputs import OverwriteOption, check_outputs
from rps_pin.cli.own_robot import Kind, own_robot
from rps_pin.cli.printing import say
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.files import write_text

_SAMPLES = Path(__file__).parent / "samples"
#: Files to copy, and what they are.
_COPIED = {
    "path.csv": "a trajectory of mine.yaml and of micro",
    "circle.yaml": "another, a circle of tilt",
    "spline.yaml": "another, through poses",
    "step.yaml": "another, from pose to pose within a jerk limit",
    "stewart.csv": "a trajectory of the mechanism stewart",
    "path.yaml": "a trajectory of the mechanism delta",
    "scenario.yaml": "a control loop and its simulated robot",
    "faults.yaml": "another, with faults",
    "design.yaml": "a design: the dimensions of a Delta for a cylinder",
    "readings.csv": "readings of a five-bar, for a calibration",
    "log.csv": "motor forces of a five-bar, for an identification",
    "other.csv": "another log of it",
    "drawing.yaml": "tolerances of a five-bar",
    "compliances.yaml": "what gives way in a four-bar",
    "drives.yaml": "what gives way in a five-bar",
}


def examples_command(
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for the files; it is made.")
    ] = Path("examples"),
    overwrite: OverwriteOption = False,
) -> None:
    """Write the sample files that the README and the commands' help name.

    In their folder, all those commands run as they are typed there. Change the files to your
    robot's numbers; **rps-pin new** begins a robot of your own.

    Exit status: 0 done; 1 an error; 2 wrong usage.

    Example: `rps-pin examples --output samples`
    """
    three_rps = own_robot(Kind.RPS, "mine").files["mine.yaml"]
    texts = {"mine.yaml": (three_rps, "a 3-RPS")}
    for name, what in _COPIED.items():
        texts[name] = ((_SAMPLES / name).read_text("utf-8"), what)
    robot = output / "robot.xml"
    check_outputs([robot, *(output / name for name in texts)], overwrite)
    output.mkdir(parents=True, exist_ok=True)
    ClosedLoopModel.load(MECHANISMS / "four_bar.yaml").to_mjcf(robot, overwrite=True)
    for name, (text, _) in texts.items():
        write_text(output / name, text)
    say(f"wrote into {output}:")
    told = {name: what for name, (_, what) in texts.items()}
    told["robot.xml"] = "a MuJoCo file, a four-bar"
    width = max(map(len, told))
    for name, what in sorted(told.items()):
        say(f"  {name:<{width}}  {what}")
