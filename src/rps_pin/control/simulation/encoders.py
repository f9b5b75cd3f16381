"""Encoders of the actuators' positions: noise and quantisation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rps_pin.arrays import Array
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import non_negative_number, whole_number


@refuses_other_kinds
@dataclass(frozen=True)
class Encoders:
    """Readings of positions d: round((d + noise) / resolution) resolution.

    Parameters
    ----------
    resolution
        m (rad of actuators that turn); zero for none.
    noise
        Standard deviation, likewise: Gaussian, independent in each reading.
    seed
        Of the noise: equal seeds give equal readings.

    Raises
    ------
    InputError
        If a number is negative or not finite.
    """

    resolution: float = 0.0
    noise: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("resolution", "noise"):
            non_negative_number(getattr(self, name), f"encoder {name}", "m")
        whole_number(self.seed, "encoder seed", 0)

    def generator(self) -> np.random.Generator:
        """Return the noise's random generator."""
        return np.random.default_rng(self.seed)

    def read(self, length: Array, generator: np.random.Generator) -> Array:
        """Return a reading of true positions, shape (na,)."""
        reading = np.array(length, dtype=np.float64)
        if self.noise:
            reading += self.noise * generator.standard_normal(reading.size)
        if self.resolution:
            reading = np.round(reading / self.resolution) * self.resolution
        return reading
