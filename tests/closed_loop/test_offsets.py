"""Closures at frames plus an offset: the closures of frames that stand there."""

from __future__ import annotations

import dataclasses
import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, InputError, LoopClosure, MechanismError
from rps_pin.closed_loop.constraints.closures import KINDS
from tests.closed_loop.mechanisms import joint, link, robot
from tests.closed_loop.random_mechanisms import Case, case, random_placement
from tests.closed_loop.test_derivatives import check_forward, check_inverse
from tests.codegen.engines import ALL, check
from tests.codegen.test_compiled_random import compiled, motions
from tests.quick import quick
from tests.worst import worst

Array = NDArray[np.float64]


def seen_from_elsewhere(c: Case) -> Case:
    """The same mechanism, its closures at offsets in other frames of their bodies."""
    rng, mechanism = np.random.default_rng(5), c.mechanism
    model, closures = mechanism.model.copy(), []
    for closure in mechanism.closures:
        if not isinstance(closure, LoopClosure):
            closures.append(closure)
            continue
        names, offsets = [], []
        for index in closure.frame_ids(model):
            closed, stand = model.frames[index], random_placement(rng)
            name = f"seat {model.nframes}"
            kind = pin.FrameType.OP_FRAME
            model.addFrame(pin.Frame(name, closed.parentJoint, 0, stand, kind))
            names.append(name)
            offsets.append(stand.actInv(closed.placement))
        closures.append(
            dataclasses.replace(
                closure,
                frame_a=names[0],
                frame_b=names[1],
                placement_a=offsets[0],
                placement_b=offsets[1].homogeneous,
            )
        )
    other = ClosedLoopModel(
        model, closures, mechanism.actuated, home=c.q, effects=mechanism.effects
    )
    return c._replace(mechanism=other)


def distances(one: ClosedLoopModel, other: ClosedLoopModel, c: Case) -> list[Array]:
    """Differences of kinematics and dynamics, at closed and open configurations."""
    rng, found = np.random.default_rng(1), []
    for size in (0.0, 0.3):
        q = pin.integrate(one.model, c.q, size * rng.normal(size=one.model.nv))
        pairs = [
            (m.loop_errors(q, c.v, c.a), m.jacobian(q), m.system.equations.bias(q, c.v))
            for m in (one, other)
        ]
        (errors, *rest), (wanted, *others) = pairs
        found += [a - b for a, b in zip((*errors, *rest), (*wanted, *others), strict=True)]
    ours, theirs = (m.inverse_dynamics(c.q, c.v, c.a, wrenches=c.wrenches) for m in (one, other))
    found += [ours.tau - theirs.tau, ours.constraint_forces - theirs.constraint_forces]
    forces = theirs.constraint_forces
    wrenches = [m.closure_wrenches(c.q, forces) for m in (one, other)]
    found += [wrenches[0][name] - wrenches[1][name] for name in wrenches[0]]
    carried = [m.joint_wrenches(c.q, c.v, c.a, forces, wrenches=c.wrenches) for m in (one, other)]
    return [*found, *(carried[0][name] - carried[1][name] for name in carried[0])]


@pytest.mark.parametrize("kind", KINDS)
def test_an_offset_is_a_frame_that_stands_there(kind: str) -> None:
    for seed in range(2):
        c = case(seed, kinds=[kind])
        size = 1 + max(np.abs(c.a).max(), np.abs(c.v).max() ** 2)
        other = seen_from_elsewhere(c)
        length = c.mechanism.characteristic_length
        assert other.mechanism.characteristic_length == pytest.approx(length, rel=1e-12)
        assert worst(*distances(other.mechanism, c.mechanism, c)) < 1e-9 * size


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_at_offsets_are_those_of_central_differences(kind: str) -> None:
    c = seen_from_elsewhere(case(0, kinds=[kind]))
    check_inverse(c)
    check_forward(c)


@pytest.mark.parametrize("kind", quick(["spherical", "rigid", "universal"], ["universal"]))
def test_generated_code_takes_offsets(kind: str) -> None:
    c = seen_from_elsewhere(case(1, kinds=[kind]))
    groups = tuple(g for g in ALL if g != "derivatives" or kind == "rigid")
    assert check(compiled(c), motions(c), groups) > 20


# A closed form ------------------------------------------------------------------------------------

PENDULUM = robot(
    link("arm", 2.0, "0.3 0 0", 0.05),
    link("cart", 1.0, "0 0 0", 0.1),
    joint("revolute", "base", "arm", axis="0 1 0"),
    joint("prismatic", "base", "cart", axis="1 0 0"),
)


