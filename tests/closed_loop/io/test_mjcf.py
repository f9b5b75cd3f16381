"""MuJoCo's files, against MuJoCo itself: masses, forces, places, and the rows of equalities."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, LoopClosure, MechanismError
from rps_pin.closed_loop.constraints.closures import JointCoupling
from rps_pin.closed_loop.io.mjcf import parts_from_mjcf
from rps_pin.closed_loop.io.parts import MechanismParts
from tests.each import each

Array = NDArray[np.float64]

INERTIAL = '<inertial pos="0.1 0.02 -0.03" mass="1.3" diaginertia="0.02 0.03 0.04"/>'
BODY = f'<body name="b"><joint name="j"/>{INERTIAL}</body>'


def mujoco_file(world: str, *others: str) -> str:
    return f'<mujoco model="m">{"".join(others)}<worldbody>{world}</worldbody></mujoco>'


def fourbar(*others: str, joint: str = "") -> str:
    """Crank, coupler and rocker, drawn closed; equalities and the like are for `others`."""
    return mujoco_file(
        f"""<body name="crank" pos="0 0 0.2"><joint name="j1" axis="0 1 0" {joint}/>{INERTIAL}
          <body name="coupler" pos="0.3 0 0"><joint name="j2" axis="0 1 0"/>{INERTIAL}
            <site name="tip" pos="0.4 0 0" euler="10 20 30"/></body></body>
        <body name="rocker" pos="0.7 0 0.2" quat="1 0 0.3 0">
          <joint name="j3" axis="0 1 0" pos="0 0 -0.2"/>{INERTIAL}
          <site name="knee" pos="0 0 0.1" zaxis="1 2 3"/></body>""",
        *others,
    )


def geoms(settings: str = "") -> str:
    """Bodies whose masses are those of their shapes, each placed in another way."""
    return mujoco_file(
        """<geom type="plane" size="1 1 1"/>
        <body name="a" euler="10 20 30" pos="1 2 3"><joint name="ja" axis="1 2 3"/>
          <geom size="0.1"/><geom type="capsule" size="0.05" fromto="0 0 0 0.3 0.1 -0.2"/>
          <frame pos="0.1 0 0" axisangle="0 2 0 40">
            <geom type="box" size="0.1 0.2 0.3" xyaxes="1 1 0 0 1 0" density="200"/>
            <frame euler="5 6 7"><body name="b" pos="0 0 0.4" zaxis="1 -1 0.5">
              <joint name="jb" type="slide" axis="0 1 1" armature="0.7"/>
              <geom type="cylinder" size="0.1 0.3" mass="2" pos="0.1 0 0"/>
              <geom type="ellipsoid" size="0.1 0.2 0.3" zaxis="0 0 -1"/>
              <geom type="box" size="0.1 0.2" fromto="0 0 0 0.3 0.1 -0.2" group="4"/>
            </body></frame></frame></body>
        <body><site name="rod" type="capsule" size="0.1" fromto="0 0 0 0.3 0.1 -0.2"/>
          <joint type="ball" name="jc" pos="0.1 0.2 0"/><geom type="capsule" size="0.1 0.2"/>
          <body name="d" pos="0.3 0 0"><geom size="0.07" pos="0 0 1"/></body></body>""",
        settings,
    )


DEFAULTS = """<default><joint axis="0 1 0" damping="0.3" armature="0.01"/>
    <geom type="box" size="0.1 0.2 0.3" quat="1 1 0 0"/><site pos="0.1 0 0"/>
    <default class="arm"><joint damping="2" frictionloss="0.4"/><geom size="0.2" euler="10 0 0"/>
      <default class="hand"><joint type="slide" stiffness="3" springref="0.2"/></default>
    </default></default>"""


def defaults(*others: str) -> str:
    return mujoco_file(
        """<body name="a" childclass="arm"><joint name="ja"/><geom/>
          <body name="b"><joint name="jb" class="hand"/><geom class="main"/><site name="s"/>
            <body name="c" childclass="hand"><joint name="jc" range="-1 2"/><geom/></body></body>
        </body><body name="e"><joint name="je" stiffness="2" springref="30"/><geom/></body>""",
        DEFAULTS,
        *others,
    )


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


def free() -> str:
    return mujoco_file(
        f"""<frame pos="0 0 1"><body name="a" pos="0.1 0 0" euler="0 30 0"><freejoint name="fly"/>
          {INERTIAL}<body name="b" pos="0.3 0 0"><joint name="jb" axis="0 1 0"/>{INERTIAL}</body>
        </body></frame><body name="box"><joint type="free" armature="0.2"/><geom size="0.1"/>
        </body>""",
        '<keyframe><key name="up" qpos="1 2 3 0 2 0 0 0.4 0 0 0 0.5 0.5 0.5 0.5"/></keyframe>',
    )


SETTINGS = (
    '<compiler angle="radian" eulerseq="zYx" inertiafromgeom="true"/><option gravity="1 2 -3"/>'
)
TREES = {
    "fourbar": fourbar(),
    "geoms": geoms(),
    "geoms in radians": geoms(SETTINGS),
    "geoms of some groups": geoms('<compiler inertiagrouprange="0 3"/>'),
    "defaults": defaults(),
    "defaults called main": defaults().replace("<default>", '<default class="main">', 1),
    "several": several(),
    "free": free(),
}
every_tree = pytest.mark.parametrize("text", TREES.values(), ids=TREES)


class Twin:
    """A file as MuJoCo has it, and maps from Pinocchio's coordinates to MuJoCo's."""

    def __init__(self, text: str, parts: MechanismParts) -> None:
        self.m = mujoco.MjModel.from_xml_string(text)
        self.d = mujoco.MjData(self.m)
        self.model = parts.model
        self.data = parts.model.createData()

    def set(self, q: Array, v: Array) -> Array:
        """Put MuJoCo in a state; return T with MuJoCo's velocity = T v."""
        T = np.zeros((self.m.nv, self.model.nv))
        qpos, row, start = [], 0, 0
        for i, kind in enumerate(self.m.jnt_type):  # in this order in both, as the tests check
            joint = self.model.joints[i + 1]
            own = q[joint.idx_q : joint.idx_q + joint.nq]
            block = np.eye(joint.nv)
            if kind == mujoco.mjtJoint.mjJNT_FREE:
                block[:3, :3] = pin.Quaternion(own[3:]).toRotationMatrix()
                own = np.concatenate([own[:3], own[[6, 3, 4, 5]]])
            elif kind == mujoco.mjtJoint.mjJNT_BALL:
                own = own[[3, 0, 1, 2]]
            T[row : row + joint.nv, joint.idx_v : joint.idx_v + joint.nv] = block
            qpos.append(own)
            row, start = row + joint.nv, start + joint.nq
        self.d.qpos[:], self.d.qvel[:] = np.concatenate(qpos), T @ v
        mujoco.mj_forward(self.m, self.d)
        return T


