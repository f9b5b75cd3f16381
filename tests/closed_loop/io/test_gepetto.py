"""Descriptions of Gepetto's kind: self-made folders, against the same mechanism built in code."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, InputError, LoopClosure, MechanismError
from tests.closed_loop.mechanisms import joint, link, robot
from tests.worst import worst


def bar(name: str) -> str:
    return link(name, 0.7, "0.1 0.01 0.02", 0.003)


def hinge(parent: str, child: str, xyz: str = "0 0 0", axis: str = "0 1 0", name: str = "") -> str:
    """A revolute joint as that repository's exporter writes it: without lower and upper."""
    text = joint("revolute", parent, child, xyz, axis, name)
    return text.replace('lower="-9" upper="9" ', "")


FOUR_BAR = robot(
    *(bar(name) for name in ("crank", "coupler", "rocker")),
    *(link(name) for name in ("loop_A", "loop_B")),
    hinge("base", "crank", name="motor"),
    hinge("crank", "coupler", "0.2 0 0", name="elbow"),
    hinge("base", "rocker", "0.4 0 0", name="pivot"),
    joint("fixed", "coupler", "loop_A", "0.4 0 0"),
    joint("fixed", "rocker", "loop_B", "0.3 0 0"),
)
PLAIN = """closed_loop: [['loop_A', 'loop_B']]
type: ['3D']
name_mot: ['motor']
"""


def folder(tmp_path: Path, yaml: str, urdf: str = FOUR_BAR, name: str = "robot") -> Path:
    made = tmp_path / "four_bar_like"
    made.mkdir(exist_ok=True)
    (made / f"{name}.urdf").write_text(urdf)
    (made / "robot.yaml").write_text(yaml)
    return made


def assert_same(one: ClosedLoopModel, other: ClosedLoopModel) -> None:
    """The same tree, driven and closed alike."""
    assert list(one.model.names) == list(other.model.names)
    assert one.actuated == other.actuated
    rng = np.random.default_rng(0)
    for _ in range(3):
        v, a = rng.normal(size=(2, one.model.nv))
        q = pin.integrate(one.model, pin.neutral(one.model), rng.normal(size=one.model.nv))
        assert worst(one.generalised_force(q, v, a) - other.generalised_force(q, v, a)) < 1e-12
        if one.closures:
            assert worst(one.jacobian(q) - other.jacobian(q)) < 1e-12


@pytest.mark.parametrize(("given", "kind"), [("3d", "spherical"), ("6d", "rigid")])
@pytest.mark.parametrize("written", [str.lower, str.upper])
def test_a_folder_is_a_mechanism(given: str, kind: str, written: object, tmp_path: Path) -> None:
    urdf = FOUR_BAR
    if kind == "rigid":  # whose knee turns
        tip = joint("fixed", "rocker", "loop_B", "0.3 0 0")
        urdf = urdf.replace(tip, hinge("rocker", "loop_B", "0.3 0 0", name="knee"))
    yaml = PLAIN.replace("3D", written(given))  # type: ignore[operator]
    made = folder(tmp_path, yaml, urdf)
    mechanism = ClosedLoopModel.load(made)
    assert mechanism.name == "four_bar_like"
    assert mechanism.loop_gap(mechanism.home) < 1e-12
    assert mechanism.describe().mobility == 1
    closure = LoopClosure("loop_A", "loop_B", kind)  # type: ignore[arg-type]
    assert mechanism.closures == (closure,)
    assert_same(mechanism, ClosedLoopModel.from_urdf(urdf, [closure], ["motor"]))
    for other in (made / "robot.yaml", str(made)):
        assert_same(mechanism, ClosedLoopModel.load(other))
    assert np.isinf(mechanism.model.upperPositionLimit).all()


def test_the_only_urdf_of_another_name_is_taken(tmp_path: Path) -> None:
    made = folder(tmp_path, PLAIN, name="four_bar_v2")
    assert ClosedLoopModel.load(made).describe().mobility == 1
    (made / "another.urdf").write_text(FOUR_BAR)
    with pytest.raises(InputError, match=r"there is: another\.urdf, four_bar_v2\.urdf"):
        ClosedLoopModel.load(made)


def test_the_root_can_float(tmp_path: Path) -> None:
    made = folder(tmp_path, PLAIN)
    floating = ClosedLoopModel.from_gepetto(made, root="free")
    assert floating.describe().mobility == 7
    assert list(floating.model.names)[1] == "root_joint"


def test_joints_of_other_types(tmp_path: Path) -> None:
    """A ball, a hook joint and a fixed one, against the tree with these joints in its URDF."""
    yaml = PLAIN + "joint_name: [pivot, elbow]\njoint_type: [UJOINT_YX, SPHERICAL]\n"
    mechanism = ClosedLoopModel.load(folder(tmp_path, yaml))
    assert list(mechanism.model.names)[1:] == ["motor", "elbow", "pivot"]
    kinds = [one.shortname() for one in list(mechanism.model.joints)[1:]]
    assert kinds == ["JointModelRY", "JointModelSpherical", "JointModelUniversal"]
    assert mechanism.describe().mobility == 3
    turned = FOUR_BAR.replace(
        hinge("base", "rocker", "0.4 0 0", name="pivot"),
        hinge("base", "cross", "0.4 0 0", name="pivot_Y")
        + link("cross")
        + hinge("cross", "rocker", axis="1 0 0", name="pivot_X"),
    )
    other = ClosedLoopModel.from_urdf(turned, [LoopClosure("loop_A", "loop_B")], ["motor"])
    rng = np.random.default_rng(1)
    q_elbow, rest = rng.normal(), rng.normal(size=3)
    about_y = [0.0, np.sin(q_elbow / 2), 0.0, np.cos(q_elbow / 2)]
    here = np.concatenate([rest[:1], about_y, rest[1:]])
    there = np.concatenate([rest[:1], [q_elbow], rest[1:]])
    v, a = rng.normal(size=(2, 4))
    wide = [np.insert(one, 1, 0.0) for one in (v, a)]
    wide = [np.insert(one, 3, 0.0) for one in wide]
    found = mechanism.generalised_force(here, *wide)
    assert worst(np.delete(found, [1, 3]) - other.generalised_force(there, v, a)) < 1e-12


