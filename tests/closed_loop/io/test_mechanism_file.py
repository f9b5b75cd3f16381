"""Mechanism files: what they say is what the parts are; what is wrong is told with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, InputError, LoopClosure, MechanismError
from rps_pin.closed_loop.constraints.closures import JointCoupling
from rps_pin.closed_loop.io.mechanism_file import parts_from_yaml
from tests.closed_loop.mechanisms import FOUR_BAR, joint, link, robot
from tests.each import each

URDF = Path(__file__).parents[3] / "urdf"

FOUR_BAR_FILE = """\
name: bars
urdf: four_bar.urdf
gravity: [0, 1, -2]
closures:
  - {frame_a: knee, frame_b: rocker_tip, kind: rigid, name: pin}
  - frame_a: knee
    frame_b: rocker_tip
    kind: revolute
    axis: [0, 2, 0]
couplings:
  - {joint: rocker_joint, other: crank_joint, ratio: -2, offset: 0.5}
actuated: [crank_joint]
home: {crank_joint: 0.5, rocker_joint: 1}
damping: {crank_joint: 0.1, rocker_joint: 3}
friction: {crank_joint: 0.2}
stiffness: {coupler_joint: 3}
rest: {coupler_joint: -0.1}
armature: {crank_joint: 1.0e-3}
friction_speed: 0.02
characteristic_length: 0.1
max_condition: 1e6
"""

WRIST = robot(
    link("a"),
    link("b"),
    link("hand", 1.0, "0.1 0.2 0.3", 0.05),
    link("fork"),
    link("foot", 2.0, "0 0 0.3", 0.04),
    joint("revolute", "base", "a", "1 0 0", "1 0 0", "x"),
    joint("revolute", "a", "b", "0 0 0", "0 1 0", "y"),
    joint("revolute", "b", "hand", "0 0 0", "0 0 1", "z"),
    joint("revolute", "base", "fork", "0 1 0", "1 0 0", "u"),
    joint("revolute", "fork", "foot", "0 0 0", "0 1 0", "v"),
)

WRIST_FILE = """\
urdf: wrist.urdf
merge:
  - {joints: [x, y, z], into: spherical, name: ball}
  - {joints: [u, v], into: universal, name: cardan}
closures: [{frame_a: hand, frame_b: foot, kind: distance, distance: 0.5}]
actuated: [cardan]
"""

MJCF = """<mujoco model="bars"><worldbody>
  <body name="a"><joint name="ja" axis="0 1 0" damping="0.4" stiffness="2"/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><site name="tip" pos="1 0 0"/></body>
  <body name="b"><joint name="jb" axis="0 1 0" damping="0.7"/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><site name="top" pos="1 0 0"/></body>
</worldbody><equality><connect name="pin" site1="tip" site2="top"/></equality>
<actuator><motor joint="jb"/></actuator>
<keyframe><key name="home" qpos="0.3 0.4"/></keyframe></mujoco>"""


def written(folder: Path, text: str = FOUR_BAR_FILE) -> Path:
    """A mechanism file in a folder, and the robots' files that it may name."""
    (folder / "four_bar.urdf").write_text(FOUR_BAR.urdf())
    (folder / "wrist.urdf").write_text(WRIST)
    (folder / "bars.xml").write_text(MJCF)
    file = folder / "mechanism.yaml"
    file.write_text(text)
    return file


def test_every_key_is_read(tmp_path: Path) -> None:
    parts = parts_from_yaml(written(tmp_path))
    model = parts.model
    assert parts.name == "bars"
    assert parts.closures == (
        LoopClosure("knee", "rocker_tip", "rigid", "pin"),
        LoopClosure("knee", "rocker_tip", "revolute", axis=[0, 1, 0]),
        JointCoupling("rocker_joint", "crank_joint", -2, 0.5),
    )
    assert parts.actuated == ("crank_joint",)
    values = {"crank_joint": 0.5, "rocker_joint": 1.0}
    np.testing.assert_array_equal(parts.home, [values.get(n, 0) for n in list(model.names)[1:]])
    assert parts.damping == {"crank_joint": 0.1, "rocker_joint": 3}
    assert parts.friction == {"crank_joint": 0.2}
    assert parts.stiffness == {"coupler_joint": 3}
    assert parts.rest == {"coupler_joint": -0.1}
    assert (parts.friction_speed, parts.characteristic_length) == (0.02, 0.1)
    assert parts.max_condition == 1e6
    np.testing.assert_array_equal(model.gravity.linear, [0, 1, -2])
    armature = dict(zip(list(model.names)[1:], model.armature, strict=True))
    assert armature.pop("crank_joint") == 1e-3
    assert not any(armature.values())


