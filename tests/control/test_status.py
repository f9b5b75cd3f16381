"""The statuses: their table, and which of them keep the last answer."""

from __future__ import annotations

from rps_pin.control.loop.status import STATUSES, Status


def test_table_holds_every_combination_at_its_number() -> None:
    assert [int(status) for status in STATUSES] == list(range(256))
    together = Status.BAD_INPUT | Status.JUMP | Status.NOT_CONVERGED
    together |= Status.NEAR_SINGULAR | Status.BEYOND_LIMIT
    together |= Status.SATURATED | Status.TARGET_HELD | Status.STOPPED
    assert STATUSES[-1] == together


def test_answers_are_kept_for_three_reasons() -> None:
    reasons = [Status.BAD_INPUT, Status.JUMP, Status.NOT_CONVERGED]
    for status in STATUSES:
        assert status.kept == any(reason in status for reason in reasons), status
