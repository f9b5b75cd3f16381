"""Encoders of the legs' lengths: noise, then quantisation."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral, Real

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import InputError


@dataclass(frozen=True)
class Encoders:
    """What the three encoders make of lengths: round((d + noise) / resolution) resolution.

    Parameters
    ----------
    resolution
        m; zero for none.
    noise
        Standard deviation of each reading, m: Gaussian, anew at each.
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
            value = getattr(self, name)
            if not (isinstance(value, Real) and 0.0 <= float(value) < np.inf):
                raise InputError(f"encoder {name} = {value}: it must be zero or more, and finite")
        if not (isinstance(self.seed, Integral) and self.seed >= 0):
            raise InputError(f"encoder seed = {self.seed}: it must be zero or more, a whole number")

    def generator(self) -> np.random.Generator:
        """Return where the noise comes from."""
        return np.random.default_rng(self.seed)

    def read(self, length: Array, generator: np.random.Generator) -> Array:
        """Return a reading, shape (3,), m, of true lengths."""
        reading = np.array(length, dtype=np.float64)
        if self.noise:
            reading += self.noise * generator.standard_normal(3)
        if self.resolution:
            reading = np.round(reading / self.resolution) * self.resolution
        return reading
