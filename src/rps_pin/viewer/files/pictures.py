"""Pictures and films of pages, for papers: drawn by a browser that nobody sees.

The size is as asked, and the light is the same on every machine: Chromium draws in software.
"""

from __future__ import annotations

import io
import math
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from rps_pin.errors import InputError, RPSPinError
from rps_pin.viewer.files.browser import opened_page

if TYPE_CHECKING:
    from playwright.sync_api import Page

_LARGEST = 8192
_PICTURE = "document.body.classList.add('picture')"
_NO_PANELS = ".dg { visibility: hidden !important; } body { background: %s !important; }"
_NO_CAPTIONS = "#caption, #layers { visibility: hidden !important; }"
_SEEK = "viewer.animator.pause(); viewer.animator.seek(%r); viewer.render()"

Progress = Callable[[Iterable[float]], Iterable[float]]


def checked_size(size: Sequence[int], scale: float) -> tuple[int, int]:
    """Return width and height as integers, or raise `InputError`."""
    try:
        width, height = (int(side) for side in size)
    except (TypeError, ValueError):
        raise InputError(f"size = {size!r}; it must be a width and a height in pixels") from None
    if not math.isfinite(scale) or scale <= 0.0:
        raise InputError(f"scale = {scale}; it must be positive")
    if not min(width, height) * scale >= 16 or not max(width, height) * scale <= _LARGEST:
        raise InputError(
            f"size {width} x {height}, scale {scale:g}: 16 to {_LARGEST} pixels a side"
        )
    return width, height


def take_pictures(
    text: str,
    times: Iterable[float],
    stop: threading.Event,
    *,
    size: tuple[int, int],
    scale: float = 1.0,
    background: str | None = None,
    captions: bool = True,
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
    size, scale, background, captions
        As for `save_png`.
    """
    transparent = background == "transparent"
    style = _NO_PANELS % (background or "#f4f6f9") + ("" if captions else _NO_CAPTIONS)
    with opened_page(text, size, scale) as page:
        page.evaluate(_PICTURE)
        _prepare(page, plain=background is not None)
        for time in times:
            if stop.is_set():
                raise RPSPinError("stopped before the last picture")
            page.evaluate(_SEEK % float(time))
            yield page.screenshot(style=style, omit_background=transparent, animations="disabled")


def _prepare(page: Page, *, plain: bool) -> None:
    """Bring the canvas to the window's size, and take the coloured sky away if need be."""
    page.evaluate("viewer.set_3d_pane_size()")
    if plain:
        page.evaluate("viewer.hide_background()")


def as_image(png: bytes) -> Image.Image:
    """Return a picture for Pillow."""
    return Image.open(io.BytesIO(png))


def as_array(png: bytes) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Return a picture's pixels, shape (height, width, 3)."""
    return np.asarray(as_image(png).convert("RGB"))
