"""How far configurations are from singularities, for any mechanism with a task.

The measures compare speeds. Those of joints and of the task's coordinates are made comparable by
the characteristic length l: an angle counts as l times itself, a length. With J the closures'
Jacobian of rank r, N an orthonormal basis of the motions that it allows, and A and S the rows of
the task and of the actuators,

================== ============================================== ==============================
measure            definition                                     zero at
================== ============================================== ==============================
`type_i` (input)   least |task's speed| of all allowed motions    the mechanism moves, and its
                   with |speeds of all joints| = 1                output does not
`type_ii` (output) least |actuators' speed| of all motions with   the output moves, and no
                   |task's speed| = 1                             actuator does, so that none
                                                                  resists
`constraint`       s_r / s_1, singular values of J                a closure's rows fail: there
                                                                  is one motion more
`determinant`      that of K = d(actuators)/d(task), signed       type II
================== ============================================== ==============================

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
