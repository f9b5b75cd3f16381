"""Limits, key frames, gravity, names, and bodies that MuJoCo's compiler treats in a special way."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, MechanismError
from rps_pin.closed_loop.io.mjcf import parts_from_mjcf
from tests.closed_loop.io.mjcf.twin import BODY, INERTIAL, Twin, fourbar, mujoco_file, read
from tests.each import each
from tests.worst import worst


def several() -> str:
    """Bodies with several joints each, at different places, with references, and no names."""
    return mujoco_file(
        f"""<body name="a" pos="1 0 0" euler="10 20 30">
          <joint name="ja" axis="0 1 0" pos="0.1 0 0" ref="30" range="-40 60"/>
          <joint type="slide" axis="1 1 0" pos="0 0.3 0.1" ref="0.2" range="-1 2" armature="0.3"/>
          <joint name="a" axis="0 0 1" frictionloss="0.3"/>{INERTIAL}
          <body pos="0 0 1"><joint type="ball" pos="0 0.1 0" armature="0.02"/>
            <joint type="slide" axis="0 0 -2"/>{INERTIAL}<site name="a" pos="1 0 0"/></body></body>
        <body name="f"><body name="g" pos="0 1 0">{INERTIAL}<site name="sg" pos="0 0 1"/>
          <joint name="jg" axis="3 2 1"/></body></body>"""
    )


def free(rotor: str = "") -> str:
    return mujoco_file(
        f"""<frame pos="0 0 1"><body name="a" pos="0.1 0 0" euler="0 30 0">
          <joint type="free" name="fly" {rotor}/>{INERTIAL}
          <body name="b" pos="0.3 0 0"><joint name="jb" axis="0 1 0"/>{INERTIAL}</body>
        </body></frame><body name="box"><joint type="free"/><geom size="0.1"/></body>""",
        '<keyframe><key name="up" qpos="1 2 3 0 2 0 0 0.4 0 0 0 0.5 0.5 0.5 0.5"/></keyframe>',
    )


def test_names_are_those_of_the_file_and_of_their_bodies() -> None:
    model = parts_from_mjcf(several()).model
    assert list(model.names)[1:] == [
        "ja",
        "a_body_joint_2",
        "a",
        "a_body_child_joint_1",
        "a_body_child_joint_2",
        "jg",
    ]
    frames = {frame.name for frame in model.frames}
    assert {"world", "a_body", "a_site", "a_body_child", "f", "g", "sg"} <= frames


@each("text", [several(), free(), free('armature="0.2"'), free('frictionloss="0.2"'), fourbar()])
def test_masses_and_bias_are_mujocos(text: str) -> None:
    twin = Twin(text)
    rng = np.random.default_rng(0)
    for _ in range(5):
        twin.random(rng)
        for own, right in (twin.masses(), twin.bias()):
            assert worst(own - right) < 1e-12 * worst(right)


def test_rotors_and_dry_friction_of_free_joints_are_per_axis_of_the_world() -> None:
    """As MuJoCo has them; then the free joint is two, with the same coordinates."""
    for option in ("armature", "frictionloss"):
        parts = parts_from_mjcf(free(f'{option}="0.2"'))
        assert list(parts.model.names)[1:3] == ["fly_position", "fly"]
        assert parts.model.nq == 15
    assert parts.friction == {"fly_position": 0.2, "fly": 0.2}
    assert list(parts_from_mjcf(free('damping="0.2"')).model.names)[1:3] == ["fly", "jb"]


def test_key_frames_are_configurations() -> None:
    parts = parts_from_mjcf(free())
    up = parts.model.referenceConfigurations["up"]
    np.testing.assert_allclose(up, [1, 2, 3, 1, 0, 0, 0, 0.4, 0, 0, 0, 0.5, 0.5, 0.5, 0.5])
    np.testing.assert_array_equal(parts.home, parts.model.referenceConfigurations["qpos0"])
    home = parts_from_mjcf(free().replace('"up"', '"home"')).home
    np.testing.assert_array_equal(home, up)


@each("kind", ["hinge", "slide"])
@each(
    "limits",
    [
        'range="-30 40"',
        'range="-30 40" ref="20"',
        'range="-30 40" limited="false"',
        'range="-30 40" limited="true"',
        'actuatorfrcrange="-2 3"',
        'actuatorfrcrange="-2 3" actuatorfrclimited="false"',
    ],
)
@each("settings", ["", '<compiler angle="radian"/>'])
def test_limits_of_joints_are_mujocos(kind: str, limits: str, settings: str) -> None:
    text = mujoco_file(BODY.replace('"j"', f'"j" type="{kind}" {limits}'), settings)
    model, m = parts_from_mjcf(text).model, mujoco.MjModel.from_xml_string(text)
    position = m.jnt_range[0] if m.jnt_limited[0] else (-np.inf, np.inf)
    assert (model.lowerPositionLimit[0], model.upperPositionLimit[0]) == tuple(position)
    effort = m.jnt_actfrcrange[0] if m.jnt_actfrclimited[0] else (-np.inf, np.inf)
    assert (model.lowerEffortLimit[0], model.upperEffortLimit[0]) == tuple(effort)


def test_limits_can_be_off() -> None:
    text = mujoco_file(
        BODY.replace('"j"', '"j" range="1 2"'), '<option><flag limit="disable"/></option>'
    )
    assert parts_from_mjcf(text).model.lowerPositionLimit[0] == -np.inf


def test_a_range_of_a_ball_joint_is_told() -> None:
    text = mujoco_file(BODY.replace('"j"', '"j" type="ball" range="0 40"'))
    with pytest.warns(UserWarning, match="line 1: joint 'j': a range of several coordinates is no"):
        parts_from_mjcf(text)


def test_gravity_can_be_off() -> None:
    text = mujoco_file(BODY, '<option gravity="1 2 3"/>', "<option><flag {}/></option>")
    assert not parts_from_mjcf(text.format('gravity="disable"')).model.gravity.linear.any()
    on = parts_from_mjcf(text.format('gravity="enable"')).model.gravity.linear
    np.testing.assert_array_equal(on, [1, 2, 3])


def gravcomp(a: str, ja: str, b: str, jb: str, settings: str) -> str:
    return mujoco_file(
        f"""<body name="still" gravcomp="7"><geom size="0.1"/>
          <body name="a" gravcomp="{a}"><joint name="ja" axis="0 1 0" {ja}/>{INERTIAL}
            <body name="b" pos="0.3 0 0" gravcomp="{b}"><joint name="jb" axis="0 1 0" {jb}/>
              {INERTIAL}</body></body></body>""",
        settings,
    )


@each(
    ("values", "share"),
    [
        (("1", "", "1", "", ""), 0.0),
        (("0.4", "", "0.4", "", ""), 0.6),
        (("0", "", "0", "", ""), 1.0),
        # MuJoCo counts this to the actuators: gravity is there, and a part of tau holds it.
        (("1", 'actuatorgravcomp="true"', "0.2", 'actuatorgravcomp="true"', ""), 1.0),
        (("1", "", "0", "", '<option><flag gravity="disable"/></option>'), 0.0),
        (("1", "", "0", "", '<option><flag spring="disable" damper="disable"/></option>'), 1.0),
    ],
)
def test_gravity_compensation_of_all_bodies_is_less_gravity(
    values: tuple[str, ...], share: float
) -> None:
    text = gravcomp(*values)
    twin = Twin(text)
    np.testing.assert_allclose(twin.model.gravity.linear, [0, 0, -9.81 * share], atol=1e-15)
    twin.random(np.random.default_rng(0))
    assert worst(twin.bias()[0] - twin.bias()[1]) < 1e-12


@each(
    ("values", "why"),
    [
        (("1", "", "0", "", ""), "body 'b' has gravcomp 0, and 'a' has 1: it is read where all"),
        (("0.5", "", "1", "", ""), "body 'b' has gravcomp 1, and 'a' has 0.5"),
        (("1", 'actuatorgravcomp="true"', "1", "", ""), "joint 'ja' has actuatorgravcomp, and oth"),
    ],
)
def test_gravity_compensation_of_some_bodies_is_refused(values: tuple[str, ...], why: str) -> None:
    with pytest.raises(MechanismError, match=why):
        parts_from_mjcf(gravcomp(*values))


def test_bodies_that_cannot_move_need_no_mass() -> None:
    text = mujoco_file(
        '<body name="a"><site name="s" pos="0 0 1"/>'
        f'<body name="c" pos="1 0 0">{BODY}</body></body>'
    )
    twin = Twin(text)
    twin.random(np.random.default_rng(0))
    assert twin.model.njoints == 2
    assert worst(twin.masses()[0] - twin.masses()[1]) < 1e-15
    placement = twin.data.oMf[twin.model.getFrameId("s")]
    pin.framesForwardKinematics(twin.model, twin.data, twin.q)
    np.testing.assert_array_equal(placement.translation, [0, 0, 1])


def test_moving_bodies_need_mass() -> None:
    with pytest.raises(MechanismError, match="mass and inertia of moving bodies must be larger"):
        parts_from_mjcf(mujoco_file(f'<body name="a"><joint name="i"/>{BODY}</body>'))


@each(
    "settings",
    [
        '<compiler balanceinertia="true"/>',
        '<compiler boundmass="2" boundinertia="0.5"/>',
        '<compiler inertiafromgeom="true" inertiagrouprange="1 2"/>',
        '<compiler fusestatic="true"/>',
        '<compiler alignfree="true"/>',
    ],
)
def test_settings_of_the_compiler_are_mujocos(settings: str) -> None:
    text = mujoco_file(
        """<body name="a"><freejoint/><geom size="0.1" pos="0.1 0 0" group="1"/>
          <geom type="box" size="0.1 0.2 0.3" euler="10 20 30" group="3"/>
          <body name="fixed" pos="0 0 0.3"><geom size="0.2" group="2"/></body>
          <body name="b" pos="0.4 0 0"><joint axis="0 1 0"/><geom size="0.1 0.1" type="capsule"
            group="2"/></body></body>""",
        settings,
    )
    twin = Twin(text)
    for seed in range(3):
        twin.random(np.random.default_rng(seed))
        for own, right in (twin.masses(), twin.bias()):
            assert worst(own - right) < 1e-12 * worst(right)


def test_a_mocap_body_stays_where_the_file_has_it() -> None:
    text = mujoco_file(
        f'<body name="hand" mocap="true" pos="0 0 1"><geom size="0.1"/></body>{BODY}',
        '<equality><weld body1="hand" body2="b"/></equality>',
    )
    with pytest.warns(UserWarning, match="body 'hand': moved by motion capture in MuJoCo, here it"):
        mechanism = ClosedLoopModel.from_mjcf(text)
    assert mechanism.describe().mobility == 0


def test_key_frames_that_are_not_finite_are_refused() -> None:
    text = fourbar('<keyframe><key name="x" qpos="0 nan 0"/></keyframe>')
    with pytest.raises(MechanismError, match="key frame 'x' has numbers that are not finite"):
        read(text)


SITE = '<site name="s" pos="0 1 nan"/></body>'
NOT_FINITE = {
    "mass": "<body name='b'><joint/><geom size='1e150'/></body>",
    "pos": BODY.replace('name="b"', 'name="b" pos="inf 0 0"'),
    "quat": BODY.replace('name="b"', 'name="b" quat="nan 0 0 0"'),
    "joint": BODY.replace("<joint", '<joint pos="0 nan 0"'),
    "axis": BODY.replace("<joint", '<joint axis="0 nan 0"'),
    "site": BODY.replace("</body>", SITE),
    **{
        word: BODY.replace("<joint", f'<joint {word}="inf"')
        for word in ("armature", "damping", "frictionloss", "stiffness", "ref", "springref")
    },
    "gravity": f"{BODY}</worldbody><option gravity='0 0 nan'/><worldbody>",
    "torquescale": BODY
    + '</worldbody><equality><weld body1="b" torquescale="nan"/></equality><worldbody>',
    "coef": BODY + '</worldbody><tendon><fixed name="t"><joint joint="j" coef="inf"/></fixed>'
    "</tendon><worldbody>",
    "gear": BODY + '</worldbody><actuator><motor joint="j" gear="nan"/></actuator><worldbody>',
}


@each("world", NOT_FINITE.values())
def test_numbers_that_are_not_finite_are_refused_with_their_line(world: str) -> None:
    with pytest.raises(MechanismError, match=r"line 1: .* not finite"):
        parts_from_mjcf(mujoco_file(world))


RADIANS = "<compiler angle='radian'/>"


@each("word", ["range", "actuatorfrcrange"])
def test_ranges_that_are_reversed_are_none_and_told(word: str) -> None:
    """As in MuJoCo, unless the file says that there is a limit; an end may be infinite."""
    text = mujoco_file(
        BODY.replace("<joint", f'<joint {word}="1 -1"'), "<compiler angle='radian'/>"
    )
    parts, told = read(text)
    assert told == ["the MJCF text, line 1: joint 'j': a range of 1 to -1 counts for none"]
    assert parts.model.lowerPositionLimit[0] == parts.model.lowerEffortLimit[0] == -np.inf
    with pytest.raises(MechanismError, match="has a range of nan to 1"):
        parts_from_mjcf(text.replace("1 -1", "nan 1"))
    assert read(text.replace("1 -1", "-inf 1"))[1] == []


def test_a_coordinate_and_a_joint_of_one_name_are_told_apart() -> None:
    text = mujoco_file(
        f"""<body><joint name="q" type="ball"/>{INERTIAL}</body>
        <body><joint name="q.x"/>{INERTIAL}</body>""",
        '<actuator><motor joint="q"/></actuator>',
    )
    with pytest.raises(MechanismError, match=r"joint 'q' is driven in 'q\.x', also a joint"):
        parts_from_mjcf(text)


def test_a_file_without_joints_is_no_mechanism() -> None:
    with pytest.raises(MechanismError, match="has no joints"):
        parts_from_mjcf(mujoco_file("<geom size='1'/>"))


def test_scenes_of_many_loose_bodies_are_refused_before_they_take_all_memory() -> None:
    loose = "<body><freejoint/><geom size='0.1'/></body>"
    text = mujoco_file(f"<replicate count='67' offset='1 0 0'>{loose}</replicate>")
    with pytest.raises(MechanismError, match=r"has 402 velocities; .* at most 400 are taken"):
        parts_from_mjcf(text)


def test_shapes_are_a_skeleton() -> None:
    from rps_pin.closed_loop.visuals import skeleton

    parts, _ = read(several())
    shapes = skeleton(ClosedLoopModel._from_parts(parts))
    assert shapes.ngeoms > 6
