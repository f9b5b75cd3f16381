"""Three ways to the forces agree to 1e-9, and a wrong one would be seen."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin.paper import agreement
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.lagrange import lagrange_forces
from tests.worst import worst


def test_random_states_and_the_helix(found: Reproduction) -> None:
    sets = [found.random, *found.helix.values()]
    assert found.random.states + found.random.left_out == 500
    for one in sets:
        assert one.states >= 495
        assert worst(one.lagrange, one.virtual_work, one.lagrange_virtual_work) < 1e-9
        assert one.gap < 1e-12
        assert worst(one.rate, one.acceleration) < 1e-9
        assert one.residual < 1e-10


def test_a_wrong_way_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(*args: object, **kwargs: object) -> object:
        found = lagrange_forces(*args, **kwargs)  # type: ignore[arg-type]
        return found._replace(force=found.force * (1 + 1e-6))

    monkeypatch.setattr(agreement, "lagrange_forces", wrong)
    one = agreement.random_agreement(1, 20)
    assert one.lagrange > 1e-7
    assert one.lagrange_virtual_work > 1e-7
    assert one.virtual_work < 1e-9


def test_states_are_drawn_from_a_fixed_seed_and_are_lively() -> None:
    assert agreement.random_agreement(1, 20) == agreement.random_agreement(1, 20)
    rng = np.random.default_rng(agreement.SEED)
    p = agreement._random_parameters(rng)
    assert p.rod_mass > 0
    assert np.linalg.norm(p.gravity) == pytest.approx(9.81)
    xx, yy, zz = np.linalg.eigvalsh(p.platform_inertia)
    assert zz <= xx + yy
