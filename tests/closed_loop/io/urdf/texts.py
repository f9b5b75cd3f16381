"""Short URDF texts for the tests."""

from __future__ import annotations


def link(name: str, mass: float = 0.0, com: str = "0 0 0", inertia: float = 1e-3) -> str:
    """A link; its inertia is a sphere's, about its centre of mass."""
    if not mass:
        return f'<link name="{name}"/>'
    return (
        f'<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/><inertia '
        f'ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial>'
        "</link>"
    )


def joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    *,
    xyz: str = "0 0 0",
    axis: str | None = "0 1 0",
    limit: str | None = 'lower="-9" upper="9" effort="9" velocity="9"',
    more: str = "",
    tag: str = "joint",
) -> str:
    """A joint; its limit is left out of types that have none."""
    bounded = limit is not None and kind in ("revolute", "prismatic")
    return (
        f'<{tag} name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/>'
        + (f'<axis xyz="{axis}"/>' if axis is not None and kind != "fixed" else "")
        + (f"<limit {limit}/>" if bounded else "")
        + f"{more}</{tag}>"
    )


def robot(*parts: str, name: str = "r") -> str:
    return f'<robot name="{name}" xmlns:drake="http://drake.mit.edu">{"".join(parts)}</robot>'


def body(name: str, mass: float, com: str, moments: str) -> str:
    """A link with three principal moments of inertia."""
    x, y, z = moments.split()
    return (
        f'<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/><inertia '
        f'ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
