"""Rate at which a panel's page shows new readings, in a headless Chromium.

    .venv/bin/python -m benchmarks.panel_rate

Two ways: by the sliders' values set here, thirty times a second, and by an arrow key held down in
the page, whose own code (viser's) sends no more than one message in 50 ms. Where there is no GPU
the picture is drawn by the processor, and the cores are shared with the panel.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from playwright.sync_api import sync_playwright

from rps_pin import RPSRobot
from rps_pin.panel import BrowserPanel, RPSPanel
from rps_pin.viewer.files.browser import ARGUMENTS, find_browser

SECONDS = 5.0
#: Counts the lengths of the first leg that the readings show one after the other.
WATCH = """() => {
    let last = "";
    window.shown = 0;
    new MutationObserver(() => {
        const found = document.body.textContent.match(/leg 1\\s*([0-9.]{7})/);
        if (found && found[1] != last) { last = found[1]; window.shown += 1; }
    }).observe(document.body, {subtree: true, childList: true, characterData: true});
}"""


def main() -> None:
    """Measure both and print them."""
    print("\n".join(measured()))


def measured() -> list[str]:
    """Return a line of results for each size of the page."""
    lines = []
    for width in (1000, 1500):
        with opened(width) as (face, page):
            told, held = by_program(face, page), by_key(page)
        lines.append(
            f"{width} x {2 * width // 3}: {told:.1f} readings shown a second, sliders set by "
            f"program; {held:.1f}, arrow key held in the page"
        )
    return lines


def by_program(face: BrowserPanel, page: Any) -> float:
    """Return the rate at which the page shows what is set here."""
    heights = itertools.cycle([218.0 + 0.1 * k for k in range(120)])
    return rate(page, lambda: face.move("pose", [next(heights), 0.0, 0.0]))


def by_key(page: Any) -> float:
    """Return the rate at which the page shows what a key of its own changes."""
    page.get_by_role("slider").first.focus()
    return rate(page, lambda: page.keyboard.press("ArrowLeft"))


@contextmanager
def opened(width: int) -> Iterator[tuple[BrowserPanel, Any]]:
    """Serve a panel, and open its page."""
    panel = RPSPanel(RPSRobot.from_preset("micro"))
    with BrowserPanel(panel, title="micro") as face, sync_playwright() as engine:
        browser = engine.chromium.launch(executable_path=find_browser(), args=list(ARGUMENTS))
        page = browser.new_page(viewport={"width": width, "height": 2 * width // 3})
        page.goto(face.url)
        page.get_by_text("within all limits").wait_for(timeout=60_000)
        page.evaluate(WATCH)
        time.sleep(2.0)
        yield face, page
        browser.close()


def rate(page: Any, call: Callable[[], object]) -> float:
    """Return the readings shown a second while something is called thirty times a second."""
    before = page.evaluate("window.shown")
    begin = time.perf_counter()
    for k in range(int(30 * SECONDS)):
        call()
        time.sleep(max(0.0, begin + k / 30 - time.perf_counter()))
    elapsed = time.perf_counter() - begin
    return float(page.evaluate("window.shown") - before) / elapsed


if __name__ == "__main__":
    main()
