"""Settings of every test, and what several test files share.

Hypothesis draws the same examples each time, without a deadline. In `assert_allclose` NaN differs
from NaN, unless a test passes ``equal_nan=True``: results that are NaN on both sides are no
agreement. The quick reproduction of the paper is computed once for all test processes.
"""

from __future__ import annotations

import fcntl
import os
import pickle
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, settings

from rps_pin.rps.generated import engine

if TYPE_CHECKING:
    from rps_pin.paper.compute import Reproduction

settings.register_profile(
    "rps_pin",
    derandomize=True,
    deadline=None,
    max_examples=40,
    print_blob=True,
    phases=[Phase.explicit, Phase.generate, Phase.shrink],  # "explain" takes minutes
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("rps_pin")

np.testing.assert_allclose = partial(np.testing.assert_allclose, equal_nan=False)

#: The files that take ten seconds and more run first, so that parallel processes end together.
LONG = (
    "test_notebooks.py",
    "test_cli.py",
    "test_time_optimal.py",
    "test_live_view.py",
    "test_browser.py",
    "test_pictures.py",
    "test_examples.py",
    "test_clock.py",
    "test_doctor.py",
    "test_storage.py",
    "test_robustness.py",
    "test_lagrange.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of the long files first."""
    items.sort(key=lambda item: LONG.index(item.path.name) if item.path.name in LONG else len(LONG))


@pytest.fixture(scope="session", autouse=True)
def cache_of_code(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Compiled code is kept in one folder of this run, of all its processes."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RPS_PIN_CACHE", str(folder / "code"))
        yield


@pytest.fixture(scope="session", autouse=True)
def python_answers() -> None:
    """Robots do not use what the cache happens to hold; tests of generated code ask for it."""
    engine.use(None)


@pytest.fixture(scope="session")
def found(tmp_path_factory: pytest.TempPathFactory) -> Reproduction:
    """The quick reproduction; parallel test processes share one through a file."""
    from rps_pin.paper.compute import compute

    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent  # of this run, of all its processes
    kept = folder / "reproduction.pickle"
    with (folder / "reproduction.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not kept.exists():
            kept.write_bytes(pickle.dumps(compute(quick=True)))
        reproduction: Reproduction = pickle.loads(kept.read_bytes())
    return reproduction
