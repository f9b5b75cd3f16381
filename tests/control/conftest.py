"""Both engines of control loops: generated code, and Python."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from rps_pin.control.generated import engine
from rps_pin.errors import CompileError


def none_built(name: str, make: object) -> None:
    raise CompileError("not in this test", "")


@pytest.fixture(scope="module", params=["generated", "interpreted"])
def both_engines(request: pytest.FixtureRequest) -> Iterator[str]:
    """Run a test with generated code, and without."""
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "interpreted":
            patch.setattr(engine, "built", none_built)
        yield request.param
