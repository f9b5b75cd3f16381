"""Write what the README shows: its pictures, and the output of its command and its Python lines.

Run it from the checkout, in an environment with the development dependencies and a Chromium:

    .venv/bin/python docs/update_readme.py
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from marked import block, replaced
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
IMAGES = ROOT / "docs" / "images"
BROWSER_OPTIONS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"]


def main() -> None:
    """Make everything anew."""
    text = README.read_text("utf-8")
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", "from rps_pin.cli import main; main()", "helix"]
        shown = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
        text = replaced(text, "rps-pin helix", quoted(shown.stdout.split("Written:")[0]))
        shutil.copy(Path(folder) / "helix" / "figure_9_forces.png", IMAGES / "forces.png")
        photograph(Path(folder) / "helix" / "viewer.html", IMAGES / "robot.png")
    block = re.search(r"```python\n(.*?)```", text, re.DOTALL)
    assert block is not None
    printed = subprocess.run(
        [sys.executable, "-c", block.group(1)], capture_output=True, text=True, check=True
    )
    README.write_text(replaced(text, "python", quoted(printed.stdout)), "utf-8")


def quoted(output: str) -> str:
    """Return what was printed as preformatted text."""
    return block(output.strip("\n").splitlines())


def photograph(page: Path, picture: Path) -> None:
    """Take a picture of the robot in an animation's page, a second into its motion."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=os.environ.get("RPS_PIN_CHROMIUM") or shutil.which("chromium"),
            args=BROWSER_OPTIONS,
        )
        tab = browser.new_page(viewport={"width": 1000, "height": 620})
        tab.goto(page.as_uri())
        tab.add_style_tag(content=".dg { display: none }")  # not the panel with the controls
        tab.wait_for_timeout(4000)
        tab.screenshot(path=picture)
        browser.close()


if __name__ == "__main__":
    main()
