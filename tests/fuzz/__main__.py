"""The long run: ``python -m tests.fuzz --minutes 60 [--formats URDF MJCF] [--folder findings]``.

Each case is a mutant by its format and number; a second run with the same first number repeats
it. Findings are written to the folder as JSON, at most three of a kind: a case that is mended goes
to tests/fuzz/seeds, which the tests replay. ``--counts FILE`` adds the counts to a file, and
``--table FILE`` prints those of a file.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from tests.fuzz.case import FINDING, LOADED, LONG, REFUSED, Outcome
from tests.fuzz.formats import FORMATS
from tests.fuzz.workers import Item, made, outcomes, run_for

_KINDS = (LOADED, REFUSED, LONG, FINDING)
_MOST_OF_A_KIND = 3


def main(arguments: Sequence[str] | None = None) -> int:
    """Run cases, print counts; return 1 if there are findings."""
    options = _options(arguments)
    if options.table:
        print(table(json.loads(options.table.read_text("utf-8"))))
        return 0
    names = options.formats or list(FORMATS)
    if options.cases:
        last = options.first + options.cases
        items = ((name, number) for name in names for number in range(options.first, last))
        found, total = outcomes(items), options.cases * len(names)
    else:
        found, total = run_for(60 * options.minutes, names, options.first), None
    counts: dict[str, Counter[str]] = {name: Counter() for name in names}
    kinds: dict[str, Counter[str]] = {name: Counter() for name in names}
    try:
        _run(found, total, counts, kinds, options.folder)
    except KeyboardInterrupt:
        print("interrupted; the counts so far:")
    given = {name: dict(one) for name, one in counts.items() if one}
    print(table(given))
    for name, places in kinds.items():
        for place, count in places.most_common():
            print(f"finding: {name}: {count} times: {place}")
    if options.counts:
        before = json.loads(options.counts.read_text("utf-8")) if options.counts.exists() else {}
        options.counts.write_text(json.dumps(before | given, indent=1) + "\n", "utf-8")
    return int(any(kinds.values()))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="length of the run")
    parser.add_argument("--cases", type=int, help="instead of minutes: mutants of each format")
    parser.add_argument("--formats", nargs="+", choices=list(FORMATS), help="default: all")
    parser.add_argument("--first", type=int, default=0, help="number of the first mutant")
    parser.add_argument("--folder", type=Path, default=Path("build/fuzz"), help="for findings")
    parser.add_argument("--counts", type=Path, help="a JSON file that gets the counts")
    parser.add_argument("--table", type=Path, help="print the counts of such a file, and end")
    return parser.parse_args(arguments)


def _run(
    found: Iterator[tuple[Item, Outcome]],
    total: int | None,
    counts: dict[str, Counter[str]],
    kinds: dict[str, Counter[str]],
    folder: Path,
) -> None:
    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("cases", total=total)
        for item, outcome in found:
            assert isinstance(item, tuple)
            name, number = item
            counts[name][outcome.kind] += 1
            if outcome.kind == FINDING:
                kinds[name][outcome.place] += 1
                if kinds[name][outcome.place] <= _MOST_OF_A_KIND:
                    _write(folder, name, number, outcome)
            progress.update(task, advance=1, description=f"{name}, {_findings(kinds)} findings")


def _findings(kinds: dict[str, Counter[str]]) -> int:
    return sum(one.total() for one in kinds.values())


def _write(folder: Path, name: str, number: int, outcome: Outcome) -> None:
    """Write a finding as a seed, and what became of it."""
    folder.mkdir(parents=True, exist_ok=True)
    words = re.sub(r"\W+", "_", f"{name}_{outcome.place}")[:80]
    (folder / f"{words}_{number}.json").write_text(made((name, number)).to_json(), "utf-8")
    with (folder / "findings.txt").open("a", encoding="utf-8") as file:
        file.write(f"{name} {number}: {outcome.message!r}\n")


def table(counts: dict[str, dict[str, int]]) -> str:
    """Return counts by format as a table."""
    lines = ["| format | cases | loaded | refused | findings |", "|---|---:|---:|---:|---:|"]
    for name, one in counts.items():
        long = f" (and {one[LONG]} long ones ended by Ctrl-C)" if one.get(LONG) else ""
        cells = [f"{one.get(kind, 0):,}" for kind in (LOADED, REFUSED, FINDING)]
        lines.append(f"| {name}{long} | {sum(one.values()):,} | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
