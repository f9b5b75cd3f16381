"""The offset slider-crank of urdf/slider_crank.urdf: textbook kinematics, d'Alembert, Lagrange.

With crank r at angle q, coupler l and guide at height e (x-z plane, crank's joint at the origin)::

    x = r cos q + sqrt(l^2 - (e - r sin q)^2)
"""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from tests.closed_loop.mechanisms import Bar
from tests.reference import jets
from tests.reference.lagrange import Lagrange, Moving, bar_body
from tests.reference.newton_euler import Jet
from tests.reference.virtual_power import Body, plane_body

Array = NDArray[np.float64]

CRANK = Bar(0.1, 1.2, 0.03, 0.01, 0.008)
COUPLER = Bar(0.35, 0.9, 0.14, -0.015, 0.012)
PISTON_MASS, HEIGHT = 0.6, 0.03


def stroke(q: Jet) -> Jet:
    """The piston's x of the textbook."""
    crank = jets.direction(q.map(lambda x: x[0]))
    x, z = (crank.map(lambda u, i=i: CRANK.length * u[i]) for i in (0, 1))
    rise = z.map(np.negative).shift(HEIGHT)
    square = jets.scaled(rise, rise).map(np.negative).shift(COUPLER.length**2)
    return x + jets.root(square)


def coupler_direction(q: Jet) -> Jet:
    crank = jets.direction(q.map(lambda x: x[0]))
    x = stroke(q)
    piston = Jet(np.array([x.value, HEIGHT]), np.array([x.first, 0]), np.array([x.second, 0]))
    end = crank.map(lambda u: CRANK.length * u)
    return jets.minus(piston, end).map(lambda d: d / COUPLER.length)


def bodies(q: Jet) -> list[Body]:
    crank = jets.direction(q.map(lambda x: x[0]))
    x = stroke(q)
    piston = Jet(
        np.array([x.value, 0, HEIGHT]), np.array([x.first, 0, 0]), np.array([x.second, 0, 0])
    )
    return [
        plane_body(CRANK, jets.constant([0, 0]), crank),
        plane_body(COUPLER, crank.map(lambda u: CRANK.length * u), coupler_direction(q)),
        Body(PISTON_MASS, np.zeros((3, 3)), piston, jets.constant(np.eye(3))),
    ]


def joints(q: Jet) -> dict[str, Jet]:
    """Every joint's value, rate and acceleration; the slider's is the stroke."""
    crank = q.map(lambda x: x[0])
    coupler = jets.angle_of(coupler_direction(q))
    return {
        "crank_joint": crank,
        "coupler_joint": jets.minus(coupler, crank),
        "slider_joint": stroke(q),
        "pin_joint": coupler.map(np.negative),
    }


@cache
def equations() -> Lagrange:
    """In the angles of crank and coupler from the x axis; driven: the first.

    The multiplier is the force (upwards) that the coupler's tip feels from the guide, whose height
    the loop holds it at.
    """
    crank, coupler = q = sp.symbols("crank coupler")
    elbow = CRANK.length * sp.Matrix([sp.cos(crank), sp.sin(crank)])
    tip = elbow + COUPLER.length * sp.Matrix([sp.cos(coupler), sp.sin(coupler)])
    moving = [
        bar_body(CRANK, sp.zeros(2, 1), crank),
        bar_body(COUPLER, elbow, coupler),
        Moving(PISTON_MASS, 0.0, tip, sp.Integer(0)),
    ]
    return Lagrange(q, moving, [tip[1] - HEIGHT])
