"""Closures of frames as they stand, and mechanisms with other closures and actuators."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, InputError, JointCoupling, LoopClosure, MechanismError
from rps_pin.closed_loop.constraints.closures import KINDS
from tests.closed_loop.mechanisms import FOUR_BAR
from tests.closed_loop.random_mechanisms import case, random_effects, random_tree
from tests.worst import worst

Array = NDArray[np.float64]
SORTS = ["revolute"] * 6 + ["prismatic", "ball", "free"]


def tree(seed: int) -> tuple[ClosedLoopModel, Array]:
    """A tree without closures, and a configuration of it."""
    rng = np.random.default_rng(seed)
    model = random_tree(rng, SORTS, planar=False)
    effects = random_effects(rng, model)
    q = pin.integrate(model, pin.neutral(model), 0.5 * rng.normal(size=model.nv))
    return ClosedLoopModel(model, [], [model.names[1]], effects=effects, name="tree"), q


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("frames", [("body_2", "universe"), ("universe", "body_2"), (0, 3)])
def test_every_kind_is_closed_where_the_frames_stand(
    kind: str, frames: tuple[str | int, str | int]
) -> None:
    gaps, found = [], []
    for seed in range(3):
        free, q = tree(seed)
        a, b = (f"body_{name}" if isinstance(name, int) else name for name in frames)
        options = {"axis": [0.3, -0.5, 0.8]} if kind in ("planar", "revolute") else {}
        closure = free.closure_at(q, a, b, kind, name="grip", **options)
        assert (closure.frame_a, closure.frame_b, closure.kind) == (a, b, kind)
        held = free.with_closures([closure], home=q)
        gaps.append(held.loop_gap(q))
        found.append(np.abs(held.home - q))
    assert worst(*gaps, *found) < 1e-12


def test_the_world_as_frame_a_keeps_its_axes_and_stands_at_the_other_frame() -> None:
    """A foot on the ground: the force's components are the world's, at the foot."""
    free, q = tree(1)
    closure = free.closure_at(q, "universe", "body_3", "planar")
    assert closure.axis == (0, 0, 1)
    data = free.model.createData()
    pin.framesForwardKinematics(free.model, data, q)
    foot = data.oMf[free.model.getFrameId("body_3")]
    a, b = closure.closed_frames(free.model)
    assert worst(a.placement.rotation - np.eye(3)) == 0
    assert worst(a.placement.translation - foot.translation) < 1e-14
    assert worst(b.at(data).homogeneous - a.placement.homogeneous) < 1e-14


def test_a_point_of_contact_is_given_as_an_offset() -> None:
    free, q = tree(2)
    toe = pin.SE3(np.eye(3), np.array([0.1, 0.0, -0.05]))
    closure = free.closure_at(q, "body_3", kind="spherical", placement_a=toe)
    data = free.model.createData()
    pin.framesForwardKinematics(free.model, data, q)
    point = data.oMf[free.model.getFrameId("body_3")].act(toe.translation)
    assert worst(closure.offsets()[1].translation - point) < 1e-14


def test_a_rod_has_the_length_at_which_it_is_measured() -> None:
    free, q = tree(0)
    data = free.model.createData()
    pin.framesForwardKinematics(free.model, data, q)
    a, b = (data.oMf[free.model.getFrameId(f"body_{k}")].translation for k in (0, 4))
    rod = free.closure_at(q, "body_0", "body_4", "distance")
    assert rod.distance == pytest.approx(np.linalg.norm(a - b), rel=1e-14)


def test_what_follows_from_the_configuration_cannot_be_given() -> None:
    free, q = tree(0)
    with pytest.raises(MechanismError, match="placement_b follows from q; leave it out"):
        free.closure_at(q, "body_0", placement_b=pin.SE3.Identity())
    with pytest.raises(MechanismError, match="distance follows from q"):
        free.closure_at(q, "body_0", "body_1", "distance", distance=0.3)
    options = "no option 'foo'; there are: name, axis, axis_b, placement_a$"
    with pytest.raises(MechanismError, match=f"'body_0' as it stands: {options}"):
        free.closure_at(q, "body_0", foo=1)
    with pytest.raises(MechanismError, match="no frame 'toe'; there are: universe"):
        free.closure_at(q, "toe")
    with pytest.raises(MechanismError, match="no closure kind 'glue'"):
        free.closure_at(q, "body_0", kind="glue")
    with pytest.raises(InputError, match="q has shape"):
        free.closure_at(q[1:], "body_0")


# Mechanisms made of others ------------------------------------------------------------------------


def test_other_closures_and_actuators_keep_all_the_rest() -> None:
    c = case(1, effects=True, armature=True)
    old = ClosedLoopModel(
        c.mechanism.model,
        c.mechanism.closures,
        c.mechanism.actuated,
        home=c.q,
        effects=c.mechanism.effects,
        name="old",
        characteristic_length=0.37,
        max_condition=1e7,
        notes=["a note"],
    )
    driven = old.with_actuated([old.model.names[1]])
    more = old.with_closures([old.closure_at(c.q, "body_2", kind="point_on_plane", name="wall")])
    fewer = more.without_closures(["wall"])
    for new in (driven, more, fewer, old.with_actuated([])):
        assert new.model is old.model
        assert (new.name, new.effects, new.notes) == ("old", old.effects, ("a note",))
        assert (new.characteristic_length, new.max_condition) == (0.37, 1e7)
        assert worst(new.home - c.q) < 1e-12
    assert (driven.closures, driven.actuated) == (old.closures, (old.model.names[1],))
    assert [one.name for one in more.closures] == [*(o.name for o in old.closures), "wall"]
    assert (fewer.closures, fewer.actuated) == (old.closures, old.actuated)
    assert more.without_closures("wall").closures == old.closures
    with pytest.raises(MechanismError, match=r"no closure 'floor'; there are: .*wall"):
        more.without_closures(["floor"])
    with pytest.raises(MechanismError, match="closure 'wall' is named twice"):
        more.with_closures([more.closures[-1]])


def test_the_length_that_compares_angles_follows_new_closures_unless_given() -> None:
    free = FOUR_BAR.mechanism().without_closures([FOUR_BAR.mechanism().closures[0].name])
    assert free.characteristic_length == 0.5  # no lever of a closure: the longest of a link
    levers = free.with_closures(FOUR_BAR.mechanism().closures)
    assert levers.characteristic_length == FOUR_BAR.mechanism().characteristic_length


def test_a_home_that_new_closures_open_is_closed() -> None:
    mechanism = FOUR_BAR.mechanism()
    tie = JointCoupling("rocker_joint", "crank_joint", offset=0.9)
    locked = mechanism.with_closures([tie])
    assert locked.loop_gap(locked.home) < 1e-12
    assert worst(locked.home - mechanism.home) > 1e-3


# MuJoCo's welds -----------------------------------------------------------------------------------

LEGGED = """<mujoco><option><flag contact="disable"/></option><worldbody>
<body name="trunk" pos="0 0 1"><freejoint/><geom size=".2 .1 .1" type="box"/>
 <body name="left" pos="0 .1 -.1"><joint name="l1" axis="0 1 0"/><geom size=".04" pos="0 0 -.2"/>
  <body name="left_foot" pos="0 0 -.4" euler="0 10 0"><joint name="l2" axis="0 1 0"/>
   <joint name="l3" axis="1 0 0"/><geom size=".05 .02 .02" type="box" pos=".02 0 0"/></body></body>
 <body name="right" pos="0 -.1 -.1"><joint name="r1" axis="0 1 0"/>
  <geom size=".04" pos="0 0 -.2"/>
  <body name="right_foot" pos="0.05 0 -.4"><joint name="r2" axis="0 1 0"/>
   <joint name="r3" axis="1 0 0"/><geom size=".05 .02 .02" type="box" pos=".02 0 0"/></body></body>
