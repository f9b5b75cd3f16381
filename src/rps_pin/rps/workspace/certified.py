"""Boxes of poses that are proven to be inside the workspace, or outside.

A box (z, tilt_x, tilt_y) is inside if in all of its poses

- every leg's length and angle keep their limits, and every spherical joint its cone;
- det K > 0, with the sign of the start: no parallel (type II) singularity in it, on the start's
  side; and no leg has length zero (type I).

Each of these is a margin, a function of the kernels, which are evaluated on intervals with outward
rounding and with slopes (`rps_pin.numerics.intervals`). Its bounds prove it, or its contrary; boxes
of which neither is proven are cut into eight. A margin that is proven of a box is not asked again
of its parts.

The numbers of the robot are taken as they are stored; the directions of the legs are exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError, SingularityError
from rps_pin.numerics.intervals import Enclosure, Interval
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kernels import legs as kernels
from rps_pin.rps.kernels import tips as ring
from rps_pin.rps.kernels.limits import LIMIT_TOLERANCE
from rps_pin.rps.kernels.platform import cross
from rps_pin.rps.kernels.tilt_functions import tilt_functions
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.compute import level_pose, parameters_of
from rps_pin.rps.workspace.evaluate import side_of_singularity
from rps_pin.validation import non_negative_number, real_vector, whole_number

if TYPE_CHECKING:
    from rps_pin.rps.robot import RPSRobot

Verdict = Literal["inside", "outside", "partly", "undecided"]
#: Places of a box among those of its size: its level, and three counts from the least corner.
Places = NDArray[np.int32]
Number = Any

#: Boxes worked on at a time: few enough for a processor's cache.
_BLOCK = 4096
#: Poses within this of a limit are neither proven inside nor outside; see `LIMIT_TOLERANCE`.
_SLACK = 2 * LIMIT_TOLERANCE
#: Largest tilt of a box, rad: the series of the tilt's functions end there.
LARGEST_TILT = 1.4
_MOST_LEVELS = 30
#: cos and sin of the sixth of a turn and their like are rounded: a number that holds the exact one.
_ROUNDED = Interval(1.0 - 2.0**-50, 1.0 + 2.0**-50)
#: The parts of a box, by halves of its edges.
_HALVES = np.array(list(np.ndindex(2, 2, 2)), dtype=np.int32)


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class CertifiedBoxes:
    """A box of poses (z, tilt_x, tilt_y), cut into boxes that are proven inside or outside."""

    parameters: RPSParameters
    """The robot."""
    lower: Array
    """Least pose of the box, shape (3,), m and rad."""
    upper: Array
    """Greatest pose, shape (3,)."""
    places: tuple[Places, Places, Places]
    """Of the boxes inside, outside and undecided, shape (n, 4) each."""

    parts: Array
    """Shares of each undecided box that are proven inside and outside, by planes, shape (n, 2)."""

    @property
    def inside(self) -> Array:
        """Boxes proven inside, shape (n, 2, 3): their least and greatest poses."""
        return self._boxes(0)

    @property
    def outside(self) -> Array:
        """Boxes proven outside, shape (n, 2, 3)."""
        return self._boxes(1)

    @property
    def undecided(self) -> Array:
        """Boxes of which neither is proven, shape (n, 2, 3)."""
        return self._boxes(2)

    @property
    def volumes(self) -> tuple[float, float, float]:
        """Volumes inside, outside and undecided, m rad^2; `parts` count as what they are."""
        whole = float(np.prod(self.upper - self.lower))
        inside, outside, cut = (whole * np.ldexp(1.0, -3 * one[:, 0]) for one in self.places)
        sums = [float(one.sum()) for one in (inside, outside, *(cut * self.parts.T))]
        return sums[0] + sums[2], sums[1] + sums[3], float(cut.sum()) - sums[2] - sums[3]

    @property
    def share_undecided(self) -> float:
        """The undecided volume over that inside; infinite if nothing is inside."""
        inside, _, undecided = self.volumes
        return undecided / inside if inside else math.inf

    @property
    def verdict(self) -> Verdict:
        """What is proven of the whole box.

        ``"partly"``: parts are inside and parts are outside.
        """
        inside, outside, _ = (volume > 0.0 for volume in self.volumes)
        if inside and outside:
            return "partly"
        if len(self.places[2]):
            return "undecided"
        return "inside" if inside else "outside"

    def _boxes(self, which: int) -> Array:
        return np.moveaxis(np.array(_ends(self.places[which], self.lower, self.upper)), 0, 1)


@refuses_other_kinds
def certify(
    robot: RPSRobot | RPSParameters,
    lower: ArrayLike,
    upper: ArrayLike,
    *,
    start: ArrayLike | None = None,
    undecided: float = 0.01,
    most_boxes: int = 2_000_000,
    progress: Callable[[Iterable[int]], Iterable[int]] = iter,
) -> CertifiedBoxes:
    """Prove of which poses of a box the robot reaches them, by interval arithmetic and bisection.

    Parameters
    ----------
    robot
        A robot, or its parameters.
    lower, upper
        Least and greatest pose (z, tilt_x, tilt_y) of the box, shape (3,), m and rad.
    start
        Pose (3,) whose side of the singularities counts; by default level, with the legs at
        mid-stroke, or at the middle of the box's heights if the stroke has no end.
    undecided
        Undecided share of the volume inside at which the cutting ends.
    most_boxes
        It ends also where this many boxes are undecided.
    progress
        Wraps the loops over blocks of boxes, for a progress bar.

    Raises
    ------
    InputError
        If the box is empty, or its tilts are larger than 1.4 rad along an axis.
    SingularityError
        If the start is singular.
    """
    parameters = parameters_of(robot)
    ends = real_vector(lower, 3, "lower"), real_vector(upper, 3, "upper")
    _refuse_box(*ends)
    share = non_negative_number(undecided, "undecided")
    whole_number(most_boxes, "most_boxes", least=1)
    margins = Margins(parameters, _checked_start(parameters, ends, start))
    decided: tuple[list[Places], list[Places]] = ([], [])
    places, asked = np.zeros((1, 4), dtype=np.int32), margins.all[None]
    while True:
        left: list[tuple[Places, Bools, Array]] = []
        for i in progress(range(0, len(places), _BLOCK)):
            block, open_ = places[i : i + _BLOCK], asked[i : i + _BLOCK]
            box = Interval(*(end.T for end in _ends(block, *ends)))
            with np.errstate(invalid="ignore", over="ignore"):  # no bounds: NaN proves nothing
                out, *shares = margins.prove(box, open_)
            proven = ~open_.any(axis=1) & ~out
            decided[0].append(block[proven])
            decided[1].append(block[out])
            rest = ~(proven | out)
            left.append((block[rest], open_[rest], np.stack(shares, axis=-1)[rest]))
        places, asked, parts = (np.concatenate(one) for one in zip(*left, strict=True))
        inside, outside = (np.concatenate(one) for one in decided)
        found = CertifiedBoxes(parameters, *ends, (inside, outside, places), parts)
        deep = len(places) and places[0, 0] >= _MOST_LEVELS
        if not len(places) or deep or found.share_undecided <= share or len(places) > most_boxes:
            return found
        cut = np.repeat(places, 8, axis=0)
        cut[:, 0] += 1
        cut[:, 1:] = 2 * cut[:, 1:] + np.tile(_HALVES, (len(places), 1))
        places, asked = cut, np.repeat(asked, 8, axis=0)


class Margins:
    """The margins of a robot: what must be positive for a pose to be inside.

    Attributes
    ----------
    all
        True for each margin, shape (margins,).
    """

    def __init__(self, parameters: RPSParameters, start: Array) -> None:
        self._p = parameters
        self._side = math.copysign(1.0, side_of_singularity(parameters, start))
        lower, upper = parameters.leg_angle_limits
        self._groups: dict[str, Callable[[_Legs], list[Number]]] = {"length": self._lengths}
        if upper - lower < 2 * math.pi:
            self._groups["angle"] = self._angles
        if parameters.spherical_cone_limit < math.pi:
            self._groups["cone"] = self._cones
        self._groups["determinant"] = self._determinant
        sizes = {"length": 3 + 3 * math.isfinite(parameters.leg_length_limits[1]), "determinant": 1}
        self._columns, count = {}, 0
        for name in self._groups:
            self._columns[name] = slice(count, count := count + sizes.get(name, 3))
        self.all = np.ones(count, dtype=bool)

    def prove(self, box: Interval, asked: Bools) -> tuple[Bools, Array, Array]:
        """Return which boxes are outside, and shares of each that are proven inside and outside.

        What is proven of a box is cleared in `asked`.

        Parameters
        ----------
        box
            Poses, shape (3, n).
        asked
            Which margins are not proven yet, shape (n, margins).
        """
        out = np.zeros(len(asked), dtype=bool)
        inside, outside = np.ones(len(asked)), np.zeros(len(asked))
        for name, columns in self._columns.items():
            which = np.flatnonzero(asked[:, columns].any(axis=1) & ~out)
            if not which.size:
                continue
            part = box[:, which]
            middle = Interval((part.lower + part.upper) / 2)
            offsets = part - middle
            over = self._groups[name](_Legs(self._p, Enclosure.coordinates(part)))
            at = self._groups[name](_Legs(self._p, (middle[0], middle[1], middle[2])))
            for k, (margin, centre) in enumerate(zip(over, at, strict=True)):
                bounds = margin.about(centre, offsets)
                proven = bounds.lower > 0.0
                asked[which, columns.start + k] &= ~proven
                out[which] |= bounds.upper < -_SLACK
                inside[which] -= np.where(proven, 0.0, 1.0 - margin.share_above(centre, offsets))
                beyond = (-margin).share_above(-(centre + _SLACK), offsets)
                outside[which] = np.maximum(outside[which], beyond)
        return out, np.maximum(inside, 0.0), outside

    def _lengths(self, legs: _Legs) -> list[Number]:
        shortest, longest = self._p.leg_length_limits
        unit = 1.0 / max(shortest, self._p.base_radius)
        found = [(d - shortest) * unit for d in legs.length]
        if math.isfinite(longest):
            found += [(longest - d) * (1.0 / longest) for d in legs.length]
        return found

    def _angles(self, legs: _Legs) -> list[Number]:
        lower, upper = self._p.leg_angle_limits
        middle, least = (lower + upper) / 2, _cosine((upper - lower) / 2)
        c, s = _cosine(middle), _sine(middle)
        pairs = zip(legs.cosine, legs.sine, strict=True)
        return [cosine * c + sine * s - least for cosine, sine in pairs]

    def _cones(self, legs: _Legs) -> list[Number]:
        rest, least = self._p.spherical_rest_angle, _cosine(self._p.spherical_cone_limit)
        found = []
        for i, (e, t) in enumerate(zip(legs.along, legs.across, strict=True)):
            out, _, up = kernels.rest_axis(e, t, legs.tilt, _cosine(rest), _sine(rest))
            found.append(kernels.cone_cosine(legs.cosine[i], legs.sine[i], out, up) - least)
        return found

    def _determinant(self, legs: _Legs) -> list[Number]:
        one, two, three = legs.jacobian
        normal = cross(two, three)
        return [self._side * (one[0] * normal[0] + one[1] * normal[1] + one[2] * normal[2])]


class _Legs:
    """Legs of poses by the kernels, each number computed when it is asked for."""

    def __init__(self, parameters: RPSParameters, pose: tuple[Number, ...]) -> None:
        z, self._x, self._y = pose
        self.tilt = tilt_functions(self._x * self._x + self._y * self._y)
        g, h = parameters.base_radius, parameters.platform_radius
        radial, height = ring.tips(z, self._x, self._y, self.tilt, h)
        pairs = zip(_at_legs(radial), _at_legs(height), strict=True)
        legs = [kernels.leg_geometry(out, up, g) for out, up in pairs]
        self.length, self.cosine, self.sine = ([leg[i] for leg in legs] for i in range(3))

    @property
    def along(self) -> list[Number]:
        """The tilt along each leg's direction."""
        return _at_legs((0.0, self._x, self._y))

    @property
    def across(self) -> list[Number]:
        """The tilt across it."""
        return _at_legs((0.0, self._y, -self._x))

    @property
    def jacobian(self) -> list[tuple[Number, Number, Number]]:
        """Rows of K, d(length)/d(z, h tilt_x, h tilt_y)."""
        by_x, by_y, *heights = ring.tip_slopes(self._x, self._y, self.tilt)
        slopes = [
            (_at_legs(out), _at_legs(up)) for out, up in zip((by_x, by_y), heights, strict=True)
        ]
        return [
            (
                self.sine[i],
                *(kernels.along_leg(self.cosine[i], self.sine[i], out[i], up[i])
                  for out, up in slopes),
            )
            for i in range(3)
        ]  # fmt: skip


