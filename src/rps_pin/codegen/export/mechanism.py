"""A mechanism's functions as a package of C: those of `functions` and `routines`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.equations import OPEN
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.codegen.export import words
from rps_pin.codegen.export.evaluation import Evaluation
from rps_pin.codegen.export.names import identifier, quoted
from rps_pin.codegen.export.package import (
    Case,
    Constant,
    Function,
    Order,
    Package,
    Real,
    conditions,
)
from rps_pin.codegen.export.vectors import Entry, vectors
from rps_pin.codegen.expressions.mechanism import GROWTH
from rps_pin.codegen.engine.generated import GeneratedCode
from rps_pin.codegen.engine.proof import STEP, Proof, Sample
from rps_pin.codegen.expressions.routines import routines
from rps_pin.codegen.units import Kernel, Unit
from rps_pin.errors import InputError, did_you_mean
from rps_pin.validation import choice

#: Largest growth of rounding errors, squared and over that of `GROWTH`: their limit, relative, is
#: about 1e-11 in double and 1e-4 in single precision.
_LIMITS: dict[str, float] = {"double": 1.0, "float": 1e-4}
_EPSILONS = {"double": 2.2e-16, "float": 1.2e-7}
#: States of the self-test keep this share of the limit.
_REGULAR = 0.1

_UNCHECKED = ("gaps", "jacobian", "generalised_force", "energy")


def mechanism_package(
    mechanism: ClosedLoopModel,
    *,
    name: str = "",
    real: Real = "double",
    functions: Sequence[str] = (),
    parameters: Sequence[str] = (),
    wrench_frames: Sequence[str] = (),
) -> Package:
    """Return what the files of a mechanism are made from.

    Parameters
    ----------
    mechanism
        The mechanism.
    name
        What the names of files and functions begin with; made an identifier. Left out: that of the
        mechanism.
    real
        Type of all numbers.
    functions
        Names of functions (`words.FUNCTIONS`); all but the derivatives if left out.
    parameters
        Groups of numbers that are arguments of the functions; see `Parameters`.
    wrench_frames
        Names of frames at which external wrenches act.

    Raises
    ------
    InputError
        If a name or a number does not fit, or no regular state was found for the self-test.
    """
    choice(real, "real", tuple(_LIMITS))
    chosen = tuple(dict.fromkeys(functions)) or words.USUAL
    for one in chosen:
        if one not in words.FUNCTIONS:
            known = words.FUNCTIONS
            raise InputError(
                f"no function {one!r}{did_you_mean(one, known)}; there are: {', '.join(known)}"
            )
    called = identifier(name) if name else identifier(mechanism.name)
    code = GeneratedCode(mechanism, parameters, wrench_frames)
    unit = _unit(code, called, chosen, _LIMITS[real])
    proof = Proof(mechanism, code.partition.independent, code.parameters, code.wrench_frames)
    made = _Cases(code, unit, proof)
    labels = zip(code.labels, code.nominal.tolist(), strict=True)
    return Package(
        called,
        quoted(mechanism.name),
        real,
        unit,
        [
            Function(
                one,
                words.FUNCTIONS[one][0],
                {key: words.meaning(one, key) for key in made.argument_names(one)},
                made.of(one),
            )
            for one in chosen
        ],
        _constants(code),
        _orders(code),
        [(quoted(label), value) for label, value in labels],
        _notes(code, real),
    )


def _unit(code: GeneratedCode, name: str, chosen: Sequence[str], limit: float) -> Unit:
    """Return the unit of the chosen functions and of what they call."""
    with_loops = {one.name: one for one in routines(code.functions)}
    needed = list(chosen)
    for one in needed:
        calls = with_loops[one].calls if one in with_loops else ()
        needed += [call for call in calls if call not in needed]
    kernels = [Kernel(code.functions[one]) for one in needed if one not in with_loops]
    loops = [one for key, one in with_loops.items() if key in needed]
    checked = frozenset(chosen) - set(_UNCHECKED)
    return Unit(name, tuple(kernels), tuple(loops), tuple(chosen), checked, limit)


# States -------------------------------------------------------------------------------------------


class _Cases:
    """Regular states of a mechanism, and the answers and condition numbers there."""

    def __init__(self, code: GeneratedCode, unit: Unit, proof: Proof) -> None:
        self._code, self._unit, self._proof = code, unit, proof
        self._evaluation = Evaluation(code.functions)
        self._samples = [one for one in proof.samples if self._is_regular(one)]
        if not self._samples:
            raise InputError(
                f"{code.mechanism.name}: all {len(proof.samples)} states near home are nearly "
                "singular; there is none for the self-test"
            )

    def argument_names(self, name: str) -> list[str]:
        """Return the names of a function's arguments and results."""
        inputs, outputs = self._unit.function(name).inputs, self._unit.handed_out(name)
        return [key for key, _ in (*inputs, *outputs)]

    def of(self, name: str) -> list[Case]:
        """Return the cases of a function."""
        return [self._case(name, sample) for sample in self._samples]

    def _is_regular(self, sample: Sample) -> bool:
        given = self._given("forward_dynamics", sample, self._inputs("forward_dynamics"))
        opening, growth = self._evaluation("forward_dynamics", given)[-1]
        return bool(opening <= 1.0 and growth <= _REGULAR * self._unit.limit)

    def _inputs(self, name: str) -> list[str]:
        function = self._code.functions[name]
        return [function.name_in(i) for i in range(function.n_in())]

    def _given(self, name: str, sample: Sample, inputs: Sequence[str]) -> list[Array]:
        values = {**sample._asdict(), "h": np.array([STEP])}
        if name in ("closed", "gaps"):
            values["q"] = sample.near
        return [np.asarray(values[key], dtype=np.float64) for key in inputs]

    def _case(self, name: str, sample: Sample) -> Case:
        inputs = [key for key, _ in self._unit.function(name).inputs]
        count = len(self._unit.handed_out(name))
        given = self._given(name, sample, inputs)

        def evaluate(given: Sequence[Array]) -> list[Array]:
            return self._evaluation(name, given)[:count]

        found = evaluate(given)
        answers = [*self._proof.expected(name, sample, found), *[None] * count][:count]
        scales = [self._scale(key, one) for key, one in zip(inputs, given, strict=True)]
        expected = [None if one is None else np.ravel(one) for one in answers]
        return Case(tuple(given), tuple(expected), conditions(evaluate, given, scales))

    def _scale(self, argument: str, value: Array) -> Array:
        """Return the sizes of an argument's numbers: angles against the characteristic length."""
        system = self._code.mechanism.system
        unit = system.column_scale
        if argument == "q":
            lengths = [entry.unit == "m" for entry in vectors(self._code.mechanism).q]
            least = np.where(lengths, system.equations.length, 1.0)
            return np.maximum(np.abs(value), least)
        independent = self._code.partition.independent
        of = {"v": unit, "a": unit, "u": unit[independent], "w": unit[independent]}
        if argument in of:
            return np.asarray(of[argument] * np.abs(value / of[argument]).max(initial=0.0))
        if argument == "tau":
            force = 1.0 / unit[system.actuated]
            return np.asarray(force * np.abs(value / force).max(initial=0.0))
        return np.abs(value)


