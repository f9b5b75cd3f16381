"""Every element and attribute of the formats' reference lists has one treatment; nothing else is.

The lists below are written from urdfdom's schema (versions 1.0 to 1.2), Drake's page of tags,
URDF+'s and Isaac Sim's parsers, and urdfdom's pull request 264. ``*``: anything may be inside.
"""

from __future__ import annotations

import re

import pytest
from lxml import etree

from rps_pin.closed_loop.io.urdf.tree import parts_from_urdf
from rps_pin.closed_loop.io.urdf.vocabulary import WORDS, misspelt
from rps_pin.errors import MechanismError
from tests.each import each

POSE = "xyz rpy quat_xyzw"
JOINT = {
    "": "name type",
    "/origin": POSE,
    "/parent": "link",
    "/child": "link",
    "/axis": "xyz",
    "/limit": "lower upper effort velocity acceleration deceleration jerk",
    "/dynamics": "damping friction",
    "/mimic": "joint multiplier offset",
    "/safety_controller": "*",
    "/calibration": "*",
}
URDF = {
    "robot": "name version",
    "robot/link": "name type",
    "robot/link/inertial": "",
    "robot/link/inertial/origin": POSE,
    "robot/link/inertial/mass": "value",
    "robot/link/inertial/inertia": "ixx ixy ixz iyy iyz izz",
    "robot/link/visual": "*",
    "robot/link/collision": "*",
    **{f"robot/joint{path}": words for path, words in JOINT.items()},
    "robot/material": "*",
    "robot/transmission": "*",
    "robot/gazebo": "*",
    "robot/sensor": "*",
}
TENDON = "robot/drake:tendon_constraint/drake:tendon_constraint_"
BALL = "robot/drake:ball_constraint/drake:ball_constraint_"
DRAKE = {
    **{f"robot/drake:joint{path}": words for path, words in JOINT.items()},
    "robot/joint": "name type drake_ignore",
    "robot/link": "name drake_ignore",
    "robot/joint/limit": "drake:acceleration",
    "robot/joint/dynamics": "damping friction coulomb_window",
    "robot/joint/actuator": "*",
    "robot/drake:joint/actuator": "*",
    "robot/drake:joint/drake:screw_thread_pitch": "value",
    "robot/drake:joint/drake:curves": "*",
    "robot/drake:joint/drake:initial_tangent": "*",
    "robot/drake:joint/drake:plane_normal": "*",
    "robot/drake:joint/drake:is_periodic": "*",
    "robot/frame": "name link xyz rpy",
    "robot/drake:ball_constraint": "",
    f"{BALL}body_A": "name",
    f"{BALL}body_B": "name",
    f"{BALL}p_AP": "value",
    f"{BALL}p_BQ": "value",
    "robot/drake:tendon_constraint": "",
    f"{TENDON}joint": "name a",
    f"{TENDON}offset": "value",
    f"{TENDON}lower_limit": "value",
    f"{TENDON}upper_limit": "value",
    f"{TENDON}stiffness": "value",
    f"{TENDON}damping": "value",
    "robot/drake:linear_bushing_rpy": "*",
    "robot/drake:linear_spring_damper": "*",
    "robot/drake:collision_filter_group": "*",
}
ENDS = ("predecessor", "successor")
OTHERS = {
    "robot/joint": "independent dont_collapse",
    "robot/joint/joint_properties": "",
    "robot/link/inertial/inertia": "iyx izx izy",
    "robot/loop": "name type",
    "robot/loop/axis": "xyz",
    **{f"robot/loop/{end}": "link" for end in ENDS},
    **{f"robot/loop/{end}/origin": POSE for end in ENDS},
    "robot/coupling": "name type",
    "robot/coupling/ratio": "value",
    **{f"robot/coupling/{end}": "link" for end in ENDS},
    "robot/constraint": "name type",
    **{f"robot/constraint/{end}": "link" for end in ("parent", "child")},
    **{f"robot/constraint/{end}_origin": POSE for end in ("parent", "child")},
    **{f"robot/constraint/{end}_axis": "xyz" for end in ("parent", "child")},
    "robot/loop_joint": "name type",
    "robot/loop_joint/axis": "xyz",
    **{f"robot/loop_joint/{end}": f"link {POSE}" for end in ("link1", "link2")},
    "robot/fixed_frame": "name",
    "robot/fixed_frame/parent": "link",
    "robot/fixed_frame/origin": POSE,
    "robot/ros2_control": "*",
    "robot/mujoco": "*",
    "robot/link/contact": "*",
    "robot/link/surface": "*",
    "robot/link/self_filter": "*",
    "robot/link/collision_checking": "*",
    "robot/link/self_collision_checking": "*",
}


