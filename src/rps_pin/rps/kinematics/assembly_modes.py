"""Assembly modes of the 3-RPS for given leg lengths: all real solutions of Eq. 8.

With the tips written as in `rps_pin.rps.kinematics.leg_equations`, leg 1's angle makes f_12 = 0 and
f_31 = 0 straight lines in the planes of legs 2 and 3, both with the normal (m_1, 2 z_1),

    m_1 w_j + 2 z_1 z_j = e_j,     e_2 = 3 g m_1 + k_12,  e_3 = 3 g m_1 + k_31,

which meet the circles of the tips, w_j^2 + z_j^2 = d_j^2, in two points each. With N = m_1^2 +
4 z_1^2, r = +-sqrt(d_2^2 N - e_2^2) and q = +-sqrt(d_3^2 N - e_3^2),

    N m_j = 3 g N - m_1 e_j + 2 z_1 (r or q),     N z_j = 2 z_1 e_j + m_1 (r or q),
    N^2 f_23 = alpha + beta r + gamma q + delta r q.

The product of f_23 over the four signs, times N^4, has no roots in it: it is the eliminant, a
polynomial of degree 8 in x = cos(phi_1), whose 8 zeros are the 8 mirrored pairs of solutions. It is
interpolated at Chebyshev points, and its zeros are the eigenvalues of its colleague matrix. All
that is close to a real solution is then polished on Eq. 8 itself, where rounding in the elimination
is forgotten, and what comes out twice is counted once.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.errors import InputError
from rps_pin.rps.kernels import leg_equations as eq
from rps_pin.rps.kinematics import leg_equations as equations

#: The triple each candidate belongs to, (m,), and its tips w and z, (3, m) each.
Candidates = tuple[Indices, Array, Array]

#: Eq. 8 has no more real solutions than this.
MOST_MODES = 16

#: Triples worked on at a time.
_BLOCK = 1024
_DEGREE = 8
#: How close to real, and to the interval [-1, 1], an eigenvalue must be to be tried: generous,
#: since a fourfold zero has an error of the fourth root of rounding.
_NEARLY_REAL = 3e-3
#: Where zeros are closer together than this, or no leg's |3 g - d|/(3 g + d) reaches that, every
#: leg's eliminant is solved: what one cannot resolve another can.
_CROWDED, _UNFIT = 3e-3, 0.1
_TURN = np.arange(3)
#: Largest |f_23| over 3 h^2 with which a pair of points on the circles is tried.
_NEARLY_CLOSED = 1e-2
#: Solutions this close, in the tips' directions, are one; singular ones are less sharp.
_SAME, _SAME_DOUBLE = 1e-8, 1e-5
#: Below this determinant (see `leg_equations.determinant`) a solution counts as double: another one
#: within about as many radians would close the robot to the same tolerance.
DOUBLE_BELOW = 1e-6
#: Below this determinant a solution's twin, across the singularity, is looked for.
_FOLD_BELOW = 0.1


class AssemblyModes(NamedTuple):
    """All real solutions of Eq. 8, from the highest platform to the lowest.

    For one triple of lengths (3,) there are k solutions, and no padding. For a batch (..., 3) the
    k below is `MOST_MODES` = 16, solutions come first, and entries where `exists` is false are
    padding: NaN, false and -1.
    """

    angle: Array
    """Leg angles phi, shape (..., k, 3), rad, in (-pi, pi]."""
    position: Array
    """Platform centre, shape (..., k, 3), m, base axes."""
    rotation: Array
    """From platform axes to base axes, shape (..., k, 3, 3)."""
    pose: Array
    """``(z, tilt_x, tilt_y)``, shape (..., k, 3), m and rad; NaN where `has_pose` is false."""
    has_pose: Bools
    """Whether the platform is turned about an axis in the base plane, shape (..., k). The others
    are of the other operation mode: half turns about axes outside that plane."""
    above: Bools
    """Whether the platform's centre is above the base, shape (..., k)."""
    mirror: Indices
    """Index of the solution mirrored in the base plane, shape (..., k); its own if it lies flat."""
    double: Bools
    """Whether solutions coincide here, to what rounding lets one tell, shape (..., k): a parallel
    singularity. Such a solution is listed once; a slight change of the lengths makes it two, or
    none."""
    determinant: Array
    """Distance to singularity, shape (..., k): see `leg_equations.determinant`."""
    residual: Array
    """Largest error of a tip distance, shape (..., k), m."""
    exists: Bools
    """False where an entry is padding, shape (..., k)."""


