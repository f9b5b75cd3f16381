"""``rps-pin helix``: the inverse dynamics of a 3-RPS along the paper's helix."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape

from rps_pin.cli import console as common
from rps_pin.cli import helix_options as helix
from rps_pin.cli.degrees import DegreesOption
from rps_pin.cli.motion_report import actuator_table, motion_files, print_motion, write_motion
from rps_pin.cli.outputs import OverwriteOption, check_outputs
from rps_pin.cli.task_options import in_unit, units
from rps_pin.rps.dynamics.motion_csv import COLUMNS
from rps_pin.rps.dynamics.motion_run import run_motion, summarise


def helix_command(
    robot: common.RobotOption = "sokolov",
    radius: helix.RadiusOption = helix.DEFAULT_RADIUS,
    pitch: helix.PitchOption = helix.DEFAULT_PITCH,
    height: helix.HeightOption = None,
    branch: helix.BranchOption = helix.Branch.PLUS,
    duration: helix.DurationOption = helix.DEFAULT_DURATION,
    rate: common.RateOption = 1000.0,
    output: common.FolderOption = Path("helix"),
    degrees: DegreesOption = False,
    overwrite: OverwriteOption = False,
    as_json: common.JsonOption = False,
) -> None:
    """Compute the actuator forces of a 3-RPS along the paper's helix.

    The platform's centre climbs one turn of a helix (Eq. 26 to 29; the last branch of Eq. 29 is
    corrected, as it is misprinted). The loops are closed by Pinocchio constraint models, and the
    forces solve the constrained RNEA. Output: **helix.csv** (every sample), figures like the
    paper's 7, 8 and 9 (PNG and SVG), and **viewer.html**, the motion in 3D, which any browser
    opens from disk.

    The defaults are the paper's Table 1 with z_0 read as 0.4 m, the only interpretation that keeps
    away from the flat, singular pose. At the 0.4 mm that it prints, the robot lies almost flat in
    its base, and the motion crosses poses that no actuator force can hold.

    Examples:

    - `rps-pin helix` the paper's robot and helix

    - `rps-pin helix --robot micro` another robot

    - `rps-pin helix --robot mine.yaml --rate 100 --output results --json`

    Exit status: 0 done; 1 the robot cannot follow it (the error says why); 2 wrong usage.
    """
    machine = common.load_robot(robot)
    path = helix.chosen_helix(machine, radius, pitch, height, branch, duration)
    console = common.text_console(as_json)
    check_outputs(motion_files(output, "helix"), overwrite, renewed=True)
    common.tell_size("helix.csv", path.duration * rate, COLUMNS)
    with helix.telling_largest(machine, path):
        progress = common.progress_bar(console, "inverse dynamics")
        run = run_motion(machine, path, rate, progress=progress)
    summary = summarise(run, machine)
    if degrees:
        summary = summary.in_degrees()
    output.mkdir(parents=True, exist_ok=True)
    name = machine.parameters.name
    with console.status("writing the results"):
        files = write_motion(output, "helix", f"3-RPS {name} along a helix", machine, run, degrees)
    if as_json:
        described = ("radius", "pitch", "height", "branch", "tilt")
        chosen = {one: getattr(path, one) for one in described}
        chosen["tilt"] = in_unit(path.tilt, True, degrees)
        answer = {"robot": name, "helix": chosen}
        answer["units"] = units(degrees)
        common.print_json(answer | summary.as_dict() | {"files": files})
        return
    console.print(
        f"3-RPS [bold]{escape(name)}[/], helix of radius {1e3 * path.radius:g} mm, "
        f"pitch {1e3 * path.pitch:g} mm, from {path.height:g} m",
        markup=True,
    )
    print_motion(console, actuator_table(summary.actuators), summary, path, files, degrees)
