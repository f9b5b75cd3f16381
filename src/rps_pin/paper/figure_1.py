"""The mechanism with its vectors, drawn from computed vectors: the paper's Fig. 1."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from rps_pin.arrays import Array
from rps_pin.plots.style import LEG_COLOURS, PAGE, styled
from rps_pin.rps.kinematics.legs import RADIAL
from rps_pin.rps.robot import RPSRobot

#: Of the drawing: high, and tilted enough for the platform's axes to be seen apart.
POSE = (0.62, 0.25, 0.25)
_RIGHT = np.array([np.sin(np.deg2rad(42)), np.cos(np.deg2rad(42)), 0.0])
"""To the right on paper."""
_VIEW = {"elev": 32, "azim": -42}


@styled
def plot_mechanism(robot: RPSRobot) -> Figure:
    """Draw (a) the 3-RPS with its joints and (b) its vectors a_i, d_i, q_i, p and b_i."""
    p, turn = robot.platform_placement(POSE)
    feet = robot.parameters.base_radius * RADIAL
    tips = p + robot.parameters.platform_radius * RADIAL @ turn.T  # Eq. 1
    figure = Figure(figsize=(PAGE, 3.5))
    # Notebooks cut to what is drawn, without texts in space: this is as large as the figure.
    figure.add_artist(Rectangle((0, 0), 1, 1, transform=figure.transFigure, fill=False, lw=0))
    figure.subplots_adjust(left=0.03, right=1.03, bottom=0, top=0.93, wspace=0)
    for column, (title, draw) in enumerate(
        (("(a) joints and legs", _draw_joints), ("(b) vectors of leg 1", _draw_vectors))
    ):
        axes = figure.add_subplot(1, 2, column + 1, projection="3d")
        assert isinstance(axes, Axes3D)  # what the projection "3d" makes
        axes.add_collection3d(Poly3DCollection([feet], facecolor=(0.6, 0.6, 0.6, 0.25)))
        axes.add_collection3d(Poly3DCollection([tips], facecolor=(0.9, 0.62, 0.0, 0.35)))
        draw(axes, feet, tips, p)
        _frame(
            axes, np.zeros(3), np.eye(3), 0.15, "XYZ" if column == 0 else " Y "
        )  # X, Z on a_1, p
        axes.set(xlim=(-0.35, 0.5), ylim=(-0.425, 0.425), zlim=(0.0, 0.74))
        axes.set_box_aspect((0.85, 0.85, 0.74), zoom=1.15)
        axes.view_init(**_VIEW)
        axes.set_axis_off()
        axes.set_title(title, y=1.0)
    return figure


def _draw_joints(axes: Axes3D, feet: Array, tips: Array, _: Array) -> None:
    for leg, colour in enumerate(LEG_COLOURS):
        foot, tip = feet[leg], tips[leg]
        half = foot + 0.55 * (tip - foot)
        _line(axes, foot, half, color=colour, lw=4)  # cylinder
        _line(axes, half, tip, color=colour, lw=1.5)  # rod
        across = 0.05 * np.cross([0.0, 0.0, 1.0], RADIAL[leg])
        _line(axes, foot - across, foot + across, color="black", lw=2)  # revolute axis
        axes.scatter(*tip[:, None], color="black", s=20, depthshade=False)
        side, ha = (1, "left") if leg == 0 else (-1, "right")  # leg 1 is on the right
        beside = 0.05 * side * _RIGHT
        for place, name in (
            (foot + 1.4 * beside, f"$A_{leg + 1}$ (R)"),
            (tip + beside + [0, 0, 0.02], f"$B_{leg + 1}$ (S)"),
            (foot + 0.5 * (tip - foot) + beside, f"$d_{leg + 1}$ (P)"),
        ):
            axes.text(*place, name, ha=ha, va="center")


def _draw_vectors(axes: Axes3D, feet: Array, tips: Array, p: Array) -> None:
    black = "black"
    for leg in (1, 2):
        _line(axes, feet[leg], tips[leg], color="0.6", lw=1.5)
    arrows = (
        (np.zeros(3), feet[0], r"$\mathbf{a}_1$", LEG_COLOURS[0], -0.1 * _RIGHT),
        (feet[0], tips[0], r"$\mathbf{d}_1 = \mathbf{q}_1 - \mathbf{a}_1$", LEG_COLOURS[1],
         0.02 * _RIGHT),
        (np.zeros(3), tips[0], r"$\mathbf{q}_1$", LEG_COLOURS[2], 0.02 * _RIGHT),
        (np.zeros(3), p, r"$\mathbf{p}$", black, -0.06 * _RIGHT),
        (p, tips[0], r"$\mathbf{R}\,\mathbf{b}_1$", "#CC79A7", 0.1 * _RIGHT + [0, 0, 0.04]),
    )  # fmt: skip
    for start, end, name, colour, shift in arrows:
        axes.quiver(*start, *(end - start), color=colour, lw=1.4, arrow_length_ratio=0.07)
        axes.text(*((start + end) / 2 + shift), name, color=colour)
    inwards, along = -RADIAL[0], tips[0] - feet[0]
    phi = np.arccos(inwards @ along / np.linalg.norm(along))
    sweep = np.linspace(0.0, phi, 30)[:, None]
    arc = feet[0] + 0.12 * (np.cos(sweep) * inwards + np.sin(sweep) * np.array([0.0, 0.0, 1.0]))
    axes.plot(*arc.T, color=black, lw=1)
    axes.text(*(arc[15] + [-0.05, 0, 0.02]), r"$\phi_1$", ha="center")
    axes.text(*p, "P", ha="right", va="bottom")
    axes.text(0, 0, 0, "O", ha="right", va="top")


def _frame(axes: Axes3D, origin: Array, turn: Array, size: float, names: str) -> None:
    for way, name in zip(turn.T, names, strict=True):
        axes.quiver(*origin, *(size * way), color="0.35", lw=1, arrow_length_ratio=0.12)
        axes.text(*(origin + 1.1 * size * way), name, color="0.35")


def _line(axes: Axes, start: Array, end: Array, **style: Any) -> None:
    axes.plot(*np.stack([start, end], axis=1), **style)
