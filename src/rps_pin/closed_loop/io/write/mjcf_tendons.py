"""Slides that stand for fixed tendons, as the reader of MuJoCo's files makes them.

A slide on the world without mass, that one linear coupling ties to other joints and on which
nothing else hangs, is a sum of their coordinates. MuJoCo moves no body without mass, but has such
sums as fixed tendons, with springs, dampers, friction, armature, limits and motors.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import pinocchio as pin

from rps_pin.closed_loop.constraints.closures import JointCoupling
from rps_pin.closed_loop.io.write.mjcf_bodies import is_massless
from rps_pin.closed_loop.io.write.source import Source, kind_of


def tendons_of(source: Source, held: Collection[int]) -> dict[int, JointCoupling]:
    """Return the couplings of slides that stand for fixed tendons, by the slides' indices.

    Parameters
    ----------
    source
        The mechanism, without rows.
    held
        Joints whose bodies closures hold.
    """
    model = source.model
    couplings = [one for one in source.closures if isinstance(one, JointCoupling)]
    ties: dict[str, list[JointCoupling]] = {}
    for coupling in couplings:
        for name in (coupling.joint, *coupling.others):
            ties.setdefault(name, []).append(coupling)
    found: dict[int, JointCoupling] = {}
    for joint in range(1, model.njoints):
        own = ties.get(model.names[joint], [])
        if len(own) == 1 and joint not in held and _is_length(model, joint):
            coupling = own[0]
            linear = all(not any(terms[1:]) for terms in coupling.terms)
            if coupling.joint == model.names[joint] and coupling.others and linear:
                found[joint] = coupling
    return found


def _is_length(model: pin.Model, joint: int) -> bool:
    """Return whether a joint is a slide on the world that carries nothing."""
    return (
        model.parents[joint] == 0
        and kind_of(model.joints[joint]) == "prismatic"
        and is_massless(model.inertias[joint])
        and not np.any(np.array(list(model.parents)[1:]) == joint)
    )
