"""Poses from any three independent quantities of Section 2.1: every solution, in closed form.

Section 2.1 of the paper describes the platform by p_z, p_x, p_y and the Z-Y-Z angles alpha, beta,
gamma. With w the rotation vector of the pose, h the platform's radius, and u and v the first two
columns of the rotation R = Rz(alpha) Ry(beta) Rz(gamma),

    gamma = -alpha,                            w = beta (-sin(alpha), cos(alpha), 0),
    p_x = -h/2 (1 - cos(beta)) cos(2 alpha),   p_y = h/2 (1 - cos(beta)) sin(2 alpha),
    u_z = -sin(beta) cos(alpha),               v_z = -sin(beta) sin(alpha).

The first three are Eq. 5 with p_x and p_y told apart as Eq. 4 demands (as printed they are
swapped); the last line is the slope of the platform. 1 - cos(beta) is written 2 sin^2(beta/2),
which keeps all its digits near the level pose, where this robot makes its micro movements.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, UnreachableError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kinematics.samples import Errors, check_errors_option, refuse
from rps_pin.validation import one_shape, positive_number, real_array

#: What is asked may miss what is possible by rounding, and no more: by this share of it, and by
#: this share of h (of 1, for slopes), the digits that a rotation matrix leaves.
_ROUNDING = 1e-12
_LAST_DIGITS = 1e-15


class PoseSolutions(NamedTuple):
    """Every pose that has the given quantities: k branches, each in a place of its own."""

    pose: Array
    """Shape (..., k, 3); level where the branch does not exist. Branches that meet are equal."""
    exists: Bools
    """Which branches exist, shape (..., k)."""
    continuum: Bools
    """Whether there is besides a whole curve of poses, of which none is listed, shape (...)."""


@refuses_other_kinds
def poses_from(
    platform_radius: float,
    *,
    z: ArrayLike | None = None,
    x: ArrayLike | None = None,
    y: ArrayLike | None = None,
    alpha: ArrayLike | None = None,
    beta: ArrayLike | None = None,
    gamma: ArrayLike | None = None,
    u_z: ArrayLike | None = None,
    v_z: ArrayLike | None = None,
    z_1: ArrayLike | None = None,
    z_2: ArrayLike | None = None,
    z_3: ArrayLike | None = None,
    errors: Errors = "raise",
) -> PoseSolutions:
    """Return every pose that has three given quantities (Section 2.1 of the paper).

    ==================  =  ====================================================================
    given               k  branches, in this order
    ==================  =  ====================================================================
    z, alpha, beta      1
    z, x, y             2  ``"+"`` and ``"-"`` of `pose_from_position`
    z, x or y, alpha    2  (alpha, beta) and (alpha, -beta), with beta >= 0
    z, x, beta          4  2 alpha = a, -a, a + 2 pi, -a + 2 pi with a = acos(..) in [0, pi]
    z, y, beta          4  2 alpha = a, pi - a, a + 2 pi, 3 pi - a with a = asin(..)
    z, u_z, v_z         2  platform upright (beta <= pi/2), platform upside down
    z_1, z_2, z_3       2  likewise
    ==================  =  ====================================================================

    All quantities broadcast to one shape (...). gamma = -alpha may stand for alpha. Tilts lie
    within pi, except where beta is given: it is taken as it is, of either sign. What is asked may
    exceed what is possible by rounding: 1e-12 of it and 1e-15 h (1e-15, for slopes).

    Where a whole curve of poses has the three quantities, it is left out, and
    `PoseSolutions.continuum` says so: x = 0 at cos(2 alpha) = 0 and y = 0 at sin(2 alpha) = 0, for
    any beta; zero slopes, besides at the level pose, for a half turn about any axis in the base
    plane.

    Parameters
    ----------
    platform_radius
        The paper's h, m.
    z, x, y
        p_z, p_x, p_y: the platform's centre in base axes, m.
    alpha, beta, gamma
        The paper's Z-Y-Z angles, rad.
    u_z, v_z
        Direction cosines to the vertical of the platform's x and y axes: its slopes.
    z_1, z_2, z_3
        Heights of the spherical joints, m.
    errors
        ``"raise"`` refuses an entry without a listed pose; ``"mask"`` says so in
        `PoseSolutions.exists`.

    Returns
    -------
    PoseSolutions
        `pose` (..., k, 3), `exists` (..., k), `continuum` (...).

    Raises
    ------
    InputError
        If the quantities are not three independent ones, are not finite numbers, or have shapes
        that do not go together; with ``errors="raise"`` also if only a continuum has them.
    UnreachableError
        With ``errors="raise"``, if no pose has them.
    """
    check_errors_option(errors)
    h = positive_number(platform_radius, "platform_radius", "metres")
    possible = {"z": z, "x": x, "y": y, "alpha": alpha, "beta": beta, "gamma": gamma}
    possible |= {"u_z": u_z, "v_z": v_z, "z_1": z_1, "z_2": z_2, "z_3": z_3}
    given = {name: value for name, value in possible.items() if value is not None}
    solve = _solver(given)
    arrays = {name: real_array(value, name) for name, value in given.items()}
    q = dict(zip(arrays, one_shape(**arrays), strict=True))
    known = q | {"alpha": -q["gamma"]} if "gamma" in q else q
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is out of reach
        if "z_1" in q:
            known = _slopes(h, *q.values())
        found = solve(h, known)

    slack = _ROUNDING * (found.upper - found.lower) + _LAST_DIGITS * (h if found.unit else 1.0)
    reached = (found.value >= found.lower - slack) & (found.value <= found.upper + slack)
    exists = np.ones(found.tilt.shape[:-1], dtype=bool) & reached[..., None] & found.isolated
    tilt = np.where(exists[..., None], found.tilt, 0.0)
    height = np.broadcast_to(known["z"][..., None, None], (*exists.shape, 1))
    if errors == "raise":
        refuse(~exists.any(axis=-1), partial(_error, q, found))
    pose = np.concatenate([height, tilt], axis=-1)
    return PoseSolutions(pose, exists, np.zeros(reached.shape, dtype=bool) | found.continuum)


class _Branches(NamedTuple):
    """Solutions of three quantities, and the condition under which they exist."""

    tilt: Array  # (..., k, 2)
    #: The quantity that decides: name, unit, value (...), and its range.
    name: str
    unit: str
    value: Array
    lower: Array | float
    upper: Array | float
    isolated: Bools | bool = True  # (..., k)
    continuum: Bools | bool = False  # (...)


_Quantities = dict[str, Array]
_Solver = Callable[[float, _Quantities], _Branches]


def _from_angles(h: float, q: _Quantities) -> _Branches:
    tilt = _tilt(q["alpha"], q["beta"])[..., None, :]
    return _Branches(tilt, "", "", np.zeros_like(q["z"]), 0.0, 0.0)


def _from_centre(h: float, q: _Quantities) -> _Branches:
    shift = np.hypot(q["x"], q["y"])
    half_phi = np.arctan2(q["y"] + 0.0, q["x"]) / 2  # + 0.0: phi is pi, not -pi, at y = -0
    # p_x = r cos(phi), p_y = r sin(phi): r = h sin^2(beta/2), alpha = pi/2 - phi/2
    tilt = _both_signs(np.pi / 2 - half_phi, shift / h)
    return _Branches(tilt, "hypot(x, y)", "m", shift, 0.0, h)


def _from_shift_and_alpha(h: float, q: _Quantities) -> _Branches:
    alpha = q["alpha"]
    # p_x = -h cos(2 alpha) sin^2(beta/2), p_y = h sin(2 alpha) sin^2(beta/2)
    name, slope = ("x", -np.cos(2 * alpha)) if "x" in q else ("y", np.sin(2 * alpha))
    shift, lower, upper = q[name], np.minimum(h * slope, 0.0), np.maximum(h * slope, 0.0)
    blind = np.abs(slope) <= _ROUNDING  # the tilt does not move the centre this way
    share = np.where(blind, 0.0, shift / h / np.where(blind, 1.0, slope))
    continuum = blind & (np.abs(shift) <= _ROUNDING * h)
    tilt, isolated = _both_signs(alpha, share), ~continuum[..., None]
    return _Branches(tilt, name, "m", shift, lower, upper, isolated, continuum)


def _from_shift_and_beta(h: float, q: _Quantities) -> _Branches:
    name, beta = "x" if "x" in q else "y", q["beta"]
    reach = h * np.sin(beta / 2) ** 2
    ratio = np.clip(q[name], -reach, reach) / np.where(reach == 0, 1.0, reach)
    if name == "x":  # p_x = -reach cos(2 alpha)
        a = np.arccos(-ratio)
        twice_alpha = np.stack([a, -a, a + 2 * np.pi, -a + 2 * np.pi], axis=-1)
    else:  # p_y = reach sin(2 alpha)
        a = np.arcsin(ratio)
        twice_alpha = np.stack([a, np.pi - a, a + 2 * np.pi, 3 * np.pi - a], axis=-1)
    tilt = _tilt(twice_alpha / 2, beta[..., None])
    return _Branches(tilt, name, "m", q[name], 0.0 - reach, reach)


def _from_slopes(h: float, q: _Quantities) -> _Branches:
    u_z, v_z = q["u_z"], q["v_z"]
    sine = np.hypot(u_z, v_z)
    flat = sine == 0
    # (u_z, v_z) = -sin(beta) (cos(alpha), sin(alpha)), so w = beta (v_z, -u_z) / sin(beta)
    axis = np.stack([v_z, -u_z], axis=-1) / np.where(flat, 1.0, sine)[..., None]
    beta = np.arcsin(np.minimum(sine, 1.0))[..., None]
    tilt = np.stack([beta * axis, (np.pi - beta) * axis], axis=-2)
    isolated = np.stack([np.ones_like(flat), ~flat], axis=-1)
    return _Branches(tilt, "hypot(u_z, v_z)", "", sine, 0.0, 1.0, isolated, flat)


def _slopes(h: float, z_1: Array, z_2: Array, z_3: Array) -> _Quantities:
    """Return height and slopes of the tips' heights: Eq. 20, and third components of Eq. 2."""
    u_z, v_z = ((z_1 - z_2) + (z_1 - z_3)) / (3 * h), (z_2 - z_3) / (np.sqrt(3) * h)
    return {"z": z_1 / 3 + z_2 / 3 + z_3 / 3, "u_z": u_z, "v_z": v_z}


