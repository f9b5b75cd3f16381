"""A panel as a page of its own, by viser: sliders, readings and the robot, on this machine only."""

from __future__ import annotations

import contextlib
import io
import threading
from typing import Any, Self

import numpy as np
import pinocchio as pin

from rps_pin.errors import RPSPinError
from rps_pin.panel.sliders import Panel, as_html, asked_by, show_values

HOST = "127.0.0.1"
_STYLE = "font-size: 85%; line-height: 1.3; margin: 0 0.8em 0.8em"


class BrowserPanel:
    """Serve a panel while a ``with`` block lasts.

    Parameters
    ----------
    panel
        An `RPSPanel` or a `MechanismPanel`.
    port
        To serve on; a free one from 8080 on if left out.
    title
        Plain text, above the sliders.

    Attributes
    ----------
    url : str
        Address to open in a browser on this machine.

    Raises
    ------
    RPSPinError
        If viser is not installed; says how to get it.
    """

    def __init__(self, panel: Panel, *, port: int | None = None, title: str = "Robot") -> None:
        try:
            import viser  # noqa: PLC0415
        except ImportError:
            raise RPSPinError(
                "the panel in the browser needs viser: pip install 'rps-pin[panel]'"
            ) from None
        self._panel, self._lock, self._following = panel, threading.RLock(), False
        with contextlib.redirect_stdout(io.StringIO()):  # the address is ours to tell
            self._server: Any = viser.ViserServer(host=HOST, port=port or 8080, verbose=False)
        # A page can ask viser for a tunnel to the world: there is none from here.
        self._server.request_share_url = lambda *_, **__: None  # type: ignore[method-assign]
        self._server.gui.configure_theme(show_logo=False, show_share_button=False)
        self.url = f"http://{HOST}:{self._server.get_port()}"
        self._show_robot()
        self._server.gui.add_markdown(f"## {title}")
        self._sliders = {
            group: [self._slider(group, k) for k in range(len(sliders))]
            for group, sliders in panel.groups.items()
        }
        self._text = self._server.gui.add_html("")
        self._update()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()

    @property
    def text(self) -> str:
        """What is read out, as HTML."""
        return str(self._text.content)

    def move(self, group: str, shown: list[float]) -> None:
        """Move a group's sliders, in the units they show: as someone in the page does."""
        for slider, value in zip(self._sliders[group], shown, strict=True):
            slider.value = value

    def _show_robot(self) -> None:
        from pinocchio.visualize import ViserVisualizer  # noqa: PLC0415

        panel = self._panel
        self._robot = ViserVisualizer(
            panel.mechanism.model, pin.GeometryModel(), panel.visual_model()
        )
        self._robot.initViewer(viewer=self._server)
        self._robot.loadViewerModel("robot")
        self._robot.display(panel.configuration)
        data = panel.mechanism.model.createData()
        pin.framesForwardKinematics(panel.mechanism.model, data, panel.configuration)
        points = np.array([place.translation for place in data.oMf])
        middle, size = points.mean(axis=0), float(np.ptp(points, axis=0).max()) or 1.0
        scene = self._server.scene
        # No shadows nor reflections: without a GPU they take half of the page's frames.
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map(None)
        scene.add_light_hemisphere("/light/sky", intensity=2.0)
        scene.add_light_directional(
            "/light/sun", intensity=1.5, position=(1.0, -1.0, 2.0), cast_shadow=False
        )
        scene.add_grid(
            "/floor",
            width=4 * size,
            height=4 * size,
            cell_size=size / 5,
            position=(0.0, 0.0, float(points[:, 2].min()) - size / 5),
        )
        camera = self._server.initial_camera
        camera.position = tuple(middle + size * np.array([1.4, -1.6, 0.9]))
        camera.look_at = tuple(middle)

    def _slider(self, group: str, number: int) -> Any:
        slider = self._panel.groups[group][number]
        now = slider.scale * float(self._panel.values(group)[number])
        handle = self._server.gui.add_slider(
            slider.name,
            min=min(slider.low, now),
            max=max(slider.high, now),
            step=slider.step,
            initial_value=now,
        )
        handle.on_update(lambda _: self._moved(group))
        return handle

    def _moved(self, group: str) -> None:
        """Follow the sliders of a group."""
        with self._lock:
            if self._following:  # these are ours, not someone's
                return
            self._panel.move(group, asked_by(self._panel, group, self._sliders[group]))
            self._update(moved=group)

    def _update(self, moved: str | None = None) -> None:
        self._robot.display(self._panel.configuration)
        self._text.content = f'<div style="{_STYLE}">{as_html(self._panel)}</div>'
        self._following = True
        try:
            show_values(self._panel, self._sliders, moved)
        finally:
            self._following = False
