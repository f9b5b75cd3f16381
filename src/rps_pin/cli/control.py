"""``rps-pin control``: a controller against a simulated plant, from a scenario file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from rps_pin.cli.console import JsonOption, NamedFolderOption, print_files, print_json
from rps_pin.cli.layer_options import chosen_layers
from rps_pin.errors import RPSPinError

if TYPE_CHECKING:
    from rps_pin.control.simulation.loop_run import LoopRun
    from rps_pin.control.simulation.loop_summary import LoopSummary
    from rps_pin.control.simulation.scenario import Scenario


#: Changes of the status that are printed.
_MOST_SHOWN = 20


def control_command(
    scenario: Annotated[
        Path, typer.Argument(metavar="SCENARIO", help="A YAML file; see docs/control.md.")
    ],
    output: NamedFolderOption = None,
    as_json: JsonOption = False,
) -> None:
    """Run a control loop against a simulated 3-RPS that differs from the controller's model.

    The file has the robot, trajectory, controller, plant (wrong masses, friction, encoders, delay)
    and faults. Output: **report.md** with gains, margins, errors in micrometres and microradians
    and statuses, **loop.csv** (every tick), figures, **summary.json**, and **viewer.html**, the
    motion in 3D.

    Exit status: 0 done, also if the controller stopped; 1 it cannot be run, or not to the end (the
    error says why); 2 wrong usage; 130 Ctrl-C. What was run before the end is written.

    Examples:

    - `rps-pin control docs/scenarios/micro_helix.yaml`
    """
    from rps_pin.control.simulation.loop_summary import LoopSummary, status_name
    from rps_pin.control.simulation.scenario import load_scenario

    loaded = load_scenario(scenario)
    console = Console(quiet=as_json)
    run, broken = _run(loaded, console)
    window = loaded.entry.settle if run.time[-1] > loaded.entry.settle else 0.0
    summary = LoopSummary.of(run, begin=window)
    folder = output or Path(f"{scenario.stem}-control")
    folder.mkdir(parents=True, exist_ok=True)
    with console.status("writing the results"):
        files = _write(folder, scenario.name, loaded, run, summary, window)
    if as_json:
        print_json({"scenario": scenario} | summary.as_dict() | {"files": files})
        if broken is not None:
            raise broken
        return
    console.print(
        f"3-RPS [bold]{loaded.model.parameters.name}[/], {scenario}, from {window:g} s on",
        highlight=False,
    )
    console.print(summary.table())
    for event in run.events[:_MOST_SHOWN]:
        words = f"{event.time:.6g} s, {status_name(event.status)}: {event.text}"
        console.print(words, highlight=False, markup=False)
    if len(run.events) > _MOST_SHOWN:
        console.print(f"... and {len(run.events) - _MOST_SHOWN} further changes of the status")
    print_files(console, files)
    if broken is not None:
        raise broken


def _run(scenario: Scenario, console: Console) -> tuple[LoopRun, BaseException | None]:
    """Return what was run, and the error that ended it; raise the error if nothing was run."""
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("control loop", total=1.0)
        try:
            return scenario.run(lambda done: bar.update(task, completed=done)), None
        except (RPSPinError, KeyboardInterrupt) as error:
            partial: LoopRun | None = getattr(error, "partial", None)
            if partial is None or partial.time.size < 2:
                raise
            broken = error
    console.print(f"broken off after {partial.time[-1]:.6g} s", highlight=False)
    return partial, broken


def _write(
    folder: Path,
    name: str,
    scenario: Scenario,
    run: LoopRun,
    summary: LoopSummary,
    window: float,
) -> list[Path]:
    """Write everything into a folder; return the files."""
    from rps_pin.control.simulation.loop_run import write_loop_csv
    from rps_pin.control.simulation.report import report
    from rps_pin.files import whole_file
    from rps_pin.plots import save_figure
    from rps_pin.plots.control import plot_loop_forces, plot_tracking
    from rps_pin.viewer import Motion, fitting_layers, save_html

    title = f"3-RPS {scenario.model.parameters.name}, {name}"
    files = save_figure(plot_tracking(run, begin=window), folder, "tracking")
    files += save_figure(plot_loop_forces(run, begin=window), folder, "forces")
    texts = {
        "summary.json": json.dumps(summary.as_dict(), indent=2) + "\n",
        "report.md": report(
            title,
            scenario,
            run,
            summary,
            {
                "tracking.png": "Errors against the target over time",
                "forces.png": "Forces, distance to type II and statuses over time",
            },
        ),
    }
    table, page = folder / "loop.csv", folder / "viewer.html"
    write_loop_csv(table, run)
    for text_name, text in texts.items():
        with whole_file(folder / text_name) as scratch:
            scratch.write_text(text, "utf-8")
    machine = scenario.machine
    shown, at_hand = chosen_layers(None, fitting_layers(machine.mechanism))
    motion = Motion(machine.mechanism.model, run.time, run.configuration, forces=run.applied)
    save_html(page, machine, motion, layers=shown, hidden=at_hand, title=title)
    return [folder / "report.md", table, folder / "summary.json", *files, page]