def test_couplings_of_several_joints_and_polynomials_are_read(tmp_path: Path) -> None:
    text = """\
urdf: four_bar.urdf
couplings:
  - {joint: rocker_joint, others: {crank_joint: 10, coupler_joint: -2.5}, offset: 0.5}
  - {joint: rocker_joint, other: crank_joint, polynomial: [0.1, 2, 0, 1], name: cam}
  - {joint: rocker_joint, others: {}, offset: 1}
"""
    assert parts_from_yaml(written(tmp_path, text)).closures == (
        JointCoupling("rocker_joint", {"crank_joint": 10, "coupler_joint": -2.5}, offset=0.5),
        JointCoupling("rocker_joint", "crank_joint", name="cam", polynomial=(0.1, 2, 0, 1)),
        JointCoupling("rocker_joint", {}, offset=1.0),
    )


def test_most_keys_can_be_left_out(tmp_path: Path) -> None:
    parts = parts_from_yaml(str(written(tmp_path, "urdf: four_bar.urdf\n")))
    assert parts.closures == parts.actuated == ()
    assert parts.name == "mechanism"  # as the URDF calls it
    assert parts.home is parts.friction_speed is parts.max_condition is None
    np.testing.assert_array_equal(parts.model.gravity.linear, [0, 0, -9.81])


def test_the_parts_make_the_mechanism_that_code_makes(tmp_path: Path) -> None:
    text = "urdf: four_bar.urdf\nclosures: [{frame_a: knee, frame_b: rocker_tip, kind: rigid}]\n"
    parts = parts_from_yaml(written(tmp_path, text + "actuated: [crank_joint]\n"))
    made = ClosedLoopModel(parts.model, parts.closures, parts.actuated)
    known = FOUR_BAR.mechanism()
    q = known.close(pin.neutral(known.model) + 0.3)
    v = known.velocity(q, [1.0])
    a = known.acceleration(q, v, [0.5])
    np.testing.assert_allclose(
        made.inverse_dynamics(q, v, a).tau, known.inverse_dynamics(q, v, a).tau, rtol=1e-12
    )


def test_files_are_found_beside_the_description_or_where_they_are_said_to_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    written(inner)
    monkeypatch.setenv("HOME", str(inner))
    for source in ("inner/four_bar.urdf", str(inner / "four_bar.urdf"), "~/four_bar.urdf"):
        file = tmp_path / "m.yaml"
        file.write_text(f"urdf: {source}\n")
        assert parts_from_yaml(file).model.nv == 4
        monkeypatch.chdir(tmp_path)
        assert parts_from_yaml("m.yaml").model.nv == 4


def test_a_free_root_floats(tmp_path: Path) -> None:
    text = "urdf: four_bar.urdf\nroot: free\nhome: {root_joint: [1, 2, 3, 0, 0, 0, 1.0001]}\n"
    parts = parts_from_yaml(written(tmp_path, text))
    assert parts.model.names[1] == "root_joint"
    assert parts.model.nv == 4 + 6
    np.testing.assert_allclose(parts.home[:7], [1, 2, 3, 0, 0, 0, 1], atol=1e-15)
    assert parts_from_yaml(written(tmp_path, "urdf: four_bar.urdf\nroot: fixed\n")).model.nv == 4


def test_losses_of_a_urdf_are_read_and_can_be_replaced(tmp_path: Path) -> None:
    dynamics = '<dynamics damping="0.3" friction="0.2"/></joint>'
    urdf = robot(
        link("a", 1, "0 0 0", 1),
        joint("revolute", "base", "a", name="j").replace("</joint>", dynamics),
        link("b", 1, "0 0 0", 1),
        joint("revolute", "a", "b", name="k").replace("</joint>", dynamics),
    )
    file = written(tmp_path, "urdf: lossy.urdf\ndamping: {k: 1}\n")
    (tmp_path / "lossy.urdf").write_text(urdf)
    parts = parts_from_yaml(file)
    assert parts.damping == {"j": 0.3, "k": 1}
    assert parts.friction == {"j": 0.2, "k": 0.2}


