"""Files of many kinds, against MuJoCo to rounding.

Compared are masses, bias, springs and dampers, dry friction, limits, home, and the equalities.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, MechanismError
from tests.closed_loop.io.mjcf.twin import (
    BODY,
    INERTIAL,
    Twin,
    equalities,
    fourbar,
    mujoco_file,
    read,
)
from tests.each import each
from tests.worst import worst


def link(name: str, joint: str, inside: str = "", more: str = "") -> str:
    return f'<body name="{name}" pos=".3 .1 0" {more}>{joint}{INERTIAL}{inside}</body>'


def hinge(name: str, more: str = "") -> str:
    return f'<joint name="{name}" axis="0.3 1 0.2" {more}/>'


def chain(*joints: str) -> str:
    """Bodies one on the other, with these joints."""
    inside = ""
    for number, joint in reversed([*enumerate(joints)]):
        inside = link(f"b{number}", joint, inside)
    return inside


def five(more: str = "") -> str:
    return chain(*(hinge(f"j{k}", more) for k in range(5)))


SHAPES = """<geom type="box" size=".1 .2 .05" pos=".1 0 0" euler="10 20 30" density="700"/>
    <geom type="capsule" size=".03" fromto="0 0 0 .1 .2 .3" contype="0" conaffinity="0" group="2"/>
    <geom type="ellipsoid" size=".1 .05 .2" mass=".3" group="3"/>"""
STONE = """<asset><mesh name="stone" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1 .1 .1 .2" {}/></asset>"""


def shaped(settings: str, shapes: str = SHAPES) -> str:
    return mujoco_file(
        f'<body name="a"><joint axis="1 2 3"/>{shapes}'
        f'<body name="c" pos="0 0 .2">{shapes}</body></body>',
        settings,
    )


ACTUATORS = """<actuator>
    <motor joint="j0" gear="-3" armature=".02" damping=".1" ctrlrange="-2 3"/>
    <position joint="j1" kp="40" dampratio="1" inheritrange=".5" forcerange="-5 4"/>
    <velocity joint="j1" kv="3"/>
    <intvelocity joint="j2" kp="10" actrange="-1 1"/>
    <damper joint="j2" kv="2" ctrlrange="0 1" armature=".03"/>
    <cylinder joint="j3" area="2" timeconst=".1"/>
    <muscle joint="j3" lengthrange="0 1" damping=".4" gear="2"/>
    <general joint="j4" gaintype="affine" gainprm="1 2 3" biastype="affine" biasprm="1 -2 -3"
      dyntype="filter" dynprm=".1"/>
    <dcmotor joint="j4" gear="20" motorconst="0.05" resistance="1.5" armature="1e-4"
      damping="1e-5"/>
    </actuator>"""
MANY = """<tendon>
    <fixed name="all" range="-1 2" limited="true" stiffness="3" springlength=".1" damping=".2">
      <joint joint="j0" coef="1"/><joint joint="j1" coef="-.5"/><joint joint="j2" coef="2"/>
      <joint joint="j3" coef=".3"/><joint joint="j4" coef="-1"/></fixed>
    <fixed name="twice"><joint joint="j1" coef=".5"/><joint joint="j3" coef=".25"/></fixed>
    <fixed name="two" frictionloss=".2"><joint joint="j4" coef="1"/><joint joint="j2" coef="1"/>
    </fixed>
    </tendon>"""
