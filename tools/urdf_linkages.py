"""Closed chains that people build, for tools/make_urdfs.py: legs, ankle, gripper and others.

Sizes and masses are our own. World and link axes are parallel at zero angles; x points forward, y
to the left, z up. A ball joint is three revolute joints without mass between them, which the
description merges.
"""

from __future__ import annotations

import math

from urdf_text import ALONG_X, ALONG_Y, ORIGIN, TURN, Numbers, joint, link, polar, robot, shape, tip

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)

Place = tuple[float, float, float]


def minus(a: Numbers, b: Numbers) -> Place:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def rod(
    name: str,
    along: Numbers,
    mass: float,
    radius: float = 0.01,
    colour: str = "steel",
    off: float = 0.25,
) -> str:
    """Return a round rod from its origin to a point; its centre is `off` radii off its line."""
    length = math.hypot(*along)
    middle = [x / 2 for x in along]
    moment = mass * radius**2 / 2
    across = mass * (length**2 / 12 + radius**2 / 4)
    e = [x / length for x in along]
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    inertia = [across * (i == j) + (moment - across) * e[i] * e[j] for i, j in pairs]
    pitch, yaw = math.acos(max(-1.0, min(1.0, e[2]))), math.atan2(e[1], e[0])
    return link(
        name,
        shape("cylinder", (radius, length), colour, middle, (0.0, pitch, yaw)),
        shape("sphere", (1.3 * radius,), "brass"),
        mass=mass,
        com=(middle[0], middle[1], middle[2] + off * radius),
        inertia=[round(x, 9) for x in inertia],
    )


def motor(name: str, colour: str = "red") -> str:
    """Return a gear or pulley about y."""
    disc = shape("cylinder", (0.03, 0.015), colour, ORIGIN, ALONG_Y)
    return link(name, disc, mass=0.2, inertia=(0.00005, 0.00009, 0.00005))


def ball(parent: str, name: str, place: Numbers) -> str:
    """Return the three joints of a ball: name_a_joint, name_b_joint and name_joint."""
    first, second = f"{name}_a", f"{name}_b"
    return "".join(
        [
            link(first),
            link(second),
            joint("revolute", parent, first, place, axis=X),
            joint("revolute", first, second, axis=Y),
            joint("revolute", second, name, axis=Z),
        ]
    )


# Parallel ankle -----------------------------------------------------------------------------------

ANKLE_CRANK = 0.04
#: Of the cranks' axes above the ankle; the motors sit one above the other.
ANKLE_HEIGHTS = {"left": 0.13, "right": 0.21}
ANKLE_RODS = {"left": 0.12, "right": 0.2}
ANKLE_CRANK_LIMITS = (-1.4, 1.4)
ANKLE_HALF, ANKLE_BACK, ANKLE_UP = 0.035, -0.045, 0.005


def ankle() -> str:
    """Return a foot on a universal joint (pitch, then roll), moved by two cranks and rods (2-RSU).

    A rod stands on a universal joint at the foot; a ball joins its other end to the crank.
    """
    foot = (shape("box", (0.2, 0.08, 0.02), "dark", (0.03, 0.0, -0.05)),)
    parts = [
        link("shin", shape("cylinder", (0.012, 0.3), "steel", (0.0, 0.0, 0.17))),
        link(
            "cross",
            shape("sphere", (0.015,), "brass"),
            mass=0.05,
            inertia=(0.000005, 0.000004, 0.000006),
        ),
        link("foot", *foot, mass=0.9, com=(0.03, 0.002, -0.04), inertia=(0.0006, 0.0035, 0.0037)),
        joint("revolute", "shin", "cross", axis=Y, limits=(-0.8, 0.8)),
        joint("revolute", "cross", "foot", axis=X, limits=(-0.4, 0.4)),
    ]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        y, crank, bar = sign * ANKLE_HALF, f"{side}_crank", f"{side}_rod"
        length = ANKLE_RODS[side]
        parts += [
            rod(crank, (-ANKLE_CRANK, 0.0, 0.0), 0.08, colour="red"),
            joint(
                "revolute",
                "shin",
                crank,
                (0.0, y, ANKLE_HEIGHTS[side]),
                axis=Y,
                limits=ANKLE_CRANK_LIMITS,
                effort=40.0,
                speed=20.0,
            ),
            tip(crank, f"{crank}_tip", (-ANKLE_CRANK, 0.0, 0.0)),
            link(
                f"{bar}_cross",
                shape("sphere", (0.006,), "brass"),
                mass=0.01,
                inertia=(0.000001, 0.0000008, 0.0000009),
            ),
            rod(bar, (0.0, 0.0, length), 0.06, 0.005),
            joint("revolute", "foot", f"{bar}_cross", (ANKLE_BACK, y, ANKLE_UP), axis=Y),
            joint("revolute", f"{bar}_cross", bar, axis=X),
            tip(bar, f"{bar}_tip", (0.0, 0.0, length)),
        ]
    return robot("ankle", *parts)


