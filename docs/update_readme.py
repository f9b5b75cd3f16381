"""Write the README's figure and the output of its command and its first Python block.

Run it from the checkout, in an environment with the development dependencies:

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

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
IMAGES = ROOT / "docs" / "images"


def main() -> None:
    """Write all outputs and the figure."""
    text = README.read_text("utf-8")
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", "from rps_pin.cli import main; main()", "helix"]
        shown = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
        text = replaced(text, "rps-pin helix", quoted(shown.stdout.split("Written:")[0]))
        shutil.copy(Path(folder) / "helix" / "forces.png", IMAGES / "forces.png")
    block = re.search(r"```python\n(.*?)```", text, re.DOTALL)
    assert block is not None
    printed = subprocess.run(
        [sys.executable, "-c", block.group(1)], capture_output=True, text=True, check=True
    )
    README.write_text(replaced(text, "python", quoted(printed.stdout)), "utf-8")


def quoted(output: str) -> str:
    """Return output as an indented block."""
    return block(output.strip("\n").splitlines())


if __name__ == "__main__":
    main()
