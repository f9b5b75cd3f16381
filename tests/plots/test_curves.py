"""Curves: equal ones once, jumps upright, limits near and far, legends that fit."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rps_pin.plots import COLUMN, styled
from rps_pin.plots.curves import (
    draw_limits,
    legend_above,
    legend_columns,
    names_for_figure,
    plot_curves,
    with_jumps,
)
from tests.plots.overlaps import faults

TIME = np.linspace(0.0, 1.0, 101)


def axes_of_own() -> Axes:
    return Figure(figsize=(COLUMN, 2.2), layout="constrained").add_subplot()


def labels_of(axes: Axes) -> list[str]:
    return list(axes.get_legend_handles_labels()[1])


def test_equal_curves_are_one_with_a_note() -> None:
    axes = axes_of_own()
    one, other = np.sin(TIME), np.cos(TIME)
    plot_curves(axes, TIME, np.stack([one] * 6, axis=1), list("abcdef"))
    assert labels_of(axes) == ["all 6 are equal"]
    axes = axes_of_own()
    plot_curves(axes, TIME, np.stack([one, other, one + 1e-12], axis=1), list("abc"))
    assert labels_of(axes) == ["a = c", "b"]
    axes = axes_of_own()
    plot_curves(axes, TIME, np.stack([one, one + 0.02], axis=1), list("ab"))
    assert labels_of(axes) == ["a", "b"]


def test_curves_over_other_abscissae_are_not_equal() -> None:
    axes = axes_of_own()
    plot_curves(axes, np.stack([TIME, -TIME], axis=1), np.stack([TIME, TIME], axis=1), list("ab"))
    assert labels_of(axes) == ["a", "b"]


def test_every_sample_stays_and_jumps_stand_between_two() -> None:
    random = np.random.default_rng(7)
    for _ in range(50):
        at = np.sort(random.choice(np.arange(5, 95, 6), 3, replace=False))
        smooth = np.sin(random.uniform(1.0, 4.0) * TIME + random.uniform(0.0, 6.0))
        steps = random.choice([-1.0, 1.0], 3) * random.uniform(0.5, 2.0, 3)
        values = smooth + np.sum([s * (TIME[k] < TIME) for k, s in zip(at, steps, strict=True)], 0)
        time, drawn, beside = with_jumps(TIME, values, np.stack([TIME, -TIME], axis=1))
        assert len(time) == len(drawn) == len(beside) == len(TIME) + 6
        added = ~np.isin(time, TIME)
        assert np.array_equal(drawn[~added], values)
        assert np.allclose(time[added], np.repeat((TIME[at] + TIME[at + 1]) / 2, 2))
        assert np.allclose(drawn[added], np.stack([values[at], values[at + 1]], axis=1).ravel())
        assert (np.diff(time) >= 0.0).all()


@pytest.mark.parametrize(
    "values", [np.sin(9 * TIME), np.abs(TIME - 0.5), np.full(101, 3.0), 3.0 + 1e-15 * TIME]
)
def test_what_is_continuous_has_no_jumps(values: np.ndarray) -> None:
    time, drawn = with_jumps(TIME, values)
    assert np.array_equal(time, TIME)
    assert np.array_equal(drawn, values)


def test_few_samples_have_no_jumps() -> None:
    for count in (1, 2, 3):
        time, _ = with_jumps(TIME[:count], np.arange(count) ** 9.0)
        assert len(time) == count


@pytest.mark.parametrize(
    ("low", "high", "lines", "label"),
    [
        (-2.0, 2.0, 2, "limits"),
        (-np.inf, 2.0, 1, "limit"),
        (-100.0, 2.0, 1, "limit"),
        (-100.0, 100.0, 0, "limits: ±100 N"),
        (200.0, 250.0, 0, "limits: 200 to 250 N"),
        (-np.inf, 250.0, 0, "limits: at most 250 N"),
        (-np.inf, np.inf, 0, None),
    ],
)
def test_limits_are_drawn_near_and_told_far_away(
    low: float, high: float, lines: int, label: str | None
) -> None:
    axes = axes_of_own()
    draw_limits(axes, np.sin(6 * TIME), low, high, "N")
    drawn = [line for line in axes.get_lines() if len(line.get_xdata())]
    assert len(drawn) == lines
    assert {float(np.asarray(line.get_ydata())[0]) for line in drawn} <= {low, high}
    assert labels_of(axes) == ([label] if label else [])


@pytest.mark.parametrize("count", [1, 3, 6, 9])
@pytest.mark.parametrize("letters", [1, 12, 40])
def test_legends_fit_whatever_the_names(count: int, letters: int) -> None:
    @styled
    def drawn() -> Figure:
        axes = axes_of_own()
        names = names_for_figure([f"{k}{'n' * (letters - 1)}" for k in range(count)])
        plot_curves(axes, TIME, np.sin(TIME[:, None] + np.arange(count)), names)
        legend_above(axes)
        axes.set_xlabel("time (s)")
        figure = axes.get_figure(root=True)
        assert figure is not None
        figure.set_figheight(4.0)
        return figure

    assert not faults(drawn())


def test_as_many_entries_as_fit_are_in_a_row() -> None:
    assert legend_columns(["a", "b", "c"], 200.0) == 3
    assert legend_columns(["a" * 20, "b" * 20, "c"], 200.0) < 3
    assert legend_columns(["a" * 200], 10.0) == 1
    assert legend_columns(list("abcde"), 125.0) in (3, 4)