def assembly_modes(length: ArrayLike, base_radius: float, platform_radius: float) -> AssemblyModes:
    """Return the assembly modes of given leg lengths: all real solutions of Eq. 8.

    Parameters
    ----------
    length
        Leg lengths d, shape (..., 3), m.
    base_radius, platform_radius
        The paper's g and h, m.

    Returns
    -------
    AssemblyModes
        None (k = 0, or `exists` false everywhere) if the lengths cannot close. Every tip distance
        is right to 2.5e-13 of g + h, or of the longest leg if that is longer. No limit of a robot
        is applied.

    Raises
    ------
    InputError
        If the lengths have the wrong shape, a number is not finite and positive, or a leg is longer
        than 100 (g + h): there rounding would hide solutions.
    """
    lengths = equations.checked_lengths(length)
    g, h = equations.checked_radii(base_radius, platform_radius)
    if lengths.max(initial=0.0) > longest_leg(g, h):
        raise InputError(
            f"a leg is {lengths.max():.6g} m long; all solutions can be found up to "
            f"{longest_leg(g, h):.6g} m, 100 times base_radius + platform_radius"
        )
    flat = lengths.reshape(-1, 3)
    angle = np.full((len(flat), MOST_MODES, 3), np.nan)
    mirror = np.full((len(flat), MOST_MODES), -1, dtype=np.intp)
    for begin in range(0, len(flat), _BLOCK):
        part = slice(begin, begin + _BLOCK)
        angle[part], mirror[part] = _solutions(flat[part], g, h)
    modes = _described(flat, angle, mirror, g, h)
    if lengths.ndim == 1:
        fields: list[Any] = [field[0][modes.exists[0]] for field in modes]
    else:
        fields = [field.reshape(*lengths.shape[:-1], *field.shape[1:]) for field in modes]
    return AssemblyModes(*fields)


def longest_leg(base_radius: float, platform_radius: float) -> float:
    """Return the length up to which all solutions are found, m."""
    return 100 * (base_radius + platform_radius)


def eliminant(length: Array, cosine: Array, base_radius: float, platform_radius: float) -> Array:
    """Return the eliminant of Eq. 8, of degree 8 in x = cos(phi_1), at given x; m^16.

    Parameters
    ----------
    length
        Leg lengths, shape (..., 3), m.
    cosine
        The x, between -1 and 1, shape (...).
    base_radius, platform_radius
        The paper's g and h, m.
    """
    lines = _lines(np.moveaxis(length, -1, 0), cosine, base_radius, platform_radius)
    _, _, n, _, _, r2, q2, a, b, c, d = lines
    # (alpha + beta r)^2 - q^2 (gamma + delta r)^2 = A + B r; times itself at -r.
    even = a * a + b * b * r2 - q2 * (c * c + d * d * r2)
    odd = 2 * (a * b - q2 * c * d)
    value: Array = (even * even - r2 * odd * odd) / n**4
    return value


# From lengths to polished solutions ---------------------------------------------------------------


def _lines(d: Array, x: Array, g: float, h: float) -> tuple[Array, ...]:
    """Return the equations of legs 2 and 3 for an angle of leg 1; see the module's docstring.

    m_1, z_1, N, e_2, e_3, r^2, q^2, alpha, beta, gamma, delta.
    """
    k12, k23, k31 = eq.constants(d, g, h)
    m1, z1 = 3 * g - d[0] * x, d[0] * np.sqrt((1 - x) * (1 + x))
    e2, e3 = 3 * g * m1 + k12, 3 * g * m1 + k31
    n = m1 * m1 + 4 * z1 * z1
    r2, q2 = d[1] ** 2 * n - e2 * e2, d[2] ** 2 * n - e3 * e3
    alpha = (3 * g * n - e2 * m1) * (3 * g * n - e3 * m1) - 8 * z1 * z1 * e2 * e3 + k23 * n * n
    beta, gamma = 6 * z1 * (g * n - m1 * e3), 6 * z1 * (g * n - m1 * e2)
    return m1, z1, n, e2, e3, r2, q2, alpha, beta, gamma, 4 * z1 * z1 - 2 * m1 * m1


