"""A mechanism on an NVIDIA card: dynamics, steps and continuation of as many as it holds."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.dynamics import least_effort
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.codegen.cuda.device import REALS, DeviceFunction, load_cupy
from rps_pin.codegen.cuda.proof import differences
from rps_pin.codegen.cuda.source import unit
from rps_pin.codegen.engine.actuated import continued_coordinates
from rps_pin.codegen.engine.applied import with_parameters
from rps_pin.codegen.engine.batches import Errors
from rps_pin.codegen.engine.generated import GeneratedCode
from rps_pin.codegen.engine.proof import Proof
from rps_pin.codegen.units import OPEN, SINGULAR
from rps_pin.errors import ClosureError, InputError, MechanismError, RPSPinError, SingularityError
from rps_pin.validation import choice, whole_number

#: Groups of functions that are generated for a card.
GROUPS = {
    "dynamics": ("inverse_dynamics", "forward_dynamics"),
    "simulation": ("step", "motion"),
    "closing": ("completed",),
}
#: Steps of one launch; float32 counts so far.
_MOST_STEPS = 2**24


class DeviceForces(NamedTuple):
    """Actuator and constraint forces; arrays of CuPy."""

    tau: Any
    """Shape (n, na)."""
    constraint_forces: Any
    """Shape (n, nc)."""
    residual: Any
    """Shape (n,)."""
    unproduced: Any
    """Shape (n, nv): see `InverseDynamics`; None if there are as many actuators as motions."""
    status: Any
    """Shape (n,), int32: 0, or a sum of 1 (not finite), 2 (open) and 4 (nearly singular)."""


class DeviceAccelerations(NamedTuple):
    """Accelerations; arrays of CuPy."""

    a: Any
    """Shape (n, nv)."""
    status: Any
    """As of `DeviceForces`."""


class DeviceStates(NamedTuple):
    """Closed states after one step or several; arrays of CuPy."""

    q: Any
    """Shape (n, nq)."""
    v: Any
    """Shape (n, nv)."""
    work: Any
    """Shape (n,): of actuators, wrenches, damping and friction on the way, J."""
    status: Any
    """As of `DeviceForces`."""


class CudaMechanism:
    """Generated CUDA of a mechanism; made by ``ClosedLoopModel.compile(device="cuda")``.

    Methods have the names and arguments of `ClosedLoopModel` for n samples at once. Array arguments
    have shape (n, size), or (size,) for the same numbers in all samples. Arrays on the card of
    other libraries are taken as CuPy's; what is not on the card is copied to it at each call. Any
    memory layout will do; the fastest, in which results come too, has neighbouring samples side by
    side: `array` makes it, and ``x.T`` is an x of shape (size, n) in it, without a copy.

    All methods take four options:

    - ``wrenches``: external wrenches by frames, (n, 6) or (6,) each; code for other frames than
      those of `compile` is built when they are first named.
    - ``parameters``: numbers of the parameters, (n, np) or (np,), instead of the nominal ones.
    - ``errors``: with ``"raise"`` the call waits for the card, and raises if samples have no
      answer; it tells how many, the first ones' indices, and all in the error's ``failed``. With
      ``"mask"`` it does neither: their results are NaN, their status is not 0.
    - ``out``: a result of the same method, whose arrays are used again; those that are None are
      new. Arguments of the same call may be among them.

    Each function is compiled and compared with the Pinocchio engine when it is first called.

    Attributes
    ----------
    mechanism : ClosedLoopModel
        What the code was generated from.
    dtype : str
        "float64" or "float32".
    differences : dict
        The largest difference from the Pinocchio engine, relative, of each function so far.
    """

    def __init__(self, code: GeneratedCode, dtype: str = "float64") -> None:
        self.dtype = choice(dtype, "dtype", tuple(REALS))
        self.mechanism, self.code = code.mechanism, code
        self.differences: dict[str, float] = {}
        self._cupy = load_cupy()
        self._codes = {code.wrench_frames: code}
        self._proofs: dict[tuple[str, ...], Proof] = {}
        self._functions: dict[tuple[tuple[str, ...], str], DeviceFunction] = {}
        self._lock = threading.RLock()

    @property
    def actuated(self) -> tuple[str, ...]:
        """Names of the actuated joints."""
        return self.mechanism.actuated

    @property
    def parameters(self) -> tuple[str, ...]:
        """What each of the parameters is, in order; empty if none were named."""
        return self.code.labels

    @property
    def nominal_parameters(self) -> Array:
        """The parameters' numbers of the mechanism as it is, shape (np,)."""
        return self.code.nominal.copy()

    def array(self, values: Any) -> Any:
        """Return a copy on the card, in this object's type of numbers and the fastest layout."""
        given = self._cupy.asarray(values, dtype=self.dtype)
        copied = self._cupy.empty(given.shape[::-1], dtype=self.dtype).T
        copied[...] = given
        return copied

    def build(self, *groups: str) -> None:
        """Compile and compare groups of functions now: `GROUPS`."""
        for group in groups:
            choice(group, "a group of functions on device 'cuda'", tuple(GROUPS))
        for group in groups:
            for name in GROUPS[group]:
                self._function(self.code, name)

    # Dynamics and steps ---------------------------------------------------------------------------

    def inverse_dynamics(
        self, q: Any, v: Any, a: Any, *, out: DeviceForces | None = None, **options: Any
    ) -> DeviceForces:
        """Return the forces of motions; see `ClosedLoopModel.inverse_dynamics`."""
        kept: list[Any] = [None] * 5 if out is None else list(out)
        lacks = self.code.partition.actuated_rank < self.code.partition.independent.size
        kept[3:4] = [kept[3], None] if lacks else []
        tau, multipliers, residual, *rest, status = self._run(
            "inverse_dynamics", (q, v, a), kept, **options
        )
        unproduced = None
        if lacks:
            rounding = 1e3 * float(np.finfo(self.dtype).eps)
            unproduced, missing = rest
            enough = missing > max(least_effort.RESIDUAL, rounding) ** 2
            unproduced *= enough[..., None]
        return DeviceForces(tau, multipliers, residual, unproduced, status)

    def forward_dynamics(
        self, q: Any, v: Any, tau: Any, *, out: DeviceAccelerations | None = None, **options: Any
    ) -> DeviceAccelerations:
        """Return accelerations under actuator forces; see `ClosedLoopModel.forward_dynamics`."""
        return DeviceAccelerations(*self._run("forward_dynamics", (q, v, tau), out, **options))

    def step(
        self,
        q: Any,
        v: Any,
        tau: Any,
        duration: Any,
        *,
        out: DeviceStates | None = None,
        **options: Any,
    ) -> DeviceStates:
        """Return states after one step of a duration, s, float or (n,), under constant forces.

        Of order 4, and closed again, as `CompiledMechanism.step` takes it.
        """
        return DeviceStates(*self._run("step", (q, v, tau, duration), out, **options))

    def steps(
        self,
        q: Any,
        v: Any,
        tau: Any,
        duration: Any,
        count: int,
        *,
        out: DeviceStates | None = None,
        **options: Any,
    ) -> DeviceStates:
        """Return states after ``count`` steps of a duration each, under constant forces.

        One launch: the states between stay in registers. A sample ends with its first step that
        has no answer.
        """
        if whole_number(count, "count") > _MOST_STEPS:
            raise InputError(f"count = {count}: it must be at most {_MOST_STEPS}")
        return DeviceStates(*self._run("motion", (q, v, tau, duration, count), out, **options))

    # Configurations -------------------------------------------------------------------------------

    def continued(
        self, values: Array, q: Array, parameters: Array | None = None
    ) -> tuple[Array, Bools]:
        """Return configurations (n, nq) continued to other values, and which are reached.

        As `CompiledMechanism.continued`, of arrays in the computer's memory and into it.

        Parameters
        ----------
        values
            Values of the actuated joints, shape (n, na).
        q
            Closed configurations, shape (n, nq).
        parameters
            As for the other methods, shape (np,) or (n, np).

        Raises
        ------
        InputError
            In single precision, whose rounding errors loops are closed to, no more.
        MechanismError
            If the actuated joints are not the mechanism's motions, or have several coordinates.
        """
        at = continued_coordinates(self.code)
        if at is None:
            raise MechanismError(
                "generated code continues configurations by actuated joints of one coordinate each "
                "that determine all others"
            )
        wanted = q.copy()
        wanted[:, at] = values
        extra = [self.code.nominal if parameters is None else parameters]
        given = (self.array(q), self.array(wanted), *(extra if self.code.parameters else ()))
        (found, *_), status = self._function(self.code, "completed")(given)
        return self._cupy.asnumpy(found), np.asarray(self._cupy.asnumpy(status) == 0)

    def _run(
        self,
        name: str,
        given: Sequence[Any],
        out: Sequence[Any] | None,
        *,
        wrenches: dict[str, Any] | None = None,
        parameters: Any = None,
        errors: Errors = "raise",
    ) -> list[Any]:
        """Return a function's outputs and status."""
        choice(errors, "errors", ("raise", "mask"))
        code = self._generated(wrenches)
        extra = []
        if code.wrench_frames:
            extra.append(self._stacked(code.wrench_frames, wrenches or {}))
        if code.parameters:
            extra.append(code.nominal if parameters is None else parameters)
        elif parameters is not None:
            raise InputError("the mechanism was compiled without parameters; name them in compile")
        function = self._function(code, name)
        found, status = function((*given, *extra), out or ())
        if errors == "raise":
            self._refuse(name, given[0], status, extra[-1] if code.parameters else None)
        return [*found, status]

    # Code -----------------------------------------------------------------------------------------

    def _generated(self, wrenches: dict[str, Any] | None) -> GeneratedCode:
        """Return the code for wrenches at these frames."""
        if not wrenches or set(wrenches) <= set(self.code.wrench_frames):
            return self.code
        frames = tuple(sorted(wrenches))
        for name in frames:
            self.mechanism.system.frame(name)
        with self._lock:
            if frames not in self._codes:
                self._codes[frames] = self.code.with_wrenches(frames)
            return self._codes[frames]

    def _function(self, code: GeneratedCode, name: str) -> DeviceFunction:
        """Return a function, compiled and compared with the Pinocchio engine."""
        key = code.wrench_frames, name
        if name == "completed" and self.dtype != "float64":
            raise InputError("configurations are continued in double precision: dtype='float64'")
        with self._lock:
            if key not in self._functions:
                real = REALS[self.dtype]
                made = unit(code.functions, name, real)
                function = DeviceFunction(
                    self._cupy,
                    name,
                    self.dtype,
                    made.cuda(real),
                    made.function(name).inputs,
                    made.handed_out(name),
                )
                difference = differences(self._proof(code), function, self._cupy.asnumpy)
                self.differences[name] = max(difference, self.differences.get(name, 0.0))
                self._functions[key] = function
            return self._functions[key]

    def _proof(self, code: GeneratedCode) -> Proof:
        if code.wrench_frames not in self._proofs:
            self._proofs[code.wrench_frames] = Proof(
                code.mechanism, code.partition.independent, code.parameters, code.wrench_frames
            )
        return self._proofs[code.wrench_frames]

    # Arguments and errors -------------------------------------------------------------------------

    def _stacked(self, frames: Sequence[str], wrenches: dict[str, Any]) -> Any:
        """Return wrenches one behind the other, shape (6 k,) or (n, 6 k)."""
        arrays = []
        for name in frames:
            array = self._cupy.asarray(wrenches.get(name, np.zeros(6)), dtype=self.dtype)
            if array.shape[-1:] != (6,) or array.ndim > 2:
                raise InputError(
                    f"the wrench at {name} has shape {array.shape}; expected (6,) or (n, 6)"
                )
            arrays.append(array)
        counts = {len(array) for array in arrays if array.ndim == 2}
        if len(counts) > 1:
            raise InputError(f"the wrenches have {', '.join(map(str, sorted(counts)))} samples")
        whole = self._cupy.empty((6 * len(arrays), *counts), dtype=self.dtype)
        for k, array in enumerate(arrays):
            whole[6 * k : 6 * k + 6] = array.T if array.ndim == 2 or not counts else array[:, None]
        return whole.T

    def _refuse(self, name: str, q: Any, status: Any, parameters: Any) -> None:
        """Raise if there are samples without an answer; what the first one lacks."""
        if not bool(status.any()):
            return
        flags = np.atleast_1d(self._cupy.asnumpy(status))
        failed = np.flatnonzero(flags)
        first = int(failed[0])
        named = ", ".join(map(str, failed[:5])) + (", ..." if failed.size > 5 else "")
        text = f"{name}: {failed.size} of {flags.size} samples have no answer ({named}). Sample "
        error = self._error(
            f"{text}{first}: ",
            int(flags[first]),
            self._host(q, first),
            None if parameters is None else self._host(parameters, first),
        )
        error.failed = flags != 0
        raise error

    def _host(self, array: Any, sample: int) -> Array:
        """Return one sample's numbers."""
        one = array[sample if len(array) > 1 else 0] if np.ndim(array) == 2 else array
        return np.asarray(self._cupy.asnumpy(one), dtype=np.float64)

    def _error(self, text: str, status: int, q: Array, parameters: Array | None) -> RPSPinError:
        mechanism: ClosedLoopModel = self.mechanism
        if parameters is not None:
            mechanism = with_parameters(mechanism, self.code.parameters, parameters)
        finite = bool(np.isfinite(q).all())
        if status & OPEN and finite:
            gap = float(mechanism.loop_gap(q))
            return ClosureError(
                f"{text}the loops are open, or a step left them open; the gap of q is {gap:.3g} m",
                gap,
            )
        if status & SINGULAR and finite:
            condition, limit = mechanism.condition(q), mechanism.max_condition
            return SingularityError(
                f"{text}nearly singular: rounding errors grow too far in {self.dtype}; the "
                f"condition number of J_p at q is {condition:.3g}",
                condition,
                limit,
            )
        return InputError(f"{text}its numbers, or its results, are not finite")