# Legs of a bird -----------------------------------------------------------------------------------

HIP_HALF = 0.12
"""Half of the distance of the hips, m; the places below are of the left leg."""
KNEE: Place = (0.15, 0.0, -0.2)  # from the hip's pitch axis, as all places but the next two
SHIN: Place = (-0.2, 0.0, -0.3)  # the hock, from the knee
TARSUS: Place = (0.07, 0.0, -0.36)  # the foot's joint, from the hock
ACHILLES: Place = (0.07, 0.04, -0.14)  # on the thigh
HEEL: Place = (-0.09, 0.03, 0.05)  # on the tarsus, from the hock
CRANK: Place = (0.02, 0.0, -0.06)  # on the tarsus, from the hock
CRANK_ARM: Place = (-0.05, 0.02, 0.0)
FOOT_BACK: Place = (-0.05, 0.025, 0.01)  # on the foot, from its joint
SOLE = {"toe": (0.09, 0.0, -0.03), "heel": (-0.08, 0.0, -0.03)}


def legged(name: str, sides: dict[str, float], pelvis: float) -> str:
    """Return a pelvis with legs like Cassie's: hip roll, yaw, pitch, knee, and foot are driven.

    A rod from the thigh to the heel (achilles) bends the hock with the knee; another, along the
    shank, takes the foot's crank to the foot. Each has a ball at both ends, so that it can spin.
    """
    body = link(
        "pelvis",
        shape("box", (0.15, 0.22, 0.12), "dark", (0.0, 0.0, 0.05)),
        mass=pelvis,
        com=(0.02, 0.0, 0.06),
        inertia=(0.07, 0.05, 0.09, 0.0, 0.002, 0.0),
    )
    return robot(name, body, *(bird_leg(side, sign) for side, sign in sides.items()))


def bird_leg(side: str, sign: float) -> str:
    """Return a leg, mirrored in y where sign is -1; its loops are closed at zero angles."""

    def at(place: Numbers) -> Place:
        return place[0], sign * place[1], place[2]

    def named(name: str) -> str:
        return f"{side}_{name}"

    hock = (KNEE[0] + SHIN[0], 0.0, KNEE[2] + SHIN[2])
    achilles = minus([hock[i] + HEEL[i] for i in range(3)], ACHILLES)
    crank_tip = [CRANK[i] + CRANK_ARM[i] for i in range(3)]
    shank = minus([TARSUS[i] + FOOT_BACK[i] for i in range(3)], crank_tip)
    foot = (shape("box", (0.17, 0.04, 0.015), "dark", (0.005, 0.0, -0.0225)),)
    inertia = (0.0001, 0.0008, 0.0008)
    links = [
        rod(named("hip_roll"), (-0.06, 0.0, 0.0), 1.4, 0.04, "dark"),
        rod(named("hip_yaw"), (0.0, 0.0, -0.06), 1.2, 0.04, "blue"),
        rod(named("thigh"), KNEE, 4.2, 0.04, "dark"),
        rod(named("shin"), SHIN, 0.9, 0.015),
        rod(named("tarsus"), TARSUS, 1.1, 0.015, "blue"),
        rod(named("crank"), at(CRANK_ARM), 0.1, 0.008, "red"),
        link(named("foot"), *foot, mass=0.25, com=at((0.01, 0.002, -0.01)), inertia=inertia),
        rod(named("achilles"), at(achilles), 0.2, 0.006, off=0.0),
        rod(named("shank_rod"), at(shank), 0.1, 0.005, off=0.0),
    ]
    parent = "pelvis"
    joints = []
    for name, axis, place, limits, effort in (
        ("hip_roll", X, (0.0, HIP_HALF, 0.0), (-0.4, 0.4), 110.0),
        ("hip_yaw", Z, (0.0, 0.0, -0.07), (-0.4, 0.4), 110.0),
        ("thigh", Y, (0.0, 0.0, -0.07), (-1.2, 0.9), 200.0),
        ("shin", Y, KNEE, (-1.0, 1.0), 200.0),
        ("tarsus", Y, SHIN, (-1.2, 1.2), None),
    ):
        kind = {} if effort is None else {"effort": effort}
        joints.append(
            joint("revolute", parent, named(name), at(place), axis=axis, limits=limits, **kind)
        )
        parent = named(name)
    joints += [
        joint("revolute", named("tarsus"), named("crank"), at(CRANK), axis=Y, effort=50.0),
        joint("revolute", named("tarsus"), named("foot"), at(TARSUS), axis=Y, limits=(-1.2, 1.2)),
        ball(named("thigh"), named("achilles"), at(ACHILLES)),
        ball(named("crank"), named("shank_rod"), at(CRANK_ARM)),
        tip(named("achilles"), named("achilles_tip"), at(achilles)),
        tip(named("tarsus"), named("heel_ball"), at(HEEL)),
        tip(named("shank_rod"), named("shank_rod_tip"), at(shank)),
        tip(named("foot"), named("foot_ball"), at(FOOT_BACK)),
        *(tip(named("foot"), named(name), at(place)) for name, place in SOLE.items()),
    ]
    return "".join([*links, *joints])


