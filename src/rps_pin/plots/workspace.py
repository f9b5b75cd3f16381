"""Figures of the workspace in planes: its outlines, a map of reasons, its reach over radii.

Each function makes a figure, or draws on a given one. No window is opened.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.plots import style
from rps_pin.plots.curves import legend_above
from rps_pin.plots.space import POSITION
from rps_pin.plots.style import GREY, PAGE, figure_of, new_axes, styled
from rps_pin.rps.workspace.geometry import boundary
from rps_pin.rps.workspace.reasons import Reason
from rps_pin.rps.workspace.result import Workspace

#: Of the workspace: its outline and what it encloses.
_INSIDE, _PALE = style.BLUE, "#9ecae9"
#: Families of reasons: a name, the part of their names, a pale colour.
_FAMILIES = (
    ("a leg too short", "SHORT", style.YELLOW),
    ("a leg too long", "LONG", style.ORANGE),
    ("a leg's angle", "ANGLE", style.PURPLE),
    ("a spherical joint", "SPHERICAL", style.VERMILION),
    ("singular", "SINGULAR", style.BLACK),
    ("unreachable", "UNREACHABLE", GREY),
)


@styled
def plot_views(workspace: Workspace, figure: Figure | None = None) -> Figure:
    """Draw the workspace's outlines in the planes XY, XZ and YZ, as the paper's Fig. 6 does.

    They are seen along z, y and x. x and y have one scale; z has its own.

    Raises
    ------
    InputError
        If no cell of the grid is inside, or the grid is a slice.
    """
    mesh = boundary(workspace)
    points = 1e3 * mesh.vertices
    figure = figure or Figure(figsize=(PAGE, 2.4), layout="constrained")
    reach = 1.08 * float(np.abs(points[:, :2]).max())
    for axes, (i, j) in zip(figure.subplots(1, 3), ((0, 1), (0, 2), (1, 2)), strict=True):
        _fill(axes, points[:, [i, j]][mesh.faces])
        axes.set(xlabel=POSITION[i], ylabel=POSITION[j], xlim=(-reach, reach))
        if j == 1:
            axes.set(ylim=(-reach, reach), box_aspect=1)
        else:
            axes.margins(y=0.05)
            axes.set_box_aspect(1)
    figure.supxlabel("scales of $p_x$ and $p_y$ are equal, that of $p_z$ is not")
    return figure


def _fill(axes: Axes, triangles: Array) -> None:
    """Fill the union of triangles (n, 3, 2), and draw its outline."""
    for colour, width in ((_INSIDE, 2.2), (_PALE, 0.6)):  # of the lower, the edge is seen
        look: Any = {"color": colour, "linewidth": width, "joinstyle": "round"}
        axes.add_collection(PolyCollection([*triangles], **look, rasterized=True))
    axes.autoscale_view()


@styled
def plot_reasons(workspace: Workspace, height: float, axes: Axes | None = None) -> Figure:
    """Draw which tilts are inside at a height, and the reasons of the others.

    Parameters
    ----------
    workspace
        On a grid of poses.
    height
        Of the slice, m; the grid's nearest plane is drawn.
    axes
        To draw on; default: those of a new figure.

    Raises
    ------
    InputError
        If the grid is not one of poses, its slice has no width, or the height lies beyond it.
    """
    if workspace.grid.kind != "poses":
        raise InputError("a map of tilts needs a workspace on a grid of poses, see pose_grid")
    plane = workspace.plane(0, height)
    if min(plane.grid.shape[1:]) < 2:
        raise InputError("a map needs at least 2 values of tilt_x and of tilt_y")
    names, parts, colours = zip(("inside", "-", _INSIDE), *_FAMILIES, strict=True)
    bits = [sum(int(one) for one in Reason if str(one.name).endswith(part)) for part in parts]
    # 0 for inside: the first family that a reason is of, or of none
    family = ((plane.reason[0, ..., None] & np.array(bits)) != 0).argmax(axis=-1)
    _, x, y = (np.rad2deg(axis) for axis in plane.grid.axes)
    axes = new_axes(axes, 3.2)
    image = to_rgba_array(colours)[family]
    half_x, half_y = (x[1] - x[0]) / 2, (y[1] - y[0]) / 2
    axes.imshow(
        np.swapaxes(image, 0, 1),
        origin="lower",
        extent=(x[0] - half_x, x[-1] + half_x, y[0] - half_y, y[-1] + half_y),
        interpolation="nearest",
    )
    for i in np.unique(family):
        axes.plot([], [], "s", color=colours[i], label=names[i])
    axes.grid(visible=False)
    height = 1e3 * plane.grid.axes[0][0]
    axes.set(xlabel=f"tilt about x (°), at $p_z$ = {height:.5g} mm", ylabel="tilt about y (°)")
    legend_above(axes)
    return figure_of(axes)


class _Reach(Protocol):
    """The workspace of one base radius: a `rps_pin.paper.PaperComparison`."""

    @property
    def base_radius(self) -> float: ...
    @property
    def x(self) -> tuple[float, float]: ...
    @property
    def y(self) -> tuple[float, float]: ...
    @property
    def stated_reach(self) -> float: ...


@styled
def plot_comparison(rows: Sequence[_Reach], axes: Axes | None = None) -> Figure:
    """Draw the reach in x and y over the base radius g, and what the paper states.

    Parameters
    ----------
    rows
        As `paper_comparison` returns them.
    axes
        To draw on; default: those of a new figure.
    """
    if len(rows) == 0:
        raise InputError("there is nothing to compare: rows is empty")
    radius = [1e3 * row.base_radius for row in rows]
    axes = new_axes(axes, 2.3)
    for axis, look, colour in (("x", "-o", style.BLUE), ("y", "--s", style.VERMILION)):
        values = [1e3 * max(map(abs, getattr(row, axis))) for row in rows]
        axes.plot(radius, values, look, color=colour, label=f"largest $|p_{axis}|$")
    stated = 1e3 * rows[0].stated_reach
    axes.axhline(stated, color="black", ls=":", label=f"paper: {stated:.3g} mm")
    axes.set(xlabel="base radius g (mm)", ylabel="reach over the stroke (mm)")
    axes.set_ylim(bottom=0)
    legend_above(axes)
    return figure_of(axes)
