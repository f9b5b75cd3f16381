"""Calls of a robot's generated functions; samples that they leave open, Python's answer.

Python's functions also say what is wrong with arguments, and which sample is refused and why: the
answers and errors are theirs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, RPSPinError
from rps_pin.rps.dynamics.actuator_forces import actuator_forces
from rps_pin.rps.dynamics.force_equations import ForceTerms
from rps_pin.rps.generated.robot import limits_of, terms_numbers
from rps_pin.rps.kinematics.forward_kinematics import CONDITION_LIMIT, forward_kinematics
from rps_pin.rps.kinematics.inverse_kinematics import inverse_kinematics
from rps_pin.rps.kinematics.legs import Legs
from rps_pin.rps.kinematics.samples import Errors, check_errors_option
from rps_pin.rps.parameters import RPSParameters

if TYPE_CHECKING:
    from rps_pin.rps.generated.library import RobotCode

#: Arrays of samples, and which samples are answered.
Found = tuple[Sequence[Array], Bools | np.bool_]
#: What answers samples that generated code leaves open, of their arrays and `errors`.
Answer = Callable[..., Found]
_NO_WRENCH = np.zeros(6)


class RobotCalls:
    """Generated functions of one robot.

    Parameters
    ----------
    code
        The functions of all robots.
    parameters, terms, max_condition
        Of the robot.
    threads
        By how many threads a batch is computed.
    """

    def __init__(
        self,
        code: RobotCode,
        parameters: RPSParameters,
        terms: ForceTerms,
        max_condition: float,
        threads: int = 1,
    ) -> None:
        self.code, self.threads = code, threads
        self._parameters, self._terms, self._max_condition = parameters, terms, max_condition
        self._limits = np.array(limits_of(parameters))
        self._force_numbers = np.array(terms_numbers(terms)), self._limits
        self._radii = parameters.base_radius, parameters.platform_radius
        self._direct = np.array([*self._radii, CONDITION_LIMIT])

    def inverse_kinematics(self, pose: ArrayLike, errors: Errors) -> Legs:
        """Return leg lengths and angles; see `RPSRobot.inverse_kinematics`."""

        def answer(pose: ArrayLike, errors: Errors) -> Found:
            legs = inverse_kinematics(self._parameters, pose, errors=errors)
            return (legs.length, legs.angle, _as_numbers(legs.reachable)), legs.reachable

        given, numbers = (pose,), (self._limits,)
        (length, angle, kept), _ = self._settled(
            "inverse_kinematics", given, numbers, answer, errors
        )
        reachable: Any = kept[0] == 1.0 if kept.ndim == 1 else kept[..., 0] == 1.0
        if errors == "raise" and not reachable.all():
            (length, angle, _), reachable = answer(pose, errors)  # it raises
        return Legs(length, angle, reachable)

    def forward_kinematics(self, length: ArrayLike, near: ArrayLike, errors: Errors) -> Array:
        """Return poses of leg lengths; see `RPSRobot.forward_kinematics`."""
        numbers = (self._direct,)

        def python(length: ArrayLike, near: ArrayLike, errors: Errors) -> Found:
            found = forward_kinematics(length, near, *self._radii, errors=errors)
            return (found.pose, _as_numbers(found.reached)), found.reached

        def in_many_steps(length: ArrayLike, near: ArrayLike, errors: Errors) -> Found:
            if errors != "mask":
                found, reached = python(length, near, errors)
                return found[:1], reached
            (pose, at_end), _ = self._settled("followed", (length, near), numbers, python, errors)
            return (pose,), at_end[..., 0] == 1.0

        given, name = (length, near), "forward_kinematics"
        (pose,), good = self._settled(name, given, numbers, in_many_steps, errors)
        return _masked(pose, good, errors)

    def actuator_forces(
        self,
        motion: tuple[ArrayLike, ArrayLike, ArrayLike],
        wrench: ArrayLike | None,
        errors: Errors,
    ) -> Array:
        """Return actuator forces; see `RPSRobot.actuator_forces`."""

        def answer(
            pose: ArrayLike, rate: ArrayLike, acceleration: ArrayLike, wrench: Any, errors: Errors
        ) -> Found:
            force = actuator_forces(
                *(self._parameters, self._terms, self._max_condition),
                (pose, rate, acceleration),
                wrench=wrench,
                errors=errors,
            )
            return (force,), ~np.ma.getmaskarray(force)[..., 0]

        given = (*motion, _NO_WRENCH if wrench is None else wrench)
        try:
            is_batch = np.ndim(given[3]) > 1 and _batch(given) != _batch(motion)
        except ValueError:  # rows of different lengths
            is_batch = True
        if is_batch:
            answer(*given, errors)  # its words: a wrench does not make a batch
        numbers = self._force_numbers
        (force,), good = self._settled("actuator_forces", given, numbers, answer, errors)
        return _masked(force, good, errors)

    def _settled(
        self,
        name: str,
        given: Sequence[ArrayLike],
        numbers: Sequence[Array],
        answer: Answer,
        errors: Errors,
    ) -> Found:
        """Return the results of a function, and which samples have one."""
        code = self.code
        if errors.__class__ is not str or errors not in ("raise", "mask"):
            check_errors_option(errors)
        if not (code.lanes or _are_single(given)):
            return answer(*given, errors)
        try:
            *found, status = code.functions[name](*given, *numbers, threads=self.threads)
        except InputError:
            return answer(*given, errors)
        if status.__class__ is int:
            return answer(*given, errors) if status else (found, np.True_)
        good = status == 0
        return (found, good) if good.all() else _filled(found, good, given, answer, errors)


def _filled(
    found: Sequence[Array], good: Bools, given: Sequence[ArrayLike], answer: Answer, errors: Errors
) -> Found:
    """Return results of all samples, those left open from `answer`."""
    left = ~good
    if left.all():
        return answer(*given, errors)
    arrays = [np.asarray(one, dtype=np.float64) for one in given]
    some = [np.broadcast_to(one, good.shape + one.shape[-1:])[left] for one in arrays]
    try:
        parts, fine = answer(*some, "mask")
    except RPSPinError:
        return answer(*given, errors)  # its error names the sample
    if errors == "raise" and not fine.all():
        return answer(*given, errors)
    for whole, part in zip(found, parts, strict=True):
        whole[left] = part
    good[left] = fine
    return found, good


def _as_numbers(condition: Bools) -> Array:
    """Return truth values (...) as numbers (..., 1)."""
    return np.asarray(condition, dtype=np.float64)[..., None]


def _masked(array: Array, good: Bools | np.bool_, errors: Errors) -> Array:
    """Return an array (..., 3), with ``"mask"`` a masked one."""
    if errors == "raise":
        return array
    return np.ma.MaskedArray(array, np.repeat(~np.asarray(good)[..., None], 3, axis=-1))


def _are_single(given: Sequence[ArrayLike]) -> bool:
    return all(np.ndim(one) == 1 for one in given)


def _batch(given: Sequence[ArrayLike]) -> tuple[int, ...] | None:
    """Return the shape of a batch, if shapes go together."""
    try:
        return np.broadcast_shapes(*(np.shape(one)[:-1] for one in given))
    except ValueError:
        return None
