"""Ticks in machine code, with the arrays that they read and write."""

from __future__ import annotations

import ctypes
import math
from array import array
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from rps_pin.arrays import Array
from rps_pin.control.estimator.loop_arguments import Numbers, elapsed_time, three_floats
from rps_pin.control.generated.tick import Form
from rps_pin.copies import DeepCopied
from rps_pin.errors import CompileError

if TYPE_CHECKING:
    from rps_pin.codegen.build import Library

#: ``int NAME_tick(double *x, double *const *answers)``, with Python's lock: it takes a microsecond.
_TICK = ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
#: Of a tick that is not regular.
NOT_REGULAR = -1
#: A motion's groups in a reading.
_MOTION = ("pose", "rate", "acceleration")


class _MachineCode(DeepCopied):
    """Machine code of a tick, with its arrays; for use in one thread.

    Parameters
    ----------
    name
        Of the tick.
    form
        Layouts of its arrays.
    library
        Its machine code.
    answers
        Contiguous arrays that a tick writes.
    floats
        Turns what a caller gives into a row of finite numbers, or None.

    Attributes
    ----------
    engine : str
        What runs.

    Raises
    ------
    CompileError
        If an array is not contiguous.
    """

    def __init__(
        self,
        name: str,
        form: Form,
        library: Library,
        answers: Sequence[Array],
        floats: Callable[[Any], Any] = three_floats,
    ) -> None:
        if not all(one.flags.c_contiguous for one in answers):
            raise CompileError("generated code writes to contiguous arrays only", "")
        self._name, self._form, self._floats = name, form, floats
        self._array = np.zeros(sum(layout.size for layout in form[:3]))
        self._answers = tuple(answers)
        self._library = library  # it keeps the code
        self.engine = f"generated code, by {library.compiler}"
        self._connect()

    def _connect(self) -> None:
        """Take the places of the arrays in memory."""
        pointers = [one.ctypes.data for one in self._answers]
        self._pointers = (ctypes.c_void_p * len(pointers))(*pointers)
        self._out = ctypes.c_void_p(ctypes.addressof(self._pointers))  # faster than the array
        self._x = ctypes.c_void_p(self._array.ctypes.data)
        doubles, (n, m, _) = self._array.data, [layout.size for layout in self._form[:3]]
        self._numbers, self._memory = doubles[:n], doubles[n : n + m]
        self._reading: Any = doubles[n + m :]
        at = self._form.reading.slices
        self._motion_at = tuple(at[one] for one in _MOTION if one in at)
        self._tick = _TICK(self._library.address(f"{self._name}_tick"))

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the places in memory: a copy has arrays of its own, and the same code."""
        left_out = ("_pointers", "_out", "_x", "_numbers", "_memory", "_reading", "_tick")
        return {name: value for name, value in self.__dict__.items() if name not in left_out}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._connect()

    def set_numbers(self, groups: Mapping[str, Any]) -> None:
        """Set what a loop does not change."""
        self._numbers[:] = _doubles(self._form.numbers.join(groups))

    def remembered(self, name: str) -> float:
        """Return one number of the memory."""
        return self._memory[self._form.memory.slices[name].start]

    def _motion_read(self, motion: Any) -> bool:
        """Put pose, rate and acceleration of any type into the reading."""
        places = self._motion_at
        try:
            pose, rate, acceleration = motion
        except Exception:  # of whatever object
            return False
        if pose.__class__ is rate.__class__ is acceleration.__class__ is ndarray:
            reading = self._reading
            try:
                reading[places[0]] = pose
                reading[places[1]] = rate
                reading[places[2]] = acceleration
            except (TypeError, ValueError):
                pass
            else:
                return True
        values = zip(places, (pose, rate, acceleration), strict=True)
        return all(self._converted(place, value) for place, value in values)

    def _read(self, place: slice, values: Numbers) -> bool:
        """Put numbers of any type into the reading."""
        if values.__class__ is ndarray:
            try:
                self._reading[place] = values
            except (TypeError, ValueError):
                return self._converted(place, values)
            return True
        return self._converted(place, values)

    def _converted(self, place: slice, values: Numbers) -> bool:
        found = self._floats(values)
        if found is not None:
            self._reading[place] = _doubles(found)
        return found is not None


class GeneratedTick(_MachineCode):
    """The ticks of one loop, with its memory.

    Parameters
    ----------
    name
        `tick.ESTIMATE`, or the name of a law.
    form, library, answers, floats
        As for `_MachineCode`.
    period
        Time between two ticks, s.
    share
        The filters' share, by the time between two ticks.
    take
        Called with the memory by `pull`.

    Attributes
    ----------
    ready : bool
        Whether the memory is what the next tick starts from.
    ahead : bool
        Whether the memory is newer than what its owner has.
    """

    def __init__(
        self,
        name: str,
        form: Form,
        library: Library,
        answers: Sequence[Array],
        period: float,
        share: Callable[[float], float],
        take: Callable[[dict[str, Any]], None],
        floats: Callable[[Any], Any] = three_floats,
    ) -> None:
        super().__init__(name, form, library, answers, floats)
        self._share, self._take, self._period = share, take, period
        self.ready = self.ahead = False
        self._set_time(period)

    def _connect(self) -> None:
        super()._connect()
        at = self._form.reading.slices
        self._length_at, self._speed_at = at["reading"], at["reading_speed"]
        self._measured_at, self._elapsed_at = at["measured"].start, at["elapsed"].start
        self._share_at = at["share"].start
        self._given_at = at["given"].start if "given" in at else -1

    def set_memory(self, groups: Mapping[str, Any]) -> None:
        """Set what the next tick starts from."""
        self._memory[:] = _doubles(self._form.memory.join(groups))
        self.ready, self.ahead = True, False

    def pull(self) -> None:
        """Give the memory to the owner, if it is newer."""
        if self.ahead:
            self.ahead = False
            self._take(self._form.memory.split(self._memory.tolist()))

    @property
    def measured(self) -> bool:
        """Whether the last tick was given a speed."""
        return bool(self._reading[self._measured_at])

    def motion(self) -> tuple[memoryview, memoryview]:
        """Return the pose and its rate that the last tick left."""
        at = self._form.memory.slices
        return self._memory[at["pose"]], self._memory[at["rate"]]

    def _set_time(self, elapsed: float) -> None:
        self._reading[self._elapsed_at] = elapsed
        self._reading[self._share_at] = self._share(elapsed)
        self._usual = elapsed == self._period

    def estimate(self, length: Numbers, speed: Numbers, dt: float | None) -> int:
        """Compute a regular tick of `RealTimeRobot`: its `Status`, or `NOT_REGULAR`."""
        reading = self._reading
        if length.__class__ is ndarray:  # no subclass: it may have masked entries
            try:
                reading[self._length_at] = length
            except (TypeError, ValueError):
                if not self._converted(self._length_at, length):
                    return NOT_REGULAR
        elif not self._converted(self._length_at, length):
            return NOT_REGULAR
        if speed is None:
            reading[self._measured_at] = 0.0
        elif self._read(self._speed_at, speed):
            reading[self._measured_at] = 1.0
        else:
            return NOT_REGULAR
        if dt is not None or not self._usual:
            elapsed = self._period if dt is None else elapsed_time(dt)
            if not 0.0 < elapsed < math.inf:
                return NOT_REGULAR
            self._set_time(elapsed)
        number: int = self._tick(self._x, self._out)
        if number != NOT_REGULAR:
            self.ahead = True
        return number

    def control(self, length: Numbers, target: Any, speed: Numbers, dt: float | None) -> int:
        """Compute a regular tick of a controller likewise."""
        if target is None:
            self._reading[self._given_at] = 0.0
        elif self._motion_read(target):
            self._reading[self._given_at] = 1.0
        else:
            return NOT_REGULAR
        return self.estimate(length, speed, dt)


class GeneratedDynamics(_MachineCode):
    """Inverse dynamics in machine code."""

    def forces(self, pose: Any, rate: Any, acceleration: Numbers) -> int:
        """Compute forces and reactions of a motion: the `Status`, or `NOT_REGULAR`."""
        if not self._motion_read((pose, rate, acceleration)):
            return NOT_REGULAR
        return self._forces()

    def forces_at(self, pose: memoryview, rate: memoryview, acceleration: Numbers) -> int:
        """Compute the same at the pose and rate that `GeneratedTick.motion` returns."""
        at = self._motion_at
        self._reading[at[0]] = pose
        self._reading[at[1]] = rate
        return self._forces() if self._read(at[2], acceleration) else NOT_REGULAR

    def _forces(self) -> int:
        number: int = self._tick(self._x, self._out)
        return number

    @property
    def pose(self) -> tuple[float, float, float]:
        """The pose of the last call."""
        z, x, y = self._reading[self._motion_at[0]].tolist()
        return z, x, y


def _doubles(values: Sequence[float]) -> memoryview:
    return memoryview(array("d", values))
