"""Ticks in machine code: built once a machine, kept, and called with arrays made beforehand."""

from __future__ import annotations

import ctypes
import hashlib
import math
import os
from array import array
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from rps_pin import codegen
from rps_pin.arrays import Array
from rps_pin.control.estimator.loop_arguments import Numbers, elapsed_time, three_floats
from rps_pin.errors import CompileError, InputError, shown

if TYPE_CHECKING:
    from rps_pin.codegen.build import Library

#: Whether a loop uses generated code; a library is used without a question, to prove it.
Compiled: TypeAlias = "Literal['auto', True, False] | Library"
#: ``int NAME_tick(double *x, double *const *answers)``, with Python's lock: it takes a microsecond.
_TICK = ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
#: Of a tick that is not regular.
NOT_REGULAR = -1
HOW_TO_GET = "pip install 'rps-pin[compile]'"
#: What generated code is made from, beside the compiler.
_SOURCES = (
    *("numerics", "codegen", "rps/kernels", "rps/generated"),
    *("control/estimator", "control/loop", "control/generated"),
    *("closed_loop/dynamics/passive_joint_forces.py", "rps/dynamics/force_equations.py"),
)


class GeneratedTick:
    """One loop's ticks in machine code, with its memory; for use in one thread.

    Parameters
    ----------
    name
        `tick.ESTIMATE`, or the name of a law.
    library
        Its machine code.
    answers
        Contiguous arrays that a tick writes.
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
        library: Library,
        answers: Sequence[Array],
        period: float,
        share: Callable[[float], float],
        take: Callable[[dict[str, Any]], None],
    ) -> None:
        if not all(array.flags.c_contiguous for array in answers):
            raise CompileError("generated code writes to contiguous arrays only", "")
        from rps_pin.control.generated.tick import form_of  # noqa: PLC0415

        form = form_of(name)
        self._form, self._share, self._take, self._period = form, share, take, period
        self.ready = self.ahead = False
        sizes = [layout.size for layout in form[:3]]
        self._array = np.zeros(sum(sizes))
        self._answers = tuple(answers)
        pointers = [array.ctypes.data for array in answers]
        self._out = (ctypes.c_void_p * len(pointers))(*pointers)
        self._x = ctypes.c_void_p(self._array.ctypes.data)
        doubles, (n, m, _) = self._array.data, sizes
        self._numbers, self._memory = doubles[:n], doubles[n : n + m]
        self._reading: Any = doubles[n + m :]
        at = form.reading.slices
        self._elapsed = at["elapsed"].start
        self._set_time(period)
        self._library = library  # it keeps the code
        self._tick = _TICK(library.address(f"{name}_tick"))
        self.engine = f"generated code, by {library.compiler}"

    # The numbers ----------------------------------------------------------------------------------

    def set_numbers(self, groups: Mapping[str, Any]) -> None:
        """Set what a loop does not change."""
        self._numbers[:] = _doubles(self._form.numbers.join(groups))

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
        return bool(self._reading[_MEASURED])

    def remembered(self, name: str) -> float:
        """Return one number of the memory."""
        return self._memory[self._form.memory.slices[name].start]

    def _set_time(self, elapsed: float) -> None:
        self._reading[self._elapsed] = elapsed
        self._reading[self._elapsed + 1] = self._share(elapsed)
        self._usual = elapsed == self._period

    # A tick ---------------------------------------------------------------------------------------

    def estimate(self, length: Numbers, speed: Numbers, dt: float | None) -> int:
        """Compute a regular tick of `RealTimeRobot`: its `Status`, or `NOT_REGULAR`."""
        reading = self._reading
        try:
            reading[_LENGTH] = length
        except (TypeError, ValueError):
            if not self._converted(_LENGTH, length):
                return NOT_REGULAR
        if speed is None:
            reading[_MEASURED] = 0.0
        elif self._converted(_SPEED, speed):
            reading[_MEASURED] = 1.0
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
        reading = self._reading
        if target is None:
            reading[_GIVEN] = 0.0
            return self.estimate(length, speed, dt)
        try:
            pose, rate, acceleration = target
            reading[_POSE] = pose
            reading[_RATE] = rate
            reading[_ACCELERATION] = acceleration
        except (TypeError, ValueError):
            if not self._target_converted(target):
                return NOT_REGULAR
        reading[_GIVEN] = 1.0
        return self.estimate(length, speed, dt)

    def _target_converted(self, target: Any) -> bool:
        try:
            pose, rate, acceleration = target
        except (TypeError, ValueError):
            return False
        return (
            self._converted(_POSE, pose)
            and self._converted(_RATE, rate)
            and self._converted(_ACCELERATION, acceleration)
        )

    def _converted(self, where: slice, values: Numbers) -> bool:
        """Put three finite numbers of any type into the reading."""
        three = three_floats(values)
        if three is None:
            return False
        begin = where.start
        self._reading[begin], self._reading[begin + 1], self._reading[begin + 2] = three
        return True


def generated_tick(
    compiled: Compiled,
    name: str,
    answers: Sequence[Array],
    period: float,
    share: Callable[[float], float],
    take: Callable[[dict[str, Any]], None],
    make: Callable[..., Any],
) -> tuple[GeneratedTick | None, str]:
    """Return the tick of a loop in machine code, if there is one, and what runs.

    `make` makes loops to prove it with: see `proof.prove`.

    Raises
    ------
    InputError
        If `compiled` is none of those.
    CompileError
        If there is none and it must be.
    """
    if isinstance(compiled, str | bool) and compiled not in ("auto", True, False):
        raise InputError(f'compiled = {shown(compiled)}: it must be "auto", True or False')
    if compiled is False:
        return None, "interpreted, as asked for"
    try:
        library = built(name, make) if compiled is True or compiled == "auto" else compiled
        found = GeneratedTick(name, library, answers, period, share, take)
    except CompileError as error:
        if compiled is True:
            raise
        return None, f"interpreted: {str(error).splitlines()[0]}"
    return found, found.engine


#: Places in the reading: see `tick.CONTROL_READING`.
_LENGTH, _SPEED, _MEASURED = slice(0, 3), slice(3, 6), 6
_POSE, _RATE, _ACCELERATION, _GIVEN = slice(9, 12), slice(12, 15), slice(15, 18), 18


def _doubles(values: Sequence[float]) -> memoryview:
    return memoryview(array("d", values))


#: What was built in this process, or why it could not be.
_BUILT: dict[str, Library | CompileError] = {}


def built(name: str, make: Callable[..., Any]) -> Library:
    """Return the proven machine code of a tick; it is looked for once.

    Raises
    ------
    CompileError
        If there is none and it cannot be built.
    """
    if name not in _BUILT:
        try:
            library = _built(name, make)
            _BUILT[name] = library
            # Of a loop the best code, from its start: not another, built and proven beside it.
            if library.better is not None:
                _BUILT[name] = library.better.result()
        except CompileError as error:
            _BUILT.setdefault(name, error)
    found = _BUILT[name]
    if isinstance(found, CompileError):
        raise found
    return found


def _built(name: str, make: Callable[..., Any]) -> Library:
    if not name:
        raise CompileError("this law has no generated code", "")
    if os.environ.get("RPS_PIN_COMPILE", "1") == "0":
        raise CompileError("generated code is switched off by RPS_PIN_COMPILE=0", "")
    try:
        version = metadata.version("casadi")
        from rps_pin.codegen.build import Source, build  # noqa: PLC0415
        from rps_pin.control.generated.proof import prove  # noqa: PLC0415
        from rps_pin.control.generated.tick import tick_texts  # noqa: PLC0415

        source = Source(
            f"3-RPS control loop, {name}",
            (f"{name}_tick",),
            lambda: tick_texts(name),
            determined_by=f"{version} {_digest()}",
        )
        return build(source, lambda library: prove(name, library, make))
    except ImportError as error:  # of CasADi only where nothing is kept
        missing = error.name or error
        raise CompileError(f"{missing} is not installed: {HOW_TO_GET}", "") from None


@cache
def _digest() -> str:
    """Return a digest of the modules that generated code depends on."""
    package = Path(codegen.__file__).parent.parent
    found = hashlib.sha256()
    for source in _SOURCES:
        place = package / source
        for path in sorted(place.rglob("*")) if place.is_dir() else [place]:
            if path.suffix in (".py", ".h", ".c"):
                found.update(path.read_bytes())
    return found.hexdigest()
