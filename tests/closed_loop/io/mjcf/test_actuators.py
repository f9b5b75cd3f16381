"""Actuators and fixed tendons: the joints that they act on, rotors, and greatest forces."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from rps_pin import ClosedLoopModel, MechanismError
from rps_pin.closed_loop.io.mjcf import parts_from_mjcf
from tests.closed_loop.io.mjcf.twin import INERTIAL, Twin, fourbar, mujoco_file, read
from tests.each import each
from tests.worst import worst

TENDON = """<tendon><fixed name="pull" {}>
    <joint joint="j1" coef="0.5"/><joint joint="j2" coef="-2"/></fixed></tendon>"""
ROPE = '<tendon><spatial name="rope" {}><site site="tip"/><site site="knee"/></spatial></tendon>'


def actuators(*elements: str) -> str:
    return f"<actuator>{''.join(elements)}</actuator>"


def test_actuated_joints_are_those_of_the_actuators() -> None:
    text = actuators(
        '<motor joint="j3"/><!-- twice --><position joint="j1" kp="3"/>',
        '<velocity jointinparent="j3"/>',
    )
    assert parts_from_mjcf(fourbar(text)).actuated == ("j3", "j1")
    assert parts_from_mjcf(fourbar(text), actuated=["j2"]).actuated == ("j2",)
    assert parts_from_mjcf(fourbar(text), actuated="j2").actuated == ("j2",)
    assert parts_from_mjcf(fourbar()).actuated == ()


ELSEWHERE = {
    "site": ('\n<motor name="a" site="tip"/>', "", "line 2: motor 'a': on a site"),
    "rope": ('\n<muscle name="a" tendon="rope"/>', ROPE.format(""), "'a': on a spatial tendon"),
    "crank": (
        '\n<motor name="a" cranksite="tip" slidersite="knee" cranklength="1"/>',
        "",
        "motor 'a': on a slider-crank",
    ),
    "body": ('\n<adhesion name="a" body="crank" ctrlrange="0 1"/>', "", "'a': on a body"),
}


@each(("element", "other", "why"), ELSEWHERE.values(), ids=ELSEWHERE)
def test_actuators_on_other_things_are_told(element: str, other: str, why: str) -> None:
    parts, (told,) = read(fourbar(actuators('<motor joint="j1"/>', element), other))
    assert parts.actuated == ("j1",)
    assert why in told and told.endswith("so not an actuated joint of the mechanism")


def test_actuators_of_one_kind_are_told_in_one_warning() -> None:
    text = actuators('<motor name="a" site="tip"/>\n<motor name="b" site="knee"/>')
    _, told = read(fourbar(text))
    assert told == [
        "the MJCF text, line 1: motor 'a'; the MJCF text, line 2: motor 'b': on a site, so not an "
        "actuated joint of the mechanism"
    ]


def several(*elements: str, free: str = "") -> str:
    return mujoco_file(
        f"""<body><joint name="b" type="ball"/>{INERTIAL}</body>
        <body><joint name="f" type="free" {free}/>{INERTIAL}</body>""",
        actuators(*elements),
    )


BALL = [f'<motor joint="b" gear="{gear}"/>' for gear in ("1", "0 1", "0 0 1")]
#: Actuators of a ball and a free joint, options of the free joint, and what is actuated.
COORDINATES = [
    (('<motor joint="b"/>',), "", ("b.x",)),
    (('<motor joint="b" gear="0 -3 0" forcerange="-1 2"/>', BALL[0]), "", ("b.y", "b.x")),
    ((*BALL, '<motor joint="f" gear="0 0 0 0 0 2"/>'), "", ("b", "f.rz")),
    ((BALL[1], BALL[0], BALL[2]), "", ("b.y", "b.x", "b.z")),
    ((BALL[0], BALL[0], *BALL[1:]), "", ("b",)),
    (
        ('<motor joint="f" gear="0 2"/>', '<motor joint="f" gear="0 0 0 0 3"/>'),
        'armature="0.1"',
        ("f_position.y", "f.y"),
    ),
]


@each(("elements", "free", "names"), COORDINATES)
def test_actuators_of_one_velocity_of_a_ball_or_free_joint_drive_it(
    elements: tuple[str, ...], free: str, names: tuple[str, ...]
) -> None:
    """The acceleration under their forces is MuJoCo's."""
    text = several(*elements, free=free)
    mechanism, twin = ClosedLoopModel.from_mjcf(text), Twin(text)
    assert mechanism.actuated == names
    rng = np.random.default_rng(0)
    twin.random(rng)
    twin.d.ctrl[:] = rng.normal(size=twin.m.nu)
    mujoco.mj_forward(twin.m, twin.d)
    forces = np.linalg.lstsq(twin.L.T, twin.d.qfrc_actuator)[0]
    tau = forces[mechanism.actuated_indices]
    assert worst(np.delete(forces, mechanism.actuated_indices), 0) < 1e-12
    a = mechanism.forward_dynamics(twin.q, twin.v, tau)
    right = twin.L @ twin.d.qacc + twin.L_rate @ twin.d.qvel
    assert worst(a - right) < 1e-10 * worst(right)