</body></worldbody>
<equality>EQUALITY</equality>
<actuator><motor joint="l1"/><motor joint="l2"/><motor joint="r1"/></actuator></mujoco>"""


@pytest.mark.parametrize(
    ("element", "frame_b", "kind"),
    [
        ('<weld body1="left_foot"/>', "universe", "rigid"),
        ('<weld body1="left_foot" body2="right_foot"/>', "right_foot", "rigid"),
        ('<connect body1="left_foot" anchor="0 0 0"/>', "universe", "spherical"),
    ],
    ids=["weld to the world", "weld of two bodies", "connect"],
)
def test_feet_are_held_as_mujoco_holds_them(element: str, frame_b: str, kind: str) -> None:
    """Accelerations by the KKT equations of MuJoCo's mass matrix, bias and constraint rows."""
    m = mujoco.MjModel.from_xml_string(LEGGED.replace("EQUALITY", element))
    d = mujoco.MjData(m)
    free = ClosedLoopModel.from_mjcf(LEGGED.replace("EQUALITY", ""))
    q = free.home  # where MuJoCo's is, too: its welds hold the pose of the file
    foot = free.closure_at(q, "left_foot", frame_b, kind)
    held = free.with_closures([foot], home=q)
    rng = np.random.default_rng(2)
    N = held.allowed_motions(q)
    v, tau = N @ rng.normal(size=N.shape[1]), rng.normal(size=3)
    found = held.forward_dynamics(q, v, tau)

    # MuJoCo's velocities: those of a free joint are linear in the world's axes, angular in its own.
    turn = np.eye(m.nv)
    data = held.model.createData()
    pin.forwardKinematics(held.model, data, q)
    turn[:3, :3] = data.oMi[1].rotation
    speed = turn @ v

    def residual(t: float) -> Array:
        at = m.qpos0.copy()
        mujoco.mj_integratePos(m, at, speed, t)
        d.qpos[:], d.qvel[:] = at, 0.0
        mujoco.mj_forward(m, d)
        return d.efc_pos.copy()

    step = 1e-4
    along = (residual(step) - 2 * residual(0.0) + residual(-step)) / step**2
    residual(0.0)
    d.qvel[:] = speed
    d.ctrl[:] = tau
    mujoco.mj_forward(m, d)
    J, M = d.efc_J.reshape(d.nefc, m.nv), np.zeros((m.nv, m.nv))
    mujoco.mj_fullM(m, d, M)
    force = d.qfrc_actuator - d.qfrc_bias
    kkt = np.block([[M, J.T], [J, np.zeros((d.nefc, d.nefc))]])
    solved = np.linalg.lstsq(kkt, np.concatenate([force, -along]), rcond=1e-10)[0][: m.nv]
    # The rows are those of one constraint: they have one null space.
    assert worst(J @ turn @ N) < 1e-9
    assert np.linalg.matrix_rank(J) == m.nv - N.shape[1]
    # d/dt of the free joint's linear velocity in its own axes: R' (a - w x v).
    wanted = solved.copy()
    w_world = turn[:3, :3] @ v[3:6]
    wanted[:3] = turn[:3, :3].T @ (solved[:3] - np.cross(w_world, speed[:3]))
    assert worst(found - wanted) < 1e-4 * (1 + np.abs(wanted).max())


