"""C functions of one 3-RPS robot for a controller: kinematics, and computed torque as one call.

They stand beside those of its mechanism (`rps_pin.codegen.export`), whose vectors are a tree's:
here a pose is (z, tilt_x, tilt_y), and the robot's numbers are part of the code.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from rps_pin.arrays import Array
from rps_pin.codegen.export.mechanism import mechanism_package
from rps_pin.codegen.export.package import Case, Function, Order, Package, Real, conditions
from rps_pin.codegen.expressions.elimination import Householder
from rps_pin.codegen.units import Kernel, Routine, Unit
from rps_pin.errors import InputError, did_you_mean
from rps_pin.rps.dynamics.force_equations import ForceTerms
from rps_pin.rps.generated.follow import FOLLOW, follow_kernels
from rps_pin.rps.generated.robot import (
    DIRECT,
    end_kernel,
    forces_kernel,
    inverse_kernel,
    limits_of,
    start_kernel,
    terms_numbers,
)
from rps_pin.rps.kinematics.forward_kinematics import CONDITION_LIMIT
from rps_pin.rps.robot import RPSRobot

#: Poses of the self-test beside the one in the middle.
_POSES = 5
#: Gains (1/s^2, 1/s) of the self-test: critical damping at 10 Hz.
_KP, _KD = (2 * np.pi * 10.0) ** 2, 2 * 2 * np.pi * 10.0
#: How far from the pose the tracker sets out, and the targets are: m in platform radii, and rad.
_AWAY = 0.01

_POSE = "m, rad, rad"
#: What arguments and results are.
_ARGUMENTS: Mapping[str, str] = {
    "pose": f"z, tilt_x, tilt_y, {_POSE}",
    "rate": "its rate, m/s, rad/s, rad/s",
    "acceleration": "its second derivative, m/s^2, rad/s^2, rad/s^2",
    "length": "lengths of the legs, m",
    "speed": "their rates, m/s",
    "angle": "angles of the legs, rad",
    "near": f"the pose before, {_POSE}",
    "target": f"pose that is wanted, {_POSE}",
    "target_rate": "its rate, m/s, rad/s, rad/s",
    "target_acceleration": "its second derivative, m/s^2, rad/s^2, rad/s^2",
    "stiffness": "gains of the pose, 1/s^2",
    "damping": "gains of the rate, 1/s",
    "force": "actuator forces of the legs, N",
}
#: The functions and their sentences.
SENTENCES: Mapping[str, str] = {
    "inverse_kinematics": "Leg lengths of a pose within the robot's limits.",
    "direct_kinematics": (
        "Pose of leg lengths that continues the pose before: the legs are followed on the line to "
        "them, each step guaranteed by the Newton-Kantorovich theorem. Call it with each reading."
    ),
    "pose_rate": "Rate of the pose, by the speeds of the legs.",
    "actuator_forces": "Actuator forces of a motion within the robot's limits.",
    "computed_torque": (
        "Pose and rate by leg lengths and speeds, and the actuator forces of the acceleration "
        "target_acceleration + damping (target_rate - rate) + stiffness (target - pose). The next "
        "call's near is this one's pose."
    ),
}
_NOTE = (
    "A pose of the 3-RPS is the platform centre's height z above the base and its rotation vector "
    "(tilt_x, tilt_y, 0). The functions of poses return {open} too where a leg is beyond its "
    "limits or near them, near a singularity, and where leg lengths were not followed to their end."
)


def robot_package(
    robot: RPSRobot,
    *,
    name: str,
    real: Real = "double",
    functions: Sequence[str] = (),
    frames: Sequence[str] = (),
) -> Package:
    """Return what the files of a robot are made from: of its mechanism, and of `SENTENCES`.

    Parameters
    ----------
    robot
        The robot.
    name, real, functions, frames
        As for `mechanism_package`; the functions' names are also those of `SENTENCES`.

    Raises
    ------
    InputError
        If a name does not fit.
    """
    robot.parameters.require_bodies()
    own = [one for one in dict.fromkeys(functions or SENTENCES) if one in SENTENCES]
    others = [one for one in functions if one not in SENTENCES]
    #: What is asked of the mechanism, which has all by default, only to have its vectors.
    asked_for_vectors = [] if others or not functions else ["gaps"]
    try:
        package = mechanism_package(
            robot.mechanism,
            name=name,
            real=real,
            functions=others or asked_for_vectors,
            frames=frames,
        )
    except InputError as error:
        unknown = [one for one in others if did_you_mean(one, SENTENCES)]
        if unknown:
            near = did_you_mean(unknown[0], SENTENCES)
            raise InputError(f"no function {unknown[0]!r}{near}") from None
        raise error
    kept = [one for one in package.functions if one.name not in asked_for_vectors]
    return _with_robot(package, robot, own, kept)


def _with_robot(
    package: Package, robot: RPSRobot, own: Sequence[str], kept: Sequence[Function]
) -> Package:
    """Return a package with the robot's functions, and some of its mechanism's."""
    kernels, loops = _functions(robot, package.real == "float")
    unit = package.unit
    names = tuple(one.name for one in kept)
    joined = Unit(
        unit.name,
        (*unit.kernels, *kernels),
        (*unit.routines, *loops),
        (*own, *names),
        (unit.checked & set(names)) | set(own),
        unit.limit,
    )
    cases = _cases(robot, {one.name: one for one in kernels})
    made = [_exported(joined, one, cases[one]) for one in own]
    note = _NOTE.format(open=package.macro("OPEN"))
    legs = Order("Legs of length, speed, angle, force", ("leg 1", "leg 2", "leg 3"))
    return replace(
        package,
        unit=joined,
        functions=[*made, *kept],
        orders=[legs, *package.orders],
        notes=[*package.notes, note],
    )


def _exported(unit: Unit, name: str, cases: Sequence[Case]) -> Function:
    one = unit.function(name)
    named = [key for key, _ in (*one.inputs, *unit.handed_out(name))]
    words = {key: _ARGUMENTS[key] for key in named}
    operations = sum(
        int(kernel.function.n_instructions())
        for kernel in unit.kernels
        if kernel.name in (name, *one.calls, *FOLLOW.calls)
    )
    return Function(name, SENTENCES[name], words, operations, cases)


# Functions ----------------------------------------------------------------------------------------


def _bound(kernel: Kernel, **numbers: Sequence[float]) -> Kernel:
    """Return a kernel with some inputs replaced by numbers."""
    f = kernel.function
    names = [f.name_in(i) for i in range(f.n_in())]
    symbols = dict(zip(names, f.sx_in(), strict=True))
    given = {key: ca.DM(list(numbers[key])) if key in numbers else symbols[key] for key in names}
    left = [key for key in names if key not in numbers]
    outputs = [ca.densify(one) for one in f.call(list(given.values()))]
    called = f.name()
    made = ca.Function(called, [symbols[key] for key in left], outputs, left, f.name_out())
    return Kernel(made, kernel.chunk)


def _functions(robot: RPSRobot, single: bool) -> tuple[list[Kernel], list[Routine]]:
    """Return kernels and routines of a robot, those that are called before those that call."""
    p = robot.parameters
    limits = limits_of(p)
    inverse = _within_limits(_bound(inverse_kernel(), numbers=limits))
    forces = _bound(
        forces_kernel(),
        numbers=limits,
        terms=terms_numbers(ForceTerms.of(p)),
        wrench=[0.0] * 6,
    )
    kernels = [inverse, forces, _rate_kernel(inverse), _law_kernel(forces)]
    radii = p.base_radius, p.platform_radius
    numbers = ", ".join(f"CONST({number!r})" for number in (*radii, CONDITION_LIMIT))
    direct = Routine(
        "direct_kinematics",
        (("length", 3), ("near", 3)),
        (("pose", 3), ("check", 2)),
        f"""
    const REAL numbers[3] = {{{numbers}}};
    {DIRECT.name}(length, near, numbers, pose, check);
