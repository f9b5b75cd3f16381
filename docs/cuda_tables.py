"""Write the tables of CUDA in docs/generated_code.md.

Run it from the checkout, with nvcc on the path, in an environment with the development dependencies
(a minute); the rates need an NVIDIA card and CuPy besides (two minutes more):

    .venv/bin/python docs/cuda_tables.py
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from marked import replaced

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "generated_code.md"
NO_CARD = "Not measured: no card was at hand."


def main() -> None:
    """Write registers and spills, and the rates if there is a card."""
    text = replaced(PAGE.read_text("utf-8"), "registers", _output("--registers"))
    PAGE.write_text(replaced(text, "rates", _output() if _has_card() else NO_CARD), "utf-8")


def _output(*options: str) -> str:
    command = [sys.executable, "-m", "benchmarks.cuda_rates", *options]
    return subprocess.run(
        command, cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.strip()


def _has_card() -> bool:
    command = [sys.executable, "-c", "from rps_pin.codegen.cuda.device import load_cupy as f; f()"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, check=False).returncode == 0


if __name__ == "__main__":
    main()
