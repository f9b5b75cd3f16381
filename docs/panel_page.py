"""Write the rates and the picture of docs/panel.md.

Run it from the checkout, on an idle machine, in an environment with the
development dependencies and a Chromium (half a minute):

    .venv/bin/python -m docs.panel_page
"""

from __future__ import annotations

from pathlib import Path

from benchmarks.panel_rate import measured, opened
from docs.marked import block, replaced

HERE = Path(__file__).parent
PAGE = HERE / "panel.md"


def main() -> None:
    """Measure and write both."""
    text = replaced(PAGE.read_text("utf-8"), "rate", block(measured()))
    PAGE.write_text(text, "utf-8")
    with opened(1000) as (_, page):
        page.wait_for_timeout(1000)
        page.screenshot(path=HERE / "images" / "panel.png")


if __name__ == "__main__":
    main()
