"""States of a mechanism, with the Pinocchio engine's answers and condition numbers there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.codegen.engine.proof import Proof, Sample
from rps_pin.codegen.export.evaluation import Evaluation
from rps_pin.codegen.export.package import Case, conditions
from rps_pin.codegen.export.vectors import vectors
from rps_pin.codegen.expressions.functions import MechanismFunctions
from rps_pin.errors import InputError, MechanismError

#: Functions of a mechanism that eliminate nothing.
UNCHECKED = ("gaps", "jacobian", "generalised_force", "energy")
#: Functions whose results are forces of all joints, brought to independent ones or to closures.
_REDUCED = ("inverse_dynamics", "constraint_forces", "bias", "gravity_forces")
#: States keep this share of the limit of growth.
_REGULAR = 0.1
#: What every number of an open configuration is moved by.
_OPEN = 0.3


class Cases:
    """Regular states of a mechanism, those of `rps_pin.codegen.engine.proof`.

    Parameters
    ----------
    mechanism
        The mechanism.
    functions
        Its functions.
    limit
        Largest growth that is not nearly singular; states stay well below.

    Raises
    ------
    InputError
        If all states are nearly singular.
    """

    def __init__(
        self, mechanism: ClosedLoopModel, functions: MechanismFunctions, limit: float
    ) -> None:
        x = functions.expressions
        self._independent, self._system = x.independent, mechanism.system
        self._lengths = [entry.unit == "m" for entry in vectors(mechanism).q]
        self._evaluation = Evaluation(functions)
        self._functions = functions
        self._proof = Proof(mechanism, x.independent, x.parameters.groups, x.wrench_frames)
        samples = self._proof.samples
        self._samples = [one for one in samples if self._growth(one) <= _REGULAR * limit]
        if not self._samples:
            raise InputError(
                f"{mechanism.name}: all {len(samples)} states near home are nearly singular, with "
                f"a growth of {min(map(self._growth, samples)):.3g} and more of at most "
                f"{_REGULAR * limit:.3g}; there is none for the self-test"
            )

    def of(self, name: str, inputs: Sequence[str], count: int) -> list[Case]:
        """Return the cases of a function or routine, of its first `count` results."""
        return [self._case(name, inputs, count, sample) for sample in self._samples]

    def opened(self, name: str, inputs: Sequence[str], checked: bool) -> Sequence[Array]:
        """Return arguments of a function with open loops; none if its status does not tell that."""
        if not checked or name in ("closed", "step"):
            return ()
        given = self._given(name, inputs, self._samples[0])
        moved = [one + _OPEN if key == "q" else one for key, one in zip(inputs, given, strict=True)]
        opening = self._evaluation(name, moved)[-1][0]
        return moved if opening > 10.0 else ()

    def _growth(self, sample: Sample) -> float:
        """Return growth at a state; infinity if its loops are open."""
        name = "forward_dynamics"
        try:
            function = self._functions[name]
        except MechanismError:  # no masses: kinematics alone
            function = self._functions[name := "motion_basis"]
        inputs = [function.name_in(i) for i in range(function.n_in())]
        opening, growth = self._evaluation(name, self._given(name, inputs, sample))[-1]
        return float(growth) if opening <= 1.0 else np.inf

    def _given(self, name: str, inputs: Sequence[str], sample: Sample) -> list[Array]:
        values = {**sample._asdict(), "h": np.array([self._proof.step])}
        if name in ("closed", "gaps"):
            values["q"] = sample.near
        return [np.asarray(values[key], dtype=np.float64) for key in inputs]

    def _case(self, name: str, inputs: Sequence[str], count: int, sample: Sample) -> Case:
        given = self._given(name, inputs, sample)

        def evaluate(given: Sequence[Array]) -> list[Array]:
            return self._evaluation(name, given)[:count]

        results = evaluate(given)
        answers = [*self._proof.expected(name, sample, results), *[None] * count][:count]
        expected = [None if one is None else np.ravel(one) for one in answers]
        scales = [self._scale(key, one) for key, one in zip(inputs, given, strict=True)]
        found = [float(one.max(initial=0.0)) for one in conditions(evaluate, given, scales)]
        share = 0.0 if name in UNCHECKED else sample.condition
        if name in ("closed", "step"):
            found[0] += self._of_closing(sample)
        if name.startswith("forward_dynamics"):
            share += self._of_inertia(sample)
        sizes = [float(np.abs(one).max(initial=0.0)) for one in results]
        if name in _REDUCED:
            reduced = self._reduced(sample)
            sizes = [max(size, reduced) for size in sizes]
        found = [one + share * size for one, size in zip(found, sizes, strict=True)]
        return Case(tuple(given), tuple(expected), tuple(found))

    def _reduced(self, sample: Sample) -> float:
        """Return the largest entry of |T|' |force|: what forces on dependent joints add up from."""
        also = ["parameters"] if sample.parameters.size else []
        wrenches = ["wrenches"] if sample.wrenches.size else []
        (basis, _) = self._evaluation("motion_basis", self._given("", ["q", *also], sample))
        given = self._given("", ["q", "v", "a", *wrenches, *also], sample)
        (force,) = self._evaluation("generalised_force", given)
        sums = np.abs(basis.reshape(force.size, -1)).T @ np.abs(force)
        return float(sums.max(initial=0.0))

    def _of_inertia(self, sample: Sample) -> float:
        """Return the condition number of the mass matrix, its coordinates scaled to 1."""
        inputs = ["q", "parameters"][: 1 + bool(sample.parameters.size)]
        given = self._given("", inputs, sample)
        mass = self._evaluation("mass_matrix", given)[0].reshape(2 * (self._independent.size,))
        scale = 1.0 / np.sqrt(mass.diagonal())
        return float(np.linalg.cond(scale[:, None] * mass * scale)) if mass.size else 0.0

    def _of_closing(self, sample: Sample) -> float:
        """Return the change of q by changes of the gaps by their condition numbers."""
        system, inputs = self._system, ["q", "parameters"][: 1 + bool(sample.parameters.size)]
        given = self._given("", inputs, sample)
        scales = [self._scale(key, one) for key, one in zip(inputs, given, strict=True)]
        (of_gaps,) = conditions(lambda x: self._evaluation("gaps", x), given, scales)
        dependent = np.setdiff1d(np.arange(system.model.nv), self._independent)
        jacobian = self._evaluation("jacobian", given)[0].reshape(-1, system.model.nv)
        inverse = np.linalg.pinv(system.scaled(jacobian)[:, dependent])
        change = np.abs(inverse) @ (system.row_scale * of_gaps)
        return float((system.column_scale[dependent] * change).max(initial=0.0))

    def _scale(self, argument: str, value: Array) -> Array:
        """Return the sizes of an argument's numbers: angles against the characteristic length."""
        unit = self._system.column_scale
        if argument == "q":
            least = np.where(self._lengths, self._system.equations.length, 1.0)
            return np.maximum(np.abs(value), least)
        units = {
            "v": unit,
            "a": unit,
            "u": unit[self._independent],
            "w": unit[self._independent],
            "tau": 1.0 / unit[self._system.actuated],
        }
        if argument in units:
            own = units[argument]
            return np.asarray(own * np.abs(value / own).max(initial=0.0))
        return np.abs(value)
