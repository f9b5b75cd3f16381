"""Mutants of calls from Python: public functions, classes and methods, by their type hints."""

from __future__ import annotations

import importlib
import inspect
import os
import types
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pydantic

from rps_pin import ClosedLoopModel, RPSRobot, trajectories
from rps_pin.closed_loop import ForceDistribution, Stepper
from rps_pin.control import ComputedTorque, Gains, Plant, RealTimeRobot
from rps_pin.rps.workspace import leg_grid, workspace
from tests.fuzz.case import Case, WrongAnswerError

ROOT = Path(__file__).resolve().parents[2]
_MODULES = ["closed_loop", "trajectories", "rps", "control", "rps.workspace", "paper"]
#: They show, wait, take minutes whatever is given, or are results that nobody else makes.
LEFT_OUT = {
    *("run_loop", "LoopClock", "paper_comparison", "workspace_to_file", "singular_surface"),
    *("compile", "compile_mechanism", "to_casadi", "to_cuda", "display", "assembly_modes"),
    "take",  # of a copy's memory
}
#: Values by name: those that fit the robots here, and those that fit nothing.
ODD: dict[str, Callable[[], Any]] = {
    "None": lambda: None,
    "text": lambda: "abc",
    "empty text": lambda: "",
    "nan": lambda: float("nan"),
    "inf": lambda: float("inf"),
    "-inf": lambda: -float("inf"),
    "0": lambda: 0,
    "-0.0": lambda: -0.0,
    "-1": lambda: -1,
    "1": lambda: 1,
    "2.5": lambda: 2.5,
    "1e308": lambda: 1e308,
    "1e-320": lambda: 1e-320,
    "1e200": lambda: 1e200,
    "10**400": lambda: 10**400,
    "True": lambda: True,
    "complex": lambda: 1j,
    "bytes": lambda: b"abc",
    "object": object,
    "type": lambda: float,
    "function": lambda: len,
    "dict": lambda: {"a": 1.0},
    "odd dict": lambda: {1: None},
    "empty dict": dict,
    "empty list": list,
    "texts": lambda: ["a", "b"],
    "nested": lambda: [[[[1.0]]]],
    "ragged": lambda: [[1.0], [2.0, 3.0]],
    "set": lambda: {1.0, 2.0},
    "generator": lambda: (x for x in (1.0, 2.0, 3.0)),
    "zeros 3": lambda: np.zeros(3),
    "ones 3": lambda: np.ones(3),
    "huge 3": lambda: np.full(3, 1e200),
    "tiny 3": lambda: np.full(3, 1e-310),
    "nan 3": lambda: np.full(3, np.nan),
    "zeros (2, 3)": lambda: np.zeros((2, 3)),
    "zeros (3, 3)": lambda: np.zeros((3, 3)),
    "eye 4": lambda: np.eye(4),
    "empty array": lambda: np.zeros(0),
    "objects": lambda: np.array([None, 1, "a"], dtype=object),
    "strings": lambda: np.array(["1", "2", "3"]),
    "masked": lambda: np.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0]),
    "big-endian": lambda: np.array([0.2, 0.0, 0.0], dtype=">f8"),
    "path": lambda: Path("new.csv"),
    "file": lambda: "four_bar.yaml",
    "folder": Path,
    "array 0-d": lambda: np.float64(0.1),
}


@cache
def _things() -> dict[str, Any]:
    """Return objects whose methods are called, and that other calls take."""
    four, robot = (
        ClosedLoopModel.load(ROOT / "urdf" / "four_bar.yaml"),
        RPSRobot.from_preset("micro"),
    )
    q = four.complete({"crank_joint": 1.0})
    v = four.velocity(q, [2.0])
    pose = np.array([0.223, 0.02, -0.01])
    q3, v3, a3 = robot.state(pose, np.zeros(3), np.zeros(3))
    grid = leg_grid(robot.parameters, 3)
    return {
        "mechanism": four,
        "robot": robot,
        "parameters": robot.parameters,
        "distribution": ForceDistribution(four, torque_limits=50.0),
        "stepper": Stepper(four, q, v),
        "plant": Plant(robot, pose),
        "estimator": RealTimeRobot(robot, pose, compiled=False),
        "controller": ComputedTorque(robot, pose, Gains.placed(15.0), compiled=False),
        "trajectory": trajectories.circle(height=0.223, tilt=0.1, duration=1.0),
        "sampled": trajectories.SampledPath([0.0, 0.1, 0.2], [pose, pose * 1.001, pose]),
        "gains": Gains.placed(15.0),
        "closure": four.closures[0],
        "inverse": four.inverse_dynamics(q, v, np.zeros(3)),
        "simulation": four.simulate(q, v, duration=0.01, step=0.005),
        "description": four.describe(),
        "workspace": workspace(robot, grid),
        "grid": grid,
        "legs": robot.inverse_kinematics(pose),
        **{"q": q, "v": v, "a": np.zeros(3), "tau": np.array([0.5]), "q_guess": q, "dt": 1e-3},
        **{"values": {"crank_joint": 1.0}, "v_actuated": np.array([2.0])},
        **{"a_actuated": np.array([0.5]), "constraint_forces": np.zeros(2), "period": 1e-3},
        **{"q of robot": q3, "v of robot": v3, "a of robot": a3, "pose": pose, "near": pose},
        **{"rate": np.array([0.01, 0.1, -0.2]), "acceleration": np.zeros(3), "start": pose},
        **{"length": robot.inverse_kinematics(pose).length, "end": pose * 1.01, "frame": "coupler"},
        **{"duration": 0.01, "step": 0.005, "count": 2, "height": 0.223, "tilt": 0.05, "time": 0.1},
        **{"radius": 0.001, "pitch": 0.001, "path": "new.yaml", "actuated": ["crank_joint"]},
        **{"kind": "spherical", "frame_a": "coupler", "frame_b": "base", "model": four.model},
        **{
            "closures": four.closures,
            "times": [0.0, 0.1, 0.2],
            "poses": [pose, pose * 1.001, pose],
        },
        **{"forces": np.array([1.0, 2.0, 3.0]), "points": 3, "axis": [0, 1, 0], "seed": 0},
        **{"starts": 20, "ratio": 2.0, "joint": "crank_joint", "other": "coupler_joint"},
        **{"mass": 0.1, "joints": ["crank_joint"], "wrench": np.ones(6), "curve": None},
    }


