"""URDF as text: links, joints, shapes and whole files, for tools/make_urdfs.py. SI units.

Not through yourdfpy, as the file of the 3-RPS: it keeps placements as matrices, so that angles are
computed back (not to the last digit, and not uniquely at a pitch of 90 degrees), and it writes no
whole numbers and no comment. These files are made to be read.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

COLOURS = {
    "steel": "0.62 0.65 0.70 1",
    "dark": "0.23 0.26 0.31 1",
    "blue": "0.16 0.39 0.68 1",
    "brass": "0.83 0.62 0.22 1",
    "red": "0.80 0.20 0.16 1",
}
TURN = 2 * math.pi
#: What a URDF says for an effort (N, N m) or a speed (m/s, rad/s) that has no limit.
UNLIMITED = 1e6

Numbers = Sequence[float]
ORIGIN = (0.0, 0.0, 0.0)
#: Turns a URDF cylinder, which lies along z, into one along x, or y.
ALONG_X, ALONG_Y = (0.0, math.pi / 2, 0.0), (math.pi / 2, 0.0, 0.0)
#: Joints of the planar mechanisms turn about -y: x towards z.
PLANE_AXIS = (0.0, -1.0, 0.0)


def text(numbers: Numbers) -> str:
    """Return numbers with all their digits, but without a point where they are whole."""
    return " ".join(
        str(int(x)) if float(x).is_integer() and abs(x) < 1e6 else repr(float(x)) for x in numbers
    )


def polar(radius: float, angle: float, z: float = 0.0) -> tuple[float, float, float]:
    """Return a point at an angle (rad) about z."""
    return radius * math.cos(angle), radius * math.sin(angle), z


def origin(xyz: Numbers, rpy: Numbers = ORIGIN) -> str:
    """Return an origin element."""
    turn = f' rpy="{text(rpy)}"' if any(rpy) else ""
    return f'<origin xyz="{text(xyz)}"{turn}/>'


def shape(
    kind: str, size: Numbers, colour: str, xyz: Numbers = ORIGIN, rpy: Numbers = ORIGIN
) -> str:
    """Return a visual: a sphere (radius), a cylinder (radius, length) or a box (x, y, z)."""
    names = {"sphere": ("radius",), "cylinder": ("radius", "length")}
    if kind == "box":
        sizes = f'size="{text(size)}"'
    else:
        sizes = " ".join(f'{n}="{text([x])}"' for n, x in zip(names[kind], size, strict=True))
    return (
        f"    <visual>\n      {origin(xyz, rpy)}\n      <geometry><{kind} {sizes}/></geometry>\n"
        f'      <material name="{colour}"/>\n    </visual>\n'
    )


def link(
    name: str,
    *shapes: str,
    mass: float = 0.0,
    com: Numbers = ORIGIN,
    inertia: Numbers = (0.0, 0.0, 0.0),
) -> str:
    """Return a link; `inertia` is (xx, yy, zz) or (xx, yy, zz, xy, xz, yz) about `com`."""
    inside = "".join(shapes)
    if mass:
        names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        full = (*inertia, 0.0, 0.0, 0.0)[:6]
        moments = " ".join(f'{n}="{text([x])}"' for n, x in zip(names, full, strict=True))
        inside = (
            f'    <inertial>\n      {origin(com)}\n      <mass value="{text([mass])}"/>\n'
            f"      <inertia {moments}/>\n    </inertial>\n{inside}"
        )
    return (
        f'  <link name="{name}">\n{inside}  </link>\n' if inside else f'  <link name="{name}"/>\n'
    )


def joint(
    kind: str,
    parent: str,
    child: str,
    xyz: Numbers = ORIGIN,
    rpy: Numbers = ORIGIN,
    axis: Numbers = PLANE_AXIS,
    limits: tuple[float, float] = (-TURN, TURN),
    effort: float = UNLIMITED,
    speed: float = UNLIMITED,
) -> str:
    """Return the joint that carries a link; its name is the link's with ``_joint`` after it."""
    moving = ""
    if kind in ("revolute", "prismatic"):
        moving = (
            f'    <axis xyz="{text(axis)}"/>\n'
            f'    <limit lower="{text(limits[:1])}" upper="{text(limits[1:])}" '
            f'effort="{text([effort])}" velocity="{text([speed])}"/>\n'
        )
    return (
        f'  <joint name="{child}_joint" type="{kind}">\n    <parent link="{parent}"/>\n'
        f'    <child link="{child}"/>\n    {origin(xyz, rpy)}\n{moving}  </joint>\n'
    )


def robot(name: str, *parts: str) -> str:
    """Return a whole file."""
    paint = "".join(
        f'  <material name="{colour}"><color rgba="{rgba}"/></material>\n'
        for colour, rgba in COLOURS.items()
    )
    return (
        '<?xml version="1.0"?>\n<!-- Written by tools/make_urdfs.py: change it there. -->\n'
        f'<robot name="{name}">\n{paint}{"".join(parts)}</robot>\n'
    )


def tip(parent: str, name: str, xyz: Numbers) -> str:
    """Return a frame without a body."""
    return link(name) + joint("fixed", parent, name, xyz)
