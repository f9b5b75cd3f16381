"""Write the rates and the picture of docs/panel.md.

Run it from the checkout, on an idle machine, in an environment with the
development dependencies and a Chromium (half a minute):

    .venv/bin/python -m docs.panel_page             # both
    .venv/bin/python -m docs.panel_page picture     # on a busy machine
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import sync_playwright

from benchmarks.panel_rate import measured
from docs.marked import block, replaced
from rps_pin import RPSRobot, helix
from rps_pin.panel import BrowserPanel, PoseFile, RPSPanel
from rps_pin.viewer.files.browser import ARGUMENTS, find_browser

HERE = Path(__file__).parent
PAGE = HERE / "panel.md"
SIZE = {"width": 1280, "height": 800}


def main() -> None:
    """Measure and write both, or draw the picture."""
    draw(HERE / "images" / "panel.png")
    if sys.argv[1:] != ["picture"]:
        text = replaced(PAGE.read_text("utf-8"), "rate", block(measured()))
        PAGE.write_text(text, "utf-8")


def draw(file: Path) -> None:
    """Take a picture of the panel of the micro robot, 2 s after the begin of a helix."""
    robot = RPSRobot.from_preset("micro")
    panel = RPSPanel(robot)
    panel.load(helix(robot, radius=4e-4, pitch=0.006, height=0.225))
    with TemporaryDirectory() as folder, sync_playwright() as engine:
        poses = PoseFile(Path(folder) / "poses.yaml", panel)
        poses.save("level", [0.225, 0.0, 0.0])
        face = BrowserPanel(
            panel, title="3-RPS micro", layers=["forces"], hidden=["limits", "trail"], poses=poses
        )
        with face:
            browser = engine.chromium.launch(executable_path=find_browser(), args=list(ARGUMENTS))
            page = browser.new_page(viewport=SIZE)
            page.goto(face.url)
            page.get_by_text("within all limits").wait_for(timeout=60_000)
            face._scrub.value = 2.0
            page.get_by_text("t = 2.00 s").wait_for(timeout=60_000)
            page.wait_for_timeout(3000)
            picture = Image.open(io.BytesIO(page.screenshot()))
            browser.close()
    picture.convert("RGB").save(file, optimize=True)


if __name__ == "__main__":
    main()
