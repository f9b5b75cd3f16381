"""Take pictures of pages of the built site, as a phone and as a desktop show them.

Run it after `make docs`, in an environment with the development dependencies and a Chromium:

    .venv/bin/python tools/site_pictures.py build/docs build/look/site

It names pages that are wider than the screen, and texts too small to read.
"""

from __future__ import annotations

import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from rps_pin.viewer.files.browser import ARGUMENTS, find_browser

PAGES = {
    "index": "index",
    "tutorial": "tutorial",
    "mechanisms": "mechanisms",
    "api": "api/objects/rps_pin.closed_loop.ClosedLoopModel",
    "gallery": "gallery",
}
SCREENS = {"phone": (390, 844), "desktop": (1280, 800)}
TALLEST = 12_000  # pixels of a page that are shown
SMALLEST = 10.0  # pixels of a letter
#: Of a page: how far it is wider than the screen, and texts below a size, with their sizes.
_FAULTS = """(least) => {
  const small = new Set();
  const walk = document.createTreeWalker(document.querySelector("article"), NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const text = walk.currentNode.textContent.trim();
    const parent = walk.currentNode.parentElement;
    const seen = parent.checkVisibility() && !parent.closest("mjx-container");
    const size = parseFloat(getComputedStyle(parent).fontSize);
    if (text && seen && size < least) small.add(`${size} px: ${text.slice(0, 40)}`);
  }
  const parts = [document.documentElement, document.querySelector(".content")];
  const wider = Math.max(...parts.map((part) => part.scrollWidth - part.clientWidth));
  return [wider, [...small].slice(0, 5)];
}"""


def take_site_pictures(site: Path, folder: Path) -> list[str]:
    """Write PAGE_SCREEN.png (the top) and PAGE_SCREEN_whole.png; return what is ugly.

    Parameters
    ----------
    site
        The built site.
    folder
        Where the pictures go; it is made.
    """
    folder.mkdir(parents=True, exist_ok=True)
    ugly = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=find_browser(), args=ARGUMENTS)
        for screen, (width, height) in SCREENS.items():
            for name, page in PAGES.items():
                tab = browser.new_page(viewport={"width": width, "height": height})
                tab.goto((site / f"{page}.html").resolve().as_uri())
                tab.wait_for_timeout(2000)  # the scene draws
                tab.screenshot(path=folder / f"{name}_{screen}.png")
                tall = min(TALLEST, tab.evaluate("document.documentElement.scrollHeight"))
                tab.set_viewport_size({"width": width, "height": tall})  # loads all scenes
                tab.wait_for_timeout(2500 * len(tab.frames))
                tab.screenshot(path=folder / f"{name}_{screen}_whole.png")
                wider, small = tab.evaluate(_FAULTS, SMALLEST)
                if wider > 0:
                    ugly.append(f"{name} on a {screen}: {wider} px wider than the screen")
                ugly += [f"{name} on a {screen}: {text}" for text in small]
                tab.close()
        browser.close()
    return ugly


if __name__ == "__main__":
    print("\n".join(take_site_pictures(Path(sys.argv[1]), Path(sys.argv[2]))) or "nothing is ugly")
