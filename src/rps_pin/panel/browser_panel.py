"""Panel in the browser: sliders, readings and the robot in viser's page, on this machine only."""

from __future__ import annotations

import html
import threading
from collections.abc import Sequence
from typing import Any, Self

from rps_pin.panel.guarded_server import guarded_server, stop
from rps_pin.panel.panel import Panel, Slider
from rps_pin.plain_text import plain
from rps_pin.viewer import Layer, View
from rps_pin.viewer.writers.viser_writer import ViserWriter

_STYLE = "font-size: 85%; line-height: 1.3; margin: 0 0.8em 0.8em"


class BrowserPanel:
    """A panel on a page of its own, served while a ``with`` block lasts.

    Parameters
    ----------
    panel
        An `RPSPanel` or a `MechanismPanel`.
    port
        The port to serve on. Default: a free one from 8080 on.
    title
        Plain text, above the sliders.
    layers, hidden
        Layers as for `rps_pin.viewer.View`, with a switch for each below the readings; those in
        `hidden` are switched off at first. Forces are those that hold the weight.

    Attributes
    ----------
    url : str
        Address to open in a browser on this machine. A token in it lets the page in; requests
        without it, from pages of other sites, or by another name of this machine, are refused.
    view : View
        The robot with its layers.

    Raises
    ------
    RPSPinError
        If viser is not installed; says how to install it.
    InputError
        If the port cannot be used, or a layer is unknown or does not fit the mechanism.
    """

    def __init__(
        self,
        panel: Panel,
        *,
        port: int | None = None,
        title: str = "Robot",
        layers: Sequence[str | Layer] = (),
        hidden: Sequence[str | Layer] = (),
    ) -> None:
        self._panel, self._lock, self._following = panel, threading.RLock(), False
        self._server: Any
        self._server, self.url = guarded_server(port)
        try:
            self._server.gui.configure_theme(show_logo=False, show_share_button=False)
            self._server.gui.main_panel.dock_right()
            self._heading = self._server.gui.add_html(
                f'<h2 style="{_STYLE}">{_escaped(title)}</h2>'
            )
            self._sliders = {
                group: [
                    (slider, self._handle(group, slider, value))
                    for slider, value in zip(sliders, panel.values(group).tolist(), strict=True)
                ]
                for group, sliders in panel.groups.items()
            }
            self._text = self._server.gui.add_html("")
            self.view = View(
                ViserWriter(self._server),
                getattr(panel, "robot", panel.mechanism),
                panel.configuration,
                visual=panel.visual_model(),
                layers=layers,
                hidden=hidden,
            )
            self._update()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the server."""
        stop(self._server)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def text(self) -> str:
        """The readings, as HTML."""
        return str(self._text.content)

    def move(self, group: str, shown: Sequence[float]) -> None:
        """Set the sliders of a group, in the units they show, as a user of the page does."""
        for (_, handle), value in zip(self._sliders[group], shown, strict=True):
            handle.value = value

    def shown(self, group: str) -> list[float]:
        """Return where the sliders of a group are, in the units they show."""
        return [float(handle.value) for _, handle in self._sliders[group]]

    def _handle(self, group: str, slider: Slider, value: float) -> Any:
        now = slider.scale * value
        handle = self._server.gui.add_slider(
            plain(slider.name),
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
            if self._following:  # set here, not by a user
                return
            values = [handle.value / slider.scale for slider, handle in self._sliders[group]]
            self._panel.move(group, values)
            self.view.display(self._panel.configuration)
            self._update(moved=group)

    def _update(self, moved: str | None = None) -> None:
        """Show the readings, and put the sliders of all other groups where the panel is."""
        self._text.content = f'<div style="{_STYLE}">{_as_html(self._panel)}</div>'
        self._following = True
        try:
            for group in self._panel.groups.keys() - {moved}:
                values = self._panel.values(group).tolist()
                for (slider, handle), value in zip(self._sliders[group], values, strict=True):
                    handle.value = min(max(slider.scale * value, handle.min), handle.max)
        finally:
            self._following = False


def _as_html(panel: Panel) -> str:
    """Return broken limits or refusals as a line, and the readings as a table."""
    words = "<br>".join(map(_escaped, panel.trouble))
    colour = "#b00000" if words else "#006000"
    rows = "".join(
        f"<tr><td>{_escaped(name)}</td><td>{_escaped(value)}</td></tr>"
        for name, value in panel.readings()
    )
    line = f'<p style="color:{colour}; margin: 0.5em 0">{words or "within all limits"}</p>'
    return f"{line}<table>{rows}</table>"


def _escaped(text: str) -> str:
    return html.escape(plain(text))
