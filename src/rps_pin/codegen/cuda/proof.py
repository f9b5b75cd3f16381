"""Proof of generated CUDA on the card: each function against the Pinocchio engine, at first use."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from rps_pin.arrays import Array
from rps_pin.codegen.cuda.device import DeviceFunction
from rps_pin.codegen.engine.proof import ACCEPTED, Proof, Sample
from rps_pin.codegen.expressions.routines import BLOCK
from rps_pin.errors import CompileError

#: Rounding units that a result may differ by, over the condition number of J_d: what `ACCEPTED` is
#: in double precision at a condition number of 1e3.
_UNITS = 450.0
#: Condition numbers of J_d above which a state may be flagged.
_MAY_FLAG = {"float64": 1e3, "float32": 1e2}
#: Results smaller than this much of a function's largest number are left of sums that cancel.
_CANCELLED = {"float64": 1e-3, "float32": 1e-1}
#: Numbers below this count as rounding errors of zero, in units of the mechanism (`Proof.unit`).
_ZERO = 1e-6


def accepted(dtype: str, condition: float) -> float:
    """Return the largest relative difference that is accepted at a condition number of J_d."""
    if dtype == "float64":
        return ACCEPTED
    return _UNITS * float(np.finfo(dtype).eps) * max(condition, 1.0)


def differences(proof: Proof, function: DeviceFunction, to_host: Callable[[Any], Array]) -> float:
    """Return the largest relative difference of a function from the Pinocchio engine.

    Raises
    ------
    CompileError
        If it is above what is `accepted`, or the function flags a state that is regular.
    """
    name, dtype = function.name, str(function.dtype)
    given = [_arguments(function, sample, proof.step) for sample in proof.samples]
    outputs, flags = function([np.array(one) for one in zip(*given, strict=True)])
    results, status = [to_host(one) for one in outputs], to_host(flags)
    worst, compared = 0.0, 0
    for i, sample in enumerate(proof.samples):
        if status[i]:
            if sample.condition < _MAY_FLAG[dtype]:
                raise CompileError(
                    f"CUDA code of {name} flags a regular state (status {status[i]}, condition "
                    f"number {sample.condition:.3g})",
                    "NVRTC",
                )
            continue
        expected = _expected(proof, name, sample, [one[i] for one in results])
        least = _least(proof, function, sample, expected)
        most = proof.limit(name, sample)
        if dtype == "float32":
            most = accepted(dtype, sample.condition)
        for (output, _), result, wanted in zip(function.outputs, results, expected, strict=False):
            if wanted is not None:
                relative = _difference(f"{name}: {output}", result[i], wanted, least, most)
                worst = max(worst, relative)
        compared += 1
    if not compared:
        raise CompileError(f"CUDA code of {name} flags all {len(given)} states", "NVRTC")
    return worst


def _least(
    proof: Proof, function: DeviceFunction, sample: Sample, expected: Sequence[Any]
) -> float:
    """Return the size below which a result is rounding errors of larger numbers that cancel."""
    sizes = [np.abs(one).max(initial=0.0) for one in expected if one is not None]
    unit = _ZERO * proof.unit(function.name, sample)
    least = max(unit, _CANCELLED[str(function.dtype)] * float(np.max(sizes, initial=0.0)))
    if function.dtype == np.float32 and function.name == "forward_dynamics":
        # Actuator forces may hold the weight: then a is what is left of two large accelerations.
        falling = sample._replace(tau=np.zeros_like(sample.tau))
        (alone,) = proof.expected(function.name, falling, ())
        least = max(least, float(np.abs(alone).max(initial=0.0)))
    return least


def _difference(what: str, found: Array, wanted: Any, least: float, most: float) -> float:
    wanted = np.reshape(wanted, found.shape)
    error = np.abs(found - wanted)
    relative = float(error.max(initial=0.0)) / max(float(np.abs(wanted).max(initial=0.0)), least)
    if not relative <= most:
        at = np.unravel_index(int(np.argmax(error)), error.shape)
        raise CompileError(
            f"CUDA code does not agree with the Pinocchio engine: {what}{list(map(int, at))} = "
            f"{found[at]!r}, not {wanted[at]!r}: {relative:.3g} relative, at most {most:.3g} is "
            "accepted",
            "NVRTC",
        )
    return relative


def _arguments(function: DeviceFunction, sample: Sample, step: float) -> list[Any]:
    values: dict[str, Any] = sample._asdict()
    values["given"] = sample.near
    many = function.name == "motion"
    values |= {"h": step / BLOCK if many else step, "count": BLOCK}
    return [values[name] for name, _ in function.inputs]


def _expected(proof: Proof, name: str, sample: Sample, found: Sequence[Array]) -> list[Any]:
    """Return the Pinocchio engine's answers; of a motion, the state after the last of its steps.

    None where a function is not compared.
    """
    if name != "motion":
        return list(proof.expected(name, sample, found))
    every = proof.expected("steps", sample, ())
    return [None if one is None else np.reshape(one, (BLOCK, -1))[-1] for one in every]
