"""The planar 3-RRR of urdf/planar_rrr.urdf in closed form, in the x-y plane.

Inversely, each leg is two bars from its shoulder to its pin of the platform. Directly, with e_i
from pin 1 to pin i in the platform, b_i from elbow 1 to elbow i, l the forearms and w the vector of
forearm 1,

    |w|^2 = l^2,   |w + R e_i - b_i|^2 = l^2,

differ by equations that are linear in w: w follows from the angle, and what is left of the first is
a polynomial of degree six in the tangent of the half angle.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from tests.reference import jets
from tests.reference.newton_euler import Jet
from tests.reference.parallel.legs import part, two_bars
from tests.reference.virtual_power import Body, body

Array = NDArray[np.float64]

BASE, ARM, FOREARM, PLATFORM = 0.3, 0.2, 0.25, 0.1
ARM_BODY = (0.5, (0.09, 0.003, 0), (2.5e-05, 0.001666667, 0.001666667))
FOREARM_BODY = (0.35, (0.1125, 0.003, 0), (1.75e-05, 0.001822917, 0.001822917))
#: About pin 1, which is at x = PLATFORM from the centre.
PLATFORM_BODY = (0.8, (-0.095, 0.004, 0), (0.002, 0.002, 0.004))
YAWS = np.arange(3) * 2 * np.pi / 3
OUT = np.column_stack([np.cos(YAWS), np.sin(YAWS)])


def _plane(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def _spatial(plane: Array) -> Array:
    return np.array([*plane, 0.0])


def _turn(u: Jet) -> Jet:
    """The rotation about z that takes x to u."""
    z = jets.constant([0.0, 0.0, 1.0])
    return jets.frame(u.map(_spatial), jets.turned(u).map(_spatial), z)


def pins(x: Jet) -> list[Jet]:
    """Of the platform, (x, y) each."""
    u = jets.direction(part(x, 2))
    place = part(x, 0, 1)
    return [
        place + u.map(lambda v, o=o: PLATFORM * (o[0] * v + o[1] * np.array([-v[1], v[0]])))
        for o in OUT
    ]


def legs(x: Jet) -> list[tuple[Jet, Jet]]:
    """Directions of each arm and forearm in the plane."""
    found = []
    for pin, out in zip(pins(x), OUT, strict=True):
        found.append(two_bars(pin.shift(-BASE * out), ARM, FOREARM, -1))
    return found


def joints(x: Jet) -> dict[str, Jet]:
    found = {}
    for i, ((arm, forearm), out) in enumerate(zip(legs(x), OUT, strict=True), start=1):
        found[f"arm_{i}_joint"] = jets.relative(jets.constant(out), arm)
        found[f"forearm_{i}_joint"] = jets.relative(arm, forearm)
    first = legs(x)[0][1]
    found["platform_joint"] = jets.relative(first, jets.direction(part(x, 2)))
    return found


def drives(x: Jet) -> Jet:
    """Inverse kinematics: the arms' angles from the outward directions."""
    return jets.stacked(*(joints(x)[f"arm_{i}_joint"] for i in (1, 2, 3)))


def platform(x: Jet) -> tuple[Jet, Jet]:
    return part(x, 0, 1).map(_spatial), _turn(jets.direction(part(x, 2)))


def bodies(x: Jet) -> list[Body]:
    found = [body(*PLATFORM_BODY, pins(x)[0].map(_spatial), platform(x)[1])]
    for (arm, forearm), out in zip(legs(x), OUT, strict=True):
        shoulder = jets.constant(_spatial(BASE * out))
        elbow = shoulder + arm.map(lambda u: ARM * _spatial(u))
        found.append(body(*ARM_BODY, shoulder, _turn(arm)))
        found.append(body(*FOREARM_BODY, elbow, _turn(forearm)))
    return found


def static_torques(x: Array, wrench: Array) -> Array:
    """Torques that bear a force (x, y) and a moment at the platform's centre.

    A forearm transmits a force along itself, whose moment about the shoulder is the torque.
    """
    at = jets.constant(x)
    both = [(arm.value, forearm.value) for arm, forearm in legs(at)]
    levers = [pin.value - x[:2] for pin in pins(at)]
    columns = [[*f, b[0] * f[1] - b[1] * f[0]] for (_, f), b in zip(both, levers, strict=True)]
    push = np.linalg.solve(np.array(columns).T, wrench)
    moments = [ARM * (u[0] * f[1] - u[1] * f[0]) for u, f in both]
    return push * moments


def poses(arms: Array) -> Array:
    """Direct kinematics: all poses (k, 3) with given angles of the arms, but a half turn."""
    elbows = [BASE * out + ARM * _plane(angle) @ out for out, angle in zip(OUT, arms, strict=True)]
    t = Polynomial([0.0, 1.0])
    one, cosine, sine = 1 + t**2, 1 - t**2, 2 * t  # times 1 + t^2
    rows, right = [], []
    for i in (1, 2):
        e, b = PLATFORM * (OUT[i] - OUT[0]), elbows[i] - elbows[0]
        d = (cosine * e[0] - sine * e[1] - one * b[0], sine * e[0] + cosine * e[1] - one * b[1])
        turned = cosine * (e @ b) + sine * (e[0] * b[1] - e[1] * b[0])  # b . R e
        rows.append(d)
        right.append(-0.5 * ((e @ e + b @ b) * one - 2 * turned))  # w . d = -d^2 / 2
    determinant = rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0]
    w = (
        right[0] * rows[1][1] - right[1] * rows[0][1],
        right[1] * rows[0][0] - right[0] * rows[1][0],
    )
    whole = w[0] ** 2 + w[1] ** 2 - (FOREARM * determinant) ** 2
    sextic = whole // one
    found = []
    for root in sextic.roots():
        if abs(root.imag) < 1e-8 and abs(determinant(root.real)) > 1e-9:
            angle = 2 * np.arctan(root.real)
            along = np.array([w[0](root.real), w[1](root.real)]) / determinant(root.real)
            centre = elbows[0] + along - PLATFORM * _plane(angle) @ OUT[0]
            found.append([*centre, angle])
    return np.array(found)
