"""Poses of a platform on six legs between points, by homotopy: all of them.

With Study's coordinates x = (e, f), e a quaternion (x, y, z, w) and e . f = 0, the pose is

    R = M(e) / e.e,    p = 2 vec(f e*) / e.e,

and the equation of a leg of length r from b to p + R a, times e.e, is a quadric in x:

    4 f.f + 4 a . vec(e* f) - 4 b . vec(f e*) - 2 b . M(e) a + (a.a + b.b - r^2) e.e = 0.

Six of them and e . f = 0 in the projective space of x have 2^7 = 128 solutions at most (Bezout). Of
a general platform 40 have e.e != 0 (Wampler, Forward displacement analysis of general
six-in-parallel SPS platform manipulators using soma coordinates, 1996; Husty, 1996; Ronga and Vust,
Stewart platforms without computer?, 1992, prove that 40 is the most). The others, with e = 0, are
no poses.

The 40 of one general platform with complex numbers are found once, from 128 paths. From there 40
paths lead to any other platform, with its points and squared lengths on straight lines.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools, ComplexArray
from rps_pin.numerics.homotopy.quadrics import proven_solutions
from rps_pin.numerics.homotopy.tracking import tracked
from rps_pin.numerics.intervals import Interval

#: Poses of a general platform.
GENERAL = 40
_TRIES = 5
#: Poses are the same if their coordinates, as unit vectors, have a product this near to 1.
_SAME = 1e-11
#: How far along a path must come before it counts as one to a singular end.
_NEAR_END = 0.999
#: Charts of the projective space that are tried for proofs.
_CHARTS = 20
#: e.e, relative to x.x, below which a solution is no pose.
_NO_POSE = 1e-8


class Legs(NamedTuple):
    """Legs between points, in one unit of length: complex numbers, or intervals."""

    base: Any
    """b, shape (6, 3)."""
    platform: Any
    """a, shape (6, 3)."""
    squared: Any
    """r^2, shape (6,)."""


def _forms() -> Array:
    """Return the symmetric matrices whose sum, by `_coefficients`, is a leg's quadric: (17, 8, 8).

    Of f.f, of e.e, of vec(e* f) for each component of a, of vec(f e*) for each component of b, and
    of the entries of M(e) for the products of both, row by row.
    """
    left, right = np.zeros((3, 8, 8)), np.zeros((3, 8, 8))
    turned = np.zeros((3, 3, 8, 8))
    ee, ff = np.zeros((2, 8, 8))
    ee[range(4), range(4)] = ff[range(4, 8), range(4, 8)] = 1.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        # vec(e* f) = w f_v - f_w e_v - e_v x f_v;  vec(f e*) = w f_v - f_w e_v + e_v x f_v
        for form, sign in ((left, -1.0), (right, 1.0)):
            form[i, 3, 4 + i], form[i, i, 7] = 1.0, -1.0
            form[i, j, 4 + k], form[i, k, 4 + j] = sign, -sign
        # M = (w^2 - v.v) 1 + 2 v v' + 2 w [v]
        turned[i, i, 3, 3] = turned[i, i, i, i] = 1.0
        turned[i, i, j, j] = turned[i, i, k, k] = -1.0
        turned[i, j, i, j] = turned[j, i, i, j] = 2.0
        turned[i, j, k, 3], turned[j, i, k, 3] = -2.0, 2.0
    forms = np.array([ff, ee, *left, *right, *turned.reshape(9, 8, 8)])
    return np.asarray((forms + forms.swapaxes(1, 2)) / 2)


_FORMS = _forms()
_STUDY = np.zeros((8, 8))
_STUDY[range(4), range(4, 8)] = _STUDY[range(4, 8), range(4)] = 0.5


def _coefficients(legs: Legs) -> list[Any]:
    """Return the 17 numbers by which a leg's quadric is made of `_forms`, each (..., 6).

    Intervals where the legs' points and squared lengths are such.
    """
    b, a = ([one[..., i] for i in range(3)] for one in (legs.base, legs.platform))
    rest = -legs.squared
    for one in (*a, *b):
        rest = rest + one * one
    products = [-2 * one * other for one in b for other in a]
    return [4 + 0 * rest, rest, *(4 * one for one in a), *(-4 * one for one in b), *products]


def _slopes(legs: Legs, by: Legs) -> list[Any]:
    """Return the derivatives of `_coefficients` along a change of the legs."""
    b, a, db, da = (
        [one[..., i] for i in range(3)] for one in (legs.base, legs.platform, by.base, by.platform)
    )
    rest = -by.squared
    for one, change in zip((*a, *b), (*da, *db), strict=True):
        rest = rest + 2 * one * change
    products = [-2 * (b[i] * da[j] + db[i] * a[j]) for i in range(3) for j in range(3)]
    return [0 * rest, rest, *(4 * one for one in da), *(-4 * one for one in db), *products]


def quadrics(legs: Legs) -> Any:
    """Return symmetric matrices Q of the legs' equations x' Q x = 0, shape (..., 6, 8, 8).

    Intervals where the legs' points and squared lengths are such.
    """
    terms = zip(_coefficients(legs), _FORMS, strict=True)
    total: Any = 0.0
    for coefficient, form in terms:
        total = coefficient[..., None, None] * form + total
    return total


class _FromProducts:
    """The homotopy from products of linear forms to the quadrics of legs."""

    def __init__(self, legs: Legs, rng: np.random.Generator) -> None:
        self._quadrics = np.concatenate([quadrics(legs), _STUDY[None]])
        self._one, self._two = _random(rng, 7, 8), _random(rng, 7, 8)
        self._patch = _random(rng, 8)

    def start(self) -> ComplexArray:
        """Return where one factor of each product vanishes, shape (128, 8)."""
        chosen = (np.arange(128)[:, None] >> np.arange(7)) & 1
        rows = np.where(chosen[..., None] == 0, self._one, self._two)
        rows = np.concatenate([rows, np.broadcast_to(self._patch, (128, 1, 8))], axis=1)
        return np.asarray(np.linalg.solve(rows, np.eye(8)[7][:, None])[..., 0])

    def __call__(
        self, x: ComplexArray, s: Array
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return the values and derivatives; see `Homotopy`."""
        p, q, share = x @ self._one.T, x @ self._two.T, s[:, None]
        by_x = 2 * np.einsum("ijk,nk->nij", self._quadrics, x)
        value = np.einsum("nij,nj->ni", by_x, x) / 2
        by_product = p[..., None] * self._two + q[..., None] * self._one
        values = (1 - share) * p * q + share * value
        slopes = (1 - share)[..., None] * by_product + share[..., None] * by_x
        return _with_patch(x, self._patch, values, slopes, value - p * q)


