"""MuJoCo as the judge of URDF and MJCF: what it refuses must not load with other numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.robot_files import beside_mujoco
from rps_pin import ClosedLoopModel
from rps_pin.errors import RPSPinError
from tests.fuzz.case import WrongAnswerError

#: Relative differences up to which the two agree: numbers of very different sizes stand in a file.
_AGREE = 1e-6
_COMPARED = ("mass matrix", "forces", "equality residual")
#: Told where closures that are not quite redundant count as redundant: they close less exactly.
_ROUNDED = "numbers are rounded"
#: Of lengths, masses, gravity, dry friction, coordinates at rest; the condition of a mass matrix.
_PLAIN, _SINGULAR = 1e4, 1e8


def compare(mechanism: ClosedLoopModel, path: Path, kind: str, told: Sequence[str] = ()) -> None:
    """Compare a mechanism with MuJoCo's model of the same file.

    Raises
    ------
    WrongAnswerError
        If they differ; or if MuJoCo refuses an MJCF that loads, and no note tells what was left
        out.
    """
    model, why = beside_mujoco.compiled(path, kind)
    if model is None:
        if kind == "MJCF" and not any("left out" in words for words in told):
            raise WrongAnswerError(f"taken, which MuJoCo refuses: {why}")
        return
    if _hides_differences(mechanism, model):
        return
    compared = _COMPARED[:2] if any(_ROUNDED in words for words in told) else _COMPARED
    try:
        found = beside_mujoco.differences(mechanism, model)
    except (RPSPinError, beside_mujoco.NotComparableError, np.linalg.LinAlgError):
        return
    for what in compared:
        if not found.get(what, 0.0) <= _AGREE:
            raise WrongAnswerError(f"{what} differs from MuJoCo's: by {found[what]:.3g}")


def _hides_differences(mechanism: ClosedLoopModel, model: Any) -> bool:
    """Return whether rounding hides what is compared, or MuJoCo's short cut for slides differs.

    MuJoCo takes the mass matrix of a body with slides alone as diagonal, parallel or not.
    """
    tree = mechanism.model
    sizes = [np.abs(tree.gravity.linear).max()]
    for inertia, placement in zip(tree.inertias, tree.jointPlacements, strict=True):
        sizes += [inertia.mass, np.abs(inertia.inertia).max(), np.abs(inertia.lever).max()]
        sizes.append(np.abs(placement.translation).max())
    for numbers in (model.qpos0, model.eq_data, model.dof_frictionloss):
        sizes.append(np.abs(numbers).max(initial=0.0))
    if max(sizes) > _PLAIN:
        return True
    mass = pin.crba(tree, tree.createData(), mechanism.home)
    mass = np.triu(mass) + np.triu(mass, 1).T
    return bool(np.linalg.cond(mass) > _SINGULAR)
