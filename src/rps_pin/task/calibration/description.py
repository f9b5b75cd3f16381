"""The description of a calibrated mechanism, with a comment on every number that changed.

A URDF and a YAML file are written as `ClosedLoopModel.to_urdf` does, whatever the mechanism was
read from: a calibrated 3-RPS is not symmetric any more, and no parameters of a 3-RPS describe it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel, LoopClosure
from rps_pin.closed_loop.io.write.files import urdf_path, write_texts
from rps_pin.errors import ClosureError
from rps_pin.plain_text import short
from rps_pin.task.calibration.prediction import CalibrationModel
from rps_pin.task.calibration.solve import Calibration
from rps_pin.task.calibration.words import units_of

#: Changes below this, in m and rad, are rounding.
_NONE = 1e-12


def calibrated_mechanism(model: CalibrationModel, found: Calibration) -> ClosedLoopModel:
    """Return the mechanism with the numbers found, its home closed.

    Offsets and scales of sensors are none of its numbers: it has positions, not readings.

    Raises
    ------
    ClosureError
        If its loops do not close near the home of the mechanism as it was believed to be.
    """
    from rps_pin.codegen.engine.applied import with_parameters  # noqa: PLC0415 (needs an extra)

    old, groups = model.task.mechanism, _own_groups(model)
    moved = with_parameters(old, groups, _numbers_of(model, groups, found.parameters))
    try:
        home = moved.close(old.home)
    except ClosureError as error:
        error.args = (f"the calibrated mechanism: {error}", *error.args[1:])
        raise
    return old.with_numbers(moved.model, moved.closures, home)


def write_calibrated(
    model: CalibrationModel,
    found: Calibration,
    path: str | os.PathLike[str],
    *,
    shapes: pin.GeometryModel | None = None,
    overwrite: bool = False,
) -> Path:
    """Write the calibrated mechanism as a URDF and, beside it, its description.

    A comment stands at each joint and closure that changed: what it was, the changes in its own
    axes and their standard deviations; and at the head of the description, offsets and scales.

    Parameters
    ----------
    model, found
        A calibration.
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
        As `calibrated_mechanism`, and `ClosedLoopModel.to_urdf`.
    """
    target, changes = urdf_path(path), changes_in_words(model, found)
    mechanisms = model.task.mechanism, calibrated_mechanism(model, found)
    before, after = (
        (one if one.has_task else one.for_task(model.task.options)).urdf_texts(target, shapes)
        for one in mechanisms
    )
    described = _commented_yaml(before.description, after.description, changes, mechanisms[1])
    commented = after._replace(
        urdf=_commented_urdf(before.urdf, after.urdf, changes),
        description="\n".join([*_head(model, found, changes), described]),
    )
    return write_texts(target, commented, overwrite)


def changes_in_words(model: CalibrationModel, found: Calibration) -> dict[str, str]:
    """Return what changed, in words, by group (``placement:JOINT``) or label."""
    told: dict[str, list[str]] = {}
    units = units_of(model)
    for k, label in enumerate(model.labels):
        change = found.parameters[k] - found.before[k]
        if abs(change) <= _NONE:
            continue
        group, _, part = label.partition(".")
        if label.startswith(("offset:", "scale:")):
            group, part = label, ""
        known = np.isfinite(found.deviations[k])
        spread = f"deviation {short(found.deviations[k])}" if known else "not known alone"
        words = f"{part} changed by {short(change)} {units[k]} ({spread})"
        if not part:
            words = (
                f"{short(found.parameters[k])} {units[k]}, was {short(found.before[k])} ({spread})"
            )
        told.setdefault(group, []).append(words.strip())
    return {group: "; ".join(parts) for group, parts in told.items()}


def _own_groups(model: CalibrationModel) -> tuple[str, ...]:
    """Return the groups that are numbers of the mechanism, not of the task's frames."""
    own = {f"closure:{closure.name}" for closure in model.task.mechanism.closures}
    return tuple(one for one in model.groups if not one.startswith("closure:") or one in own)


def _numbers_of(model: CalibrationModel, groups: Sequence[str], p: Array) -> Array:
    """Return the numbers of some groups, in their order."""
    return np.array(
        [
            value
            for group in groups
            for label, value in zip(model.labels, p, strict=True)
            if label == group or label.startswith(f"{group}.")
        ]
    )


def _head(model: CalibrationModel, found: Calibration, changes: Mapping[str, str]) -> list[str]:
    poses, used = len(found.x), int(np.isfinite(found.residuals).sum() - found.outliers.sum())
    lines = [
        f"# Calibrated by {used} readings at {poses} poses, {int(found.outliers.sum())} outliers "
        "left out.",
        "# Changes are in the axes of the joint or frame that moved; m and rad.",
    ]
    own = _own_groups(model)
    others = {group: words for group, words in changes.items() if group not in own}
    if others:
        lines.append("# Not numbers of this file; a sensor reads (position - offset) / scale:")
        lines += [f"#   {group}: {words}" for group, words in others.items()]
    return lines


def _commented_urdf(old: str, new: str, changes: Mapping[str, str]) -> str:
    """Return a URDF with a comment in each joint that moved."""
    before, after = (etree.fromstring(text.encode()) for text in (old, new))
    for group, words in changes.items():
        kind, _, name = group.partition(":")
        if kind != "placement":
            continue
        joint = _first_of_row(after, name)
        was = _first_of_row(before, name).find("origin")
        origin = {} if was is None else dict(was.attrib)
        told = f"xyz {origin.get('xyz', '0 0 0')}, rpy {origin.get('rpy', '0 0 0')}"
        comment = etree.Comment(f" calibrated: {words}; was {told} ".replace("--", "- -"))
        joint.insert(0, comment)
        comment.tail = joint.text
    return str(etree.tostring(after, encoding="unicode")) + "\n"


def _first_of_row(robot: Any, name: str) -> Any:
    """Return the element of a joint, or of the first of those that are written for it."""
    joints = {one.get("name"): one for one in robot.iter("joint", "{*}joint")}
    return next(joints[one] for one in (f"{name}_1", f"{name}:1", name) if one in joints)


def _commented_yaml(
    old: str, new: str, changes: Mapping[str, str], mechanism: ClosedLoopModel
) -> str:
    """Return a description with a comment before each closure that changed."""
    closures = [one.name for one in mechanism.closures if isinstance(one, LoopClosure)]
    before, lines = _entries(old), new.splitlines()
    places = _places(lines)
    for i, name in reversed([*enumerate(closures)]):
        told = [
            f"  # calibrated: {changes[f'{kind}:{name}']}"
            for kind in ("closure", "distance")
            if f"{kind}:{name}" in changes
        ]
        if told:
            lines[places[i] : places[i]] = [*told, f"  # was: {before[i]}"]
    return "\n".join(lines) + "\n"


def _places(lines: Sequence[str]) -> list[int]:
    """Return the numbers of the lines of closures."""
    if "closures:" not in lines:
        return []
    first = lines.index("closures:") + 1
    found = []
    for k in range(first, len(lines)):
        if not re.match(r"  - ", lines[k]):
            break
        found.append(k)
    return found


def _entries(text: str) -> list[str]:
    lines = text.splitlines()
    return [lines[k].removeprefix("  - ") for k in _places(lines)]
