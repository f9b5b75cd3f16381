"""Unknown motor constants: factors of the forces of some actuators, found with the parameters.

Of an actuator whose forces y are currents times a believed constant k, the true constant is c k:

    c (y - e) = W b + f,

with f the forces of what is known and e the noise of the currents, times k. Noise must not stand
in the regressor, or the answer is biased; so y is on the left alone, and linearised about the last
answer: with y scaled by the last c, and c = (1 + d) times that,

    y = (W b + f) / (1 + d) + e ~ W b + f - d (W b_0 + f) + e,

Gauss and Newton's method; at its end d = 0 and b_0 = b, and its covariance is that of both. If
f = 0, then (b, d) = (b_0, 1) changes nothing: all forces may be larger by one factor, and nothing
in the logs says which.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Indices
from rps_pin.errors import InputError, did_you_mean
from rps_pin.task.identification.evidence import Evidence, Fit, fit
from rps_pin.task.identification.model import DynamicsModel

#: Rounds, and the change of a factor over its deviation at which they end.
_ROUNDS, _SMALL = 30, 1e-3
#: Least factor of a step: a constant does not change its sign.
_LEAST = 0.2


class FactorFit(NamedTuple):
    """A fit with unknown factors."""

    fit: Fit
    """Of the base parameters alone."""
    evidence: list[Evidence]
    """With the forces times their factors."""
    factors: Array
    """c, shape (na,); 1 where it is known."""
    deviations: Array
    """Of c, shape (na,); 0 where it is known."""


def unknown_factors(model: DynamicsModel, names: Sequence[str]) -> Indices:
    """Return which actuators are named, or refuse."""
    for name in names:
        if name not in model.actuators:
            raise InputError(
                f"unknown_constants: no actuator {name!r}{did_you_mean(name, model.actuators)}; "
                f"there are: {', '.join(model.actuators)}"
            )
    if len(set(names)) < len(names):
        raise InputError(f"unknown_constants: {', '.join(names)}: one is named twice")
    return np.array([model.actuators.index(name) for name in names], dtype=np.intp)


def times(evidence: Sequence[Evidence], factors: Array) -> list[Evidence]:
    """Return evidence with the measured forces times factors (na,)."""
    return [
        one._replace(
            forces=one.forces + (factors - 1) * one.measured * one.used[:, None],
            measured=factors * one.measured,
        )
        for one in evidence
    ]


def fit_with_factors(
    model: DynamicsModel, evidence: Sequence[Evidence], unknown: Indices
) -> FactorFit:
    """Return the least squares of base parameters and factors.

    Raises
    ------
    InputError
        If nothing fixes the scale of the forces, or the rounds do not end.
    """
    factors, size = np.ones(len(model.actuators)), model.believed.size
    scaled = list(evidence)
    base = fit(model, scaled).values
    deviations = np.zeros_like(factors)
    for _ in range(_ROUNDS):
        found = fit(model, [_widened(one, base, unknown) for one in scaled])
        if not found.alone[size:].all():
            _refuse([model.actuators[k] for k in unknown[~found.alone[size:]]])
        step, spread = found.values[size:], np.sqrt(np.diag(found.covariance)[size:])
        base = found.values[:size]
        factors[unknown] *= np.maximum(1 + step, _LEAST)
        deviations[unknown] = factors[unknown] * spread
        scaled = times(evidence, factors)
        if (np.abs(step) <= np.maximum(_SMALL * spread, 1e-12)).all():
            own = found._replace(
                values=base,
                covariance=found.covariance[:size, :size],
                alone=found.alone[:size],
                rank=found.rank - unknown.size,
            )
            return FactorFit(own, scaled, factors, deviations)
    raise InputError(
        "unknown_constants: the factors of "
        f"{', '.join(model.actuators[k] for k in unknown)} still change after {_ROUNDS} rounds "
        f"(they are {factors[unknown].round(4).tolist()}): hold more as known, or give constants "
        "that are nearer"
    )


def _widened(one: Evidence, base: Array, unknown: Indices) -> Evidence:
    """Return evidence with a column -(W b_0 + f) for each unknown factor."""
    known = (one.measured - one.forces) * one.used[:, None]
    columns = np.zeros((*one.forces.shape, unknown.size))
    columns[:, unknown, np.arange(unknown.size)] = -(one.rows @ base + known)[:, unknown]
    return one._replace(rows=np.concatenate([one.rows, columns], axis=-1))


def _refuse(names: Sequence[str]) -> None:
    raise InputError(
        f"unknown_constants: nothing fixes the scale of the forces of {', '.join(names)}: bodies "
        "that are heavier by a factor, with constants that are larger by it, have the same "
        "currents. Hold something as known that these forces move: name in bodies= (--body) "
        "only the unknown ones, so that one whose mass is known is left out, or give one constant "
        "as known"
    )
