"""What logs say of base parameters: filtered forces and regressors, and the least squares of them.

With F the filter, D the samples in use, W the regressor of the base parameters and y the forces
less the known part, the noise e of the forces being white with a deviation s_a of each actuator,

    D F y = D F W b + D F e,     A = sum_a G_a / s_a^2,  G_a = (D F W_a)' (D F W_a),
    b = A^-1 sum_a (D F W_a)' (D F y_a) / s_a^2,
    cov b = A^-1 [sum_a (F' D F W_a)' (F' D F W_a) / s_a^2] A^-1,

since filtered noise is no longer white. s_a follows from the residuals: their sum of squares is
s_a^2 times the samples, times the share of white noise that the filter leaves, less what the
parameters take.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError
from rps_pin.numerics.linear_algebra import rank
from rps_pin.task.identification.filtering import MOST, Filter, motion_of, usual_cut_off
from rps_pin.task.identification.log import Log, Piece, pieces_of
from rps_pin.task.identification.model import DynamicsModel, Progress

#: Rounds of weighing by the residuals.
_ROUNDS = 5
#: Deviation of a force, over its root mean square, that is taken as no noise at all.
_EXACT = 1e-9
#: Singular values below this part of the largest, columns of one length, are none.
_NONE = 1e-9
#: A parameter is determined alone if no unseen combination of length 1 has more of it.
_ALONE = 1e-6


class Evidence(NamedTuple):
    """A piece of a log, filtered."""

    time: Array
    """Shape (n,), s."""
    rows: Array
    """D F W, shape (n, na, b), zero where a sample is not in use."""
    forces: Array
    """D F y, shape (n, na)."""
    measured: Array
    """F tau, shape (n, na), N or N m."""
    used: Bools
    """D, shape (n,)."""
    filtered: Filter


class Fit(NamedTuple):
    """The least squares of evidence."""

    values: Array
    """b, shape (b,)."""
    covariance: Array
    """Shape (b, b), of what is seen."""
    alone: Bools
    """Which are determined by themselves."""
    rank: int
    noise: Array
    """s_a, shape (na,), N or N m."""
    condition: float
    """Of the weighed regressor, columns of one length, of what is seen."""


def evidence_of(
    model: DynamicsModel,
    logs: Sequence[Log],
    cut_off: float | None,
    near: Array | None,
    doubts: list[str],
    progress: Progress = iter,
) -> list[Evidence]:
    """Return what logs say, and add what is doubtful to `doubts`.

    Raises
    ------
    InputError
        If all pieces are too short, or the cut-off frequency is too high for the sampling rate.
    """
    found = []
    for log in logs:
        pieces = pieces_of(model, log, doubts)
        longest = max(pieces, key=lambda one: one.time.size)
        own = usual_cut_off(longest.position, longest.step) if cut_off is None else cut_off
        if not own * longest.step <= MOST:
            raise InputError(
                f"{log.name}: cut_off = {own:.4g} Hz is too high for samples every "
                f"{longest.step:.4g} s; at most {MOST / longest.step:.4g} Hz is possible"
            )
        kept = [one for one in pieces if one.time.size > 3 * Filter(own, one.step).reach]
        if not kept:
            needed = 3 * Filter(own, longest.step).reach
            raise InputError(
                f"{log.name} is too short: {longest.time.size} samples without a gap, and more "
                f"than {needed} are needed with a cut-off frequency of {own:.4g} Hz"
            )
        if len(kept) < len(pieces):
            lost = sum(one.time.size for one in pieces if not any(one is other for other in kept))
            doubts.append(
                f"{log.name}: {len(pieces) - len(kept)} pieces between gaps are too short for the "
                f"filter: {lost} samples are left out"
            )
        found += [_filtered(model, one, own, near, progress) for one in kept]
    return found


def _filtered(
    model: DynamicsModel, piece: Piece, cut_off: float, near: Array | None, progress: Progress
) -> Evidence:
    filtered = Filter(cut_off, piece.step)
    states = model.states(*motion_of(piece.position, filtered), near, progress)
    rows, known = model.regressor(states)
    measured = filtered(piece.force)
    used = np.ones(len(rows), dtype=np.bool_)
    used[: filtered.reach] = used[-filtered.reach :] = False
    for k in np.flatnonzero(piece.held):
        used[max(k - filtered.reach, 0) : k + filtered.reach + 1] = False
    forces = np.where(used[:, None], measured - filtered(known), 0.0)
    base = filtered(rows[:, :, model.base.independent]) * used[:, None, None]
    return Evidence(piece.time, base, forces, measured, used, filtered)


def fit(model: DynamicsModel, evidence: Sequence[Evidence]) -> Fit:
    """Return the weighed least squares.

    Columns of the rows beyond those of the base parameters are of further parameters, believed 0.

    Raises
    ------
    InputError
        If there are fewer samples than it takes.
    """
    na, size = len(model.actuators), evidence[0].rows.shape[2]
    believed = np.append(model.believed, np.zeros(size - model.believed.size))
    count = sum(one.used.sum() * one.filtered.noise for one in evidence)
    if count * na < 2 * size:
        used = sum(int(one.used.sum()) for one in evidence)
        there = sum(one.used.size for one in evidence)
        raise InputError(
            f"{used} of {there} samples of {na} forces can be used, and, filtered, count for "
            f"{count * na:.3g} independent numbers: too few for {size} parameters; log longer"
        )
    stacks = [_stacked(evidence, k) for k in range(na)]
    noisy = [_noisy_information(evidence, k) for k in range(na)]
    squares = np.array([float(one[:, -1] @ one[:, -1]) for one in stacks])
    least = _EXACT**2 * np.maximum(squares, np.finfo(np.float64).tiny)
    variance = np.maximum(squares / count, np.finfo(np.float64).tiny)
    for _ in range(_ROUNDS):
        values, covariance, seen = _solved(believed, stacks, noisy, variance)
        taken = np.array([np.sum(covariance * (one[:-1, :-1].T @ one[:-1, :-1])) for one in stacks])
        left = np.array([np.sum((one @ np.append(values, -1.0)) ** 2) for one in stacks])
        variance = np.maximum(left, least) / np.maximum(count - taken / variance, count / 10)
    values, covariance, seen = _solved(believed, stacks, noisy, variance)
    return Fit(values, covariance, seen.alone, seen.rank, np.sqrt(variance), seen.condition)


class _Seen(NamedTuple):
    rank: int
    alone: Bools
    condition: float


def _stacked(evidence: Sequence[Evidence], actuator: int) -> Array:
    """Return R of the rows (W, y) of an actuator: R'R is their square, shape (b + 1, b + 1)."""
    blocks = [
        np.hstack([one.rows[one.used, actuator], one.forces[one.used, actuator, None]])
        for one in evidence
    ]
    triangle = np.zeros((blocks[0].shape[1],) * 2)
    for block in blocks:
        new = np.linalg.qr(np.vstack([triangle, block]), "r")
        triangle = np.zeros_like(triangle)
        triangle[: len(new)] = new
    return triangle