# MJCF ---------------------------------------------------------------------------------------------


def test_an_mjcf_brings_its_own_and_the_description_adds_to_it(tmp_path: Path) -> None:
    parts = parts_from_yaml(written(tmp_path, "mjcf: bars.xml\n"))
    assert [closure.name for closure in parts.closures] == ["pin"]
    assert (parts.actuated, parts.name) == (("jb",), "bars")
    assert parts.damping == {"ja": 0.4, "jb": 0.7}
    np.testing.assert_array_equal(parts.home, [0.3, 0.4])
    more = """\
mjcf: bars.xml
name: other
closures: [{frame_a: a, frame_b: b, kind: planar}]
couplings: [{joint: ja, other: jb}]
actuated: [ja]
home: {jb: 1}
damping: {jb: 5}
rest: {ja: 0.2}
gravity: [0, 0, 0]
"""
    parts = parts_from_yaml(written(tmp_path, more))
    assert [closure.name for closure in parts.closures] == ["pin", "a = b", "ja = jb"]
    assert (parts.actuated, parts.name) == (("ja",), "other")
    assert parts.damping == {"ja": 0.4, "jb": 5}
    assert (parts.stiffness, parts.rest) == ({"ja": 2}, {"ja": 0.2})
    np.testing.assert_array_equal(parts.home, [0.3, 1])
    assert not parts.model.gravity.linear.any()


# Merging ------------------------------------------------------------------------------------------


def test_joints_are_merged(tmp_path: Path) -> None:
    parts = parts_from_yaml(written(tmp_path, WRIST_FILE))
    assert list(parts.model.names) == ["universe", "cardan", "ball"]
    assert parts.actuated == ("cardan",)
    assert parts.home is None


def test_a_home_can_name_joints_before_and_after_merging(tmp_path: Path) -> None:
    """Three angles or a quaternion; Rx(a) Ry(b) Rz(c) is the rotation of the three."""
    by_angles = parts_from_yaml(
        written(tmp_path, WRIST_FILE + "home: {x: 0.3, y: 0.4, z: 0.5, cardan: [0.1, 0.2]}\n")
    )
    turn = np.eye(3)
    for axis, angle in zip(np.eye(3), (0.3, 0.4, 0.5), strict=True):
        turn = turn @ pin.AngleAxis(angle, axis).matrix()
    expected = pin.Quaternion(turn).coeffs()
    np.testing.assert_allclose(by_angles.home, [0.1, 0.2, *expected], atol=1e-15)
    numbers = ", ".join(map(repr, expected.tolist()))
    by_quaternion = parts_from_yaml(
        written(tmp_path, WRIST_FILE + f"home: {{ball: [{numbers}], u: 0.1, v: 0.2}}\n")
    )
    np.testing.assert_allclose(by_quaternion.home, by_angles.home, atol=1e-15)


def test_losses_of_merged_joints_must_be_said_anew(tmp_path: Path) -> None:
    lossy = WRIST.replace("</joint>", '<dynamics damping="0.3"/></joint>')
    file = written(tmp_path, WRIST_FILE)
    (tmp_path / "wrist.urdf").write_text(lossy)
    with pytest.raises(MechanismError, match="line 2: joint 'x' has damping and is merged; say wh"):
        parts_from_yaml(file)
    file.write_text(WRIST_FILE + "damping: {ball: 0.1, cardan: 0.2}\n")
    assert parts_from_yaml(file).damping == {"ball": 0.1, "cardan": 0.2}


# What is wrong ------------------------------------------------------------------------------------

