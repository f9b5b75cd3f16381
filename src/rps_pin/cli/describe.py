"""``rps-pin describe``: joints, closures, mobility and actuation of a mechanism."""

from __future__ import annotations

import json

import typer

from rps_pin.cli.console import JsonOption
from rps_pin.cli.mechanism_options import (
    AccuracyOption,
    FileArgument,
    IgnoreLimitsOption,
    load_mechanism,
)
from rps_pin.cli.printing import say


def describe_command(
    file: FileArgument,
    ignore_limits: IgnoreLimitsOption = False,
    accuracy: AccuracyOption = None,
    as_json: JsonOption = False,
) -> None:
    """Describe any mechanism: joints, closures, rank, mobility, and whether its actuators suffice.

    Exit status: 0; 1 if the file is not a mechanism, or its loops do not close; 2 wrong usage.

    Examples:

    - `rps-pin describe delta`, or `rps-pin describe mine.yaml`

    - `rps-pin describe robot.xml --json` of a MuJoCo file
    """
    description = load_mechanism(file, ignore_limits, accuracy)[0].describe()
    if as_json:
        typer.echo(json.dumps(description.as_dict(), indent=2, allow_nan=False))
    else:
        say(str(description))
