"""All modes of a platform on three balls, each at the tip of a leg that turns about one hinge.

Such are the 3-RPS and the 3-RRS with their actuators' values. Tip i is on a circle,

    t_i = c_i + (g_i w + g_i* / w),   w = exp(i angle),   g = (e - i h) / 2,

e and h its radii at angles 0 and 90 degrees. Between two tips is a side of the platform,

    |t_i - t_j|^2 = L^2,

of degree two in each w once multiplied by both: 16 solutions at most (`biquadratic`), as many as
Nanua, Waldron and Murthy count (Direct kinematic solution of a Stewart platform, 1990). Three tips
give the platform's pose.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools, ComplexArray
from rps_pin.closed_loop.assembly.every.chains import Chains
from rps_pin.closed_loop.assembly.every.solutions import NoFormulationError, Solutions
from rps_pin.closed_loop.constraints.closures import LoopClosure
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.numerics.homotopy.biquadratic import PATHS, biquadratic_solutions
from rps_pin.numerics.homotopy.krawczyk import all_distinct
from rps_pin.numerics.homotopy.quadrics import proven_solutions
from rps_pin.numerics.intervals import Interval

#: p or q, relative to the other, below which w is infinite or zero.
_INFINITE = 1e-8
_PAIRS = ((0, 1), (1, 2), (2, 0))


class _Tips(NamedTuple):
    """Three tips on circles, and the platform's points that they meet, in its joint's axes."""

    chains: Chains
    circles: Array
    """Rows e, h and c of each, so that t = cos e + sin h + c, shape (3, 3, 3), in units."""
    platform: Array
    """Shape (3, 3), in units."""
    hinges: list[int]
    """Indices of their velocities."""
    unit: float
    """Of lengths, m."""


def three_tip_solutions(system: ConstraintSystem, held: Bools, about: Array) -> Solutions:
    """Return all solutions of a platform on three tips of legs with one hinge each.

    Raises
    ------
    NoFormulationError
        If the mechanism is no such platform; says why.
    """
    found = _tips(system, held, about)
    forms = np.array([_form(found, i, j) for i, j in _PAIRS])
    forms /= np.abs(forms).max(axis=(1, 2), keepdims=True)
    x, ends = biquadratic_solutions(forms)
    size = np.abs(x)
    finite = ends.regular & (size.min(axis=2) > _INFINITE * size.max(axis=2)).all(axis=1)
    w = x[finite, :, 0] / x[finite, :, 1]
    # With w, 1 / w* is a solution too: it is real, of size one, where that is itself.
    apart = np.abs((1 / w.conj())[:, None] - w[None]).max(axis=2, initial=0.0)
    real = w[np.argmin(apart, axis=1) == np.arange(len(w))] if len(w) else w
    real = real / np.abs(real)
    solved = ~held
    regular = int(np.count_nonzero(finite))
    known = f"{PATHS} is the Bezout number of three tips on circles"
    return Solutions(
        np.array([_configuration(system, found, about, one) for one in real]).reshape(
            len(real), system.model.nq
        ),
        solved,
        _certified(found, real),
        regular,
        PATHS,
        PATHS - regular,
        f"{known}: all are found"
        if regular == PATHS
        else f"{known}; the paths lead to all regular ones, with probability one",
    )


def _tips(system: ConstraintSystem, held: Bools, about: Array) -> _Tips:
    chains = Chains(system, held, about)
    circles, platform, hinges = [], [], []
    unit = system.equations.length
    for closure in system.equations.closures:
        if not isinstance(closure, LoopClosure) or closure.kind != "spherical":
            raise NoFormulationError("a closure is not of kind 'spherical'")
        fixed, chain, moved, other = chains.between(closure)
        if len(chain) != 1 or other:
            raise NoFormulationError(f"the leg of {closure.name!r} turns about not one hinge")
        axis, tip, origin = chains.hinge(chain[0]), chains.world(fixed), chains.origin(chain[0])
        centre = origin + ((tip - origin) @ axis) * axis
        e = tip - centre
        circles.append(np.array([e, np.cross(axis, e), centre]) / unit)
        platform.append(chains.on_platform(chains.world(moved)) / unit)
        hinges.append(chains.model.joints[chain[0]].idx_v)
    if len(circles) != 3:
        raise NoFormulationError(f"it has {len(circles)} tips, not three")
    chains.refuse_others()
    return _Tips(chains, np.array(circles), np.array(platform), hinges, unit)


def _form(found: _Tips, i: int, j: int) -> ComplexArray:
    """Return M of the side between two tips: of (1, w, 1/w) of both."""
    to_powers = np.array([[0, 0.5, 0.5], [0, -0.5j, 0.5j], [1, 0, 0]])  # of cos, sin, 1
    one, two = (found.circles[k].T @ to_powers for k in (i, j))
    form = -2 * one.T @ two
    for side, rows in ((0, one), (1, two)):
        c, g = rows[:, 0], rows[:, 1]
        row = np.array([c @ c + 2 * g @ rows[:, 2], 2 * c @ g, 2 * c @ rows[:, 2]])
        form[(slice(None), 0) if side == 0 else (0, slice(None))] += row
    form[0, 0] -= np.sum((found.platform[i] - found.platform[j]) ** 2)
    return np.asarray(form)


def _configuration(system: ConstraintSystem, found: _Tips, about: Array, w: ComplexArray) -> Array:
    """Return the configuration with tips at angles, shape (nq,)."""
    velocity = np.zeros(system.model.nv)
    velocity[found.hinges] = np.angle(w)
    q = np.asarray(pin.integrate(system.model, about, velocity))
    parts = np.stack([w.real, w.imag, np.ones(3)], axis=1)
    tips = np.einsum("ij,ijk->ik", parts, found.circles)
    turn = _axes(tips) @ _axes(found.platform).T
    position = tips.mean(axis=0) - turn @ found.platform.mean(axis=0)
    return found.chains.placed(q, turn, found.unit * position)


def _axes(points: Array) -> Array:
    """Return axes that three points determine, as columns."""
    x = points[1] - points[0]
    z = np.cross(x, points[2] - points[0])
    x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
    return np.array([x, np.cross(z, x), z]).T


def _certified(found: _Tips, real: ComplexArray) -> Bools:
    """Return which real solutions are proven, and no two of them the same.

    By the cosines and sines v = (c_1, s_1, ..., 1): three circles, three sides.
    """
    circles = np.zeros((3, 7, 7))
    for k in range(3):
        circles[k, [2 * k, 2 * k + 1, 6], [2 * k, 2 * k + 1, 6]] = 1.0, 1.0, -1.0
    sides = []
    for i, j in _PAIRS:
        apart = Interval(np.zeros((3, 7)))
        for k, sign in ((i, 1.0), (j, -1.0)):
            part = np.zeros((3, 7))
            part[:, [2 * k, 2 * k + 1, 6]] = sign * found.circles[k].T
            apart = apart + Interval(part)
        form = Interval(np.zeros((7, 7)))
        side = Interval(found.platform[i]) - Interval(found.platform[j])
        corner = np.zeros((7, 7))
        corner[6, 6] = 1.0
        for axis in range(3):
            form = form + apart[axis][:, None] * apart[axis][None]
            form = form - side[axis].square() * corner
        sides.append(form)
    lower = np.concatenate([circles, [one.lower for one in sides]])
    upper = np.concatenate([circles, [one.upper for one in sides]])
    v = np.ones((len(real), 7))
    v[:, 0:6:2], v[:, 1:6:2] = real.real, real.imag
    return all_distinct(proven_solutions(Interval(lower, upper), np.eye(7)[6], v))
