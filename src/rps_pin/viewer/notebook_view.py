"""View of a robot in a notebook: a page in a frame below the cell, to turn and to play."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import pinocchio as pin

from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.rps.robot import RPSRobot
from rps_pin.validation import whole_number
from rps_pin.viewer.layers.base import Layer
from rps_pin.viewer.motion import FRAME_RATE
from rps_pin.viewer.save import recorded_view


class NotebookView:
    """A robot with its layers in a notebook: the page of `save_html`, below the cell.

    The page is recorded and part of the cell's output, about 1 MB: it needs no server, and plays
    as long as the notebook's outputs are trusted. Programs that show no HTML print a line.

    Parameters
    ----------
    what, motion, visual, layers, hidden
        As for `View`.
    title, frame_rate
        As for `save_html`.
    height
        Of the frame, pixels of the page.

    Attributes
    ----------
    page : str
        The page, as HTML.
    duration : float
        Of the motion, s; 0 for a pose.

    Raises
    ------
    InputError
        If something cannot be shown.

    Examples
    --------
    >>> NotebookView(robot, path, layers=["trail", "forces"])  # doctest: +SKIP
    """

    def __init__(
        self,
        what: RPSRobot | ClosedLoopModel,
        motion: Any = None,
        *,
        visual: pin.GeometryModel | None = None,
        layers: Sequence[str | Layer] = (),
        hidden: Sequence[str | Layer] = (),
        title: str | None = None,
        frame_rate: float = FRAME_RATE,
        height: int = 480,
    ) -> None:
        self._height = whole_number(height, "height")
        self.page, view = recorded_view(
            what, motion, title, frame_rate, visual=visual, layers=layers, hidden=hidden
        )
        self.duration = view.motion.duration
        self._title = title or view.subject.title

    def _repr_html_(self) -> str:
        return (
            f'<iframe title="{escape(self._title)}" width="100%" height="{self._height}" '
            f'data-duration="{self.duration!r}" sandbox="allow-scripts" frameborder="0" '
            f'srcdoc="{escape(self.page)}"></iframe>'
        )

    def __repr__(self) -> str:
        return f"NotebookView({self._title!r}, {self.duration:.3g} s)"
