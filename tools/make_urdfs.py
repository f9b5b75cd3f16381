"""Write the URDF files of the well-known mechanisms in urdf/ (the 3-RPS has its own generator).

    python tools/make_urdfs.py            writes the files
    python tools/make_urdfs.py --check    only says which differ from what would be written

The sizes and masses stand here, once, beside what they mean; SI units. A file holds the open tree;
the .yaml file of the same name says how its loops close. Every body has a plain shape to look at.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from urdf_linkages import LINKAGES
from urdf_parallel import PARALLEL
from urdf_text import ALONG_X, ALONG_Y, ORIGIN, TURN, Numbers, joint, link, polar, robot, shape, tip

FOLDER = Path(__file__).resolve().parents[1] / "urdf"

# Planar mechanisms, in the x-z plane --------------------------------------------------------------


def bar(name: str, length: float, mass: float, com: Numbers, inertia: Numbers, colour: str) -> str:
    """Return a bar along x with a hub at either end; its centre of mass is off its line."""
    hub = (0.016, 0.05)
    return link(
        name,
        shape("cylinder", (0.01, length), colour, (length / 2, 0.0, 0.0), ALONG_X),
        shape("cylinder", hub, "brass", ORIGIN, ALONG_Y),
        shape("cylinder", hub, "brass", (length, 0.0, 0.0), ALONG_Y),
        mass=mass,
        com=com,
        inertia=inertia,
    )


def ground(length: float) -> str:
    """Return the base of a planar mechanism: a rail below the x axis."""
    rail = (length, 0.08, 0.02)
    return link("base", shape("box", rail, "dark", (length / 2, 0.0, -0.04)))


def four_bar() -> str:
    """Return a crank-rocker: 0.2 + 0.5 < 0.45 + 0.4, so the crank turns all the way (Grashof)."""
    return robot(
        "four_bar",
        ground(0.45),
        bar("crank", 0.2, 1.1, (0.08, 0.0, 0.03), (0.004, 0.02, 0.018), "red"),
        bar("coupler", 0.5, 2.3, (0.3, 0.0, -0.05), (0.012, 0.07, 0.066), "steel"),
        bar("rocker", 0.4, 0.9, (0.15, 0.0, 0.02), (0.006, 0.05, 0.048), "blue"),
        joint("revolute", "base", "crank"),
        joint("revolute", "crank", "coupler", (0.2, 0.0, 0.0)),
        joint("revolute", "base", "rocker", (0.45, 0.0, 0.0)),
        tip("coupler", "coupler_tip", (0.5, 0.0, 0.0)),
        tip("rocker", "rocker_tip", (0.4, 0.0, 0.0)),
    )


FIVE_BAR_EFFORT, FIVE_BAR_SPEED = 40.0, 15.0


def five_bar() -> str:
    """Return a five-bar, both of its base joints driven, with no two bars alike."""
    return robot(
        "five_bar",
        ground(0.4),
        bar("left", 0.3, 1.0, (0.14, 0.0, 0.01), (0.004, 0.02, 0.019), "red"),
        bar("left_arm", 0.42, 0.8, (0.2, 0.0, -0.02), (0.003, 0.025, 0.024), "steel"),
        bar("right", 0.28, 1.1, (0.12, 0.0, 0.02), (0.005, 0.03, 0.028), "red"),
        bar("right_arm", 0.45, 0.7, (0.21, 0.0, 0.015), (0.002, 0.015, 0.014), "blue"),
        joint("revolute", "base", "left", effort=FIVE_BAR_EFFORT, speed=FIVE_BAR_SPEED),
        joint("revolute", "left", "left_arm", (0.3, 0.0, 0.0)),
        joint(
            "revolute",
            "base",
            "right",
            (0.4, 0.0, 0.0),
            effort=FIVE_BAR_EFFORT,
            speed=FIVE_BAR_SPEED,
        ),
        joint("revolute", "right", "right_arm", (0.28, 0.0, 0.0)),
        tip("left_arm", "left_tip", (0.42, 0.0, 0.0)),
        tip("right_arm", "right_tip", (0.45, 0.0, 0.0)),
    )


def slider_crank() -> str:
    """Return an offset slider-crank; the piston is a point mass at the coupler's tip.

    Its guide is a line along x at height 0.03.
    """
    piston = shape("cylinder", (0.024, 0.056), "blue", (0.0, 0.0, 0.0), ALONG_Y)
    rails = [shape("box", (0.34, 0.01, 0.03), "dark", (0.35, y, 0.03)) for y in (-0.034, 0.034)]
    return robot(
        "slider_crank",
        link("base", *rails),
        bar("crank", 0.1, 1.2, (0.03, 0.0, 0.01), (0.003, 0.008, 0.007), "red"),
        bar("coupler", 0.35, 0.9, (0.14, 0.0, -0.015), (0.002, 0.012, 0.011), "steel"),
        link("piston", piston, mass=0.6),
        joint("revolute", "base", "crank"),
        joint("revolute", "crank", "coupler", (0.1, 0.0, 0.0)),
        joint("fixed", "coupler", "piston", (0.35, 0.0, 0.0)),
        tip("base", "guide", (0.0, 0.0, 0.03)),
    )


# Delta --------------------------------------------------------------------------------------------

DELTA = (1, 2, 3)
DELTA_BASE, DELTA_ARM, DELTA_ROD, DELTA_PLATFORM = 0.2, 0.25, 0.6, 0.06
#: Half of the width of a parallelogram.
DELTA_HALF = 0.04
DELTA_ARM_LIMITS = (-1.2, 1.5)


def delta_arm(i: int) -> str:
    """Return arm i: it turns about its own y, down from the horizontal; x runs along it."""
    name, angle = f"arm_{i}", (i - 1) * TURN / 3
    body = link(
        name,
        shape("cylinder", (0.02, DELTA_ARM), "blue", (DELTA_ARM / 2, 0.0, 0.0), ALONG_X),
        shape("cylinder", (0.012, 2 * DELTA_HALF), "brass", (DELTA_ARM, 0.0, 0.0), ALONG_Y),
        mass=0.8,
        com=(0.1, 0.004, -0.006),
        inertia=(0.0008, 0.006, 0.0062),
    )
    place, turn = polar(DELTA_BASE, angle), (0.0, 0.0, angle)
    return body + joint(
        "revolute",
        "base",
        name,
        place,
        turn,
        (0.0, 1.0, 0.0),
        DELTA_ARM_LIMITS,
        effort=60.0,
        speed=15.0,
    )


def delta_core() -> str:
    """Return base, arms, the free platform, and the ball frames on the platform."""
    parts = [
        link("base", shape("cylinder", (1.1 * DELTA_BASE, 0.03), "dark", (0.0, 0.0, 0.04))),
        link(
            "platform",
            shape("cylinder", (DELTA_PLATFORM, 0.015), "red"),
            mass=0.7,
            com=ORIGIN,
            inertia=(0.0011, 0.0012, 0.002),
        ),
        joint("floating", "base", "platform"),
    ]
    for i in DELTA:
        parts.append(delta_arm(i))
        x, y, _ = polar(DELTA_PLATFORM, (i - 1) * TURN / 3)
        ux, uy, _ = polar(DELTA_HALF, (i - 1) * TURN / 3 + TURN / 4)
        for side, sign in (("left", 1), ("right", -1)):
            ball = (x + sign * ux, y + sign * uy, 0.0)
            parts.append(tip("platform", f"platform_ball_{i}_{side}", ball))
    return "".join(parts)


def delta() -> str:
    """Return a Delta whose rods have no mass and no bodies: two-ball rods, closed by distances."""
    elbows = [
        tip(f"arm_{i}", f"elbow_{i}_{side}", (DELTA_ARM, sign * DELTA_HALF, 0.0))
        for i in DELTA
        for side, sign in (("left", 1), ("right", -1))
    ]
    return robot("delta", delta_core(), *elbows)


def delta_rods() -> str:
    """Return a Delta whose six rods are bodies, each on a universal joint at its elbow."""
    parts = []
    for i in DELTA:
        for side, sign in (("left", 1), ("right", -1)):
            rod = f"rod_{i}_{side}"
            bar_shape = shape(
                "cylinder", (0.006, DELTA_ROD), "steel", (DELTA_ROD / 2, 0.0, 0.0), ALONG_X
            )
            parts += [
                link(
                    f"{rod}_cross",
                    shape("sphere", (0.01,), "brass"),
                    mass=0.02,
                    inertia=(0.000004, 0.000003, 0.000005),
                ),
                link(
                    rod,
                    bar_shape,
                    mass=0.15,
                    com=(0.28, 0.0, 0.0),
                    inertia=(0.00002, 0.0045, 0.0045),
                ),
                joint(
                    "revolute",
                    f"arm_{i}",
                    f"{rod}_cross",
                    (DELTA_ARM, sign * DELTA_HALF, 0.0),
                    axis=(0.0, 1.0, 0.0),
                ),
                joint("revolute", f"{rod}_cross", rod, axis=(0.0, 0.0, 1.0)),
                tip(rod, f"{rod}_tip", (DELTA_ROD, 0.0, 0.0)),
            ]
    return robot("delta_rods", delta_core(), *parts)


# Stewart-Gough ------------------------------------------------------------------------------------

STEWART_BASE, STEWART_PLATFORM = 0.5, 0.3
#: Legs come in pairs: at 0, 120, 240 degrees on the base, at 60, 180, 300 on the platform, so far
#: to either side (rad).
STEWART_BASE_HALF, STEWART_PLATFORM_HALF = 0.2, 0.28
STEWART_STROKE = (0.45, 0.95)


def stewart_angles(leg: int) -> tuple[float, float]:
    """Return the directions (rad) of a leg's (1 to 6) universal joint and of its ball."""
    pair, side = divmod(leg - 1, 2)
    sign = 1 if side == 0 else -1
    centre = pair * TURN / 3
    return (
        centre + sign * STEWART_BASE_HALF,
        centre + sign * (TURN / 6 - STEWART_PLATFORM_HALF),
    )


