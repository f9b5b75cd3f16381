"""Headless Chromium, by Playwright; both are optional."""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from rps_pin.errors import RPSPinError
from rps_pin.interruption import scratch_folder

if TYPE_CHECKING:
    from playwright.sync_api import Page, ViewportSize

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
"""Programs that are searched for, after the one in ``RPS_PIN_CHROMIUM``."""
ARGUMENTS = [
    "--no-sandbox",
    # WebGL without a graphics card: Chromium's own software renderer, the same everywhere.
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--force-color-profile=srgb",
]
_LOAD_SECONDS = 60.0
#: Where Chromium makes a socket, and the longest path of one, bytes.
_SOCKET, _LONGEST_SOCKET = "org.chromium.Chromium.XXXXXX/SingletonSocket", 103
_Answer = TypeVar("_Answer")


def in_own_thread(work: Callable[[threading.Event], _Answer]) -> _Answer:
    """Call `work` in a new thread and return its result.

    Playwright refuses threads with an event loop, as Jupyter's. The event that `work` is given is
    set at Ctrl-C.
    """
    stop = threading.Event()
    with ThreadPoolExecutor(1, thread_name_prefix="rps_pin pictures") as pool:
        try:
            return pool.submit(work, stop).result()
        except BaseException:
            stop.set()
            raise


@contextmanager
def opened_page(text: str, size: tuple[int, int], scale: float) -> Iterator[Page]:
    """Give a page that has been loaded and drawn once, in a new browser.

    Parameters
    ----------
    text
        The page, as HTML of `recorded_page`.
    size
        Width and height of the window, in CSS pixels.
    scale
        Pixels of the picture per CSS pixel.

    Raises
    ------
    RPSPinError
        If Playwright or a browser is missing, or the page cannot be shown; says what to do.
    """
    try:
        from playwright.sync_api import Error, sync_playwright  # noqa: PLC0415
    except ImportError:
        raise RPSPinError(
            "pictures need Playwright: pip install 'rps-pin[pictures]' (and a Chromium: "
            "apt-get install chromium, or playwright install chromium)"
        ) from None
    with scratch_folder() as folder, sync_playwright() as playwright:
        try:
            browser = playwright.chromium.launch(
                executable_path=find_browser(),
                args=ARGUMENTS,
                env=_environment(folder),
            )
        except Error as error:
            raise RPSPinError(
                "pictures need a Chromium that runs: apt-get install chromium, or playwright "
                "install chromium, or set RPS_PIN_CHROMIUM to its path. The error: "
                f"{str(error).strip().splitlines()[0]}"
            ) from None
        try:
            viewport: ViewportSize = {"width": size[0], "height": size[1]}
            page = browser.new_page(viewport=viewport, device_scale_factor=scale)
            page.set_default_timeout(1e3 * _LOAD_SECONDS)
            wrong: list[str] = []
            page.on("pageerror", lambda error: wrong.append(str(error)))
            page.set_content(text)
            if wrong:
                raise RPSPinError(f"the browser cannot show the page: {wrong[0]}")
            yield page
        finally:
            browser.close()


def _environment(folder: Path) -> dict[str, str | float | bool]:
    """Return Chromium's environment: `folder` takes what it does not remove if a signal ends it."""
    fits = len(os.fsencode(folder / _SOCKET)) <= _LONGEST_SOCKET
    return {**os.environ, "TMPDIR": str(folder)} if fits else {**os.environ}


def find_browser() -> str | None:
    """Return the path of a Chromium, or None to leave it to Playwright, which may have its own."""
    named = os.environ.get("RPS_PIN_CHROMIUM")
    if named:
        return shutil.which(named) or named
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)
