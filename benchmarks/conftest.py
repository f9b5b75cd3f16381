"""Ratios of each benchmark's time to the peers of its group, printed after the table."""

from __future__ import annotations

from collections import defaultdict
from typing import Any


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print our times over those of the peers by group: medians and minima."""
    session = getattr(terminalreporter.config, "_benchmarksession", None)
    groups: dict[str, dict[str, Any]] = defaultdict(dict)
    for bench in session.benchmarks if session else []:
        if "role" in bench.extra_info:
            groups[bench.group][bench.extra_info["role"]] = bench.stats
    for group, stats in groups.items():
        ours = stats.pop("ours", None)
        if ours is None:  # left out by -k
            continue
        for peer, theirs in stats.items():
            for figure in ("median", "min"):
                mine, other = 1e6 * getattr(ours, figure), 1e6 * getattr(theirs, figure)
                terminalreporter.write_line(
                    f"{group}: {figure} {mine:.2f} us, {peer} {other:.2f} us, "
                    f"ratio {mine / other:.3f}"
                )
