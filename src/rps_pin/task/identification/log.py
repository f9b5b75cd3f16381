"""Logs of a machine: time, the actuators' positions and forces; their faults and doubts.

Faults are errors: numbers that are not finite, times that do not increase. What can be worked with
is a doubt, in words: gaps (the pieces between them are used apart), forces that are held at their
largest (such samples are left out), steps that are not equal (positions and forces are
interpolated).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, did_you_mean
from rps_pin.task.identification.model import DynamicsModel
from rps_pin.validation import numbers, positive_number

#: A step longer than this many times the median step is a gap.
GAP = 3.5
#: Steps whose deviation from the median step is above this share of it are not equal.
UNEQUAL = 0.02
#: So many samples in a row with the same largest force are saturated.
HELD = 5
#: Share of an actuator's stated limit from which a force is at the limit.
_AT_LIMIT = 0.999


class Log(NamedTuple):
    """What was recorded of a machine, n samples; see `force_log`."""

    time: Array
    """Shape (n,), s, increasing."""
    position: Array
    """Of the actuators, shape (n, na), m or rad."""
    force: Array
    """Of the actuators, shape (n, na), N or N m: positive does work when the position grows."""
    name: str = "log"
    """For messages: its file, as an example."""
    notes: tuple[str, ...] = ()
    """What was not used of its file, in words."""


def force_log(
    model: DynamicsModel,
    time: ArrayLike,
    position: ArrayLike,
    force: ArrayLike | None = None,
    *,
    current: ArrayLike | None = None,
    constants: Mapping[str, float] | None = None,
    held: bool = False,
    name: str = "log",
) -> Log:
    """Return a log, checked.

    Parameters
    ----------
    model
        The mechanism.
    time
        Shape (n,), s.
    position
        Of the actuators, in the order of ``model.actuators``, shape (n, na), m or rad.
    force
        Their forces, shape (n, na), N or N m.
    current, constants
        In place of forces: currents, shape (n, na), A, and of each actuator, by name, the force of
        one ampere, gear included, N/A or N m/A.
    held
        Whether each force, or current, acts from its sample to the next, as that of a digital
        drive's command does. At the sample, where the position is read, it is then the mean of the
        one before and its own.
    name
        For messages.

    Raises
    ------
    InputError
        If an array has the wrong shape or numbers that are not finite, times do not increase, or
        neither forces nor currents with constants are given.
    """
    t = numbers(time, "time", "one number for each sample")
    if t.ndim != 1 or t.size < 2:
        raise InputError(f"{name}: time has shape {t.shape}; a log has two samples or more")
    shape = (t.size, len(model.actuators))
    a = _checked(name, position, "position", shape, model.actuators)
    if (force is None) == (current is None):
        raise InputError(f"{name}: give forces, or currents with constants: one of them")
    if force is not None:
        tau = _checked(name, force, "force", shape, model.actuators)
    else:
        assert current is not None
        factors = _constants(model, constants or {})
        tau = factors * _checked(name, current, "current", shape, model.actuators)
    if not np.isfinite(t).all():
        raise InputError(f"{name}: time is not finite at sample {int(np.argmin(np.isfinite(t)))}")
    rising = np.diff(t) > 0
    if not rising.all():
        k = int(np.argmin(rising))
        raise InputError(
            f"{name}: times must increase, but sample {k + 1} is at {t[k + 1]:.9g} s after "
            f"{t[k]:.9g} s ({np.count_nonzero(~rising)} such samples)"
        )
    if held:
        tau = np.vstack([tau[:1], (tau[:-1] + tau[1:]) / 2])
    notes: tuple[str, ...] = ()
    if force is not None and constants:
        notes = (f"{name} has forces: constants of {', '.join(constants)} are not used",)
    return Log(t, a, tau, name, notes)


def _checked(
    name: str, given: ArrayLike, what: str, shape: tuple[int, int], actuators: tuple[str, ...]
) -> Array:
    array = numbers(given, what, "one number for each sample and actuator")
    if array.shape != shape:
        raise InputError(
            f"{name}: {what} has shape {array.shape}; expected {shape}, the actuators being "
            f"{', '.join(actuators)}"
        )
    good = np.isfinite(array)
    if not good.all():
        row, column = np.argwhere(~good)[0]
        raise InputError(
            f"{name}: {what} of {actuators[column]} is {array[row, column]} at sample {row} "
            f"({np.count_nonzero(~good)} such numbers)"
        )
    return array


def _constants(model: DynamicsModel, given: Mapping[str, float]) -> Array:
    for one in given:
        if one not in model.actuators:
            raise InputError(
                f"constants: no actuator {one!r}{did_you_mean(one, model.actuators)}; there are: "
                f"{', '.join(model.actuators)}"
            )
    missing = [one for one in model.actuators if one not in given]
    if missing:
        raise InputError(f"constants: none is given of {', '.join(missing)}")
    return np.array(
        [positive_number(given[one], f"constant of {one}", "N/A") for one in model.actuators]
    )


class Piece(NamedTuple):
    """Samples of a log at equal steps, without a gap."""

    time: Array
    position: Array
    force: Array
    held: Bools
    """Where a force is saturated, shape (n,)."""
    step: float
    """s."""


def pieces_of(model: DynamicsModel, log: Log, doubts: list[str]) -> list[Piece]:
    """Return the pieces of a log between its gaps, and add what is doubtful to `doubts`."""
    steps = np.diff(log.time)
    step = float(np.median(steps))
    held = _saturated(model, log, doubts)
    gaps = np.flatnonzero(steps > GAP * step)
    if gaps.size:
        places = ", ".join(f"{steps[k]:.4g} s at {log.time[k]:.6g} s" for k in gaps[:4])
        more = f" and {gaps.size - 4} more" if gaps.size > 4 else ""
        doubts.append(
            f"{log.name} has gaps ({places}{more}; the step is {step:.4g} s): what is between "
            "them is filtered apart"
        )
    found = []
    unequal = 0.0
    for part in np.split(np.arange(log.time.size), gaps + 1):
        t = log.time[part]
        piece = Piece(t, log.position[part], log.force[part], held[part], step)
        if t.size > 3:
            own = (t[-1] - t[0]) / (t.size - 1)
            even = t[0] + own * np.arange(t.size)
            off = float(np.abs(t - even).max() / own)
            unequal = max(unequal, off if off > UNEQUAL else 0.0)
            piece = _even(piece, even) if off > UNEQUAL else piece._replace(step=own)
        found.append(piece)
    if unequal:
        doubts.append(
            f"{log.name} has unequal steps, up to {unequal:.2g} of a step from even times: "
            "positions and forces are interpolated"
        )
    return found


def _even(piece: Piece, time: Array) -> Piece:
    """Return a piece at even times: cubic splines, and the nearest sample's saturation."""
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 (slow to import)

    position, force = (CubicSpline(piece.time, one)(time) for one in (piece.position, piece.force))
    nearest = np.abs(np.searchsorted(piece.time, time)).clip(0, time.size - 1)
    step = float(time[1] - time[0])
    return Piece(time, position, force, piece.held[nearest], step)