TREES = {
    "actuators of every kind": mujoco_file(five('range="-60 80"'), ACTUATORS),
    "actuators of classes": mujoco_file(
        five(),
        """<default><motor gear="2" armature=".1"/><default class="big">
        <motor gear="9" damping=".3"/><general armature=".2"/></default></default>""",
        """<actuator><motor joint="j0"/><motor class="big" joint="j1"/><motor class="big" joint="j1"
        gear="1"/><general class="big" joint="j2"/></actuator>""",
    ),
    "gravity of all bodies in part": mujoco_file(
        chain(hinge("j0"), hinge("j1")).replace("<body", '<body gravcomp=".7"'),
        '<option gravity="1 -2 3"/>',
    ),
    "Euler angles of fixed axes": mujoco_file(
        chain(hinge("j0"), '<joint type="ball"/>').replace("<body", '<body euler="10 -50 80"'),
        '<compiler eulerseq="ZYX"/>',
    ),
    "Euler angles in radians": mujoco_file(
        chain(hinge("j0", 'range="-1 2" ref=".4" stiffness="3"'), hinge("j1")).replace(
            "<body", '<body euler=".1 -.5 2"'
        ),
        '<compiler eulerseq="xzx" angle="radian"/>',
    ),
    "references in degrees": mujoco_file(
        chain(
            hinge("j0", 'range="-10 20" ref="40" springref="20" stiffness="3"'),
            '<joint type="slide" axis="1 1 0" ref=".4" springref=".2" stiffness="3" range="0 1"/>',
        )
    ),
    "limits told, not guessed": mujoco_file(
        chain(hinge("j0", 'range="-10 20" limited="true"'), hinge("j1", 'limited="false"')),
        '<compiler autolimits="false"/>',
    ),
    "springs by their time": mujoco_file(five('springdamper=".2 .7" stiffness="9"')),
    "inertia of shapes": shaped('<compiler inertiafromgeom="true"/>', SHAPES + INERTIAL),
    "inertia of no shapes": shaped('<compiler inertiafromgeom="false"/>', SHAPES + INERTIAL),
    "inertia of some shapes": shaped('<compiler inertiagrouprange="0 2"/>'),
    "springs of balls": mujoco_file(
        chain(hinge("j0"), '<joint type="ball" stiffness="3" damping=".2"/>')
    ),
    "shapes of no contact left out": shaped('<compiler discardvisual="true"/>'),
    "static bodies fused": shaped('<compiler fusestatic="true"/>'),
    "total mass": shaped('<compiler settotalmass="7"/>'),
    "least masses": shaped('<compiler boundmass=".5" boundinertia=".3"/>'),
    "full inertia": mujoco_file(
        """<body><joint axis="1 1 0" pos=".1 .2 0"/><inertial pos=".1 0 0" mass="2"
        xyaxes="1 1 0 0 0 1" diaginertia=".1 .2 .25"/><body pos="0 0 1"><joint/>
        <inertial pos=".1 0 .2" mass="2"
        fullinertia=".1 .2 .25 .01 -.02 .03"/></body></body>"""
    ),
    "meshes' inertia": shaped(
        STONE.format('scale="1 2 -1" inertia="exact"'),
        '<geom type="mesh" mesh="stone" pos=".1 0 0" density="300"/>',
    ),
    "meshes' shells": shaped(
        STONE.format('inertia="shell" refpos=".1 0 0" refquat="1 1 0 0"'),
        '<geom type="mesh" mesh="stone" euler="30 0 0" mass=".7"/>',
    ),
    "shells": shaped("", '<geom type="box" size=".1 .2 .3" shellinertia="true"/>'),
    "joints inside frames": mujoco_file(
        f"""<frame pos="1 0 0" euler="0 0 40"><frame quat="1 1 0 0"><body name="a" pos="0 1 0">
        <frame pos="0 .2 0" axisangle="1 1 0 70">{hinge("j0", 'pos=".1 0 0"')}
        <geom size=".1" pos=".2 0 0"/><site name="s" pos="0 0 1"/></frame>{hinge("j1")}</body>
        </frame></frame>"""
    ),
    "replicates in replicates": mujoco_file(
        f"""<replicate count="3" euler="0 0 30" offset=".1 0 0" sep="_"><body><joint name="a"/>
        {INERTIAL}<replicate count="2" offset="0 .2 0"><body pos="0 0 .3">
        <joint type="slide" name="b" axis="1 0 0" damping=".3"/>{INERTIAL}</body></replicate>
        </body></replicate>"""
    ),
    "several joints, and a ball at the end": mujoco_file(
        f"""<body name="a" quat="1 2 3 4">{hinge("x", 'pos=".1 0 0"')}
        <joint type="slide" axis="1 2 0"/>
        <joint type="ball" pos="0 .3 0" damping=".2" frictionloss=".1"/>{INERTIAL}
        <body name="c" pos="0 0 .3">{INERTIAL}</body></body>"""
    ),
    "free joints": mujoco_file(
        f"""<frame euler="20 0 0"><body pos="1 2 3" quat="1 1 0 0"><joint type="free" damping=".2"/>
        {INERTIAL}{link("x", hinge("j"))}</body></frame>
        <body><freejoint align="true"/><geom size=".1"/><geom size=".2" pos="1 0 0"/></body>
        <body><joint type="free" armature=".3"/>{INERTIAL}</body>"""
    ),
    "key frames": mujoco_file(
        f'{BODY}<body><joint type="ball"/>{INERTIAL}</body>',
        """<keyframe><key name="a" qpos="1 1 2 3 4"/><key qpos="2 1 0 0 0"/>
        <key name="home" qpos=".3 0 2 0 0" qvel="1 2 3 4"/></keyframe>""",
    ),
    "tendons of many joints": mujoco_file(five('ref="20"'), MANY),
    "motors on tendons": mujoco_file(
        five('ref="20"'),
        MANY,
        """<actuator><motor tendon="all" gear="-3" armature=".02" damping=".3" forcerange="-1 2"/>
        <position tendon="all" kp="3" gear="2" armature=".1"/>
        <motor tendon="twice" ctrlrange="-1 1"/><motor joint="j1"/></actuator>""",
    ),
    "what does not matter": mujoco_file(
        five('margin=".1" solreflimit=".1 1" group="3" user="1 2"'),
        """<option integrator="implicit" timestep=".1" cone="elliptic" magnetic="1 2 3">
        <flag contact="disable" warmstart="disable" energy="enable"/></option>
        <size memory="1M"/><statistic extent="2"/><visual><map znear=".1"/></visual>
        <custom><numeric name="x" data="1 2"/><text name="t" data="u"/></custom>
        <contact><exclude body1="b0" body2="b2"/></contact>
        <sensor><jointpos joint="j0"/><framepos objtype="body" objname="b1"/></sensor>""",
    ),
    "no gravity": mujoco_file(
        five('stiffness="2" damping="1"'), '<option><flag gravity="disable"/></option>'
    ),
    "forces of actuators bounded at the joint": mujoco_file(
        five('actuatorfrcrange="-2 3"'), '<actuator><motor joint="j0" gear="5"/></actuator>'
    ),
    "names that others have": mujoco_file(
        chain(*(f'<joint name="{n}"/>' for n in ("universe", "world", "b1", "b1_joint", "a/b c.x")))
    ),
}


