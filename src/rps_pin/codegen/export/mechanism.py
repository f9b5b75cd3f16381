"""A mechanism's functions as a package of C: those of `functions` and `routines`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.codegen.export import words
from rps_pin.codegen.export.cases import UNCHECKED, Cases
from rps_pin.codegen.export.names import identifier, quoted
from rps_pin.codegen.export.package import Constant, Function, Order, Package, Real
from rps_pin.codegen.export.vectors import Entry, vectors
from rps_pin.codegen.expressions.functions import MechanismFunctions
from rps_pin.codegen.expressions.independent import choose, regular_samples
from rps_pin.codegen.expressions.mechanism import GROWTH, LIMITS, MechanismExpressions
from rps_pin.codegen.expressions.routines import with_calls
from rps_pin.codegen.units import Kernel, Unit
from rps_pin.errors import InputError, did_you_mean
from rps_pin.validation import choice as one_of

_EPSILONS: Mapping[str, float] = {"double": 2.0**-52, "float": 2.0**-23}


def mechanism_package(
    mechanism: ClosedLoopModel,
    *,
    name: str = "",
    real: Real = "double",
    functions: Sequence[str] = (),
    frames: Sequence[str] = (),
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
    frames
        Names of frames whose placement and Jacobian are functions too.
    parameters
        Groups of numbers that are arguments of the functions; see `Parameters`.
    wrench_frames
        Names of frames at which external wrenches act.

    Raises
    ------
    InputError
        If a name or a number does not fit, or no regular state was found for the self-test.
    MechanismError
        If a frame is unknown.
    """
    one_of(real, "real", tuple(LIMITS))
    chosen = tuple(dict.fromkeys(functions)) or words.USUAL
    for one in chosen:
        if one not in words.FUNCTIONS:
            known = words.FUNCTIONS
            raise InputError(
                f"no function {one!r}{did_you_mean(one, known)}; there are: {', '.join(known)}"
            )
    called = identifier(name or mechanism.name)
    system = mechanism.system
    partition = choose(system, regular_samples(system, mechanism.home).jacobians)
    if "inverse_dynamics_derivatives" in chosen and not partition.is_actuated:
        raise InputError(
            f"inverse_dynamics_derivatives of {mechanism.name}: {system.actuated.size} actuated "
            f"velocities must be the {partition.mobility} independent ones"
        )
    x = MechanismExpressions(system, partition, parameters, wrench_frames, single=real == "float")
    made = MechanismFunctions(x)
    #: Names in the unit, and in `functions` and `routines`.
    sources = {one: one for one in chosen} | _frames(mechanism, frames)
    unit = _unit(made, called, sources, LIMITS[real])
    cases = Cases(mechanism, made, unit.limit)
    entries = []
    for one, source in sources.items():
        inputs = [key for key, _ in unit.function(one).inputs]
        results = [key for key, _ in unit.handed_out(one)]
        sentence, own = words.of(source, mechanism)
        entries.append(
            Function(
                one,
                sentence,
                {key: own.get(key) or words.ARGUMENTS[key] for key in (*inputs, *results)},
                _operations(unit, one),
                cases.of(source, inputs, len(results)),
                cases.opened(source, inputs, one in unit.checked),
            )
        )
    return Package(
        called,
        quoted(mechanism.name),
        real,
        unit,
        entries,
        _constants(mechanism, x),
        _orders(mechanism, x),
        list(zip(x.parameters.labels, x.parameters.nominal.tolist(), strict=True)),
        _notes(mechanism, x, real),
    )


def _frames(mechanism: ClosedLoopModel, frames: Sequence[str]) -> dict[str, str]:
    """Return the functions of frames by their names in C."""
    found: dict[str, str] = {}
    for frame in dict.fromkeys(frames):
        source = f"frame_jacobian_{mechanism.system.frame(frame)}"
        called = f"frame_{identifier(f'frame {frame}').removeprefix('frame_')}"
        if called in found:
            raise InputError(f"frames {frame!r} and another would both be {called} in C")
        found[called] = source
    return found