_SOLVERS: dict[frozenset[str], _Solver] = {
    frozenset({"z", "alpha", "beta"}): _from_angles,
    frozenset({"z", "x", "y"}): _from_centre,
    frozenset({"z", "x", "alpha"}): _from_shift_and_alpha,
    frozenset({"z", "y", "alpha"}): _from_shift_and_alpha,
    frozenset({"z", "x", "beta"}): _from_shift_and_beta,
    frozenset({"z", "y", "beta"}): _from_shift_and_beta,
    frozenset({"z", "u_z", "v_z"}): _from_slopes,
    frozenset({"z_1", "z_2", "z_3"}): _from_slopes,
}


def _solver(given: dict[str, ArrayLike]) -> _Solver:
    """Return what solves for the given quantities, or say why they do not determine a pose."""
    names = frozenset(given)
    if {"alpha", "gamma"} <= names:
        raise InputError(
            "alpha and gamma are not independent, gamma = -alpha (Eq. 5): give one of them, and "
            "one of x, y, beta"
        )
    solver = _SOLVERS.get(frozenset("alpha" if name == "gamma" else name for name in names))
    if solver is None:
        raise InputError(
            f"{', '.join(given) or 'nothing'} given, which is no set that determines a pose. It is "
            "z, which nothing else determines, with two of x, y, alpha, beta (gamma = -alpha may "
            "stand for alpha), or z, u_z, v_z, or z_1, z_2, z_3"
        )
    return solver


