"""Equalities, against MuJoCo's residuals and rows."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, ClosureError, LoopClosure, MechanismError
from rps_pin.closed_loop.constraints.closures import JointCoupling
from rps_pin.closed_loop.constraints.equations import ClosureEquations
from rps_pin.closed_loop.io.mjcf import parts_from_mjcf
from rps_pin.closed_loop.io.parts import MechanismParts
from tests.closed_loop.io.mjcf.twin import (
    INERTIAL,
    Array,
    Twin,
    equalities,
    fourbar,
    mujoco_file,
    read,
)
from tests.each import each
from tests.worst import worst


def with_references(text: str, two: float = 20, three: float = -30) -> str:
    text = text.replace('name="j2"', f'name="j2" ref="{two}"')
    return text.replace('name="j3"', f'name="j3" ref="{three}"')


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


def frames_of(parts: MechanismParts, closure: LoopClosure, q: Array) -> tuple[pin.SE3, pin.SE3]:
    data = parts.model.createData()
    pin.framesForwardKinematics(parts.model, data, q)
    a, b = (parts.model.getFrameId(name) for name in (closure.frame_a, closure.frame_b))
    return data.oMf[a], data.oMf[b]


def point_rows(parts: MechanismParts, closure: LoopClosure, q: Array) -> Array:
    """World velocities of the point of frame a less that of frame b; shape (3, nv)."""
    data = parts.model.createData()
    pin.computeJointJacobians(parts.model, data, q)
    pin.updateFramePlacements(parts.model, data)
    a, b = (
        pin.getFrameJacobian(
            parts.model, data, parts.model.getFrameId(name), pin.LOCAL_WORLD_ALIGNED
        )
        for name in (closure.frame_a, closure.frame_b)
    )
    return (a - b)[:3]


@each("element", CONNECTS.values(), ids=CONNECTS)
def test_a_connect_is_a_spherical_closure(element: str) -> None:
    twin = Twin(with_references(fourbar(equalities(element))))
    (closure,) = twin.parts.closures
    assert isinstance(closure, LoopClosure) and closure.kind == "spherical"
    rng = np.random.default_rng(3)
    for _ in range(5):
        twin.random(rng)
        a, b = frames_of(twin.parts, closure, twin.q)
        assert worst(a.translation - b.translation - twin.gaps()) < 1e-12
        assert worst(point_rows(twin.parts, closure, twin.q) - twin.rows()[1]) < 1e-12


@each("element", WELDS.values(), ids=WELDS)
def test_a_weld_is_a_rigid_closure(element: str) -> None:
    twin = Twin(with_references(fourbar(equalities(element))))
    (closure,) = twin.parts.closures
    assert isinstance(closure, LoopClosure) and closure.kind == "rigid"
    scale = float(twin.m.eq_data[0, 10])  # torquescale
    rng = np.random.default_rng(4)
    for _ in range(5):
        twin.random(rng)
        a, b = frames_of(twin.parts, closure, twin.q)
        gap, rows = twin.gaps(), twin.rows()[1]
        assert worst(a.translation - b.translation - gap[:3]) < 1e-12
        assert worst(point_rows(twin.parts, closure, twin.q) - rows[:3]) < 1e-12
        turn = pin.Quaternion(b.rotation.T @ a.rotation).coeffs()
        sine = turn[:3] * np.sign(turn[3])  # MuJoCo's measure: sin of half the angle
        assert worst(np.linalg.norm(scale * sine) - np.linalg.norm(gap[3:])) < 1e-12


@each("sites", [False, True])
def test_a_weld_that_holds_no_torque_is_a_spherical_closure(sites: bool) -> None:
    """MuJoCo's rows of the turn are zero with a torquescale of 0."""
    element = WELDS["sites" if sites else "both"].replace("/>", ' torquescale="0"/>')
    twin = Twin(with_references(fourbar(equalities(element))))
    (closure,) = twin.parts.closures
    assert isinstance(closure, LoopClosure) and closure.kind == "spherical"
    rng = np.random.default_rng(6)
    for _ in range(5):
        twin.random(rng)
        a, b = frames_of(twin.parts, closure, twin.q)
        assert worst(a.translation - b.translation - twin.gaps()[:3]) < 1e-12
        rows = twin.rows()[1]
        assert worst(point_rows(twin.parts, closure, twin.q) - rows[:3]) < 1e-12
        assert not rows[3:].any()


