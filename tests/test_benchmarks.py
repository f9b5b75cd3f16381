"""The benchmark of generated code compares one mechanism, and its tables say what is met."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.generated_cases import MECHANISMS, case, chain_case
from benchmarks.generated_goals import Figures, goals_table, table

pytest.importorskip("mujoco")


@pytest.mark.parametrize("name", list(MECHANISMS))
def test_mujoco_has_the_same_tree_and_closures(name: str) -> None:
    from benchmarks.generated_peers import relative, same_tree
    from benchmarks.mujoco_twin import MujocoTwin

    one = case(name)
    twin = MujocoTwin(one.mechanism, stiff=True)
    assert same_tree(one, twin) < 1e-9
    rest = np.zeros(one.mechanism.model.nv)  # soft constraints leave out J' v
    twin.put(one.q, rest, one.tau)
    twin.forward()
    assert twin.gap() < 1e-12
    exact = one.mechanism.forward_dynamics(one.q, rest, one.tau)
    assert relative(twin.acceleration(one.q, rest), exact) < 0.02


def test_chains_start_closed() -> None:
    one = chain_case(3)
    assert one.mechanism.loop_gap(one.q) < 1e-12
    assert one.name == "3 four-bars" and chain_case(1).name == "1 four-bar"


def test_tables_show_ratios_and_goals() -> None:
    figures = Figures()
    kind = "forward dynamics (us)"
    figures.add(kind, "3-RPS", {"generated": 1.0, "mj_forward": 5.0, "pin.lcaba": np.nan})
    figures.add(kind, "Stewart", {"generated": 2.0, "mj_forward": 5.0})
    assert "| 3-RPS | 1 | 5 (0.2) | NaN |" in table(figures, kind)
    goals = goals_table(figures).splitlines()[2:]
    assert [line.split("|")[-2].strip() for line in goals] == ["yes", "**no**"]