def _solutions(length: Array, g: float, h: float) -> tuple[Array, Indices]:
    """Return angles (n, 16, 3), padded with NaN, and mirror indices (n, 16) of n triples."""
    # Leg 1's part can be any leg's: that one's is best whose N stays farthest from zero.
    fitness = np.abs(3 * g - length) / (3 * g + length)
    best = np.argmax(fitness, axis=1)
    every = np.arange(len(length))
    x, crowded = _zeros(length[every[:, None], (best[:, None] + _TURN) % 3], g, h)
    hard = np.flatnonzero(crowded | (fitness[every, best] < _UNFIT))
    tries = [_from_leg(every, best, length, x, g, h)]
    for other in (1, 2):
        leg = (best[hard] + other) % 3
        x, _ = _zeros(length[hard[:, None], (leg[:, None] + _TURN) % 3], g, h)
        tries.append(_from_leg(hard, leg, length, x, g, h))
    owner, w, z = _polished(length, *_joined(tries), g, h)
    twin = _twins(length, owner, w, z, g, h)
    more = _polished(length, *twin, g, h)
    flat = _flat(length, g, h)
    found = _joined([(owner, w, z), more, flat])
    return _arranged(length, *_distinct(length, *found, g, h), g + h)


def _from_leg(
    which: Indices, leg: Indices, length: Array, x: Array, g: float, h: float
) -> Candidates:
    """Return the candidates of some triples from one leg's cosines x, that leg's own for each."""
    order = (leg[:, None] + _TURN) % 3
    item, w, z = _candidates(length[which[:, None], order], x, g, h)
    w_legs, z_legs = np.empty_like(w), np.empty_like(z)
    column = np.arange(len(item))
    for turned in range(3):
        w_legs[order[item, turned], column] = w[turned]
        z_legs[order[item, turned], column] = z[turned]
    return which[item], w_legs, z_legs


def _joined(parts: list[Candidates]) -> Candidates:
    owner = np.concatenate([part[0] for part in parts])
    w, z = (np.concatenate([part[i] for part in parts], axis=1) for i in (1, 2))
    return owner, w, z


def _zeros(length: Array, g: float, h: float) -> tuple[Array, Bools]:
    """Return the eliminant's zeros that may be real, (n, 8), and whether any two are close, (n,).

    As x = cos(phi_1); NaN for the rest.
    """
    low, high = _interval(length[:, 0], g, h)
    middle, half = (low + high) / 2, (high - low) / 2
    values = eliminant(length, middle + half * _NODES[:, None], g, h)
    series = _TO_SERIES @ values  # (3 shifts, 9, n)
    size = np.abs(series).max(axis=1)
    series /= np.where(size > 0, size, 1.0)[:, None]
    share = np.abs(series[:, -1])
    share[0] *= _PREFER_PLAIN
    choice = np.argmax(share, axis=0)
    chosen = series[choice, :, np.arange(len(length))]
    lead = chosen[:, -1]
    chosen[:, -1] = np.where(np.abs(lead) < 1e-12, 1e-12, lead)
    y = np.linalg.eigvals(_colleague(chosen))
    likely = (np.abs(y.imag) < _NEARLY_REAL) & (np.abs(y.real) < 1 + _NEARLY_REAL)
    a = _SHIFTS[choice, None]
    t = np.where(likely, np.clip((y.real + a) / (1 + a * y.real), -1.0, 1.0), np.nan)
    with np.errstate(invalid="ignore"):  # NaN - NaN
        crowded: Bools = np.any(np.diff(np.sort(t, axis=1), axis=1) < _CROWDED, axis=1)
    return middle[:, None] + half[:, None] * t, crowded


def _interval(d: Array, g: float, h: float) -> tuple[Array, Array]:
    """Return between which x = cos(phi_1) a leg of length d can close: most of [-1, 1], or little.

    The tips of the other two legs are in planes at 120 degrees to this one's: a tip at rho is at
    least |rho| sin(60 degrees) from them, and at most sqrt(3) h. So |rho| <= 2 h, d x = g - rho.
    """
    low, high = np.maximum((g - 2 * h) / d, -1.0), np.minimum((g + 2 * h) / d, 1.0)
    return np.minimum(low, 1.0), high