# Words --------------------------------------------------------------------------------------------


def _constants(code: GeneratedCode) -> list[Constant]:
    mechanism, system = code.mechanism, code.mechanism.system
    found = [
        Constant("NQ", mechanism.model.nq, "numbers of a configuration"),
        Constant("NV", mechanism.model.nv, "velocities"),
        Constant("NA", system.actuated.size, "actuator forces"),
        Constant("NC", mechanism.constraint_size, "rows of the closures"),
        Constant("NI", code.partition.independent.size, "independent joints"),
    ]
    if code.labels:
        found.append(Constant("NP", len(code.labels), "parameters"))
    return found


def _orders(code: GeneratedCode) -> list[Order]:
    order = vectors(code.mechanism)

    def lines(entries: Sequence[Entry], suffix: str = "") -> tuple[str, ...]:
        return tuple(f"{what}, {unit}{suffix}" for what, unit in entries)

    independent = [order.v[i] for i in code.partition.independent]
    found = [
        Order("Configurations q", lines(order.q)),
        Order("Velocities v (accelerations a: /s^2)", lines(order.v, "/s")),
        Order("Independent joints, of u (w: /s^2)", lines(independent, "/s")),
        Order("Actuator forces tau", lines(order.tau)),
        Order("Rows of the closures, of gaps and of the Jacobian", lines(order.rows)),
    ]
    if code.wrench_frames:
        frames = [
            f"{part} {axis} at frame {quoted(frame)}, {unit}"
            for frame in code.wrench_frames
            for part, unit in (("force", "N"), ("moment", "N m"))
            for axis in "xyz"
        ]
        found.append(Order("Wrenches", tuple(frames)))
    if code.labels:
        found.append(Order("Parameters", tuple(quoted(label) for label in code.labels)))
    return found


def _notes(code: GeneratedCode, real: str) -> list[str]:
    mechanism = code.mechanism
    gravity = ", ".join(f"{number:g}" for number in mechanism.model.gravity.linear)
    limit = OPEN * mechanism.characteristic_length
    error = float(np.sqrt(_LIMITS[real])) * GROWTH * _EPSILONS[real]
    effects = mechanism.effects
    notes = [
        "Gravity is among the parameters."
        if "gravity" in code.parameters
        else f"Gravity is ({gravity}) m/s^2 in world axes.",
        "World axes are those of the mechanism's root. Forces of a closure act on the mechanism as "
        "J' multipliers.",
        f"The loops count as open beyond a gap of {limit:.3g} m ({OPEN:g} of the characteristic "
        f"length, {mechanism.characteristic_length:.6g} m), and a configuration as nearly singular "
        f"where rounding errors may grow to about {error:.0g}, relative.",
    ]
    if effects is not None:
        notes.append("Damping, friction and springs of the joints are part of the dynamics.")
    return notes
