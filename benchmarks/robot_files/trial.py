"""One robot file tried: load, describe, close, hold, forward dynamics, one step of simulation."""

from __future__ import annotations

import re
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from benchmarks.robot_files import beside_mujoco
from benchmarks.robot_files.find import MJCF, PART, URDF, RobotFile
from rps_pin import ClosedLoopModel
from rps_pin.errors import RPSPinError

STEP = 1e-3
"""Length of the step of simulation, s."""
AGREE = 1e-9
"""Relative difference from MuJoCo up to which the two agree."""

LOADS, REFUSED, CRASHED, TIMEOUT, APART = "loads", "refused", "crashed", "timeout", "apart"


@dataclass
class Trial:
    """What became of one file."""

    outcome: str
    """`LOADS`, or where it does not: `REFUSED`, `CRASHED`, `TIMEOUT`; or `APART`."""
    stage: str = ""
    """The first stage that failed; "" if none did."""
    message: str = ""
    sizes: dict[str, int] = field(default_factory=dict)
    """nv, rows, rank, mobility, actuators."""
    differences: dict[str, float] = field(default_factory=dict)
    """From MuJoCo, relative, by quantity."""
    mujoco: str = ""
    """Why MuJoCo was not compared; "" if it was."""
    seconds: float = 0.0

    @property
    def agrees(self) -> bool | None:
        """Whether it agrees with MuJoCo; None if they were not compared."""
        if not self.differences:
            return None
        return not any(not value <= AGREE for value in self.differences.values())

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {**asdict(self), "agrees": self.agrees}


def tried(file: RobotFile) -> Trial:
    """Return what becomes of a file; nothing is raised."""
    warnings.simplefilter("ignore")
    began = time.perf_counter()
    path, kind = file.path, file.kind
    model, why = beside_mujoco.compiled(path, kind)
    reason = beside_mujoco.not_a_mechanism(model, why) if kind == MJCF else ""
    if reason:
        part = file.included and model is None
        trial = Trial(APART, message=PART if part else reason, mujoco=why)
    else:
        trial = _tried(path, kind)
        trial.mujoco = why
        if trial.outcome == LOADS and model is not None:
            _compare(trial, path, kind, model)
        if kind == URDF and trial.outcome == REFUSED and not _urdfdom_reads(path):
            trial.outcome = APART
            trial.message = f"urdfdom does not read it either: {trial.message}"
    trial.seconds = time.perf_counter() - began
    return trial


def loaded(path: Path, kind: str) -> ClosedLoopModel:
    """Return the mechanism of a file; a URDF's moving joints are all actuated."""
    if kind == MJCF:
        return ClosedLoopModel.from_mjcf(path)
    if kind == URDF:
        return ClosedLoopModel.from_urdf(path, [], _movable(path))
    return ClosedLoopModel.load(path)


def _urdfdom_reads(path: Path) -> bool:
    """Return whether Pinocchio, by urdfdom, builds a tree of a URDF."""
    try:
        pin.buildModelFromXML(_text(path))
    except (ValueError, RuntimeError):
        return False
    return True


def _text(path: Path) -> str:
    """Return the text of a URDF without a version, of which urdfdom takes any."""
    return re.sub(r"^\s*<\?xml[^>]*\?>", "", path.read_text("utf-8-sig"))


def _movable(path: Path) -> list[str]:
    """Return the joints of a URDF that an actuator can drive, less those that mimic another."""
    root = ElementTree.fromstring(_text(path))
    kinds = "revolute", "continuous", "prismatic"
    return [
        joint.get("name", "")
        for joint in root.findall("joint")
        if joint.get("type") in kinds and joint.find("mimic") is None
    ]


def _tried(path: Path, kind: str) -> Trial:
    trial = Trial(LOADS)
    made: dict[str, Any] = {}

    def load() -> None:
        made["mechanism"] = loaded(path, kind)

    def describe() -> None:
        found = made["mechanism"].describe()
        trial.sizes = {
            "nv": found.nv,
            "rows": found.rows,
            "rank": found.rank,
            "mobility": found.mobility,
            "actuators": found.actuated_velocities,
        }

    def close() -> None:
        mechanism = made["mechanism"]
        made["q"] = q = mechanism.close(mechanism.home)
        _finite(q)

    def hold() -> None:
        mechanism, rest = made["mechanism"], np.zeros(made["mechanism"].model.nv)
        _finite(mechanism.inverse_dynamics(made["q"], rest, rest).tau)

    def forward() -> None:
        mechanism, rest = made["mechanism"], np.zeros(made["mechanism"].model.nv)
        tau = np.zeros(mechanism.actuated_indices.size)
        _finite(mechanism.forward_dynamics(made["q"], rest, tau))

    def step() -> None:
        _finite(made["mechanism"].simulate(made["q"], duration=STEP, step=STEP).q)

    stages: list[Callable[[], None]] = [load, describe, close, hold, forward, step]
    for stage in stages:
        try:
            stage()
        except RPSPinError as error:
            _fail(trial, REFUSED, stage.__name__, str(error))
        except Exception as error:
            _fail(trial, CRASHED, stage.__name__, f"{type(error).__name__}: {error}")
        if "mechanism" not in made or (stage is close and "q" not in made):
            break
    return trial


def _fail(trial: Trial, outcome: str, stage: str, message: str) -> None:
    """Note the first failure; one after loading leaves the outcome, unless it is a crash."""
    if stage == "load" or outcome == CRASHED:
        trial.outcome = outcome
    if not trial.stage:
        trial.stage, trial.message = stage, message


def _finite(array: Any) -> None:
    if not np.isfinite(array).all():
        raise FloatingPointError("a result is not finite")


def _compare(trial: Trial, path: Path, kind: str, model: Any) -> None:
    try:
        trial.differences = beside_mujoco.differences(loaded(path, kind), model)
    except beside_mujoco.NotComparableError as error:
        trial.mujoco = str(error)
    except Exception as error:
        trial.mujoco = f"comparison failed: {type(error).__name__}: {error}"
