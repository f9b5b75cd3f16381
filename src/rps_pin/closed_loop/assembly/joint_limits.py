"""Joint limits of a tree: bounds on its coordinates, for closing the loops within them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools

#: Distance from a limit, relative to it, within which a joint counts as standing at it.
_AT = 1e-12


class JointLimits:
    """Limits of the joints whose coordinates are plain numbers (no balls, free-flyers, full turns).

    Parameters
    ----------
    model
        The tree; its position limits.
    angular
        Which velocities are angular, shape (nv,), for the units in phrases; without, they have
        none.
    """

    def __init__(self, model: pin.Model, angular: Bools | None = None) -> None:
        joints = [joint for joint in list(model.joints)[1:] if joint.nq == joint.nv]
        pairs = [(joint, k) for joint in joints for k in range(joint.nv)]
        self.q = np.array([joint.idx_q + k for joint, k in pairs], dtype=np.intp)
        self.v = np.array([joint.idx_v + k for joint, k in pairs], dtype=np.intp)
        self.names = [model.names[joint.id] for joint, _ in pairs]
        self.lower = model.lowerPositionLimit[self.q]
        self.upper = model.upperPositionLimit[self.q]
        self._nv = model.nv
        self._units = ["" if angular is None else " rad" if angular[i] else " m" for i in self.v]

    def clip(self, q: Array) -> Array:
        """Return the configuration with every coordinate brought within its limits."""
        clipped = q.copy()
        clipped[self.q] = np.clip(q[self.q], self.lower, self.upper)
        return clipped

    def beyond(self, q: Array, slack: float | Array = 0.0) -> Bools:
        """Return which coordinates are outside their limits by more than a slack, shape (..., n).

        Of configurations of shape (..., nq); the slack is one number or of shape (n,).
        """
        x = q[..., self.q]
        return np.asarray((x < self.lower - slack) | (x > self.upper + slack))

    def outside(self, q: Array) -> dict[str, str]:
        """Return a phrase for each joint outside its limits, by its name."""
        x = q[self.q]
        return {
            self.names[i]: f"{self.names[i]!r} at {x[i]:.6g}{self._units[i]} "
            f"({self.lower[i]:.6g} to {self.upper[i]:.6g}{self._units[i]})"
            for i in np.flatnonzero(self.beyond(q))
        }

    def blocked(self, q: Array, step: Array) -> Bools:
        """Return which velocities, shape (nv,), a step would drive out through a limit at once."""
        x, outward = q[self.q], step[self.v]
        blocked = np.zeros(self._nv, dtype=bool)
        at_lower = x <= self.lower + self._margin(self.lower)
        at_upper = x >= self.upper - self._margin(self.upper)
        blocked[self.v] = (at_upper & (outward > 0)) | (at_lower & (outward < 0))
        return blocked

    def reached(self, q: Array) -> list[str]:
        """Return a phrase for each joint that stands at a limit."""
        x, found = q[self.q], dict[str, str]()
        for limit in (self.lower, self.upper):
            at = np.isfinite(limit) & (np.abs(x - limit) <= self._margin(limit))
            for i in np.flatnonzero(at):
                name = self.names[i]
                found.setdefault(
                    name, f"joint {name!r} at its limit {limit[i]:.6g}{self._units[i]}"
                )
        return list(found.values())

    def _margin(self, limit: Array) -> Array:
        return _AT * np.where(np.isfinite(limit), np.abs(limit), 0.0)
