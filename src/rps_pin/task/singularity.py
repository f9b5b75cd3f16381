"""How far configurations are from singularities, for any mechanism with a task.

The measures compare speeds. Those of joints and of the task's coordinates are made comparable by
the characteristic length l: an angle counts as l times itself, a length. With J the closures'
Jacobian of rank r, N an orthonormal basis of the motions that it allows, and A and S the rows of
the task and of the actuators,

- `type_i` (input): the least speed of the task in an allowed motion in which the speed of all
  joints is 1. Zero where the mechanism moves and its output does not.
- `type_ii` (output): the least speed of the actuators in a motion in which the task's speed is 1.
  Zero where the output moves and no actuator does, so that none resists.
- `constraint`: the last singular value of J that counts over the first, s_r / s_1. Zero where a
  closure's rows fail, and there is one motion more.
- `determinant`: that of K = d(actuators)/d(task), signed. Zero with `type_ii`.

A speed is the root of the sum of squares.

The 3-RPS has closed forms in place of these, with the same names and zeros: see
`rps_pin.rps.singularity.measures` for their definitions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array


class SingularityMeasures(NamedTuple):
    """How far configurations are from each kind of singularity, shape (...) each; dimensionless."""

    type_i: Array
    """Zero at an input (type I) singularity."""
    type_ii: Array
    """Zero at an output (type II, parallel) singularity."""
    constraint: Array
    """Zero at a constraint singularity."""
    determinant: Array
    """Signed and smooth; changes sign where a path crosses a type II singularity."""

    @property
    def distance(self) -> Array:
        """Distance to the nearest singularity: the least of the three in size."""
        return np.minimum(np.minimum(self.type_i, self.type_ii), np.abs(self.constraint))

    @property
    def signed_type_ii(self) -> Array:
        """`type_ii` with the sign of `determinant`."""
        return np.copysign(self.type_ii, self.determinant)
