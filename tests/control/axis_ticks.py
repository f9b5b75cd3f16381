"""One axis of the control loop, tick by tick, with the real `SpeedFilter`: the tests' reference.

Nothing here is a transfer function: matrices are found by putting unit vectors through a tick.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rps_pin.control.loop.filters import SpeedFilter

Array = NDArray[np.float64]


class Axis(NamedTuple):
    """Gains in 1/s^2, 1/s, 1/s^3; s; ticks; Hz."""

    proportional: float
    derivative: float
    integral: float
    period: float = 1e-3
    delay: int = 1
    cut_off: float | None = 50.0
    inertia: float = 1.0

    @property
    def options(self) -> dict[str, Any]:
        names = "period", "delay", "cut_off", "inertia"
        return {name: getattr(self, name) for name in names}

    def start(self, position: float) -> Array:
        """At rest there: x, v, last reading, filtered speed, integral, commands on their way."""
        return np.array([position, 0.0, position, 0.0, 0.0, *[0.0] * self.delay])

    def tick(self, state: Array, force: float | None = None) -> tuple[Array, float]:
        """State a tick later, and what the loop would accelerate; `force` opens the loop there."""
        T = self.period
        x, v, last, filtered, integral, *waiting = (float(number) for number in state)
        if self.cut_off is None:
            speed = v
        else:
            speeds = SpeedFilter(self.cut_off)
            speeds.update((last,) * 3, (filtered,) * 3)
            speed = filtered = speeds.after((x,) * 3, T)[1]
        integral += T * self.integral * (0 - x)
        waiting.append(self.derivative * (0 - speed) + self.proportional * (0 - x) + integral)
        arriving = self.inertia * waiting.pop(0)
        a = arriving if force is None else force
        after = [x + T * v + T**2 / 2 * a, v + T * a, x, filtered, integral, *waiting]
        if self.cut_off is None:
            after[3] = 0.0
        if self.integral == 0:
            after[4] = 0.0  # else a pole at 1 that nothing moves
        return np.array(after), arriving

    def closed(self) -> Array:
        """State matrix of the closed loop."""
        return np.array([self.tick(unit)[0] for unit in np.eye(5 + self.delay)]).T

    def radius(self) -> float:
        """Largest modulus of the closed loop's poles."""
        return float(np.abs(np.linalg.eigvals(self.scaled(self.closed()))).max())

    def scaled(self, matrix: Array) -> Array:
        """Similar matrix in ticks, of better condition; the poles are the same."""
        T = self.period
        units = np.array([T**2, T, T**2, T, 1.0, *[1.0] * self.delay])
        return matrix * units / units[:, None]

    def opened(self, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """L at each z, from the state matrices of the loop opened at the force."""
        units = np.eye(5 + self.delay)
        A = np.array([self.tick(unit, 0.0)[0] for unit in units]).T
        C = np.array([self.tick(unit, 0.0)[1] for unit in units])
        B = self.tick(0 * units[0], 1.0)[0]
        return -(C @ np.linalg.solve(z[:, None, None] * np.eye(B.size) - A, B[:, None]))[..., 0]


def random_axis(rng: np.random.Generator) -> Axis:
    """Gains of any damping, well within stability to far beyond it, every kind of speed."""
    w = 2 * math.pi * 10 ** rng.uniform(0, 2)
    cut_off = (None, 10 ** rng.uniform(1, 3), math.inf)[rng.choice(3, p=[0.3, 0.6, 0.1])]
    return Axis(
        proportional=w**2,
        derivative=2 * 10 ** rng.uniform(-0.5, 0.7) * w,
        integral=rng.choice([0.0, 1.0]) * 10 ** rng.uniform(-3, 0.3) * w**3,
        period=10 ** rng.uniform(-4, -2.3),
        delay=int(rng.integers(0, 6)),
        cut_off=cut_off,
        inertia=rng.uniform(0.5, 2),
    )
