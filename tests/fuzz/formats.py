"""Each file format: its mutants, and the real use that follows reading."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.control import load_scenario
from rps_pin.errors import RPSPinError
from rps_pin.rps.motion.trajectory_file import load_trajectory
from rps_pin.rps.robot_file import load_robot
from rps_pin.rps.workspace import load_workspace, volume
from tests.fuzz import commands, public_calls, tables, workspace_mutants
from tests.fuzz.beside_mujoco import compare
from tests.fuzz.case import Case, WrongAnswerError, require_finite
from tests.fuzz.xml_mutants import XmlMutator
from tests.fuzz.yaml_mutants import YamlMutator

ROOT = Path(__file__).resolve().parents[2]
START = Path(__file__).resolve().parent / "start"
#: Ticks of a scenario that are run, and samples of a trajectory.
_TICKS, _SAMPLES = 20, 5


class Format(NamedTuple):
    """A kind of input."""

    mutant: Callable[[Random], Case]
    use: Callable[[Case, Path], None]


def case(format_: str, number: int) -> Case:
    """Return the mutant of a number; the same at each call."""
    return FORMATS[format_].mutant(Random(f"{format_} {number}"))


@cache
def _text(path: Path) -> str:
    return path.read_text("utf-8")


# Mechanisms ---------------------------------------------------------------------------------------

_URDF = XmlMutator(
    words={
        "type": [
            "revolute",
            "continuous",
            "prismatic",
            "fixed",
            "floating",
            "planar",
            "screw",
            "ball",
        ],
        "joint": ["turn", "follow", "slide", "none"],
    },
    open_tags={"visual", "collision", "material"},
    required={
        *("joint/parent", "joint/child", "joint@type", "joint@name", "link@name", "parent@link"),
        *("child@link", "mimic@joint", "mass@value", "inertial/mass"),
    },
    strict=True,
)
_URDF_STARTS = [
    START / "dialects.urdf",
    *(ROOT / "urdf" / f"{n}.urdf" for n in ("four_bar", "rrs")),
]
_MJCF = XmlMutator(
    words={
        "type": [
            "hinge",
            "slide",
            "ball",
            "free",
            "sphere",
            "box",
            "capsule",
            "mesh",
            "plane",
            "ellipsoid",
            "cylinder",
        ],
        "angle": ["degree", "radian"],
        "active": ["true", "false"],
    }
)
_MJCF_STARTS = [START / f"{name}.xml" for name in ("loop", "bodies", "weld")]
_DESCRIPTION = YamlMutator(required={"frame_a", "frame_b", "joint", "joints", "into", "urdf"})
_DESCRIPTIONS = ["four_bar", "gripper", "slider_crank", "differential", "cassie_leg", "rrs"]
_GEPETTO = YamlMutator()
_GEPETTO_START = """
closed_loop: [[coupler_tip, rocker_tip]]
type: [3d]
name_mot: [crank_joint]
joint_name: [coupler_joint, rocker_joint]
joint_type: [UJOINT_YZ, SPHERICAL]
"""


def _urdf(rng: Random) -> Case:
    content, why = _URDF.mutant(_text(rng.choice(_URDF_STARTS)), rng)
    return Case("URDF", {"robot.urdf": content}, must_refuse=why)


def _use_urdf(given: Case, folder: Path) -> None:
    path = given.put(folder)
    mechanism = ClosedLoopModel.from_urdf(path, [], [])
    if given.must_refuse:
        return
    ours = [
        name for name, nv in zip(mechanism.model.names, mechanism.model.nvs, strict=True) if nv == 1
    ]
    driven = [name for name in ours[:40] if name not in _mimicking(mechanism)]
    mechanism = ClosedLoopModel.from_urdf(path, [], driven)
    _use_mechanism(mechanism)
    compare(mechanism, path, "URDF")


def _mimicking(mechanism: ClosedLoopModel) -> set[str]:
    return {getattr(one, "joint", "") for one in mechanism.closures}


def _mjcf(rng: Random) -> Case:
    content, _ = _MJCF.mutant(_text(rng.choice(_MJCF_STARTS)), rng)
    return Case("MJCF", {"robot.xml": content})


def _use_mjcf(given: Case, folder: Path) -> None:
    path = given.put(folder)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        mechanism = ClosedLoopModel.from_mjcf(path)
    _use_mechanism(mechanism)
    compare(mechanism, path, "MJCF", [str(one.message) for one in told])


def _description(rng: Random) -> Case:
    name = rng.choice(_DESCRIPTIONS)
    content, why = _DESCRIPTION.mutant(_text(ROOT / "urdf" / f"{name}.yaml"), rng)
    tree = (ROOT / "urdf" / f"{name}.urdf").read_bytes()
    return Case("mechanism", {"robot.yaml": content, f"{name}.urdf": tree}, must_refuse=why)


def _gepetto(rng: Random) -> Case:
    content, why = _GEPETTO.mutant(_GEPETTO_START, rng)
    tree = (ROOT / "urdf" / "four_bar.urdf").read_bytes()
    return Case("Gepetto", {"robot.yaml": content, "four_bar.urdf": tree}, must_refuse=why)


def _use_description(given: Case, folder: Path) -> None:
    _use_mechanism(ClosedLoopModel.load(given.put(folder)))


def _use_mechanism(mechanism: ClosedLoopModel) -> None:
    """Ask for what a mechanism is loaded for; refusals are answers, numbers must be finite."""
    nv = mechanism.model.nv
    rest, answered = np.zeros(nv), 0
    calls: list[Callable[[], Any]] = [
        lambda: mechanism.describe().rank,
        lambda: mechanism.inverse_dynamics(q, rest, rest).tau,
        lambda: mechanism.forward_dynamics(q, rest, np.zeros(mechanism.actuated_indices.size)),
        lambda: mechanism.generalised_force(q, rest, rest),
        lambda: mechanism.simulate(q, duration=1e-3, step=1e-3).q,
    ]
    q = mechanism.close(mechanism.home)
    require_finite(q, "configuration")
    for call in calls:
        try:
            require_finite(call(), "an answer")
            answered += 1
        except RPSPinError as error:
            if not str(error):
                raise WrongAnswerError("an error without message") from None


# The 3-RPS ----------------------------------------------------------------------------------------

_PARAMETERS = YamlMutator(
    required={
        *("base_radius", "platform_radius", "platform_mass", "platform_inertia"),
        *("leg_mass", "leg_com", "leg_inertia"),
    }
)
_PRESETS = ROOT / "src" / "rps_pin" / "rps" / "presets"
_TRAJECTORY = YamlMutator(
    required=[
        "kind",
        "radius",
        "pitch",
        "height",
        "start",
        "end",
        "poses",
        "tilt",
        "amplitude",
        "frequency",
    ]
)
_TRAJECTORIES = sorted((ROOT / "docs" / "trajectories").glob("*.yaml"))
_SCENARIO = YamlMutator(
    required=["robot", "trajectory", "controller", "kind", "proportional", "derivative"]
)
_SCENARIOS = sorted((ROOT / "docs" / "scenarios").glob("*.yaml"))


@cache
def _micro() -> RPSRobot:
    return RPSRobot.from_preset("micro")


def _parameters(rng: Random) -> Case:
    content, why = _PARAMETERS.mutant(
        _text(_PRESETS / f"{rng.choice(['micro', 'sokolov'])}.yaml"), rng
    )
    return Case("parameters", {"robot.yaml": content}, must_refuse=why)


def _use_parameters(given: Case, folder: Path) -> None:
    robot = load_robot(str(given.put(folder)))
    p = robot.parameters
    low, high = p.leg_length_limits
    height = 0.5 * (low + min(high, low + 4 * p.base_radius))
    pose = (height, 0.01, -0.02)
    require_finite(robot.inverse_kinematics(pose).length, "lengths")
    forces = robot.actuator_forces(pose, (0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    require_finite(forces, "forces")
    require_finite(
        robot.mechanism.inverse_dynamics(*robot.state(pose, np.zeros(3), np.zeros(3))).tau, "forces"
    )


def _trajectory(rng: Random) -> Case:
    start = rng.choice(_TRAJECTORIES)
    content, why = _TRAJECTORY.mutant(_text(start), rng)
    return Case("trajectory", {"path.yaml": content}, must_refuse=why)


def _table(rng: Random) -> Case:
    content, why = tables.mutant(rng)
    return Case("CSV", {"path.csv": content}, must_refuse=why)


def _use_trajectory(given: Case, folder: Path) -> None:
    path = load_trajectory(given.put(folder), _micro())
    require_finite(path.duration, "duration")
    for time in np.linspace(0.0, path.duration, _SAMPLES):
        sample = path.sample(time)
        require_finite([sample.pose, sample.rate, sample.acceleration], "a sample")
        forces = _micro().actuator_forces(sample.pose, sample.rate, sample.acceleration)
        require_finite(forces, "forces")


def _scenario(rng: Random) -> Case:
    content, why = _SCENARIO.mutant(_text(rng.choice(_SCENARIOS)), rng)
    return Case("scenario", {"scenario.yaml": content}, must_refuse=why)


def _use_scenario(given: Case, folder: Path) -> None:
    scenario = load_scenario(given.put(folder))
    controller, plant = scenario.controller(), scenario.plant()
    given = scenario.entry.controller.force_limit
    limit = scenario.model.parameters.actuator_force_limit if given is None else given
    for tick in range(_TICKS):
        target = scenario.trajectory.sample(
            min(tick * scenario.entry.period, scenario.trajectory.duration)
        )
        controller.tick(plant.reading(), target)
        forces = np.asarray(controller.forces)
        require_finite(forces, "forces")
        if (np.abs(forces) > np.asarray(limit) * (1 + 1e-12)).any():
            raise WrongAnswerError(f"forces beyond the limit: {forces}, {limit}")
        try:
            plant.step(forces)
        except RPSPinError:
            break
        require_finite(plant.configuration, "the plant's configuration")


def _workspace(rng: Random) -> Case:
    content, why = workspace_mutants.mutant(rng)
    return Case("workspace", {"w.h5": content}, must_refuse=why)


def _use_workspace(given: Case, folder: Path) -> None:
    found = load_workspace(given.put(folder))
    require_finite(found.pose, "poses")
    require_finite(found.conditioning, "conditioning")
    if not 0 <= found.inside.sum() <= found.reason.size:
        raise WrongAnswerError(f"inside: {found.inside}")
    require_finite(volume(found)[0], "volume")


FORMATS: dict[str, Format] = {
    "URDF": Format(_urdf, _use_urdf),
    "MJCF": Format(_mjcf, _use_mjcf),
    "mechanism": Format(_description, _use_description),
    "Gepetto": Format(_gepetto, _use_description),
    "parameters": Format(_parameters, _use_parameters),
    "trajectory": Format(_trajectory, _use_trajectory),
    "CSV": Format(_table, _use_trajectory),
    "scenario": Format(_scenario, _use_scenario),
    "workspace": Format(_workspace, _use_workspace),
    "command": Format(commands.mutant, commands.use),
    "call": Format(public_calls.mutant, public_calls.use),
}
