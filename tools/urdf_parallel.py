"""Parallel robots for tools/make_urdfs.py: rotary Stewart, linear Delta, planar 3-RRR.

World and link axes are parallel at zero angles but for turns about z, which stand in the joints'
origins.
"""

from __future__ import annotations

from urdf_linkages import X, Y, Z, rod
from urdf_text import ALONG_X, ORIGIN, TURN, joint, link, polar, robot, shape, tip

# Rotary Stewart, 6-RUS ----------------------------------------------------------------------------
# Sizes and masses are our own, those of a table of 0.4 m with servo drives.

RUS_BASE, RUS_CRANK, RUS_ROD, RUS_PLATFORM = 0.2, 0.08, 0.24, 0.15
#: Cranks come in pairs: at 0, 120, 240 degrees on the base, their balls next to 60, 180, 300 on the
#: platform; so far to either side (rad).
RUS_BASE_HALF, RUS_PLATFORM_HALF = 0.25, 0.2
RUS_CRANK_LIMITS, RUS_TILT_LIMITS = (-1.2, 1.2), (-1.4, 1.4)
RUS_EFFORT, RUS_SPEED = 6.0, 12.0


def rus_angles(leg: int) -> tuple[float, float, float]:
    """Return the directions (rad) of a leg's (1 to 6) drive, of its crank at zero, of its ball.

    The cranks of a pair turn in one vertical plane, tangential between them, and point apart.
    """
    pair, side = divmod(leg - 1, 2)
    sign = 1 if side == 0 else -1
    centre = pair * TURN / 3
    return (
        centre + sign * RUS_BASE_HALF,
        centre + sign * TURN / 4,
        centre + sign * (TURN / 6 - RUS_PLATFORM_HALF),
    )


def rus_leg(leg: int) -> str:
    """Return a leg: crank up about -y, cross about y, rod about x, up along z to its ball."""
    place, turn, _ = rus_angles(leg)
    crank, cross, bar = (f"{part}_{leg}" for part in ("crank", "cross", "rod"))
    small = (0.000002, 0.0000015, 0.000003)
    return "".join(
        [
            rod(crank, (RUS_CRANK, 0.0, 0.0), 0.1, 0.01, "red"),
            link(cross, shape("sphere", (0.008,), "brass"), mass=0.015, inertia=small),
            rod(bar, (0.0, 0.0, RUS_ROD), 0.08, 0.005),
            joint(
                "revolute",
                "base",
                crank,
                polar(RUS_BASE, place),
                (0.0, 0.0, turn),
                limits=RUS_CRANK_LIMITS,
                effort=RUS_EFFORT,
                speed=RUS_SPEED,
            ),
            joint("revolute", crank, cross, (RUS_CRANK, 0.0, 0.0), axis=Y),
            joint("revolute", cross, bar, axis=X, limits=RUS_TILT_LIMITS),
            tip(bar, f"{bar}_tip", (0.0, 0.0, RUS_ROD)),
        ]
    )


def rotary_stewart() -> str:
    """Return a platform on six rods, each on a universal joint at a crank, with a ball above."""
    legs = range(1, 7)
    return robot(
        "rotary_stewart",
        link("base", shape("cylinder", (0.24, 0.02), "dark", (0.0, 0.0, -0.1))),
        link(
            "platform",
            shape("cylinder", (RUS_PLATFORM, 0.012), "blue"),
            mass=2.0,
            com=(0.006, -0.004, 0.02),
            inertia=(0.012, 0.0125, 0.022, 0.0002, -0.0003, 0.0001),
        ),
        joint("floating", "base", "platform"),
        *(
            tip("platform", f"platform_ball_{i}", polar(RUS_PLATFORM, rus_angles(i)[2]))
            for i in legs
        ),
        *(rus_leg(i) for i in legs),
    )


# Linear Delta -------------------------------------------------------------------------------------
# Sizes like those of the Kossel Mini printer: rods of 215 mm, 44 mm apart, on upright rails.

RAIL_RADIUS, RAIL_ROD, RAIL_PLATFORM = 0.125, 0.215, 0.02
#: Half of the width of a parallelogram.
RAIL_HALF = 0.022
RAIL_STROKE = (0.16, 0.5)
RAIL_EFFORT, RAIL_SPEED = 60.0, 1.0


