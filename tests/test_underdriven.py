"""Inverse dynamics of underdriven robots agrees with that of regular ones."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.underdriven import MECHANISMS, regular
from tests.worst import worst


@pytest.mark.parametrize("name", MECHANISMS)
def test_where_the_missing_actuators_need_no_force_both_agree(name: str) -> None:
    """The motion under the actuators alone: from forward dynamics of either."""
    under = MECHANISMS[name]()
    full, q, rng = regular(under), under.home, np.random.default_rng(0)
    na, nf = under.actuated_indices.size, full.actuated_indices.size
    assert na < nf == full.describe().mobility
    assert full.describe().actuation == "sufficient"
    v, tau = full.velocity(q, rng.normal(size=nf)), rng.normal(size=na)
    a = under.forward_dynamics(q, v, tau)
    assert worst(full.forward_dynamics(q, v, np.append(tau, np.zeros(nf - na))) - a) < 1e-7
    found, other = under.inverse_dynamics(q, v, a), full.inverse_dynamics(q, v, a)
    size = 1.0 + worst(under.generalised_force(q, v, a))
    assert found.unproduced is None
    assert worst(found.tau - tau) < 1e-10 * size
    assert worst(other.tau[:na] - tau, other.tau[na:]) < 1e-10 * size
    assert worst(found.constraint_forces - other.constraint_forces) < 1e-9 * size
