"""What must hold of a configuration to be inside, bounded over boxes: limits, and type II.

Over a box, a joint's coordinate is q_0 + S (x - x_0) + z, which is linear but for z. With the
actuators' part of dy/dx, which is K = d(actuators)/d(task) in one unit, within D of S: with M about
the inverse of S, K is regular if the row sums of |1 - M S| + |M| D are below 1, and the sign of its
determinant is that of S.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import MechanismError
from rps_pin.numerics.bits import Flags, bit_of, distinct
from rps_pin.numerics.intervals import share_beyond
from rps_pin.task.certification.cones import Cones, Rooms
from rps_pin.task.certification.equations import Equations, inverses
from rps_pin.task.certification.newton import Sheets
from rps_pin.task.certification.reasons import LimitWords
from rps_pin.task.workspace.reasons import SINGULAR

#: Rooms within this of zero are proven to be neither, rad or characteristic lengths.
_ROUNDED, _SLACK = 1e-12, 1e-9
#: A determinant of rows of unit length that is smaller than this has no sign in floats.
_SIGNED = 1e-9


class Judged(NamedTuple):
    """What is proven of boxes, shape (n,) each."""

    inside: Bools
    why: Flags
    """Bits of the reasons of boxes that are outside; 0 of others."""
    shares: Array
    """Parts of the others that are inside and outside, at least, shape (n, 2)."""


class _Limited(NamedTuple):
    """A joint with limits: lower and upper, in the unit of y."""

    z: int
    """Where it is in the state; or of x if it is a coordinate of the task."""
    unknown: int | None
    turns: bool
    lower: float
    upper: float
    unit: float
    names: tuple[str, str]
    """The reasons below and above; empty where there is no limit."""


class Margins:
    """Limits of joints and the side of the type II singularities."""

    def __init__(
        self,
        equations: Equations,
        side: Sheets,
        words: LimitWords,
        cones: Cones | None = None,
    ) -> None:
        self._cones = cones
        task, self._equations = equations.task, equations
        mechanism = task.mechanism
        self._limited = _limits(equations, words)
        names = [name for one in self._limited for name in one.names if name]
        #: Names of the reasons, in the order of their bits.
        self.reasons = distinct([*names, *words.cones, SINGULAR])
        self._bits = {name: bit_of(self.reasons, name) for name in self.reasons}
        self._of_cones = [self._bits[name] for name in words.cones]
        scale = np.where(task.angular, 1.0, mechanism.characteristic_length)
        self._x_scale = scale
        self._actuators = [_where(equations, int(k)) for k in task.of_actuators]
        if len(self._actuators) < task.size:
            raise MechanismError(
                f"{len(self._actuators)} actuators do not determine {task.size} coordinates: every "
                "point is singular"
            )
        self._square = len(self._actuators) == task.size
        self._side = float(self.signs(side)[0])

    @property
    def side(self) -> float:
        """Sign of the determinant at the start; 0 where it has none."""
        return self._side

    def judged(self, one: Sheets) -> Judged:
        """Return what is proven of boxes over which configurations are proven."""
        n = len(one.x)
        inside, why = np.ones(n, dtype=bool), np.zeros(n, dtype=np.uint64)
        shares = np.stack([np.ones(n), np.zeros(n)], axis=-1)
        for limited in self._limited:
            self._keep(limited, one, inside, why, shares)
        if self._cones is not None:
            self._keep_cones(self._cones.rooms(one), one, inside, why, shares)
        regular, sign = self._regular(one)
        right = regular & ((sign == self._side) if self._square else True)
        if self._square:
            why[regular & (sign == -self._side)] |= self._bits[SINGULAR]
        shares[~right, 0] = 0.0
        shares = np.where(np.isfinite(shares), np.clip(shares, 0.0, 1.0), 0.0)
        return Judged(inside & right & (why == 0), why, shares)

    def _keep(self, joint: _Limited, one: Sheets, inside: Bools, why: Flags, shares: Array) -> None:
        """Take the room that a joint has to its limits into account."""
        if joint.unknown is None:
            middle = one.x[:, joint.z] / joint.unit
            slopes = np.zeros((len(middle), one.x.shape[1]))
            slopes[:, joint.z] = 1.0 / joint.unit
            within = np.zeros(len(middle))
        else:
            middle = one.z[:, joint.z] / joint.unit
            slopes, within = one.slopes[:, joint.unknown], one.within[:, joint.unknown]
        lower, upper = joint.lower / joint.unit, joint.upper / joint.unit
        if joint.turns:
            centre = (lower + upper) / 2
            middle = middle - 2 * np.pi * np.round((middle - centre) / (2 * np.pi))
        reach = np.abs(slopes) * one.half
        reach_ = reach.sum(axis=-1) + within + _ROUNDED
        low, high = middle - reach_, middle + reach_
        inside &= (low > lower) & (high < upper)
        turn = 2 * np.pi if joint.turns else np.inf
        above = (low > upper + _SLACK) & (high < lower + turn - _SLACK)
        below = (high < lower - _SLACK) & (low > upper - turn + _SLACK)
        for broken, name in zip((below, above), joint.names, strict=True):
            if name:
                why[broken] |= self._bits[name]
        once = (high < lower + turn - _SLACK) & (low > upper - turn + _SLACK)
        open_ = np.flatnonzero(~((low > lower) & (high < upper)))
        if not open_.size:
            return
        for room, bound, bounded in (
            (middle - lower, low - lower, np.isfinite(lower)),
            (upper - middle, upper - high, np.isfinite(upper)),
        ):
            crossing = open_[~(bound[open_] > 0)] if bounded else open_[:0]
            if not crossing.size:
                continue
            a, z = reach[crossing].T, (within + _ROUNDED)[crossing]
            wide = a.max(axis=1, initial=0.0) > 0.0
            kept = share_beyond(a[wide], z - room[crossing])
            out = share_beyond(a[wide], z + _SLACK + room[crossing])
            out[~once[crossing]] = 0.0
            shares[crossing, 0] -= 1.0 - kept
            shares[crossing, 1] = np.maximum(shares[crossing, 1], out)

    def _keep_cones(
        self, rooms: Rooms, one: Sheets, inside: Bools, why: Flags, shares: Array
    ) -> None:
        """Take the room of cones into account."""
        reach = np.abs(rooms.slopes) * one.half[:, None]  # (n, cones, m)
        low = rooms.middle - reach.sum(axis=-1) - rooms.error - _ROUNDED
        high = rooms.middle + reach.sum(axis=-1) + rooms.error + _ROUNDED
        inside &= (low > 0).all(axis=-1)
        for k, bit in enumerate(self._of_cones):
            why[high[:, k] < -_SLACK] |= bit
            open_ = np.flatnonzero(~(low[:, k] > 0))
            if not open_.size:
                continue
            a, error = reach[open_, k].T, rooms.error[open_, k] + _ROUNDED
            wide, middle = a.max(axis=1) > 0.0, rooms.middle[open_, k]
            shares[open_, 0] -= 1.0 - share_beyond(a[wide], error - middle)
            broken = share_beyond(a[wide], error + _SLACK + middle)
            shares[open_, 1] = np.maximum(shares[open_, 1], broken)

    def _gains(self, one: Sheets) -> tuple[Array, Array]:
        """Return the middles and half widths of K in one unit, shape (n, na, m)."""
        n, m = one.x.shape
        S, D = np.zeros((n, len(self._actuators), m)), np.zeros((n, len(self._actuators), m))
        for i, (unknown, column) in enumerate(self._actuators):
            if unknown is None:
                S[:, i, column] = 1.0 / self._x_scale[column]
            else:
                S[:, i], D[:, i] = one.slopes[:, unknown], one.spread[:, unknown]
        return S * self._x_scale, D * self._x_scale * (1.0 + 1e-12)

    def _regular(self, one: Sheets) -> tuple[Bools, Array]:
        """Return over which boxes K has full rank, and the sign of its determinant there."""
        S, D = self._gains(one)
        known = np.asarray(np.isfinite(S + D).all(axis=(1, 2)))
        S = np.where(known[:, None, None], S, 0.0)
        D = np.where(known[:, None, None], D, 0.0)
        m = S.shape[-1]
        M = inverses(S) if self._square else _left_inverses(S)
        with np.errstate(invalid="ignore", over="ignore"):
            off = np.abs(np.eye(m) - M @ S) + np.abs(M) @ D
            # The rounding of all this is far below 1e-6 while the entries of |M| |S| are small.
            size = (np.abs(M) @ np.abs(S)).max(axis=(1, 2))
            regular = known & (off.sum(axis=-1).max(axis=-1) < 1.0 - 1e-6) & (size < 1e8)
        signs = self._signs_of(S) if self._square else np.ones(len(S))
        return regular & (signs != 0.0), signs

    def signs(self, one: Sheets) -> Array:
        """Return the signs of det K at the middles, 0 where they are not certain, shape (n,)."""
        S, _ = self._gains(one)
        return self._signs_of(S) if self._square else np.ones(len(S))

    @staticmethod
    def _signs_of(S: Array) -> Array:
        with np.errstate(invalid="ignore", divide="ignore"):
            found = np.linalg.det(np.nan_to_num(S / np.linalg.norm(S, axis=-1, keepdims=True)))
        return np.where(np.abs(found) > _SIGNED, np.sign(found), 0.0)


def _left_inverses(S: Array) -> Array:
    """Return (S' S)^-1 S' of matrices (n, na, m)."""
    transposed = np.swapaxes(S, -1, -2)
    return np.asarray(inverses(transposed @ S) @ transposed)


def _where(equations: Equations, coordinate: int) -> tuple[int | None, int]:
    """Return which unknown an actuator is, or which coordinate of the task."""
    unknown = equations.symbols.unknown_of(coordinate)
    if unknown is not None:
        return unknown, 0
    return None, equations.task.extension.idx_q.tolist().index(coordinate)


def _limits(equations: Equations, words: LimitWords) -> list[_Limited]:
    """Return the joints that have limits; none of turns with more room than a whole turn."""
    task = equations.task
    limits = task.mechanism.system.limits
    kinds = {one.z.start: one for one in equations.unknowns}
    of_task = {} if task.frame is not None else {
        int(q): k for k, q in enumerate(task.extension.idx_q)
    }  # fmt: skip
    found = []
    for q, lower, upper in zip(limits.q.tolist(), limits.lower, limits.upper, strict=True):
        if not (np.isfinite(lower) or np.isfinite(upper)):
            continue
        names = words.of(q, "lower"), words.of(q, "upper")
        if q in of_task:
            found.append(_Limited(of_task[q], None, False, lower, upper, 1.0, names))
            continue
        one = kinds.get(q)
        if one is None:
            name = limits.names[limits.q.tolist().index(q)]
            raise MechanismError(f"joint {name!r} has limits that boxes cannot be certified with")
        turns = one.kind == "turn"
        if turns and not upper - lower < 2 * np.pi:  # some whole turn keeps them
            continue
        ends = float(lower), float(upper)
        found.append(_Limited(q, one.y.start, turns, *ends, one.unit, names))
    return found