def test_limits_of_forces_of_a_ball_are_of_the_velocity() -> None:
    text = several('<motor joint="b" gear="0 -3 0" forcerange="-1 2"/>')
    model = parts_from_mjcf(text).model
    assert list(model.lowerEffortLimit[:3]) == [-np.inf, -6, -np.inf]
    assert list(model.upperEffortLimit[:3]) == [np.inf, 3, np.inf]


@each(
    ("element", "free"),
    [
        ('<motor joint="b" gear="1 1"/>', ""),
        ('<motor joint="b" gear="0"/>', ""),
        ('<motor jointinparent="b"/>', ""),
        ('<motor joint="f"/>', ""),  # along an axis of the world
        ('<motor jointinparent="f" gear="0 0 0 1"/>', 'armature="0.1"'),
    ],
)
def test_actuators_of_several_velocities_are_told(element: str, free: str) -> None:
    with pytest.warns(UserWarning, match="on a joint of several coordinates, so not an act"):
        assert parts_from_mjcf(several(element, free=free)).actuated == ()


@each("option", ["armature", "damping"])
@each(
    ("element", "what"),
    [
        ('<motor name="a" tendon="rope" {}="0.1"/>', "a spatial tendon, which is not read"),
        ('<motor name="a" joint="ball" {}="0.1"/>', "a joint of several coordinates, which is not"),
    ],
)
def test_rotors_on_other_things_are_refused(option: str, element: str, what: str) -> None:
    """On sites, bodies and slider-cranks MuJoCo refuses them too."""
    text = fourbar(actuators("\n" + element.format(option)), ROPE.format(""))
    ball = f'<body><joint name="ball" type="ball"/>{INERTIAL}</body></worldbody>'
    with pytest.raises(MechanismError, match=f"line 2: motor 'a' has {option} on {what}"):
        parts_from_mjcf(text.replace("</worldbody>", ball))


