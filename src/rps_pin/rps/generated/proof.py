"""What is compared before generated code of the 3-RPS is used: Python's functions, on random poses.

Several robots, with limits, friction, payload and gravity askew, some poses beyond the limits, at
half a turn, beside singularities, or with a leg without length. What generated code answers must be
Python's answer; what it leaves to Python is counted, and must be few among plain poses.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.constraints.system import MAX_CONDITION
from rps_pin.errors import CompileError
from rps_pin.rps.dynamics.actuator_forces import actuator_forces
from rps_pin.rps.dynamics.force_equations import ForceTerms
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.generated.robot import limits_of, terms_numbers
from rps_pin.rps.kinematics.forward_kinematics import CONDITION_LIMIT, forward_kinematics
from rps_pin.rps.kinematics.inverse_kinematics import inverse_kinematics
from rps_pin.rps.parameters import RPSParameters

#: Largest difference relative to the size of what is compared.
TOLERANCE = 1e-10
#: Direct kinematics loses as many digits as the condition number has: beyond this one, the pose's
#: leg lengths are compared instead of the pose.
_POSE_COMPARED = 1e4
#: Least part of plain poses that generated code must answer.
_LEAST_PART = 0.9
#: Samples of a robot, not a multiple of 8; and those of them that are computed one by one.
_SAMPLES, _SINGLY = 403, 23


class Case(NamedTuple):
    """A robot and its samples."""

    parameters: RPSParameters
    terms: ForceTerms
    pose: Array
    length: Array
    """Of the legs in the poses."""
    near: Array
    """Poses from which direct kinematics sets out."""
    motion: tuple[Array, Array, Array]
    """Rate, acceleration and wrench."""
    plain: Bools
    """Samples within the limits, far from singularities."""
    followed: Bools
    """Samples of direct kinematics."""


class _Comparison:
    """The largest differences so far, by function."""

    def __init__(self, compiler: str) -> None:
        self.compiler = compiler
        self.worst: dict[str, float] = {}

    def equal(self, name: str, found: Array, right: Array, size: Array | float) -> None:
        """Refuse a difference; of nothing there is none."""
        difference = np.abs(found - right) / np.maximum(size, 1e-300)
        worst = float(difference.max(initial=0.0))
        self.worst[name] = max(self.worst.get(name, 0.0), worst)
        if not (difference <= TOLERANCE).all():
            at = np.unravel_index(int(np.argmax(~(difference <= TOLERANCE))), difference.shape)
            raise CompileError(
                f"proof of {name}: {found[at]!s}, but Python's function gives {right[at]!s}; they "
                f"may differ by {TOLERANCE} of {float(np.broadcast_to(size, found.shape)[at]):.3g}",
                self.compiler,
            )

    def answers(self, name: str, answered: Bools, allowed: Bools, plain: Bools) -> None:
        """Refuse answers where Python's function has none, and too few answers."""
        if (answered & ~allowed).any():
            raise CompileError(
                f"proof of {name}: {int((answered & ~allowed).sum())} samples are answered that "
                "Python's function refuses",
                self.compiler,
            )
        part = float(answered[plain].mean())
        if not part >= _LEAST_PART:
            raise CompileError(
                f"proof of {name}: {part:.1%} of plain poses are answered; at least "
                f"{_LEAST_PART:.0%} must be",
                self.compiler,
            )

    def refusals(self, name: str, refused: Bools, answered: Bools) -> None:
        """Refuse refusals where Python's function has an answer."""
        if (refused & answered).any():
            raise CompileError(
                f"proof of {name}: {int((refused & answered).sum())} samples are refused that "
                "Python's function answers",
                self.compiler,
            )


def prove(functions: Mapping[str, Any], compiler: str) -> dict[str, float]:
    """Compare generated functions with Python's; return the largest relative differences.

    Raises
    ------
    CompileError
        If one is above `TOLERANCE`, or a sample is answered that Python refuses, or too few are.
    """
    found = _Comparison(compiler)
    for case in cases():
        _inverse(found, functions["inverse_kinematics"], case)
        _direct(found, functions, case)
        _forces(found, functions["actuator_forces"], case)
    return found.worst


def _called(
    function: Any, samples: tuple[Array, ...], numbers: tuple[Array, ...]
) -> Iterator[tuple[list[Array], Bools, slice]]:
    """Yield results, which samples have one, and which samples: of a batch, and of single calls."""
    *results, status = function(*samples, *numbers)
    yield results, status == 0, slice(None)
    some = slice(0, _SINGLY)
    rows = [function.call(*one, *numbers) for one in zip(*(a[some] for a in samples), strict=True)]
    *results, status = (np.array(column) for column in zip(*rows, strict=True))
    yield results, status == 0, some


def _inverse(found: _Comparison, function: Any, case: Case) -> None:
    name, numbers = "inverse_kinematics", np.array(limits_of(case.parameters))
    right = inverse_kinematics(case.parameters, case.pose, errors="mask")
    size = right.length.max(axis=-1, keepdims=True)
    for (length, angle, kept), settled, some in _called(function, (case.pose,), (numbers,)):
        answered = settled & (kept[:, 0] == 1.0)
        found.answers(name, answered, right.reachable[some], case.plain[some])
        found.refusals(name, settled & ~answered, right.reachable[some])
        expected = right.length[some][settled], right.angle[some][settled]
        found.equal(name, length[settled], expected[0], size[some][settled])
        found.equal(name, angle[settled], expected[1], 1.0)