""",
        (DIRECT.name,),
    )
    computed_torque = Routine(
        "computed_torque",
        (
            *(("length", 3), ("speed", 3), ("near", 3)),
            *(("target", 3), ("target_rate", 3), ("target_acceleration", 3)),
            *(("stiffness", 3), ("damping", 3)),
        ),
        (("pose", 3), ("rate", 3), ("force", 3), ("check", 2)),
        """
    REAL of_pose[2], of_rate[2], of_force[2];
    direct_kinematics(length, near, pose, of_pose);
    pose_rate(pose, speed, rate, of_rate);
    law(pose, rate, target, target_rate, target_acceleration, stiffness, damping, force, of_force);
    check[0] = FMAX(FMAX(of_pose[0], of_rate[0]), of_force[0]);
    check[1] = CONST(0);
""",
        ("direct_kinematics", "pose_rate", "law"),
    )
    following = [*follow_kernels(single), start_kernel(), end_kernel()]
    return [*kernels, *following], [FOLLOW, DIRECT, direct, computed_torque]


def _within_limits(inverse: Kernel) -> Kernel:
    """Return inverse kinematics that flags what is beyond the limits, too."""
    pose = ca.SX.sym("pose", 3)
    length, angle, reachable, check = inverse.function.call([pose])
    flagged = ca.vertcat(ca.fmax(check[0], 2.0 * (1.0 - reachable)), 0.0)
    outputs = [length, angle, ca.densify(flagged)]
    return Kernel(
        ca.Function(inverse.name, [pose], outputs, ["pose"], ["length", "angle", "check"])
    )


def _rate_kernel(inverse: Kernel) -> Kernel:
    """Return x' of d' = (dd/dx) x'."""
    pose, speed = ca.SX.sym("pose", 3), ca.SX.sym("speed", 3)
    length, _, check = inverse.function.call([pose])
    rate = Householder(ca.jacobian(length, pose)).solve(speed)
    names = ["pose", "speed"], ["rate", "check"]
    return Kernel(ca.Function("pose_rate", [pose, speed], [ca.densify(rate), check], *names))


