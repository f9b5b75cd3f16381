"""Write the tables of docs/benchmarks.md from a run of the benchmarks.

Run it from the checkout, on an idle machine, in an environment with the
development dependencies (about five minutes):

    .venv/bin/python docs/benchmarks_table.py
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from marked import replaced

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "benchmarks.md"
FILES = ("inverse_dynamics", "mechanisms", "chains", "force_distribution")

#: Minimum time in microseconds by group and role; on a shared machine the median varies.
Times = dict[str, dict[str, float]]


def main() -> None:
    """Run the benchmarks and write the tables."""
    times = measured()
    text = PAGE.read_text("utf-8")
    chains = {group: roles for group, roles in times.items() if "four-bars" in group}
    others = {group: roles for group, roles in times.items() if group not in chains}
    text = replaced(text, "operations", operations_table(others))
    text = replaced(text, "chains", chains_table(chains))
    text = replaced(text, "underdriven", underdriven_table())
    PAGE.write_text(text, "utf-8")


def measured() -> Times:
    """Run the benchmarks and return the minimum time of each."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        files = [str(ROOT / "benchmarks" / f"bench_{name}.py") for name in FILES]
        command = [sys.executable, "-m", "pytest", *files, "--benchmark-only", "-q"]
        single = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
        subprocess.run([*command, f"--benchmark-json={report}"], cwd=ROOT, check=True, env=single)
        found: Times = defaultdict(dict)
        for bench in json.loads(report.read_text("utf-8"))["benchmarks"]:
            if "role" in bench["extra_info"]:
                role = bench["extra_info"]["role"]
                found[bench["group"]][role] = 1e6 * bench["stats"]["min"]
    return found


def underdriven_table() -> str:
    """Return the table that benchmarks/underdriven.py prints."""
    command = [sys.executable, "-m", "benchmarks.underdriven"]
    single = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        command, cwd=ROOT, check=True, env=single, capture_output=True, text=True, encoding="utf-8"
    )
    return done.stdout.strip()


def operations_table(times: Times) -> str:
    """Return a row for each operation and peer."""
    lines = ["| operation | ours (us) | peer | peer (us) | ours / peer |", "|---|---|---|---|---|"]
    for group, roles in times.items():
        for role, peer in roles.items():
            if role != "ours":
                ours = roles["ours"]
                lines.append(f"| {group} | {ours:.3g} | {role} | {peer:.3g} | {ours / peer:.2g} |")
    return "\n".join(lines)


def chains_table(times: Times) -> str:
    """Return a row for each number of loops."""
    kinds = sorted({group.partition(" four-bars, ")[2] for group in times})
    counts = sorted({int(group.partition(" ")[0]) for group in times})
    heads = []
    for kind in kinds:
        roles = times[f"{counts[0]} four-bars, {kind}"]
        heads += [(kind, role) for role in roles]
    lines = ["| loops | " + " | ".join(f"{kind}: {role}" for kind, role in heads) + " |"]
    lines.append("|---" * (len(heads) + 1) + "|")
    for count in counts:
        cells = [f"{times[f'{count} four-bars, {kind}'][role]:.3g}" for kind, role in heads]
        lines.append(f"| {count} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
