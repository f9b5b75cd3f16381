"""Exciting motions: those in which a log tells most of the base parameters, within limits.

Of the motions of `fourier`, one is sought for which the determinant of W'W is largest, or the
condition number of W is least (columns of one length), W the regressor of the base parameters at
samples of the motion. What leaves a limit, is out of reach or is singular costs as much as it
leaves it by; SciPy's L-BFGS-B, from random starts, finds the least. At the end the path is
checked (`check_path`), and the motion is made smaller until nothing is found.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from rps_pin.arrays import Array
from rps_pin.errors import InputError, RPSPinError, UnreachableError
from rps_pin.numerics.linear_algebra import singular_values
from rps_pin.task.identification.exciting.fourier import FourierMotion, free_coefficients
from rps_pin.task.identification.model import DynamicsModel, Progress, States, condition_of
from rps_pin.task.path_check import check_path
from rps_pin.task.paths.events import PathCheck
from rps_pin.validation import choice, numbers, positive_number, whole_number

Criterion = Literal["determinant", "condition"]

#: Amplitude that is taken if none is given, over the characteristic length.
_AMPLITUDE = 0.15
#: Samples for each harmonic, in the search.
_SAMPLES = 10
#: Share of a limit that the search goes up to.
_ROOM = 0.9
#: Cost of a limit exceeded once over, and of a sample that cannot be reached.
_EXCESS, _LOST = 1e3, 1e4
#: Share of samples out of reach from which a motion is not looked at.
_MOST_LOST = 0.5
#: Factor of a motion that the path check finds something of, and how often it is taken.
_SMALLER, _TIMES = 0.93, 30
#: Limits of a model from which on there is none.
_NO_LIMIT = 1e6


class ExcitingMotion(NamedTuple):
    """A motion for identification."""

    trajectory: FourierMotion
    """Of the task's coordinates."""
    condition: float
    """Condition number of the base regressor along it, columns of one length."""
    log_determinant: float
    """Natural logarithm of the determinant of W'W / samples."""
    start_log_determinant: float
    """The same of the best random motion that the search began with."""
    evaluations: int
    """Motions that were tried."""
    check: PathCheck
    """Of the path; it found nothing."""


def exciting_motion(
    model: DynamicsModel,
    *,
    period: float = 10.0,
    harmonics: int = 5,
    amplitude: ArrayLike | None = None,
    start: ArrayLike | None = None,
    criterion: Criterion = "determinant",
    starts: int = 20,
    iterations: int = 30,
    repeats: int = 1,
    seed: int = 0,
    progress: Progress = iter,
) -> ExcitingMotion:
    """Return a motion in which a log tells much of the base parameters.

    Limits are those of the mechanism's model: the joints' positions, and the actuators' speeds and
    forces (those of the mechanism as it is believed to be), of which 90 % are used; and the
    amplitude.

    Parameters
    ----------
    model
        What is to be identified; of a task in generated code it takes a fraction of the time.
    period
        s; the slowest harmonic has one turn in it.
    harmonics
        How many there are, 2 or more.
    amplitude
        Farthest that each coordinate goes from the start, m and rad, one number or (m,); left out,
        0.15 characteristic lengths (angles: 0.15 rad).
    start
        Coordinates, shape (m,); home if left out.
    criterion
        ``"determinant"``: the volume of the parameters' confidence ellipsoid is least;
        ``"condition"``.
    starts, iterations
        Random motions to begin with, and steps of the search from the best of them.
    repeats
        How often the period is run through.
    seed
        Of the random motions.
    progress
        Wraps the loop over the random motions.

    Raises
    ------
    InputError
        If a number is out of its range.
    UnreachableError
        If no motion about the start is clear of limits and singularities.
    """
    search = _Search(
        model,
        positive_number(period, "period", "s"),
        whole_number(harmonics, "harmonics", 2),
        _amplitude(model, amplitude),
        _start(model, start),
        choice(criterion, "criterion", ("determinant", "condition")),
        whole_number(repeats, "repeats"),
    )
    rng = np.random.default_rng(seed)
    best, lowest = search.random(rng), np.inf
    for _ in progress(range(whole_number(starts, "starts"))):
        shape = search.random(rng)
        if (cost := search.cost(shape)) < lowest:
            best, lowest = shape, cost
    begun = search.measures(search.motion(best))
    found = minimize(
        search.cost,
        best,
        method="L-BFGS-B",
        options={"maxiter": whole_number(iterations, "iterations", 0), "maxfun": 10**6},
    )
    return search.checked(np.asarray(found.x), begun[1])