@each(
    "elements",
    [
        ('<motor joint="j1" gear="10" armature="0.02" damping="0.3"/>',),
        ('<motor joint="j1" gear="-3" armature="0.02"/>', '<position joint="j1" damping="0.3"/>'),
        ('<motor joint="j2" armature="1" gear="2"/>', '<motor joint="j2" armature="3"/>'),
        ('<dcmotor joint="j1" motorconst="0.1" resistance="2" armature="3" damping="0.2"/>',),
        ('<motor tendon="pull" gear="3" armature="0.02" damping="0.3"/>',),
        ('<general tendon="pull" gainprm="3" biastype="affine" biasprm="0 -1 -1" armature="2"/>',),
    ],
)
def test_inverse_dynamics_of_rotors_and_dampers_is_mujocos(elements: tuple[str, ...]) -> None:
    """`mj_inverse`: what makes this motion besides passive forces."""
    text = fourbar(TENDON.format('armature="0.7"'), actuators(*elements), joint='armature="0.2"')
    twin = Twin(text)
    mechanism = ClosedLoopModel.from_mjcf(text, actuated=["j1", "j2", "j3"])
    rng = np.random.default_rng(0)
    for _ in range(5):
        twin.random(rng)
        twin.d.qacc[:] = rng.normal(size=3)
        right = twin.d.qacc.copy()
        mujoco.mj_inverse(twin.m, twin.d)
        r = mechanism.inverse_dynamics(twin.q, twin.v, twin.L @ right)
        assert worst(r.tau - twin.d.qfrc_inverse) < 1e-11 * worst(twin.d.qfrc_inverse)


def test_the_rotor_of_the_field_case_counts() -> None:
    text = """<mujoco><default><default class="m"><motor armature=".02" damping=".3"/></default>
      </default><worldbody><body><joint name="j" axis="0 1 0"/>
      <geom type="box" size=".1 .02 .03" pos=".1 0 0"/></body></worldbody>
      <actuator><motor class="m" joint="j" gear="10"/></actuator></mujoco>"""
    tau = ClosedLoopModel.from_mjcf(text).inverse_dynamics([0.0], [2.0], [1.0]).tau
    assert tau == pytest.approx([61.535664], abs=1e-6)  # mj_inverse


@each("option", ['armature="-1"', 'damping="-1"', 'damping="1 2"'])
def test_rotors_and_dampers_that_are_not_passive_are_refused(option: str) -> None:
    with pytest.raises(MechanismError, match="joint 'j1' has a "):
        parts_from_mjcf(fourbar(actuators(f'<motor joint="j1" {option}/>')))


# Greatest forces ----------------------------------------------------------------------------------


@each(
    ("elements", "joint", "limits"),
    [
        (('<motor joint="j1" forcerange="-2 3" gear="10"/>',), "", (-20, 30)),
        (('<motor joint="j1" forcerange="-2 3" gear="-10"/>',), "", (-30, 20)),
        (('<motor joint="j1" ctrlrange="-1 2" gear="10"/>',), "", (-10, 20)),
        (('<motor joint="j1" ctrlrange="-1 2" forcerange="-9 1"/>',), "", (-1, 1)),
        (('<position joint="j1" kp="9" ctrlrange="-1 2" forcerange="-4 4"/>',), "", (-4, 4)),
        (('<position joint="j1" ctrlrange="-1 2"/>',), "", (-np.inf, np.inf)),
        (('<motor joint="j1" ctrlrange="-1 2"/>', '<motor joint="j1"/>'), "", (-np.inf, np.inf)),
        (('<motor joint="j1" ctrlrange="-1 2"/>',) * 2, "", (-2, 4)),
        (('<motor joint="j1" ctrlrange="-1 2" ctrllimited="false"/>',), "", (-np.inf, np.inf)),
        (('<motor joint="j1" forcerange="-1 2" forcelimited="false"/>',), "", (-np.inf, np.inf)),
        (('<motor joint="j1" ctrlrange="-1 2" gear="0"/>',), "", (0, 0)),
        (('<motor joint="j1" ctrlrange="-1 2" gear="9"/>',), 'actuatorfrcrange="-5 6"', (-5, 6)),
        (('<motor joint="j2" ctrlrange="-1 2"/>',), "", (-np.inf, np.inf)),
    ],
)
def test_limits_of_forces_are_those_that_mujoco_clamps_at(
    elements: tuple[str, ...], joint: str, limits: tuple[float, float]
) -> None:
    text = fourbar(actuators(*elements), joint=joint)
    model = parts_from_mjcf(text).model
    assert (model.lowerEffortLimit[0], model.upperEffortLimit[0]) == limits
    m = mujoco.MjModel.from_xml_string(text)
    d = mujoco.MjData(m)
    for sign, limit in zip((-1, 1), limits, strict=True):
        if np.isfinite(limit):
            d.ctrl[:] = sign * 1e6 * np.sign(m.actuator_gear[:, 0])
            mujoco.mj_forward(m, d)
            assert d.qfrc_actuator[0] == pytest.approx(limit)


