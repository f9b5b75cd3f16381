"""Generated CUDA: on the host against the Pinocchio engine, through nvcc, and calls of Python."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.closed_loop.simulation.stepper import Stepper
from rps_pin.codegen.cuda.mechanism import CudaMechanism, DeviceForces, DeviceStates
from rps_pin.codegen.cuda.proof import accepted
from rps_pin.codegen.cuda.source import unit
from rps_pin.codegen.engine.generated import GeneratedCode
from rps_pin.codegen.engine.proof import Proof, Sample
from rps_pin.errors import ClosureError, CompileError, InputError, SingularityError
from tests.codegen.device import DeviceArray, FakeCuPy
from tests.quick import quick
from tests.worst import worst

URDF = Path(__file__).parents[2] / "urdf"


def file(name: str) -> ClosedLoopModel:
    return ClosedLoopModel.load(URDF / f"{name}.yaml")


MECHANISMS: dict[str, Callable[[], ClosedLoopModel]] = {
    "3-RPS": lambda: RPSRobot.from_preset("sokolov").mechanism,
    "stewart": lambda: file("stewart"),
    "four-bar": lambda: file("four_bar"),
}


@pytest.fixture(scope="module")
def five_bar(cupy: FakeCuPy) -> CudaMechanism:
    options = {"wrench_frames": ["left_tip"], "parameters": ["gravity"]}
    found: CudaMechanism = file("five_bar").compile(device="cuda", **options)
    return found


def states(fast: CudaMechanism, count: int) -> list[Sample]:
    """Return closed states other than those of the proof."""
    code = fast.code
    proof = Proof(code.mechanism, code.partition.independent, code.parameters, code.wrench_frames)
    places = [sample.q for sample in proof.samples[:5]]
    return [proof._sample(places[i % 5]) for i in range(count)]


def column(samples: list[Sample], name: str) -> Any:
    return np.array([getattr(sample, name) for sample in samples])


def put(fast: CudaMechanism, array: Any, layout: str) -> Any:
    """Return an array (n, k) on the card: samples apart, or entries apart."""
    samples = np.ascontiguousarray(array, dtype=fast.dtype).view(DeviceArray)
    return samples if layout == "samples" else fast.array(samples)


# Answers ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "dtype", "steps"),
    quick(
        [
            ("3-RPS", "float64", 3),
            ("3-RPS", "float32", 3),
            ("four-bar", "float64", 0),
            ("four-bar", "float32", 3),
            ("stewart", "float64", 0),
        ],
        [("3-RPS", "float64", 3), ("four-bar", "float64", 0), ("four-bar", "float32", 3)],
    ),
)
def test_answers_of_the_pinocchio_engine(name: str, dtype: str, steps: int, cupy: FakeCuPy) -> None:
    mechanism = MECHANISMS[name]()
    fast = mechanism.compile(device="cuda", dtype=dtype)
    samples = states(fast, 20)
    most = accepted(dtype, max(sample.condition for sample in samples))
    assert most == 1e-10 if dtype == "float64" else most < 1e-3
    q, v, a, tau = (column(samples, key) for key in ("q", "v", "a", "tau"))
    forces = [mechanism.inverse_dynamics(*one) for one in zip(q, v, a, strict=True)]
    moved = []
    for sample in samples:
        stepper = Stepper(mechanism, sample.q, sample.v)
        for _ in range(max(steps, 1)):
            stepper.advance(sample.tau, 2e-4)
        moved.append((stepper.q, stepper.v))
    for layout in ("samples", "entries"):
        given = {"q": q, "v": v, "a": a, "tau": tau}
        x = {key: put(fast, array, layout) for key, array in given.items()}
        found = fast.inverse_dynamics(x["q"], x["v"], x["a"])
        assert relative(found.tau, [one.tau for one in forces]) < most
        assert relative(found.constraint_forces, [one.constraint_forces for one in forces]) < most
        assert (found.unproduced, found.residual.shape) == (None, (20,))
        assert relative(fast.forward_dynamics(x["q"], x["v"], x["tau"]).a, a) < most
        if steps:
            after = fast.steps(x["q"], x["v"], x["tau"], 2e-4, steps)
        else:
            after = fast.step(x["q"], x["v"], x["tau"], 2e-4)
        assert relative(after.q, [one[0] for one in moved]) < most
        assert relative(after.v, [one[1] for one in moved]) < most
        for result in (found.tau, after.q):
            assert result.dtype == dtype
            assert result.flags.f_contiguous
            assert not found.status.any()


def relative(found: Any, wanted: Any) -> float:
    """Return the largest difference over the largest number of each sample."""
    wanted = np.asarray(wanted)
    return worst((found - wanted) / np.abs(wanted).max(axis=1, keepdims=True))


def test_a_motion_is_as_many_steps(five_bar: CudaMechanism) -> None:
    samples = states(five_bar, 4)
    q, v, tau = (put(five_bar, column(samples, key), "entries") for key in ("q", "v", "tau"))
    options = {"wrenches": {"left_tip": np.array([1.0, 2.0, 0.0, 0.0, 0.0, 0.1])}}
    together = five_bar.steps(q, v, tau, 1e-3, 7, **options)
    work = np.zeros(4)
    for _ in range(7):
        one = five_bar.step(q, v, tau, 1e-3, **options)
        q, v, work = one.q, one.v, work + one.work
    np.testing.assert_allclose(together.q, q, rtol=1e-14)
    np.testing.assert_allclose(together.v, v, rtol=1e-12)
    np.testing.assert_allclose(together.work, work, rtol=1e-12)


def test_single_precision_where_forces_hold_the_weight(cupy: FakeCuPy) -> None:
    """Accelerations may be far smaller than those without actuator forces."""
    fast = file("slider_crank").compile(device="cuda", dtype="float32")
    sample = states(fast, 1)[0]
    found = fast.forward_dynamics(sample.q, sample.v, sample.tau)
    falling = fast.forward_dynamics(sample.q, sample.v, 0 * sample.tau)
    assert worst(found.a - sample.a) < accepted("float32", 1.0) * worst(falling.a)
    assert fast.differences["forward_dynamics"] < accepted("float32", 1.0)


def test_nvcc_compiles_the_text(tmp_path: Path) -> None:
    nvcc = shutil.which("nvcc")
    if nvcc is None:
        pytest.skip("no nvcc")
    runs = []
    for robot, name, real in (
        ("3-RPS", "inverse_dynamics", "double"),
        ("four-bar", "motion", "float"),
    ):
        code = GeneratedCode(MECHANISMS[robot]())
        source = tmp_path / f"{name}.cu"
        source.write_text(unit(code.functions, name, real).cuda(real), "utf-8")
        command = [nvcc, "-arch=sm_90", "-Werror", "all-warnings", "-cubin", str(source)]
        command += ["-o", str(source.with_suffix(".cubin"))]
        runs.append(subprocess.Popen(command, stderr=subprocess.STDOUT, stdout=subprocess.PIPE))
    for run in runs:
        said, _ = run.communicate()
        assert run.returncode == 0, said.decode()


# Calls --------------------------------------------------------------------------------------------


class OnTheCard:
    """An array of another library."""

    __cuda_array_interface__: ClassVar[dict[str, Any]] = {}

    def __init__(self, array: Any) -> None:
        self._array = array

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return self._array


def test_one_sample_and_the_same_for_all(five_bar: CudaMechanism, cupy: FakeCuPy) -> None:
    samples = states(five_bar, 130)
    q, v, tau = (column(samples, key) for key in ("q", "v", "tau"))
    many = five_bar.forward_dynamics(q, v, tau[0])
    assert cupy.launches[-1] == ((3,), (64,))
    assert (many.a.shape, many.status.shape) == ((130, 4), (130,))
    one = five_bar.forward_dynamics(q[3], OnTheCard(v[3]), list(tau[0]))
    assert (one.a.shape, int(one.status)) == ((4,), 0)
    np.testing.assert_array_equal(one.a, many.a[3])
    np.testing.assert_array_equal(five_bar.forward_dynamics(q, v[:1], tau[:1]).a[0], many.a[0])
    step = five_bar.step(q[:2], v[:2], tau[:2], [1e-3, 2e-3])
    for i, duration in enumerate((1e-3, 2e-3)):
        alone = five_bar.step(q[i], v[i], tau[i], duration)
        np.testing.assert_array_equal(alone.q, step.q[i])
        assert alone.work == step.work[i]
    launched = len(cupy.launches)
    nothing = five_bar.forward_dynamics(np.empty((0, 4)), np.empty((0, 4)), tau[0])
    assert (nothing.a.shape, nothing.status.shape) == ((0, 4), (0,))
    assert len(cupy.launches) == launched


def test_arrays_are_used_again_and_in_place(five_bar: CudaMechanism, cupy: FakeCuPy) -> None:
    samples = states(five_bar, 6)
    q, v, a, tau = (put(five_bar, column(samples, k), "entries") for k in ("q", "v", "a", "tau"))
    first = five_bar.inverse_dynamics(q, v, a)
    forces = np.array(first.tau)
    again = five_bar.inverse_dynamics(q, v, 2 * a, out=first)
    assert again.tau is first.tau
    assert again.constraint_forces is first.constraint_forces
    assert again.status is first.status
    assert worst(again.tau - forces) > 1e-3
    right = five_bar.step(q, v, tau, 1e-3)
    five_bar.step(q, v, tau, 1e-3, out=DeviceStates(q, v, None, None))
    np.testing.assert_array_equal(q, right.q)
    np.testing.assert_array_equal(v, right.v)
    apart = cupy.empty((12, 8), float)[::2, ::2]
    given = DeviceForces(None, None, None, None, None)
    acceleration = five_bar.forward_dynamics(right.q, right.v, tau, out=(apart, None))
    assert acceleration.a is apart
    np.testing.assert_array_equal(apart, five_bar.forward_dynamics(right.q, right.v, tau).a)
    assert five_bar.inverse_dynamics(q, v, a, out=given).status.shape == (6,)


def test_parameters_and_wrenches(five_bar: CudaMechanism) -> None:
    assert len(five_bar.parameters) == 3
    np.testing.assert_array_equal(five_bar.nominal_parameters, [0, 0, -9.81])
    samples = states(five_bar, 5)
    gravity = np.random.default_rng(0).normal(size=(5, 3))
    given = column(samples, "q"), column(samples, "v"), column(samples, "a")
    wrench = np.random.default_rng(1).normal(size=(5, 6))
    for frame in ("left_tip", "right_tip"):
        found = five_bar.inverse_dynamics(*given, wrenches={frame: wrench}, parameters=gravity)
        for i, sample in enumerate(samples):
            mechanism = file("five_bar")
            mechanism.model.gravity.linear = gravity[i]
            right = mechanism.inverse_dynamics(
                sample.q, sample.v, sample.a, wrenches={frame: wrench[i]}
            )
            assert worst(found.tau[i] - right.tau) < 1e-12
    both = {"left_tip": wrench, "right_tip": np.zeros(6)}
    found = five_bar.inverse_dynamics(*given, wrenches=both)
    alone = five_bar.inverse_dynamics(*given, wrenches={"left_tip": wrench})
    assert worst(found.tau - alone.tau) < 1e-12


def test_forces_that_actuators_do_not_produce(cupy: FakeCuPy) -> None:
    whole = file("five_bar")
    mechanism = ClosedLoopModel(whole.model, whole.closures, ["left_joint"], home=whole.home)
    fast = mechanism.compile(device="cuda")
    q = np.array([mechanism.home] * 3)
    found = fast.inverse_dynamics(q, np.zeros(4), np.zeros(4), errors="mask")
    right = mechanism.inverse_dynamics(q[0], np.zeros(4), np.zeros(4))
    assert right.unproduced is not None
    assert worst(found.unproduced - right.unproduced) < 1e-10
    assert worst(found.tau - right.tau) < 1e-10


# Samples without an answer ------------------------------------------------------------------------


def toggle() -> Any:
    """Return the five-bar with its arms in line, its elbows 0.87 m apart."""
    far, left, right, base = 0.87, 0.3, 0.28, 0.4
    a = 2.3
    elbow = left * np.array([np.cos(a), np.sin(a)])
    to_base = np.array([base, 0.0]) - elbow
    reach = np.hypot(*to_base)
    between = np.arccos((reach**2 + far**2 - right**2) / (2 * reach * far))
    arm = np.arctan2(to_base[1], to_base[0]) + between
    other = elbow + far * np.array([np.cos(arm), np.sin(arm)])
    b = np.arctan2(other[1], other[0] - base)
    return np.array([a, arm - a, b, arm + np.pi - b])


def test_samples_without_an_answer(five_bar: CudaMechanism) -> None:
    q = np.array([sample.q for sample in states(five_bar, 9)])
    still, tau = np.zeros(4), np.zeros(2)
    q[2, 1] += 0.1
    q[5] = toggle()
    q[7, 0] = np.nan
    with pytest.raises(ClosureError, match=r"3 of 9 samples have no answer \(2, 5, 7\)") as caught:
        five_bar.forward_dynamics(q, still, tau)
    assert caught.value.gap > 0.01
    assert list(np.flatnonzero(caught.value.failed)) == [2, 5, 7]
    with pytest.raises(SingularityError, match="Sample 0: nearly singular") as singular:
        five_bar.inverse_dynamics(q[5], still, still, parameters=[0, 0, -1])
    assert singular.value.condition > 1e5
    with pytest.raises(InputError, match="Sample 0: its numbers, or its results, are not finite"):
        five_bar.step(q[7:], still, tau, 1e-3)
    found = five_bar.forward_dynamics(q, still, tau, errors="mask")
    assert list(np.flatnonzero(found.status)) == [2, 5, 7]
    assert (found.status[2] & 2, found.status[5] & 4, found.status[7] & 1) == (2, 4, 1)
    assert np.isnan(found.a[[2, 5, 7]]).all()
    assert np.isfinite(found.a[[0, 1, 3, 4, 6, 8]]).all()
    moved = five_bar.steps(q, still, tau, 1e-3, 3, errors="mask")
    assert list(np.flatnonzero(moved.status)) == [2, 5, 7]


# Bad input ----------------------------------------------------------------------------------------


def test_bad_arguments_are_refused(five_bar: CudaMechanism, cupy: FakeCuPy) -> None:
    q, v, tau = np.array([five_bar.mechanism.home] * 3), np.zeros((3, 4)), np.zeros(2)
    single = np.zeros((3, 4), np.float32).view(DeviceArray)
    run = five_bar.forward_dynamics
    one_place = np.broadcast_to(np.zeros(4), (3, 4)).view(DeviceArray)
    wrong = np.zeros((4, 3)).view(DeviceArray)
    marks = np.zeros(3, np.int64).view(DeviceArray)
    for call, message in (
        (lambda: run(q[:, :3], v, tau), r"q has shape \(3, 3\); expected \(4,\) or \(n, 4\)"),
        (lambda: run(q, v[:2], tau), "the inputs have 2, 3 samples; they must have as many"),
        (lambda: run(q, single, tau), r"v is an array of float32, and the code is of float64"),
        (lambda: run(q, ["a"] * 4, tau), "v = "),
        (lambda: run(q, v, tau, out=(q, None)), "out: a must be an array of CuPy, not ndarray"),
        (lambda: run(q, v, tau, out=(wrong, None)), r"out: a has shape \(4, 3\); expected \(3,"),
        (lambda: run(q, v, tau, out=(one_place, None)), "out: a has several numbers in one"),
        (lambda: run(q, v, tau, out=(None, marks)), "out: status must be an array of CuPy of"),
        (lambda: run(q, v, tau, errors="no"), "errors = 'no'"),
        (lambda: run(q, v, tau, wrenches={"left_tip": np.zeros(3)}), "the wrench at left_tip has"),
        (lambda: run(q, v, tau, wrenches={"nowhere": np.zeros(6)}), "nowhere"),
        (lambda: five_bar.step(q, v, tau, [[1e-3]]), r"h has shape \(1, 1\); expected \(\) or"),
        (lambda: five_bar.steps(q, v, tau, 1e-3, 0), "count = 0"),
        (lambda: five_bar.steps(q, v, tau, 1e-3, 10**8), "it must be at most 16777216"),
        (lambda: file("five_bar").compile(device="gpu"), "device = 'gpu': it must be 'cpu' or"),
        (lambda: file("five_bar").compile(dtype="float32"), "on device 'cpu' it must be"),
        (lambda: file("five_bar").compile(device="cuda", dtype="half"), "dtype = 'half'"),
        (lambda: file("five_bar").compile(device="cuda", compiler="gcc"), "has its own"),
        (
            lambda: file("five_bar").compile(device="cuda", functions=["forces"]),
            "a group of functions on device 'cuda' = 'forces': it must be 'dynamics' or",
        ),
    ):
        with pytest.raises(InputError, match=message):
            call()
    plain = file("five_bar").compile(device="cuda")
    with pytest.raises(InputError, match="was compiled without parameters"):
        plain.forward_dynamics(q, v, tau, parameters=[1.0])


def test_without_cupy_or_a_card(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    mechanism = file("four_bar")
    monkeypatch.setitem(sys.modules, "cupy", None)  # type: ignore[arg-type]
    with pytest.raises(CompileError, match=r"needs CuPy: pip install 'rps-pin\[cuda\]'"):
        mechanism.compile(device="cuda")
    for cards in (None, 0):
        monkeypatch.setitem(sys.modules, "cupy", FakeCuPy(tmp_path, cards))  # type: ignore[arg-type]
        with pytest.raises(CompileError, match="needs an NVIDIA card; CuPy finds none"):
            mechanism.compile(device="cuda")


class WrongCard(FakeCuPy):
    """A card whose compiler refuses, or whose results are wrong by a part in 10^9."""

    refuses = False

    def RawModule(self, *, code: str, options: Any, backend: str) -> Any:  # noqa: N802
        if self.refuses:
            code += "// refuse"
        code = code.replace("y0s[k];\n    }", "y0s[k] * CONST(1.000000001);\n    }")
        return super().RawModule(code=code, options=options, backend=backend)


def test_code_that_is_wrong_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    mechanism, card = file("four_bar"), WrongCard(tmp_path)
    monkeypatch.setitem(sys.modules, "cupy", card)  # type: ignore[arg-type]
    message = r"forward_dynamics: a\[\d\] = \S+, not \S+: 1e-09 relative, at most 1e-10"
    fast = mechanism.compile(device="cuda")
    for _ in range(2):
        with pytest.raises(CompileError, match=message):
            fast.forward_dynamics(mechanism.home, [0, 0, 0], [0])
    card.refuses = True
    with pytest.raises(CompileError, match=r"NVRTC refuses inverse_dynamics: unit.cu\(3\)") as said:
        mechanism.compile(device="cuda", functions=["dynamics"])
    assert "and more" in said.value.output
