"""Write the table of docs/reliability.md from the counts of a long run.

.venv/bin/python -m tests.fuzz --cases 10000 --counts tests/fuzz/counts.json
PYTHONPATH=. .venv/bin/python docs/reliability_tables.py
"""

from __future__ import annotations

import json
from pathlib import Path

from marked import replaced

from tests.fuzz.__main__ import table

PAGE = Path(__file__).parent / "reliability.md"
COUNTS = PAGE.parents[1] / "tests" / "fuzz" / "counts.json"


def main() -> None:
    """Write the table."""
    counts = json.loads(COUNTS.read_text("utf-8"))
    PAGE.write_text(replaced(PAGE.read_text("utf-8"), "counts", table(counts)), "utf-8")


if __name__ == "__main__":
    main()
