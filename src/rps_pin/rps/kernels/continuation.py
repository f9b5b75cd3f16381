"""An assembly mode followed while the leg lengths change: steps of the Newton-Kantorovich theorem.

The leg angles are followed from known lengths to those wanted, on the straight line between them.
With the Jacobian J of Eq. 8 at the angles so far and at the lengths of the step's end,

    beta = |J^-1|,  eta = |J^-1 f|,  L >= |f''|,     beta L eta <= 1/2  (here 1/4)

there is exactly one solution within 2 eta, J is regular all the way to it, and Newton's method
finds it. Where the bound does not hold the step is shortened. Within a step the first inverse of J
serves twice, for a Newton and a chord step, both of which the theorem covers; what is then left is
of third order, and one more Newton step reaches rounding error. At a parallel singularity beta
grows without bound and the steps shrink to nothing.
"""

from __future__ import annotations

import math

from rps_pin.numerics.elementary import (
    Number,
    always,
    both,
    clamp,
    less,
    never,
    select,
    select_all,
)
from rps_pin.rps.kernels import leg_equations as eq
from rps_pin.rps.kernels.leg_equations import Matrix
from rps_pin.rps.kernels.placement import Direction
from rps_pin.rps.kernels.tips import Ring, Three

#: Half a Newton step in each angle, determinant, condition, beta L eta, adjugate, -1/2 over det.
Step = tuple[Ring, Number, Number, Number, Matrix, Number]
#: Part of the line gone, length of the next step in parts, condition number of J.
Progress = tuple[Number, Number, Number]

#: Largest beta L eta of a step: half of what the theorem asks for.
TRUST = 0.25
#: Half a Newton step, rad, after which another would only move rounding errors; and in single
#: precision.
_LAST_STEP, LAST_STEP_SINGLE = 1e-9, 1e-5
#: Newton steps after which one that has not converged is given up.
MOST_NEWTON = 12
_SINGULAR = 1e-300


def newton_step(d: Three, direction: Direction, g: Number, h: Number) -> Step:
    """Return half a Newton step of Eq. 8 in each angle, rad, and the numbers that judge it."""
    t, det, condition, singular, beta, adjugate, half = _newton(d, direction, g, h)
    kantorovich = beta * 2.0 * eq.largest(t) * eq.curvature_bound(d, g)
    return t, det, condition, select(singular, math.inf, kantorovich), adjugate, half


def _newton(
    d: Three, direction: Direction, g: Number, h: Number
) -> tuple[Ring, Number, Number, Number, Number, Matrix, Number]:
    """Return half a Newton step, determinant, condition, whether J is singular, |J^-1|, and so on.

    Then the adjugate, and -1/2 over the determinant.
    """
    c1, c2, c3, s1, s2, s3 = direction
    w, z = (d[0] * c1, d[1] * c2, d[2] * c3), (d[0] * s1, d[1] * s2, d[2] * s3)
    f = eq.residuals(w, z, g, eq.constants(d, g, h))
    by_angle = eq.slopes(w, z, g)
    det = eq.determinant(by_angle)
    singular = less(abs(det), _SINGULAR)
    half = -0.5 / select(singular, 1.0, det)
    adjugate = eq.adjugate(by_angle)
    beta = 2.0 * abs(half) * eq.matrix_norm(adjugate)
    condition = select(singular, math.inf, eq.jacobian_norm(by_angle) * beta)
    return eq.matrix_times(adjugate, f, half), det, condition, singular, beta, adjugate, half


def chord_step(
    d: Three, direction: Direction, g: Number, h: Number, adjugate: Matrix, half: Number
) -> Ring:
    """Return half a step of Eq. 8 in each angle, by the inverse Jacobian of before."""
    c1, c2, c3, s1, s2, s3 = direction
    w, z = (d[0] * c1, d[1] * c2, d[2] * c3), (d[0] * s1, d[1] * s2, d[2] * s3)
    return eq.matrix_times(adjugate, eq.residuals(w, z, g, eq.constants(d, g, h)), half)


def turned_legs(direction: Direction, t: Ring) -> Direction:
    """Return the legs' directions turned by 2 atan(t) each."""
    c1, c2, c3, s1, s2, s3 = direction
    c1, s1 = eq.turned(c1, s1, t[0])
    c2, s2 = eq.turned(c2, s2, t[1])
    c3, s3 = eq.turned(c3, s3, t[2])
    return c1, c2, c3, s1, s2, s3


