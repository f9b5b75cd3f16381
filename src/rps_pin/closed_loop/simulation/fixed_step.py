"""One step of fixed length, without the projection at its end."""

from __future__ import annotations

import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.simulation.damped import implicit_step
from rps_pin.closed_loop.simulation.integrators import RK4_WEIGHTS, rk4_step
from rps_pin.closed_loop.simulation.motion import Motion, State


def fixed_step(
    motion: Motion, time: float, state: State, step: float, a: Array
) -> tuple[State, float]:
    """Return the state one step later, to order 4, and the work done.

    Parameters
    ----------
    motion
        Its last acceleration was that at the start, `a`.
    time, state, step, a
        Where it starts, its length, s, and the acceleration there.
    """
    damping = motion.stiff_damping(*state, step)
    if damping is not None:
        return implicit_step(
            motion.model,
            motion.acceleration,
            time,
            state,
            step,
            a,
            damping,
            lambda: motion.power,
        )
    powers = [motion.power]  # at the start, where a comes from

    def acceleration(t: float, q: Array, v: Array) -> Array:
        a = motion.acceleration(t, q, v)
        powers.append(motion.power)
        return a

    moved = rk4_step(motion.model, acceleration, time, state, step, a)
    return moved, step * float(np.dot(RK4_WEIGHTS, powers))