def _candidates(length: Array, x: Array, g: float, h: float) -> Candidates:
    """Return what the first leg's cosines x, (n, 8), make of the other legs."""
    owner, column = np.nonzero(~np.isnan(x))
    d, cosine = length[owner].T, x[owner, column]
    m1, z1, n, e2, e3, r2, q2, alpha, beta, gamma, delta = _lines(d, cosine, g, h)
    r, q = np.sqrt(np.maximum(r2, 0.0)), np.sqrt(np.maximum(q2, 0.0))
    sign_r, sign_q = np.array([[1.0], [1.0], [-1.0], [-1.0]]), np.array([[1.0], [-1.0]] * 2)
    r, q = sign_r * r, sign_q * q
    gap = np.abs(alpha + beta * r + gamma * q + delta * r * q)
    gap /= 3 * h * h * n**2
    choice, which = np.nonzero((gap < _NEARLY_CLOSED) | (gap == gap.min(axis=0)))
    r, q = r[choice, which], q[choice, which]
    m1, z1, n, e2, e3 = (values[which] for values in (m1, z1, n, e2, e3))
    w = np.stack([3 * g - m1, (m1 * e2 - 2 * z1 * r) / n, (m1 * e3 - 2 * z1 * q) / n])
    z = np.stack([z1, (2 * z1 * e2 + m1 * r) / n, (2 * z1 * e3 + m1 * q) / n])
    return owner[which], *_on_circles(length[owner[which]].T, w, z)


def _polished(length: Array, owner: Indices, w: Array, z: Array, g: float, h: float) -> Candidates:
    """Return the candidates that Newton's method turns into solutions."""
    d = length[owner].T
    tolerance = equations.closing_tolerance(d, g, h)
    # Stop at the tolerance: beside a double solution, more steps would lead away again. Then take
    # as many as make it better.
    equations.newton(d, w, z, g, h, 0.5 * tolerance / equations.WITHIN, _STEPS)
    error = eq.largest(eq.distance_errors(w, z, g, h))
    closed = np.flatnonzero(error <= tolerance)
    owner, d, w, z, error = owner[closed], d[:, closed], w[:, closed], z[:, closed], error[closed]
    better = np.flatnonzero(error > _ROUNDING * (g + h))
    for _ in range(_POLISHING_STEPS):
        w_next, z_next = w[:, better], z[:, better]
        equations.newton(d[:, better], w_next, z_next, g, h, 0.0, 1)
        error_next = eq.largest(eq.distance_errors(w_next, z_next, g, h))
        gain = error_next < error[better]
        better = better[gain]
        w[:, better], z[:, better] = w_next[:, gain], z_next[:, gain]
        error[better] = error_next[gain]
        if not len(better):
            break
    return owner, *_on_circles(d, w, z)


def _twins(length: Array, owner: Indices, w: Array, z: Array, g: float, h: float) -> Candidates:
    """Return where, across a nearby singularity, the twins of solutions should be.

    Along the direction v in which the Jacobian nearly vanishes, u' J v = sigma, the equations are
    sigma s + u' f''(v, v) s^2 / 2: their other zero is s = -2 sigma / (u' f''(v, v)).
    """
    d = length[owner].T
    angle = np.arctan2(z, w)
    det = equations.cosines_determinant(d, w, z, g, h)
    near = np.abs(det) < _FOLD_BELOW
    owner, d, angle = owner[near], d[:, near], angle[:, near]
    if not len(owner):
        return owner, d, d
    u, sigma, v = np.linalg.svd(equations.jacobian(d.T, angle.T, g, h))
    left, small, right = u[:, :, 2], sigma[:, 2], v[:, 2, :]
    step = 1e-4
    ahead, behind = (
        np.einsum("nij,nj->ni", equations.jacobian(d.T, angle.T + side * step * right, g, h), right)
        for side in (1, -1)
    )
    curvature = np.einsum("ni,ni->n", left, ahead - behind) / (2 * step)
    s = -2 * small / np.where(np.abs(curvature) < 1e-12 * (g + h), np.inf, curvature)
    worth = np.abs(s) < 1.0
    twin = (angle.T + s[:, None] * right)[worth].T
    d = d[:, worth]
    return owner[worth], d * np.cos(twin), d * np.sin(twin)


