"""Options that do not go together are refused, never ignored: which were given, and the refusal."""

from __future__ import annotations

import typer


def given(context: typer.Context, *names: str) -> list[str]:
    """Return those of a command's options that were given, as they are typed: ``--radius``."""
    options = {str(one.name): one for one in context.command.params}
    found = []
    for name in names:
        source = context.get_parameter_source(name)
        if source is not None and source.name != "DEFAULT":
            option = options[name]
            found.append(option.opts[0] if option.param_type_name == "option" else name.upper())
    return found


def refuse(context: typer.Context, why: str, *names: str) -> None:
    """Refuse the first of these options that was given.

    Raises
    ------
    typer.BadParameter
        Usage is wrong; says why.
    """
    for option in given(context, *names):
        raise typer.BadParameter(why, param_hint=option)