def _direct(found: _Comparison, functions: Mapping[str, Any], case: Case) -> None:
    """Compare `forward_kinematics`, and `followed`, which also tells lines that are not."""
    p, used = case.parameters, case.followed
    radii, free = (p.base_radius, p.platform_radius), p.without_limits()
    length, near, plain = case.length[used], case.near[used], case.plain[used]
    right = forward_kinematics(length, near, *radii, errors="mask")
    numbers = np.array([*radii, CONDITION_LIMIT])
    size = np.array([p.platform_radius, 1.0, 1.0])
    for name in ("forward_kinematics", "followed"):
        for results, settled, some in _called(functions[name], (length, near), (numbers,)):
            pose = results[0]
            answered = settled & (results[1][:, 0] == 1.0) if len(results) > 1 else settled
            found.answers(name, answered, right.reached[some], plain[some])
            found.refusals(name, settled & ~answered, right.reached[some])
            sharp = answered & (right.condition[some] <= _POSE_COMPARED)
            found.equal(name, pose[sharp], right.pose[some][sharp], size)
            again = inverse_kinematics(free, pose[answered], errors="mask").length
            wanted = length[some][answered]
            longest: Array = wanted.max(axis=-1, keepdims=True)
            found.equal(name, again, wanted, longest)


def _forces(found: _Comparison, function: Any, case: Case) -> None:
    name, p = "actuator_forces", case.parameters
    rate, acceleration, wrench = case.motion
    motion = case.pose, rate, acceleration
    right = actuator_forces(p, case.terms, MAX_CONDITION, motion, wrench=wrench, errors="mask")
    size = np.abs(right.data).max(axis=-1, keepdims=True)
    numbers = np.array(terms_numbers(case.terms)), np.array(limits_of(p))
    expected, allowed = np.asarray(right.data), ~np.ma.getmaskarray(right)[:, 0]
    for (force,), answered, some in _called(function, (*motion, wrench), numbers):
        found.answers(name, answered, allowed[some], case.plain[some])
        found.equal(name, force[answered], expected[some][answered], size[some][answered])


def cases() -> Iterator[Case]:
    """Yield robots with poses, always the same."""
    rng = np.random.default_rng(16)
    for preset, swing in (("micro", 0.05), ("sokolov", 0.4)):
        bare = RPSParameters.from_preset(preset)
        h = bare.platform_radius
        rough = bare.replace(
            gravity=np.array([1.0, -2.0, -9.0]),
            prismatic_friction=0.5,
            prismatic_damping=5.0,
            revolute_friction=0.01,
            revolute_damping=0.02,
            rod_mass=0.2,
            rod_com=0.3 * h,
            spherical_rest_angle=0.05,
        )
        payload = Payload(0.3, (0.1 * h, 0.2 * h, 0.1 * h), 1e-3 * h * h * np.eye(3))
        yield _case(bare, ForceTerms.of(bare), swing, rng, wild_lines=preset == "sokolov")
        yield _case(rough, ForceTerms.of(rough, payload), swing, rng, wild_lines=False)


def _case(
    p: RPSParameters, terms: ForceTerms, swing: float, rng: np.random.Generator, *, wild_lines: bool
) -> Case:
    """Return a robot's samples, a quarter of them wild: anywhere, and beyond the limits.

    Lines between wild poses are followed only if asked for: Python takes most of a second there.
    """
    low, high = p.leg_length_limits
    middle = (low + high) / 2 if high < math.inf else p.base_radius
    size = np.array([0.03 * middle, swing, swing])
    pose = np.array([middle, 0.0, 0.0]) + size * rng.uniform(-1, 1, (_SAMPLES, 3))
    near = pose + 0.1 * size * rng.uniform(-1, 1, pose.shape)
    wild = np.arange(_SAMPLES) % 4 == 3
    count = int(wild.sum())
    pose[wild] = np.stack(
        [rng.uniform(-2.0, 2.0, count) * middle, *rng.uniform(-3.2, 3.2, (2, count))], axis=-1
    )
    near[wild] = pose[wild] + 0.1 * rng.normal(size=(count, 3)) * [middle, 1.0, 1.0]
    # Beside the base plane, where legs do not hold a level platform, and in it.
    pose[3], pose[7] = [1e-7 * middle, 0.0, 0.0], [0.0, 0.0, 0.0]
    plain = inverse_kinematics(p, pose, errors="mask").reachable & ~wild
    free = p.without_limits()
    legs = inverse_kinematics(free, pose, errors="mask")
    followed = legs.reachable & inverse_kinematics(free, near, errors="mask").reachable
    rate, acceleration = rng.normal(size=(2, _SAMPLES, 3))
    wrench = rng.normal(size=(_SAMPLES, 6))
    return Case(
        *(p, terms, pose, legs.length, near),
        (rate, 10.0 * acceleration, wrench),
        *(plain, followed & (wild_lines | ~wild)),
    )
