"""A group of commands whose modules are imported when a command is called, not when it is listed.

Help, completion of a command's name and the version then take no more than Typer does: a command
imports Pinocchio and much else.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperGroup

from rps_pin.cli.decimal_numbers import DecimalCommand

#: Of the whole command line, and of each command.
SETTINGS: dict[str, Any] = {
    "rich_markup_mode": "markdown",
    "pretty_exceptions_enable": False,
    "context_settings": {"help_option_names": ["-h", "--help"]},
}
#: Help of Typer's own options in one line each, so that all commands fit a screen.
_SHORT = {
    "install_completion": "Install completion for the shell.",
    "show_completion": "Show completion for the shell.",
}


class LazyGroup(TyperGroup):
    """Commands that are known by name and one line: ``rps_pin.cli.NAME`` has ``NAME_command``.

    NAME is the command's, or, in a group of its own, the group's and the command's: ``export_c``.
    """

    @staticmethod
    def stub(name: str) -> Callable[[], None]:
        """Return what stands for a command until it is called."""

        def command() -> None:
            raise NotImplementedError(name)  # `resolve_command` puts the command in its place

        command.stands_for = name  # type: ignore[attr-defined]
        return command

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options; those of completion, which Typer adds, with help of one line."""
        params: list[Any] = super().get_params(ctx)
        for one in params:
            one.help = _SHORT.get(one.name, one.help)
        return params

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find a command by its name, and import it if it has not been."""
        name, command, rest = super().resolve_command(ctx, args)
        stands_for = getattr(getattr(command, "callback", None), "stands_for", "")
        return name, _imported(stands_for) if stands_for else command, rest


def _imported(name: str) -> Any:
    """Return the command of a module, with the settings of the whole command line."""
    module = importlib.import_module(f"rps_pin.cli.{name}")
    one = typer.Typer(add_completion=False, **SETTINGS)
    command = one.command(name.rpartition("_")[2], cls=DecimalCommand)
    command(getattr(module, f"{name}_command"))
    return typer.main.get_command(one)
