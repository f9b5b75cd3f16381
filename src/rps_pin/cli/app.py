"""The list of commands. Their errors are one line and a non-zero exit status."""

from __future__ import annotations

import os
import sys
import threading
import warnings
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any

import typer

from rps_pin import __version__
from rps_pin.cli.degrees import ASKED, as_asked
from rps_pin.cli.doctor import doctor
from rps_pin.cli.lazy_group import SETTINGS, LazyGroup
from rps_pin.cli.printing import say, tell_error, tell_fault
from rps_pin.errors import AccuracyWarning, RPSPinError
from rps_pin.output_places import FILES_READ
from rps_pin.plain_text import plain

app = typer.Typer(name="rps-pin", cls=LazyGroup, no_args_is_help=True, **SETTINGS)

_BEGIN, _ANY, _RPS = "To begin", "Any robot", "The 3-RPS"
for _panel, _name, _line in (
    (_BEGIN, "view", "Show a robot, a pose or a motion in the browser."),
    (_BEGIN, "new", "Files of a robot of your own, to edit."),
    (_BEGIN, "examples", "Sample files that the commands' examples name."),
    (_ANY, "ik", "Leg lengths of a pose, and limits; of any task too."),
    (_ANY, "fk", "Poses of leg lengths: all modes, or one; any task."),
    (_ANY, "dynamics", "Forces of any trajectory; sizing."),
    (_ANY, "design", "Dimensions for a task: fronts of robots."),
    (_ANY, "calibrate", "Lengths and offsets from readings."),
    (_ANY, "tolerance", "Errors of the pose from tolerances."),
    (_ANY, "stiffness", "Deflection, stiffness and frequencies."),
    (_ANY, "identify", "Masses and friction from logs of forces."),
    (_ANY, "check", "Singularities and limits along a path."),
    (_ANY, "control", "A control loop on a simulated robot."),
    (_ANY, "describe", "Joints, closures, rank, mobility, actuation."),
    (_ANY, "assembly-modes", "Closed configurations with given joint values."),
    (_ANY, "simulate", "Simulation, loops closed at every step."),
    (_ANY, "convert", "URDF with its description, or a MuJoCo file."),
    (_RPS, "helix", "Actuator forces along the paper's helix."),
    (_RPS, "workspace", "Its workspace, with the paper's figures."),
    (_RPS, "urdf", "Its URDF."),
    (_RPS, "reproduce", "The paper's equations, figures and tables."),
):
    app.command(_name, rich_help_panel=_panel, short_help=_line)(
        LazyGroup.stub(_name.replace("-", "_"))
    )

export = typer.Typer(cls=LazyGroup, no_args_is_help=True, **SETTINGS)
export.command("c", short_help="C99 with header, CMake and a self-test.")(
    LazyGroup.stub("export_c")
)
app.add_typer(
    export,
    name="export",
    rich_help_panel=_ANY,
    short_help="Code for a controller.",
    help="Write a mechanism as code for other programs.\n\nExit status: 0; 2 wrong usage.",
)


@app.command("doctor", rich_help_panel=_BEGIN)
def doctor_command(
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """List what is installed and what is missing.

    Exit status: 0 all required packages work; 1 something is missing or broken. Of any command, 70
    is a fault of rps-pin itself: please report it with this list.

    Example: `rps-pin doctor --json`
    """
    raise typer.Exit(doctor(as_json))


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"rps-pin {__version__}")
        raise typer.Exit


@app.callback()
def rps_pin(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Closed-loop robots on Pinocchio. SI units. Begin with **rps-pin helix** and **view**."""


def _show_warning(others: Callable[..., None], warning: object, kind: object, *rest: Any) -> None:
    """Show a warning about a file's numbers as a note, others as they are."""
    if isinstance(warning, AccuracyWarning):
        say(f"note: {warning}", err=True)
    else:
        others(plain(warning), kind, *rest)


def run() -> None:
    """Run the command line; an error is one line and the exit status 1, a fault 70."""
    warnings.showwarning = partial(_show_warning, warnings.showwarning)
    FILES_READ.set(set())
    ASKED.set(False)
    threading.excepthook = _tell_fault_of_thread
    try:
        app(prog_name="rps-pin")
        return
    except BrokenPipeError:  # the reader of the output ended: no message
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except RPSPinError as error:
        message = str(error)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        message = f"{where}{error.strerror or error}"
    except MemoryError as error:
        message = f"not enough memory: {error}".removesuffix(": ")
    except ImportError:
        raise  # `rps_pin.cli.main` says what is missing
    except Exception as error:
        sys.exit(tell_fault(error))
    tell_error(as_asked(message))
    sys.exit(1)


def _tell_fault_of_thread(ended: threading.ExceptHookArgs) -> None:
    if ended.exc_value is not None and ended.exc_type is not SystemExit:
        tell_fault(ended.exc_value)
