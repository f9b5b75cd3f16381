"""Write the table of all assembly modes of docs/mechanisms.md from runs.

Run it from the checkout (about a minute):

    .venv/bin/python docs/assembly_modes_table.py
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from marked import replaced

from rps_pin import ClosedLoopModel

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "mechanisms.md"
sys.path.insert(0, str(ROOT))

from tests.closed_loop.test_assembly_modes import dietmaier  # noqa: E402
from tests.closed_loop.test_every_mode import three_rpr  # noqa: E402
from tests.closed_loop.test_general_modes import rssr, six_hinges  # noqa: E402

PLANAR = ["four_bar", "five_bar", "slider_crank", "planar_rrr"]
PLATFORMS = ["rps", "rrs", "stewart", "rotary_stewart", "delta", "linear_delta"]
GENERAL = ["ankle", "cassie_leg"]
HEAD = "| mechanism | paths | complex | real | certified | s | search | s |"


def main() -> None:
    """Run all and write the table."""
    rng, rows = np.random.default_rng(0), [HEAD, "|---|---|---|---|---|---|---|---|"]
    rows.append(row("Dietmaier's platform", dietmaier(), None, None))
    rows.append(row("planar 3-RPR, general", *three_rpr(2), None))
    rows.append(row("spatial four-bar RSSR", rssr(0), [1.0], None))
    for seed in range(3):
        rows.append(row(f"general 6R, tool held, {seed}", six_hinges(seed)[0], None, None))
    for name in PLANAR + PLATFORMS + GENERAL:
        mechanism = ClosedLoopModel.load(ROOT / "urdf" / f"{name}.yaml")
        system = mechanism.system
        home = mechanism.home[system.coordinates_of(system.actuated)]
        values = home * (1 + 0.05 * rng.uniform(-1, 1, home.size))
        frames = ["platform"] if name in PLATFORMS else None
        rows.append(row(f"`{name}`", mechanism, values, frames))
    PAGE.write_text(replaced(PAGE.read_text("utf-8"), "modes", "\n".join(rows)), "utf-8")


def row(title: str, mechanism: ClosedLoopModel, values: object, frames: list[str] | None) -> str:
    """Return the row of a mechanism."""
    begin = time.process_time()
    found = mechanism.assembly_modes(values, method="all", within_limits=False)
    middle = time.process_time()
    searched = mechanism.assembly_modes(values, frames=frames, within_limits=False)
    end = time.process_time()
    assert found.certified is not None
    counts = found.paths, found.complex_count, len(found.q), int(found.certified.sum())
    told = (*counts, f"{middle - begin:.2f}", len(searched.q), f"{end - middle:.2f}")
    print(title, *told)
    return f"| {title} | " + " | ".join(map(str, told)) + " |"


if __name__ == "__main__":
    main()
