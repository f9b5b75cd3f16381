"""What `compile` refuses; builds that fail, a damaged cache, two builds at once."""

from __future__ import annotations

import re
import shutil
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, CompileError, InputError, LoopClosure, MechanismError
from rps_pin.codegen.build import compilers, tcc
from rps_pin.codegen.engine import generated, proof
from rps_pin.codegen.expressions import functions
from tests import processes
from tests.closed_loop import mechanisms
from tests.codegen.engines import QUICK, difference, states


def five_bar() -> ClosedLoopModel:
    rough = mechanisms.five_bar()
    return mechanisms.five_bar(home=rough.close(mechanisms.guess(rough)))


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RPS_PIN_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def kept(folder: Path) -> list[str]:
    return sorted(one.name for one in folder.glob("*") if one.is_dir())


# Arguments ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "kind", "words"),
    [
        (
            {"functions": ["dynamic"]},
            InputError,
            r"'dynamic' \(did you mean dynamics\?\); there are: ",
        ),
        ({"functions": "forward_dynamics"}, InputError, r"'forward_dynamics'.*there are: dynamics"),
        ({"functions": [3]}, InputError, r"functions = \[3\]: it must be a sequence of names"),
        ({"functions": None}, InputError, "functions = None"),
        ({"compiler": "gcx"}, InputError, r"compiler = 'gcx' \(did you mean gcc\?\): it must be"),
        ({"compiler": None}, InputError, "compiler = None"),
        ({"device": "gpu"}, InputError, "device = 'gpu'"),
        ({"device": "gpu", "functions": []}, InputError, "device = 'gpu'"),
        ({"dtype": "float16"}, InputError, "dtype = 'float16'"),
        ({"wrench_frames": ["tip"]}, MechanismError, "no frame 'tip'.* left_tip"),
        ({"wrench_frames": "tip"}, MechanismError, "no frame 'tip'.* left_tip"),
        ({"wrench_frames": ["left_tip", "left_tip"]}, MechanismError, "left_tip"),
        ({"parameters": 3}, InputError, "parameters = 3"),
        ({"parameters": ["gravity", 3]}, InputError, "parameters = "),
    ],
    ids=str,
)
def test_options_that_are_not_possible(
    options: dict[str, Any], kind: type[Exception], words: str
) -> None:
    with pytest.raises(kind, match=words):
        five_bar().compile(**({"compiler": QUICK} | options))


def test_names_may_stand_alone_and_groups_may_be_none() -> None:
    fast = five_bar().compile(compiler=QUICK, functions="dynamics", wrench_frames="left_tip")
    assert set(fast.code.libraries) == {"dynamics"}
    s = next(states(fast.mechanism))
    push = {"left_tip": np.ones(6)}
    found = fast.forward_dynamics(s.q, s.v, s.tau, wrenches=push)
    wanted = fast.mechanism.forward_dynamics(s.q, s.v, s.tau, wrenches=push)
    assert difference(found, wanted) <= 1e-10
    assert set(five_bar().compile(compiler=QUICK, functions=[]).code.libraries) <= {"dynamics"}


def with_joint(joint: Any) -> ClosedLoopModel:
    """A bar on an ordinary joint, and a link on another at its end that a ball holds."""
    model = pin.Model()
    bar = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "bar")
    far = model.addJoint(bar, joint, pin.SE3(np.eye(3), np.array([0.0, 0.3, 0.0])), "odd")
    for one in (bar, far):
        model.appendBodyToJoint(one, pin.Inertia.Random(), pin.SE3.Identity())
        place = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.1]))
        model.addFrame(pin.Frame(f"tip_{one}", one, 0, place, pin.FrameType.OP_FRAME))
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    ground = data.oMf[model.getFrameId(f"tip_{far}")]
    model.addFrame(pin.Frame("ground", 0, 0, ground, pin.FrameType.OP_FRAME))
    closure = LoopClosure(f"tip_{far}", "ground", "point_on_plane", axis=(1, 0, 0))
    return ClosedLoopModel(model, [closure], ["bar"])


def test_joints_without_expressions() -> None:
    mechanism = with_joint(pin.JointModelEllipsoid(0.3, 0.5, 0.8))
    with pytest.raises(MechanismError, match=r"'odd' \(Ellipsoid\)"):
        mechanism.compile(compiler=QUICK, functions="dynamics")


def test_without_casadi() -> None:
    code = (
        "import sys; sys.modules['casadi'] = None\n"
        "from tests.closed_loop import mechanisms\n"
        "mechanisms.five_bar().compile()\n"
    )
    run = processes.run([sys.executable, "-c", code])
    assert run.returncode != 0
    assert "pip install 'rps-pin[compile]'" in run.stderr.splitlines()[-1]


# Proofs that fail ---------------------------------------------------------------------------------