def cassie_leg() -> str:
    """Return one leg and a part of the pelvis."""
    return legged("cassie_leg", {"left": 1.0}, 5.0)


def cassie_biped() -> str:
    """Return two legs and the pelvis."""
    return legged("cassie_biped", {"left": 1.0, "right": -1.0}, 10.0)


# Gripper ------------------------------------------------------------------------------------------

GRIPPER = {
    "driver": ((0.03, 0.0, 0.05), (0.035, 0.0, 0.005)),
    "spring": ((0.013, 0.0, 0.062), (0.037, 0.0, 0.043)),
    "coupler": ((0.035, 0.0, 0.005), (0.006, 0.0, 0.045)),
    "follower": ((0.037, 0.0, 0.043), (0.021, 0.0, -0.005)),
}
"""Of the right finger: where each link's joint is on its parent, and the link's other end."""


def gripper() -> str:
    """Return two fingers of five bars each: driver, coupler; spring link, follower with its pad.

    A tendon's winch pulls both drivers; the spring links hold the pads parallel until they touch.
    """
    parts = [link("palm", shape("box", (0.09, 0.06, 0.05), "dark", (0.0, 0.0, 0.025)))]
    for side, sign in (("right", 1.0), ("left", -1.0)):
        for name, (place, end) in GRIPPER.items():
            parent = {"coupler": "driver", "follower": "spring"}.get(name)
            parts += [
                rod(f"{side}_{name}", (sign * end[0], 0.0, end[2]), 0.02, 0.006, "steel"),
                joint(
                    "revolute",
                    f"{side}_{parent}" if parent else "palm",
                    f"{side}_{name}",
                    (sign * place[0], 0.0, place[2]),
                    axis=(0.0, -sign, 0.0),
                    limits=(-1.0, 1.0),
                ),
            ]
            if name in ("coupler", "follower"):
                parts.append(
                    tip(f"{side}_{name}", f"{side}_{name}_end", (sign * end[0], 0.0, end[2]))
                )
    winch = link(
        "tendon",
        shape("box", (0.01, 0.01, 0.02), "red", (0.0, 0.0, 0.0)),
        mass=0.02,
        inertia=(0.000001, 0.000001, 0.0000005),
    )
    pull = joint("prismatic", "palm", "tendon", (0.0, 0.0, 0.01), axis=(0.0, 0.0, -1.0))
    return robot("gripper", *parts, winch, pull)


# Bevel differential -------------------------------------------------------------------------------


