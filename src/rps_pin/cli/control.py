"""``rps-pin control``: a controller against a simulated plant, from a scenario file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape

from rps_pin.cli import console as common
from rps_pin.cli.degrees import DegreesOption, as_asked
from rps_pin.cli.layer_options import write_page
from rps_pin.cli.motion_options import FastestOption, fastest_of_robot, fastest_of_task
from rps_pin.cli.outputs import OverwriteOption, check_outputs, figures_in
from rps_pin.errors import RPSPinError
from rps_pin.files import write_text

if TYPE_CHECKING:
    from rps_pin.control.simulation.loop_run import LoopRun
    from rps_pin.control.simulation.scenario import Scenario


#: Changes of the status that are printed.
_MOST_SHOWN = 20
#: Figures in the report.
_CAPTIONS = {
    "tracking.png": "Targets, actual values and errors over time",
    "forces.png": "Forces, and what else changed, over time",
}


def control_command(
    scenario: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="A YAML file; see docs/control.md.")
    ],
    output: common.NamedFolderOption = None,
    overwrite: OverwriteOption = False,
    as_json: common.JsonOption = False,
    fastest: FastestOption = False,
    degrees: DegreesOption = False,
) -> None:
    """Run a control loop against a simulated robot that differs from the controller's model.

    The file has the robot (a 3-RPS, or a mechanism with a task), trajectory, controller, plant
    (wrong masses, friction, encoders, delay) and faults. Output: **report.md** with gains, margins,
    errors in micrometres and microradians (with **--degrees** in degrees) and statuses,
    **loop.csv** (every tick), figures, **summary.json**, and **viewer.html**, the motion in 3D. The
    shortest time of **--fastest** is that of the controller's model, and leaves no force for
    control: lower limits are given in the trajectory (**fastest: {force: 40}**).

    Exit status: 0 done, also if the controller stopped; 1 it cannot be run, or not to the end (the
    error says why); 2 wrong usage; 130 Ctrl-C. What was run before the end is written.

    Examples:

    - `rps-pin control scenario.yaml`
    """
    from rps_pin.control.simulation.loop_run import columns_of, write_loop_csv
    from rps_pin.control.simulation.loop_summary import status_name, summary_of
    from rps_pin.control.simulation.report import report
    from rps_pin.control.simulation.scenario import load_scenario
    from rps_pin.rps.robot import RPSRobot

    loaded = load_scenario(scenario)
    name = loaded.name
    robot = "3-RPS" if isinstance(loaded.machine, RPSRobot) else "mechanism"
    folder = output or Path(f"{scenario.stem}-control")
    files = [folder / file for file in ("report.md", "loop.csv", "summary.json")]
    results = [*files, *figures_in(folder, "tracking", "forces"), folder / "viewer.html"]
    check_outputs(results, overwrite, inputs=[scenario], renewed=True)
    console = common.text_console(as_json)
    if fastest:
        loaded = _fastest(loaded, console)
    common.tell_size("loop.csv", loaded.duration / loaded.entry.period, columns_of(*loaded.sizes))
    run, broken = _run(loaded, console)
    window = loaded.entry.settle if run.time[-1] > loaded.entry.settle else 0.0
    summary = summary_of(run, begin=window)
    if degrees:
        summary = summary.in_degrees()
    folder.mkdir(parents=True, exist_ok=True)
    with console.status("writing the results"):
        from rps_pin.plots import save_figure
        from rps_pin.plots.control import plot_loop_forces, plot_tracking
        from rps_pin.viewer import Motion

        title = f"{robot} {name}, {scenario.name}"
        write_loop_csv(files[1], run, degrees=degrees)
        write_text(files[2], json.dumps(summary.as_dict(), indent=2) + "\n")
        write_text(files[0], as_asked(report(title, loaded, run, summary, _CAPTIONS)))
        files += save_figure(plot_tracking(run, begin=window, degrees=degrees), folder, "tracking")
        files += save_figure(plot_loop_forces(run, begin=window), folder, "forces")
        mechanism = loaded.machine.mechanism
        model = mechanism.model
        motion = Motion(model, run.time, run.configuration, forces=run.applied)
        files.append(write_page(folder, loaded.subject, motion, title))
    if as_json:
        common.print_json({"scenario": scenario} | summary.as_dict() | {"files": files})
    else:
        console.print(
            f"{robot} [bold]{escape(name)}[/], {escape(str(scenario))}, from {window:g} s on",
            markup=True,
        )
        console.print(summary.table())
        for event in run.events[:_MOST_SHOWN]:
            words = f"{event.time:.6g} s, {status_name(event.status)}: {event.text}"
            console.print(as_asked(words))
        if len(run.events) > _MOST_SHOWN:
            console.print(f"... and {len(run.events) - _MOST_SHOWN} further changes of the status")
        common.print_files(console, files)
    if broken is not None:
        raise broken


def _fastest(scenario: Scenario, console: Console) -> Scenario:
    """Return a scenario with the shortest motion along its trajectory."""
    from rps_pin.rps.robot import RPSRobot

    model, given = scenario.model, scenario.trajectory
    path = (
        fastest_of_robot(console, model, given)
        if isinstance(model, RPSRobot)
        else fastest_of_task(console, model, given)
    )
    return replace(scenario, trajectory=path)


def _run(scenario: Scenario, console: Console) -> tuple[LoopRun, BaseException | None]:
    """Return what was run, and the error that ended it; raise the error if nothing was run."""
    try:
        with common.share_bar(console, "control loop") as progress:
            return scenario.run(progress), None
    except (RPSPinError, KeyboardInterrupt) as error:
        partial: LoopRun | None = getattr(error, "partial", None)
        if partial is None or partial.time.size < 2:
            raise
        console.print(f"broken off after {partial.time[-1]:.6g} s")
        return partial, error