def test_standing_on_two_feet_the_forces_carry_the_weight() -> None:
    free = ClosedLoopModel.from_mjcf(LEGGED.replace("EQUALITY", ""))
    q = free.home
    feet = [free.closure_at(q, f"{side}_foot", kind="rigid") for side in ("left", "right")]
    joints = ["l1", "l2", "l3", "r1", "r2", "r3"]
    standing = free.with_closures(feet, home=q).with_actuated(joints)
    still = np.zeros(free.model.nv)
    forces = standing.inverse_dynamics(q, still, still)
    carried = sum(
        wrench[:3] for wrench in standing.closure_wrenches(q, forces.constraint_forces).values()
    )
    weight = 9.81 * sum(inertia.mass for inertia in free.model.inertias)
    assert worst(carried - [0, 0, weight]) < 1e-9 * weight
    assert forces.unproduced is None


def test_a_frame_is_held_at_a_given_pose() -> None:
    mechanism = FOUR_BAR.mechanism()
    q = mechanism.close(mechanism.home, fixed=["crank_joint"])
    target = mechanism.frame_placement(mechanism.complete([1.1], q), "knee")
    pose = np.eye(4)
    pose[:3] = np.asarray(target)[:3]
    hold = LoopClosure("knee", "universe", "rigid", placement_b=pose)
    held = mechanism.with_closures([hold], home=mechanism.complete([1.0], q))
    assert worst(held.home - mechanism.complete([1.1], q)) < 1e-9
    assert dataclasses.replace(hold, name="here").placement_b == hold.placement_b
