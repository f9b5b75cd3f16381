"""Links and joints of the URDF of a 3-RPS, through yourdfpy's object model.

The tree has no loops, as URDF demands: the base carries three open legs (revolute, then prismatic)
and a free platform. Frames stand where the spherical joints belong, one on the rod and one on the
platform, for loop closures to join::

    base ─┬─ platform_free ── platform ── platform_ball_1, _2, _3
          └─ leg_i_revolute ── leg_i_cylinder ── leg_i_prismatic ── leg_i_rod ── leg_i_ball

A leg's frame lies in its revolute joint: x along the leg (at angle 0: towards the base's centre),
z up, and the joint turns about -y. The joint positions are then the paper's phi and d themselves.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
import yourdfpy
from lxml import etree
from yourdfpy import Box, Cylinder, Sphere

from rps_pin.arrays import Array
from rps_pin.rps.leg_frames import LEG_DIRECTIONS, LEGS, URDF_UNLIMITED, ball_frames
from rps_pin.rps.parameters import RPSParameters

_STEEL = ("steel", (0.58, 0.61, 0.66, 1.0))
_BRIGHT = ("bright", (0.84, 0.86, 0.89, 1.0))
_DARK = ("dark", (0.20, 0.23, 0.28, 1.0))
_BLUE = ("blue", (0.16, 0.33, 0.55, 1.0))
_WHITE = ("white", (0.76, 0.78, 0.81, 1.0))
_BRASS = ("brass", (0.83, 0.62, 0.22, 1.0))
#: One colour for each leg, told apart by all: those of the plots (Okabe and Ito).
_LEGS = (
    ("leg_1", (0.0, 0.447, 0.698, 1.0)),
    ("leg_2", (0.835, 0.369, 0.0, 1.0)),
    ("leg_3", (0.0, 0.620, 0.451, 1.0)),
)

Shape: TypeAlias = Box | Cylinder | Sphere
Paint = tuple[str, tuple[float, float, float, float]]


def robot_text(parameters: RPSParameters) -> str:
    """Return the URDF of the robot as XML text; see `rps_pin.rps.urdf.build_urdf`."""
    size = _Sizes(parameters)
    links = [_base(parameters, size), _platform(parameters, size)]
    joints = [_joint("platform_free", "floating", "base", "platform")]
    for leg, direction in zip(LEGS, LEG_DIRECTIONS, strict=True):
        links += [_cylinder_link(parameters, size, leg), _rod_link(parameters, size, leg)]
        joints += _leg_joints(parameters, leg, direction)
        on_platform, on_rod = ball_frames(leg)
        links += [yourdfpy.Link(on_platform), yourdfpy.Link(on_rod)]
        ball = _polar(parameters.platform_radius, direction)
        joints += [
            _joint(f"{on_platform}_fixed", "fixed", "platform", on_platform, origin=_at(*ball)),
            _joint(f"{on_rod}_fixed", "fixed", f"leg_{leg}_rod", on_rod),
        ]
    robot = yourdfpy.Robot(name=parameters.name, links=links, joints=joints)
    tree = yourdfpy.URDF(robot=robot, build_scene_graph=False, load_meshes=False).write_xml()
    etree.indent(tree, space="  ")
    text: str = etree.tostring(tree, encoding="unicode")
    return text + "\n"


class _Sizes:
    """Sizes that only the pictures and the collision shapes need, m."""

    def __init__(self, parameters: RPSParameters) -> None:
        radius = max(parameters.base_radius, parameters.platform_radius)
        shortest, longest = parameters.leg_length_limits
        if math.isinf(longest):  # drawn for legs about as long as the robot is wide
            longest = max(1.2 * radius, 1.5 * shortest)
        #: Length of a cylinder and of a rod: they overlap at full stroke.
        self.part = round(max(0.75 * shortest, 0.52 * longest), 6)
        #: Radii of cylinder, rod and ball.
        self.cylinder, self.rod, self.ball = (
            round(share * self.part, 6) for share in (0.06, 0.038, 0.065)
        )
        #: Thickness of the base plate, height of the clevises above it.
        self.plate, self.clevis = round(0.05 * radius, 6), round(0.12 * self.part, 6)


# Links --------------------------------------------------------------------------------------------


def _base(parameters: RPSParameters, size: _Sizes) -> yourdfpy.Link:
    """Return the base: a plate below the revolute joints, and a clevis for each of them."""
    link = yourdfpy.Link("base")
    radius = parameters.base_radius + 2.5 * size.clevis
    top = -size.clevis
    _add(link, "plate", Cylinder(radius, size.plate), _at(0, 0, top - size.plate / 2), _STEEL)
    gap = 1.3 * size.cylinder
    cheek = np.array([1.6 * size.cylinder, 0.5 * size.cylinder, 2 * size.clevis])
    foot = np.array([3.2 * size.cylinder, 3.8 * size.cylinder, 0.3 * size.clevis])
    for leg, direction in zip(LEGS, LEG_DIRECTIONS, strict=True):
        joint = _leg_placement(parameters, direction)
        place = joint @ _at(0, 0, top + foot[2] / 2)
        _decorate(link, f"foot_{leg}", Box(foot), place, _DARK)
        for side, offset in (("left", gap), ("right", -gap)):
            _add(link, f"clevis_{leg}_{side}", Box(cheek), joint @ _at(0, offset, 0), _DARK)
            end = Cylinder(0.8 * size.cylinder, 0.5 * size.cylinder)
            place = joint @ _at(0, offset, size.clevis) @ _TO_Y
            _decorate(link, f"clevis_{leg}_{side}_end", end, place, _DARK)
        pin = Cylinder(0.45 * size.cylinder, 3.4 * size.cylinder)
        _add(link, f"pin_{leg}", pin, joint @ _TO_Y, _BRASS)
    return link


def _platform(parameters: RPSParameters, size: _Sizes) -> yourdfpy.Link:
    """Return the platform: a disc on three balls, with a white face and a mark for each leg.

    The balls' centres, and the platform's own, lie in one plane; the disc lies on the balls.
    """
    mass, inertia = parameters.platform_mass, np.array(parameters.platform_inertia)
    link = yourdfpy.Link("platform", inertial=yourdfpy.Inertial(np.eye(4), mass, inertia))
    radius, thickness = parameters.platform_radius, 0.8 * size.plate
    outer = radius + 1.3 * size.ball
    low = 0.7 * size.ball
    top = low + thickness
    _add(link, "disc", Cylinder(outer, thickness), _at(0, 0, low + thickness / 2), _BLUE)
    mark = 0.08 * thickness
    _decorate(link, "face", Cylinder(outer - 0.8 * size.ball, mark), _at(0, 0, top), _WHITE)
    for leg, direction in zip(LEGS, LEG_DIRECTIONS, strict=True):
        ball = _at(*_polar(radius, direction))
        _add(link, f"ball_{leg}", Sphere(size.ball), ball, _BRASS)
        socket = Cylinder(1.15 * size.ball, 0.8 * size.ball)
        _decorate(link, f"socket_{leg}", socket, ball @ _at(0, 0, 0.55 * size.ball), _DARK)
        spoke = Box(np.array([0.62 * radius, 0.055 * radius, 2 * mark]))
        dot = Cylinder(0.075 * radius, 2 * mark)
        for name, shape, away in ((f"mark_{leg}", spoke, 0.55), (f"mark_{leg}_end", dot, 0.86)):
            turned = _turn(0, 1, direction) @ _at(away * radius, 0, top)
            _decorate(link, name, shape, turned, _LEGS[leg - 1])
    _decorate(link, "centre", Cylinder(0.05 * radius, 2 * mark), _at(0, 0, top), _DARK)
    return link


def _cylinder_link(parameters: RPSParameters, size: _Sizes, leg: int) -> yourdfpy.Link:
    """Return the part of a leg that only turns; x runs along the leg from the revolute joint."""
    p = parameters
    inertial = _bar(p.leg_mass, p.leg_com, p.leg_inertia_about_com, size.cylinder)
    link = yourdfpy.Link(f"leg_{leg}_cylinder", inertial=inertial)
    tube = Cylinder(size.cylinder, size.part - size.cylinder)
    _add(link, "tube", tube, _at((size.part + size.cylinder) / 2, 0, 0) @ _TO_X, _DARK)
    _add(link, "hub", Sphere(1.15 * size.cylinder), np.eye(4), _STEEL)
    rear, gland = 1.3 * size.cylinder, 1.6 * size.cylinder
    for name, at, length, paint in (
        ("rear", 1.4 * size.cylinder + rear / 2, rear, _STEEL),
        ("gland", size.part - gland / 2, gland, _LEGS[leg - 1]),
    ):
        ring = Cylinder(1.18 * size.cylinder, length)
        _decorate(link, name, ring, _at(at, 0, 0) @ _TO_X, paint)
    return link


def _rod_link(parameters: RPSParameters, size: _Sizes, leg: int) -> yourdfpy.Link:
    """Return the part of a leg that also slides; its origin is the tip, x runs on outwards."""
    p = parameters
    inertial = _bar(p.rod_mass, -p.rod_com, p.rod_inertia, size.rod)
    link = yourdfpy.Link(f"leg_{leg}_rod", inertial=inertial)
    _add(link, "rod", Cylinder(size.rod, size.part), _at(-size.part / 2, 0, 0) @ _TO_X, _BRIGHT)
    nut = Cylinder(1.35 * size.rod, 1.2 * size.ball)
    _decorate(link, "nut", nut, _at(-1.5 * size.ball, 0, 0) @ _TO_X, _DARK)
    return link


def _bar(mass: float, com: float, across: float, radius: float) -> yourdfpy.Inertial | None:
    """Return the inertia of a bar along x with its centre of mass at `com`; None without a mass.

    Only the moment across the bar, in the plane the leg moves in, does work; the bar is taken as a
    body of revolution. The moment along it is a solid cylinder's, at most what a rigid body allows.
    """
    if mass == 0:
        return None
    along = min(mass * radius**2 / 2, 2 * across)
    return yourdfpy.Inertial(_at(com, 0, 0), mass, np.diag([along, across, across]))


def _add(link: yourdfpy.Link, name: str, shape: Shape, origin: Array, paint: Paint) -> None:
    """Give a link a shape, to be seen and to be hit."""
    seen = _decorate(link, name, shape, origin, paint)
    link.collisions.append(yourdfpy.Collision(seen.name, origin, seen.geometry))


def _decorate(
    link: yourdfpy.Link, name: str, shape: Shape, origin: Array, paint: Paint
) -> yourdfpy.Visual:
    """Give a link a shape that is only seen."""
    geometry = yourdfpy.Geometry(**{type(shape).__name__.lower(): shape})
    colour = yourdfpy.Material(name=paint[0], color=yourdfpy.Color(np.array(paint[1])))
    visual = yourdfpy.Visual(f"{link.name}_{name}", origin, geometry, colour)
    link.visuals.append(visual)
    return visual


# Joints -------------------------------------------------------------------------------------------


def _leg_joints(parameters: RPSParameters, leg: int, direction: float) -> list[yourdfpy.Joint]:
    shortest, longest = parameters.leg_length_limits
    if math.isinf(longest):
        longest = 10 * (parameters.base_radius + parameters.platform_radius)
    force = min(parameters.actuator_force_limit, URDF_UNLIMITED)
    speed = min(parameters.actuator_speed_limit, URDF_UNLIMITED)
    swing = yourdfpy.Limit(URDF_UNLIMITED, URDF_UNLIMITED, *parameters.leg_angle_limits)
    stroke = yourdfpy.Limit(force, speed, shortest, longest)
    place = _leg_placement(parameters, direction)
    turn, slide = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    names = [f"leg_{leg}_{part}" for part in ("revolute", "prismatic", "cylinder", "rod")]
    revolute, prismatic, cylinder, rod = names
    return [
        _joint(revolute, "revolute", "base", cylinder, origin=place, axis=turn, limit=swing),
        _joint(prismatic, "prismatic", cylinder, rod, axis=slide, limit=stroke),
    ]


def _joint(name: str, kind: str, parent: str, child: str, **more: Any) -> yourdfpy.Joint:
    return yourdfpy.Joint(name, kind, parent, child, **{"origin": np.eye(4)} | more)


# Placements, homogeneous (4, 4) -------------------------------------------------------------------


def _polar(radius: float, direction: float) -> tuple[float, float, float]:
    return radius * math.cos(direction), radius * math.sin(direction), 0.0


def _at(x: float, y: float, z: float) -> Array:
    placement = np.eye(4)
    placement[:3, 3] = x, y, z
    return placement


def _turn(axis_1: int, axis_2: int, angle: float) -> Array:
    """Return the rotation by `angle` that carries axis 1 towards axis 2."""
    placement = np.eye(4)
    cosine, sine = math.cos(angle), math.sin(angle)
    placement[axis_1, axis_1] = placement[axis_2, axis_2] = cosine
    placement[axis_2, axis_1], placement[axis_1, axis_2] = sine, -sine
    return placement


#: URDF's cylinders lie along z; ours lie along x, or along y.
_TO_X, _TO_Y = _turn(2, 0, math.pi / 2), _turn(1, 2, math.pi / 2)


def _leg_placement(parameters: RPSParameters, direction: float) -> Array:
    """Return the frame of a leg's revolute joint: x towards the base's centre, z up."""
    return _at(*_polar(parameters.base_radius, direction)) @ _turn(0, 1, direction + math.pi)
