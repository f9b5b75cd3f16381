"""By how much candidates fail requirements, each in a unit of its own; and how near they come.

================ ==========================================================================
requirement      a candidate fails it by
================ ==========================================================================
``reach``        the share of the region's points that it does not reach, and more where the
                 way to the region's middle is not possible
``singularity``  the share of the points reached that are singular or beyond a singularity
``conditioning`` the share of the least conditioning that is missing
``limits``       the room that is missing to the limit that is nearest, in shares of its range
``motions``      the share of the motions' samples that it does not reach
``force``        the largest force's excess over its limit, as a share of the limit
``speed``        the same of the speeds
``stiffness``    the share of the least stiffness that is missing
``clearance``    the clearance of two rods that is missing, in characteristic lengths
================ ==========================================================================

A requirement that could not be measured, as nothing was reached, is failed by 1.
"""

from __future__ import annotations

import numpy as np

from rps_pin.arrays import Array
from rps_pin.task.design.measures import Measures
from rps_pin.task.design.requirements import Requirements

#: Requirements that are met or not: there is no room to them.
WITHOUT_ROOM = ("reach", "singularity", "motions")
_SLACK = 1e-12


def violations(measures: Measures, requirements: Requirements, length: float) -> dict[str, Array]:
    """Return by how much candidates fail each requirement, (n,); at most 0 where they meet it.

    `length` is the characteristic length of the file's robot, m.
    """
    found = {
        "reach": measures.unreached,
        "singularity": measures.beyond,
        "limits": requirements.limit_margin - measures.room - _SLACK,
    }
    if requirements.min_conditioning > 0:
        found["conditioning"] = 1.0 - measures.conditioning / requirements.min_conditioning
    if requirements.motions:
        found["motions"] = measures.off
        found["force"] = measures.force_share - 1.0
        found["speed"] = measures.speed_share - 1.0
    if requirements.min_stiffness is not None:
        found["stiffness"] = 1.0 - measures.stiffness / requirements.min_stiffness
    if requirements.rods:
        found["clearance"] = ((requirements.min_clearance or 0.0) - measures.clearance) / length
    return {name: np.where(np.isnan(value), 1.0, value) for name, value in found.items()}


def contradictions(found: dict[str, Array]) -> list[tuple[str, str]]:
    """Return pairs of requirements that candidates meet one by one, and none meets together."""
    met = {name: value <= 0 for name, value in found.items()}
    names = [name for name, each in met.items() if each.any()]
    return [
        (one, other)
        for k, one in enumerate(names)
        for other in names[k + 1 :]
        if not (met[one] & met[other]).any()
    ]