def stewart_leg(leg: int) -> str:
    """Return a leg: cross about x (radial), cylinder about y, rod out along z to its ball."""
    on_base, _ = stewart_angles(leg)
    cross, cylinder, rod = (f"leg_{leg}_{part}" for part in ("cross", "cylinder", "rod"))
    x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    turn, tilt = (0.0, 0.0, on_base), (-1.5, 1.5)
    return "".join(
        [
            link(
                cross,
                shape("sphere", (0.025,), "brass"),
                mass=0.3,
                inertia=(0.0002, 0.00015, 0.0003),
            ),
            link(
                cylinder,
                shape("cylinder", (0.022, 0.4), "dark", (0.0, 0.0, 0.22)),
                mass=3.0,
                com=(0.01, -0.015, 0.17),
                inertia=(0.045, 0.047, 0.004, 0.001, -0.002, 0.0015),
            ),
            link(
                rod,
                shape("cylinder", (0.012, 0.42), "steel", (0.0, 0.0, -0.21)),
                shape("sphere", (0.02,), "brass"),
                mass=1.2,
                com=(0.002, 0.003, -0.19),
                inertia=(0.02, 0.0203, 0.0006, 0.0002, 0.0004, -0.0003),
            ),
            joint("revolute", "base", cross, polar(STEWART_BASE, on_base), turn, x, tilt),
            joint("revolute", cross, cylinder, axis=y, limits=tilt),
            joint(
                "prismatic",
                cylinder,
                rod,
                axis=(0.0, 0.0, 1.0),
                limits=STEWART_STROKE,
                effort=2000.0,
                speed=1.0,
            ),
            tip(rod, f"leg_{leg}_ball", ORIGIN),
        ]
    )


