"""Mechanisms with collision shapes, as texts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from rps_pin import ClosedLoopModel

INERTIA = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


_LIMIT = '<limit lower="-9" upper="9" effort="99" velocity="99"/>'


def shape(form: str, xyz: str = "0 0 0", rpy: str = "0 0 0") -> str:
    return f'<collision><origin xyz="{xyz}" rpy="{rpy}"/><geometry>{form}</geometry></collision>'


def link(name: str, *shapes: str) -> str:
    return f'<link name="{name}">{INERTIA}{"".join(shapes)}</link>'


def joint(
    name: str, parent: str, child: str, kind: str = "continuous", xyz: str = "0 0 0",
    axis: str = "0 0 1",
) -> str:  # fmt: skip
    limit = "" if kind == "floating" else _LIMIT
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}</joint>'
    )


def robot(*parts: str) -> str:
    return f'<robot name="shaped">{"".join(parts)}</robot>'


def rod(radius: float, length: float, kind: str = "cylinder") -> str:
    """A rod from its link's origin along x."""
    form = f'<{kind} radius="{radius}" length="{length}"/>'
    return shape(form, f"{length / 2} 0 0", f"0 {np.pi / 2} 0")


def floating(a: str, b: str) -> ClosedLoopModel:
    """Two bodies on free-flyers, each with one shape."""
    parts = [link("base"), link("a", shape(a)), link("b", shape(b))]
    joints = [joint(f"j{name}", "base", name, "floating") for name in "ab"]
    return ClosedLoopModel.from_urdf(robot(*parts, *joints), [], [])


def place(*placements: pin.SE3) -> np.ndarray:
    """The configuration of free-flyers."""
    return np.concatenate([pin.SE3ToXYZQUAT(one) for one in placements])


def write_mesh(file: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Write an STL of triangles."""
    lines = ["solid part"]
    for corners in vertices[triangles]:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {' '.join(map(repr, map(float, corner)))}" for corner in corners]
        lines += ["endloop", "endfacet"]
    file.write_text("\n".join([*lines, "endsolid part"]))


def hull(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The triangles of a convex body, outwards."""
    found = ConvexHull(vertices)
    middle = vertices.mean(axis=0)
    triangles = []
    for one in found.simplices:
        a, b, c = vertices[one]
        outward = np.cross(b - a, c - a) @ (a - middle) > 0
        triangles.append(one if outward else one[::-1])
    return vertices, np.array(triangles)


def box(sides: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return hull(signs * np.array(sides) / 2)


def channel() -> tuple[np.ndarray, np.ndarray]:
    """A U of three boxes as one surface: 1 m wide, its walls 0.1 m thick and 0.5 m high."""
    outline = np.array(
        [[-0.5, 0], [0.5, 0], [0.5, 0.5], [0.4, 0.5], [0.4, 0.1], [-0.4, 0.1], [-0.4, 0.5],
         [-0.5, 0.5]]
    )  # fmt: skip
    n = len(outline)
    vertices = np.array([[x, y, z] for y in (-0.5, 0.5) for x, z in outline])
    caps = [[0, 1, 4], [1, 2, 3], [1, 3, 4], [0, 4, 5], [0, 5, 6], [0, 6, 7]]
    triangles = [*caps, *([n + c, n + b, n + a] for a, b, c in caps)]
    for k in range(n):
        a, b = k, (k + 1) % n
        triangles += [[a, n + a, n + b], [a, n + b, b]]
    return vertices, np.array(triangles)