def test_a_range_of_controls_can_be_off() -> None:
    motor = actuators('<motor joint="j1" ctrlrange="-1 2"/>')
    off = '<option><flag clampctrl="disable"/></option>'
    assert parts_from_mjcf(fourbar(motor)).model.upperEffortLimit[0] == 2
    assert parts_from_mjcf(fourbar(motor, off)).model.upperEffortLimit[0] == np.inf


# Disabled -----------------------------------------------------------------------------------------


def test_disabled_actuators_do_not_actuate_and_it_is_told() -> None:
    motors = actuators('<motor joint="j1" group="2" armature="0.3"/>', '<motor joint="j2"/>')
    parts, told = read(fourbar(motors, '<option actuatorgroupdisable="2"/>'))
    assert parts.actuated == ("j2",)
    assert parts.model.armature[0] == 0.3
    assert told == ["the MJCF text, line 1: motor: its group is disabled, so it does not act"]
    off = '<option><flag actuation="disable"/></option>'
    parts, told = read(fourbar(motors, off))
    assert parts.actuated == ()
    assert told == ["the MJCF text, line 1: flag: actuation is disabled, so no joint is actuated"]
    twin = Twin(fourbar(motors, off))
    twin.random(np.random.default_rng(0))
    assert worst(twin.masses()[0] - twin.masses()[1]) < 1e-12


# Fixed tendons ------------------------------------------------------------------------------------


def test_a_tendon_with_an_actuator_is_an_actuated_joint() -> None:
    """Its force is the tendon's: at the joints, the force times the coefficients."""
    text = fourbar(TENDON.format(""), actuators('<motor tendon="pull" gear="3"/>'))
    mechanism = ClosedLoopModel.from_mjcf(text)
    assert mechanism.actuated == ("pull",)
    assert mechanism.model.nq == 4
    twin = Twin(text)
    twin.random(np.random.default_rng(0), 0.3)
    twin.d.ctrl[:] = 2.0
    mujoco.mj_forward(twin.m, twin.d)
    # Forward dynamics without closures: 3 equations for as many joints, and the length follows.
    a = mechanism.forward_dynamics(twin.q, twin.v, [6.0])
    assert worst(a - twin.L @ twin.d.qacc) < 1e-10 * worst(a)


def test_half_of_a_gripper_has_mobility_1() -> None:
    """Two fingers, of equal angles, driven by a tendon over both: half of the force each."""
    finger = '<geom type="box" size="0.1 0.01 0.01" pos="0.1 0 0" mass="1"/>'
    text = mujoco_file(
        f"""<body><joint name="left" axis="0 1 0"/>{finger}</body>
        <body pos="0 0.1 0"><joint name="right" axis="0 1 0"/>{finger}</body>""",
        """<tendon><fixed name="split"><joint joint="left" coef="0.5"/>
          <joint joint="right" coef="0.5"/></fixed></tendon>""",
        '<equality><joint joint1="left" joint2="right"/></equality>',
        '<actuator><motor tendon="split"/></actuator>',
    )
    mechanism = ClosedLoopModel.from_mjcf(text)
    assert mechanism.describe().mobility == 1
    tau = mechanism.inverse_dynamics(mechanism.home, np.zeros(3), np.zeros(3)).tau
    assert tau == pytest.approx([-2 * 0.981])  # two weights at 0.1 m, the same turn for both