@pytest.mark.parametrize("reach", [0.4, 0.7])
def test_a_slotted_link_of_offsets_moves_as_its_formula_says(reach: float) -> None:
    """A pin at (reach, 0, 0.1) of the arm lies in a slot across the cart, 0.2 in front of it."""
    slot = LoopClosure(
        "cart",
        "arm",
        "point_on_plane",
        axis=[1, 0, 0],
        placement_a=pin.SE3(np.eye(3), np.array([0.2, 0.0, 0.0])),
        placement_b=pin.SE3(np.eye(3), np.array([reach, 0.0, 0.1])),
    )
    mechanism = ClosedLoopModel.from_urdf(PENDULUM, [slot], ["arm_joint"])
    for angle in (0.0, 0.6, -1.1):
        q = mechanism.complete([angle])
        x = reach * np.cos(angle) + 0.1 * np.sin(angle)
        slope = -reach * np.sin(angle) + 0.1 * np.cos(angle)
        assert worst(q - [angle, x - 0.2]) < 1e-9
        assert worst(mechanism.velocity(q, [2.0]) - [2.0, 2.0 * slope]) < 1e-9
        assert worst(mechanism.acceleration(q, [2.0, 2 * slope], [0.0])[1] + 4 * x) < 1e-8


# Descriptions -------------------------------------------------------------------------------------


def test_an_offset_is_kept_exactly_and_is_a_value() -> None:
    at = pin.SE3(pin.exp3(np.array([0.1, 0.2, -0.3])), np.array([1 / 3, 0.2, 0.1]))
    one = LoopClosure("a", "b", "rigid", placement_a=at)
    assert np.array_equal(one.placement_a, at.homogeneous)
    assert one.placement_b is None
    assert worst(one.offsets()[0].homogeneous - at.homogeneous) == 0
    assert one == LoopClosure("a", "b", "rigid", placement_a=at.homogeneous.tolist())
    assert hash(one) == hash(dataclasses.replace(one))
    assert one != LoopClosure("a", "b", "rigid")
    assert pickle.loads(pickle.dumps(one)) == one
    assert LoopClosure("a", "b", placement_a=np.eye(4)) == LoopClosure("a", "b")


def test_rounded_rotations_are_made_rotations() -> None:
    turn = np.round(pin.exp3(np.array([0.4, -0.2, 0.7])), 5)
    closure = LoopClosure("a", "b", placement_b=pin.SE3(turn, np.ones(3)).homogeneous)
    found = closure.offsets()[1].rotation
    assert worst(found @ found.T - np.eye(3)) < 4e-15  # a singular value decomposition rounds
    assert worst(found - turn) < 1e-5


TURNED = np.diag([1.0, 1.0, -1.0, 1.0])
BAD = [np.eye(3), [1, 2, 3], "here", 2 * np.eye(4), TURNED, np.full((4, 4), np.nan), [[1], [2, 3]]]
BAD += [np.eye(4) * (1 + 1e-6j), np.eye(4).astype(bool), np.eye(4).astype(str)]


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("option", ["placement_a", "placement_b"])
def test_what_is_no_placement_is_refused(option: str, bad: object) -> None:
    with pytest.raises(MechanismError, match=f"closure 'a = b': {option}.* placement|pin.SE3"):
        LoopClosure("a", "b", **{option: bad})


def test_files_have_offsets_as_urdfs_write_origins(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(PENDULUM)
    text = """\
urdf: robot.urdf
closures:
  - frame_a: cart
    frame_b: arm
    kind: rigid
    placement_a: {xyz: [0.2, 0, 0], rpy: [0.1, 0.2, 0.3]}
    placement_b: {rpy: [0, 0, 1.5]}
"""
    (tmp_path / "m.yaml").write_text(text + "actuated: [arm_joint]\n")
    from rps_pin.closed_loop.io.mechanism_file import parts_from_yaml

    (closure,) = parts_from_yaml(tmp_path / "m.yaml").closures
    R = [pin.utils.rotate(axis, angle) for axis, angle in (("z", 0.3), ("y", 0.2), ("x", 0.1))]
    a, b = closure.offsets()
    assert worst(a.rotation - R[0] @ R[1] @ R[2], a.translation - [0.2, 0, 0]) < 1e-15
    assert worst(b.rotation - pin.utils.rotate("z", 1.5), b.translation) < 1e-15
    (tmp_path / "bad.yaml").write_text(text.replace("xyz: [0.2, 0, 0]", "xyz: [0.2, 0]"))
    with pytest.raises(InputError, match=r"line 6: closures\[0\].placement_a.xyz"):
        parts_from_yaml(tmp_path / "bad.yaml")


def test_descriptions_tell_offsets() -> None:
    moved = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.25]))
    closure = LoopClosure("universe", "arm", "point_on_plane", placement_b=moved)
    mechanism = ClosedLoopModel.from_urdf(PENDULUM, [closure], ["cart_joint"], home=[0.5, 0.0])
    found = mechanism.describe()
    assert found.closures[0].between == ("universe", "arm")
    assert worst(np.subtract(found.closures[0].offsets[1], [0.5, 0, 0.25, 0, 0, 0])) < 1e-15
    assert found.closures[0].offsets[0] is None
    assert "universe = arm + (0.5, 0, 0.25) m" in str(found)
    assert found.as_dict()["closures"][0]["offsets"][1][:3] == [0.5, 0.0, 0.25]