def _flat(length: Array, g: float, h: float) -> Candidates:
    """Return the solutions with all tips on the base plane: highly singular, so tried directly."""
    w = length.T[:, :, None] * _SIDES[:, None, :]
    tolerance = equations.closing_tolerance(length.T, g, h)
    closed = eq.largest(eq.distance_errors(w, 0 * w, g, h)) <= tolerance[:, None]
    owner, side = np.nonzero(closed)
    w = w[:, owner, side]
    return owner, w, np.zeros_like(w)


# From solutions to modes --------------------------------------------------------------------------


def _distinct(
    length: Array, owner: Indices, w: Array, z: Array, g: float, h: float
) -> tuple[Array, Bools]:
    """Return angles (n, c, 3) of one of each mirrored pair, and which of them to keep (n, c)."""
    d = length[owner].T
    size = g + h
    # Of a pair the one above the base; if the centre is on it, the one whose first raised tip is.
    raised = np.where(np.abs(z) > 1e-9 * size, z, 0.0)
    first = np.where(raised[0] != 0, raised[0], np.where(raised[1] != 0, raised[1], raised[2]))
    height = z.sum(axis=0)
    z = np.where(np.where(np.abs(height) > 1e-9 * size, height, first) < 0, -z, z)
    det = equations.cosines_determinant(d, w, z, g, h)

    # Flat ones first, then the best closed, so that of those that coincide the best is kept.
    error = eq.largest(eq.distance_errors(w, z, g, h))
    order = np.lexsort((error, (z != 0).any(axis=0), owner))
    owner, w, z, d, det = owner[order], w[:, order], z[:, order], d[:, order], det[order]
    count = np.bincount(owner, minlength=len(length))
    place = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    shape = len(length), int(count.max(initial=0))
    keep = np.zeros(shape, dtype=bool)
    keep[owner, place] = True
    angle = np.zeros((*shape, 3))
    angle[owner, place] = np.arctan2(z, w).T
    keep[_repeated(owner, place, np.concatenate([w / d, z / d]), np.abs(det), shape)] = False
    return angle, keep


def _repeated(
    owner: Indices, place: Indices, direction: Array, det: Array, shape: tuple[int, int]
) -> tuple[Indices, Indices]:
    """Return triple and place of the solutions that another one, at an earlier place, repeats.

    `direction` holds the legs' directions, shape (6, m). Only solutions that are close in a
    projection, which few are, are compared.
    """
    item = np.full(shape, -1)
    item[owner, place] = np.arange(len(owner))
    shadow = np.full(shape, np.nan)
    shadow[owner, place] = _PROJECTION @ direction
    earlier, later = np.triu_indices(shape[1], 1)
    alike = np.abs(shadow[:, later] - shadow[:, earlier]) < np.abs(_PROJECTION).sum() * _SAME_DOUBLE
    which, pair = np.nonzero(alike)
    first, second = item[which, earlier[pair]], item[which, later[pair]]
    apart = np.abs(direction[:, first] - direction[:, second]).max(axis=0)
    singular = (det[first] < DOUBLE_BELOW) & (det[second] < DOUBLE_BELOW)
    same = apart < np.where(singular, _SAME_DOUBLE, _SAME)
    return which[same], later[pair[same]]


def _arranged(length: Array, angle: Array, keep: Bools, size: float) -> tuple[Array, Indices]:
    """Return both of each mirrored pair, highest first, (n, 16, 3), and the mirror's index."""
    n = len(keep)
    z = length[:, None] * np.sin(angle)
    lies = (np.abs(z) <= 1e-9 * size).all(axis=-1)
    height = z[..., 0] + z[..., 1] + z[..., 2]
    order = np.lexsort((-height, lies, ~keep), axis=-1)
    upper = keep.sum(axis=1)[:, None]  # of each pair one, then those that lie flat
    pairs = (keep & ~lies).sum(axis=1)[:, None]
    total = upper + pairs

    k = np.arange(MOST_MODES)
    exists, is_upper = k < total, k < upper
    partner = np.where((k >= pairs) & is_upper, k, total - 1 - k)
    source = np.where(is_upper, k, partner)[exists]
    triple = np.nonzero(exists)[0]
    both = np.full((n, MOST_MODES, 3), np.nan)
    value = angle[triple, order[triple, source]]
    both[exists] = np.where(is_upper[exists][:, None], value, _mirrored(value))
    return both, np.where(exists, partner, -1)


