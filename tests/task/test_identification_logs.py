"""Logs for identification: their faults, gaps, saturation and unequal steps; the filter."""

from __future__ import annotations

import numpy as np
import pytest

from rps_pin import InputError
from rps_pin.arrays import Array
from rps_pin.task.identification import Log, force_log, identify
from rps_pin.task.identification.filtering import Filter, motion_of, usual_cut_off
from rps_pin.task.identification.log import pieces_of
from tests.task.identified import log_of, model_of, truth
from tests.worst import worst


def log() -> Log:
    return log_of("rps", 1, 1, 0.01, np.random.default_rng(0))


def parts(changed: Log | None = None) -> tuple[Array, Array, Array]:
    one = changed or log()
    return one.time.copy(), one.position.copy(), one.force.copy()


# The filter ---------------------------------------------------------------------------------------


def test_the_filter_has_no_phase_and_a_stated_gain() -> None:
    """Of a sine at the cut-off frequency: half of it, not shifted."""
    filtered = Filter(5.0, 0.01)
    t = 0.01 * np.arange(1000)
    inner = slice(200, 800)
    for frequency, gain in ((5.0, 0.5), (1.0, 1 / (1 + 0.2**8))):
        wave = np.sin(2 * np.pi * frequency * t)
        # The bilinear transform bends frequencies other than the cut-off.
        assert worst((filtered(wave) - gain * wave)[inner]) < 1e-4
    noise = filtered(np.random.default_rng(1).normal(size=200_000))
    assert abs(np.var(noise) / filtered.noise - 1) < 0.03


def test_speeds_and_accelerations_of_a_sine() -> None:
    filtered = Filter(20.0, 0.005)
    t = 0.005 * np.arange(1000)
    w = 2 * np.pi * 1.3
    _, speed, acceleration = motion_of(np.sin(w * t)[:, None], filtered)
    inner = slice(100, 900)
    assert worst((speed[:, 0] - w * np.cos(w * t))[inner]) < 1e-6 * w
    assert worst((acceleration[:, 0] + w**2 * np.sin(w * t))[inner]) < 1e-6 * w**2


def test_the_usual_cut_off_is_above_the_motion() -> None:
    t = 0.01 * np.arange(1000)
    wave = np.sin(2 * np.pi * t) + 0.3 * np.sin(2 * np.pi * 2 * t)
    assert 16 <= usual_cut_off(wave[:, None], 0.01) <= 20
    assert usual_cut_off(np.zeros((1000, 1)), 0.01) > 0


# Faults -------------------------------------------------------------------------------------------


def test_faults_of_a_log() -> None:
    model = model_of("rps")
    t, position, force = parts()
    back = t.copy()
    back[100] = back[98]
    with pytest.raises(InputError, match="times must increase, but sample 100 is at"):
        force_log(model, back, position, force)
    for what, array in (("position", position), ("force", force)):
        spoilt = array.copy()
        spoilt[7, 1] = np.nan
        given = (spoilt, force) if what == "position" else (position, spoilt)
        with pytest.raises(InputError, match=f"{what} of leg_2_prismatic is nan at sample 7"):
            force_log(model, t, *given)
    with pytest.raises(InputError, match="force has shape"):
        force_log(model, t, position, force[:, :2])
    with pytest.raises(InputError, match="give forces, or currents with constants"):
        force_log(model, t, position)
    with pytest.raises(InputError, match="time is not finite at sample 3"):
        force_log(model, np.where(np.arange(t.size) == 3, np.nan, t), position, force)


def test_currents_with_constants_are_forces() -> None:
    model = model_of("rps")
    t, position, force = parts()
    constants = {name: 2.0 + k for k, name in enumerate(model.actuators)}
    found = force_log(
        model, t, position, current=force / list(constants.values()), constants=constants
    )
    assert worst(found.force - force) < 1e-12 * worst(force)
    with pytest.raises(InputError, match="constants: none is given of leg_3_prismatic"):
        del constants["leg_3_prismatic"]
        force_log(model, t, position, current=force, constants=constants)
    with pytest.raises(InputError, match="no actuator 'leg_4_prismatic'"):
        force_log(model, t, position, current=force, constants={"leg_4_prismatic": 1.0})