def _law_kernel(forces: Kernel) -> Kernel:
    """Return the forces of x'' = x_t'' + K_d (x_t' - x') + K_p (x_t - x)."""
    names = ["pose", "rate", "target", "target_rate", "target_acceleration", "stiffness", "damping"]
    given = [ca.SX.sym(name, 3) for name in names]
    x, v, target, target_rate, acceleration, stiffness, damping = given
    command = acceleration + damping * (target_rate - v) + stiffness * (target - x)
    outputs = forces.function.call([x, v, command])
    return Kernel(ca.Function("law", given, outputs, names, ["force", "check"]))


# Self-test ----------------------------------------------------------------------------------------


def _cases(robot: RPSRobot, kernels: Mapping[str, Kernel]) -> dict[str, list[Case]]:
    """Return poses within the limits with the Pinocchio engine's answers, by function."""
    found: dict[str, list[Case]] = {name: [] for name in SENTENCES}
    for sample in _samples(robot):
        for name, case in _answers(robot, kernels, sample).items():
            found[name].append(case)
    return found


def _samples(robot: RPSRobot) -> list[dict[str, Array]]:
    """Return motions near a pose in the middle of the workspace."""
    rng, p = np.random.default_rng(3), robot.parameters
    low, high = p.leg_length_limits
    middle = (low + high) / 2 if high < np.inf else p.base_radius
    size = np.array([0.02 * middle, 0.05, 0.05])
    away = _AWAY * np.array([p.platform_radius, 1.0, 1.0])
    samples = []
    for k in range(1 + _POSES):
        pose = np.array([middle, 0.0, 0.0]) + (size * rng.uniform(-1, 1, 3) if k else 0.0)
        rate, acceleration = size * rng.normal(size=(2, 3)) * [[1.0], [10.0]]
        near, target = pose + away * rng.uniform(-1, 1, (2, 3))
        gains = np.full(3, _KP), np.full(3, _KD)
        target_rate = rate + away * rng.uniform(-1, 1, 3)
        samples.append(
            {
                **{"pose": pose, "rate": rate, "acceleration": acceleration, "near": near},
                **{"target": target, "target_rate": target_rate},
                **{"target_acceleration": acceleration, "stiffness": gains[0], "damping": gains[1]},
            }
        )
    return samples


def _answers(
    robot: RPSRobot, kernels: Mapping[str, Kernel], sample: Mapping[str, Array]
) -> dict[str, Case]:
    x, v, a = sample["pose"], sample["rate"], sample["acceleration"]
    state = robot.state(x, v, a)
    model, mechanism = robot.mechanism.model, robot.mechanism
    names = [f"leg_{i}_{kind}" for kind in ("prismatic", "revolute") for i in (1, 2, 3)]
    joints = [model.joints[model.getJointId(name)] for name in names]
    length, angle = (state[0][[j.idx_q for j in part]] for part in (joints[:3], joints[3:]))
    speed = state[1][[j.idx_v for j in joints[:3]]]
    command = (
        sample["target_acceleration"]
        + sample["damping"] * (sample["target_rate"] - v)
        + sample["stiffness"] * (sample["target"] - x)
    )
    forces = mechanism.inverse_dynamics(*state).tau
    commanded = mechanism.inverse_dynamics(*robot.state(x, v, command)).tau
    known = {**sample, "length": length, "angle": angle, "speed": speed}
    scale = {
        "pose": np.maximum(np.abs(x), [robot.parameters.platform_radius, 1.0, 1.0]),
        **{key: np.full(3, np.abs(value).max()) for key, value in known.items() if key != "pose"},
    }
    scale |= {"near": np.zeros(3), "target": scale["pose"]}

    def run(name: str, given: Sequence[Array]) -> list[Array]:
        outputs = kernels[name].function.call(list(given))
        return [np.asarray(one.full()).ravel() for one in outputs][:-1]

    def direct(length: Array, near: Array) -> Array:
        pose = near
        for _ in range(6):  # Newton's method on the inverse kinematics
            (moved,) = run("pose_rate", [pose, length - run("inverse_kinematics", [pose])[0]])
            pose = pose + moved
        return pose

    def torque(given: Sequence[Array]) -> list[Array]:
        length, speed, near, *rest = given
        pose = direct(length, near)
        (rate,) = run("pose_rate", [pose, speed])
        return [pose, rate, *run("law", [pose, rate, *rest])]

    def case(inputs: Sequence[str], expected: Sequence[Array], evaluate: Any) -> Case:
        given = [known[key] for key in inputs]
        numbers = conditions(evaluate, given, [scale[key] for key in inputs])
        return Case(tuple(given), tuple(expected), tuple(float(one.max()) for one in numbers))

    tick = ("length", "speed", "near", "target", "target_rate", "target_acceleration")
    return {
        "inverse_kinematics": case(
            ["pose"], [length, angle], lambda given: run("inverse_kinematics", given)
        ),
        "direct_kinematics": case(["length", "near"], [x], lambda given: [direct(*given)]),
        "pose_rate": case(["pose", "speed"], [v], lambda given: run("pose_rate", given)),
        "actuator_forces": case(
            ["pose", "rate", "acceleration"], [forces], lambda given: run("actuator_forces", given)
        ),
        "computed_torque": case([*tick, "stiffness", "damping"], [x, v, commanded], torque),
    }
