"""The commands, and how their errors end: one clear line and a non-zero exit status."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from rps_pin import __version__
from rps_pin.cli.check import check_command
from rps_pin.cli.console import complain
from rps_pin.cli.control import control_command
from rps_pin.cli.describe import describe_command
from rps_pin.cli.dynamics import dynamics_command
from rps_pin.cli.fk import fk_command
from rps_pin.cli.helix import helix_command
from rps_pin.cli.ik import ik_command
from rps_pin.cli.reproduce import reproduce_command
from rps_pin.cli.simulate import simulate_command
from rps_pin.cli.urdf import urdf_command
from rps_pin.cli.view import view_command
from rps_pin.cli.workspace import workspace_command
from rps_pin.errors import RPSPinError

app = typer.Typer(
    name="rps-pin",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("helix")(helix_command)
app.command("dynamics")(dynamics_command)
app.command("control")(control_command)
app.command("view")(view_command)
app.command("ik")(ik_command)
app.command("fk")(fk_command)
app.command("check")(check_command)
app.command("workspace")(workspace_command)
app.command("reproduce")(reproduce_command)
app.command("urdf")(urdf_command)
app.command("describe")(describe_command)
app.command("simulate")(simulate_command)


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
    """Closed-loop robots on Pinocchio: the 3-RPS parallel robot, and any other mechanism.

    Everything is in SI units: metres, radians, seconds, kilograms, newtons.

    First steps: **rps-pin helix** computes the paper's motion, **rps-pin view** shows it live,
    **rps-pin dynamics** takes any trajectory of yours, **rps-pin describe** tells what any other
    mechanism can do.
    """


def main() -> None:
    """Run the command line; the console script ``rps-pin``."""
    try:
        app()
    except RPSPinError as error:
        complain(str(error))
        sys.exit(1)
    except BrokenPipeError:  # the reader of our output left: not worth a word
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        complain(f"{where}{error.strerror or error}")
        sys.exit(1)
