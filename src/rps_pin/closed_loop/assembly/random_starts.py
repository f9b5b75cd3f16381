"""Random configurations of joints, for searches."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.constraints.system import ConstraintSystem


class RandomStarts:
    """Configurations about one, uniform over the angles and over what else can be reached.

    Angles lie anywhere within a turn, balls and free-flyers are turned anyhow (uniform rotations),
    and displacements are up to the mechanism's size from their values in the given configuration:
    the largest extent of its joints' origins and closed frames there. Joint limits narrow that,
    where they count and where a joint has them.

    Parameters
    ----------
    system
        The system.
    about
        Configuration, shape (nq,).
    held
        Velocities of joints that keep their values in it, shape (nv,).
    within_limits
        Whether the joint limits count.
    """

    def __init__(
        self, system: ConstraintSystem, about: Array, held: Bools, within_limits: bool
    ) -> None:
        self._model, self._about, self._held = system.model, about, held
        self._angular, limits = system.equations.angular_velocities, system.limits
        self._size = mechanism_size(system, about)
        self._q, self._v = limits.q[~held[limits.v]], limits.v[~held[limits.v]]
        centre = about[self._q]
        reach = np.where(self._angular[self._v], np.pi, self._size)
        self._lower, self._width = centre - reach, 2 * reach
        if within_limits:
            lower, upper = limits.lower[~held[limits.v]], limits.upper[~held[limits.v]]
            half = np.maximum(upper / 2 - lower / 2, 0.0)  # limits may be the largest numbers
            self._width = 2 * np.minimum(reach, half)
            self._lower = np.clip(self._lower, lower, np.maximum(upper - self._width, lower))

    def drawn(self, rng: np.random.Generator, count: int) -> Array:
        """Return configurations, shape (count, nq)."""
        drawn = np.array([self._moved(rng) for _ in range(count)]).reshape(count, -1)
        drawn[:, self._q] = self._lower + self._width * rng.random((count, self._q.size))
        return drawn

    def _moved(self, rng: np.random.Generator) -> Array:
        """Return the configuration with balls, free-flyers and the like moved at random."""
        velocity = np.zeros(self._model.nv)
        for joint in list(self._model.joints)[1:]:
            if joint.nq == joint.nv:
                continue
            own = np.arange(joint.idx_v, joint.idx_v + joint.nv)
            turning, moving = own[self._angular[own]], own[~self._angular[own]]
            velocity[moving] = self._size * rng.uniform(-1.0, 1.0, moving.size)
            if turning.size == 3:
                turn = pin.Quaternion(*_direction(rng)).toRotationMatrix()
                velocity[turning] = pin.log3(turn)
            else:
                velocity[turning] = rng.uniform(-np.pi, np.pi, turning.size)
        velocity[self._held] = 0.0
        moved: Array = pin.integrate(self._model, self._about, velocity)
        return moved


def mechanism_size(system: ConstraintSystem, q: Array) -> float:
    """Return the largest extent of the joints' origins and closed frames along an axis, m."""
    data, equations = system.data, system.equations
    pin.forwardKinematics(system.model, data, q)
    points = [data.oMi[i].translation for i in range(1, system.model.njoints)]
    for closed in equations.closed_frames:
        points += [frame.at(data).translation for frame in (closed.a, closed.b)]
    extent = float(np.ptp(np.array(points), axis=0).max(initial=0.0))
    return max(extent, equations.length)


def _direction(rng: np.random.Generator) -> Array:
    """Return a uniform unit vector of four numbers."""
    numbers = rng.normal(size=4)
    return np.asarray(numbers / np.linalg.norm(numbers))