@each("listed", [URDF, DRAKE, OTHERS])
def test_every_word_of_a_reference_list_has_its_treatment(listed: dict[str, str]) -> None:
    for path, attributes in listed.items():
        word = WORDS[path]
        if attributes == "*":
            assert word.is_open, path
        else:
            assert not word.is_open, path
            assert set(attributes.split()) <= {*word.read, *word.harmless}, path


def test_no_word_is_known_that_no_list_has() -> None:
    assert set(WORDS) == {*URDF, *DRAKE, *OTHERS}
    shared = {"quat_xyzw", "name", *JOINT["/limit"].split(), "drake:acceleration"}
    shared |= {"coulomb_window", "independent", "dont_collapse", "drake_ignore", "type"}
    for path, word in WORDS.items():
        told = " ".join(one.get(path, "") for one in (URDF, DRAKE, OTHERS)).split()
        assert not {*word.read, *word.harmless} - {*told, *shared}, path


#: A file with every element that is looked into, and every attribute of each.
FULL = """<robot name="full" version="1.2" xmlns:drake="http://drake.mit.edu">
<material name="grey"><color rgba="1 1 1 1"/></material>
<link name="base" type="x"/>
<link name="a">
<inertial>
<origin xyz="0.1 0 0" rpy="0 0 0.1"/>
<mass value="2"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
</inertial>
<visual><geometry><box size="1 1 1"/></geometry></visual>
<collision><geometry><box size="1 1 1"/></geometry></collision>
</link>
<link name="b"/>
<link name="c"/>
<link name="d"/>
<link name="e"/>
<link name="f"/>
<joint name="ja" type="revolute" independent="true" dont_collapse="true">
<parent link="base"/>
<child link="a"/>
<origin xyz="0 0 1" quat_xyzw="0 0 0 1"/>
<axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="3" velocity="4" acceleration="5" deceleration="6" jerk="7"/>
<dynamics damping="0.1" friction="0.2"/>
<safety_controller k_velocity="1"/>
<calibration rising="0"/>
</joint>
<joint name="jb" type="revolute">
<parent link="a"/>
<child link="b"/>
<axis xyz="0 1 0"/>
<limit lower="-9" upper="9" effort="3" velocity="4" drake:acceleration="5"/>
<dynamics damping="0.1" coulomb_window="0.1"/>
<mimic joint="ja" multiplier="2" offset="0.1"/>
</joint>
<drake:joint name="jc" type="screw">
<parent link="base"/>
<child link="c"/>
<axis xyz="0 0 1"/>
<drake:screw_thread_pitch value="0.01"/>
</drake:joint>
<joint name="jd" type="continuous">
<parent link="base"/>
<child link="d"/>
</joint>
<joint name="je" type="continuous">
<parent link="base"/>
<child link="e"/>
</joint>
<joint name="jf" type="floating">
<parent link="base"/>
<child link="f"/>
</joint>
<frame name="mark" link="a" xyz="0 0 1" rpy="0 0 0"/>
<fixed_frame name="mark_2">
<parent link="a"/>
<origin xyz="0 0 1" rpy="0 0 0"/>
</fixed_frame>
<loop name="l" type="revolute">
<predecessor link="d">
<origin xyz="0 0 0" rpy="0 0 0"/>
</predecessor>
<successor link="f">
<origin xyz="0 0 0" rpy="0 0 0"/>
</successor>
<axis xyz="1 0 0"/>
</loop>
<coupling name="k" type="rolling">
<predecessor link="d"/>
<successor link="e"/>
<ratio value="-2"/>
</coupling>
<constraint name="m" type="universal">
<parent link="e"/>
<parent_origin xyz="0 0 0"/>
<parent_axis xyz="1 0 0"/>
<child link="f"/>
<child_origin xyz="0 0 0"/>
<child_axis xyz="0 1 0"/>
</constraint>
<loop_joint name="n" type="prismatic">
<link1 link="e" xyz="0 0 0" rpy="0 0 0"/>
<link2 link="f" xyz="0 0 0" rpy="0 0 0"/>
<axis xyz="0 1 0"/>
</loop_joint>
<drake:ball_constraint>
<drake:ball_constraint_body_A name="d"/>
<drake:ball_constraint_body_B name="f"/>
<drake:ball_constraint_p_AP value="0 0 0"/>
<drake:ball_constraint_p_BQ value="0 0 0"/>
</drake:ball_constraint>
<drake:tendon_constraint>
<drake:tendon_constraint_joint name="jc" a="2"/>
<drake:tendon_constraint_joint name="jd" a="1"/>
<drake:tendon_constraint_joint name="je" a="1"/>
<drake:tendon_constraint_offset value="0.5"/>
<drake:tendon_constraint_lower_limit value="0.1"/>
<drake:tendon_constraint_upper_limit value="0.1"/>
</drake:tendon_constraint>
<transmission name="t"><joint name="jd"/><actuator name="m"/></transmission>
<gazebo reference="a"><mu1>1</mu1></gazebo>
</robot>
"""
NAMESPACE = "{http://drake.mit.edu}"


