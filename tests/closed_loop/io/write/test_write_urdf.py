"""URDFs with descriptions: what is read back is what was written, at random states."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from ruamel.yaml import YAML

from rps_pin import (
    ClosedLoopModel,
    InputError,
    JointCoupling,
    JointEffects,
    LoopClosure,
    MechanismError,
)
from rps_pin.closed_loop.io.mechanism_file import parts_from_yaml
from rps_pin.closed_loop.io.mechanism_schema import Description
from rps_pin.closed_loop.io.write.numbers import number
from tests.closed_loop.mechanisms import ALL
from tests.closed_loop.random_mechanisms import case, random_inertia, random_tree
from tests.worst import worst

Array = NDArray[np.float64]
URDF = Path(__file__).resolve().parents[4] / "urdf"
PACKAGE = sorted(path.stem for path in URDF.glob("*.yaml"))
JOINTS = ["revolute"] * 3 + [
    *("prismatic", "helical", "ball", "free", "turn", "planar", "translation", "universal", "zyx")
]
EFFECTS = ("damping", "friction", "stiffness", "rest")


def order(before: pin.Model, after: pin.Model) -> Array:
    """Where the entries of v of the tree that was read stand in those that were written."""
    of_v: list[int] = []
    for joint in list(after.joints)[1:]:
        old, skip = written_as(before, after, joint.id)
        of_v += [old.idx_v + skip + i for i in range(joint.nv)]
    assert sorted(of_v) == list(range(before.nv))
    return np.array(of_v)


def as_read(before: pin.Model, after: pin.Model, q: Array) -> Array:
    """A configuration of the tree that was written, in that which was read."""
    parts = []
    for joint in list(after.joints)[1:]:
        old, skip = written_as(before, after, joint.id)
        if (old.nq, old.nv, joint.nq) == (2, 1, 1):  # a turn without bounds is read as an angle
            parts.append([np.arctan2(q[old.idx_q + 1], q[old.idx_q])])
        else:
            parts.append(q[old.idx_q + skip : old.idx_q + skip + joint.nq])
    return np.concatenate(parts)


def written_as(before: pin.Model, after: pin.Model, joint: int) -> tuple[object, int]:
    """The joint that was written, and how many single joints of its row come before this."""
    name, _, part = after.names[joint].partition(":")
    row = [n for n in after.names if n.partition(":")[0] == name]
    return before.joints[before.getJointId(name)], int(part) - 1 if part else len(row) - 1


def assert_same(mechanism: ClosedLoopModel, back: ClosedLoopModel) -> None:
    """Forces, gaps and rows are those of the mechanism, to rounding, anywhere."""
    model = mechanism.model
    of_v = order(model, back.model)
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(3):
        q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
        v, a = rng.normal(size=(2, model.nv))
        there = as_read(model, back.model, q)
        force = mechanism.generalised_force(q, v, a)
        scale = 1 + np.abs(force).max()
        errors.append((force[of_v] - back.generalised_force(there, v[of_v], a[of_v])) / scale)
        gaps, rows = mechanism.loop_errors(q).position, mechanism.jacobian(q)[:, of_v]
        back_gaps, back_rows = back.loop_errors(there).position, back.jacobian(there)
        for name in (closure.name for closure in mechanism.closures):
            one, other = mechanism.rows(name), back.rows(name)
            errors += [gaps[one] - back_gaps[other], rows[one] - back_rows[other]]
    assert worst(*errors) < 1e-13
    assert worst(as_read(model, back.model, mechanism.home) - back.home) < 1e-12
    assert back.name == mechanism.name
    driven = order_of(mechanism, of_v)
    assert np.array_equal(driven, back.actuated_indices)
    for what in EFFECTS:
        one, other = mechanism.effects, back.effects
        given = getattr(one, what) if one is not None else np.zeros(model.nv)
        if what == "rest" and one is not None:
            given = np.where(one.stiffness > 0, given, 0)
        read = getattr(other, what) if other is not None else np.zeros(model.nv)
        assert np.array_equal(given[of_v], read), what
    assert np.array_equal(model.armature[of_v], back.model.armature)
    assert mechanism.characteristic_length == pytest.approx(back.characteristic_length, rel=1e-15)


def order_of(mechanism: ClosedLoopModel, of_v: Array) -> Array:
    """The indices of the actuated velocities in the tree that was read."""
    where = {int(old): new for new, old in enumerate(of_v)}
    return np.array([where[int(index)] for index in mechanism.actuated_indices])


@pytest.mark.parametrize("name", PACKAGE)
def test_mechanisms_of_the_package_come_back(name: str, tmp_path: Path) -> None:
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    written = mechanism.to_urdf(tmp_path / "written.urdf")
    assert written == tmp_path / "written.yaml"
    back = ClosedLoopModel.load(written)
    assert_same(mechanism, back)
    for limit in ("lowerPositionLimit", "upperPositionLimit", "upperEffortLimit"):
        plain = np.abs(getattr(mechanism.model, limit)) < 1e300
        assert np.array_equal(
            getattr(mechanism.model, limit)[plain], getattr(back.model, limit)[plain]
        )
    frames = {frame.name for frame in mechanism.model.frames}
    assert frames <= {frame.name for frame in back.model.frames}
    names = [frame.name for frame in back.model.frames]
    again = ClosedLoopModel.load(back.to_urdf(tmp_path / "again.urdf"))
    assert [frame.name for frame in again.model.frames] == names  # nothing is added each time


@pytest.mark.parametrize("make", ALL)
def test_mechanisms_of_the_tests_come_back(make: object, tmp_path: Path) -> None:
    mechanism = make()  # type: ignore[operator]
    assert_same(mechanism, ClosedLoopModel.load(mechanism.to_urdf(tmp_path / "m.urdf")))


@pytest.mark.parametrize("seed", range(12))
def test_random_mechanisms_come_back(seed: int, tmp_path: Path) -> None:
    """Of all joints that URDF can say, with effects and rotors, and all closures."""
    mechanism = case(seed, effects=True, armature=True, joints=JOINTS).mechanism
    assert_same(mechanism, ClosedLoopModel.load(mechanism.to_urdf(tmp_path / "m.urdf")))


def alone(joint: object, name: str = "joint") -> pin.Model:
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Random(), name)
    model.appendBodyToJoint(1, random_inertia(np.random.default_rng(2)), pin.SE3.Identity())
    return model


def test_a_row_of_joints_is_written_as_a_row(tmp_path: Path) -> None:
    composite = pin.JointModelComposite()
    composite.addJoint(pin.JointModelPX(), pin.SE3.Random())
    composite.addJoint(pin.JointModelSphericalZYX(), pin.SE3.Random())
    composite.addJoint(pin.JointModelRY(), pin.SE3.Random())
    model = alone(composite)
    mechanism = ClosedLoopModel(model, [], ["joint"])
    back = ClosedLoopModel.load(mechanism.to_urdf(tmp_path / "m.urdf"))
    parts = ["joint:1", "joint:2", "joint:3", "joint:4", "joint"]
    assert list(back.model.names)[1:] == parts
    assert back.actuated == tuple(parts)
    v, a = np.random.default_rng(0).normal(size=(2, 5))
    q = pin.integrate(model, pin.neutral(model), v)
    assert worst(mechanism.generalised_force(q, v, a) - back.generalised_force(q, v, a)) < 1e-12


def test_one_coordinate_that_is_driven_comes_back(tmp_path: Path) -> None:
    """Of a row it is a joint of its own name; of a ball and a universal joint the same name."""
    composite = pin.JointModelComposite()
    composite.addJoint(pin.JointModelPX(), pin.SE3.Random())
    composite.addJoint(pin.JointModelSpherical(), pin.SE3.Random())
    model = alone(composite)
    kinds = (
        pin.JointModelSpherical(),
        pin.JointModelUniversal(np.eye(3)[0], np.eye(3)[2]),
        pin.JointModelTranslation(),
    )
    for index, kind in enumerate(kinds, 1):
        model.addJoint(index, kind, pin.SE3.Random(), "buc"[index - 1])
        model.appendBodyToJoint(
            index + 1, random_inertia(np.random.default_rng(2)), pin.SE3.Identity()
        )
    mechanism = ClosedLoopModel(model, [], ["joint.2", "b.z", "u.0", "c.y"])
    back = ClosedLoopModel.load(mechanism.to_urdf(tmp_path / "m.urdf"))
    assert back.actuated == ("joint.y", "b.z", "u.0", "c:2")
    assert np.array_equal(back.actuated_indices, mechanism.actuated_indices)


def test_efforts_that_differ_by_sign_are_told(tmp_path: Path) -> None:
    model = alone(pin.JointModelRX())
    model.lowerEffortLimit[:], model.upperEffortLimit[:] = -5.0, 7.0
    with pytest.warns(UserWarning, match="'joint': effort of -5 to 7 is written as 5 either way"):
        ClosedLoopModel(model, [], ["joint"]).to_urdf(tmp_path / "m.urdf")


def test_a_joint_that_urdf_has_not_is_named(tmp_path: Path) -> None:
    mechanism = ClosedLoopModel(alone(pin.JointModelEllipsoid(0.1, 0.2, 0.3)), [], ["joint"])
    with pytest.raises(MechanismError, match=r"'joint' \(Ellipsoid\) cannot be written"):
        mechanism.to_urdf(tmp_path / "m.urdf")
    assert not list(tmp_path.iterdir())


INF = np.inf
RANGES = [(-INF, INF), (-INF, 2.0), (-1.5, INF), (-1.0, 2.5), (0.0, 0.0), (0.5, 0.5)]


@pytest.mark.parametrize("limits", RANGES)
@pytest.mark.parametrize("joint", [pin.JointModelRX(), pin.JointModelPZ(), pin.JointModelHY(0.2)])
@pytest.mark.parametrize("effort", [INF, 3.0, 0.0])
def test_limits_come_back(
    limits: tuple[float, float], joint: object, effort: float, tmp_path: Path
) -> None:
    model = alone(joint)
    model.lowerPositionLimit[:], model.upperPositionLimit[:] = limits
    model.lowerEffortLimit[:], model.upperEffortLimit[:] = -effort, effort
    model.upperVelocityLimit[:] = 2 * effort
    mechanism = ClosedLoopModel(model, [], ["joint"])
    back = ClosedLoopModel.load(mechanism.to_urdf(tmp_path / "m.urdf")).model
    found = float(back.lowerPositionLimit[0]), float(back.upperPositionLimit[0])
    assert found == pytest.approx(limits, abs=1e-300)
    assert float(back.upperEffortLimit[0]) == pytest.approx(effort, abs=1e-300)
    assert float(back.upperVelocityLimit[0]) == pytest.approx(2 * effort, abs=1e-300)


def test_closures_at_offsets_and_couplings_of_several_joints_come_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    model = random_tree(rng, ["revolute"], planar=False)
    names = list(model.names)[1:]
    closures = [
        LoopClosure("body_0", "body_3", "point_on_plane", placement_a=pin.SE3.Random()),
        LoopClosure("body_1", "universe", "distance", distance=0.7, placement_b=pin.SE3.Random()),
        JointCoupling(names[0], {names[1]: 0.5, names[2]: -2.0}, offset=0.1),
        JointCoupling(names[1], names[3], polynomial=[0.1, 0.2, 0.3]),
    ]
    mechanism = ClosedLoopModel(model, closures, [])
    back = ClosedLoopModel(*parts_of(mechanism.to_urdf(tmp_path / "m.urdf")))
    for _ in range(3):
        q = rng.normal(size=model.nq)
        there = as_read(model, back.model, q)
        for name in (closure.name for closure in closures):
            one = mechanism.loop_errors(q).position[mechanism.rows(name)]
            other = back.loop_errors(there).position[back.rows(name)]
            assert worst(one - other) < 1e-14


def parts_of(description: Path) -> tuple[pin.Model, Sequence[object], Sequence[str]]:
    """Tree, closures and actuators of a description whose loops need not close."""
    parts = parts_from_yaml(description)
    return parts.model, parts.closures, parts.actuated


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    mechanism = ClosedLoopModel.load(URDF / "four_bar.yaml")
    with pytest.raises(InputError, match=r"must end in \.urdf"):
        mechanism.to_urdf(tmp_path / "m.yaml")


def test_an_inertia_that_would_not_be_read_is_not_written(tmp_path: Path) -> None:
    model = alone(pin.JointModelRX())
    model.inertias[1] = pin.Inertia(1.0, np.zeros(3), np.diag([1.0, 1.0, 10.0]))
    with pytest.raises(MechanismError, match="link 'joint_link' cannot be written: its principal"):
        ClosedLoopModel(model, [], ["joint"]).to_urdf(tmp_path / "m.urdf")
    assert not list(tmp_path.iterdir())


def test_names_that_yaml_or_xml_could_misread_come_back(tmp_path: Path) -> None:
    names = ["yes", "1e5", 'a "b": {c}', "<d> & 'e'", "null"]
    model = pin.Model()
    model.name = "no"
    for index, name in enumerate(names):
        model.addJoint(index, pin.JointModelRX(), pin.SE3.Random(), name)
        model.appendBodyToJoint(
            index + 1, random_inertia(np.random.default_rng(2)), pin.SE3.Identity()
        )
    mechanism = ClosedLoopModel(model, [], names, name="no")
    back = ClosedLoopModel.load(mechanism.to_urdf(tmp_path / "m.urdf"))
    assert list(back.model.names)[1:] == names
    assert back.actuated == tuple(names)
    assert back.name == "no"


@pytest.mark.parametrize("name", ["a\x01b", "", "a" * 2000])
@pytest.mark.parametrize("write", ["to_urdf", "to_mjcf"])
def test_names_that_no_file_can_hold_are_refused(name: str, write: str, tmp_path: Path) -> None:
    mechanism = ClosedLoopModel(alone(pin.JointModelRX(), name), [], [])
    with pytest.raises(MechanismError, match="cannot be written: a name in a file has 1 to 1000"):
        getattr(mechanism, write)(tmp_path / ("m.urdf" if write == "to_urdf" else "m.xml"))
    assert not list(tmp_path.iterdir())


def test_a_neutral_home_outside_the_limits_comes_back(tmp_path: Path) -> None:
    model = alone(pin.JointModelRX())
    model.lowerPositionLimit[:], model.upperPositionLimit[:] = 0.5, 1.0
    mechanism = ClosedLoopModel(model, [], ["joint"])
    back = ClosedLoopModel.load(mechanism.to_urdf(tmp_path / "m.urdf"))
    assert mechanism.home.tolist() == back.home.tolist() == [0]


def test_frames_keep_their_places_and_the_links_they_hang_on(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    model = random_tree(rng, ["revolute", "prismatic"], planar=False)
    mechanism = ClosedLoopModel(model, [], [model.names[1]])
    back = ClosedLoopModel.load(mechanism.to_urdf(tmp_path / "m.urdf")).model
    for frame in list(model.frames)[1:]:
        found = back.frames[back.getFrameId(frame.name)]
        assert back.names[found.parentJoint] == model.names[frame.parentJoint]
        assert worst(found.placement.homogeneous - frame.placement.homogeneous) < 1e-14


def test_effects_of_each_velocity_of_a_joint_come_back(tmp_path: Path) -> None:
    model = alone(pin.JointModelSpherical())
    effects = JointEffects.named(model, damping={"joint": [1, 2, 3.5]}, friction={"joint": 0.25})
    mechanism = ClosedLoopModel(model, [], ["joint"], effects=effects)
    back = ClosedLoopModel.load(mechanism.to_urdf(tmp_path / "m.urdf"))
    assert back.effects is not None
    assert back.effects.damping.tolist() == [1, 2, 3.5]
    assert back.effects.friction.tolist() == [0.25] * 3


@pytest.mark.parametrize("kind", [pin.JointModelSpherical(), pin.JointModelFreeFlyer()])
def test_springs_of_balls_and_free_joints_come_back(kind: pin.JointModel, tmp_path: Path) -> None:
    model = alone(kind)
    stiffness = [4.0] * 3 if model.nv == 3 else [7.0] * 3 + [4.0] * 3
    rest = np.linspace(-0.5, 0.6, model.nv)
    effects = JointEffects.named(model, stiffness={"joint": stiffness}, rest={"joint": rest})
    mechanism = ClosedLoopModel(model, [], ["joint"], effects=effects)
    back = ClosedLoopModel.load(mechanism.to_urdf(tmp_path / "m.urdf"))
    assert back.effects is not None
    assert back.effects.stiffness.tolist() == stiffness
    assert back.effects.rest.tolist() == rest.tolist()
    q = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
    forces = [one.generalised_force(q, 0 * rest, 0 * rest) for one in (mechanism, back)]
    assert worst(forces[0] - forces[1]) < 1e-12


def test_shapes_are_carried_over(tmp_path: Path) -> None:
    from rps_pin.closed_loop.visuals import visual_model

    file = URDF / "stewart.yaml"
    mechanism = ClosedLoopModel.load(file)
    shapes = visual_model(file, mechanism.model)
    assert shapes is not None
    written = mechanism.to_urdf(tmp_path / "m.urdf", shapes=shapes)
    back = ClosedLoopModel.load(written)
    again = visual_model(written, back.model)
    assert again is not None
    assert len(again.geometryObjects) == len(shapes.geometryObjects) > 0

    def placed(one: pin.GeometryModel, model: pin.Model) -> dict[tuple[str, str], list[Array]]:
        found: dict[tuple[str, str], list[Array]] = {}
        for shape in one.geometryObjects:
            key = model.names[shape.parentJoint], type(shape.geometry).__name__
            entry = np.concatenate([shape.placement.homogeneous.ravel(), shape.meshColor])
            found.setdefault(key, []).append(entry)
        return found

    before, after = placed(shapes, mechanism.model), placed(again, back.model)
    assert before.keys() == after.keys()
    assert worst(*(np.array(before[key]) - np.array(after[key]) for key in before)) < 1e-9


def test_a_home_that_does_not_close_is_not_written(tmp_path: Path) -> None:
    model = alone(pin.JointModelRX())
    frame = pin.Frame("far", 0, 0, pin.SE3(np.eye(3), np.full(3, 9.0)), pin.FrameType.OP_FRAME)
    model.addFrame(frame)
    tip = pin.Frame("tip", 1, 0, pin.SE3(np.eye(3), np.ones(3)), pin.FrameType.OP_FRAME)
    model.addFrame(tip)
    mechanism = ClosedLoopModel(model, [LoopClosure("tip", "far")], ["joint"])
    text = mechanism.to_urdf(tmp_path / "m.urdf").read_text()
    assert "home" not in text
    assert "frame_b: far" in text


def test_every_key_of_a_description_is_written_or_known_not_to_be() -> None:
    """A key that is added to descriptions has to be written too: add it to the writer, and here."""
    # The tree is in the URDF: its free-flyer, the limits that count, and the joints replaced.
    elsewhere = {"mjcf", "root", "within_limits", "joint_types"}
    written = {
        *("name", "urdf", "gravity", "closures", "couplings", "actuated", "home", "merge"),
        *("damping", "friction", "stiffness", "rest", "armature", "friction_speed"),
        *("characteristic_length", "max_condition", "accuracy", "task", "interference"),
    }
    assert set(Description.model_fields) == written | elsewhere


# Numbers ------------------------------------------------------------------------------------------


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_come_back_exactly(value: float) -> None:
    text = number(value)
    assert float(text) == value
    assert YAML(typ="safe", pure=True).load(text) == value
