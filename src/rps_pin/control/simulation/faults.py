"""Faults of readings and targets in a simulated loop, each with a start and a duration."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from rps_pin import validation
from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds

Kind = Literal["lost", "nan", "jump", "stuck", "target", "target_nan"]
_LEG_KINDS = ("nan", "jump", "stuck")
#: Tolerance of times, s: 300 ticks of 1 ms are 0.3 s in spite of rounding.
_ROUNDING = 1e-9


@refuses_other_kinds
@dataclass(frozen=True)
class Fault:
    """One fault.

    Parameters
    ----------
    kind
        ``"lost"``: no reading. ``"nan"``: a reading that is not a number. ``"jump"``: a reading
        with an error of `size`. ``"stuck"``: a reading that does not change. ``"target"``: a target
        whose pose has an error of `offset`. ``"target_nan"``: a target that is not a number.
    start
        s.
    duration
        s; default: endless. Half a period affects one tick.
    leg
        The leg, or actuator, whose reading is affected, from 1 on; default: all.
    size
        Of a jump, m or rad.
    offset
        Of a target, one number for each coordinate: m, rad, rad of the 3-RPS.

    Raises
    ------
    InputError
        If the kind or the leg does not exist, or a number is out of range or does not go with the
        kind.
    """

    kind: Kind
    start: float
    duration: float = math.inf
    leg: int | None = None
    size: float = 0.0
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        validation.choice(self.kind, "fault kind", get_args(Kind))
        validation.non_negative_number(self.start, "fault start", "s")
        validation.positive_number(self.duration, "fault duration", "s", infinite=True)
        if self.leg is not None:
            validation.whole_number(self.leg, "fault leg")
        if self.leg is not None and self.kind not in _LEG_KINDS:
            raise InputError(
                f"fault leg = {self.leg}: a fault {self.kind!r} has no leg; faults of one leg are: "
                f"{', '.join(_LEG_KINDS)}"
            )
        if (self.kind == "jump") != (validation.finite_number(self.size, "fault size", "m") != 0.0):
            raise InputError(f"fault size = {self.size}: a size, in m, is for a jump only")
        offset = validation.fixed_array(self.offset, "fault offset", (None,))
        object.__setattr__(self, "offset", tuple(offset.tolist()))
        if (self.kind == "target") != offset.any():
            raise InputError(
                f"fault offset = {self.offset}: an offset is for a fault of the target only"
            )

    def check(self, actuators: int, coordinates: int) -> None:
        """Raise `InputError` unless a robot has its leg, and as many coordinates."""
        if self.leg is not None and self.leg > actuators:
            legs = "1, 2 and 3" if actuators == 3 else f"1 to {actuators}"
            raise InputError(f"fault leg = {self.leg}: legs are {legs}")
        if self.kind == "target" and len(self.offset) != coordinates:
            raise InputError(
                f"fault offset = {self.offset}: the pose has {coordinates} coordinates"
            )

    def on(self, time: float) -> bool:
        """Return whether the fault is present at a time, s."""
        return -_ROUNDING <= time - self.start < self.duration - _ROUNDING

    def __str__(self) -> str:
        return self.text()

    def text(self, units: Sequence[str] = ("m", "rad", "rad")) -> str:
        """Return the fault in words; the units are those of the coordinates of a target."""
        which = "" if self.leg is None else f" of leg {self.leg}"
        size = f" by {self.size:.6g} m" if self.kind == "jump" else ""
        size += f" by {self.offset} {', '.join(units)}" if self.kind == "target" else ""
        until = "" if self.duration == math.inf else f" for {self.duration:.6g} s"
        return f"{self.kind}{which}{size} from t = {self.start:.6g} s{until}"


class Faults:
    """The faults of one run; they may overlap.

    Parameters
    ----------
    faults
        Any number of `Fault`.
    """

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        self.faults = tuple(faults)
        self._stuck: dict[Fault, Array] = {}

    def reading(self, time: float, true: Array) -> Array | None:
        """Return the faulty reading (3,), m, of a true one; None if it is lost."""
        reading, lost = np.array(true, dtype=np.float64), False
        for fault in self.faults:
            if not fault.on(time):
                if fault.kind == "stuck":
                    self._stuck[fault] = np.array(true)
                continue
            legs = slice(None) if fault.leg is None else slice(fault.leg - 1, fault.leg)
            lost |= fault.kind == "lost"
            if fault.kind == "nan":
                reading[legs] = np.nan
            elif fault.kind == "jump":
                reading[legs] += fault.size
            elif fault.kind == "stuck":
                reading[legs] = self._stuck.setdefault(fault, np.array(true))[legs]
        return None if lost else reading

    def target(self, time: float, true: tuple[Array, Array, Array]) -> tuple[Any, Any, Any]:
        """Return the faulty target of a true one: pose, rate and acceleration."""
        pose, rate, acceleration = true
        for fault in self.faults:
            if fault.on(time) and fault.kind == "target":
                pose = pose + np.array(fault.offset)
            elif fault.on(time) and fault.kind == "target_nan":
                pose = np.full_like(pose, np.nan)
        return pose, rate, acceleration