U = "urdf: four_bar.urdf\n"
C = U + "closures:\n  - {frame_a: knee, frame_b: rocker_tip, "
WRONG = {
    "unknown key": (
        U + "gravty: 3\n",
        2,
        "unknown key 'gravty' (did you mean gravity?); the keys of a mechanism are: name, urdf",
    ),
    "unknown key inside": (
        C + "knd: rigid}\n",
        3,
        "unknown key 'knd' (did you mean kind?); the keys of closures[0] are: frame_a, frame_b",
    ),
    "missing": (U + "closures:\n  - {frame_a: knee}\n", 3, "closures[0] needs frame_b"),
    "wrong kind": (C + "kind: ball}\n", 3, "no closure kind 'ball'; there are: spherical, rigid"),
    "wrong frame": (
        C.replace("knee", "kne") + "kind: rigid}\n",
        3,
        "closures: no frame 'kne' (did you mean knee?); there are: universe, base",
    ),
    "wrong option": (C + "distance: 1}\n", 3, "distance"),
    "short axis": (C + "kind: revolute, axis: [1, 0]}\n", 3, "closures[0].axis = [1, 0]: list sh"),
    "no direction": (C + "kind: revolute, axis: [0, 0, 0]}\n", 3, "has no direction"),
    "nan": (U + "damping: {crank_joint: .nan}\n", 2, "damping.crank_joint = nan: must be"),
    "infinite": (U + "gravity: [0, 0, .inf]\n", 2, "gravity[2] = inf: must be a finite"),
    "negative": (U + "friction: {crank_joint: -1}\n", 2, "friction.crank_joint = -1: must be"),
    "truth value": (U + "friction: {crank_joint: true}\n", 2, "friction.crank_joint = True"),
    "quoted number": (U + "damping: {crank_joint: '1'}\n", 2, "damping.crank_joint = '1': must be"),
    "name that is a number": (U + "name: 3\n", 2, "name = 3: must be a valid string"),
    "file that is a number": ("urdf: 3\n", 1, "urdf = 3: must be a valid string"),
    "list for a mapping": (U + "home: [1, 2]\n", 2, "home = [1, 2]: must be a valid dict"),
    "text for a list": (U + "actuated: crank_joint\n", 2, "actuated = 'crank_joint': must be"),
    "key that is a number": (
        U + "home: {1: 2}\n",
        2,
        "home[1] = 1: must be a valid string",
    ),
    "joint to actuate": (
        U + "actuated: [crank_joint, crank]\n",
        2,
        "actuated: no joint 'crank'; there are: crank_joint, coupler_joint",
    ),
    "joint of an effect": (U + "rest: {arm: 1}\n", 2, "rest: no joint 'arm'; there are: crank_j"),
    "joint of a home": (U + "\nhome:\n  arm: 1\n", 4, "home: no joint 'arm'; there are: crank_joi"),
    "size of a home": (
        U + "home: {crank_joint: [1, 2]}\n",
        2,
        "home of 'crank_joint' (JointModelRevoluteUnaligned) has 2 numbers; it must have 1",
    ),
    "home is text": (U + "home: {crank_joint: x}\n", 2, "home.crank_joint = 'x': must be"),
    "home is not a rotation": (
        U + "root: free\nhome: {root_joint: [0, 0, 0, 1, 0, 0, 1]}\n",
        3,
        "is not a rotation",
    ),
    "home of zeros": (
        U + "root: free\nhome: {root_joint: [0, 0, 0, 0, 0, 0, 0]}\n",
        3,
        "is not a rotation",
    ),
    "root": (U + "root: loose\n", 2, "root = 'loose': must be 'fixed' or 'free'"),
    "two files": (U + "mjcf: bars.xml\n", 2, "one of urdf and mjcf; both were given"),
    "root of an mjcf": ("mjcf: bars.xml\nroot: free\n", 2, "root belongs to urdf"),
    "text in place of a file": ("urdf: '<robot/>'\n", 1, "must be the name of a file, not its te"),
    "no such file": ("name: x\nurdf: none.urdf\n", 2, "cannot read the URDF"),
    "coupling": (
        U + "couplings: [{joint: crank_joint, other: x}]\n",
        2,
        "no joint 'x' of one coordinate; there are: ",
    ),
    "coupling of others": (
        U + "couplings:\n - {joint: crank_joint, others: {rocker_joint: 1, x: 2}}\n",
        3,
        "no joint 'x' of one coordinate; there are: ",
    ),
    "coupling of nothing": (
        U + "couplings:\n - {joint: crank_joint}\n",
        3,
        "one of other (a joint) and others (ratios by joints' names); neither was given",
    ),
    "coupling of both": (
        U + "couplings:\n - {joint: crank_joint, other: a, others: {b: 1}}\n",
        3,
        "both were given",
    ),
    "ratio": (
        U + "couplings:\n - {joint: crank_joint, others: {rocker_joint: wide}}\n",
        3,
        "couplings[0].others.rocker_joint = 'wide': must be a valid number",
    ),
    "polynomial": (
        U + "couplings:\n - {joint: crank_joint, other: rocker_joint, polynomial: [1]}\n",
        3,
        "polynomial = [1.0] couples nothing",
    ),
    "coupling to itself": (
        U + "couplings: [{joint: crank_joint, other: crank_joint}]\n",
        2,
        "cannot tie joint 'crank_joint' to itself",
    ),
    "merge": (
        U + "merge: [{joints: [crank_joint, knee_joint], into: universal, name: m}]\n",
        2,
        "'knee_joint' does not follow 'crank_joint'",
    ),
    "merge into": (
        U + "merge:\n - {joints: [crank_joint], into: screw, name: m}\n",
        3,
        "merge[0].into = 'screw': must be 'spherical' or 'universal'",
    ),
    "condition": (U + "max_condition: 0.5\n", 2, "max_condition = 0.5: must be greater"),
    "syntax": (U + "home: {a: 1\n", 3, "not valid YAML"),
    "twice": (U + "urdf: b.urdf\n", 2, "found duplicate key"),
    "object": (U + "name: !!python/object:os.system {}\n", 2, "not valid YAML"),
}