JOINTS = {
    "plain": '<joint joint1="j1" joint2="j3"/>',
    "line": '<joint joint1="j2" joint2="j3" polycoef="0.3 -1.7 0 0 0"/>',
    "short": '<joint joint1="j3" joint2="j2" polycoef="0.3"/>',
    "curve": '<joint joint1="j2" joint2="j3" polycoef="0.1 0.7 -0.4 0.3 0.2"/>',
    "square": '<joint joint1="j1" joint2="j3" polycoef="0 0 1.3"/>',
    "held": '<joint joint1="j2" polycoef="0.4"/>',
    "held by a constant": '<joint joint1="j2" joint2="j3" polycoef="0.4 0"/>',
}
TENDONS = {
    "held": '<tendon tendon1="sum" polycoef="0.2"/>',
    "two": '<tendon tendon1="sum" tendon2="other" polycoef="0.2 1.5"/>',
    "one joint in both": '<tendon tendon1="other" tendon2="sum"/>',
    "curve": '<tendon tendon1="sum" tendon2="other" polycoef="0.1 0.7 -0.4 0.3 0.2"/>',
    "constant": '<tendon tendon1="other" tendon2="sum" polycoef="0.1 0"/>',
}
TWO_TENDONS = """<tendon>
    <fixed name="sum"><joint joint="j1" coef="0.5"/><joint joint="j2" coef="-2"/></fixed>
    <fixed name="other"><joint joint="j3" coef="3"/><joint joint="j1" coef="0"/></fixed>
    <fixed name="none"><joint joint="j1" coef="0"/></fixed></tendon>"""


@each("element", [*JOINTS.values(), *TENDONS.values()])
@each(("angle", "references"), [("degree", (20, -30)), ("radian", (0.3, -0.5))])
def test_joint_and_tendon_equalities_are_couplings(
    element: str, angle: str, references: tuple[float, float]
) -> None:
    """One row less those of lengths, equal to MuJoCo's up to a factor, as the residual is."""
    twin = Twin(
        with_references(
            fourbar(
                TWO_TENDONS,
                equalities(element),
                f'<compiler angle="{angle}"/>',
                joint='ref="0.3"',
            ),
            *references,
        )
    )
    coupling = twin.parts.closures[0]
    assert isinstance(coupling, JointCoupling)
    equations = ClosureEquations(twin.model, twin.parts.closures)
    rng = np.random.default_rng(5)
    for _ in range(5):
        twin.random(rng)
        own, right = (rows[0] for rows in twin.rows())
        largest = int(np.abs(right).argmax())
        factor = own[largest] / right[largest]
        assert worst(own - factor * right) < 1e-12 * worst(own)
        assert worst(equations.gaps(twin.q)[0] - factor * twin.gaps()[0]) < 1e-12
        assert worst(equations.gaps(twin.q)[1:], 0) < 1e-12  # lengths
        assert worst(twin.rows()[0][1:], 0) < 1e-12


LOOPS = {
    "connect": CONNECTS["bodies"],
    "weld": '<weld body1="rocker" body2="plate"/>',
    "sites": '<connect site1="knee" site2="edge"/>',
    "joint": '<joint joint1="j1" joint2="slide" polycoef="0 1.5 -0.3"/>',
    "tendon": '<tendon tendon1="sum"/>',
}


@each("chosen", [["connect"], ["weld"], ["connect", "joint"], ["sites"], ["connect", "tendon"]])
def test_where_the_loops_are_closed_the_rows_span_what_mujocos_do(chosen: list[str]) -> None:
    """Rank, and the motions that are left, at closed configurations."""
    plate = f"""<body name="plate" pos="0.9 0.1 0"><joint name="slide" type="slide" axis="1 0 0"/>
        <joint name="ball" type="ball"/>{INERTIAL}<site name="edge" pos="0.2 0 0"/></body>"""
    text = fourbar(TWO_TENDONS, equalities(*(LOOPS[name] for name in chosen)))
    text = text.replace("</worldbody>", f"{plate}</worldbody>")
    mechanism = ClosedLoopModel.from_mjcf(text, actuated=["j1"])
    twin = Twin(text)
    q = mechanism.close(mechanism.home + 0.05)
    qpos = q.copy()
    qpos[-4:] = q[[-1, -4, -3, -2]]
    twin.set(qpos, np.zeros(twin.m.nv))
    assert worst(twin.gaps()) < 1e-9
    own, right = twin.rows()
    spaces = []
    for rows in (own, right):
        _, sizes, motions = np.linalg.svd(rows)
        rank = int((sizes > 1e-9).sum())
        spaces.append(motions[:rank].T @ motions[:rank])
    assert worst(spaces[0] - spaces[1]) < 1e-9


