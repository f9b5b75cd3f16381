"""Notes on a mechanism whose numbers look like millimetres, grams or other units than SI.

The limits are far from any body that is built: none of 1343 URDFs of robots is beyond one, and of
234 MJCFs six, whose inertias are those of bodies of kilometres, or lighter than air.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array

#: No mechanism has a longer offset in it, m.
LARGEST = 10.0
#: A body's radius of gyration is at most so many times the longest offset of its mechanism.
WIDEST = 100.0
#: Where no offset is longer, nothing is compared with it, m.
SHORTEST = 1e-6
#: Of all bodies together, as solid ellipsoids of their masses and inertias, kg/m^3.
LIGHTEST, DENSEST = 1e-4, 1e5


def unit_doubts(model: pin.Model) -> tuple[str, ...]:
    """Return a sentence for each quantity that may have been given in another unit.

    Offsets of joints and centres of mass beyond `LARGEST`; a radius of gyration of more than
    `WIDEST` times the longest offset; a density outside `LIGHTEST` to `DENSEST`.
    """
    doubts = []
    placed = list(zip(model.names, model.jointPlacements, model.inertias, strict=True))[1:]
    offsets = {}
    for name, placement, inertia in placed:
        joint, centre = _length(placement.translation), _length(inertia.lever)
        offsets[f"joint {name!r} is at {joint:.4g} m from the one before"] = joint
        if inertia.mass > 0:
            offsets[f"the centre of mass at joint {name!r} is at {centre:.4g} m from it"] = centre
    what = max(offsets, key=lambda one: offsets[one], default="")
    size = offsets.get(what, 0.0)
    if size > LARGEST:
        doubts.append(f"{what}; {size:.4g} mm would be {1e-3 * size:.4g} m")
    gyrations = {name: _gyration(inertia) for name, _, inertia in placed}
    widest = max(gyrations, key=lambda name: gyrations[name], default="")
    if size > SHORTEST and gyrations[widest] > WIDEST * size:
        doubts.append(
            f"the inertia at joint {widest!r} is a radius of gyration of {gyrations[widest]:.4g} "
            f"m, where no offset is above {size:.4g} m; in kg mm^2 it would be "
            f"{1e-3 * gyrations[widest]:.4g} m"
        )
    mass, volume = sum(i.mass for _, _, i in placed), sum(_volume(i) for _, _, i in placed)
    if volume > 0 and not LIGHTEST <= mass / volume <= DENSEST:
        doubts.append(
            f"masses and inertias are those of bodies of {mass / volume:.2g} kg/m^3 (steel has "
            "7850); grams, or kg mm^2, may be taken for kg and kg m^2"
        )
    return tuple(f"{doubt}. Units are SI: m, kg, kg m^2" for doubt in doubts)


def _length(vector: Array) -> float:
    return float(np.linalg.norm(vector))


def _moments(inertia: pin.Inertia) -> Array:
    return np.maximum(np.linalg.eigvalsh(inertia.inertia), 0.0)


def _gyration(inertia: pin.Inertia) -> float:
    """Return the largest radius of gyration about the centre of mass, m."""
    return math.sqrt(_moments(inertia)[2] / inertia.mass) if inertia.mass > 0 else 0.0


def _volume(inertia: pin.Inertia) -> float:
    """Return the volume of the solid ellipsoid of a mass and inertia, m^3.

    Its semi-axes are a_i^2 = 5 (I_j + I_k - I_i) / (2 m).
    """
    if inertia.mass <= 0:
        return 0.0
    moments = _moments(inertia)
    squares = np.maximum(2.5 / inertia.mass * (moments.sum() - 2 * moments), 0.0)
    return float(4 / 3 * np.pi * np.sqrt(squares).prod())