def test_a_fixed_joint_stays_at_zero(tmp_path: Path) -> None:
    yaml = PLAIN.replace("[['loop_A', 'loop_B']]", "[]").replace("['3D']", "[]")
    mechanism = ClosedLoopModel.load(
        folder(tmp_path, yaml + "joint_name: [elbow]\njoint_type: [FIXED]\n")
    )
    rigid = FOUR_BAR.replace(
        hinge("crank", "coupler", "0.2 0 0", name="elbow"),
        joint("fixed", "crank", "coupler", "0.2 0 0", name="elbow"),
    )
    assert_same(mechanism, ClosedLoopModel.from_urdf(rigid, [], ["motor"]))


def test_motors_may_drive_an_axis_of_a_universal_joint(tmp_path: Path) -> None:
    """Named as there, ``pivot_Y``; a wrench about that axis is what the motor holds."""
    yaml = PLAIN + "joint_name: [pivot]\njoint_type: [UJOINT_XY]\n"
    mechanism = ClosedLoopModel.load(folder(tmp_path, yaml.replace("'motor'", "'pivot_Y'")))
    joint = mechanism.model.joints[mechanism.model.getJointId("pivot")]
    assert mechanism.actuated_indices.tolist() == [joint.idx_v + 1]
    with pytest.raises(MechanismError, match="line 3: name_mot: no joint 'pivot_Z'"):
        ClosedLoopModel.load(folder(tmp_path, yaml.replace("'motor'", "'pivot_Z'")))


def test_losses_of_replaced_joints_are_told(tmp_path: Path) -> None:
    lossy = hinge("base", "rocker", "0.4 0 0", name="pivot").replace(
        "</joint>", '<dynamics damping="0.5"/></joint>'
    )
    urdf = FOUR_BAR.replace(hinge("base", "rocker", "0.4 0 0", name="pivot"), lossy)
    plain = ClosedLoopModel.load(folder(tmp_path, PLAIN, urdf))
    assert plain.effects is not None and plain.effects.damping.max() == 0.5
    yaml = PLAIN + "joint_name: [pivot]\njoint_type: [SPHERICAL]\n"
    mechanism = ClosedLoopModel.load(folder(tmp_path, yaml, urdf))
    assert mechanism.effects is None
    assert any("joint_type replaces are left out: pivot" in note for note in mechanism.notes)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("'motor'", "'moter'", r"line 3: name_mot: no joint 'moter' \(did you mean motor\?\)"),
        (
            "'loop_B']",
            "'loop_C']",
            r"line 1: closed_loop: no frame 'loop_C' \(did you mean loop_B\?\)",
        ),
        ("'loop_B']", "'loop_B', 'base']", "line 1: a loop is closed at two frames, not 3"),
        ("'3D'", "'4D'", "line 2: no type '4D' of a closure; there are: 3d, 6d"),
        ("'3D'", "'3D', '3D'", "line 2: 2 entries of type stand beside 1 of closed_loop"),
        ("name_mot", "joint_name: [elbow]\nname_mot", "1 of joint_name; there is one for each"),
        (
            "name_mot",
            "joint_name: [elbow]\njoint_type: [UJOINT_XX]\nname_mot",
            "line 4: no type 'UJOINT_XX' of a joint; there are: SPHERICAL, FIXED, UJOINT_XY",
        ),
        (
            "name_mot",
            "joint_name: [elbo]\njoint_type: [FIXED]\nname_mot",
            r"line 3: joint_name: no joint 'elbo' \(did you mean elbow\?\)",
        ),
        ("type:", "tipe:", "unknown key 'tipe' .did you mean type"),
    ],
)
def test_mistakes_are_named_with_their_line(
    before: str, after: str, said: str, tmp_path: Path
) -> None:
    made = folder(tmp_path, PLAIN.replace(before, after, 1))
    with pytest.raises((InputError, MechanismError), match=said):
        ClosedLoopModel.load(made)


def test_a_folder_without_the_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"robot\.yaml"):
        ClosedLoopModel.load(tmp_path)


def test_its_shapes_are_those_of_the_urdf(tmp_path: Path) -> None:
    from rps_pin.closed_loop.visuals import visual_model

    box = '<visual><geometry><box size="0.1 0.2 0.3"/></geometry></visual></link>'
    urdf = FOUR_BAR.replace("</link>", box, 1)
    made = folder(tmp_path, PLAIN + "joint_name: [elbow]\njoint_type: [SPHERICAL]\n", urdf)
    mechanism = ClosedLoopModel.load(made)
    shapes = visual_model(made / "robot.yaml", mechanism.model)
    assert shapes is not None
    assert [mechanism.model.names[one.parentJoint] for one in shapes.geometryObjects] == ["motor"]