def _unit(
    functions: MechanismFunctions, name: str, sources: Mapping[str, str], limit: float
) -> Unit:
    """Return the unit of functions and of what they call."""
    called, loops = with_calls(functions, sources.values())
    names = {source: one for one, source in sources.items()}
    kernels = [Kernel(_renamed(functions[one], names.get(one, one))) for one in called]
    checked = frozenset(sources) - set(UNCHECKED)
    return Unit(name, tuple(kernels), loops, tuple(sources), checked, limit)


def _operations(unit: Unit, name: str) -> int:
    """Return about how many operations a result takes; loops run some four times."""
    one = unit.function(name)
    if isinstance(one, Kernel):
        return int(one.function.n_instructions())
    return 4 * sum(_operations(unit, call) for call in one.calls)


def _renamed(function: ca.Function, name: str) -> ca.Function:
    if function.name() == name:
        return function
    given = function.sx_in()
    names = function.name_in(), function.name_out()
    return ca.Function(name, given, function.call(given), *names)


# Words --------------------------------------------------------------------------------------------


def _constants(mechanism: ClosedLoopModel, x: MechanismExpressions) -> list[Constant]:
    found = [
        Constant("NQ", mechanism.model.nq, "numbers of a configuration"),
        Constant("NV", mechanism.model.nv, "velocities"),
        Constant("NA", x.system.actuated.size, "actuator forces"),
        Constant("NC", mechanism.constraint_size, "rows of the closures"),
        Constant("NI", x.independent.size, "independent velocities"),
    ]
    if x.parameters.labels:
        found.append(Constant("NP", len(x.parameters.labels), "parameters"))
    return found


def _orders(mechanism: ClosedLoopModel, x: MechanismExpressions) -> list[Order]:
    order = vectors(mechanism)

    def lines(entries: Sequence[Entry], suffix: str = "") -> tuple[str, ...]:
        return tuple(f"{what}, {unit}{suffix}" for what, unit in entries)

    independent = [order.v[i] for i in x.independent]
    found = [
        Order("Configurations q", lines(order.q)),
        Order("Velocities v (accelerations a: /s^2)", lines(order.v, "/s")),
        Order(
            "Independent velocities u (accelerations w: /s^2)",
            lines(independent, "/s"),
        ),
        Order("Actuator forces tau", lines(order.tau)),
        Order("Rows of the closures: of gaps, of the Jacobian, of multipliers", lines(order.rows)),
    ]
    if x.wrench_frames:
        wrenches = [
            f"{part} {axis} at frame {quoted(frame)}, {unit}"
            for frame in x.wrench_frames
            for part, unit in (("force", "N"), ("moment", "N m"))
            for axis in "xyz"
        ]
        found.append(Order("External wrenches", tuple(wrenches)))
    if x.parameters.labels:
        found.append(Order("Parameters", tuple(map(quoted, x.parameters.labels))))
    return [one for one in found if one.lines]


def _notes(mechanism: ClosedLoopModel, x: MechanismExpressions, real: str) -> list[str]:
    gravity = ", ".join(f"{number:g}" for number in mechanism.model.gravity.linear)
    length, limit = mechanism.characteristic_length, mechanism.system.equations.open_limit
    error = float(np.sqrt(LIMITS[real])) * GROWTH * _EPSILONS[real]
    notes = [
        "Gravity is among the parameters."
        if "gravity" in x.parameters.groups
        else f"Gravity is ({gravity}) m/s^2 in world axes.",
        "World axes are those of the mechanism's root. The closures' forces act on the mechanism "
        "as J' multipliers.",
        f"The loops count as open beyond a gap of {limit:.3g} m ({limit / length:.3g} of the "
        f"characteristic length, {length:.6g} m), and a configuration as nearly singular where "
        f"rounding errors may grow to about {error:.0g}, relative.",
    ]
    if mechanism.effects is not None:
        notes.append("Damping, friction and springs of the joints are part of the dynamics.")
    return notes
