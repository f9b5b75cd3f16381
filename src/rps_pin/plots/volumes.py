"""The workspace in space: the paper's Figures 3 to 5. No window is opened."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgba
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from rps_pin.arrays import Array
from rps_pin.plots.space import POSITION, axes_in_space, finish_space, frame_space
from rps_pin.plots.style import BLUE, COLOUR_MAP, GREY, VERMILION, figure_of, styled
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.geometry import boundary, boundary_conditioning
from rps_pin.rps.workspace.result import Workspace


@styled
def plot_theoretical(parameters: RPSParameters, figure: Figure | None = None) -> Figure:
    """Draw the theoretical workspace, as the paper's Fig. 3 does.

    The cylinder of radius h, with the platform level in its middle and turned by half a turn about
    axes in the base plane, where its centre lies on the cylinder.
    """
    h = 1e3 * parameters.platform_radius
    axes = axes_in_space(figure)
    _draw_cylinder(axes, h, -h, h)
    dots = {"s": 14, "depthshade": False, "zorder": 5}
    axes.scatter([0], [0], [0], color="black", label="level: $p_x = p_y = 0$", **dots)
    # Tilt by pi along alpha: p = h (cos 2a', ...), on the cylinder (Eq. 4)
    for i, way in enumerate(np.deg2rad([0.0, 60.0, 120.0])):
        centre = h * np.array([np.cos(2 * way), -np.sin(2 * way), 0.0])
        label = f"turned by 180°: h = {h:.4g} mm" if i == 0 else None
        axes.scatter(*centre[:, None], color=BLUE, label=label, **dots)
        axes.plot(*np.stack([np.zeros(3), centre], axis=1), color=BLUE, lw=0.8)
    labels = (*POSITION[:2], "$p_z$, any height (mm)")
    frame_space(axes, np.full(3, -h), np.full(3, h), labels, ticks=3)
    return finish_space(axes, figure)


@styled
def plot_effective(workspace: Workspace, figure: Figure | None = None) -> Figure:
    """Draw the effective workspace within the theoretical cylinder, as the paper's Fig. 4 does."""
    mesh = boundary(workspace)
    points = 1e3 * mesh.vertices
    h = 1e3 * workspace.parameters.platform_radius
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    axes = axes_in_space(figure)
    _draw_cylinder(axes, h, low, high)
    axes.add_collection3d(Poly3DCollection(points[mesh.faces], color=VERMILION))
    reach = float(np.abs(points[:, :2]).max())
    axes.plot([], [], "s", color=GREY, alpha=0.5, label=f"theoretical: radius {h:.4g} mm")
    axes.plot([], [], "s", color=VERMILION, label=f"effective: within {reach:.3g} mm")
    scales = frame_space(axes, np.array([-h, -h, low]), np.array([h, h, high]), ticks=3)
    return finish_space(axes, figure, scales)


@styled
def plot_space(workspace: Workspace, figure: Figure | None = None) -> Figure:
    """Draw the boundary of the workspace of the centre in space, as the paper's Fig. 5 does.

    The colour is the conditioning there, as in the viewer. The scale of x and y is not that of z,
    which the line below says: the motion along them is parasitic, and much smaller.
    """
    mesh, values = boundary(workspace), boundary_conditioning(workspace)
    points = 1e3 * mesh.vertices
    shape = points[mesh.faces]
    axes = axes_in_space(figure)
    scales = Normalize(float(values.min()), float(values.max()))
    colours = colormaps[COLOUR_MAP](scales(values[mesh.faces].mean(axis=1)))[:, :3]
    lit = np.clip(colours * _light(shape)[:, None], 0.0, 1.0)
    axes.add_collection3d(Poly3DCollection(shape, facecolors=lit, edgecolors=lit, linewidths=0.1))
    words = frame_space(axes, points.min(axis=0), points.max(axis=0))
    found = figure_of(axes)
    beside: Any = {"ax": axes}
    if figure is None:
        beside = {"cax": found.add_axes((0.82, 0.2, 0.03, 0.6), label="<colorbar>")}
    bar = found.colorbar(ScalarMappable(scales, COLOUR_MAP), label="conditioning (1)", **beside)
    bar.ax.grid(visible=False)
    return finish_space(axes, figure, words, right=0.75)


def _draw_cylinder(axes: Axes3D, radius: float, low: float, high: float) -> None:
    turn, height = np.meshgrid(np.linspace(0, 2 * np.pi, 73), [low, high])
    circle = radius * np.cos(turn), radius * np.sin(turn), height
    axes.plot_surface(*circle, color=to_rgba(GREY, 0.2), lw=0, shade=False)
    for end in zip(*circle, strict=True):
        axes.plot(*end, color=GREY, lw=0.8)


def _light(triangles: Array) -> Array:
    """Return the brightness of triangles (n, 3, 3), more where they face up and to the viewer.

    Axes are scaled first, so that the light falls on what is drawn and not on slivers.
    """
    span = np.ptp(triangles.reshape(-1, 3), axis=0)
    scaled = triangles / np.where(span > 0, span, 1.0)
    normal = np.cross(scaled[:, 1] - scaled[:, 0], scaled[:, 2] - scaled[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    light: Array = (normal / np.where(size > 0, size, 1.0)) @ np.array([0.36, -0.48, 0.8])
    return 0.8 + 0.3 * light
