"""Arrays that callers give: each public call converts them rightly, or refuses them in words."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.closed_loop import (
    ForceDistribution,
    InverseDynamics,
    LoopClosure,
    Simulation,
    Stepper,
)
from rps_pin.closed_loop.visuals import skeleton
from rps_pin.codegen import CompiledMechanism
from rps_pin.codegen.engine.forces import GeneratedForces
from rps_pin.control import ComputedTorque, Gains, Plant
from rps_pin.control.estimator.real_time_robot import RealTimeRobot
from rps_pin.errors import InputError, RPSPinError
from tests.codegen.engines import QUICK, of_file
from tests.worst import worst

#: Conversions of an array (n,) that keep its numbers, or round them to single precision.
Form = Callable[[np.ndarray], Any]


class _Subclass(np.ndarray):
    pass


def _unaligned(x: np.ndarray) -> np.ndarray:
    memory = np.zeros(x.nbytes + 1, np.uint8)
    memory[1:] = np.frombuffer(x.tobytes(), np.uint8)
    return memory[1:].view(np.float64)


def _read_only(x: np.ndarray) -> np.ndarray:
    copy = x.copy()
    copy.setflags(write=False)
    return copy


GOOD: dict[str, Form] = {
    "big-endian": lambda x: x.astype(">f8"),
    "little-endian": lambda x: x.astype("<f8"),
    "long double": lambda x: x.astype(np.longdouble),
    "list": list,
    "tuple": tuple,
    "every second": lambda x: np.repeat(x, 2)[::2],
    "reversed": lambda x: x[::-1].copy()[::-1],
    "column of a table": lambda x: np.tile(x[:, None], 3)[:, 1],
    "not aligned": _unaligned,
    "read-only": _read_only,
    "subclass": lambda x: x.view(_Subclass),
    "nothing masked": lambda x: np.ma.array(x, mask=False),
}
#: They round: the answer is that of the rounded numbers, or the same refusal.
ROUNDED: dict[str, Form] = {
    "single precision": lambda x: x.astype(np.float32),
    "single, big-endian": lambda x: x.astype(">f4"),
    "half precision": lambda x: x.astype(np.float16),
    "integers": lambda x: x.astype(int),
    "integers, big-endian": lambda x: x.astype(">i4"),
    "small integers": lambda x: np.abs(x).astype(np.uint8),
}
BAD: dict[str, Form] = {
    "complex": lambda x: x + 1j,
    "real numbers as complex": lambda x: x.astype(complex),
    "strings": lambda x: x.astype(str),
    "bytes": lambda x: x.astype(bytes),
    "one string": str,
    "objects": lambda x: x.astype(object),
    "truth values": lambda x: x.astype(bool),
    "dates": lambda x: x.astype("M8[s]"),
    "durations": lambda x: x.astype("m8[s]"),
    "masked": lambda x: np.ma.array(x, mask=True),
    "one masked": lambda x: np.ma.array(x, mask=[True] + [False] * (x.size - 1)),
    "records": lambda x: x.view([("x", np.float64)]),
    "ragged": lambda x: [[1.0], [1.0, 2.0]],
    "None inside": lambda x: [None] * x.size,
    "a dictionary": lambda x: {"x": 1.0},
    "a set": set,
    "too long": lambda x: np.append(x, 0.0),
    "one number": lambda x: np.float64(1.0),
    "NaN": lambda x: x * np.nan,
    "infinite": lambda x: x + np.inf,
    "huge integers": lambda x: [10**400] * len(x),
}

#: Arguments of `ClosedLoopModel` and `CompiledMechanism` by name, and the calls that take them.
ARGUMENTS = {
    "loop_errors": "q v a",
    "loop_gap": "q",
    "gaps": "q",
    "close": "q_guess",
    "project": "q_guess",
    "complete": "values q_guess",
    "jacobian": "q",
    "allowed_motions": "q",
    "motion_basis": "q",
    "frame_placement": "q",
    "frame_jacobian": "q",
    "velocity": "q v_actuated",
    "acceleration": "q v a_actuated",
    "condition": "q",
    "inverse_dynamics": "q v a",
    "generalised_force": "q v a",
    "constraint_forces": "q v a tau",
    "forward_dynamics": "q v tau",
    "mass_matrix": "q",
    "bias": "q v",
    "gravity_forces": "q",
    "energy": "q v",
    "closure_wrenches": "q constraint_forces",
    "joint_wrenches": "q v a constraint_forces",
    "inverse_dynamics_derivatives": "q v a",
    "forward_dynamics_derivatives": "q v tau",
    "linearize": "q v tau",
    "simulate": "q v",
    "describe": "q",
    "closure_at": "q",
    "interference": "q",
    "search_start": "q_guess",
    "assembly_modes": "values q_guess",
    "step": "q v tau",
    "steps": "q v tau",
    "passive_jacobian": "q",
}
#: Of a mechanism that is compiled with parameters.
BY_PARAMETERS = {
    "gaps_by_parameters": "q",
    "inverse_dynamics_by_parameters": "q v a",
    "forward_dynamics_by_parameters": "q v tau",
    "inverse_dynamics": "q v a",
    "jacobian": "q",
}
OTHERS: dict[str, dict[str, Any]] = {
    "frame_placement": {"frame": "coupler"},
    "frame_jacobian": {"frame": "coupler"},
    "closure_at": {"frame_a": "coupler"},
    "simulate": {"duration": 0.01, "step": 0.005},
    "assembly_modes": {"starts": 20},
    "step": {"duration": 1e-3},
    "steps": {"duration": 1e-3, "count": 2},
}


@cache
def _pinocchio() -> ClosedLoopModel:
    mechanism = ClosedLoopModel.load("urdf/four_bar.yaml")
    return mechanism.with_collision(skeleton(mechanism))  # bars, whose distances are computed


@cache
def _with_parameters() -> CompiledMechanism:
    return _pinocchio().compile(
        compiler=QUICK, parameters=["mass:crank_joint", "mass:coupler_joint"]
    )


@cache
def _values() -> dict[str, np.ndarray]:
    mechanism = _pinocchio()
    q = mechanism.complete({"crank_joint": 1.0})
    v = mechanism.velocity(q, [2.0])
    a = mechanism.acceleration(q, v, [0.5])
    found = mechanism.inverse_dynamics(q, v, a)
    values = {"q": q, "v": v, "a": a, "tau": found.tau, "q_guess": q, "values": np.array([1.0])}
    values |= {"v_actuated": np.array([2.0]), "a_actuated": np.array([0.5])}
    return values | {"constraint_forces": found.constraint_forces}


@cache
def _robot() -> RPSRobot:
    return RPSRobot.from_preset("micro")


_POSE, _RATE = np.array([0.223, 0.02, -0.01]), np.array([0.01, 0.1, -0.2])
_LENGTH = np.array([0.224, 0.2245, 0.2203])


def _calls() -> Iterator[tuple[str, Callable[..., Any], dict[str, np.ndarray], dict[str, Any]]]:
    for mechanism in (_pinocchio(), of_file("four_bar")):
        kind = type(mechanism).__name__
        for name, given in ARGUMENTS.items():
            if hasattr(mechanism, name):
                arrays = {one: _values()[one] for one in given.split()}
                others = OTHERS.get(name, {})
                yield f"{kind}.{name}", getattr(mechanism, name), arrays, others
    fast = _with_parameters()
    for name, given in BY_PARAMETERS.items():
        arrays = {one: _values()[one] for one in given.split()} | {
            "parameters": np.array([1.3, 2.25])
        }
        yield f"by parameters.{name}", getattr(fast, name), arrays, {}
    robot = _robot()
    motion = {"pose": _POSE, "rate": _RATE, "acceleration": _RATE}
    for name in ("motion", "state", "actuator_forces"):
        yield f"RPSRobot.{name}", getattr(robot, name), motion, {}
    wrench = {"wrench": np.arange(6.0) + 1}
    yield "RPSRobot.actuator_forces", robot.actuator_forces, wrench, motion
    yield "RPSRobot.inverse_kinematics", robot.inverse_kinematics, {"pose": _POSE}, {}
    yield "RPSRobot.platform_placement", robot.platform_placement, {"pose": _POSE}, {}
    yield "RPSRobot.assembly_modes", robot.assembly_modes, {"length": _LENGTH}, {}
    near = {"length": _LENGTH, "near": _POSE}
    yield "RPSRobot.forward_kinematics", robot.forward_kinematics, near, {}
    q, v, a = robot.state(*motion.values())
    state = {"q": q, "v": v, "a": a}
    yield "RPSRobot.inverse_dynamics", robot.inverse_dynamics, state, {}
    yield "RPSRobot.inverse_dynamics", robot.inverse_dynamics, wrench, state
    four = {one: _values()[one] for one in "qva"}
    distribution = ForceDistribution(_pinocchio(), torque_limits=50.0)
    yield "ForceDistribution.solve", distribution.solve, four, {}
    yield "ForceDistribution", _weighted, {"weights": np.array([2.0])}, {}
    yield "Stepper", _stepped, {one: _values()[one] for one in ("q", "v", "tau")}, {}
    yield "Plant", _plant, {"pose": _POSE, "forces": np.array([1.0, 2.0, 3.0])}, {}
    yield "RealTimeRobot", _estimate, {"near": _POSE}, {}
    limits = {"near": _POSE, "force_limit": np.array([40.0, 50.0, 60.0])}
    yield "ComputedTorque", _controller, limits, {}


def _weighted(weights: Any) -> Any:
    return ForceDistribution(_pinocchio(), weights=weights).weights


def _stepped(q: Any, v: Any, tau: Any) -> Any:
    stepper = Stepper(_pinocchio(), q, v)
    stepper.advance(tau, 1e-3)
    return stepper.q, stepper.v


def _plant(pose: Any, forces: Any) -> Any:
    plant = Plant(_robot(), pose)
    plant.step(forces)
    return plant.configuration


def _estimate(near: Any) -> Any:
    return RealTimeRobot(_robot(), near, compiled=False).state.geometry.length


def _controller(near: Any, force_limit: Any) -> Any:
    gains = Gains.placed(15.0)
    made = ComputedTorque(_robot(), near, gains, force_limit=force_limit, compiled=False)
    return made.forces


CALLS = [pytest.param(*call[1:], id=f"{call[0]} {' '.join(call[2])}") for call in _calls()]


def _numbers(answer: Any) -> np.ndarray:
    """Return all numbers of an answer, one behind the other."""
    if isinstance(answer, LoopClosure):
        answer = np.asarray(answer.placement_b)
    if isinstance(answer, Simulation):
        answer = answer.q
    if isinstance(answer, (InverseDynamics, GeneratedForces)):
        answer = answer.tau, answer.constraint_forces
    if isinstance(answer, dict):
        answer = tuple(answer.values())
    if isinstance(answer, (np.ndarray, np.bool_, float, int)):
        return np.ravel(np.asarray(answer, dtype=float))
    if not isinstance(answer, (tuple, list)):
        answer = [part for part in vars(answer).values() if isinstance(part, np.ndarray)]
    return np.concatenate(
        [np.zeros(0), *(_numbers(p) for p in answer if p is not None and not isinstance(p, str))]
    )


def _differ(found: np.ndarray, wanted: np.ndarray) -> float:
    assert found.size == wanted.size > 0
    return float(worst(found - wanted) / max(1.0, np.abs(wanted).max()))


@pytest.mark.parametrize(("call", "arrays", "others"), CALLS)
def test_arrays_are_read_rightly_or_refused(
    call: Callable[..., Any], arrays: dict[str, np.ndarray], others: dict[str, Any]
) -> None:
    wanted = _numbers(call(**arrays, **others))
    for name, array in arrays.items():
        for form, convert in GOOD.items():
            found = _numbers(call(**{**arrays, name: convert(array)}, **others))
            assert _differ(found, wanted) <= 1e-12, (name, form)
        for form, convert in ROUNDED.items():
            rounded = np.array(convert(array).tolist(), dtype=np.float64)
            try:
                wanted_now = _numbers(call(**{**arrays, name: rounded}, **others))
            except RPSPinError as error:
                with pytest.raises(type(error)):
                    call(**{**arrays, name: convert(array)}, **others)
            else:
                found = _numbers(call(**{**arrays, name: convert(array)}, **others))
                assert _differ(found, wanted_now) <= 1e-12, (name, form)
        for form, convert in BAD.items():
            if form in ("one number", "infinite") and name in ("weights", "force_limit"):
                continue  # one for all; and no limit
            with pytest.raises(InputError):
                call(**{**arrays, name: convert(array)}, **others)
                pytest.fail(f"{name}: {form}")


@pytest.mark.parametrize("kind", [ClosedLoopModel, CompiledMechanism])
def test_every_call_with_arrays_is_in_the_table(kind: type) -> None:
    scalars = {"duration", "home", "parameters", "gravity"}
    # The next test; and of arrays that `rps_pin.task.workspace` has made.
    inner = {"generated", "continued"}
    for name, method in inspect.getmembers(kind, inspect.isfunction):
        if not name.startswith("_"):
            given = inspect.signature(method).parameters.values()
            arrays = {one.name for one in given if str(one.annotation).split(" |")[0] in _TYPES}
            assert (
                not arrays - scalars or name in ARGUMENTS or name in BY_PARAMETERS or name in inner
            )


_TYPES = ("ArrayLike", "Array")


def test_generated_functions_give_a_status_for_what_is_not_finite() -> None:
    """And refuse the rest, as all other calls do."""
    mechanism, arrays = of_file("four_bar"), {one: _values()[one] for one in "qva"}

    def call(**given: Any) -> tuple[Any, Any]:
        *answers, status = mechanism.generated("inverse_dynamics", None, None, *given.values())
        return answers, status

    answers, status = call(**arrays)
    assert status == 0
    wanted = _numbers(answers)
    for name, array in arrays.items():
        for form, convert in GOOD.items():
            found, status = call(**{**arrays, name: convert(array)})
            assert status == 0
            assert _differ(_numbers(found), wanted) <= 1e-12, (name, form)
        for form, convert in BAD.items():
            if form in ("NaN", "infinite"):
                assert call(**{**arrays, name: convert(array)})[1] != 0, (name, form)
                continue
            with pytest.raises(InputError):
                call(**{**arrays, name: convert(array)})
                pytest.fail(f"{name}: {form}")


@pytest.mark.parametrize("engine", ["compiled mechanism", "robot"])
def test_batches_are_read_rightly_or_refused(engine: str) -> None:
    if engine == "robot":
        call: Callable[..., Any] = _robot().actuator_forces
        batch = [np.tile(one, (5, 1)) for one in (_POSE, _RATE, _RATE)]
        batch[0][:, 1] += np.linspace(0, 0.05, 5)
    else:
        call = of_file("four_bar").generalised_force
        batch = [np.tile(_values()[name], (5, 1)) for name in "qva"]
        batch[1] *= np.arange(5.0)[:, None]
    wanted = _numbers(call(*batch))
    assert wanted.size in (15, 5 * _pinocchio().model.nv)
    for at, array in enumerate(batch):
        for form, convert in GOOD.items():
            if form not in ("every second", "column of a table", "not aligned"):
                given = [convert(array) if k == at else one for k, one in enumerate(batch)]
                assert _differ(_numbers(call(*given)), wanted) <= 1e-12, (at, form)
        turned = [np.asfortranarray(one) if k == at else one for k, one in enumerate(batch)]
        assert _differ(_numbers(call(*turned)), wanted) <= 1e-12, at
        for form, convert in BAD.items():
            if form not in ("records", "one masked", "a set", "too long", "None inside"):
                given = [convert(array) if k == at else one for k, one in enumerate(batch)]
                with pytest.raises(InputError):
                    call(*given)
                    pytest.fail(f"{at}: {form}")
        some = np.ma.array(array, mask=np.arange(array.size).reshape(array.shape) == 4)
        with pytest.raises(InputError, match="masked"):
            call(*[some if k == at else one for k, one in enumerate(batch)])