def test_a_differential_ties_three_joints() -> None:
    """q_rotor = 10 (pitch + roll), as ros2_control 1837 asks for."""
    text = mujoco_file(
        """<body><joint name="pitch" axis="0 1 0"/><geom size=".1" pos=".2 0 0"/><body pos=".3 0 0">
          <joint name="roll" axis="1 0 0"/><geom size=".1" pos="0 .1 0"/></body></body>
        <body pos="0 1 0"><joint name="rotor1" axis="0 1 0"/><geom size=".02"/></body>""",
        """<tendon><fixed name="bevel"><joint joint="pitch" coef="1"/><joint joint="roll" coef="1"/>
          <joint joint="rotor1" coef="-0.1"/></fixed></tendon>""",
        '<equality><tendon tendon1="bevel"/></equality>',
        '<actuator><motor joint="rotor1"/></actuator>',
    )
    mechanism = ClosedLoopModel.from_mjcf(text)
    assert mechanism.describe().mobility == 2
    q = mechanism.close([0.3, 0.2, 0.0], fixed=["pitch", "roll"])
    np.testing.assert_allclose(q, [0.3, 0.2, 5.0], atol=1e-12)


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


@each("flag", ["constraint", "equality"])
def test_disabled_constraints_close_nothing_and_it_is_told(flag: str) -> None:
    off = f'<option>\n<flag {flag}="disable"/></option>'
    parts, told = read(fourbar(equalities(CONNECTS["bodies"]), off))
    assert parts.closures == ()
    assert told == [
        f"the MJCF text, line 2: flag: {flag} is disabled, so no equality closes a loop"
    ]


def test_closures_given_come_after_the_files() -> None:
    more = LoopClosure("tip", "knee", "planar")
    parts = parts_from_mjcf(fourbar(equalities(CONNECTS["to the world"])), closures=[more])
    assert [closure.name for closure in parts.closures] == ["pin", "tip = knee"]
    assert parts.closures[0].frame_a == "pin:1"


def test_a_loop_that_cannot_close_is_told_with_its_line() -> None:
    """Within 1.51 degrees, two fingers cannot be 1.6 degrees apart."""
    text = mujoco_file(
        f"""<body><joint name="a" range="0 1.51" ref="1.1"/>{INERTIAL}</body>
        <body><joint name="b" range="0 2" ref="-.5"/>{INERTIAL}</body>""",
        """<tendon><fixed name="t"><joint joint="a" coef=".4"/><joint joint="b" coef="-.4"/></fixed>
        </tendon>""",
        '<equality><joint joint1="a" active="false"/>\n<tendon name="tie" tendon1="t"/></equality>',
    )
    with pytest.raises(
        ClosureError, match="line 3: tendon 'tie': the loops do not close"
    ) as caught:
        ClosedLoopModel.from_mjcf(text)
    mechanism = ClosedLoopModel.from_mjcf(text, within_limits=False)
    gap = mechanism.characteristic_length * np.radians(0.09)
    assert caught.value.gap == pytest.approx(gap, rel=1e-6)
    q = mechanism.close(mechanism.home)
    assert q[0] - q[1] == pytest.approx(np.radians(1.6), abs=1e-12)
    far = pin.SE3(np.eye(3), np.array([0.0, 0.0, 9.0]))
    more = LoopClosure("tip", "universe", "spherical", "more", placement_b=far)
    with pytest.raises(ClosureError, match=r"^the loops do not close .*: closure 'more"):
        ClosedLoopModel.from_mjcf(fourbar(), closures=[more])


ROPE = """<tendon><spatial name="rope">{}</spatial></tendon>"""
ROD = ROPE.format('<site site="tip"/><site site="knee"/>')
SPATIAL = ROPE.format('<site site="tip"/><site site="knee"/><site site="tip"/>')


def test_a_tendon_straight_between_two_sites_is_a_rod() -> None:
    """Held at its length in qpos0 and 0.05 m more."""
    text = fourbar(ROD, equalities('\n<tendon name="rod" tendon1="rope" polycoef="0.05 0 0 0 0"/>'))
    (closure,) = parts_from_mjcf(text).closures
    there = mujoco.MjModel.from_xml_string(text)
    assert closure == LoopClosure(
        "tip", "knee", "distance", "rod", distance=float(there.tendon_length0[0]) + 0.05
    )


@each(
    ("others", "why"),
    [
        (
            (SPATIAL, equalities('\n<tendon name="t" tendon1="rope"/>')),
            "line 2: tendon 't' is of a spatial tendon, which is not read",
        ),
        (
            (TWO_TENDONS, equalities('<tendon tendon1="none"/>')),
            "tendon couples no joint",
        ),
    ],
)
def test_what_is_not_read_is_refused_with_its_line(others: tuple[str, ...], why: str) -> None:
    with pytest.raises(MechanismError, match=why):
        parts_from_mjcf(fourbar(*others))
