"""Calibration: predicted readings by differences, what can be known, and simulated measurements."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, InputError, Task, UnreachableError
from rps_pin.arrays import Array
from rps_pin.task.calibration import (
    Calibration,
    CalibrationModel,
    Readings,
    Tracker,
    calibrate,
    geometric_groups,
    readings,
)
from rps_pin.task.calibration.fit import Linearised
from rps_pin.task.calibration.outliers import outliers
from rps_pin.task.calibration.problem import Problem
from tests.worst import worst

#: Of the five-bar's encoders, rad, and of what measures its tip, m.
DEVIATIONS = {"left_joint": 1e-4, "right_joint": 1e-4, "x": 3e-5, "z": 3e-5}
GROUPS = (
    "placement:left_joint",
    "placement:left_arm_joint",
    "placement:right_joint",
    "placement:right_arm_joint",
    "closure:tips",
)
TARGETS = {"A": [0.05, 0.087, 0.01], "B": [-0.1, 0.0, 0.01], "C": [0.05, -0.087, 0.01]}
ENCODERS = ("left_joint", "left_arm_joint", "right_joint", "right_arm_joint")
#: The five-bar's lengths, m, as its file says: left bars, right bars, base.
PENTAGON = {
    "placement:left_arm_joint.x": 0.3,
    "closure:tips.a.x": 0.42,
    "placement:right_arm_joint.x": 0.28,
    "closure:tips.b.x": 0.45,
    "placement:right_joint.x": 0.4,
}


class Case(NamedTuple):
    """A five-bar with all of its lengths as parameters, and poses."""

    task: Task
    model: CalibrationModel
    x: Array
    q: Array


@cache
def five_bar() -> Case:
    task = ClosedLoopModel.load("urdf/five_bar.yaml").task
    model = CalibrationModel(task, GROUPS, tuple(DEVIATIONS), offsets=["left_joint", "right_joint"])
    x = task.home + np.random.default_rng(0).uniform(-0.075, 0.075, (60, 2))
    return Case(task, model, x, model.home(x, model.nominal))


def read(values: Array) -> Readings:
    task = five_bar().task
    return readings(task, dict(zip(DEVIATIONS, values.T, strict=True)), DEVIATIONS)


def seen() -> Array:
    """Combinations of parameters that can be known, (p, 11)."""
    case = five_bar()
    exact = case.model.predict(case.x, case.q, case.model.nominal).readings
    problem = Problem(case.model, read(exact), np.full(case.model.nominal.size, np.inf))
    problem.begin(None)
    return problem.identifiable().seen


def wrong(rng: np.random.Generator, size: float = 1e-3) -> Array:
    """Parameters whose loops close, about `size` (m) from the believed ones."""
    model, basis = five_bar().model, seen()
    return model.nominal + basis @ (size * rng.normal(size=basis.shape[1])) / model.units


def measured(p: Array, rng: np.random.Generator, bad: int = 0) -> tuple[Array, Array]:
    """Readings with noise at parameters, and which of them are spoilt, 20 to 100 deviations."""
    case = five_bar()
    values = case.model.predict(case.x, case.q, p).readings
    deviation = np.broadcast_to(list(DEVIATIONS.values()), values.shape)
    values = values + deviation * rng.normal(size=values.shape)
    spoilt = np.zeros(values.shape, dtype=bool)
    spoilt.flat[rng.choice(values.size, bad, replace=False)] = True
    sizes = rng.uniform(20, 100, values.shape) * rng.choice([-1, 1], values.shape)
    return values + spoilt * sizes * deviation, spoilt


# What is predicted --------------------------------------------------------------------------------


def test_derivatives_of_what_is_predicted() -> None:
    """By poses and by parameters, against differences; the latter where the loops stay closed."""
    _, model, x, q = five_bar()
    rng, h = np.random.default_rng(1), 1e-6
    p = wrong(rng)
    found = model.predict(x, q, p)
    direction = rng.normal(size=x.shape)
    sides = [model.predict(x + s * h * direction, q, p).readings for s in (1, -1)]
    slope = np.einsum("nsm,nm->ns", found.by_pose, direction)
    assert worst((sides[0] - sides[1]) / (2 * h) - slope) < 1e-8 * worst(slope)
    basis = seen() / model.units[:, None]
    for column in basis.T:
        sides = [model.predict(x, q, p + s * h * column).readings for s in (1, -1)]
        slope = found.by_parameters @ column
        assert worst((sides[0] - sides[1]) / (2 * h) - slope) < 1e-8 * max(worst(slope), 1.0)


def test_readings_are_the_pinocchio_engines() -> None:
    """At parameters that are wrong: the mechanism rebuilt with them, completed at the poses."""
    task, model, x, q = five_bar()
    p = wrong(np.random.default_rng(2))
    found = model.predict(x, q, p).readings
    own = len(model.engine.parameters)
    other = model.engine.reference(p[:own])
    columns = [
        task.mechanism.model.joints[task.mechanism.model.getJointId(n)].idx_q
        for n in ("left_joint", "right_joint")
    ]
    for one, start, values in zip(x[:5], q[:5], found[:5], strict=True):
        there = other.complete(one, start, within_limits=False)
        assert worst(there[columns] - p[own:] - values[:2]) < 1e-9
        assert worst(values[2:] - one) < 1e-12


def test_scale_of_a_sensor() -> None:
    task = five_bar().task
    model = CalibrationModel(task, [], ["left_joint", "x"], offsets=["x"], scales=["left_joint"])
    assert model.labels == ("offset:x", "scale:left_joint")
    x = five_bar().x[:3]
    q = model.home(x, model.nominal)
    plain, h = model.predict(x, q, model.nominal), 1e-6
    p = np.array([0.01, 1.1])
    found = model.predict(x, q, p)
    assert worst(found.readings[:, 0] * 1.1 - plain.readings[:, 0]) < 1e-12
    assert worst(found.readings[:, 1] + 0.01 - plain.readings[:, 1]) < 1e-12
    for k in range(2):
        step = h * np.eye(2)[k]
        sides = [model.predict(x, q, p + s * step).readings for s in (1, -1)]
        assert worst((sides[0] - sides[1]) / (2 * h) - found.by_parameters[..., k]) < 1e-8


# What can be known --------------------------------------------------------------------------------


def test_how_many_combinations_of_a_five_bar_can_be_known() -> None:
    """Counted by hand: base points, both lengths and offset of an arm (5 each), closed point (2).

    The point that is measured is the left tip; a length of the left forearm goes to it, and the
    closed point has two coordinates from there. Then the right forearm's length is known too.
    """
    assert seen().shape[1] == 5 + 5 + 1


def test_combinations_that_cannot_be_known_are_kept() -> None:
    """Readings without noise: what can be known is found, the rest stays as believed."""
    case, rng = five_bar(), np.random.default_rng(3)
    p = wrong(rng, 3e-3)
    exact = read(case.model.predict(case.x, case.q, p).readings)
    found = calibrate(case.model, exact, widest=1.0)
    assert not found.outliers.any()
    off = (found.parameters - p) * case.model.units
    assert worst(found.identifiable.seen.T @ off) < 1e-5 * worst(
        (p - found.before) * case.model.units
    )
    assert (
        worst(found.identifiable.unseen.T @ ((found.parameters - found.before) * case.model.units))
        < 1e-12
    )
    assert worst(found.residuals) < 1e-3
    assert np.isinf(found.deviations[~found.alone]).all()
    assert np.isfinite(found.deviations[found.alone]).all()


def test_a_prior_separates_parameters() -> None:
    case = five_bar()
    model = CalibrationModel(
        case.task, ["placement:left_joint"], tuple(DEVIATIONS), offsets=["left_joint"]
    )
    values = model.predict(case.x, case.q, model.nominal).readings
    priors = {
        "placement:left_joint.x": 1e-4,
        "placement:left_joint.z": 1e-4,
        "offset:left_joint": 1e-3,
    }
    free = calibrate(model, read(values))
    held = calibrate(model, read(values), priors=priors)
    # A turn of the base joint about its axis is an offset of its encoder.
    names = [np.array(model.labels)[one.alone].tolist() for one in (free, held)]
    either = ["placement:left_joint.pitch", "offset:left_joint"]
    assert names[0] == ["placement:left_joint.x", "placement:left_joint.z"]
    assert names[1] == [*names[0], *either]
    assert (held.deviations[free.alone] < free.deviations[free.alone]).all()
    k = model.labels.index("placement:left_joint.x")
    assert held.deviations[k] < 1e-4


# Noise and outliers -------------------------------------------------------------------------------


def run(seed: int) -> tuple[Calibration, Array, Array]:
    """A calibration of simulated readings with 20 outliers; its errors, and what was spoilt."""
    rng = np.random.default_rng(seed)
    p = wrong(rng)
    values, spoilt = measured(p, rng, bad=20)
    found = calibrate(five_bar().model, read(values), widest=1.0)
    return found, found.parameters - p, spoilt


def test_errors_are_those_that_the_covariance_says() -> None:
    """Sums of squared errors over their covariance, 9 parameters of 10 runs, and coverage."""
    squares, within, freedom = 0.0, [], 0
    for seed in range(10):
        found, error, spoilt = run(seed)
        known = found.alone
        part = found.covariance[np.ix_(known, known)]
        squares += float(error[known] @ np.linalg.solve(part, error[known]))
        freedom += int(known.sum())
        within.append(np.abs(error[known]) < 1.96 * found.deviations[known])
        assert np.count_nonzero(spoilt & ~found.outliers) <= 3  # pairs in one pose can agree
        assert 0.6 < found.chi_squared / found.freedom < 1.6
    assert freedom == 90
    # Chi squared of 90 degrees of freedom: 0.1 % and 99.9 %.
    assert 52.0 < squares < 137.3
    assert np.mean(within) > 0.85


def test_outliers_of_a_pose() -> None:
    """One wrong of five readings of two coordinates is named; of three, none can be."""
    rng = np.random.default_rng(4)
    A = rng.normal(size=(2, 5, 2))
    r = np.einsum("nsm,nm->ns", A, rng.normal(size=(2, 2)))
    r[0, 3] += 50.0
    r[1, 1] -= 30.0
    known = np.ones((2, 5), dtype=bool)
    wanted = np.zeros((2, 5), dtype=bool)
    wanted[0, 3] = wanted[1, 1] = True
    assert np.array_equal(outliers(r, A, known), wanted)
    known[1, 3:] = False  # any one of the three may be wrong: all go
    assert np.array_equal(outliers(r, A, known)[1], known[1])


@cache
def rps_with_tracker() -> CalibrationModel:
    task = ClosedLoopModel.load("urdf/rps.yaml").task
    tracker = Tracker(TARGETS, "platform", placement=np.eye(4), known=True)
    groups = [group for group in geometric_groups(task) if "leg" in group]
    legs = task.mechanism.actuated
    return CalibrationModel(
        task, groups, [*legs, *tracker.sensors], legs, instruments=[tracker], compiler="tcc"
    )


def errors_of_a_drawing(noise: float, seed: int) -> tuple[CalibrationModel, Readings, Array]:
    """A 3-RPS off by 3 mm in every number, in a small workspace; what was spoilt."""
    model, rng = rps_with_tracker(), np.random.default_rng(seed)
    x = model.task.home + rng.uniform(-1, 1, (80, 3)) * [0.04, 0.15, 0.15]
    truth = model.nominal + 3e-3 * rng.normal(size=model.nominal.size) / model.units
    values = model.predict(x, model.home(x, model.nominal), truth).readings
    spread = np.repeat([noise / 50, noise], [3, 9])
    values = values + spread * rng.normal(size=values.shape)
    spoilt = np.zeros(values.shape, dtype=bool)
    spoilt[:, 3:].flat[rng.choice(9 * 80, 12, replace=False)] = True
    values[spoilt] += noise * rng.uniform(20, 200, 12) * rng.choice([-1, 1], 12)
    names, more = model.sensors, model.sensors[3:]
    columns, deviations = (
        dict(zip(names, one, strict=True)) for one in (values.T, spread.tolist())
    )
    return model, readings(model.task, columns, deviations, more), spoilt


@pytest.mark.parametrize(("noise", "widest"), [(1e-6, None), (2e-5, 1.0)])
def test_errors_of_a_drawing_without_priors(noise: float, widest: float | None) -> None:
    """All combinations are fitted, the weakest known to some mm; readings that are right stay."""
    model, read, spoilt = errors_of_a_drawing(noise, 0)
    found = calibrate(model, read, widest=widest)
    assert found.identifiable.rank == 30
    assert np.array_equal(found.outliers, spoilt)
    assert 0.83 < found.chi_squared / found.freedom < 1.19  # of 678: 0.1 % and 99.9 %
    assert not found.doubts


def test_a_combination_left_as_believed_is_doubted_if_readings_contradict_it() -> None:
    """Off by 20 mm in a combination that is known to less than that, and may be off by 2."""
    case = five_bar()
    exact = case.model.predict(case.x, case.q, case.model.nominal).readings
    problem = Problem(case.model, read(exact), np.full(case.model.nominal.size, np.inf))
    problem.begin(None)
    every = problem.identifiable()
    weakest = every.seen[:, -1] / case.model.units
    widest = 0.99 / every.singular_values[every.rank - 1]
    for off, doubted in ((0.5, False), (12.0, True)):
        p = case.model.nominal + off * widest * weakest
        values, _ = measured(p, np.random.default_rng(8))
        told = calibrate(case.model, read(values), widest=widest)
        assert told.identifiable.weak == 1
        assert any("raise widest" in one for one in told.doubts) == doubted
        assert not calibrate(case.model, read(values), widest=1.0).doubts


# Redundant sensors alone --------------------------------------------------------------------------


def pentagon_gap(numbers: Array, angles: Array) -> Array:
    """The gap of a loop of four bars and a base, (2 n,), by lengths, base and offsets, (10,)."""
    lengths, base, t = numbers[:4], numbers[4:6], angles + numbers[6:]
    turned = [np.stack([np.cos(a), np.sin(a)]) for a in (t[:, 0], t[:, 0] + t[:, 1])]
    turned += [-np.stack([np.cos(a), np.sin(a)]) for a in (t[:, 2], t[:, 2] + t[:, 3])]
    return np.ravel(np.tensordot(lengths, turned, 1) - base[:, None])


def test_redundant_encoders_alone() -> None:
    """A five-bar with an encoder at every joint, and no pose measured.

    What is seen is counted by differences of the gap of a pentagon, and its scale is not seen.
    Errors of ten machines are those that the covariance, the bound, says.
    """
    case, joints, h = five_bar(), [*ENCODERS], 1e-6
    model = CalibrationModel(case.task, GROUPS, joints, offsets=joints)
    x, q = case.x, model.home(case.x, model.nominal)
    exact = model.predict(x, q, model.nominal).readings

    def taken(values: Array) -> Readings:
        columns = dict(zip(joints, values.T, strict=True))
        return readings(case.task, columns, dict.fromkeys(joints, 1e-4))

    numbers = np.array([*PENTAGON.values(), 0.0, *np.zeros(4)])
    assert worst(pentagon_gap(numbers, exact)) < 1e-9
    slopes = [
        (pentagon_gap(numbers + h * e, exact) - pentagon_gap(numbers - h * e, exact)) / (2 * h)
        for e in np.eye(10)
    ]
    values = np.linalg.svd(np.array(slopes), compute_uv=False)
    count = np.count_nonzero(values > 1e-6 * values[0])
    seen = calibrate(model, taken(exact), widest=10.0).identifiable
    assert seen.rank == count == 8  # of 10, but for the scale and a turn of the whole
    scale = np.zeros(model.nominal.size)
    for name, length in PENTAGON.items():
        scale[model.labels.index(name)] = length
    assert worst(seen.seen.T @ scale) < 1e-7
    assert not any(
        calibrate(model, taken(exact), widest=10.0).alone[model.labels.index(n)] for n in PENTAGON
    )
    squares = 0.0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        p = model.nominal + seen.seen @ (1e-3 * rng.normal(size=8)) / model.units
        there = model.predict(x, q, p).readings
        found = calibrate(model, taken(there + 1e-4 * rng.normal(size=there.shape)), widest=10.0)
        turn = found.identifiable.seen.T
        error = turn @ ((found.parameters - p) * model.units)
        own = (turn * model.units) @ found.covariance @ (turn * model.units).T
        squares += float(error @ np.linalg.solve(own, error))
    assert 46.5 < squares < 124.8  # chi squared of 80 degrees of freedom: 0.1 % and 99.9 %


# Bad input ----------------------------------------------------------------------------------------


def test_faults_of_readings() -> None:
    task = five_bar().task
    with pytest.raises(InputError, match="called 'left_jiont' \\(did you mean"):
        readings(task, {"left_jiont": [0.0]}, {"left_jiont": 1e-3})
    with pytest.raises(InputError, match="one number of each sensor for each pose"):
        readings(task, {"x": [0.0], "z": [0.0, 1.0]}, {"x": 1e-3, "z": 1e-3})
    with pytest.raises(InputError, match="no deviation of 'z'"):
        readings(task, {"x": [0.0], "z": [0.0]}, {"x": 1e-3})
    with pytest.raises(InputError, match="pose 1 has no reading"):
        readings(task, {"x": [0.0, np.nan]}, {"x": 1e-3})
    with pytest.raises(InputError, match="a reading is infinite"):
        readings(task, {"x": [np.inf]}, {"x": 1e-3})


def test_faults_of_a_calibration() -> None:
    case = five_bar()
    values = case.model.predict(case.x, case.q, case.model.nominal).readings
    with pytest.raises(InputError, match="no group of geometric parameters"):
        CalibrationModel(case.task, ["mass:left_joint"], ["x"])
    with pytest.raises(InputError, match="'z' is not read"):
        CalibrationModel(case.task, [], ["x"], offsets=["z"])
    with pytest.raises(InputError, match="the model's sensors are"):
        calibrate(case.model, readings(case.task, {"x": values[:, 2]}, {"x": 1e-3}))
    with pytest.raises(InputError, match="8 readings, poses: 2, leave nothing"):
        calibrate(case.model, read(values[:2]))
    with pytest.raises(InputError, match="no parameter 'closure:tip'"):
        calibrate(case.model, read(values), priors={"closure:tip": 1e-3})


def test_readings_of_another_machine_are_doubted() -> None:
    """Columns in the wrong order; noise that is larger than was said."""
    case, rng = five_bar(), np.random.default_rng(5)
    values, _ = measured(case.model.nominal, rng)
    try:
        doubts = calibrate(case.model, read(values[:, [1, 0, 3, 2]])).doubts
    except UnreachableError as error:
        doubts = (str(error),)
    assert doubts
    assert not calibrate(case.model, read(values)).doubts
    loud = case.model.predict(case.x, case.q, case.model.nominal).readings
    loud = loud + 2.0 * (values - loud)
    (doubt,) = calibrate(case.model, read(loud)).doubts
    assert "the residuals are 1." in doubt  # outliers are left out


def test_a_reading_that_cannot_be_is_an_outlier() -> None:
    """A digit typed wrong puts the tip 9 m away."""
    case, rng = five_bar(), np.random.default_rng(6)
    values, _ = measured(case.model.nominal, rng)
    values[7, 3] = 9.0
    found = calibrate(case.model, read(values))
    assert found.outliers[7, 3]
    assert found.outliers.sum() == 1


def test_a_step_of_fewer_rows_than_combinations() -> None:
    """The shortest that leaves nothing of the residuals, as by NumPy's least squares."""
    rng = np.random.default_rng(8)
    r, A, B = rng.normal(size=(2, 3)), rng.normal(size=(2, 3, 2)), rng.normal(size=(2, 3, 7))
    step = Linearised(r, A, B, np.zeros((0, 7)), np.zeros(0)).step()
    left = r - np.einsum("nsm,nm->ns", A, step.x) - B @ step.p
    assert worst(left) < 1e-12
    across = [np.linalg.svd(one)[0][:, 2] for one in A]  # what a pose cannot take
    rows = np.array([n @ b for n, b in zip(across, B, strict=True)])
    right = np.array([n @ one for n, one in zip(across, r, strict=True)])
    assert worst(step.p - np.linalg.lstsq(rows, right, rcond=None)[0]) < 1e-12
