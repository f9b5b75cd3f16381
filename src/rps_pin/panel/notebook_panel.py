"""Panel in a notebook: the page of `BrowserPanel` in a frame below the cell."""

from __future__ import annotations

from typing import Any

from rps_pin.panel.browser_panel import BrowserPanel

_WIDTH, _HEIGHT = 1000, 700


class NotebookPanel(BrowserPanel):
    """Sliders and readings beside the robot, in a notebook; `close` ends it.

    The parameters and attributes are those of `BrowserPanel`. A notebook that runs on another
    machine must forward the panel's port to the browser's machine.

    Examples
    --------
    >>> NotebookPanel(RPSPanel(robot))  # doctest: +SKIP
    """

    @property
    def widget(self) -> Any:
        """The frame as an ``IPython.display.IFrame``, to display in another cell."""
        from IPython.display import IFrame  # noqa: PLC0415

        return IFrame(self.url, _WIDTH, _HEIGHT)

    def _repr_html_(self) -> str:
        size = f'width="{_WIDTH}" height="{_HEIGHT}"'
        return f'<iframe src="{self.url}" {size} frameborder="0"></iframe>'
