"""The paper's figures of the workspace, 2 to 6, and a map of a slice: axes with units.

Each function makes a figure, or draws on a given one. No window is opened.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.plots import style
from rps_pin.plots.style import GREY, LEG_COLOURS, STYLE, axes_in_space, figure_of, new_axes
from rps_pin.rps.kinematics.assembly_modes import AssemblyModes
from rps_pin.rps.kinematics.legs import RADIAL
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.geometry import boundary
from rps_pin.rps.workspace.reasons import Reason
from rps_pin.rps.workspace.result import Workspace

#: The workspace, the theoretical cylinder, the platform.
_INSIDE, _CYLINDER, _PLATFORM = style.BLUE, GREY, style.ORANGE
#: Families of reasons: a name, the part of their names, a pale colour.
_FAMILIES = (
    ("a leg too short", "SHORT", style.YELLOW),
    ("a leg too long", "LONG", style.ORANGE),
    ("a leg's angle", "ANGLE", style.PURPLE),
    ("a spherical joint", "SPHERICAL", style.VERMILION),
    ("singular", "SINGULAR", style.BLACK),
    ("unreachable", "UNREACHABLE", GREY),
)
_POSITION = ("$p_x$ (mm)", "$p_y$ (mm)", "$p_z$ (mm)")


def plot_assembly_modes(
    parameters: RPSParameters, modes: AssemblyModes, figure: Figure | None = None
) -> Figure:
    """Draw each assembly mode as a robot: base, legs and platform, as the paper's Fig. 2 does.

    Parameters
    ----------
    parameters
        The robot.
    modes
        Solutions for one triple of leg lengths: `angle` (k, 3), `position` (k, 3) and `rotation`
        (k, 3, 3) are used.
    figure
        To draw on; default: a new one.

    Raises
    ------
    InputError
        If there is no mode to draw.
    """
    count = len(modes.angle)
    if count == 0:
        raise InputError("there is no assembly mode to draw")
    base = 1e3 * parameters.base_radius * RADIAL
    arms = parameters.platform_radius * RADIAL
    tips = 1e3 * (modes.position[:, None, :] + arms @ np.swapaxes(modes.rotation, -1, -2))
    reach = max(float(np.abs(tips[..., :2]).max()), float(np.abs(base).max()))
    low, high = min(0.0, float(tips[..., 2].min())), max(1.0, float(tips[..., 2].max()))
    columns = min(4, count)
    rows = -(-count // columns)
    with matplotlib.rc_context(STYLE):
        for k in range(count):
            axes = axes_in_space(figure, (3.0 * columns, 3.4 * rows), (rows, columns, k + 1))
            figure = figure_of(axes)
            _draw_robot(axes, base, tips[k])
            degrees = ", ".join(f"{angle:.0f}" for angle in np.rad2deg(modes.angle[k]))
            axes.set_title(f"{k + 1}: $\\phi$ = {degrees}°", fontsize=9)
            axes.set(xlim=(-reach, reach), ylim=(-reach, reach), zlim=(low, high))
            _label_space(axes, ("x (mm)", "y (mm)", "z (mm)"), size=7, ticks=3)
            axes.set_box_aspect((1, 1, (high - low) / (2 * reach)), zoom=0.8)
    return figure_of(axes)


def plot_theoretical(parameters: RPSParameters, figure: Figure | None = None) -> Figure:
    """Draw the theoretical workspace, as the paper's Fig. 3 does.

    The cylinder of radius h, with the platform level in its middle and turned by half a turn about
    axes in the base plane, where its centre lies on the cylinder.
    """
    h = 1e3 * parameters.platform_radius
    with matplotlib.rc_context(STYLE):
        axes = axes_in_space(figure, (5.6, 5.2))
        _draw_cylinder(axes, h, -h, h)
        axes.scatter([0], [0], [0], color="black", s=20, label="level, $p_x = p_y = 0$")
        # Tilt by pi along alpha: p = h (cos 2a', ...), on the cylinder (Eq. 4)
        for i, way in enumerate(np.deg2rad([0.0, 60.0, 120.0])):
            centre = h * np.array([np.cos(2 * way), -np.sin(2 * way), 0.0])
            label = "half a turn: the limit" if i == 0 else None
            axes.scatter(*centre[:, None], color=LEG_COLOURS[0], s=20, label=label)
            axes.plot(*np.stack([np.zeros(3), centre], axis=1), color=LEG_COLOURS[0], lw=0.8)
        _label_space(axes, ("$p_x$ (mm)", "$p_y$ (mm)", "$p_z$, any height (mm)"))
        axes.set_title(f"Theoretical workspace, radius h = {h:.4g} mm")
        axes.legend(loc="upper left")
        axes.set_box_aspect((1, 1, 1), zoom=0.88)
    return figure_of(axes)


def plot_effective(workspace: Workspace, figure: Figure | None = None) -> Figure:
    """Draw the effective workspace within the theoretical cylinder, as the paper's Fig. 4 does."""
    mesh = boundary(workspace)
    points = 1e3 * mesh.vertices
    h = 1e3 * workspace.parameters.platform_radius
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    with matplotlib.rc_context(STYLE):
        axes = axes_in_space(figure, (5.6, 5.2))
        _draw_cylinder(axes, h, low, high)
        axes.add_collection3d(Poly3DCollection(points[mesh.faces], color=_INSIDE))
        reach = float(np.abs(points[:, :2]).max())
        text = (
            f"grey: theoretical, radius {h:.4g} mm\n"
            f"blue: effective, within {reach:.3g} mm of the axis in x and y"
        )
        axes.text2D(0.02, 0.94, text, transform=axes.transAxes, fontsize=8)
        axes.set(xlim=(-h, h), ylim=(-h, h), zlim=(low, high))
        _label_space(axes)
        axes.set_title("Effective and theoretical workspace")
        axes.set_box_aspect((1, 1, 1), zoom=0.88)
    return figure_of(axes)


