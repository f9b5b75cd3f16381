"""Live view of a robot with its layers, in a browser on this machine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import pinocchio as pin

from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.rps.robot import RPSRobot
from rps_pin.viewer.displayed_mechanism import without_shapes
from rps_pin.viewer.layers.base import Layer
from rps_pin.viewer.server.local_viewer import LocalViewer
from rps_pin.viewer.view import View


@contextmanager
def show(
    what: RPSRobot | ClosedLoopModel,
    motion: Any = None,
    *,
    visual: pin.GeometryModel | None = None,
    layers: Sequence[str | Layer] = (),
    hidden: Sequence[str | Layer] = (),
    title: str | None = None,
    port: int | None = None,
) -> Iterator[LocalView]:
    """Serve a view to browsers on this machine while a ``with`` block lasts.

    Parameters
    ----------
    what, motion, visual, layers, hidden
        As for `View`.
    title
        As for `save_html`.
    port
        As for `LocalViewer`.

    Yields
    ------
    LocalView
        A `View` with an address, `url`.

    Examples
    --------
    >>> with show(robot, path, layers=["trail", "forces"]) as view:  # doctest: +SKIP
    ...     print(view.url)
    ...     view.play()
    """
    with LocalViewer(port, title=title or without_shapes(what).title) as viewer:
        yield LocalView(viewer, what, motion, visual=visual, layers=layers, hidden=hidden)


class LocalView(View):
    """A `View` in a `LocalViewer`.

    Attributes
    ----------
    url : str
        Address to open in a browser on this machine.
    """

    def __init__(
        self, viewer: LocalViewer, what: RPSRobot | ClosedLoopModel, motion: Any, **options: Any
    ) -> None:
        super().__init__(viewer.window, what, motion, **options)
        self.url = viewer.url
