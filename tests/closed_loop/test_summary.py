"""`print` and `repr` of a mechanism say what it is, at any state of it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, JointCoupling, LoopClosure
from rps_pin.codegen.build import tcc
from tests.closed_loop.mechanisms import FOUR_BAR
from tests.closed_loop.test_without_actuators import PASSIVE, passive_four_bar


def test_a_four_bar() -> None:
    mechanism = FOUR_BAR.mechanism()
    text = str(mechanism)
    first, *lines = text.splitlines()
    assert first == f"{mechanism.name}: mobility 1, actuation sufficient: 1 actuator"
    assert lines[0].startswith("4 joints (nq 4, nv 4): ")
    for name in list(mechanism.model.names)[1:]:
        assert name in lines[0]
    closure = mechanism.closures[0]
    assert f"1 closure (6 rows): {closure.name} (rigid)" in text
    assert lines[-1] == "actuated: crank_joint"
    assert repr([mechanism]) == (
        f"[<ClosedLoopModel {mechanism.name!r}: 4 joints (nq 4, nv 4), 1 closure (6 rows), "
        "1 actuated>]"
    )


def test_repr_computes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    mechanism = FOUR_BAR.mechanism()
    for name in ("describe", "home", "close"):
        monkeypatch.delattr(ClosedLoopModel, name)
    assert "4 joints" in repr(mechanism)


def test_without_closures_actuators_or_name() -> None:
    model = ClosedLoopModel.from_mjcf(PASSIVE).model.copy()
    model.name = ""
    text = str(ClosedLoopModel(model, [], []))
    assert text.splitlines() == [
        "mechanism: mobility 1, actuation underactuated: nothing driven",
        "1 joint (nq 1, nv 1): hinge",
        "0 closures",
        "actuated: nothing",
    ]
    assert "nothing driven" in str(passive_four_bar())


def test_loops_that_do_not_close_are_told_and_not_raised() -> None:
    model = FOUR_BAR.mechanism().model
    far = LoopClosure(
        list(model.names)[1],
        "universe",
        "rigid",
        "far",
        placement_b=pin.SE3(np.eye(3), np.array([50.0, 0.0, 0.0])),
    )
    twice = [JointCoupling("crank_joint", {}, offset=x, name=f"held at {x}") for x in (0.1, 0.2)]
    for closures in ([far], twice):
        mechanism = ClosedLoopModel(model, closures, ["crank_joint"])
        assert "4 joints" in repr(mechanism)
        first, *lines = str(mechanism).splitlines()
        assert "mobility not known: " in first
        assert "open" in first
        assert lines[-1] == "actuated: crank_joint"


def test_generated_code_tells_what_compiled_it() -> None:
    mechanism = passive_four_bar()
    fast = mechanism.compile(compiler="tcc" if tcc.is_here() else "auto", functions=["dynamics"])
    assert repr(fast) == repr(mechanism).replace("ClosedLoopModel", "CompiledMechanism")
    assert str(fast).startswith(str(mechanism) + "\ncompiled: dynamics by ")