def plot_space(workspace: Workspace, figure: Figure | None = None) -> Figure:
    """Draw the boundary of the workspace of the centre in space, as the paper's Fig. 5 does.

    The scale of x and y is not that of z: the motion along them is parasitic, and much smaller.
    """
    mesh = boundary(workspace)
    points = 1e3 * mesh.vertices
    with matplotlib.rc_context(STYLE):
        axes = axes_in_space(figure, (5.6, 5.4))
        shape = points[mesh.faces]
        axes.add_collection3d(Poly3DCollection(shape, facecolors=_shaded(shape), linewidths=0))
        x, y, z = np.stack([points.min(axis=0), points.max(axis=0)], axis=1)
        axes.set(xlim=x, ylim=y, zlim=z)
        _label_space(axes)
        axes.set_title("Effective workspace of the platform's centre")
        axes.set_box_aspect((1, 1, 1.2), zoom=0.85)
    return figure_of(axes)


def plot_views(workspace: Workspace, figure: Figure | None = None) -> Figure:
    """Draw the workspace's points in the planes XY, XZ and YZ, as the paper's Fig. 6 does."""
    points = 1e3 * workspace.position[workspace.inside]
    if not len(points):
        raise InputError("no point is inside the workspace: there is nothing to draw")
    with matplotlib.rc_context(STYLE):
        figure = figure or Figure(figsize=(10.5, 3.8), layout="constrained")
        for axes, (i, j) in zip(figure.subplots(1, 3), ((0, 1), (0, 2), (1, 2)), strict=True):
            axes.plot(points[:, i], points[:, j], ",", color=_INSIDE, alpha=0.5, rasterized=True)
            axes.set(xlabel=_POSITION[i], ylabel=_POSITION[j])
            axes.set_title("XYZ"[i] + "XYZ"[j], loc="left")
            if j == 1:
                axes.set_aspect("equal", adjustable="datalim")
    return figure


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
    with matplotlib.rc_context(STYLE):
        axes = new_axes(axes, (6.4, 4.4))
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
        axes.set(xlabel="tilt about x (°)", ylabel="tilt about y (°)")
        axes.set_title(f"Tilts at $p_z$ = {1e3 * plane.grid.axes[0][0]:.5g} mm", loc="left")
        axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1), frameon=False)
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
    with matplotlib.rc_context(STYLE):
        axes = new_axes(axes, (6.4, 3.8))
        for axis, look, colour in (("x", "-o", style.BLUE), ("y", "--s", style.VERMILION)):
            values = [1e3 * max(map(abs, getattr(row, axis))) for row in rows]
            axes.plot(radius, values, look, color=colour, label=f"greatest $|p_{axis}|$")
        axes.axhline(1e3 * rows[0].stated_reach, color="black", lw=1, ls=":", label="paper")
        axes.set(xlabel="base radius g (mm)", ylabel="reach (mm)")
        axes.set_ylim(bottom=0)
        axes.set_title("Parasitic reach for 50 mm of leg stroke", loc="left")
        axes.legend(loc="upper left", frameon=False)
    return figure_of(axes)


def _label_space(
    axes: Axes3D, labels: Sequence[str] = _POSITION, size: int | None = None, ticks: int = 5
) -> None:
    for axis, label in zip((axes.xaxis, axes.yaxis, axes.zaxis), labels, strict=True):
        axis.set_label_text(label, fontsize=size)
        axis.set_major_locator(MaxNLocator(ticks))
        axis.set_tick_params(labelsize=size or 9)


def _draw_robot(axes: Axes3D, base: Array, tips: Array) -> None:
    axes.add_collection3d(Poly3DCollection([base], facecolor=(*to_rgba(_CYLINDER)[:3], 0.25)))
    axes.add_collection3d(Poly3DCollection([tips], facecolor=(*to_rgba(_PLATFORM)[:3], 0.5)))
    for leg, colour in enumerate(LEG_COLOURS):
        axes.plot(*np.stack([base[leg], tips[leg]], axis=1), color=colour, lw=2)
        axes.scatter(*tips[leg][:, None], color=colour, s=12)


def _draw_cylinder(axes: Axes3D, radius: float, low: float, high: float) -> None:
    turn, height = np.meshgrid(np.linspace(0, 2 * np.pi, 73), [low, high])
    circle = radius * np.cos(turn), radius * np.sin(turn), height
    axes.plot_surface(*circle, color=_CYLINDER, alpha=0.25, lw=0)
    for end in zip(*circle, strict=True):
        axes.plot(*end, color=_CYLINDER, lw=1)


def _shaded(triangles: Array) -> Array:
    """Return a colour for each triangle (n, 3, 3), lighter where it faces up and to the viewer.

    Axes are scaled first, so that the light falls on what is drawn and not on slivers.
    """
    span = np.ptp(triangles.reshape(-1, 3), axis=0)
    scaled = triangles / np.where(span > 0, span, 1.0)
    normal = np.cross(scaled[:, 1] - scaled[:, 0], scaled[:, 2] - scaled[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    light = (normal / np.where(size > 0, size, 1.0)) @ np.array([0.36, -0.48, 0.8])
    brightness = 0.65 + 0.35 * light[:, None]
    colour = np.array(to_rgba(_INSIDE)[:3])
    rgb: Array = np.clip(colour * brightness + (1 - brightness) * 0.1, 0.0, 1.0)
    return rgb
