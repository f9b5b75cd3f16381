"""Write the tables of docs/generated_code.md from a run of the benchmark of generated code.

Run it from the checkout, on an idle machine, in an environment with the
development dependencies and gcc (about three minutes):

    .venv/bin/python docs/generated_code_table.py
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from marked import replaced

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "generated_code.md"


def main() -> None:
    """Run the benchmark and write the tables that the page has places for."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "tables.json"
        command = [sys.executable, "-m", "benchmarks.generated_code_table", f"--json={report}"]
        single = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
        subprocess.run(command, cwd=ROOT, check=True, env=single)
        tables = json.loads(report.read_text("utf-8"))
    text = PAGE.read_text("utf-8")
    for name, table in tables.items():
        text = replaced(text, name, table)
    PAGE.write_text(text, "utf-8")


if __name__ == "__main__":
    main()
