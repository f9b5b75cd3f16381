"""Base parameters: the combinations of parameters that decide the actuators' forces.

Columns of the regressor that depend linearly on those that are kept are left out, and their
parameters are added to those of the columns that they are made of,

    W_d = W_i K,     W p = W_i (p_i + K p_d) = W_i b.

Source: M. Gautier, Numerical calculation of the base inertial parameters of robots, J. Robotic
Systems 8(4), 1991; here with two Gram-Schmidt passes, column by column, in place of the QR
decomposition.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Indices

#: A column whose part beyond those that are kept is below this share of its length depends on them.
DEPENDENT = 1e-7
#: A column below this share of the largest of its kind is none.
_NOTHING = 1e-9
#: Coefficients below this, in columns of one length, are rounding errors.
_ROUNDING = 1e-6


class BaseParameters(NamedTuple):
    """Which parameters, and combinations of them, decide the forces."""

    independent: Indices
    """Columns that are kept, shape (b,)."""
    matrix: Array
    """b = matrix @ p, shape (b, p)."""

    def words(self, labels: Sequence[str], terms: int = 4) -> tuple[str, ...]:
        """Return each combination in words, with so many terms at most."""
        found = []
        for j, row in zip(self.independent, self.matrix, strict=True):
            falling = np.argsort(-np.abs(row), kind="stable")[: np.count_nonzero(row)].tolist()
            others = [k for k in falling if k != j]
            parts = [f"{row[k]:+.4g} {labels[k]}" for k in others[:terms]]
            if len(others) > terms:
                parts.append(f"and {len(others) - terms} more")
            found.append(" ".join([labels[int(j)], *parts]))
        return tuple(found)


def base_parameters(rows: Array) -> BaseParameters:
    """Return the base parameters of a regressor at many states.

    The columns are gone through from the last to the first: of those that depend on each other,
    that of the body that is further on in the tree is kept.

    Parameters
    ----------
    rows
        W of all states, in rows, shape (n, p); n should be some times p.
    """
    lengths = np.linalg.norm(rows, axis=0)
    there = lengths > _NOTHING * lengths.max(initial=0.0)
    unit = rows[:, there] / lengths[there]
    places = np.flatnonzero(there)
    unit, places = unit[:, ::-1], places[::-1]
    basis = np.empty((len(rows), min(unit.shape)))
    kept: list[int] = []
    for j, column in enumerate(unit.T):
        rest = column.copy()
        for _ in range(2):
            rest -= basis[:, : len(kept)] @ (basis[:, : len(kept)].T @ rest)
        size = float(np.linalg.norm(rest))
        if size > DEPENDENT and len(kept) < basis.shape[1]:
            basis[:, len(kept)] = rest / size
            kept.append(j)
    kept.sort(reverse=True)  # the order of the parameters
    others = np.setdiff1d(np.arange(unit.shape[1]), kept)
    coefficients = np.linalg.lstsq(unit[:, kept], unit[:, others], rcond=None)[0]
    coefficients[np.abs(coefficients) < _ROUNDING] = 0.0
    independent, dependent = places[kept], places[others]
    matrix = np.zeros((len(kept), rows.shape[1]))
    matrix[np.arange(len(kept)), independent] = 1.0
    matrix[:, dependent] = coefficients * lengths[dependent] / lengths[independent][:, None]
    return BaseParameters(np.asarray(independent, dtype=np.intp), matrix)