def test_faults_of_an_identification() -> None:
    model = model_of("rps")
    t, position, force = parts()
    short = force_log(model, t[:40], position[:40], force[:40], name="short.csv")
    with pytest.raises(InputError, match=r"short.csv is too short: 40 samples"):
        identify(model, short, cut_off=10.0)
    with pytest.raises(InputError, match="too few for 25 parameters"):
        identify(model, force_log(model, t[:90], position[:90], force[:90]), cut_off=10.0)
    with pytest.raises(InputError, match="cut_off = 40 Hz is too high for samples every"):
        identify(model, log(), cut_off=40.0)
    with pytest.raises(InputError, match="one or more Log objects"):
        identify(model, [])
    dead = force.copy()
    dead[:, 1] = 0.25
    with pytest.raises(InputError, match=r"log: the force of leg_2_prismatic is 0.25 at all samp"):
        identify(model, force_log(model, t, position, dead), cut_off=10.0)
    with pytest.raises(InputError, match=r"log: no actuator moves"):
        identify(model, force_log(model, t, 0 * position + position[0], force))


def test_a_log_that_saturation_leaves_nothing_of_says_so() -> None:
    model = model_of("rps")
    t, position, force = parts()
    top = 0.7 * np.abs(force[:, 0]).max()
    cut = force_log(model, t, position, np.clip(force, -top, top))
    with pytest.raises(InputError, match=r"of \d+ samples of 3 .*the force of leg_1_pri.* is held"):
        identify(model, cut, cut_off=3.0)


def test_constants_of_forces_are_named() -> None:
    model = model_of("rps")
    one = force_log(model, *parts(), constants={"leg_1_prismatic": 2.0}, name="a.csv")
    assert one.notes == ("a.csv has forces: constants of leg_1_prismatic are not used",)


# Doubts -------------------------------------------------------------------------------------------


def test_gaps_are_named_and_the_pieces_used_apart() -> None:
    model = model_of("rps")
    t, position, force = parts()
    kept = np.r_[0:130, 140:300]
    gapped = force_log(model, t[kept], position[kept], force[kept])
    found = identify(model, gapped, cut_off=10.0, physical=False)
    (doubt,) = [one for one in found.doubts if "gaps" in one]
    assert f"0.1833 s at {t[129]:.6g} s" in doubt
    wanted = model.base.matrix @ truth(model, np.random.default_rng(1))
    error = found.values - wanted
    assert error @ np.linalg.solve(found.covariance, error) < 60  # chi squared of 25: 99.99 %


def test_saturated_samples_are_named_and_left_out() -> None:
    model = model_of("rps")
    t, position, force = parts()
    top = 0.9 * np.abs(force[:, 0]).max()
    force[:, 0] = np.clip(force[:, 0], -top, top)
    held = int(np.count_nonzero(np.abs(force[:, 0]) == top))
    assert held > 8
    doubts: list[str] = []
    (piece,) = pieces_of(model, force_log(model, t, position, force), doubts)
    assert piece.held.sum() <= held
    assert "the force of leg_1_prismatic is held at its largest value" in doubts[0]
    assert not pieces_of(model, log(), doubts)[0].held.any()


def test_unequal_steps_are_named_and_evened() -> None:
    model, rng = model_of("rps"), np.random.default_rng(2)
    t, position, force = parts()
    shaken = t + 0.2 * (t[1] - t[0]) * rng.uniform(-1, 1, t.size)
    doubts: list[str] = []
    moved = np.array([np.interp(shaken, t, one) for one in position.T]).T
    (piece,) = pieces_of(model, force_log(model, shaken, moved, force), doubts)
    assert "unequal steps" in doubts[0]
    assert worst(np.diff(piece.time, 2)) < 1e-12
    inner = slice(3, -3)
    true = np.array([np.interp(piece.time, t, one) for one in position.T]).T
    assert worst((piece.position - true)[inner]) < 1e-3 * worst(position)


def test_a_motion_that_moves_little_is_doubted() -> None:
    """One leg alone moves: what belongs to the others is not seen, and kept."""
    model = model_of("rps")
    t, position, force = parts()
    still = np.tile(position.mean(axis=0), (t.size, 1))
    found = identify(model, force_log(model, t, still, force), cut_off=10.0)
    assert any("determines" in one for one in found.doubts)
    assert np.isinf(found.deviations).any()


def test_forces_that_the_model_lacks_are_doubted() -> None:
    model = model_of("rps")
    t, position, force = parts()
    force = force + 0.3 * np.sin(2 * np.pi * 0.53 * t)[:, None]
    found = identify(model, force_log(model, t, position, force), cut_off=10.0, physical=False)
    assert any("times as much power at low frequencies" in one for one in found.doubts)