@each(("text", "line", "why"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_told_in_a_line(text: str, line: int, why: str, tmp_path: Path) -> None:
    file = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        parts_from_yaml(file)
    message = str(caught.value)
    assert message.startswith(f"{file}, line {line}: ")
    assert why in message
    assert "\n" not in message and len(message) < 1000


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("name: x\n", "mechanism.yaml: a mechanism has one of urdf and mjcf; neither was given"),
        ("", "it holds nothing"),
        ("- urdf: x\n", "it holds a list"),
    ],
)
def test_files_that_say_too_little_are_refused(text: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=why):
        parts_from_yaml(written(tmp_path, text))


def test_a_bad_robot_is_told_with_both_files(tmp_path: Path) -> None:
    file = written(tmp_path)
    (tmp_path / "four_bar.urdf").write_text("<robot")
    with pytest.raises(MechanismError, match=r"mechanism\.yaml, line 2: .*four_bar\.urdf is not"):
        parts_from_yaml(file)


def test_many_nested_values_do_not_fill_a_message(tmp_path: Path) -> None:
    nest = "[" * 60 + "]" * 60
    with pytest.raises(InputError) as caught:
        parts_from_yaml(written(tmp_path, f"{U}closures: {nest}\n"))
    assert len(str(caught.value)) < 600


def test_files_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot read the mechanism file .*none\.yaml"):
        parts_from_yaml(tmp_path / "none.yaml")


def test_all_names_that_there_are_not_are_told_at_once(tmp_path: Path) -> None:
    source = (URDF / "four_bar.yaml").read_text()
    for before, after in (
        ("frame_b: rocker_tip", "frame_b: rocker_top"),
        ("actuated: [crank_joint]", "actuated: [crank, rocker]"),
        ("home: {crank_joint", "home: {cronk_joint"),
        ("urdf: ", f"urdf: {URDF}/"),
        ("task: {joints: [rocker_joint]}", "task: {frame: nowhere, coordinates: [x]}"),
    ):
        assert before in source
        source = source.replace(before, after)
    file = tmp_path / "mine.yaml"
    file.write_text(f"{source}damping: {{knee: 1.0}}\n")
    with pytest.raises(MechanismError) as told:
        parts_from_yaml(file)
    words = str(told.value).split("; line ")
    assert words[0].startswith(f"{file}, line ")
    for fault in (
        "damping: no joint 'knee'",
        "actuated: no joint 'crank'",
        "actuated: no joint 'rocker'",
        "closures: no frame 'rocker_top'",
        "home: no joint 'cronk_joint'",
        "task: no frame 'nowhere'",
    ):
        assert sum(fault in one for one in words) == 1, fault
    assert len(words) == 6
