"""The description of an identified mechanism, with a comment on every number that changed."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

import pinocchio as pin

from rps_pin.closed_loop.io.write.files import urdf_path, write_texts
from rps_pin.plain_text import short
from rps_pin.task.identification.result import Identification

#: Kinds of numbers, as the description's mappings name them.
_MAPPINGS = ("damping", "friction", "stiffness", "armature")


def write_identified(
    found: Identification,
    path: str | os.PathLike[str],
    *,
    shapes: pin.GeometryModel | None = None,
    overwrite: bool = False,
) -> Path:
    """Write the mechanism with the physically possible parameters: a URDF, and its description.

    A comment stands at each joint whose body changed and at each of damping, friction, stiffness
    and armature, with what was believed; at the head of the description, what it was found from.

    Parameters
    ----------
    found
        The identification.
    path
        The URDF, ``NAME.urdf``; the description is ``NAME.yaml``.
    shapes
        As for `ClosedLoopModel.to_urdf`.
    overwrite
        Whether files that exist are replaced.

    Returns
    -------
    Path
        The description.

    Raises
    ------
    RPSPinError
        As `Identification.mechanism` and `ClosedLoopModel.to_urdf`.
    """
    target, mechanism = urdf_path(path), found.mechanism
    if not mechanism.has_task:
        mechanism = mechanism.for_task(found.model.task.options)
    texts, changes = mechanism.urdf_texts(target, shapes), changes_in_words(found)
    commented = texts._replace(
        urdf=_commented_tree(texts.urdf, changes),
        description=_commented(texts.description, found, changes),
    )
    return write_texts(target, commented, overwrite)


def changes_in_words(found: Identification) -> dict[str, str]:
    """Return what changed, by group (``inertia:JOINT``, ``damping:JOINT``), in words."""
    told: dict[str, list[str]] = {}
    assert found.possible is not None
    for label, before, after in zip(
        found.model.labels, found.model.nominal, found.possible.parameters, strict=True
    ):
        if short(after) == short(before):
            continue
        kind, _, name = label.partition(":")
        group, part = (label.rpartition(".")[::2]) if kind == "inertia" else (label, name)
        told.setdefault(group, []).append(f"{part} {short(after)}, was {short(before)}")
    return {group: "; ".join(parts) for group, parts in told.items()}


def _commented_tree(text: str, changes: Mapping[str, str]) -> str:
    """Return a URDF with a comment before each joint whose body changed."""
    lines = []
    for line in text.splitlines():
        opened = re.match(r'(\s*)<joint name="([^"]*)"', line)
        if opened and (told := changes.get(f"inertia:{opened[2]}")):
            lines.append(f"{opened[1]}<!-- identified, its body: {told.replace('--', '- -')} -->")
        lines.append(line)
    return "\n".join(lines) + "\n"


def _commented(text: str, found: Identification, changes: Mapping[str, str]) -> str:
    """Return a description with a head, and a comment before each mapping that changed."""
    lines = [
        f"# Identified by {found.samples} samples of logs, filtered at {found.cut_off:.4g} Hz;",
        "# bodies are the most likely ones that are physically possible, about the joints'",
        "# origins (kg, kg m, kg m^2); what the logs do not tell stays near what was believed.",
        *(f"# doubtful: {doubt}" for doubt in found.doubts),
    ]
    lines += [f"# {group}: {told}" for group, told in changes.items() if group[:8] == "inertia:"]
    for line in text.splitlines():
        kind = line.partition(":")[0]
        if kind in _MAPPINGS:
            own = [told for group, told in changes.items() if group.startswith(f"{kind}:")]
            lines += [f"# identified: {told}" for told in own]
        lines.append(line)
    return "\n".join(lines) + "\n"
