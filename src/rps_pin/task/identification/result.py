"""What an identification found: base parameters, physically possible ones, predictions."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop import ClosedLoopModel, JointEffects
from rps_pin.errors import MechanismError
from rps_pin.task.identification.evidence import evidence_of
from rps_pin.task.identification.factors import times
from rps_pin.task.identification.log import Log
from rps_pin.task.identification.model import DynamicsModel, Progress
from rps_pin.task.identification.physical import Possible


class Prediction(NamedTuple):
    """Forces of a log, filtered as those that were identified with, and what was predicted."""

    time: Array
    """Shape (n,), s: samples in use."""
    measured: Array
    """Filtered, shape (n, na), N or N m."""
    free: Array
    """By the free answer, shape (n, na)."""
    possible: Array | None
    """By the physically possible parameters."""
    believed: Array
    """By the parameters believed before."""
    expected: Array
    """Root mean square of the error of the free answer that noise, and the deviations of the base
    parameters, explain, shape (na,), N or N m."""
    doubts: tuple[str, ...]
    """Of the log."""

    def errors(self, of: str = "free") -> Array:
        """Return root mean squares of the errors, shape (na,), N or N m.

        `of` is ``"free"``, ``"possible"`` or ``"believed"``.
        """
        return np.asarray(np.sqrt(np.mean((getattr(self, of) - self.measured) ** 2, axis=0)))

    def percent(self, of: str = "free") -> Array:
        """Return the errors in per cent of the root mean square of the measured force, (na,)."""
        size = np.sqrt(np.mean(self.measured**2, axis=0))
        return np.asarray(100 * self.errors(of) / size)


class Identification(NamedTuple):
    """What logs say of a mechanism's dynamics."""

    model: DynamicsModel
    """What was identified."""
    values: Array
    """The base parameters, shape (b,): the free answer."""
    covariance: Array
    """Of the base parameters, shape (b, b)."""
    alone: Bools
    """Which base parameters are determined; the others keep what is believed."""
    noise: Array
    """Standard deviation of each actuator's force at a sample, before the filter, N or N m."""
    condition: float
    """Condition number of the logs' regressor, weighed, columns of one length."""
    cut_off: float
    """Of the filter, Hz."""
    samples: int
    """In use."""
    possible: Possible | None
    """The most likely parameters that are physically possible; None if not asked for."""
    doubts: tuple[str, ...]
    """What speaks against the identification, a sentence each; empty if nothing does."""
    factors: Array
    """Motor constants over those that the logs were read with, shape (na,); 1 where known."""
    factor_deviations: Array
    """Their standard deviations, shape (na,); 0 where known."""

    @property
    def deviations(self) -> Array:
        """Standard deviations of the base parameters, shape (b,); infinite where not seen."""
        return np.where(self.alone, np.sqrt(np.maximum(np.diag(self.covariance), 0.0)), np.inf)

    @property
    def believed(self) -> Array:
        """The base parameters believed before, shape (b,)."""
        return self.model.believed

    @property
    def labels(self) -> tuple[str, ...]:
        """The base parameters in words, each with the parameters that are added to it."""
        return self.model.base.words(self.model.labels)

    def predict(
        self, log: Log, *, near: ArrayLike | None = None, progress: Progress = iter
    ) -> Prediction:
        """Return what the forces of another log should be, filtered alike.

        Parameters
        ----------
        log, near, progress
            As for `identify`.

        Raises
        ------
        RPSPinError
            As `identify`.
        """
        doubts = list(log.notes)
        start = None if near is None else np.asarray(near, dtype=np.float64)
        found = evidence_of(self.model, [log], self.cut_off, start, doubts, progress)
        found = times(found, self.factors)
        measured = [one.measured[one.used] for one in found]

        def forces(values: Array) -> Array:
            return np.concatenate(
                [
                    full - one.forces[one.used] + one.rows[one.used] @ values
                    for full, one in zip(measured, found, strict=True)
                ]
            )

        possible = None
        if self.possible is not None:
            possible = forces(self.model.base.matrix @ self.possible.parameters)
        square = np.concatenate(
            [
                self.noise**2 * one.filtered.noise
                + np.einsum("nai,ij,naj->na", rows, self.covariance, rows)
                for one in found
                for rows in (one.rows[one.used],)
            ]
        )
        return Prediction(
            np.concatenate([one.time[one.used] for one in found]),
            np.concatenate(measured),
            forces(self.values),
            possible,
            forces(self.believed),
            np.sqrt(square.mean(axis=0)),
            tuple(doubts),
        )

    # The identified mechanism ---------------------------------------------------------------------

    @property
    def mechanism(self) -> ClosedLoopModel:
        """The mechanism with the physically possible parameters.

        Raises
        ------
        MechanismError
            If there are none, or an offset was estimated where there is no spring: a mechanism has
            no constant forces.
        """
        if self.possible is None:
            raise MechanismError("there are no physically possible parameters: ask for them")
        return with_parameters(self.model, self.possible.parameters)


def with_parameters(model: DynamicsModel, parameters: Array) -> ClosedLoopModel:
    """Return a mechanism with other numbers in place of those that are estimated.

    Parameters
    ----------
    model
        The mechanism, and what is estimated of it.
    parameters
        By ``model.labels``, shape (p,).

    Raises
    ------
    MechanismError
        If one is an offset other than 0: a mechanism has no constant forces.
    """
    mechanism = model.mechanism
    changed = pin.Model(mechanism.model)
    effects = mechanism.effects or JointEffects.named(changed)
    arrays = {
        name: np.array(getattr(effects, name))
        for name in ("damping", "friction", "stiffness", "rest")
    }
    arrays["armature"] = np.array(changed.armature)
    for k, label in enumerate(model.labels):
        kind, _, name = label.partition(":")
        if kind == "inertia":
            if name.endswith(".mass"):
                joint = changed.getJointId(name.removesuffix(".mass"))
                body = np.array(parameters[k : k + 10])
                changed.inertias[joint] = pin.Inertia.FromDynamicParameters(body)
            continue
        joint = changed.joints[changed.getJointId(name)]
        own = slice(joint.idx_v, joint.idx_v + joint.nv)
        if kind == "offset":
            if parameters[k]:
                _refuse_offset(name, parameters[k])
            continue
        arrays[kind][own] = parameters[k]
    changed.armature = arrays.pop("armature")
    own_effects: dict[str, Any] = {**arrays, "friction_speed": effects.friction_speed}
    options = mechanism._options() | {"effects": JointEffects(**own_effects)}
    return ClosedLoopModel(
        changed, mechanism.closures, mechanism.actuated, home=mechanism.home, **options
    )


def _refuse_offset(name: str, value: float) -> None:
    raise MechanismError(
        f"offset of joint {name!r} = {value:.6g}: a mechanism has no constant forces; correct the "
        "sensor by it and identify without it"
    )
