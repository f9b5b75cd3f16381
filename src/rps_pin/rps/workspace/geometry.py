"""Sizes and surfaces of a workspace: volumes, its boundary as a mesh, the theoretical cylinder.

The platform's centre is p_x = h/2 b (w_x^2 - w_y^2), p_y = -h b w_x w_y: opposite tilts w and -w
put it at the same place. A set of centre positions is therefore covered up to twice, and the
boundary of a workspace, drawn in positions, passes through itself. In poses it does not.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.evaluate import evaluate, side_of_singularity
from rps_pin.rps.workspace.result import Workspace
from rps_pin.task.workspace.boundary import surface
from rps_pin.task.workspace.grids import shares
from rps_pin.task.workspace.volume import refuse_slices
from rps_pin.validation import choice, whole_number

if TYPE_CHECKING:
    import trimesh

Space = Literal["position", "pose"]
#: Of coordinates, over the largest of their axis.
_ROUNDING = 1e-12


class Volume(NamedTuple):
    """How large a workspace is."""

    pose: float
    """Of the poses (z, tilt_x, tilt_y), m rad^2."""
    position: float
    """Of the centre's positions (x, y, z), each counted once, m^3."""
    position_twice: float
    """The same with a position counted twice where two tilts reach it, m^3: the volume that the
    `boundary` encloses."""


@refuses_other_kinds
def volume(workspace: Workspace) -> Volume:
    """Return the volumes of a workspace, by the trapezoidal rule over its inside points.

    On leg lengths a volume element is dz dw_x dw_y = dd_1 dd_2 dd_3 / (h^2 |det K|). In positions
    it is |d(x, y)/d(w_x, w_y)| = h^2/2 (1 - cos(beta)) sin(beta)/beta times that of poses, and half
    of it where the opposite tilt is in the workspace as well.

    Raises
    ------
    InputError
        If the grid is a slice: one of its axes has a single value.
    """
    refuse_slices(workspace.grid.shape)
    inside = workspace.inside
    ends = [shares(axis) for axis in workspace.grid.axes]
    element = np.einsum("i,j,k->ijk", *ends)[inside]
    h = workspace.parameters.platform_radius
    if workspace.grid.kind == "leg lengths":
        element = element / (h**2 * np.abs(workspace.determinant[inside]))
    pose = workspace.pose[inside]
    beta = np.hypot(pose[:, 1], pose[:, 2])
    # 1 - cos(beta) = 2 sin^2(beta/2), |sin|: the centre turns back beyond a half turn
    spread = h**2 * np.sin(beta / 2) ** 2 * np.abs(np.sinc(beta / np.pi))
    share = np.where(_opposite_inside(workspace, pose), 0.5, 1.0)
    elements = element, element * spread * share, element * spread
    return Volume(*(float(volumes.sum()) for volumes in elements))


@refuses_other_kinds
def boundary(workspace: Workspace, space: Space = "position") -> trimesh.Trimesh:
    """Return the boundary of a workspace as a closed triangle mesh, normals outwards.

    A cell of the grid belongs to the workspace if its eight corners are inside; the mesh is made
    of the cells' outer faces, two triangles each, mapped through the kinematics. Where the grid's
    own ends are the limits (leg lengths over the stroke) the vertices lie on the exact boundary;
    elsewhere they are within a grid step inside of it.

    Parameters
    ----------
    workspace
        On leg lengths or poses.
    space
        ``"position"``: vertices are the platform's centre (x, y, z), m, and the surface passes
        through itself where two tilts reach one position. ``"pose"``: vertices are
        (z, tilt_x, tilt_y), m and rad.

    Raises
    ------
    InputError
        If the grid is a slice, no cell is inside, or there is no such space.
    """
    choice(space, "space", ("position", "pose"))
    refuse_slices(workspace.grid.shape)
    return surface(workspace.inside, workspace.position if space == "position" else workspace.pose)


@refuses_other_kinds
def boundary_conditioning(workspace: Workspace) -> Array:
    """Return the conditioning (0 singular, 1 at best) at each vertex of the `boundary`, (n,)."""
    poses = np.array(boundary(workspace, "pose").vertices)
    side = side_of_singularity(workspace.parameters, workspace.start)
    return evaluate(workspace.parameters, poses, side).conditioning


@refuses_other_kinds
def theoretical_cylinder(
    parameters: RPSParameters, lower: float, upper: float, sections: int = 96
) -> trimesh.Trimesh:
    """Return the cylinder of radius h that holds every position of the centre, as a mesh in m.

    |(p_x, p_y)| = h/2 (1 - cos(beta)) <= h, whatever the legs' lengths (Section 3).

    Parameters
    ----------
    parameters
        The robot.
    lower, upper
        Heights of the ends, m.
    sections
        Sides of the prism that stands for it.

    Raises
    ------
    InputError
        If the heights are not finite and in order, or there are fewer than 3 sections.
    """
    if not (math.isfinite(lower) and math.isfinite(upper) and lower < upper):
        raise InputError(f"heights {lower} to {upper} m must be finite and in order")
    whole_number(sections, "sections", least=3)
    import trimesh  # noqa: PLC0415 (takes long to load)

    cylinder: trimesh.Trimesh = trimesh.creation.cylinder(
        radius=parameters.platform_radius,
        sections=sections,
        segment=[[0.0, 0.0, lower], [0.0, 0.0, upper]],
    )
    return cylinder


def _opposite_inside(workspace: Workspace, pose: Array) -> Bools:
    """Return whether (z, -tilt) is in the workspace too, and within its grid, shape (n,)."""
    opposite = pose * [1.0, -1.0, -1.0]
    side = side_of_singularity(workspace.parameters, workspace.start)
    fields = evaluate(
        workspace.parameters, opposite, side, min_conditioning=workspace.min_conditioning
    )
    coordinates = fields.length if workspace.grid.kind == "leg lengths" else opposite
    inside = fields.reason == 0
    for i, axis in enumerate(workspace.grid.axes):
        slack = _ROUNDING * float(np.abs(axis).max())
        inside &= (coordinates[:, i] >= axis[0] - slack) & (coordinates[:, i] <= axis[-1] + slack)
    return np.asarray(inside)