def test_a_file_with_every_word_is_read_without_a_note() -> None:
    parts = parts_from_urdf(FULL)
    assert len(parts.closures) == 7  # the mimic, and six loops
    told = [note for note in parts.notes if "position limits" not in note]
    assert told == []
    assert {frame.name for frame in parts.model.frames} >= {"mark", "mark_2"}


def slips() -> list[tuple[str, int]]:
    """Texts with one word misspelt, and the word's line (or that of the element around it)."""
    found = []
    tree = etree.fromstring(FULL)
    for number, element in enumerate(tree.iter("*")):
        path = "/".join(reversed([tag(one) for one in (element, *element.iterancestors())]))
        if path not in WORDS:
            continue  # in an open one
        for name in element.attrib if not WORDS[path].is_open else ():
            found.append((changed(number, name), element.sourceline))
        if element is not tree:
            found.append((changed(number, None), element.sourceline))
    return found


def tag(element) -> str:
    return element.tag.replace(NAMESPACE, "drake:")


def changed(number: int, attribute: str | None) -> str:
    """The text with the last two letters of a name swapped, and doubled if they are alike."""
    tree = etree.fromstring(FULL)
    element = [*tree.iter("*")][number]
    name = element.tag if attribute is None else attribute
    bare = name.rpartition("}")[2]
    slip = bare + bare[-1] if bare[-1] == bare[-2:-1] or len(bare) < 2 else swapped(bare)
    new = name.replace(bare, slip)
    if attribute is None:
        element.tag = new
    else:
        values = {new if key == attribute else key: v for key, v in element.attrib.items()}
        element.attrib.clear()
        element.attrib.update(values)
    return etree.tostring(tree, encoding="unicode")


def swapped(word: str) -> str:
    return f"{word[:-2]}{word[-1]}{word[-2]}"


def test_every_slip_in_a_word_is_refused_with_its_line() -> None:
    cases = slips()
    assert len(cases) > 150
    short = 0
    for text, line in cases:
        try:
            notes = parts_from_urdf(text).notes
        except MechanismError as error:
            found = re.search(r"line (\d+)", str(error))
            assert found, error
            assert abs(int(found[1]) - line) <= 2, (str(error), line)
        else:  # a name of one letter is not missed, but told
            assert any(f"line {line}:" in note for note in notes), (line, notes)
            short += 1
    assert short == 0


@each(
    ("word", "known", "meant"),
    [
        ("limt", ("link", "limit"), "limit"),
        ("limitt", ("limit",), "limit"),
        ("axes", ("axis",), "axis"),
        ("xzy", ("rpy", "xyz"), "xyz"),
        ("Origin", ("origin",), "origin"),
        ("inertal", ("mass", "inertial"), "inertial"),
        ("gear_velocity", ("velocity",), None),
        ("command_effort", ("effort",), None),
        ("D", ("damping",), None),
        ("gravity", ("axis",), None),
    ],
)
def test_slips_are_told_from_other_words(word: str, known: tuple[str], meant: str | None) -> None:
    assert misspelt(word, known) == meant