def _at_legs(of_ring: ring.Ring) -> list[Number]:
    """Return the numbers of the three legs, whose directions are exact."""
    mean, x, y = of_ring
    return list(ring.at_legs((mean, x, y * _ROUNDED)))


def _cosine(angle: float) -> Interval:
    return Interval(math.cos(angle)).widened(2.0**-50)  # of a library: not rounded correctly


def _sine(angle: float) -> Interval:
    return Interval(math.sin(angle)).widened(2.0**-50)


def _ends(places: Places, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the least and greatest poses of boxes, shape (n, 3) each; equal where they touch."""
    parts = np.ldexp(1.0, -places[:, :1])
    at = places[:, 1:].astype(np.float64)

    def pose(share: Array) -> Array:
        return np.where(share < 1.0, lower + (upper - lower) * share, upper)

    return pose(at * parts), pose((at + 1.0) * parts)


def _checked_start(
    parameters: RPSParameters, ends: tuple[Array, Array], start: ArrayLike | None
) -> Array:
    if start is not None:
        pose = real_vector(start, 3, "start")
    elif math.isfinite(parameters.leg_length_limits[1]):
        pose = level_pose(parameters, sum(parameters.leg_length_limits) / 2)
    else:
        pose = np.array([(ends[0][0] + ends[1][0]) / 2, 0.0, 0.0])
    if side_of_singularity(parameters, pose) == 0:
        raise SingularityError("the start pose is singular", math.inf, math.inf)
    return pose


def _refuse_box(lower: Array, upper: Array) -> None:
    if not (lower < upper).all():
        raise InputError(
            f"the box from {lower.tolist()} to {upper.tolist()} is empty: lower must be below upper"
        )
    largest = float(np.abs([lower[1:], upper[1:]]).max())
    if largest > LARGEST_TILT:
        raise InputError(
            f"the box has tilts up to {largest:.4g} rad along an axis; at most {LARGEST_TILT} rad "
            "is possible"
        )