@cache
def targets() -> dict[str, Callable[..., Any]]:
    """Return what is called, by name: ``"trajectories.circle"``, ``"mechanism.close"``."""
    found: dict[str, Callable[..., Any]] = {}
    for name in _MODULES:
        module = importlib.import_module(f"rps_pin.{name}")
        for public in module.__all__:
            thing = getattr(module, public)
            if public not in LEFT_OUT and callable(thing) and not _is_plain(thing):
                found[f"{name}.{public}"] = thing
            if inspect.isclass(thing):
                found |= {
                    f"{name}.{public}.{made}": getattr(thing, made)
                    for made, one in vars(thing).items()
                    if isinstance(one, (classmethod, staticmethod)) and not made.startswith("_")
                }
    for name, thing in _things().items():
        if type(thing).__module__.startswith("rps_pin"):
            for public in sorted(set(dir(type(thing))) - _INHERITED - LEFT_OUT):
                method = getattr(type(thing), public)
                if not public.startswith("_") and isinstance(method, _METHODS):
                    found[f"{name}.{public}"] = getattr(thing, public)
    return {k: v for k, v in found.items() if k.rpartition(".")[2] not in _INHERITED}


_METHODS = (types.FunctionType, types.MethodType)
#: Of NamedTuple, of pydantic and of exceptions: they are not this package's.
_INHERITED = set(dir(tuple)) | set(dir(pydantic.BaseModel)) | set(dir(Exception))


def _is_plain(thing: Any) -> bool:
    """Return whether it only holds what others computed, or names what there is."""
    plain = hasattr(thing, "_fields") or hasattr(thing, "__members__")
    made = {"LoopClosure", "Gains", "Payload", "JointCoupling", "Fault", "Encoders", "RPSRobot"}
    holds = hasattr(thing, "__dataclass_fields__") and thing.__name__ not in made
    return bool(
        plain
        or holds
        or (inspect.isclass(thing) and inspect.isabstract(thing))
        or getattr(thing, "_is_protocol", False)
    )


def mutant(rng: Random) -> Case:
    """Return a call: its name, and the names of its values."""
    name = rng.choice(sorted(targets()))
    try:
        given = inspect.signature(targets()[name]).parameters.values()
    except (TypeError, ValueError):
        given = ()
    words = []
    wrong = rng.choice([0, 1, 1, 1, 2])
    named = [one for one in given if one.kind in (one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY)]
    named = [one for one in named if one.name != "progress"]  # its errors are the caller's
    hostile_ones = {one.name for one in rng.sample(named, min(wrong, len(named)))}
    for one in named:
        if one.name in hostile_ones:
            words.append(f"{one.name}={rng.choice(sorted(ODD))}")
        elif one.default is inspect.Parameter.empty or rng.random() < 0.15:
            if (good := _good(one, name)) is not None:
                words.append(f"{one.name}={good}")
            elif one.default is inspect.Parameter.empty:
                words.append(f"{one.name}={rng.choice(sorted(ODD))}")
    return Case("call", {}, (name, *words))


def _good(parameter: inspect.Parameter, target: str) -> str | None:
    """Return the name of a thing that fits a parameter, if there is one."""
    things = _things()
    of_robot = f"{parameter.name} of robot"
    if target.startswith(("robot.", "rps.")) and of_robot in things:
        return of_robot
    if parameter.name in things:
        return parameter.name
    kind = str(parameter.annotation)
    for name, thing in things.items():
        if type(thing).__module__.startswith("rps_pin") and type(thing).__name__ in kind:
            return name
    return None


def use(given: Case, folder: Path) -> None:
    """Make the call.

    Raises
    ------
    RPSPinError
        As the call.
    WrongAnswerError
        If an answer has a NaN.
    """
    name, *words = given.arguments
    values = {}
    for word in words:
        parameter, _, value = word.partition("=")
        values[parameter] = ODD[value]() if value in ODD else _things()[value]
    before = Path.cwd()
    os.chdir(folder)
    try:
        with np.errstate(all="ignore"):
            answer = targets()[name](**values)
            if inspect.isgenerator(answer):
                answer = [one for one, _ in zip(answer, range(3), strict=False)]
    finally:
        os.chdir(before)
    if _has_nan(answer):
        raise WrongAnswerError(f"{name} not finite: {words}")


def _has_nan(answer: Any, depth: int = 3) -> bool:
    if isinstance(answer, (float, np.ndarray)):
        numbers = np.asarray(answer)
        return bool(numbers.dtype.kind in "fc" and np.isnan(numbers).any())
    if depth and isinstance(answer, (tuple, list)):
        return any(_has_nan(one, depth - 1) for one in answer)
    return False
