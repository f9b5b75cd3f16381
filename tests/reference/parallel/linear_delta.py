"""The linear Delta of urdf/linear_delta.urdf in closed form.

The platform only translates. With b from the foot of rail i to the platform's rim and t the unit
vector along the rail, the carriage at s t and a rod of length L give

    |b - s t|^2 = L^2,   s^2 - 2 (b . t) s + b^2 - L^2 = 0,

of which the carriage above the platform takes the larger root. Directly, the platform's centre is
on three spheres of radius L about the carriages, brought inwards by the platform's radius.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tests.reference import jets
from tests.reference.delta import TURNS, meeting_of_spheres
from tests.reference.newton_euler import Jet
from tests.reference.virtual_power import Body, body

Array = NDArray[np.float64]

RAILS, ROD, PLATFORM = 0.125, 0.215, 0.02
PLATFORM_BODY = (0.136, (0, 0, 0), (6e-05, 6e-05, 0.00011))
CARRIAGE_BODY = (0.172, (0.012, 0.001, 0.004), (8e-05, 4e-05, 7e-05))
ALONG = np.array([0.0, 0.0, 1.0])


def drives(x: Jet) -> Jet:
    """Inverse kinematics: where the carriages are on their rails."""
    found = []
    for turn in TURNS:
        b = x.shift(turn @ [PLATFORM - RAILS, 0, 0])
        middle = b.map(lambda v: v @ ALONG)
        square = jets.minus(jets.scaled(middle, middle), jets.dot(b, b)).shift(ROD**2)
        found.append(middle + jets.root(square))
    return jets.stacked(*found)


def platform_positions(carriages: Array) -> Array:
    """Direct kinematics: both places of the platform, (2, 3)."""
    centres = [
        turn @ [RAILS - PLATFORM, 0, 0] + s * ALONG
        for turn, s in zip(TURNS, carriages, strict=True)
    ]
    return meeting_of_spheres(centres, ROD)


def bodies(x: Jet) -> list[Body]:
    found = [body(*PLATFORM_BODY, x, jets.constant(np.eye(3)))]
    for i, turn in enumerate(TURNS):
        place = drives(x).map(lambda s, i=i: s[i] * ALONG).shift(turn @ [RAILS, 0, 0])
        found.append(body(*CARRIAGE_BODY, place, jets.constant(turn)))
    return found


def joints(x: Jet) -> dict[str, Jet]:
    """Every joint but the platform's."""
    return {f"carriage_{i + 1}_joint": drives(x).map(lambda s, i=i: s[i]) for i in range(3)}


def platform(x: Jet) -> tuple[Jet, Jet]:
    return x, jets.constant(np.eye(3))


def static_forces(x: Array, force: Array) -> Array:
    """Forces of the carriages that bear a force on the platform, without gravity.

    The two rods of a pair are parallel, and transmit a force along themselves.
    """
    carriages = drives(jets.constant(x)).value
    rods = [
        (x + turn @ [PLATFORM - RAILS, 0, 0] - s * ALONG) / ROD
        for turn, s in zip(TURNS, carriages, strict=True)
    ]
    push = np.linalg.solve(np.column_stack(rods), force)
    return np.array([f * (rod @ ALONG) for f, rod in zip(push, rods, strict=True)])
