"""Tables of a Markdown page, for tests of what it says."""

from __future__ import annotations


def section(page: str, heading: str) -> str:
    """Return the first table under a heading."""
    _, _, after = page.partition(f"# {heading}\n")
    lines = after.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("|"))
    end = next(i for i in range(start, len(lines)) if not lines[i].startswith("|"))
    return "\n".join(lines[start:end])


def rows(table: str) -> list[list[str]]:
    """Return the cells of the head and of the rows, as many in each."""
    head, line, *body = [row.strip("| ").split(" | ") for row in table.splitlines()]
    assert set(line) == {"---"}
    assert len({row.count("|") for row in table.splitlines()}) == 1
    return [head, *body]
