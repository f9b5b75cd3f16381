"""Motor constants found from currents, against machines with known ones."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin import InputError
from rps_pin.arrays import Array
from rps_pin.task.identification import DynamicsModel, force_log, identify
from rps_pin.task.identification.evidence import Evidence, evidence_of
from rps_pin.task.identification.factors import fit_with_factors
from tests.task.identified import forces, log_of, model_of, motion, noise_of, task_of, truth
from tests.worst import worst

#: True constants over those that are believed.
FACTORS = np.array([1.25, 0.8, 1.1])


def machine() -> tuple[DynamicsModel, Array, Evidence]:
    """A 3-RPS whose platform is known: its model, true parameters, evidence of exact currents."""
    whole = model_of("rps")
    bodies = [label for label in whole.labels if label.endswith(".mass")]
    names = [label.removeprefix("inertia:").removesuffix(".mass") for label in bodies]
    p = dict(zip(whole.labels, truth(whole, np.random.default_rng(1)), strict=True))
    unknown = DynamicsModel(task_of("rps"), bodies=names[:-1])
    known = [k for k, label in enumerate(whole.labels) if label not in unknown.labels]
    rows, _ = whole.regressor(whole.states(*_positions()))
    # The platform as it is believed to be, in place of the true one.
    change = whole.nominal[known] - np.array([p[whole.labels[k]] for k in known])
    tau = forces("rps", 1, 1) + rows[..., known] @ change
    log = force_log(unknown, motion("rps", 1).time, _positions()[0], tau / FACTORS)
    (one,) = evidence_of(unknown, [log], 10.0, None, [])
    return unknown, np.array([p[label] for label in unknown.labels]), one


def _positions() -> tuple[Array, Array, Array]:
    task = task_of("rps")
    actuated = task.mechanism.actuated_indices
    _, q, v, a = motion("rps", 1)
    return q[:, task.of_actuators], v[:, actuated], a[:, actuated]


def test_constants_and_their_deviations() -> None:
    """Exact currents: the true factors. 15 noisy logs: errors as the covariance says."""
    model, p, one = machine()
    wanted = model.base.matrix @ p
    exact = fit_with_factors(model, [one], np.arange(3))
    assert worst(exact.factors - FACTORS) < 2e-4
    assert worst(exact.fit.values - wanted) < 2e-3 * worst(wanted)
    deviation = noise_of("rps", 1, 0.02)
    errors = []
    for seed in range(15):
        noise = one.filtered(deviation * np.random.default_rng(seed).normal(size=one.forces.shape))
        noise *= one.used[:, None]
        noisy = one._replace(forces=one.forces + noise, measured=one.measured + noise)
        found = fit_with_factors(model, [noisy], np.arange(3))
        errors.append((found.factors - FACTORS) / found.deviations)
    assert worst(np.mean(errors, axis=0)) < 3.5 / np.sqrt(15)  # no bias: three of them
    # Chi squared of 15 degrees of freedom, 0.05 % and 99.95 %; the deviations are known to 4 %.
    squares = np.sum(np.square(errors), axis=0)
    assert (squares > 3.1 / 1.04**2).all()
    assert (squares < 39.8 * 1.04**2).all()


def test_a_known_constant_fixes_the_others_and_predicts() -> None:
    model = model_of("rps")
    log = log_of("rps", 1, 1, 0.02, np.random.default_rng(2))
    scaled = log._replace(force=log.force / [1.0, 0.8, 1.1])
    names = model.actuators[1:]
    found = identify(model, scaled, unknown_constants=names, cut_off=10.0, physical=False)
    assert (np.abs(found.factors - [1.0, 0.8, 1.1]) <= 4 * found.factor_deviations).all()
    assert found.factor_deviations[0] == 0.0
    assert (found.factor_deviations[1:] > 0).all()
    predicted = found.predict(scaled)
    assert worst(predicted.percent()) < 3


def test_faults_of_constants() -> None:
    model = model_of("rps")
    log = log_of("rps", 1, 1, 0.02, np.random.default_rng(2))
    with pytest.raises(InputError, match="nothing fixes the scale of the forces of"):
        identify(model, log, unknown_constants=model.actuators, cut_off=10.0)
    with pytest.raises(InputError, match="no actuator 'leg'"):
        identify(model, log, unknown_constants=["leg"])
    with pytest.raises(InputError, match="named twice"):
        identify(model, log, unknown_constants=[model.actuators[0]] * 2)