def differential() -> str:
    """Return a wrist: a bevel gear on the arm (roll) between two driven ones, on a yoke (pitch)."""
    yoke = shape("box", (0.03, 0.1, 0.02), "blue")
    arm = shape("cylinder", (0.015, 0.3), "steel", (0.15, 0.0, 0.0), ALONG_X)
    return robot(
        "differential",
        link("base", shape("box", (0.04, 0.2, 0.02), "dark", (-0.05, 0.0, 0.0))),
        link("yoke", yoke, mass=0.3, com=(0.005, 0.0, 0.002), inertia=(0.0003, 0.0001, 0.0003)),
        link("arm", arm, mass=1.1, com=(0.17, 0.004, 0.01), inertia=(0.0006, 0.009, 0.0091)),
        motor("left_gear"),
        motor("right_gear"),
        joint("revolute", "base", "yoke", axis=Y, limits=(-1.8, 1.8)),
        joint("revolute", "yoke", "arm", (0.04, 0.0, 0.0), axis=X),
        joint("revolute", "base", "left_gear", (0.0, 0.06, 0.0), axis=Y, effort=8.0),
        joint("revolute", "base", "right_gear", (0.0, -0.06, 0.0), axis=Y, effort=8.0),
        tip("arm", "hand", (0.3, 0.02, 0.0)),
    )


# 3-RRS --------------------------------------------------------------------------------------------

RRS_BASE, RRS_PROXIMAL, RRS_DISTAL, RRS_PLATFORM = 0.2, 0.15, 0.25, 0.12
RRS_ARM_LIMITS = (-0.8, 2.0)


def rrs() -> str:
    """Return a platform on three legs in vertical planes: driven shoulder, elbow, ball."""
    parts = [
        link("base", shape("cylinder", (1.1 * RRS_BASE, 0.02), "dark", (0.0, 0.0, -0.03))),
        link(
            "platform",
            shape("cylinder", (RRS_PLATFORM, 0.012), "blue"),
            mass=1.5,
            com=(0.004, -0.003, 0.01),
            inertia=(0.006, 0.0062, 0.011, 0.0001, -0.0002, 0.0001),
        ),
        joint("floating", "base", "platform"),
    ]
    for i in (1, 2, 3):
        angle = (i - 1) * TURN / 3
        arm, shank = f"arm_{i}", f"shank_{i}"
        parts += [
            rod(arm, (RRS_PROXIMAL, 0.0, 0.0), 0.4, 0.015, "red"),
            rod(shank, (RRS_DISTAL, 0.0, 0.0), 0.3, 0.01),
            joint(
                "revolute",
                "base",
                arm,
                polar(RRS_BASE, angle),
                (0.0, 0.0, angle),
                limits=RRS_ARM_LIMITS,
                effort=30.0,
                speed=10.0,
            ),
            joint("revolute", arm, shank, (RRS_PROXIMAL, 0.0, 0.0)),
            tip(shank, f"{shank}_ball", (RRS_DISTAL, 0.0, 0.0)),
            tip("platform", f"platform_ball_{i}", polar(RRS_PLATFORM, angle)),
        ]
    return robot("rrs", *parts)


# Minitaur's leg -----------------------------------------------------------------------------------

MINITAUR_UPPER, MINITAUR_LOWER, MINITAUR_TOE = 0.1, 0.2, 0.02


def minitaur_leg() -> str:
    """Return a five-bar whose two motors are coaxial; the toe is on the right lower link."""
    parts: list[str] = [link("hip", shape("cylinder", (0.04, 0.06), "dark", ORIGIN, ALONG_Y))]
    for side, extra in (("left", 0.0), ("right", MINITAUR_TOE)):
        upper, lower = f"{side}_upper", f"{side}_lower"
        parts += [
            rod(upper, (MINITAUR_UPPER, 0.0, 0.0), 0.12, 0.01, "red"),
            rod(lower, (MINITAUR_LOWER + extra, 0.0, 0.0), 0.1, 0.008),
            joint("revolute", "hip", upper, effort=10.0, speed=40.0),
            joint("revolute", upper, lower, (MINITAUR_UPPER, 0.0, 0.0)),
            tip(lower, f"{lower}_tip", (MINITAUR_LOWER, 0.0, 0.0)),
        ]
    toe = tip("right_lower", "toe", (MINITAUR_LOWER + MINITAUR_TOE, 0.0, 0.0))
    return robot("minitaur_leg", *parts, toe)


LINKAGES = {
    "ankle": ankle,
    "cassie_leg": cassie_leg,
    "cassie_biped": cassie_biped,
    "gripper": gripper,
    "differential": differential,
    "rrs": rrs,
    "minitaur_leg": minitaur_leg,
}