def linear_delta() -> str:
    """Return a Delta driven by carriages on upright rails; its rods are closed by distances.

    A pair of rods, 24 g, counts by half to its carriage (172 g with it) and by half to the platform
    (136 g with three halves).
    """
    rails = []
    for i in (1, 2, 3):
        x, y, z = polar(RAIL_RADIUS + 0.03, (i - 1) * TURN / 3, 0.25)
        rails.append(shape("cylinder", (0.01, 0.6), "dark", (x, y, z)))
    parts = [
        link("base", shape("cylinder", (0.18, 0.02), "dark", (0.0, 0.0, -0.05)), *rails),
        link(
            "platform",
            shape("cylinder", (0.03, 0.008), "blue"),
            mass=0.136,
            com=ORIGIN,
            inertia=(0.00006, 0.00006, 0.00011),
        ),
        joint("floating", "base", "platform"),
    ]
    for i in (1, 2, 3):
        angle, carriage = (i - 1) * TURN / 3, f"carriage_{i}"
        parts += [
            link(
                carriage,
                shape("box", (0.02, 0.06, 0.04), "red", (0.015, 0.0, 0.0)),
                mass=0.172,
                com=(0.012, 0.001, 0.004),
                inertia=(0.00008, 0.00004, 0.00007),
            ),
            joint(
                "prismatic",
                "base",
                carriage,
                polar(RAIL_RADIUS, angle),
                (0.0, 0.0, angle),
                Z,
                RAIL_STROKE,
                effort=RAIL_EFFORT,
                speed=RAIL_SPEED,
            ),
        ]
        x, y, _ = polar(RAIL_PLATFORM, angle)
        ux, uy, _ = polar(RAIL_HALF, angle + TURN / 4)
        for side, sign in (("left", 1), ("right", -1)):
            parts += [
                tip(carriage, f"carriage_ball_{i}_{side}", (0.0, sign * RAIL_HALF, 0.0)),
                tip("platform", f"platform_ball_{i}_{side}", (x + sign * ux, y + sign * uy, 0.0)),
            ]
    return robot("linear_delta", *parts)


# Planar 3-RRR -------------------------------------------------------------------------------------
# Sizes and masses are our own, in the proportions of laboratory machines.

RRR_BASE, RRR_ARM, RRR_FOREARM, RRR_PLATFORM = 0.3, 0.2, 0.25, 0.1
RRR_ARM_LIMITS, RRR_EFFORT, RRR_SPEED = (-3.1, 3.1), 12.0, 15.0


def flat_bar(name: str, length: float, mass: float, colour: str) -> str:
    """Return a bar along x that lies in the plane; its centre of mass is off its line."""
    across = mass * length**2 / 12
    return link(
        name,
        shape("cylinder", (0.01, length), colour, (length / 2, 0.0, 0.0), ALONG_X),
        shape("cylinder", (0.016, 0.03), "brass"),
        mass=mass,
        com=(round(0.45 * length, 6), 0.003, 0.0),
        inertia=[round(x, 9) for x in (mass * 0.01**2 / 2, across, across)],
    )


def planar_rrr() -> str:
    """Return a platform moved in the horizontal plane by three driven arms with forearms.

    Forearm 1 carries the platform; its frame is parallel to the world's where its angle is zero,
    and its origin is the pin of forearm 1.
    """
    centre = (-RRR_PLATFORM, 0.0, 0.0)
    body = shape("cylinder", (RRR_PLATFORM, 0.01), "blue", centre)
    parts = [
        link("base", shape("cylinder", (0.33, 0.01), "dark", (0.0, 0.0, -0.05))),
    ]
    for i in (1, 2, 3):
        angle, arm, forearm = (i - 1) * TURN / 3, f"arm_{i}", f"forearm_{i}"
        parts += [
            flat_bar(arm, RRR_ARM, 0.5, "red"),
            flat_bar(forearm, RRR_FOREARM, 0.35, "steel"),
            joint(
                "revolute",
                "base",
                arm,
                polar(RRR_BASE, angle),
                (0.0, 0.0, angle),
                Z,
                RRR_ARM_LIMITS,
                effort=RRR_EFFORT,
                speed=RRR_SPEED,
            ),
            joint("revolute", arm, forearm, (RRR_ARM, 0.0, 0.0), axis=Z),
        ]
    parts += [
        link("platform", body, mass=0.8, com=(-0.095, 0.004, 0.0), inertia=(0.002, 0.002, 0.004)),
        joint("revolute", "forearm_1", "platform", (RRR_FOREARM, 0.0, 0.0), axis=Z),
        tip("platform", "platform_centre", centre),
    ]
    for i in (2, 3):
        x, y, _ = polar(RRR_PLATFORM, (i - 1) * TURN / 3)
        parts += [
            tip(f"forearm_{i}", f"forearm_{i}_tip", (RRR_FOREARM, 0.0, 0.0)),
            tip("platform", f"platform_pin_{i}", (x - RRR_PLATFORM, y, 0.0)),
        ]
    return robot("planar_rrr", *parts)


PARALLEL = {
    "rotary_stewart": rotary_stewart,
    "linear_delta": linear_delta,
    "planar_rrr": planar_rrr,
}