@each(("text"), TREES.values())
def test_trees_are_mujocos(text: str) -> None:
    twin = Twin(text)
    rng = np.random.default_rng(0)
    for _ in range(3):
        twin.random(rng)
        for own, right in (twin.masses(), twin.bias(), twin.passive()):
            assert worst(own - right) < 1e-12 * max(1.0, worst(right))
    m = twin.m
    size = {0: 6, 1: 3, 2: 1, 3: 1}
    at = 0
    for number, kind in enumerate(m.jnt_type):
        dof = m.jnt_dofadr[number]
        assert at == dof
        at += size[int(kind)]
        np.testing.assert_array_equal(
            twin.effects().friction[dof:at], m.dof_frictionloss[dof:at], strict=True
        )
        if size[int(kind)] == 1:
            limits = m.jnt_range[number] if m.jnt_limited[number] else (-np.inf, np.inf)
            place = int(m.jnt_qposadr[number])
            assert twin.model.lowerPositionLimit[place] == limits[0]
            assert twin.model.upperPositionLimit[place] == limits[1]
    key = [k for k in range(m.nkey) if m.key(k).name == "home"]
    qpos = m.key_qpos[key[0]].copy() if key else m.qpos0
    mujoco.mj_normalizeQuat(m, qpos)
    twin.set(qpos, np.zeros(m.nv))
    np.testing.assert_allclose(twin.parts.home, twin.q, atol=1e-15)


