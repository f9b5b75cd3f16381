"""The quick reproduction, computed once for all tests of it."""

from __future__ import annotations

import pytest

from rps_pin.paper.compute import Reproduction, compute


@pytest.fixture(scope="session")
def found() -> Reproduction:
    return compute(quick=True)