def _noisy_information(evidence: Sequence[Evidence], actuator: int) -> Array:
    """Return the sum of (F' D F W)' (F' D F W), shape (b, b)."""
    found = np.zeros((evidence[0].rows.shape[2],) * 2)
    for one in evidence:
        twice = one.filtered(one.rows[:, actuator])
        found += twice.T @ twice
    return found


def _solved(
    believed: Array, stacks: Sequence[Array], noisy: Sequence[Array], variance: Array
) -> tuple[Array, Array, _Seen]:
    """Return b nearest to what is believed where it is not seen, and its covariance."""
    whole = np.vstack([one / np.sqrt(v) for one, v in zip(stacks, variance, strict=True)])
    rows, right = whole[:, :-1], whole[:, -1]
    lengths = np.linalg.norm(rows, axis=0)
    unit = np.where(lengths > 0, lengths, 1.0)
    left, s, across = np.linalg.svd(rows / unit, full_matrices=False)
    count = rank(s, _NONE)
    seen = across[:count]
    step = seen.T @ ((left[:, :count].T @ (right - rows @ believed)) / s[:count])
    turn = (seen.T / s[:count] ** 2) @ seen / unit  # A^-1 of what is seen, left unit below
    turn = turn / unit[:, None]
    spread = sum(one / v for one, v in zip(noisy, variance, strict=True))
    alone = np.abs(across[count:]).max(axis=0, initial=0.0) < _ALONE
    known = _Seen(count, alone, float(s[0] / s[count - 1]) if count else 1.0)
    return believed + step / unit, turn @ spread @ turn, known
