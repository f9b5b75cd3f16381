"""A 3-RPS robot's functions as expressions and C: inverse and direct kinematics, forces.

Each ends with an output `check` (2), of which the first is above 1 where the answer needs a closer
look: a leg near its limits or without length, a singularity nearby, leg lengths that are not
followed to their end; for forces, also a leg beyond its limits. There `rps_pin.rps.kinematics` and
`rps_pin.rps.dynamics` answer.

Numbers of the robot are inputs: one library serves all robots.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rps_pin.codegen.units import Kernel, Routine, Unit
from rps_pin.numerics.elementary import Number, atan2, both, greatest, least, select_all
from rps_pin.rps.dynamics.force_equations import ForceTerms
from rps_pin.rps.generated.follow import FOLLOW, follow_kernels, kernel, symbols
from rps_pin.rps.generated.forces import TERMS, actuator_forces, is_regular, leg_block, terms_of
from rps_pin.rps.generated.layout import Layout
from rps_pin.rps.kernels import continuation, legs, limits, placement, tips
from rps_pin.rps.kernels.tilt_functions import TiltFunctions, tilt_functions
from rps_pin.rps.kinematics.forward_kinematics import MOST_STEPS
from rps_pin.rps.kinematics.leg_equations import ONE_MODE
from rps_pin.rps.kinematics.legs import VANISHING, cosine_of_cone, cosine_of_half
from rps_pin.rps.parameters import RPSParameters

#: Steps in which most leg lengths are followed; the few that take more are followed again, apart
#: from the others, so that these need not wait for them.
FEW_STEPS = 20
#: Margin, of cosines or of lengths over lengths, below which a limit is broken, rounding or not.
_BEYOND = 1e-9
#: A length that no leg has: generated code takes finite numbers.
_FAR = 1e50
#: Radii, and what limits are made of: see `limits_of`.
LIMITS = Layout(
    {"radii": 2, "lengths": 2, "middle": 2, "half_angle": 1, "rest": 2, "cone": 1},
)
#: Inputs and outputs of each function, without `check`, and their sizes.
ARGUMENTS: Mapping[str, tuple[Mapping[str, int], Mapping[str, int]]] = {
    "inverse_kinematics": (
        {"pose": 3, "numbers": LIMITS.size},
        {"length": 3, "angle": 3, "reachable": 1},
    ),
    "forward_kinematics": ({"length": 3, "near": 3, "numbers": 3}, {"pose": 3}),
    "followed": ({"length": 3, "near": 3, "numbers": 3}, {"pose": 3, "reached": 1}),
    "actuator_forces": (
        {
            **{"pose": 3, "rate": 3, "acceleration": 3, "wrench": 6},
            **{"terms": TERMS.size, "numbers": LIMITS.size},
        },
        {"force": 3},
    ),
}

#: A number of each leg.
_Three = tuple[Number, Number, Number]


def limits_of(p: RPSParameters) -> list[float]:
    """Return the numbers of `LIMITS` of a robot."""
    low, high = p.leg_angle_limits
    middle, rest = (low + high) / 2, p.spherical_rest_angle
    return LIMITS.join(
        {
            "radii": (p.base_radius, p.platform_radius),
            "lengths": (p.leg_length_limits[0], min(p.leg_length_limits[1], _FAR)),
            "middle": (math.cos(middle), math.sin(middle)),
            "half_angle": cosine_of_half(low, high),
            "rest": (math.cos(rest), math.sin(rest)),
            "cone": cosine_of_cone(p.spherical_cone_limit),
        }
    )


def terms_numbers(terms: ForceTerms) -> list[float]:
    """Return the numbers of `TERMS` of a robot."""
    return TERMS.join({name: getattr(terms, name) for name in TERMS.sizes})


class _Legs(NamedTuple):
    """Legs of a pose as expressions."""

    tilt: TiltFunctions
    length: _Three
    cosine: _Three
    sine: _Three


def _legs_of(pose: Sequence[Number], g: Number, h: Number) -> _Legs:
    """Return the legs of a pose; see `rps_pin.rps.kinematics.legs.geometry_of_pose`."""
    z, x, y = pose
    tilt = tilt_functions(x * x + y * y)
    radial, height = (tips.at_legs(ring) for ring in tips.tips(z, x, y, tilt, h))
    length, cosine, sine = zip(
        *(legs.leg_geometry(rho, up, g) for rho, up in zip(radial, height, strict=True)),
        strict=True,
    )
    return _Legs(tilt, length, cosine, sine)


def _keeps_limits(
    pose: Sequence[Number], of: _Legs, groups: dict[str, Any]
) -> tuple[Number, Number]:
    """Return whether the legs surely keep their limits, and whether one surely breaks one."""
    _, x, y = pose
    e, t = tips.at_legs((0.0, x, y)), tips.at_legs((0.0, y, -x))
    cones = []
    for i in range(3):
        out, _, up = legs.rest_axis(e[i], t[i], of.tilt, *groups["rest"])
        cones.append(legs.cone_cosine(of.cosine[i], of.sine[i], out, up))
    margins = (
        limits.length_margin(of.length, *groups["lengths"]) / greatest(*of.length),
        limits.angle_margin(of.cosine, of.sine, groups["middle"], groups["half_angle"]),
        limits.cone_margin((cones[0], cones[1], cones[2]), groups["cone"]),
    )
    smallest = least(*margins)
    has_length = _has_length(of, groups["radii"][0])
    return both(smallest >= 0.0, has_length), both(smallest < -_BEYOND, has_length)


def _has_length(of: _Legs, g: Number) -> Number:
    return least(*of.length) >= VANISHING * g


def _check(good: Number) -> tuple[Number, Number]:
    """Return the output `check`: (0, 0) of a good sample, else (2, 0)."""
    return 2.0 * (1.0 - good), 0.0


def inverse_kernel() -> Kernel:
    """Return leg lengths and angles of a pose, and whether they keep their limits."""
    pose, numbers = symbols("pose", 3), symbols("numbers", LIMITS.size)
    groups = LIMITS.split(numbers)
    of = _legs_of(pose, *groups["radii"])
    angle = tuple(atan2(s, c) for s, c in zip(of.sine, of.cosine, strict=True))
    kept, broken = _keeps_limits(pose, of, groups)
    return kernel(
        "inverse_kinematics",
        {"pose": pose, "numbers": numbers},
        {
            "length": of.length,
            "angle": angle,
            "reachable": (kept,),
            "check": _check(kept + broken),
        },
    )


def forces_kernel() -> Kernel:
    """Return the actuator forces of a motion."""
    pose, rate, acceleration = symbols("pose", 3), symbols("rate", 3), symbols("acceleration", 3)
    wrench = symbols("wrench", 6)
    terms, numbers = symbols("terms", TERMS.size), symbols("numbers", LIMITS.size)
    groups = LIMITS.split(numbers)
    g, h = groups["radii"]
    of = _legs_of(pose, g, h)
    block = leg_block((pose[1], pose[2], of.tilt), of.length, (*of.cosine, *of.sine))
    force = actuator_forces(terms_of(TERMS.split(terms)), block, rate, acceleration, wrench)
    good = both(is_regular(block, h), _keeps_limits(pose, of, groups)[0])
    return kernel(
        "actuator_forces",
        {
            "pose": pose,
            "rate": rate,
            "acceleration": acceleration,
            "wrench": wrench,
            "terms": terms,
            "numbers": numbers,
        },
        {
            "force": force,
            "check": _check(good),
        },
    )


# Direct kinematics --------------------------------------------------------------------------------


def start_kernel() -> Kernel:
    """Return where following begins, and whether it may."""
    near, numbers = symbols("near", 3), symbols("numbers", 3)
    g, h, limit = numbers
    of = _legs_of(near, g, h)
    direction = (*of.cosine, *of.sine)
    condition = continuation.newton_step(of.length, direction, g, h)[2]
    return kernel(
        "direct_start",
        {"near": near, "numbers": numbers},
        {
            "begin": of.length,
            "direction": direction,
            "good": (both(condition <= limit, _has_length(of, g)),),
        },
    )


def end_kernel() -> Kernel:
    """Return the pose at the end, or the last one reached, and which of both it is."""
    length, begin, numbers = symbols("length", 3), symbols("begin", 3), symbols("numbers", 3)
    direction, progress, good = symbols("direction", 6), symbols("progress", 3), symbols("good", 1)
    g, h, _ = numbers
    done = progress[0]
    part = [one + done * (other - one) for one, other in zip(begin, length, strict=True)]
    there = select_all(done >= 1.0, length, (part[0], part[1], part[2]))
    rho = (g - there[0] * direction[0], g - there[1] * direction[1], g - there[2] * direction[2])
    height = (there[0] * direction[3], there[1] * direction[4], there[2] * direction[5])
    _, u, v = placement.platform_axes(rho, height, h)
    good_pose = both(good[0], both(u[0] + v[1] >= -ONE_MODE, least(*length) > 0.0))
    return kernel(
        "direct_end",
        {
            "length": length,
            "begin": begin,
            "numbers": numbers,
            "direction": direction,
            "progress": progress,
            "good": good,
        },
        {
            "pose": placement.pose_of_legs(there, direction, g, h),
            "reached": (done >= 1.0,),
            "check": _check(good_pose),
        },
    )


def _direct(most: int) -> str:
    """Return the C that follows lengths in so many steps."""
    return f"""
    REAL begin[3], start[6], good[1], direction[6], progress[3], most[1];
    most[0] = CONST({most});
    direct_start(near, numbers, begin, start, good);
    {FOLLOW.name}(begin, start, length, numbers, numbers + 2, most, direction, progress);
    direct_end(length, begin, numbers, direction, progress, good, pose, reached, check);
"""


_OF_DIRECT = (("length", 3), ("near", 3), ("numbers", 3))
_CALLED = ("direct_start", FOLLOW.name, "direct_end")
#: The pose of leg lengths that continues another; numbers are g, h and the limit of the condition.
DIRECT = Routine(
    "forward_kinematics",
    _OF_DIRECT,
    (("pose", 3), ("check", 2)),
    f"""
    REAL reached[1];
    {_direct(FEW_STEPS).strip()}
    check[0] = SELECT(reached[0], check[0], CONST(2.0));
""",
    _CALLED,
)
#: The same in many steps; and whether the lengths are reached, or the pose is the last before that.
FOLLOWED = Routine(
    "followed",
    _OF_DIRECT,
    (("pose", 3), ("reached", 1), ("check", 2)),
    _direct(MOST_STEPS),
    _CALLED,
)


def robot_unit() -> Unit:
    """Return all functions as one unit."""
    kernels = (inverse_kernel(), forces_kernel(), *follow_kernels(), start_kernel(), end_kernel())
    entries = tuple(ARGUMENTS)
    return Unit("rps", kernels, (FOLLOW, DIRECT, FOLLOWED), entries, frozenset(entries))
