"""Write the table of docs/mjcf_words.md, from the list that the tests hold against MuJoCo's.

PYTHONPATH=. .venv/bin/python docs/mjcf_words.py
"""

from __future__ import annotations

from pathlib import Path

from tests.closed_loop.io.mjcf.schema import table

SHOWN = {"harmless": "not used"}


def main() -> None:
    """Write the table."""
    from marked import replaced  # noqa: PLC0415 (beside this script, which the tests import)

    page = Path(__file__).with_suffix(".md")
    page.write_text(replaced(page.read_text("utf-8"), "words", words()), "utf-8")


def words() -> str:
    """Return the table, and the elements of which nothing is used."""
    elements = table()
    unused = [name for name, kinds in elements.items() if not kinds.keys() - {"harmless"}]
    lines = ["| element | attributes |", "|---|---|"]
    lines += [row(name, kinds) for name, kinds in elements.items() if name not in unused]
    names = ", ".join(f"`{name}`" for name in unused)
    return "\n".join([*lines, "", f"Not used with all of their attributes: {names}."])


def row(name: str, kinds: dict[str, list[str]]) -> str:
    """Return the row of an element."""
    cells = [f"**{SHOWN.get(kind, kind)}** {' '.join(given)}" for kind, given in kinds.items()]
    return f"| `{name}` | {'; '.join(cells)} |"


if __name__ == "__main__":
    main()