def _error(
    q: _Quantities, found: _Branches, first: tuple[int, ...], where: str
) -> InputError | UnreachableError:
    """Return the error of an entry that has no pose to list."""
    units = {"alpha": "rad", "beta": "rad", "gamma": "rad", "u_z": "", "v_z": ""}
    asked = ", ".join(
        f"{name} = {values[first]:.6g} {units.get(name, 'm')}".rstrip()
        for name, values in q.items()
    )
    if np.broadcast_to(found.continuum, found.value.shape)[first]:
        return InputError(
            f"{asked}{where}: this holds for every beta, so it determines no pose; give another "
            f"quantity than {found.name} or alpha"
        )
    ends = np.broadcast_arrays(found.value, found.lower, found.upper)
    value, lower, upper = (float(end[first]) for end in ends)
    unit = f" {found.unit}" if found.unit else ""
    return UnreachableError(
        f"no pose has {asked}{where}: {found.name} would be {value:.6g}{unit}; it can be "
        f"{lower:.6g} to {upper:.6g}{unit}, and misses that by "
        f"{max(lower - value, value - upper):.3g}{unit}"
    )


def _tilt(alpha: Array, beta: Array) -> Array:
    """Return (tilt_x, tilt_y) = beta (-sin(alpha), cos(alpha)), shape (..., 2)."""
    return np.stack([-beta * np.sin(alpha), beta * np.cos(alpha)], axis=-1)


def _both_signs(alpha: Array, share: Array) -> Array:
    """Return both tilts about alpha whose sin^2(beta/2) is a share, 0 to 1; shape (..., 2, 2).

    Shares beyond that are not reached, and are told apart by the caller.
    """
    plus = _tilt(alpha, 2 * np.arcsin(np.sqrt(np.clip(share, 0.0, 1.0))))
    return np.stack([plus, -plus], axis=-2)