def states(model: pin.Model, seed: int, count: int = 5) -> list[tuple[Array, Array]]:
    rng = np.random.default_rng(seed)
    return [
        (
            pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv)),
            rng.normal(size=model.nv),
        )
        for _ in range(count)
    ]


@every_tree
def test_masses_and_gravity_are_mujocos(text: str) -> None:
    parts = parts_from_mjcf(text)
    twin = Twin(text, parts)
    assert [j.nv for j in parts.model.joints][1:] == [
        {0: 6, 1: 3, 2: 1, 3: 1}[kind] for kind in twin.m.jnt_type
    ]
    for q, v in states(parts.model, 0):
        T = twin.set(q, v)
        full = np.zeros((twin.m.nv, twin.m.nv))
        mujoco.mj_fullM(twin.m, twin.d, full)
        mass = pin.crba(parts.model, twin.data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        scale = np.abs(full).max()
        np.testing.assert_allclose(T.T @ full @ T, mass, rtol=1e-9, atol=1e-12 * scale)
        twin.d.qvel[:] = 0
        mujoco.mj_forward(twin.m, twin.d)
        gravity = pin.computeGeneralizedGravity(parts.model, twin.data, q)
        scale = np.abs(gravity).max()
        np.testing.assert_allclose(T.T @ twin.d.qfrc_bias, gravity, rtol=1e-9, atol=1e-12 * scale)


@every_tree
def test_velocity_forces_are_mujocos(text: str) -> None:
    """With v_m = T v of MuJoCo's free joints, a = 0 is a_m = T' v: their linear part is R w x v."""
    parts = parts_from_mjcf(text)
    twin = Twin(text, parts)
    for q, v in states(parts.model, 1):
        T = twin.set(q, v)
        drift = np.zeros(twin.m.nv)
        for joint in list(parts.model.joints)[1:]:
            if joint.nv == 6:
                part = slice(joint.idx_v, joint.idx_v + 3)
                linear, angular = v[joint.idx_v : joint.idx_v + 6].reshape(2, 3)
                drift[part] = T[part, part] @ np.cross(angular, linear)
        full = np.zeros((twin.m.nv, twin.m.nv))
        mujoco.mj_fullM(twin.m, twin.d, full)
        bias = pin.nonLinearEffects(parts.model, twin.data, q, v)
        # Of a rotor on a free joint MuJoCo's axes feel it in the world, Pinocchio's in the body.
        full -= np.diag(twin.m.dof_armature)
        expected = T.T @ (twin.d.qfrc_bias + full @ drift)
        scale = np.abs(bias).max()
        np.testing.assert_allclose(expected, bias, rtol=1e-9, atol=1e-12 * scale)


@every_tree
def test_bodies_and_sites_stand_where_mujoco_has_them(text: str) -> None:
    parts = parts_from_mjcf(text)
    twin = Twin(text, parts)
    frames = {frame.name for frame in parts.model.frames}
    for q, v in states(parts.model, 2):
        twin.set(q, v)
        pin.framesForwardKinematics(parts.model, twin.data, q)
        seen = 0
        for kind, places, rotations in (
            ("body", twin.d.xpos, twin.d.xmat),
            ("site", twin.d.site_xpos, twin.d.site_xmat),
        ):
            for i in range(len(places)):
                name = getattr(twin.m, kind)(i).name
                name = f"{name}_{kind}" if f"{name}_{kind}" in frames else name
                if not name:
                    continue
                placement = twin.data.oMf[parts.model.getFrameId(name)]
                np.testing.assert_allclose(placement.translation, places[i], atol=1e-12)
                np.testing.assert_allclose(placement.rotation.ravel(), rotations[i], atol=1e-12)
                seen += 1
        assert seen >= 3


@every_tree
def test_limits_losses_and_springs_are_mujocos(text: str) -> None:
    parts = parts_from_mjcf(text)
    m = mujoco.MjModel.from_xml_string(text)
    for i in range(m.njnt):
        joint, name = parts.model.joints[i + 1], parts.model.names[i + 1]
        dof = m.jnt_dofadr[i]
        assert parts.damping.get(name, 0) == m.dof_damping[dof].ravel()[0]
        assert parts.friction.get(name, 0) == m.dof_frictionloss[dof]
        assert parts.stiffness.get(name, 0) == m.jnt_stiffness[i].ravel()[0]
        if name in parts.rest:
            assert parts.rest[name] == pytest.approx(m.qpos_spring[m.jnt_qposadr[i]], rel=1e-15)
        armature = parts.model.armature[joint.idx_v : joint.idx_v + joint.nv]
        np.testing.assert_array_equal(armature, m.dof_armature[dof : dof + joint.nv])
        if joint.nq == 1:
            limits = m.jnt_range[i] if m.jnt_limited[i] else (-np.inf, np.inf)
            own = (parts.model.lowerPositionLimit, parts.model.upperPositionLimit)
            np.testing.assert_allclose([limit[joint.idx_q] for limit in own], limits, rtol=1e-15)
    np.testing.assert_array_equal(parts.model.gravity.linear, m.opt.gravity)
    assert not parts.model.damping.any()  # it is in the parts, and should not count twice


@every_tree
def test_the_home_is_qpos0(text: str) -> None:
    parts = parts_from_mjcf(text)
    twin = Twin(text, parts)
    twin.set(parts.home, np.zeros(parts.model.nv))
    np.testing.assert_allclose(twin.d.qpos, twin.m.qpos0, atol=1e-15)


def test_key_frames_are_configurations() -> None:
    parts = parts_from_mjcf(free())
    twin = Twin(free(), parts)
    twin.set(parts.model.referenceConfigurations["up"], np.zeros(parts.model.nv))
    unit = np.array([1, 2, 3, 0, 1, 0, 0, 0.4, 0, 0, 0, 0.5, 0.5, 0.5, 0.5])
    np.testing.assert_allclose(twin.d.qpos, unit, atol=1e-15)
    home = parts_from_mjcf(free().replace('"up"', '"home"')).home
    np.testing.assert_array_equal(home, parts.model.referenceConfigurations["up"])


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
    own = model.lowerPositionLimit[0], model.upperPositionLimit[0]
    np.testing.assert_allclose(own, position, rtol=1e-15)
    own = model.lowerEffortLimit[0], model.upperEffortLimit[0]
    effort = m.jnt_actfrcrange[0] if m.jnt_actfrclimited[0] else (-np.inf, np.inf)
    np.testing.assert_allclose(own, effort, rtol=1e-15)


def test_limits_that_may_or_may_not_hold_are_refused() -> None:
    """As MuJoCo does."""
    text = mujoco_file(BODY.replace('"j"', '"j" range="1 2"'), '<compiler autolimits="false"/>')
    with pytest.raises(MechanismError, match="has a range, but autolimits is off and limited is"):
        parts_from_mjcf(text)
    with pytest.raises(ValueError, match="limited"):
        mujoco.MjModel.from_xml_string(text)


def test_gravity_can_be_off() -> None:
    text = mujoco_file(BODY, '<option gravity="1 2 3"/>', "<option><flag {}/></option>")
    assert not parts_from_mjcf(text.format('gravity="disable"')).model.gravity.linear.any()
    on = parts_from_mjcf(text.format('gravity="enable"')).model.gravity.linear
    np.testing.assert_array_equal(on, [1, 2, 3])


def test_what_is_drawn_inside_massless_bodies_is_kept() -> None:
    """A link without mass, which MuJoCo refuses, is a link without mass."""
    parts = parts_from_mjcf(mujoco_file(f'<body name="a"><joint name="i"/>{BODY}</body>'))
    assert parts.model.inertias[1].mass == 0
    assert parts.model.inertias[2].mass == 1.3


# Equalities ---------------------------------------------------------------------------------------


def equalities(*elements: str) -> str:
    return f"<equality>{''.join(elements)}</equality>"


def with_references(text: str) -> str:
    return text.replace('name="j2"', 'name="j2" ref="20"').replace(
        'name="j3"', 'name="j3" ref="-30"'
    )


CONNECTS = {
    "bodies": '<connect body1="coupler" body2="rocker" anchor="0.4 0 0"/>',
    "reversed": '<connect body1="rocker" body2="coupler" anchor="0.1 0.2 0.3"/>',
    "to the world": '<connect name="pin" body1="coupler" anchor="0.4 0.1 0"/>',
    "from the world": '<connect body1="world" body2="rocker" anchor="0.4 0.1 0"/>',
    "sites": '<connect site1="tip" site2="knee"/>',
}
WELDS = {
    "bodies": '<weld body1="coupler" body2="rocker"/>',
    "anchor": '<weld body1="coupler" body2="rocker" anchor="0.1 0.2 0.3" torquescale="0.5"/>',
    "relpose": '<weld body1="coupler" body2="rocker" relpose="0.1 0.2 0.3 1 0.2 0.3 0.4"/>',
    "both": '<weld body1="coupler" body2="rocker" anchor="1 2 0" relpose="1 0 2 0 0 1 1"/>',
    "to the world": '<weld body1="rocker"/>',
    "sites": '<weld site1="tip" site2="knee"/>',
}
JOINTS = {
    "plain": '<joint joint1="j1" joint2="j3"/>',
    "line": '<joint joint1="j2" joint2="j3" polycoef="0.3 -1.7 0 0 0"/>',
    "short": '<joint joint1="j3" joint2="j2" polycoef="0.3"/>',
}


def frames_of(parts: MechanismParts, closure: LoopClosure, q: Array) -> tuple[pin.SE3, pin.SE3]:
    data = parts.model.createData()
    pin.framesForwardKinematics(parts.model, data, q)
    a, b = (parts.model.getFrameId(name) for name in (closure.frame_a, closure.frame_b))
    return data.oMf[a], data.oMf[b]


def velocity_rows(parts: MechanismParts, closure: LoopClosure, q: Array) -> Array:
    """World velocities of the points of frames a less those of b; shape (6, nv)."""
    data = parts.model.createData()
    pin.computeJointJacobians(parts.model, data, q)
    pin.updateFramePlacements(parts.model, data)
    a, b = (
        pin.getFrameJacobian(
            parts.model, data, parts.model.getFrameId(name), pin.LOCAL_WORLD_ALIGNED
        )
        for name in (closure.frame_a, closure.frame_b)
    )
    return a - b


def equality_rows(twin: Twin) -> tuple[Array, Array]:
    rows = twin.d.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    return twin.d.efc_pos[rows], twin.d.efc_J.reshape(-1, twin.m.nv)[rows]


DENSE = '<option jacobian="dense"/>'


@pytest.mark.parametrize("element", CONNECTS.values(), ids=CONNECTS)
def test_a_connect_is_a_spherical_closure(element: str) -> None:
    text = with_references(fourbar(equalities(element), DENSE))
    parts = parts_from_mjcf(text)
    (closure,) = parts.closures
    assert isinstance(closure, LoopClosure) and closure.kind == "spherical"
    twin = Twin(text, parts)
    for q, v in states(parts.model, 3):
        twin.set(q, v)
        a, b = frames_of(parts, closure, q)
        gap, rows = equality_rows(twin)
        np.testing.assert_allclose(a.translation - b.translation, gap, atol=1e-12)
        np.testing.assert_allclose(velocity_rows(parts, closure, q)[:3], rows, atol=1e-12)


@pytest.mark.parametrize("element", WELDS.values(), ids=WELDS)
def test_a_weld_is_a_rigid_closure(element: str) -> None:
    text = with_references(fourbar(equalities(element), DENSE))
    parts = parts_from_mjcf(text)
    (closure,) = parts.closures
    assert isinstance(closure, LoopClosure) and closure.kind == "rigid"
    twin = Twin(text, parts)
    scale = float(twin.m.eq_data[0, 10])  # torquescale
    for q, v in states(parts.model, 4):
        twin.set(q, v)
        a, b = frames_of(parts, closure, q)
        gap, rows = equality_rows(twin)
        np.testing.assert_allclose(a.translation - b.translation, gap[:3], atol=1e-12)
        np.testing.assert_allclose(velocity_rows(parts, closure, q)[:3], rows[:3], atol=1e-12)
        turn = pin.Quaternion(b.rotation.T @ a.rotation).coeffs()
        sine = turn[:3] * np.sign(turn[3])  # MuJoCo's measure: sin of half the angle
        np.testing.assert_allclose(
            np.linalg.norm(scale * sine), np.linalg.norm(gap[3:]), atol=1e-12
        )


@pytest.mark.parametrize("element", JOINTS.values(), ids=JOINTS)
@pytest.mark.parametrize("angle", ["degree", "radian"])
def test_a_joint_equality_is_a_coupling(element: str, angle: str) -> None:
    text = with_references(
        fourbar(equalities(element), DENSE, f'<compiler angle="{angle}"/>', joint='ref="0.3"')
    )
    parts = parts_from_mjcf(text)
    (coupling,) = parts.closures
    assert isinstance(coupling, JointCoupling)
    twin = Twin(text, parts)
    index = {name: i - 1 for i, name in enumerate(parts.model.names)}
    i, j = index[coupling.joint], index[coupling.other]
    for q, v in states(parts.model, 5):
        twin.set(q, v)
        gap, rows = equality_rows(twin)
        own = np.zeros(parts.model.nv)
        own[i], own[j] = 1, -coupling.ratio
        np.testing.assert_allclose(q[i] - coupling.ratio * q[j] - coupling.offset, gap, atol=1e-12)
        np.testing.assert_allclose(own, rows[0], atol=1e-12)


@pytest.mark.parametrize(
    "element",
    ['<joint joint1="j2" polycoef="0.4"/>', '<joint joint1="j2" joint2="j3" polycoef="0.4 0"/>'],
)
def test_a_joint_held_by_an_equality_leaves_the_tree(element: str) -> None:
    """What is left has MuJoCo's masses with that joint at rest there."""
    text = with_references(fourbar(equalities(element), joint='damping="1"'))
    parts = parts_from_mjcf(text)
    assert list(parts.model.names) == ["universe", "j1", "j3"]
    assert parts.closures == ()
    assert parts.home == pytest.approx([0, np.radians(-30)])
    m = mujoco.MjModel.from_xml_string(text)
    d = mujoco.MjData(m)
    d.qpos[:] = 0.2, 0.4 + np.radians(20), 0.5
    mujoco.mj_forward(m, d)
    full = np.zeros((3, 3))
    mujoco.mj_fullM(m, d, full)
    mass = pin.crba(parts.model, parts.model.createData(), np.array([0.2, 0.5]))
    np.testing.assert_allclose(np.diag(mass), full[[0, 2], [0, 2]], rtol=1e-12)


def test_equalities_that_are_not_active_are_left_out() -> None:
    off = CONNECTS["bodies"].replace("/>", ' active="false"/>')
    assert parts_from_mjcf(fourbar(equalities(off))).closures == ()
    by_class = '<default class="off"><equality active="false"/></default>'
    text = fourbar(
        f"<default>{by_class}</default>",
        equalities(
            CONNECTS["sites"].replace("/>", ' class="off"/>'),
            CONNECTS["bodies"].replace("/>", ' name="on"/>'),
        ),
    )
    m = mujoco.MjModel.from_xml_string(text)
    assert list(m.eq_active0) == [0, 1]
    assert [closure.name for closure in parts_from_mjcf(text).closures] == ["on"]


def test_closures_given_come_after_the_files() -> None:
    more = LoopClosure("tip", "knee", "planar")
    parts = parts_from_mjcf(fourbar(equalities(CONNECTS["to the world"])), closures=[more])
    assert [closure.name for closure in parts.closures] == ["pin", "tip = knee"]
    assert parts.closures[0].frame_a == "pin:1"


# Actuators ----------------------------------------------------------------------------------------


def test_actuated_joints_are_those_of_the_actuators() -> None:
    actuators = """<actuator><motor joint="j3"/><!-- twice --><position joint="j1" kp="3"/>
        <velocity jointinparent="j3"/></actuator>"""
    assert parts_from_mjcf(fourbar(actuators)).actuated == ("j3", "j1")
    assert parts_from_mjcf(fourbar(actuators), actuated=["j2"]).actuated == ("j2",)
    assert parts_from_mjcf(fourbar()).actuated == ()


def test_actuators_on_other_things_are_refused_unless_joints_are_named() -> None:
    text = fourbar('<actuator><motor name="pull" site="tip"/></actuator>')
    with pytest.raises(MechanismError, match=r"line 1: motor 'pull' acts on a site, not on a jo"):
        parts_from_mjcf(text)
    assert parts_from_mjcf(text, actuated="j1").actuated == ("j1",)
    with pytest.raises(MechanismError, match=r"no joint 'j9'; there are: j1, j2, j3"):
        parts_from_mjcf(fourbar('<actuator><motor joint="j9"/></actuator>'))


# What is refused ----------------------------------------------------------------------------------

REFUSED = {
    "other equality": (
        fourbar(equalities('<flex flex="f"/>')),
        "flex is an equality that is not read; read are: connect, weld, joint",
    ),
    "curve": (
        fourbar(equalities('<joint joint1="j1" joint2="j2" polycoef="0 1 2"/>')),
        "couples by a curve",
    ),
    "unknown body": (
        fourbar(equalities('<weld body1="crnk"/>')),
        "body1: no body 'crnk'; there are: crank, coupler, rocker, world",
    ),
    "unknown site": (
        fourbar(equalities('<connect site1="tip" site2="tap"/>')),
        "site2: no site 'tap'; there are: tip, knee",
    ),
    "unknown joint": (
        fourbar(equalities('<joint joint1="j7"/>')),
        "joint1: no joint 'j7'; there are: j1, j2, j3",
    ),
    "unknown class": (
        mujoco_file(BODY.replace("<joint", '<joint class="x"')),
        "joint 'j' is of class 'x'; there are: main",
    ),
    "no body": (fourbar(equalities("<weld/>")), "weld needs a body1"),
    "no anchor": (fourbar(equalities('<connect body1="crank"/>')), "connect needs an anchor"),
    "itself": (fourbar(equalities('<weld body1="crank" body2="crank"/>')), "a body to itself"),
    "nan": (mujoco_file(BODY.replace('mass="1.3"', 'mass="nan"')), "mass = 'nan' must be finite"),
    "word": (mujoco_file(BODY.replace('mass="1.3"', 'mass="x"')), "mass = 'x' must be finite"),
    "two numbers": (mujoco_file(BODY.replace('name="b"', 'pos="1 2"')), "must be 3 numbers"),
    "heavy air": (mujoco_file(BODY, '<option density="1.2"/>'), "option has a density"),
    "include": (mujoco_file(BODY, '<include file="x.xml"/>'), "include is not read"),
    "replicate": (mujoco_file(f'<replicate count="3">{BODY}</replicate>'), "replicate is not"),
    "composite": (mujoco_file("<body><composite/></body>"), "composite is not read"),
    "mesh": (
        mujoco_file('<body><joint/><geom type="mesh" mesh="m"/></body>'),
        "geom is a mesh whose mass is not computed",
    ),
    "gravcomp": (mujoco_file(BODY.replace('"b"', '"b" gravcomp="1"')), "has gravcomp"),
    "mocap": (mujoco_file(BODY.replace('"b"', '"b" mocap="true"')), "motion capture"),
    "type": (
        mujoco_file(BODY.replace('"j"', '"j" type="screw"')),
        "type = 'screw'; it can be: hinge, slide, ball, free",
    ),
    "total mass": (mujoco_file(BODY, '<compiler settotalmass="3"/>'), "settotalmass = '3'"),
    "two orientations": (
        mujoco_file(BODY.replace('"b"', '"b" quat="1 0 0 0" euler="0 0 0"')),
        "more than one orientation: quat, euler",
    ),
    "no rigid body": (
        mujoco_file(BODY.replace('0.02 0.03 0.04"', '0.02 0.03 0.4"')),
        "is not that of a rigid body",
    ),
    "tendon": (
        fourbar(
            '<tendon><fixed name="t" stiffness="3"><joint joint="j1" coef="1"/></fixed></tendon>'
        ),
        "fixed 't' is a tendon with stiffness",
    ),
    "spring of a ball": (
        mujoco_file(BODY.replace('"j"', '"j" type="ball" stiffness="1"')),
        "has a spring, which a ball joint cannot have",
    ),
    "key": (
        fourbar('<keyframe><key qpos="1 2"/></keyframe>'),
        "key has 2 numbers in qpos, not 3",
    ),
    "limits": (
        mujoco_file(BODY.replace('"j"', '"j" range="3 -3"')),
        "range: 3 must be below -3",
    ),
    "held and driven": (
        fourbar(equalities('<joint joint1="j1"/>'), '<actuator><motor joint="j1"/></actuator>'),
        "'j1' is fixed by an equality",
    ),
    "long ball": (
        mujoco_file("<body><joint/><geom size='1' fromto='0 0 0 0 0 1'/></body>"),
        "is a sphere, which does not reach",
    ),
    "too heavy": (
        mujoco_file("<body name='b'><joint name='j'/><geom size='1e150'/></body>"),
        "what 'j' carries is too heavy",
    ),
    "flag": (
        mujoco_file(BODY, '<option><flag equality="disable"/></option>'),
        "flag equality = 'disable' is not read",
    ),
    "no joints": (mujoco_file("<body><geom size='1'/></body>"), "has no joints"),
    "twice": (mujoco_file(BODY + BODY.replace('"j"', '"k"')), "has a name that another one has"),
}


@each(("text", "why"), REFUSED.values(), ids=REFUSED)
def test_what_is_not_read_is_refused_with_its_line(text: str, why: str, tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    file.write_text("\n\n" + text.replace("><", ">\n<"))
    with pytest.raises(MechanismError) as caught:
        parts_from_mjcf(file)
    assert why in str(caught.value)
    assert str(file) in str(caught.value) or "fixed by" in str(caught.value)


def test_the_line_is_that_of_the_element(tmp_path: Path) -> None:
    lines = fourbar(equalities('<weld body1="crnk"/>')).replace("><", ">\n<")
    number = next(i for i, line in enumerate(lines.splitlines(), 1) if "crnk" in line)
    with pytest.raises(MechanismError, match=f"the MJCF text, line {number}: weld body1"):
        parts_from_mjcf(lines)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("<robot/>", "its root element is <robot>"),
        ("<mujoco", "is not a valid MJCF"),
        ("<!DOCTYPE mujoco []><mujoco/>", "declares a document type"),
        ("<mujoco/>", "has no joints"),
        ("<mujoco>" + "<body>" * 5000 + "</body>" * 5000 + "</mujoco>", "is not a valid MJCF"),
    ],
)
def test_what_is_no_mjcf_is_refused(text: str, why: str) -> None:
    with pytest.raises(MechanismError, match=why):
        parts_from_mjcf(text)


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot read the MJCF .*none\.xml: No such file"):
        parts_from_mjcf(tmp_path / "none.xml")
    (tmp_path / "binary.xml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"binary\.xml: not a UTF-8 text"):
        parts_from_mjcf(tmp_path / "binary.xml")
