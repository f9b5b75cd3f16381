"""Write the tables of CUDA in docs/generated_code.md.

Run it from the checkout in an environment with the development dependencies, with nvcc on the path
(a minute), or with the tables that benchmarks/cuda_rates.py printed where a card is:

    .venv/bin/python docs/cuda_tables.py [RATES.md]
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from marked import replaced

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "generated_code.md"


def main() -> None:
    """Write registers and spills, or rates."""
    if len(sys.argv) > 1:
        name, part = "rates", Path(sys.argv[1]).read_text("utf-8")
    else:
        command = [sys.executable, "-m", "benchmarks.cuda_case", "--registers"]
        done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
        name, part = "registers", done.stdout
    PAGE.write_text(replaced(PAGE.read_text("utf-8"), name, part.strip()), "utf-8")


if __name__ == "__main__":
    main()