FORCES = {
    "spring": 'stiffness="30" springlength="0.2"',
    "spring at qpos_spring": 'stiffness="30"',
    "damper": 'damping="2"',
    "armature": 'armature="2"',
    "range": 'range="-1 2"',
    "dry friction": 'frictionloss="2"',
    "forces": 'actuatorfrcrange="-3 4" stiffness="3"',
}


@each("option", FORCES.values())
def test_a_tendon_with_forces_or_limits_is_a_joint(option: str) -> None:
    text = fourbar(TENDON.format(option), joint='ref="30" springref="10"')
    twin = Twin(text)
    assert list(twin.model.names)[1:] == ["j1", "j2", "j3", "pull"]
    rng = np.random.default_rng(0)
    for _ in range(5):
        twin.random(rng)
        for own, right in (twin.masses(), twin.bias(), twin.passive()):
            assert worst(own - right) < 1e-12 * max(worst(right), 1.0)
    limits = twin.m.tendon_range[0] if twin.m.tendon_limited[0] else (-np.inf, np.inf)
    place = twin.place("pull")
    assert twin.model.lowerPositionLimit[place.idx_q] == limits[0]
    assert twin.model.upperPositionLimit[place.idx_q] == limits[1]
    forces = twin.m.tendon_actfrcrange[0] if twin.m.tendon_actfrclimited[0] else (-np.inf, np.inf)
    assert twin.model.lowerEffortLimit[place.idx_v] == forces[0]
    assert twin.model.upperEffortLimit[place.idx_v] == forces[1]
    assert twin.effects().friction[place.idx_v] == twin.m.tendon_frictionloss[0]
    twin.set(twin.m.qpos0, np.zeros(3))
    np.testing.assert_allclose(twin.parts.home, twin.q, atol=1e-15)
    kept = [name for name, effect in {**twin.parts.stiffness}.items() if effect]
    assert ("pull" in kept) == ("stiffness" in option)


def test_a_tendon_that_only_measures_is_no_joint_unless_it_is_named() -> None:
    text = fourbar(TENDON.format(""))
    assert parts_from_mjcf(text).model.nq == 3
    assert parts_from_mjcf(text, actuated=["pull"]).model.nq == 4
    assert ClosedLoopModel.from_mjcf(text, actuated=["pull"]).actuated == ("pull",)


def test_a_tendon_of_a_joints_name_is_called_a_tendon() -> None:
    text = fourbar(
        TENDON.format('stiffness="2"').replace("pull", "j2"), actuators('<motor tendon="j2"/>')
    )
    assert parts_from_mjcf(text).actuated == ("j2_tendon",)


@each(
    ("element", "why"),
    [
        (TENDON.format('stiffness="1 2"'), "fixed 'pull' has a stiffness that is not linear"),
        (TENDON.format('damping="1 2"'), "fixed 'pull' has a damping that is not linear"),
        (TENDON.format('stiffness="1" springlength="0 2"'), "'pull' is slack from 0 to 2"),
        (TENDON.format('stiffness="1" springyield="2"'), "'pull' has a spring that yields"),
        (ROPE.format('stiffness="1"'), "spatial 'rope' has stiffness, which is not read"),
        (ROPE.format('damping="1"'), "spatial 'rope' has damping, which is not read"),
        (ROPE.format('frictionloss="1"'), "spatial 'rope' has frictionloss, which is not read"),
        (ROPE.format('armature="1"'), "spatial 'rope' has armature, which is not read"),
    ],
)
def test_forces_of_tendons_that_are_not_read_are_refused(element: str, why: str) -> None:
    with pytest.raises(MechanismError, match=f"the MJCF text, line 1: .*{why}"):
        parts_from_mjcf(fourbar(element))


def test_a_range_of_a_spatial_tendon_is_told() -> None:
    with pytest.warns(UserWarning, match="spatial 'rope': a range of a spatial tendon is not rea"):
        parts_from_mjcf(fourbar(ROPE.format('range="0 1"')))
