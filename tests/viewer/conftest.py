"""A browser to look at the pages with, and what it is to look at."""

from __future__ import annotations

import io
import os
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from tests.viewer.robots import Sample, sample_robot

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# WebGL without a graphics card: Chromium's own software renderer.
ARGUMENTS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]


@pytest.fixture(scope="session")
def sample() -> Sample:
    return sample_robot()


# Not for the session: Playwright keeps an event loop running, and other tests need their own.
@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A headless Chromium with WebGL: RPS_PIN_CHROMIUM (empty: none), or the first found."""
    found = os.environ.get("RPS_PIN_CHROMIUM")
    if found is None:
        found = next((path for name in BROWSERS if (path := shutil.which(name))), "")
    if not found:
        pytest.skip(
            f"no browser found ({', '.join(BROWSERS)}); "
            "on Debian and Ubuntu: apt-get install chromium"
        )
    with sync_playwright() as playwright:
        instance = playwright.chromium.launch(executable_path=found, args=ARGUMENTS)
        yield instance
        instance.close()


@dataclass
class Watched:
    """A page together with everything that it asked for and complained about."""

    page: Page
    requests: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)

    def wait(self, expression: str, seconds: float = 120.0) -> None:
        """Wait until a JavaScript expression is true.

        Playwright's own wait_for_function evaluates text inside the page, which the pages'
        Content-Security-Policy forbids.
        """
        deadline = time.monotonic() + seconds
        while not self.page.evaluate(expression):
            assert time.monotonic() < deadline, f"still not true after {seconds} s: {expression}"
            self.page.wait_for_timeout(50)

    def picture(self) -> np.ndarray:
        """Return the canvas as it is drawn now, without the panels over it: (h, w, 3), 0 to 255."""
        self.page.evaluate("viewer.render()")
        shot = self.page.locator("#meshcat-pane canvas").screenshot(style=PANELS_HIDDEN)
        return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"), dtype=np.float64)


PANELS_HIDDEN = "#caption, .dg { visibility: hidden !important; }"


def watching(browser: Browser) -> Watched:
    """Open an empty page and watch it."""
    page = browser.new_page(viewport={"width": 800, "height": 600})
    page.set_default_timeout(120_000)
    watch = Watched(page)
    page.on("request", lambda request: watch.requests.append(request.url))
    page.on("pageerror", lambda error: watch.complaints.append(f"error: {error}"))
    page.on(
        "console",
        lambda message: (
            watch.complaints.append(f"{message.type}: {message.text}")
            if message.type in ("error", "warning")
            else None
        ),
    )
    return watch


@pytest.fixture
def watched(browser: Browser) -> Iterator[Watched]:
    watch = watching(browser)
    yield watch
    watch.page.close()


def open_text(watch: Watched, text: str, path: Path) -> Watched:
    """Write a page's text to disk and open it as a file."""
    path.write_text(text, encoding="utf-8")
    watch.page.goto(path.as_uri())
    watch.wait("typeof viewer !== 'undefined' && !viewer.needs_render")
    return watch


@pytest.fixture
def show(watched: Watched, tmp_path: Path):
    """Write a page's text to disk, open it as a file, and return the watched page."""

    return lambda text: open_text(watched, text, tmp_path / "page.html")
