"""Write the README's figure, the output of its command and its first Python block, and its speeds.

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
GENERATED = ROOT / "docs" / "generated_code.md"
Measured = dict[str, dict[str, str]]


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
    text = replaced(text, "python", quoted(printed.stdout))
    README.write_text(replaced(text, "speed", speeds()), "utf-8")


def speeds() -> str:
    """Return a table of times, from those that docs/generated_code_table.py measured."""
    dynamics, steps = measured("forward dynamics (us)"), measured("step of 1 ms, 64 in a call (us)")
    inverse = measured("inverse dynamics (us)")
    robots = ("3-RPS", "Stewart", "five-bar", "biped")
    lines: list[tuple[str, Measured, str]] = [
        ("inverse dynamics, generated code", inverse, "generated"),
        ("inverse dynamics, Python", inverse, "Pinocchio engine"),
        ("forward dynamics, generated code", dynamics, "generated"),
        ("`pin.constraintDynamics`", dynamics, "pin.constraintDynamics"),
        ("`mj_forward`", dynamics, "mj_forward"),
        ("step of 1 ms (64 in a call), generated code", steps, "generated"),
        ("`mj_step`, Euler", steps, "mj_step Euler"),
    ]
    rows = [["us", *robots], ["---"] * (len(robots) + 1)]
    for title, table, column in lines:
        times = [table[robot][column].split()[0] for robot in robots]  # without the ratio
        rows.append([title, *times])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def measured(name: str) -> Measured:
    """Return a table of the page of generated code: the cells of each row by their columns."""
    part = GENERATED.read_text("utf-8").partition(f"generated_code_table.py: {name} -->")[2]
    lines = [line for line in part.partition("<!--")[0].splitlines() if line.startswith("|")]
    head, _, *rows = [[cell.strip() for cell in line[1:-1].split("|")] for line in lines]
    return {row[0]: dict(zip(head[1:], row[1:], strict=True)) for row in rows}


def quoted(output: str) -> str:
    """Return output as an indented block."""
    return block(output.strip("\n").splitlines())


if __name__ == "__main__":
    main()
