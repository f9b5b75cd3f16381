"""What `rps-pin new` writes: the package's own robots as commented files to edit.

A 3-RPS is the preset ``micro``; the others are the package's URDF and description. Comments are put
before the first line of each kind.
"""

from __future__ import annotations

import re
from enum import StrEnum
from typing import NamedTuple

from rps_pin.cli.completion import MECHANISMS
from rps_pin.rps.parameters import RPSParameters


class Kind(StrEnum):
    """The robots to begin with."""

    RPS = "3rps"
    STEWART = "stewart"
    DELTA = "delta"
    FIVE_BAR = "five-bar"


class OwnRobot(NamedTuple):
    """A new robot's files, and what can be done with them."""

    files: dict[str, str]
    """Texts by file name."""
    commands: tuple[str, ...]
    """Commands to try, with ``{0}`` for the folder and a slash."""


_BEGUN = "Begun by rps-pin new {kind}: change the numbers and names to your robot's."
_SI = "SI units: m, rad, s, kg, N."
#: Of a description, by key.
_DESCRIBED = {
    "name": "Its name, in messages and titles.",
    "urdf": "The open tree: links, joints, masses, limits. Relative to this file.",
    "closures": "Where the loops close: each joint that the tree leaves out, between two frames "
    "of the URDF.\n# Kinds: spherical, revolute, universal, distance (a rod's length), rigid and "
    "more.",
    "actuated": "The driven joints of the URDF, in the order of all forces.",
    "home": "A guess of joint positions in the assembly mode that is meant, m and rad: the loops "
    "are closed from it.\n# Joints that are left out are at 0. A free platform has x, y, z and a "
    "quaternion x, y, z, w.",
    "task": "What it is for: coordinates of a frame (x, y, z, rx, ry, rz), for ik, fk, check, "
    "dynamics and control.",
}
#: Of a URDF: before the first line that matches.
_IN_URDF = {
    r"    <inertial>": "Mass (kg), its centre in the link's axes (m), inertia about it (kg m^2). "
    "Only forces need them.",
    r"    <visual>": "What is drawn. Nothing is computed from it.",
    r'  <joint name="\w+" type="floating">': "The platform is free; the closures hold it.",
    r'  <link name="\w+"/>': "A frame: where a loop closes, or a tool. It has no mass.",
    r'    <limit lower="[^"]*" upper="[^"]*" effort="(?!1000000")': "Limits of position (rad, m), "
    "force (N m, N) and speed (rad/s, m/s).",
}
_PATHS = {
    Kind.RPS: "# The platform's axis turns about once, tilted by 0.1 rad.\n"
    "kind: circle\nheight: 0.223\ntilt: 0.1\nduration: 2.0\n",
    Kind.STEWART: "end: {z: 0.66, rx: 0.1}\nduration: 1.0\n",
    Kind.DELTA: "end: {x: 0.1, z: -0.45}\nduration: 0.5\n",
    Kind.FIVE_BAR: "end: {x: 0.25, z: 0.5}\nduration: 0.5\n",
}
_TO_AND_FRO = (
    "# From home to another place in a straight line, from rest to rest.\nkind: point_to_point\n"
)
#: A place near home, and an actuator's position near home's.
_NEAR = {
    Kind.STEWART: ("z=0.65", "leg_1_rod_joint=0.72"),
    Kind.DELTA: ("z=-0.45", "arm_1_joint=0.4"),
    Kind.FIVE_BAR: ("x=0.22", "left_joint=2.1"),
}


def own_robot(kind: Kind, name: str) -> OwnRobot:
    """Return a new robot of a kind; its name is that of its files."""
    begun = f"{_BEGUN.format(kind=kind)} {_SI}"
    robot, path = f"{{0}}{name}.yaml", "{0}path.yaml"
    if kind is Kind.RPS:
        parameters = RPSParameters.from_preset("micro").replace(name=name)
        files = {f"{name}.yaml": f"# {begun}\n{parameters.yaml_text()}", "path.yaml": _PATHS[kind]}
        return OwnRobot(
            files,
            (
                f"view {robot}",
                f"describe {robot}",
                f"ik --robot {robot} --pose 0.22 0.1 0",
                f"fk --robot {robot} --lengths 0.22 0.23 0.22",
                f"dynamics {path} --robot {robot}",
            ),
        )
    stem = kind.replace("-", "_")
    place, position = _NEAR[kind]
    files = {
        f"{name}.urdf": _urdf((MECHANISMS / f"{stem}.urdf").read_text("utf-8"), name, begun),
        f"{name}.yaml": _description((MECHANISMS / f"{stem}.yaml").read_text("utf-8"), name, begun),
        "path.yaml": _TO_AND_FRO + _PATHS[kind],
    }
    return OwnRobot(
        files,
        (
            f"view {robot}",
            f"describe {robot}",
            f"ik --mechanism {robot} --at {place}",
            f"fk --mechanism {robot} --at {position}",
            f"dynamics {path} --mechanism {robot}",
        ),
    )


def _description(text: str, name: str, begun: str) -> str:
    text = re.sub(r"^name: .*$", f"name: {name}", text, count=1, flags=re.MULTILINE)
    text = re.sub(r"^urdf: .*$", f"urdf: {name}.urdf", text, count=1, flags=re.MULTILINE)
    for key, words in _DESCRIBED.items():
        text = re.sub(rf"^{key}:", f"# {words}\n{key}:", text, count=1, flags=re.MULTILINE)
    return f"# {begun}\n{text}"


def _urdf(text: str, name: str, begun: str) -> str:
    text = re.sub(r"<!--.*?-->", f"<!-- {begun} -->", text, count=1)
    text = re.sub(r'<robot name="\w+">', f'<robot name="{name}">', text, count=1)
    for line, words in _IN_URDF.items():
        before = rf"^(\s*)({line.strip()})"
        with_words = rf"\1<!-- {words} -->\n\1\2"
        text = re.sub(before, with_words, text, count=1, flags=re.MULTILINE)
    return text
