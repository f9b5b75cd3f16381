"""What a robot must do, and what is to be best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, did_you_mean
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.design.geometry.rods import Rod
from rps_pin.task.design.region import Region
from rps_pin.task.task import Task
from rps_pin.trajectories.path import Trajectory
from rps_pin.validation import finite_number, non_negative_number, positive_number, whole_number

Measure = Literal[
    "size", "mass", "conditioning", "force", "speed", "stroke", "stiffness", "clearance"
]
#: Measures that are best when they are large.
_LARGE = ("conditioning", "stiffness", "clearance")


@refuses_other_kinds
@dataclass(frozen=True)
class Requirements:
    """What must hold of a robot.

    Parameters
    ----------
    region
        Task coordinates that it must reach, from its middle straight to each point, in the assembly
        mode of home and on home's side of the singularities.
    min_conditioning
        Least conditioning (1/cond of K in one unit, 0 to 1) there.
    limit_margin
        Least room to the limits of joints there, as a share of the way between the two limits of a
        joint; of one that has one limit, in rad or characteristic lengths. 0: they are kept.
    motions
        Motions by name, as `rps_pin.task.load_task_trajectory` reads them: forces and speeds of the
        actuators must be within their limits.
    samples
        Samples of each motion.
    stiffness
        Of the actuators, N/m or N m/rad: one number, or one for each, shape (na,); links and joints
        count as rigid. The task's is K' diag(k) K.
    min_stiffness
        The least that it must be in any direction of the region, in N/m: angles count as arcs of
        the characteristic length.
    rods
        Links that must not collide in the region, as capsules, by name. Rods that share an end may
        touch.
    min_clearance
        The least distance of the surfaces of two rods, m; 0 if rods are given without it.

    Raises
    ------
    InputError
        If a number is not possible, a least stiffness has no stiffness of the actuators, or a
        least clearance no rods.
    """

    region: Region
    min_conditioning: float = 0.0
    limit_margin: float = 0.0
    motions: Mapping[str, Trajectory] | None = None
    samples: int = 41
    stiffness: ArrayLike | None = None
    min_stiffness: float | None = None
    rods: Mapping[str, Rod] | None = None
    min_clearance: float | None = None

    def __post_init__(self) -> None:
        if not 0 <= finite_number(self.min_conditioning, "min_conditioning") < 1:
            raise InputError(f"min_conditioning = {self.min_conditioning}: it must be from 0 to 1")
        if not 0 <= non_negative_number(self.limit_margin, "limit_margin") < 0.5:
            raise InputError(f"limit_margin = {self.limit_margin}: it must be below 0.5")
        whole_number(self.samples, "samples", 2)
        if self.min_stiffness is not None:
            positive_number(self.min_stiffness, "min_stiffness", "N/m")
            if self.stiffness is None:
                raise InputError("min_stiffness needs the stiffness of the actuators")
        if self.min_clearance is not None:
            finite_number(self.min_clearance, "min_clearance", "m")
            if not self.rods:
                raise InputError("min_clearance needs rods")
        if self.stiffness is not None:
            given = np.asarray(self.stiffness, dtype=np.float64)
            if not (np.isfinite(given) & (given > 0)).all():
                raise InputError("stiffness of the actuators: it must be positive and finite")

    def sampled(self, task: Task) -> list[Motion]:
        """Return the samples of the motions."""
        found = []
        for name, path in (self.motions or {}).items():
            poses = path.sample(np.linspace(0.0, path.duration, self.samples))
            parts = [np.asarray(part, dtype=np.float64) for part in (poses[0], poses[1], poses[2])]
            if parts[0].shape != (self.samples, task.size):
                raise InputError(f"motion {name!r} is not one of {', '.join(task.coordinates)}")
            found.append(Motion(name, *parts))
        return found


class Motion(NamedTuple):
    """Samples of a motion of the task."""

    name: str
    x: Array
    """Coordinates, shape (k, m)."""
    rate: Array
    """Shape (k, m)."""
    acceleration: Array
    """Shape (k, m)."""


@refuses_other_kinds
@dataclass(frozen=True)
class Objective:
    """What is to be small or large.

    Parameters
    ----------
    of
        A measure: ``size`` (m), ``mass`` (kg), ``conditioning`` (the worst in the region),
        ``force`` and ``speed`` (the largest of an actuator in the motions, N or N m, m/s or rad/s),
        ``stroke`` (the longest way of an actuator in the region, m or rad), ``stiffness`` (the
        least in the region, N/m), ``clearance`` (the least of two rods in the region, m); or the
        name of a dimension, or several with weights.
    largest
        Whether it is to be large; left out: conditioning, stiffness and clearance are, all
        others not.

    Raises
    ------
    InputError
        If there is no such measure.
    """

    of: str | Mapping[str, float]
    largest: bool | None = None

    @property
    def maximised(self) -> bool:
        """Whether it is to be large."""
        return self.of in _LARGE if self.largest is None else self.largest

    @property
    def name(self) -> str:
        """What it is called in tables."""
        if isinstance(self.of, str):
            return self.of
        return " + ".join(n if w == 1 else f"{w:g} {n}" for n, w in self.of.items())

    def of_candidates(
        self, measures: Mapping[str, Array], dimensions: Mapping[str, Array]
    ) -> Array:
        """Return its values (n,) of measures and dimensions (n,) each."""
        if isinstance(self.of, str):
            return measures[self.of] if self.of in measures else dimensions[self.of]
        return np.asarray(sum(weight * dimensions[name] for name, weight in self.of.items()))

    def refuse_unknown(self, dimensions: Sequence[str], requirements: Requirements) -> None:
        """Refuse what is neither a measure nor a dimension, or has nothing to be measured on."""
        known = (*get_args(Measure), *dimensions) if isinstance(self.of, str) else (*dimensions,)
        for name in [self.of] if isinstance(self.of, str) else self.of:
            if name not in known:
                raise InputError(
                    f"no objective {name!r}{did_you_mean(name, known)}; there are: "
                    f"{', '.join(known)}"
                )
        if self.of in ("force", "speed") and not requirements.motions:
            raise InputError(f"objective {self.of!r} needs motions")
        if self.of == "clearance" and not requirements.rods:
            raise InputError("objective 'clearance' needs rods")
        if self.of == "stiffness" and requirements.stiffness is None:
            raise InputError("objective 'stiffness' needs the stiffness of the actuators")


def objectives_of(given: Sequence[str | Objective]) -> tuple[Objective, ...]:
    """Return objectives, one to three.

    Raises
    ------
    InputError
        If there are none, or more than three.
    """
    names = (given,) if isinstance(given, (str, Objective)) else tuple(given)
    found = tuple(Objective(one) if isinstance(one, str) else one for one in names)
    if not 1 <= len(found) <= 3:
        raise InputError(f"{len(found)} objectives: there may be one to three")
    return found
