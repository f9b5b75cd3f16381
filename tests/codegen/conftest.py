"""A stand-in for CuPy and its card, for all tests of generated CUDA."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest

from tests.codegen.device import FakeCuPy


@pytest.fixture(scope="module")
def cupy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FakeCuPy]:
    fake = FakeCuPy(tmp_path_factory.mktemp("card"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "cupy", fake)  # type: ignore[arg-type]
        yield fake
