"""The long run of ticks over all floats: some of it, and that it finds faults."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rps_pin.control import Status
from rps_pin.control.loop.controller import Controller
from tests.control import float_ticks
from tests.control.float_ticks import LAWS


def test_some_ticks_of_the_long_run() -> None:
    """``python -m tests.control.float_ticks`` computes a million with each engine."""
    reports = list(float_ticks.run(3000, seed=1))
    assert not [fault for report in reports for fault in report.faults]
    assert sum(report.ticks for report in reports) >= 6000
    seen = set().union(*(report.statuses for report in reports))
    assert seen == {"OK", *(str(flag.name) for flag in Status)}
    by_name = {report.name: report for report in reports}
    for law in (*LAWS, "estimate"):
        one, other = by_name[f"generated, {law}"], by_name[f"interpreted, {law}"]
        assert one.statuses == other.statuses
        assert one.generated > 0.1 * one.ticks
        assert other.generated == 0
        assert law == "estimate" or 0.5 < one.largest <= 1.0


def test_the_long_run_finds_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    """A force beyond its limit, one that is not finite, a tick that raises."""
    tick = Controller.tick

    def bad(self: Controller, *given: Any, **options: Any) -> Status:
        status = tick(self, *given, **options)
        if status & Status.TARGET_HELD:
            self.forces[0] = math.nan
        elif status & Status.JUMP:
            self.forces[1] = 1e3
        elif status & Status.BAD_INPUT:
            raise ZeroDivisionError
        return status

    monkeypatch.setattr(Controller, "tick", bad)
    report = next(float_ticks.run(1000))
    faults = " ".join(report.faults)
    assert all(word in faults for word in ("ZeroDivisionError", "nan", "1000."))