def _saturated(model: DynamicsModel, log: Log, doubts: list[str]) -> Bools:
    """Return at which samples a force is held at its largest, or at the actuator's limit."""
    limit = np.array(model.mechanism.model.effortLimit)[model.mechanism.actuated_indices]
    found = np.zeros(log.force.shape, dtype=np.bool_)
    size = np.abs(log.force)
    for k, name in enumerate(model.actuators):
        top = size[:, k].max()
        runs = _long_runs((size[:, k] == top) & (top > 0), HELD)
        at = size[:, k] >= _AT_LIMIT * limit[k] if limit[k] > 0 else np.zeros_like(runs)
        found[:, k] = runs | at
        if found[:, k].any():
            why = "at its limit" if at.any() else "held at its largest value"
            doubts.append(
                f"{log.name}: the force of {name} is {why}, {top:.6g}, at "
                f"{np.count_nonzero(found[:, k])} of {log.time.size} samples: they are left out"
            )
    return np.asarray(found.any(axis=1))


def _long_runs(mask: Bools, least: int) -> Bools:
    """Return the entries that are in a row of so many."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.view(np.int8), [0]])))
    found = np.zeros(mask.size, dtype=np.bool_)
    for start, stop in edges.reshape(-1, 2):
        found[start:stop] = stop - start >= least
    return found
