"""The option ``errors`` of the 3-RPS's batch functions: samples that fail are refused or masked."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import ArrayLike

import rps_pin.paper
import rps_pin.rps
from rps_pin.arrays import Array
from rps_pin.errors import (
    ClosureError,
    InputError,
    RPSPinError,
    SingularityError,
    UnreachableError,
)
from rps_pin.paper import lagrange_forces, virtual_work_forces
from rps_pin.rps import (
    Payload,
    RPSRobot,
    constraint_residuals,
    force_causes,
    joint_reactions,
    leg_jacobian_rates,
    leg_jacobians,
    pose_acceleration,
    pose_from_placement,
    pose_from_position,
    pose_rate,
    poses_from,
    singularity_measures,
)

#: Its limits are narrow; without them, it has legs of no length at FLAT (g = h).
MICRO = RPSRobot.from_preset("micro").with_payload(Payload(0.5, (0.01, 0.0, 0.02)))
FREE = RPSRobot(MICRO.parameters.without_limits(), MICRO.payload)
#: Without limits, and singular at FLAT (g = 2 h).
SOKOLOV = RPSRobot.from_preset("sokolov")
H = SOKOLOV.parameters.platform_radius
FLAT = np.zeros(3)
BATCH, BAD = (2, 3), (1, 2)

rng = np.random.default_rng(15)
MICRO_POSE = [0.225, 0, 0] + [0.005, 0.05, 0.05] * rng.uniform(-1, 1, (*BATCH, 3))
POSE = [0.4, 0, 0] + [0.05, 0.2, 0.2] * rng.uniform(-1, 1, (*BATCH, 3))
RATE, ACCELERATION, SPEED = rng.uniform(-1, 1, (3, *BATCH, 3))
WRENCH = rng.uniform(-1, 1, (*BATCH, 6))
MOTION = {"rate": RATE, "acceleration": ACCELERATION}
POSITION, ROTATION = SOKOLOV.platform_placement(POSE)
LENGTH = FREE.inverse_kinematics(MICRO_POSE).length
NEAR = MICRO_POSE + np.array([0.001, 0.01, -0.01])
_AXIS = np.array([0.6, 0.0, 0.8])
OTHER_MODE = 2 * np.outer(_AXIS, _AXIS) - np.eye(3)
"""A half turn about an axis outside the base plane."""


class Case(NamedTuple):
    """A function, its batch, the values of a sample that fails, and its error."""

    function: Callable[..., Any]
    samples: dict[str, Array]
    bad: dict[str, ArrayLike]
    error: type[RPSPinError]
    other: Mapping[str, Any] = MappingProxyType({})
    told: bool = False
    """Whether a mask in the result tells which samples fail, and other fields may be numbers."""

    @property
    def name(self) -> str:
        return str(self.function.__qualname__)

    def spoilt(self) -> dict[str, Array]:
        """Return the samples with the bad one in its place."""
        samples = {name: np.array(value, dtype=float) for name, value in self.samples.items()}
        for name, value in self.bad.items():
            samples[name][BAD] = value
        return samples

    def call(self, samples: dict[str, Array], **options: Any) -> list[Array]:
        return list(_arrays(self.function(**self.other, **samples, **options)))


def _arrays(result: Any) -> Iterator[Array]:
    """Yield the arrays of a result; masked entries are NaN."""
    if isinstance(result, np.ma.MaskedArray):
        yield result.filled(np.nan)
    elif isinstance(result, (np.ndarray, np.generic)):
        yield result
    else:
        for part in result if isinstance(result, tuple) else vars(result).values():
            yield from _arrays(part)


def _cases() -> Iterator[Case]:
    out, flat = {"pose": [0.5, 0, 0]}, {"pose": FLAT}
    micro, pose = {"pose": MICRO_POSE}, {"pose": POSE}
    free, sokolov = {"parameters": FREE.parameters}, {"parameters": SOKOLOV.parameters}
    length = {"length": LENGTH, "near": NEAR}
    centre = dict(zip("xyz", np.moveaxis(POSITION, -1, 0), strict=True))
    placement = {"position": POSITION, "rotation": ROTATION}
    radius = {"platform_radius": H}
    yield Case(MICRO.inverse_kinematics, micro, out, UnreachableError, told=True)
    yield Case(FREE.inverse_kinematics, micro, flat, UnreachableError, told=True)
    for bad in ({"length": [0.2, 0.2, 5.0]}, {"near": FLAT}):
        error = ClosureError if "length" in bad else UnreachableError
        yield Case(FREE.forward_kinematics, length, bad, error)
    yield Case(leg_jacobians, micro, flat, UnreachableError, free)
    yield Case(leg_jacobian_rates, micro | {"rate": RATE}, flat, UnreachableError, free)
    for other, at, error in ((free, micro, UnreachableError), (sokolov, pose, SingularityError)):
        yield Case(pose_rate, at | {"leg_speed": SPEED}, flat, error, other, told=True)
        legs = {"rate": RATE, "leg_acceleration": SPEED}
        yield Case(pose_acceleration, at | legs, flat, error, other, told=True)
        yield Case(virtual_work_forces, at | MOTION, flat, error, other)
        yield Case(lagrange_forces, at | MOTION, flat, error, other)
    yield Case(singularity_measures, pose, {"pose": [0.4, 7.0, 0]}, InputError, sokolov)
    for method in (MICRO.motion, MICRO.state):
        yield Case(method, micro | MOTION, out, UnreachableError)
    loaded = MOTION | {"wrench": WRENCH}
    for robot, at, bad, error in (
        (MICRO, micro, out, UnreachableError),
        (FREE, micro, flat, UnreachableError),
        (SOKOLOV, pose, flat, SingularityError),
    ):
        yield Case(robot.actuator_forces, at | loaded, bad, error)
        for function in (joint_reactions, force_causes):
            yield Case(function, at | loaded, bad, error, {"robot": robot})
    yield Case(poses_from, centre, {"x": 2 * H}, UnreachableError, radius, told=True)
    yield Case(
        pose_from_position,
        {"position": POSITION},
        {"position": [2 * H, 0, 0.4]},
        UnreachableError,
        radius,
    )
    half = {"position": [H * (_AXIS[0] ** 2), 0, 0.4], "rotation": OTHER_MODE}
    yield Case(pose_from_placement, placement, {"position": [0.01, 0, 0.4]}, ClosureError, radius)
    yield Case(pose_from_placement, placement, half, InputError, radius)
    for function in (pose_from_placement, constraint_residuals):
        yield Case(function, placement, {"rotation": 2 * np.eye(3)}, InputError, radius)


CASES = list(_cases())
each_case = pytest.mark.parametrize(
    "case", CASES, ids=[f"{case.name}-{case.error.__name__}-{i}" for i, case in enumerate(CASES)]
)


@each_case
def test_a_sample_that_fails_is_refused_or_masked_and_the_others_are_unchanged(case: Case) -> None:
    samples = case.spoilt()
    failed = np.zeros(BATCH, dtype=bool)
    failed[BAD] = True
    with pytest.raises(case.error) as refusal:
        case.call(samples)
    np.testing.assert_array_equal(refusal.value.failed, failed)

    masked = case.call(samples, errors="mask")
    others = case.call({name: value[~failed] for name, value in samples.items()})
    assert len(masked) == len(others) > 0
    for found, expected in zip(masked, others, strict=True):
        assert found.shape == (*BATCH, *expected.shape[1:])
        np.testing.assert_allclose(found[~failed], expected, rtol=1e-12, atol=1e-12)
        if found.dtype == bool:
            assert not found[failed].any()
        elif not case.told:
            assert np.isnan(found[failed]).all()
    assert not case.told or any(found.dtype == bool for found in masked)


@each_case
def test_one_sample_without_batch_dimensions_is_masked(case: Case) -> None:
    samples = {name: value[BAD] for name, value in case.spoilt().items()}
    with pytest.raises(case.error):
        case.call(samples)
    for found in case.call(samples, errors="mask"):
        assert not found.any() if found.dtype == bool else case.told or np.isnan(found).all()


@each_case
def test_all_samples_may_fail_and_arguments_broadcast(case: Case) -> None:
    """The arguments that fail are one for all samples."""
    samples = case.spoilt()
    samples |= {name: samples[name][BAD] for name in case.bad}
    if samples.keys() != case.bad.keys():
        for found in case.call(samples, errors="mask"):
            assert found.shape[:2] == BATCH
            assert not found.any() if found.dtype == bool else case.told or np.isnan(found).all()


@each_case
def test_an_unknown_option_and_wrong_arguments_raise(case: Case) -> None:
    with pytest.raises(InputError, match="errors = 'ignore': it must be 'raise' or 'mask'"):
        case.call(case.samples, errors="ignore")
    for name, value in case.samples.items():
        spoilt = np.array(value)
        spoilt[BAD] = np.nan
        with pytest.raises(InputError, match="not finite"):
            case.call(case.samples | {name: spoilt}, errors="mask")


def test_every_kind_of_failure_is_masked_in_one_call() -> None:
    """A pose beyond a limit and a singular one are found one after the other."""
    p = SOKOLOV.parameters.replace(leg_length_limits=(0.0, 1.0))
    pose = POSE.copy()
    pose[0, 0], pose[BAD] = [5.0, 0, 0], FLAT
    found = joint_reactions(RPSRobot(p), pose, RATE, ACCELERATION, errors="mask")
    masked = np.isnan(found.prismatic).all(axis=(-1, -2))
    np.testing.assert_array_equal(np.argwhere(masked), [[0, 0], BAD])
    # A leg of no length is refused before singular poses are looked for.
    p = FREE.parameters
    pose = MICRO_POSE.copy()
    pose[0, 0], pose[BAD] = FLAT, [0.0, np.pi, 0.0]
    force = virtual_work_forces(p, pose, RATE, ACCELERATION, errors="mask")
    np.testing.assert_array_equal(np.argwhere(np.isnan(force).all(axis=-1)), [[0, 0], BAD])


# Every public function ----------------------------------------------------------------------------

#: Public functions of samples without the option: why no finite sample can fail by itself.
WITHOUT = {
    "RPSRobot.platform_placement": "every pose has a placement",
    "RPSRobot.assembly_modes": "lengths that cannot close have no modes",
    "angles_from_pose": "every pose has angles",
    "position_from_pose": "every pose has a centre",
    "parasitic_motion": "every pose has a centre",
    "platform_twist": "the platform's motion is smooth at every pose",
    "size_motion": "the samples are one motion, with one result",
}
SAMPLES = {"pose", "length", "position", "rotation"}


def test_every_public_function_of_samples_has_the_option_or_cannot_fail() -> None:
    public = [getattr(room, n) for room in (rps_pin.rps, rps_pin.paper) for n in room.__all__]
    public += [getattr(RPSRobot, n) for n in dir(RPSRobot) if not n.startswith("_")]
    options, without = set(), set()
    for function in filter(inspect.isfunction, public):
        parameters = inspect.signature(function).parameters
        if "errors" in parameters:
            assert parameters["errors"].default == "raise"
            options.add(function.__qualname__)
        elif any(n in SAMPLES and p.annotation == "ArrayLike" for n, p in parameters.items()):
            without.add(function.__qualname__)
    assert options == {case.name for case in CASES}
    assert without == set(WITHOUT)
