"""Write the README's pictures and the output of its command and its first Python block.

Run it from the checkout, in an environment with the development dependencies and a Chromium:

    .venv/bin/python docs/update_readme.py
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from marked import block, replaced

from rps_pin import RPSRobot, helix
from rps_pin.viewer import save_png

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
IMAGES = ROOT / "docs" / "images"


def main() -> None:
    """Write all tables and pictures."""
    text = README.read_text("utf-8")
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", "from rps_pin.cli import main; main()", "helix"]
        shown = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
        text = replaced(text, "rps-pin helix", quoted(shown.stdout.split("Written:")[0]))
        shutil.copy(Path(folder) / "helix" / "forces.png", IMAGES / "forces.png")
    photograph(IMAGES / "robot.png")
    block = re.search(r"```python\n(.*?)```", text, re.DOTALL)
    assert block is not None
    printed = subprocess.run(
        [sys.executable, "-c", block.group(1)], capture_output=True, text=True, check=True
    )
    README.write_text(replaced(text, "python", quoted(printed.stdout)), "utf-8")


def quoted(output: str) -> str:
    """Return output as an indented block."""
    return block(output.strip("\n").splitlines())


def photograph(picture: Path) -> None:
    """Save a picture of the paper's robot half-way along its helix."""
    robot = RPSRobot.from_preset("sokolov")
    path = helix(robot, radius=0.75e-3, pitch=0.5e-3, height=0.4)
    title, layers = "3-RPS sokolov along a helix", ["trail", "forces"]
    save_png(picture, robot, path, time=2.6, layers=layers, title=title)


if __name__ == "__main__":
    main()