# Equalities ---------------------------------------------------------------------------------------

PLATE = f"""<body name="plate" pos=".9 .1 0"><joint name="slide" type="slide" axis="1 0 0"/>
    <joint name="ball" type="ball"/>{INERTIAL}<site name="edge" pos=".2 0 0"/>
    <body name="rim" pos="0 .1 0">{INERTIAL}</body></body>"""
SUMS = """<tendon>
    <fixed name="sum"><joint joint="j1" coef=".5"/><joint joint="j2" coef="-2"/></fixed>
    <fixed name="more"><joint joint="j3" coef="3"/><joint joint="slide" coef="1"/></fixed>
    </tendon>"""


def loops(*elements: str, joint: str = "", more: str = "") -> str:
    text = fourbar(more, SUMS, equalities(*elements), joint=joint)
    return text.replace("</worldbody>", f"{PLATE}</worldbody>")


REPLICATED = f"""<replicate count="2" offset="0 1 0"><body name="a"><joint name="j"/>{INERTIAL}
    <body name="b" pos=".3 0 0"><joint/>{INERTIAL}<site name="tip" pos=".3 0 0"/></body></body>
    <site name="pin" pos=".5 .1 0"/></replicate>"""
LOOPS = {
    "a fixed body of a moving one": loops('<connect body1="coupler" body2="rim" anchor=".4 0 0"/>'),
    "a weld to a fixed body": loops('<weld body1="rim" body2="rocker" torquescale=".1"/>'),
    "a weld at an anchor": loops(
        '<weld body1="plate" body2="coupler" anchor=".1 .2 0" relpose="0 .1 0 1 0 .2 0"/>'
    ),
    "sites of the world": mujoco_file(
        REPLICATED + '<site name="post" pos=".4 .1 0"/>',
        equalities('<connect site1="tip0" site2="post"/>', '<connect site1="pin1" site2="tip1"/>'),
    ),
    "a joint held where it has a reference": loops(
        '<joint joint1="j1" polycoef=".2"/>', joint='ref="30"'
    ),
    "a curve of references": loops(
        '<joint joint1="slide" joint2="j1" polycoef=".1 .3 -.2 .1 .05"/>', joint='ref="30"'
    ),
    "tendons of two": loops('<tendon tendon1="more" tendon2="sum" polycoef=".1 -1.5"/>'),
    "a curve of tendons": loops('<tendon tendon1="more" tendon2="sum" polycoef=".1 -1.5 .3"/>'),
    "some, and some that are not active": loops(
        '<connect body1="coupler" body2="rocker" anchor=".4 0 0" class="off"/>',
        '<weld body1="plate" class="off" active="true"/>',
        '<joint joint1="j1" joint2="j3"/>',
        more='<default><default class="off"><equality active="false"/></default></default>',
    ),
    "rods": loops('<tendon tendon1="rod" polycoef=".02"/>').replace(
        "</tendon>",
        '<spatial name="rod"><site site="tip"/><site site="edge"/></spatial></tendon>',
    ),
}


@each("text", LOOPS.values())
def test_loops_are_mujocos(text: str) -> None:
    """Where they are closed, MuJoCo's residual is zero and its rows span the same space."""
    mechanism, twin = ClosedLoopModel.from_mjcf(text, actuated=[]), Twin(text)
    rng = np.random.default_rng(0)
    for _ in range(3):
        guess = pin.integrate(
            mechanism.model, mechanism.home, 0.1 * rng.normal(size=mechanism.model.nv)
        )
        q = mechanism.close(guess)
        qpos = q[: twin.m.nq].copy()
        for kind, at in zip(twin.m.jnt_type, twin.m.jnt_qposadr, strict=True):
            if kind == 1:
                qpos[at : at + 4] = q[[at + 3, at, at + 1, at + 2]]
        twin.set(qpos, np.zeros(twin.m.nv))
        assert len(twin.gaps()) > 0
        assert worst(twin.gaps()) < 1e-9
        own, right = twin.rows()
        spaces = []
        for rows in (own, right):
            _, sizes, motions = np.linalg.svd(rows)
            rank = int((sizes > 1e-8).sum())
            spaces.append(motions[:rank].T @ motions[:rank])
        assert worst(spaces[0] - spaces[1]) < 1e-9