def _described(length: Array, angle: Array, mirror: Indices, g: float, h: float) -> AssemblyModes:
    """Return all that is known of solutions with angles (n, 16, 3)."""
    exists = mirror >= 0
    d = np.broadcast_to(length[:, None], angle.shape)[exists]
    phi = angle[exists]
    place = equations.placement_from_angles(d, phi, g, h)
    det = equations.determinant(d, phi, g, h)
    residual = np.abs(equations.residuals(d, phi, g, h)).max(axis=-1, initial=0.0)

    def padded(values: NDArray[Any], fill: float | bool) -> NDArray[Any]:
        whole = np.full((*exists.shape, *values.shape[1:]), fill)
        whole[exists] = values
        return whole

    return AssemblyModes(
        angle=angle,
        position=padded(place.position, np.nan),
        rotation=padded(place.rotation, np.nan),
        pose=padded(place.pose, np.nan),
        has_pose=padded(place.in_plane_mode, False),
        above=padded(place.position[:, 2] > 1e-9 * (g + h), False),
        mirror=mirror,
        double=padded(np.abs(det) < DOUBLE_BELOW, False),
        determinant=padded(det, np.nan),
        residual=padded(residual, np.nan),
        exists=exists,
    )


def _mirrored(angle: Array) -> Array:
    """Return -phi, with pi for -pi."""
    return np.where(angle == np.pi, np.pi, -angle)


def _on_circles(d: Array, w: Array, z: Array) -> tuple[Array, Array]:
    """Return the tips moved onto the circles of radius d: as angles would have them."""
    size = np.hypot(w, z)
    vanishing = size == 0
    stretch = d / np.where(vanishing, 1.0, size)
    return np.where(vanishing, d, w * stretch), z * stretch


# The polynomial -----------------------------------------------------------------------------------

#: Newton steps: quadratic from a simple zero, one bit a step towards a multiple one.
_STEPS = 40
_POLISHING_STEPS = 8
_ROUNDING = 1e-17
#: Weights of the legs' directions when they are compared: no two the same, nor simple fractions.
_PROJECTION: Array = np.sqrt([0.31, 0.43, 0.59, 0.67, 0.79, 0.97])
#: Leg 1 to 3 pointing inwards or outwards, (3, 8).
_SIDES = np.array(np.meshgrid([1.0, -1.0], [1.0, -1.0], [1.0, -1.0])).reshape(3, 8)

#: Chebyshev points: no end of the interval among them, where N may vanish.
_NODES = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))

#: The eliminant loses its leading coefficient for special lengths, and the colleague matrix its
#: meaning. x = (y + a)/(1 + a y) maps [-1, 1] to itself; (1 + a y)^8 P(x) is as good a polynomial
#: in y, with the leading coefficient a^8 P(1/a). Of three a the best is taken.
_SHIFTS = np.array([0.0, 0.3, -0.3])
_PREFER_PLAIN = 10.0


def _to_series(a: float) -> Array:
    """Return the matrix from P at the Chebyshev points to the Chebyshev series in y."""
    values_to_series = np.linalg.inv(chebyshev.chebvander(_NODES, _DEGREE))
    x = (_NODES + a) / (1 + a * _NODES)
    weight = (1 + a * _NODES) ** _DEGREE
    values = weight[:, None] * chebyshev.chebvander(x, _DEGREE)
    return np.asarray(values_to_series @ values @ values_to_series, dtype=np.float64)


_TO_SERIES = np.stack([_to_series(a) for a in _SHIFTS])


def _colleague(series: Array) -> Array:
    """Return matrices (n, 8, 8) whose eigenvalues are the zeros of Chebyshev series (n, 9).

    The rows and columns are scaled so that the matrix without its last column is symmetric.
    """
    n = _DEGREE
    matrix = np.zeros((len(series), n, n))
    rows = np.arange(n - 1)
    beside = np.full(n - 1, 0.5)
    beside[0] = math.sqrt(0.5)
    matrix[:, rows, rows + 1] = matrix[:, rows + 1, rows] = beside
    scale = np.full(n, math.sqrt(0.5))
    scale[0] = 1.0
    matrix[:, :, -1] -= series[:, :-1] / series[:, -1:] * (scale / scale[-1] * 0.5)
    return matrix[:, ::-1, ::-1]
