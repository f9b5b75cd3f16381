"""Robots of published workspaces, and the geometry of constant orientations by Gosselin.

The Delta is the SurgiScope's: R_b = 0.25 m, R_p = 0.2 m, arms 0.75 m, rods 0.95 m, arms from 0 to
90 degrees below the horizontal, z at most -0.3 m; 1.48 m^3 by points 0.02 m apart. So says a paper
on the "Delta inverse" robot, read in an excerpt without its title:
https://th4.ilovetranslation.com/8NUfK0-8Ewb=d.

C. Gosselin, Determination of the workspace of 6-DOF parallel manipulators, J. Mech. Des. 112, 1990:
at one orientation each leg keeps the centre between two spheres; a plane z cuts them in annuli.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rps_pin import ClosedLoopModel
from rps_pin.arrays import Array
from rps_pin.task import Task

BASE, PLATFORM, ARM, ROD = 0.25, 0.2, 0.75, 0.95
HALF = 0.04
LIMITS = (0.0, np.pi / 2)
TOP, VOLUME = -0.3, 1.48

_MASS = (
    '<inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
)


def _frame(parent: str, name: str, place: str) -> str:
    return (
        f'<link name="{name}"/><joint name="{name}_joint" type="fixed"><parent link="{parent}"/>'
        f'<child link="{name}"/><origin {place}/></joint>'
    )


def surgiscope(folder: Path) -> Task:
    """The Delta with two rods each, written as a description and read again."""
    links, closures = [f'<link name="base"/><link name="platform">{_MASS}</inertial></link>'], []
    links.append(
        '<joint name="platform_joint" type="floating"><parent link="base"/>'
        '<child link="platform"/></joint>'
    )
    for i in range(3):
        t = 2 * np.pi * i / 3
        c, s = np.cos(t), np.sin(t)
        links.append(
            f'<link name="arm_{i}">{_MASS}</inertial></link><joint name="arm_{i}_joint" '
            'type="revolute"><parent link="base"/>'
            f'<child link="arm_{i}"/><origin xyz="{BASE * c} {BASE * s} 0" rpy="0 0 {t}"/>'
            f'<axis xyz="0 1 0"/><limit lower="{LIMITS[0]}" upper="{LIMITS[1]}" effort="1e6" '
            'velocity="1e6"/></joint>'
        )
        for side in (-HALF, HALF):
            name = f"{i}_{'left' if side > 0 else 'right'}"
            links.append(_frame(f"arm_{i}", f"elbow_{name}", f'xyz="{ARM} {side} 0"'))
            x, y = PLATFORM * c - side * s, PLATFORM * s + side * c
            links.append(_frame("platform", f"ball_{name}", f'xyz="{x} {y} 0"'))
            closures.append(
                f"  - {{name: rod_{name}, frame_a: elbow_{name}, frame_b: ball_{name}, "
                f"kind: distance, distance: {ROD}}}"
            )
    (folder / "delta.urdf").write_text(f'<robot name="surgiscope">{"".join(links)}</robot>')
    angle = 0.6  # of all arms at home
    out = BASE + ARM * np.cos(angle) - PLATFORM
    height = -ARM * np.sin(angle) - np.sqrt(ROD**2 - out**2)
    arms = ", ".join(f"arm_{i}_joint: {angle}" for i in range(3))
    (folder / "delta.yaml").write_text(
        "\n".join(
            [
                "name: surgiscope",
                "urdf: delta.urdf",
                "closures:",
                *closures,
                "actuated: [arm_0_joint, arm_1_joint, arm_2_joint]",
                f"home: {{{arms}, platform_joint: [0, 0, {height}, 0, 0, 0, 1]}}",
                "task: {frame: platform, coordinates: [x, y, z]}",
            ]
        )
    )
    task: Task = ClosedLoopModel.load(folder / "delta.yaml").task
    return task


def area_of_annuli(centres: Array, inner: Array, outer: Array) -> float:
    """The area of the intersection of annuli in a plane, by its boundary's arcs; exact.

    Each circle is cut where others meet it; the arcs inside all annuli make up the boundary. With
    the area on the left, A = 1/2 integral of x dy - y dx; an inner circle is gone round clockwise.
    """
    circles = [(c, r, sign) for c, i, o in zip(centres, inner, outer, strict=True)
               for r, sign in ((i, -1.0), (o, 1.0)) if r > 0]  # fmt: skip
    area = 0.0
    for k, (centre, radius, sign) in enumerate(circles):
        cuts = [0.0, 2 * np.pi]
        for other, size, _ in circles[:k] + circles[k + 1 :]:
            d = other - centre
            far = np.hypot(*d)
            if abs(radius - size) < far < radius + size:
                half = np.arccos((radius**2 + far**2 - size**2) / (2 * radius * far))
                cuts += list((np.arctan2(d[1], d[0]) + np.array([-half, half])) % (2 * np.pi))
        ends = np.sort(cuts)
        low, high = ends[:-1], ends[1:]
        middle = (low + high) / 2
        points = centre + radius * np.stack([np.cos(middle), np.sin(middle)], axis=-1)
        away = np.linalg.norm(points[:, None] - centres, axis=-1)
        mine = np.abs(away - radius) < 1e-12 * radius  # on the circle itself
        ok = (((away >= inner) & (away <= outer)) | mine).all(axis=-1)
        low, high = low[ok], high[ok]
        arcs = radius**2 * (high - low) + radius * (
            centre[0] * (np.sin(high) - np.sin(low)) - centre[1] * (np.cos(high) - np.cos(low))
        )
        area += sign * float(arcs.sum()) / 2
    return area


def volume_of_shells(
    centres: Array, lengths: tuple[float, float], ends: tuple[float, float], planes: int = 2000
) -> float:
    """The volume of the intersection of spherical shells about centres (n, 3), between heights."""
    step = (ends[1] - ends[0]) / planes
    total = 0.0
    for z in ends[0] + step * (np.arange(planes) + 0.5):
        squares = np.square(lengths)[:, None] - (z - centres[:, 2]) ** 2
        inner, outer = np.sqrt(np.maximum(squares, 0.0))
        if (squares[1] > 0).all():
            total += step * area_of_annuli(centres[:, :2], inner, outer)
    return total