class _Search:
    """The problem, in amplitudes as unknowns."""

    def __init__(
        self,
        model: DynamicsModel,
        period: float,
        harmonics: int,
        amplitude: Array,
        start: Array,
        criterion: str,
        repeats: int,
    ) -> None:
        self.model, self.period, self.amplitude, self.start = model, period, amplitude, start
        self.criterion, self.repeats = criterion, repeats
        self.bases = free_coefficients(harmonics)
        self.evaluations = 0
        self.times = np.linspace(0, period, _SAMPLES * harmonics, endpoint=False)
        tree, actuated = model.mechanism.model, model.mechanism.actuated_indices
        speed, force = (np.array(one)[actuated] for one in (tree.velocityLimit, tree.effortLimit))
        self.speed, self.force = (
            np.where((one > 0) & (one < _NO_LIMIT), one, np.inf) for one in (speed, force)
        )
        self.lower, self.upper = tree.lowerPositionLimit, tree.upperPositionLimit
        bounded = (self.upper - self.lower < _NO_LIMIT) & (self.upper > self.lower)
        self.bounded = np.flatnonzero(bounded)
        self.weights = 1 / np.maximum(np.abs(self._home_forces()), 1e-3)

    def _home_forces(self) -> Array:
        """Return the scale of each actuator's force: in random motions."""
        states = self.model.random_states(np.random.default_rng(0), 20)
        rows, known = self.model.regressor(states)
        forces = rows @ self.model.nominal + known
        return np.asarray(np.sqrt(np.mean(forces**2, axis=0)))

    def random(self, rng: np.random.Generator) -> Array:
        """Return a random motion, of about the amplitude."""
        shape = rng.normal(size=2 * self.bases[0].shape[1] * self.amplitude.size)
        motion = self.motion(shape)
        x = motion.sample(self.times).pose - self.start
        return np.asarray(0.8 * shape / np.abs(x / self.amplitude).max())

    def motion(self, shape: Array, size: float = 1.0) -> FourierMotion:
        cosines, sines = shape.reshape(2, -1, self.amplitude.size) * self.amplitude * size
        return FourierMotion(
            self.start, self.bases[0] @ cosines, self.bases[1] @ sines, self.period
        )

    def cost(self, shape: Array) -> float:
        """Return what is made small."""
        self.evaluations += 1
        motion = self.motion(shape)
        states = self._states(motion)
        lost = 1 - len(states.q) / self.times.size
        if lost > _MOST_LOST:
            return _LOST
        rows, known = self.model.regressor(states)
        condition, determinant = self._measures(rows)
        excess = self._excess(motion, states, rows @ self.model.nominal + known)
        value = np.log(condition) if self.criterion == "condition" else -determinant
        return float(value + _EXCESS * excess + _LOST * lost)

    def measures(self, motion: FourierMotion) -> tuple[float, float]:
        """Return the condition number and log det of W'W / samples."""
        states = self._states(motion)
        if len(states.q) < (1 - _MOST_LOST) * self.times.size:
            return np.inf, -np.inf
        return self._measures(self.model.regressor(states)[0])

    def _states(self, motion: FourierMotion) -> States:
        """Return the states that are reached."""
        return self.model.states_of_task(*motion.sample(self.times))

    def _measures(self, rows: Array) -> tuple[float, float]:
        base = (rows[..., self.model.base.independent] * self.weights[:, None]).reshape(
            -1, self.model.believed.size
        )
        condition = condition_of(base)
        with np.errstate(divide="ignore"):
            values = singular_values(base / np.sqrt(len(rows)))
            return condition, float(2 * np.log(values).sum())

    def _excess(self, motion: FourierMotion, states: States, tau: Array) -> float:
        """Return the sum of squares by which limits are left, over the limits."""
        actuated = self.model.mechanism.actuated_indices
        away = np.abs(motion.sample(self.times).pose - self.start) / self.amplitude
        forces = np.abs(tau) / (_ROOM * self.force)
        speeds = np.abs(states.v[:, actuated]) / (_ROOM * self.speed)
        q = states.q[:, self.bounded]
        low, high = self.lower[self.bounded], self.upper[self.bounded]
        inside = np.abs(q - (low + high) / 2) / (_ROOM * (high - low) / 2)
        return float(
            sum(np.sum(np.maximum(one - 1, 0) ** 2) for one in (away, forces, speeds, inside))
        )

    def checked(self, shape: Array, begun: float) -> ExcitingMotion:
        """Return the motion, made smaller until the path check finds nothing."""
        size, why = 1.0, ""
        for _ in range(_TIMES):
            motion = self.motion(shape, size)
            try:
                found = check_path(self.model.task, motion)
            except RPSPinError as error:
                why = str(error)
            else:
                links = found.interference.events if found.interference else ()
                events = [*found.singularities, *found.limits, *links]
                if not events:
                    whole = FourierMotion(
                        motion.start, motion.cosines, motion.sines, self.period, self.repeats
                    )
                    return ExcitingMotion(
                        whole, *self.measures(motion), begun, self.evaluations, found
                    )
                why = str(events[0])
            size *= _SMALLER
        raise UnreachableError(
            f"no motion about the start {self.start.tolist()} is clear, down to {size:.2g} of the "
            f"amplitude: {why}"
        )


def _amplitude(model: DynamicsModel, given: ArrayLike | None) -> Array:
    task = model.task
    if given is None:
        return np.asarray(_AMPLITUDE * task.characteristic_length / task.scale)
    found = numbers(given, "amplitude", f"one number, or numbers of shape ({task.size},)")
    if found.shape not in ((), (task.size,)) or not ((found > 0) & np.isfinite(found)).all():
        raise InputError(
            f"amplitude = {found.tolist()}: it must be positive, one number or {task.size}"
        )
    return np.broadcast_to(found, task.size).copy()


def _start(model: DynamicsModel, given: ArrayLike | None) -> Array:
    task = model.task
    if given is None:
        return task.home
    found = numbers(given, "start", "the task's coordinates")
    if found.shape != (task.size,) or not np.isfinite(found).all():
        raise InputError(f"start = {found.tolist()}: it must be {task.size} finite coordinates")
    return found