def test_code_that_does_not_agree_is_refused(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With both numbers; nothing of it is kept, and without the mistake it is built."""
    right = functions._MAKERS["gravity_forces"]

    def wrong(x: Any) -> Any:
        given, results = right(x)
        return given, results | {"force": -results["force"]}

    fast = five_bar().compile(compiler=QUICK, functions="dynamics")
    before = kept(own_cache)
    s = next(states(fast.mechanism))
    with monkeypatch.context() as patch:
        patch.setitem(functions._MAKERS, "gravity_forces", wrong)
        with pytest.raises(CompileError) as caught:
            fast.gravity_forces(s.q)
        text = str(caught.value)
        assert "generated code of gravity_forces does not agree with the Pinocchio engine" in text
        one, other = re.search(r"force\[\d\] = (\S+), not (\S+): ", text).groups()
        assert float(one) == pytest.approx(-float(other), rel=1e-10)
        assert "2 relative, at most 1e-10 is accepted" in text
        assert kept(own_cache) == before
        with pytest.raises(CompileError, match="gravity_forces"):  # again, not remembered
            fast.gravity_forces(s.q)
    again = five_bar().compile(compiler=QUICK, functions=["dynamics", "forces"])
    assert difference(again.gravity_forces(s.q), fast.mechanism.gravity_forces(s.q)) <= 1e-10
    assert len(kept(own_cache)) == len(before) + 1


def test_code_that_flags_regular_states_is_refused(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(proof, "_MAY_FLAG", np.inf)
    right = functions._MAKERS["bias"]

    def flagged(x: Any) -> Any:
        given, results = right(x)
        return given, results | {"check": 0 * results["check"] + 3.0}

    monkeypatch.setitem(functions._MAKERS, "bias", flagged)
    with pytest.raises(CompileError, match="flags a regular state"):
        five_bar().compile(compiler=QUICK, functions="forces")
    assert kept(own_cache) == []


def test_a_result_of_another_shape_is_refused(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(generated, "is_matrix", lambda name: False)
    one = mechanisms.FOUR_BAR.spherical_mechanism(
        home=mechanisms.closed_guess(mechanisms.spherical())
    )
    with pytest.raises(CompileError, match=r"basis has shape \(3,\), not \(3, 1\)"):
        one.compile(compiler=QUICK, functions="kinematics")
    assert kept(own_cache) == []


def test_proofs_of_several_threads_take_turns(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of TinyCC's code of one group, and of GCC's of another in the background."""
    if not tcc.is_here() or not list(compilers.find("auto")):
        pytest.skip("there are not two compilers")
    right, at_work, most = proof.Proof.compare, [0], [0]

    def slow(self: proof.Proof, *given: Any) -> float:
        at_work[0] += 1
        most[0] = int(np.maximum(most[0], at_work[0]))
        time.sleep(0.15)
        result = right(self, *given)
        at_work[0] -= 1
        return result

    monkeypatch.setattr(proof.Proof, "compare", slow)
    fast = five_bar().compile(functions=["dynamics"])
    fast.code.build("kinematics", "forces", "closing")
    fast.wait()
    assert "tcc" not in fast.compilers.values()
    assert most == [1]


# The cache ----------------------------------------------------------------------------------------

ON_DISK = "gcc" if list(compilers.find("gcc")) else "clang"


def test_what_is_kept_serves_again_without_expressions(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    exact = five_bar()
    first = exact.compile(compiler=ON_DISK, functions="kinematics")
    s = next(states(exact))
    wanted = first.motion_basis(s.q)

    def no_expressions(*given: Any) -> Any:
        raise AssertionError("expressions were made")

    monkeypatch.setattr(generated, "MechanismExpressions", no_expressions)
    monkeypatch.setattr(generated, "choose", no_expressions)
    again = five_bar().compile(compiler=ON_DISK, functions="kinematics")
    np.testing.assert_array_equal(again.motion_basis(s.q), wanted)
    np.testing.assert_array_equal(
        again.code.partition.independent, first.code.partition.independent
    )


@pytest.mark.parametrize("damage", ["library", "record", "half", "gone"])
def test_a_damaged_cache_is_built_anew(own_cache: Path, damage: str) -> None:
    """Loaded code goes on; the next object builds what is missing."""
    exact = five_bar()
    fast = exact.compile(compiler=ON_DISK, functions="kinematics")
    s = next(states(exact))
    wanted = fast.motion_basis(s.q)
    for entry in own_cache.glob("*"):
        if not entry.is_dir():
            continue
        files = sorted(entry.iterdir())
        if damage == "gone":
            shutil.rmtree(entry)
        for file in files if damage != "gone" else []:
            whole = file.read_bytes()
            if (damage == "record") == (file.suffix == ".json") and damage != "half":
                file.unlink()
                file.write_bytes(whole[: len(whole) // 2] + b"\0" * 9)
            elif damage == "half" and file.suffix != ".json":
                file.unlink()
                file.write_bytes(whole[: len(whole) // 2])
    np.testing.assert_array_equal(fast.motion_basis(s.q), wanted)
    again = five_bar().compile(compiler=ON_DISK, functions="kinematics")
    np.testing.assert_array_equal(again.motion_basis(s.q), wanted)


TWO = """
import sys
import numpy as np
from tests.codegen.test_compiling import five_bar
fast = five_bar().compile(compiler=sys.argv[1], functions=["kinematics"])
print(fast.motion_basis(fast.mechanism.home).sum())
"""


def test_two_processes_at_once(own_cache: Path) -> None:
    """Both get the same; one builds, and nothing half-built is left."""
    command = [sys.executable, "-c", TWO, ON_DISK]
    started = [processes.start(command) for _ in range(2)]
    said = [one.communicate(timeout=120) for one in started]
    assert [one.returncode for one in started] == [0, 0], said
    assert said[0][0] == said[1][0]
    assert not [name for name in kept(own_cache) if ".part-" in name]
    keys = [name.partition("-")[0] for name in kept(own_cache)]
    assert len(keys) == len(set(keys))
