"""Forces and reactions of a motion as expressions: `rps_pin.rps.dynamics.joint_reactions`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rps_pin.numerics.elementary import Number
from rps_pin.rps.dynamics.force_equations import ForceTerms, forces_of_motion
from rps_pin.rps.dynamics.joint_reactions import in_balance, leg_axes
from rps_pin.rps.generated.forces import Tilt, column, leg_block
from rps_pin.rps.kernels import platform
from rps_pin.rps.kinematics.legs import RADIAL


def forces_and_reactions(
    terms: ForceTerms,
    tilt: Tilt,
    length: Sequence[Number],
    direction: Sequence[Number],
    rate: Sequence[Number],
    acceleration: Sequence[Number],
) -> tuple[tuple[Number, Number, Number], tuple[Number, ...]]:
    """Return the forces of the actuators, N; and of each leg on the platform, base axes, 9.

    Parameters
    ----------
    terms
        Of `terms_of`.
    tilt, length, direction
        Of `leg_block`.
    rate, acceleration
        Of the pose (3).
    """
    legs = leg_block(tilt, length, direction)
    x, y, functions, cosine, sine = legs.x, legs.y, legs.tilt, legs.cosine, legs.sine
    found = forces_of_motion(terms, legs, column(rate), column(acceleration), None)
    one, two, three = found.axial[:, 0]

    axes = leg_axes(cosine.T, sine.T)
    rows = [np.concatenate(row) for row in platform.rotation(x, y, functions)]
    arms = (RADIAL @ np.stack(rows).T) * terms.platform_radius
    tip = np.zeros((1, 3, 3), dtype=object)
    tip[..., 0], tip[..., 2] = found.push.T, -found.across.T
    force = np.concatenate(found.force)
    couple = np.concatenate(platform.to_base(x, y, functions, found.moment))
    reactions = in_balance(axes, arms[None], tip, force[None], couple[None])
    return (one, two, three), tuple(reactions.ravel())