def test_unknown_words_are_told_once_with_line_and_count() -> None:
    text = FULL.replace('friction="0.2"', 'friction="0.2" mu_viscous="16"')
    text = text.replace('coulomb_window="0.1"', 'coulomb_window="0.1" mu_viscous="16"')
    line = text[: text.index("mu_viscous")].count("\n") + 1
    (note,) = [one for one in parts_from_urdf(text).notes if "mu_viscous" in one]
    assert note.endswith(
        f"line {line}: the attribute 'mu_viscous' of <dynamics> is not read (nor are 1 more)"
    )
    text = FULL.replace("<frame ", '<gravity_off/><v:w xmlns:v="u"/><frame ')
    told = " ".join(parts_from_urdf(text).notes)
    assert "<gravity_off> in <robot> is not read" in told
    assert "<v:w> in <robot> is not read" in told


@each(
    ("right", "wrong", "why"),
    [
        ("damping=", "dampening=", "<dynamics> has no attribute 'dampening'; it can have: 'damp"),
        ("damping=", "viscous_friction=", "<dynamics> has no attribute 'viscous_friction'; it can"),
        ("velocity=", "velocty_limit=", "<limit> has no attribute 'velocty_limit'; it can have"),
        ("lower=", "minimum=", "<limit> has no attribute 'minimum'; it can have: 'lower', 'upper'"),
        ("multiplier=", "ratio=", "<mimic> has no attribute 'ratio'; it can have: 'joint', 'multi"),
        ('mass value="2"', 'mass value="2" unit="g"', "<mass> has no attribute 'unit'; it can"),
        ('iyz="0"', 'iyz="0" Iyy_about="com"', "<inertia> has no attribute 'Iyy_about'; it can"),
        ("axis xyz", "axis direction", "<axis> has no attribute 'direction'; it can have: 'xyz'"),
        ('rpy="0 0 0.1"', 'euler="0 0 6"', "<origin> has no attribute 'euler'; it can have: 'xyz'"),
        ('parent link="a"', 'parent link="a" frame="x"', "<parent> has no attribute 'frame'"),
        ('child link="a"', 'child link="a" offset="1"', "<child> has no attribute 'offset'"),
        ('type="revolute" ind', 'type="revolute" axis="1 0 0" ind', "<joint> has no attribute 'ax"),
        ("<dynamics ", "<armature v='1'/><dynamics ", "<joint> has a <armature>; it can have: <or"),
        ("<mass ", "<density v='1'/><mass ", "<inertial> has a <density>; it can have: <origin>, "),
        ('ratio value="-2"', 'ratio value="-2" of="3"', "<ratio> has no attribute 'of'; it can"),
    ],
)
def test_unknown_words_are_refused_where_they_bear_on_the_motion(
    right: str, wrong: str, why: str
) -> None:
    assert right in FULL
    line = FULL[: FULL.index(right)].count("\n") + 1
    with pytest.raises(MechanismError, match=rf"line {line}: {re.escape(why)}"):
        parts_from_urdf(FULL.replace(right, wrong, 1))


@each(
    ("right", "wrong", "told"),
    [
        ("<dynamics ", '<dynamics D="1" K="7000" mu_coulomb="0" mu_viscous="16" ', "'K' of <dyn"),
        ("<dynamics ", '<dynamics spring_stiffness="0" ', "'spring_stiffness' of <dynamics>"),
        ("<axis ", '<axis rpy="0 0 0" ', "the attribute 'rpy' of <axis> is not read"),
        ("<limit ", '<limit gear_velocity="1" ', "the attribute 'gear_velocity' of <limit>"),
        ("<dynamics ", '<joint_properties friction="0"/><dynamics ', "of <joint_properties>"),
        ("<dynamics ", '<v:w xmlns:v="u"/><dynamics ', "<v:w> in <joint> is not read"),
        ('<link name="b"/>', '<link name="b"><gravity>0</gravity></link>', "<gravity> in <link>"),
    ],
)
def test_words_of_other_programs_are_told(right: str, wrong: str, told: str) -> None:
    assert told in " ".join(parts_from_urdf(FULL.replace(right, wrong, 1)).notes)


@pytest.mark.parametrize("spring", ["linear_bushing_rpy", "linear_spring_damper"])
def test_springs_between_links_are_refused(spring: str) -> None:
    text = FULL.replace("<frame ", f"<drake:{spring}/><frame ")
    with pytest.raises(MechanismError, match=rf"line \d+: <drake:{spring}> is a spring"):
        parts_from_urdf(text)


def test_a_prefix_that_is_not_declared_is_read() -> None:
    text = FULL.replace(' xmlns:drake="http://drake.mit.edu"', "")
    assert len(parts_from_urdf(text).closures) == 7