class _BetweenLegs:
    """The homotopy from the legs of one platform to those of another."""

    def __init__(self, start: Legs, end: Legs, patch: ComplexArray, bend: float) -> None:
        self._start, self._patch, self._bend = start, patch, bend
        self._change = Legs(*(np.asarray(b - a) for a, b in zip(start, end, strict=True)))

    def __call__(
        self, x: ComplexArray, s: Array
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return the values and derivatives; see `Homotopy`."""
        change, bend = self._change, 1j * self._bend
        share = s + bend * s * (1 - s)
        legs = Legs(
            self._start.base + share[:, None, None] * change.base,
            self._start.platform + share[:, None, None] * change.platform,
            self._start.squared + share[:, None] * change.squared,
        )
        products = (_FORMS.reshape(-1, 8) @ x.T).T.reshape(-1, 17, 8)  # of each form with x
        by_x = 2 * np.stack(_coefficients(legs), axis=-1) @ products
        by_x = np.concatenate([by_x, 2 * (x @ _STUDY)[:, None]], axis=1)
        values = (by_x @ x[:, :, None])[..., 0] / 2
        along = np.stack(np.broadcast_arrays(*_slopes(legs, change)), axis=-1) @ (
            products @ x[:, :, None]
        )
        by_s = along[..., 0] * (1 + bend * (1 - 2 * s))[:, None]
        by_s = np.concatenate([by_s, np.zeros((len(x), 1))], axis=1)
        return _with_patch(x, self._patch, values, by_x, by_s)


def _with_patch(
    x: ComplexArray,
    patch: ComplexArray,
    values: ComplexArray,
    slopes: ComplexArray,
    by_s: ComplexArray,
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Add the equation patch . x = 1, by which x stands for its multiples."""
    k = len(x)
    return (
        np.concatenate([values, (x @ patch - 1)[:, None]], axis=1),
        np.concatenate([slopes, np.broadcast_to(patch, (k, 1, 8))], axis=1),
        np.concatenate([by_s, np.zeros((k, 1))], axis=1),
    )


def _random(rng: np.random.Generator, *shape: int) -> ComplexArray:
    """Return complex numbers of size one."""
    return np.asarray(np.exp(2j * np.pi * rng.random(shape)))


@cache
def general_platform() -> tuple[Legs, ComplexArray]:
    """Return a platform with complex numbers, and its 40 poses, shape (40, 8)."""
    for seed in range(_TRIES):
        rng = np.random.default_rng(seed)
        legs = Legs(_random(rng, 6, 3), _random(rng, 6, 3), _random(rng, 6))
        homotopy = _FromProducts(legs, rng)
        ends = tracked(homotopy, homotopy.start())
        found = ends.x[ends.regular & is_pose(ends.x)]
        if len(found) == GENERAL:
            return legs, found
    raise AssertionError("a general platform has 40 poses")


def is_pose(x: ComplexArray) -> Bools:
    """Return which Study coordinates, (k, 8), are poses: e.e is not zero."""
    e = x[:, :4]
    return np.asarray(np.abs((e * e).sum(axis=1)) > _NO_POSE * (np.abs(x) ** 2).sum(axis=1))


def poses_of(legs: Legs, seed: int = 0) -> ComplexArray:
    """Return all regular poses of a platform, shape (k, 8), |x| = 1.

    If a path stops before its end is near, the paths are followed again, on another arc from the
    general platform: it comes near to e = 0 elsewhere.

    Parameters
    ----------
    legs
        Legs of about one in size.
    seed
        Of the arcs and charts.
    """
    start, x = general_platform()
    rng = np.random.default_rng(seed)
    found = np.empty((0, 8), dtype=np.complex128)
    for attempt in range(_TRIES):
        patch, bend = _random(rng, 8), attempt * rng.uniform(-1.0, 1.0)
        ends = tracked(_BetweenLegs(start, legs, patch, bend), x / (x @ patch)[:, None])
        ended = ends.x[ends.regular & is_pose(ends.x)]
        ended = ended / np.linalg.norm(ended, axis=1)[:, None]
        new = np.abs(ended.conj() @ found.T).max(axis=1, initial=0.0) < 1.0 - _SAME
        found = np.concatenate([found, ended[new]])
        if ends.s.min() >= _NEAR_END or len(found) == GENERAL:
            break
    return found


def real_ones(x: ComplexArray) -> Array:
    """Return the real ones among all poses of a real platform (k, 8), shape (m, 8), |e| = 1.

    The conjugate of a solution is one too: it is real where that is itself.
    """
    alike = np.abs(x @ x.T)  # |x . y| is 1 where y is a multiple of the conjugate of x
    chosen = x[np.argmax(alike, axis=1) == np.arange(len(x))]
    largest = chosen[np.arange(len(chosen)), np.argmax(np.abs(chosen), axis=1)]
    real = (chosen / largest[:, None]).real
    return np.asarray(real / np.linalg.norm(real[:, :4], axis=1)[:, None])


def proven(legs: Legs, x: Array, rng: np.random.Generator) -> list[Interval | None]:
    """Return boxes that hold one real pose each, in one chart; none where that is not proven.

    Parameters
    ----------
    legs
        Real legs, as exact numbers: intervals.
    x
        Solutions nearby, shape (m, 8).
    rng
        By which the chart c . x = 1 is chosen: far from infinity for all of x.
    """
    charts = rng.normal(size=(_CHARTS, 8))
    size = np.abs(x @ charts.T) / np.linalg.norm(x, axis=1)[:, None]
    chart = charts[int(np.argmax((size / np.linalg.norm(charts, axis=1)).min(axis=0, initial=1.0)))]
    legs_forms = quadrics(legs)
    forms = Interval(
        *(np.concatenate([end, _STUDY[None]]) for end in (legs_forms.lower, legs_forms.upper))
    )
    return proven_solutions(forms, chart, x)