def unit_directions(direction: Direction) -> Direction:
    """Return the legs' directions at length one: the errors of millions of turns would add up."""
    c1, c2, c3, s1, s2, s3 = direction
    c1, s1 = eq.unit_length(c1, s1)
    c2, s2 = eq.unit_length(c2, s2)
    c3, s3 = eq.unit_length(c3, s3)
    return c1, c2, c3, s1, s2, s3


def newton_and_chord(d: Three, direction: Direction, g: Number, h: Number, step: Step) -> Direction:
    """Return the legs' directions after a Newton step and a chord step by the same inverse."""
    t, _, _, _, adjugate, half = step
    at = turned_legs(direction, t)
    if always(less(eq.largest(t), _LAST_STEP)):
        return at
    return turned_legs(at, chord_step(d, at, g, h, adjugate, half))


def refined(
    d: Three,
    at: Direction,
    g: Number,
    h: Number,
    limit: Number,
    det: Number,
    last_step: float = _LAST_STEP,
) -> tuple[Direction, Number, Number, Number]:
    """Return directions after a Newton step, condition, whether it was the last, and was good.

    `det` is the determinant at the line's step's beginning, whose sign must not change.
    """
    t, det_there, there, _, _, _, _ = _newton(d, at, g, h)
    # The remaining error is the step's square: below rounding.
    last = less(eq.largest(t), last_step)
    good = both(there <= limit, less(0.0, det * det_there))
    return turned_legs(at, t), there, last, good


def solve_step(
    d: Three, direction: Direction, g: Number, h: Number, limit: Number
) -> tuple[Number, Direction, Number, Number]:
    """Return whether lengths are solved, directions, condition, and beta L eta at the beginning."""
    step = newton_step(d, direction, g, h)
    _, det, condition, kantorovich, _, _ = step
    trusted = to_be_trusted(condition, kantorovich, limit)
    if never(trusted):
        return trusted, direction, condition, kantorovich
    at = newton_and_chord(d, direction, g, h, step)
    for _ in range(MOST_NEWTON):
        at, condition, last, good = refined(d, at, g, h, limit, det)
        if always(select(trusted, last, True)):
            break
    return both(trusted, both(last, good)), at, condition, kantorovich


def to_be_trusted(condition: Number, kantorovich: Number, limit: Number) -> Number:
    """Return whether the theorem holds at a step's beginning, far enough from singularities."""
    return both(kantorovich <= TRUST, condition <= limit)


def step_end(
    begin: Three, goal: Three, progress: Progress
) -> tuple[Number, tuple[Number, Number, Number]]:
    """Return the part of the line gone at the end of the next step, and the lengths there."""
    (b1, b2, b3), (e1, e2, e3), (done, share, _) = begin, goal, progress
    to = select(less(done + share, 1.0), done + share, 1.0)
    back = 1.0 - to  # exactly the goal at its end
    return to, (e1 + back * (b1 - e1), e2 + back * (b2 - e2), e3 + back * (b3 - e3))


def after_step(
    direction: Direction,
    progress: Progress,
    to: Number,
    step: tuple[Number, Direction, Number, Number],
) -> tuple[Direction, Progress]:
    """Return directions and progress after a step, of `solve_step`, to a part of the line."""
    solved, at, there, kantorovich = step
    done, share, condition = progress
    ratio = 0.8 * TRUST / clamp(kantorovich, 1e-9, math.inf)
    factor = clamp(ratio, select(solved, 0.5, 0.02), select(solved, 4.0, 0.5))
    return select_all(solved, unit_directions(at), direction), (
        select(solved, to, done),
        share * factor,
        select(solved, there, condition),
    )


def follow_legs(
    begin: Three,
    direction: Direction,
    goal: Three,
    radii: tuple[Number, Number],
    limit: Number,
    progress: Progress,
    most: int,
) -> tuple[Direction, Progress]:
    """Follow leg lengths on the straight line from known ones, in at most so many steps.

    Parameters
    ----------
    begin, goal
        Lengths at both ends of the line, m.
    direction
        Of the legs at the lengths reached so far: they satisfy Eq. 8.
    radii
        The paper's g and h, m.
    limit
        Largest condition number that is followed through.
    progress
        (0, 1, infinity) at the beginning.
    most
        Largest number of steps, those that had to be shortened among them.
    """
    g, h = radii
    for _ in range(most):
        to, d = step_end(begin, goal, progress)
        step = solve_step(d, direction, g, h, limit)
        direction, progress = after_step(direction, progress, to, step)
        if always(progress[0] == 1.0):
            break
    return direction, progress
