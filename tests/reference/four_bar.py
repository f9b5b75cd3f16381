"""The four-bar of urdf/four_bar.urdf by Lagrange's equations with multipliers (SymPy).

`tests.closed_loop.mechanisms.FourBar` has its closed forms: circles that intersect, one generalised
inertia. Here the coordinates are the three bars' angles from the x axis, and the knee's two
components close the loop; the multipliers are the force of the rocker on the coupler.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from tests.closed_loop.mechanisms import FourBar
from tests.reference.lagrange import Lagrange, bar_body

#: The sizes and masses of urdf/four_bar.urdf.
FOUR_BAR = FourBar()


@cache
def equations(four_bar: FourBar = FOUR_BAR) -> Lagrange:
    """In the angles of crank, coupler and rocker; driven: the first."""
    crank, coupler, rocker = q = sp.symbols("crank coupler rocker")
    ground = sp.Matrix([four_bar.ground, 0])
    elbow = four_bar.crank.length * _direction(crank)
    knee = elbow + four_bar.coupler.length * _direction(coupler)
    bodies = [
        bar_body(four_bar.crank, sp.zeros(2, 1), crank),
        bar_body(four_bar.coupler, elbow, coupler),
        bar_body(four_bar.rocker, ground, rocker),
    ]
    loop = knee - ground - four_bar.rocker.length * _direction(rocker)
    return Lagrange(q, bodies, list(loop))


def _direction(angle: sp.Symbol) -> sp.Matrix:
    return sp.Matrix([sp.cos(angle), sp.sin(angle)])