def stewart() -> str:
    """Return a Stewart-Gough platform: six legs, universal joint, prismatic drive, ball."""
    legs = range(1, 7)
    balls = [
        tip("platform", f"platform_ball_{i}", polar(STEWART_PLATFORM, stewart_angles(i)[1]))
        for i in legs
    ]
    return robot(
        "stewart",
        link("base", shape("cylinder", (0.58, 0.03), "dark", (0.0, 0.0, -0.05))),
        link(
            "platform",
            shape("cylinder", (0.32, 0.03), "blue", (0.0, 0.0, 0.03)),
            mass=12.0,
            com=(0.02, -0.01, 0.05),
            inertia=(0.4, 0.45, 0.7, 0.02, -0.03, 0.01),
        ),
        joint("floating", "base", "platform"),
        *balls,
        *(stewart_leg(i) for i in legs),
    )


FILES = {
    "four_bar": four_bar,
    "five_bar": five_bar,
    "slider_crank": slider_crank,
    "delta": delta,
    "delta_rods": delta_rods,
    "stewart": stewart,
    **LINKAGES,
    **PARALLEL,
}


def main(arguments: Sequence[str]) -> int:
    """Write, or check, every file; return the exit status."""
    stale = 0
    for name, make in FILES.items():
        path, wanted = FOLDER / f"{name}.urdf", make()
        if "--check" not in arguments:
            path.write_text(wanted, "utf-8")
        elif not path.exists() or path.read_text("utf-8") != wanted:
            print(f"{path.name} is not what tools/make_urdfs.py writes")
            stale += 1
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
