"""A panel in Jupyter: ipywidgets beside an embedded Meshcat."""

from __future__ import annotations

import html
from typing import Any, Self

from rps_pin.errors import RPSPinError
from rps_pin.panel.sliders import Panel, as_html, asked_by, show_values
from rps_pin.viewer.scene.scene import Scene
from rps_pin.viewer.server.local_viewer import LocalViewer

_HEIGHT = 480


class NotebookPanel:
    """Sliders and readings beside the robot, in a notebook; `close` ends it.

    Parameters
    ----------
    panel
        An `RPSPanel` or a `MechanismPanel`.
    port
        For the viewer's server; a free one if left out.

    Attributes
    ----------
    url : str
        Address of the viewer, on this machine.
    widget : ipywidgets.HBox
        What to display; the panel itself displays it where it ends a cell.

    Raises
    ------
    RPSPinError
        If ipywidgets is not installed; says how to get it.

    Examples
    --------
    >>> NotebookPanel(RPSPanel(robot))  # doctest: +SKIP
    """

    def __init__(self, panel: Panel, *, port: int | None = None) -> None:
        try:
            import ipywidgets  # noqa: PLC0415
        except ImportError:
            raise RPSPinError(
                "the panel in a notebook needs ipywidgets: pip install 'rps-pin[jupyter]'"
            ) from None
        self._panel, self._following = panel, False
        self._viewer = LocalViewer(port)
        self._viewer.__enter__()
        self.url = self._viewer.url
        self._scene = Scene(
            panel.mechanism.model, panel.visual_model(), self._viewer.window, panel.configuration
        )
        self._sliders: dict[str, list[Any]] = {}
        boxes = []
        for group, sliders in panel.groups.items():
            handles = []
            for slider, value in zip(sliders, panel.values(group), strict=True):
                now = slider.scale * float(value)
                handles.append(
                    ipywidgets.FloatSlider(
                        value=now,
                        min=min(slider.low, now),
                        max=max(slider.high, now),
                        step=slider.step,
                        description=slider.name,
                        readout_format=".2f",
                        style={"description_width": "150px"},
                        layout={"width": "420px"},
                    )
                )
                handles[-1].observe(lambda _, group=group: self._moved(group), "value")
            self._sliders[group] = handles
            boxes += [ipywidgets.HTML(f"<b>{html.escape(group)}</b>"), *handles]
        self.text = ipywidgets.HTML()
        frame = f'<iframe src="{self.url}" width="640" height="{_HEIGHT}" frameborder="0"></iframe>'
        self.widget = ipywidgets.HBox(
            [ipywidgets.HTML(frame), ipywidgets.VBox([*boxes, self.text])]
        )
        self._update()

    def close(self) -> None:
        """End the viewer's server and the widgets."""
        self._viewer.__exit__(None, None, None)
        self.widget.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ipython_display_(self) -> None:
        from IPython.display import display  # noqa: PLC0415

        display(self.widget)  # type: ignore[no-untyped-call]

    def _moved(self, group: str) -> None:
        """Follow the sliders of a group."""
        if self._following:  # these are ours, not someone's
            return
        self._panel.move(group, asked_by(self._panel, group, self._sliders[group]))
        self._update(moved=group)

    def _update(self, moved: str | None = None) -> None:
        self._scene.display(self._panel.configuration)
        self.text.value = as_html(self._panel)
        self._following = True
        try:
            show_values(self._panel, self._sliders, moved)
        finally:
            self._following = False