# Several files ------------------------------------------------------------------------------------

FILES = {
    "hand.xml": f"""<mujoco model="hand"><compiler angle="radian" eulerseq="zyx"/>
      <default><joint damping=".3"/></default><worldbody><body name="palm" euler=".1 .2 .3">
      <joint name="wrist" range="-1 2" ref=".2"/>{INERTIAL}<site name="grip" pos=".1 0 0"/></body>
      </worldbody><equality><joint joint1="wrist" polycoef=".4"/></equality>
      <actuator><motor name="m" joint="wrist" gear="7" armature=".1"/></actuator></mujoco>""",
    "parts/shapes.xml": """<mujoco><default><geom density="300"/></default><include
      file="parts/more.xml"/></mujoco>""",
    "parts/more.xml": f"""<mujoco><worldbody>{BODY}</worldbody><actuator><position joint="j" kp="3"
      armature=".2"/></actuator></mujoco>""",
    "scene.xml": """<mujoco><compiler angle="degree"/><include file="parts/shapes.xml"/>
      <asset><model name="hand" file="hand.xml"/></asset><worldbody>
      <body name="left" pos="0 1 0" euler="0 0 90"><joint name="shoulder" range="-30 40"/>
        <geom size=".1"/><attach model="hand" body="palm" prefix="l-"/></body>
      <frame pos="1 0 0" euler="0 40 0"><attach model="hand" body="palm" prefix="r-"/></frame>
      </worldbody></mujoco>""",
}


def test_included_and_attached_files_are_mujocos(tmp_path: Path) -> None:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    twin = Twin(tmp_path / "scene.xml")
    assert twin.parts.actuated == ("j", "l-wrist", "r-wrist")
    assert len(twin.parts.closures) == 2
    rng = np.random.default_rng(0)
    for _ in range(3):
        twin.random(rng)
        for own, right in (twin.masses(), twin.bias(), twin.passive(), twin.rows()):
            assert worst(own - right) < 1e-12 * max(1.0, worst(right))


# Refused ------------------------------------------------------------------------------------------

REFUSED = {
    "composite": mujoco_file(
        '\n<body><composite type="cable" count="5 1 1" curve="s" size="1"/></body>'
    ),
    "flexcomp": mujoco_file(
        BODY + '\n<flexcomp name="f" type="grid" count="3 3 1" spacing=".1 .1 .1" dim="2"/>'
    ),
    "density": mujoco_file(BODY, '\n<option density="1.2"/>'),
    "gravcomp": mujoco_file('<body gravcomp="1"><joint/><geom size="1"/></body>\n' + BODY),
    "springyield": mujoco_file(
        '\n<body><joint type="ball" stiffness="1" springyield="3"/><geom size=".1"/></body>'
    ),
    "springlength": mujoco_file(
        BODY,
        '<tendon>\n<fixed stiffness="1" springlength="0 1"><joint joint="j" coef="1"/></fixed>'
        "</tendon>",
    ),
    "lenght": mujoco_file('\n<body lenght="1"/>' + BODY),
    "joint2": mujoco_file(BODY, '<equality>\n<joint joint1="j" joint2="k"/></equality>'),
}


@each("text", REFUSED.values())
def test_what_is_not_read_is_refused_with_its_line(text: str) -> None:
    with pytest.raises(MechanismError, match="line 2"):
        read(text)
