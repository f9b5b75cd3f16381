"""What goes wrong in a loop, at a time and for a while: readings and targets."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, Literal

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError

Kind = Literal["lost", "nan", "jump", "stuck", "target", "target_nan"]
_KINDS = ("lost", "nan", "jump", "stuck", "target", "target_nan")
_OF_A_LEG = ("nan", "jump", "stuck")
#: Times are compared to this, s: 0.3 is 300 ticks of 1 ms, though 300 * 0.001 is not 0.1 + 0.2.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Fault:
    """One fault.

    Parameters
    ----------
    kind
        ``"lost"``: no reading. ``"nan"``: a reading that is not a number. ``"jump"``: a reading
        off by `size`. ``"stuck"``: a reading that stays what it was. ``"target"``: a target whose
        pose is off by `offset`. ``"target_nan"``: a target that is not a number.
    start
        From when on, s.
    duration
        For how long, s; for ever if left out. Half a period hits one tick.
    leg
        Which leg's reading, 1 to 3; all if left out.
    size
        Of a jump, m.
    offset
        Of a target: m, rad, rad.

    Raises
    ------
    InputError
        If there is no such fault or leg, or a number is not finite or negative where it must not.
    """

    kind: Kind
    start: float
    duration: float = math.inf
    leg: int | None = None
    size: float = 0.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.kind not in _KINDS:
            raise InputError(f"fault kind {self.kind!r}; there are: {', '.join(_KINDS)}")
        for name in ("start", "duration", "size"):
            value = getattr(self, name)
            if not isinstance(value, Real) or isinstance(value, bool):
                raise InputError(f"fault {name} = {value!r}: it must be a number")
        try:
            offset = tuple(float(entry) for entry in self.offset)
        except (TypeError, ValueError):
            raise InputError(
                f"fault offset = {self.offset!r}: it must be three finite numbers"
            ) from None
        object.__setattr__(self, "offset", offset)
        if not 0.0 <= self.start < math.inf:
            raise InputError(f"fault start = {self.start}: it must be a time, zero or more")
        if not self.duration > 0.0:
            raise InputError(f"fault duration = {self.duration}: it must be positive")
        if self.leg is not None and not (isinstance(self.leg, Integral) and self.leg in (1, 2, 3)):
            raise InputError(f"fault leg = {self.leg}; legs are 1, 2 and 3")
        if self.leg is not None and self.kind not in _OF_A_LEG:
            raise InputError(
                f"fault leg = {self.leg}: a fault {self.kind!r} has none; of one leg are: "
                f"{', '.join(_OF_A_LEG)}"
            )
        if not math.isfinite(self.size) or (self.kind == "jump") != (self.size != 0.0):
            raise InputError(f"fault size = {self.size}: a jump, and no other, has a size, in m")
        if len(self.offset) != 3 or not all(map(math.isfinite, self.offset)):
            raise InputError(f"fault offset = {self.offset}: it must be three finite numbers")
        if (self.kind == "target") != any(self.offset):
            raise InputError(
                f"fault offset = {self.offset}: a fault of the target, and no other, has one"
            )

    def on(self, time: float) -> bool:
        """Return whether it is there at a time, s."""
        return -_ROUNDING <= time - self.start < self.duration - _ROUNDING

    @property
    def _of_reading(self) -> slice:
        return slice(None) if self.leg is None else slice(self.leg - 1, self.leg)

    def __str__(self) -> str:
        which = "" if self.leg is None else f" of leg {self.leg}"
        size = f" by {self.size:.6g} m" if self.kind == "jump" else ""
        size += f" by {self.offset} m, rad, rad" if self.kind == "target" else ""
        until = "" if self.duration == math.inf else f" for {self.duration:.6g} s"
        return f"{self.kind}{which}{size} from t = {self.start:.6g} s{until}"


class Faults:
    """Faults of one run; they may overlap.

    Parameters
    ----------
    faults
        Any number of `Fault`.
    """

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        self.faults = tuple(faults)
        self._stuck: dict[Fault, Array] = {}

    def reading(self, time: float, true: Array) -> Array | None:
        """Return what arrives of a reading (3,), m; None if it is lost."""
        reading, lost = np.array(true, dtype=np.float64), False
        for fault in self.faults:
            if not fault.on(time):
                if fault.kind == "stuck":
                    self._stuck[fault] = np.array(true)
                continue
            legs = fault._of_reading
            lost |= fault.kind == "lost"
            if fault.kind == "nan":
                reading[legs] = np.nan
            elif fault.kind == "jump":
                reading[legs] += fault.size
            elif fault.kind == "stuck":
                reading[legs] = self._stuck.setdefault(fault, np.array(true))[legs]
        return None if lost else reading

    def target(self, time: float, true: tuple[Array, Array, Array]) -> tuple[Any, Any, Any]:
        """Return what arrives of a target: pose, rate and acceleration."""
        pose, rate, acceleration = true
        for fault in self.faults:
            if fault.on(time) and fault.kind == "target":
                pose = pose + np.array(fault.offset)
            elif fault.on(time) and fault.kind == "target_nan":
                pose = np.full(3, np.nan)
        return pose, rate, acceleration
