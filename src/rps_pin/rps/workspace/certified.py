"""Boxes of poses that are proven to be inside the workspace of a 3-RPS, or outside.

A box (z, tilt_x, tilt_y) is inside if in all of its poses

- every leg's length and angle keep their limits, and every spherical joint its cone;
- det K > 0, with the sign of the start: no parallel (type II) singularity in it, on the start's
  side; and no leg has length zero (type I).

Each of these is a margin, a function of the kernels, which are evaluated on intervals with outward
rounding and with slopes (`rps_pin.numerics.intervals`). The numbers of the robot are taken as they
are stored; the directions of the legs are exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, SingularityError
from rps_pin.numerics.boxes import (
    Bounds,
    CertifiedBoxes,
    Group,
    Groups,
    Progress,
    bounded,
    checked_box,
    prove,
)
from rps_pin.numerics.intervals import Interval
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kernels import legs as kernels
from rps_pin.rps.kernels import tips as ring
from rps_pin.rps.kernels.limits import LIMIT_TOLERANCE
from rps_pin.rps.kernels.platform import cross
from rps_pin.rps.kernels.tilt_functions import tilt_functions
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.compute import level_pose, parameters_of
from rps_pin.rps.workspace.evaluate import side_of_singularity
from rps_pin.rps.workspace.reasons import Reason
from rps_pin.task.certification.round_parts import Box, balls_of
from rps_pin.validation import real_vector

if TYPE_CHECKING:
    from rps_pin.rps.robot import RPSRobot
    from rps_pin.task.design.region import RoundPart

Number = Any

#: Poses within this of a limit are neither proven inside nor outside; see `LIMIT_TOLERANCE`.
_SLACK = 2 * LIMIT_TOLERANCE
#: Largest tilt of a box along an axis, rad: the series of the tilt's functions end at 2 rad.
LARGEST_TILT = 1.4
_COORDINATES = ("z", "rx", "ry")
#: cos and sin of the sixth of a turn and their like are rounded: a number that holds the exact one.
_ROUNDED = Interval(1.0 - 2.0**-50, 1.0 + 2.0**-50)


@refuses_other_kinds
def certify(
    robot: RPSRobot | RPSParameters,
    lower: ArrayLike,
    upper: ArrayLike,
    *,
    start: ArrayLike | None = None,
    round: Sequence[RoundPart] = (),
    undecided: float = 0.01,
    most_boxes: int = 2_000_000,
    progress: Progress = iter,
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
    round
        A disc of the tilts, ``[RoundPart(["rx", "ry"], [0, 0], 0.2)]``: tilts up to 0.2 rad about
        any level axis. Points of the box outside of it do not count, so that boxes that do not meet
        it are left out.
    undecided
        Undecided share of the volume inside at which the cutting ends.
    most_boxes
        It ends also where this many boxes are undecided.
    progress
        Wraps the loops over blocks of boxes, for a progress bar.

    Raises
    ------
    InputError
        If the box is empty, its tilts are larger than 1.4 rad along an axis, or a round part is not
        of the tilts.
    SingularityError
        If the start is singular.
    """
    parameters = parameters_of(robot)
    ends = checked_box(lower, upper, 3)
    _refuse_tilts(*ends)
    margins = Margins(parameters, _checked_start(parameters, ends, start))
    balls = balls_of(Box(_COORDINATES, (False, True, True), *ends), round)
    options: dict[str, Any] = {"undecided": undecided, "most_boxes": most_boxes, "balls": balls}
    return prove(margins.groups, *ends, progress=progress, **options)


class Margins:
    """The margins of a robot: what must be positive for a pose to be inside."""

    def __init__(self, parameters: RPSParameters, start: Array) -> None:
        self._p = parameters
        self._side = math.copysign(1.0, side_of_singularity(parameters, start))
        endless = math.isinf(parameters.leg_length_limits[1])
        lower, upper = parameters.leg_angle_limits
        short, long = _of_legs(Reason.LEG_1_SHORT), _of_legs(Reason.LEG_1_LONG)
        angles, cones = _of_legs(Reason.LEG_1_ANGLE), _of_legs(Reason.LEG_1_SPHERICAL)
        asked = {
            self._lengths: short if endless else short + long,
            self._angles: angles if upper - lower < 2 * math.pi else [],
            self._cones: cones if parameters.spherical_cone_limit < math.pi else [],
            self._determinant: [Reason.SINGULAR],
        }
        #: For `rps_pin.numerics.boxes.prove`.
        self.groups: Groups = {
            margins.__name__: ([one.text for one in reasons], self._group(margins))
            for margins, reasons in asked.items()
            if reasons
        }

    def _group(self, margins: Callable[[_Legs], list[Number]]) -> Group:
        def bounds(box: Interval) -> list[Bounds]:
            return bounded(lambda *pose: margins(_Legs(self._p, pose)), box, _SLACK)

        return bounds

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


def _of_legs(leg_1: Reason) -> list[Reason]:
    """Return a reason of leg 1, and those of legs 2 and 3, whose bits follow."""
    return [Reason(leg_1 << leg) for leg in range(3)]


def _at_legs(of_ring: ring.Ring) -> list[Number]:
    """Return the numbers of the three legs, whose directions are exact."""
    mean, x, y = of_ring
    return list(ring.at_legs((mean, x, y * _ROUNDED)))


def _cosine(angle: float) -> Interval:
    return Interval(math.cos(angle)).widened(2.0**-50)  # of a library: not rounded correctly


def _sine(angle: float) -> Interval:
    return Interval(math.sin(angle)).widened(2.0**-50)


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


def _refuse_tilts(lower: Array, upper: Array) -> None:
    largest = float(np.abs([lower[1:], upper[1:]]).max())
    if largest > LARGEST_TILT:
        raise InputError(
            f"the box has tilts up to {largest:.4g} rad along an axis; at most {LARGEST_TILT} rad "
            "is possible"
        )
