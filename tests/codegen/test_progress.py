"""The bar of builds: on a terminal only, and only for what takes long."""

from __future__ import annotations

import io
from typing import Any

import pytest
from rich.console import Console

from rps_pin.codegen.build import progress
from rps_pin.codegen.build.progress import Bar


@pytest.mark.parametrize(
    ("terminal", "after", "shown"), [(True, 0.0, True), (True, 9.0, False), (False, 0.0, False)]
)
def test_when_it_is_shown(
    terminal: bool, after: float, shown: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = io.StringIO()

    def console(**options: Any) -> Console:
        assert options == {"stderr": True}
        return Console(file=screen, force_terminal=terminal, width=80)

    monkeypatch.setattr(progress, "Console", console)
    monkeypatch.setattr(progress, "_AFTER", after)
    with Bar("five_bar [a] {b}: gcc") as bar:
        for done in range(4):
            bar(done, 4)
    assert ("five_bar [a] {b}: gcc" in screen.getvalue()) == shown
    assert bool(screen.getvalue()) == shown


def test_it_goes_when_the_build_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_AFTER", 0.0)
    bar = Bar("x")
    with pytest.raises(KeyboardInterrupt), bar:
        bar(0, 1)
        raise KeyboardInterrupt
    assert bar._shown is not None
    assert not bar._shown.live.is_started
