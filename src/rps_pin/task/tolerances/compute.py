"""Errors of the pose of a mechanism's output from tolerances: the call that computes them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError, MechanismError, few
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.task import Task
from rps_pin.task.tolerances.analysis import ToleranceAnalysis
from rps_pin.task.tolerances.model import WHOLE_POSE, ToleranceModel, output_of
from rps_pin.task.tolerances.poses import poses_of
from rps_pin.task.tolerances.specification import Tolerance, chosen, load_tolerances, tolerances
from rps_pin.validation import choice

Given = Mapping[str, Any] | Sequence[Tolerance] | str | os.PathLike[str]

#: How far a unit of a number may open loops, as a part of it, by rounding errors; those of a file
#: may be larger, as the rule of its rank says.
_CLOSED = 1e-6


@refuses_other_kinds
def tolerance(
    of: Any,
    given: Given,
    poses: Any = None,
    *,
    coordinates: Sequence[str] | None = None,
    held: Sequence[str] | None = None,
    opening: Literal["raise", "leave out"] = "raise",
    **options: Any,
) -> ToleranceAnalysis:
    """Return errors of the pose that tolerances make, to first order, at poses.

    The actuators hold the readings that the mechanism as it is drawn has at a pose. Exact errors:
    `monte_carlo`; shares of the variance where first order is not enough: `sobol`.

    Parameters
    ----------
    of
        A `Task`, or what has one: a `ClosedLoopModel`, an `RPSRobot`.
    given
        Tolerances by name or pattern (see `names`), those of `tolerances` or `load_tolerances`, or
        a file of them: ``{"placement:leg_*.x": "0.05 mm", "offset:*": 1e-5}``.
    poses
        Task coordinates (n, m), a `Trajectory`, a `TaskGrid`, or a `TaskWorkspace`, of which the
        points inside count; home if left out. Of a grid, points that are not reached are left out.
    coordinates
        Of the output frame, whose errors are looked at: some of x, y, z, rx, ry, rz, or ``"pose"``
        for all; those of the task if left out. A 3-RPS as an example is off in x, y and rz too.
    held
        The actuators that hold their readings; all if left out.
    opening
        Whether errors that open loops (a joint of a planar mechanism moved out of its plane) are
        refused, or left out and named.
    **options
        Of `ClosedLoopModel.compile`.

    Raises
    ------
    InputError
        If no number has such a name, a length is given for an angle, poses have the wrong shape, or
        an error opens loops.
    MechanismError
        If there is no task, or the actuators do not determine the pose.
    UnreachableError
        If a pose is not reached.
    SingularityError
        If the actuators do not determine the motion at a pose.
    """
    choice(opening, "opening", ("raise", "leave out"))
    task = task_of(of)
    output = output_of(task, WHOLE_POSE if _is_pose(coordinates) else coordinates, held)
    found = chosen(_entries(given), output.kinds)
    model = ToleranceModel(task, output, found.labels, **options)
    at = poses_of(task, poses)
    nominal = model.nominal(at.q, at.x)
    slopes = model.slopes(nominal)
    rule = output.extension.mechanism.system.rule
    opens = slopes.opening > (max(_CLOSED, rule.tolerance) if rule.rounding else _CLOSED)
    out = tuple(label for label, one in zip(found.labels, opens, strict=True) if one)
    if out and opening == "raise":
        raise InputError(opening_told(out, "opening='leave out' does without them"))
    if opens.all():
        raise InputError("errors of all of these numbers open loops")
    kept = found.of(~opens)
    model = model.with_labels(kept.labels)
    return ToleranceAnalysis(model, kept, at, nominal, slopes.x[:, :, ~opens], out)


def names(of: Any, *, held: Sequence[str] | None = None) -> dict[str, str]:
    """Return the names of all numbers that can have a tolerance, and what they are.

    Parameters
    ----------
    of, held
        As for `tolerance`.

    Returns
    -------
    dict
        ``"length"`` (m), ``"angle"`` (rad) or ``"ratio"``, by name:

        - ``placement:JOINT.x`` (``y``, ``z``, ``roll``, ``pitch``, ``yaw``): where a joint stands
          on the link before it, in the axes of its own frame;
        - ``closure:NAME.a.x``, ``.b.x``: the same of a closure's frames;
        - ``distance:NAME``: the length of a rod;
        - ``frame:NAME.x``: of the output frame, and of the frame that it is measured from;
        - ``offset:ACTUATOR``, ``scale:ACTUATOR``: of the encoder: position = offset + (1 + scale)
          reading.
    """
    return dict(output_of(task_of(of), None, held).kinds)


def opening_told(numbers: Sequence[str], remedy: str) -> str:
    """Return why errors of some numbers are refused, and what to do."""
    return (
        f"errors of {few(numbers, 8)} open loops, as closures are redundant: what they do to the "
        "pose, rigid links cannot tell. Give the mechanism the joint that lets it be assembled (a "
        f"ball in place of a hinge); {remedy}"
    )


def task_of(of: Any) -> Task:
    """Return the task of what has one.

    Raises
    ------
    MechanismError
        If it has none.
    """
    task = of if isinstance(of, Task) else getattr(of, "task", None)
    if not isinstance(task, Task):
        kind = "the mechanism" if isinstance(of, ClosedLoopModel) else type(of).__name__
        raise MechanismError(f"tolerances are of something with a task; {kind} has none")
    return task


def _is_pose(coordinates: Any) -> bool:
    return isinstance(coordinates, str) and coordinates == "pose"


def _entries(given: Given) -> tuple[Tolerance, ...]:
    if isinstance(given, (str, os.PathLike)):
        return load_tolerances(given)
    if isinstance(given, Mapping):
        return tolerances(given)
    return tuple(given)
