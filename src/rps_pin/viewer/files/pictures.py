"""Pictures of pages, drawn in software by a headless Chromium: the same on every machine."""

from __future__ import annotations

import io
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from rps_pin.errors import InputError, RPSPinError
from rps_pin.validation import positive_number
from rps_pin.viewer.files.browser import opened_page

_LARGEST = 8192
_PICTURE = "document.body.classList.add(%r); document.getElementById('legend').open = true"
_BACKGROUND = "body { background: %s !important; }"
_SEEK = "viewer.animator.pause(); viewer.animator.seek(%r); viewer.render()"

Progress = Callable[[Iterable[float]], Iterable[float]]


class PictureStyle(NamedTuple):
    """Size and style of a picture; see `save_png`."""

    size: tuple[int, int]
    scale: float
    background: str | None
    captions: bool


def picture_style(
    size: Sequence[int], scale: float, background: str | None, captions: bool
) -> PictureStyle:
    """Return a style, or raise `InputError` if size or scale do not fit."""
    try:
        width, height = (int(side) for side in size)
    except (TypeError, ValueError):
        raise InputError(f"size = {size!r}; it must be a width and a height in pixels") from None
    positive_number(scale, "scale")
    if not min(width, height) * scale >= 16 or not max(width, height) * scale <= _LARGEST:
        raise InputError(
            f"size {width} x {height}, scale {scale:g}: 16 to {_LARGEST} pixels a side"
        )
    return PictureStyle((width, height), scale, background, captions)


def take_pictures(
    text: str, times: Iterable[float], stop: threading.Event, style: PictureStyle
) -> Iterator[bytes]:
    """Give a page's picture at each time, as PNG files.

    Parameters
    ----------
    text
        The page, as HTML.
    times
        Of the page's motion, s.
    stop
        Set it to end early.
    style
        Of the pictures.
    """
    plain, transparent = style.background is not None, style.background == "transparent"
    css = _BACKGROUND % (style.background or "#f4f6f9")
    with opened_page(text, style.size, style.scale) as page:
        for name in ("picture", *(() if style.captions else ("bare",))):
            page.evaluate(_PICTURE % name)
        page.evaluate("viewer.set_3d_pane_size()")  # the canvas to the window's size
        if plain:
            page.evaluate("viewer.hide_background()")
        for time in times:
            if stop.is_set():
                raise RPSPinError("stopped before the last picture")
            page.evaluate(_SEEK % float(time))
            yield page.screenshot(style=css, omit_background=transparent, animations="disabled")


def pixels_of(png: bytes) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Return a picture's pixels, shape (height, width, 3)."""
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))
