"""MuJoCo files, in MuJoCo: masses, forces, residuals and rank are those of the mechanism."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from rps_pin import (
    ClosedLoopModel,
    InputError,
    JointCoupling,
    JointEffects,
    LoopClosure,
    MechanismError,
)
from rps_pin.closed_loop.column_names import joint_coordinates
from tests.closed_loop.io.write.mujoco_agreement import Agreement, agreement
from tests.closed_loop.random_mechanisms import ALL_KINDS, case, random_placement, random_tree
from tests.worst import worst

URDF = Path(__file__).resolve().parents[4] / "urdf"
PACKAGE = sorted(path.stem for path in URDF.glob("*.yaml"))
JOINTS = ["revolute"] * 3 + [
    *("prismatic", "ball", "free", "turn", "planar", "translation", "universal", "zyx", "helical")
]
#: With these each velocity may have an effect of its own.
EVEN = ["revolute"] * 3 + ["prismatic", "turn", "translation", "universal", "zyx", "helical"]


SOLID = pin.Inertia(1.3, np.array([0.1, -0.2, 0.3]), np.diag([0.2, 0.3, 0.4]))


def assert_agrees(found: Agreement) -> None:
    assert found.gap < 1e-13
    assert found.rate < 1e-13
    assert found.mobility == 0
    assert worst(found.mass, found.weight, found.losses) < 1e-12, found
    assert found.force < 1e-6, found  # differences in time


@pytest.mark.parametrize("name", PACKAGE)
def test_mechanisms_of_the_package(name: str, tmp_path: Path) -> None:
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    if name == "rps":  # the paper's platform is no body, and its rods have no mass
        with pytest.raises(MechanismError, match=r"'leg_1_rod' has a mass of 0 kg"):
            mechanism.to_mjcf(tmp_path / "m.xml")
        mechanism = lightest(mechanism)
    assert_agrees(agreement(mechanism, mechanism.to_mjcf(tmp_path / "m.xml")))


def lightest(mechanism: ClosedLoopModel) -> ClosedLoopModel:
    """The same with a light mass in place of none, and moments that a body can have."""
    model = pin.Model(mechanism.model)
    for index in range(1, model.njoints):
        one = model.inertias[index]
        moments = np.maximum(np.linalg.eigvalsh(one.inertia), 1e-9)
        if moments[2] > moments[0] + moments[1] or one.mass == 0:
            moments[2] = moments[0] + moments[1]
            model.inertias[index] = pin.Inertia(max(one.mass, 1e-9), one.lever, np.diag(moments))
    return ClosedLoopModel(model, mechanism.closures, mechanism.actuated, home=mechanism.home)


def drivable(mechanism: ClosedLoopModel) -> ClosedLoopModel:
    """Driven but along axes of moving bodies, which MuJoCo's motors on joints do not."""
    moving = ("planar", "free")
    return mechanism.with_actuated([n for n in mechanism.actuated if not n.startswith(moving)])


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_every_closure(kind: str, tmp_path: Path) -> None:
    for seed in range(2):
        mechanism = drivable(case(seed, kinds=[kind], joints=JOINTS).mechanism)
        path = mechanism.to_mjcf(tmp_path / f"{seed}.xml")
        assert_agrees(agreement(mechanism, path))


@pytest.mark.parametrize("kind", ["spherical", "rigid", "revolute", "planar"])
def test_closures_at_offsets(kind: str, tmp_path: Path) -> None:
    """b's closed frame is put where a's is, whatever the frames that are named."""
    rng = np.random.default_rng(2)
    model = random_tree(rng, ["revolute"] * 4 + ["free", "ball"], planar=False)
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    a, b = (data.oMf[model.getFrameId(name)] for name in ("body_1", "body_4"))
    own = random_placement(rng)
    closure = LoopClosure("body_1", "body_4", kind, placement_a=own, placement_b=b.actInv(a * own))
    mechanism = ClosedLoopModel(model, [closure], [], home=q)
    assert mechanism.loop_gap(q) < 1e-12
    assert_agrees(agreement(mechanism, mechanism.to_mjcf(tmp_path / "m.xml")))


def coupled(*couplings: JointCoupling) -> ClosedLoopModel:
    """Five revolute joints, or more, standing where the couplings hold."""
    model = random_tree(np.random.default_rng(1), ["revolute"], planar=False)
    mechanism = ClosedLoopModel(model, couplings, [])
    q = mechanism.close(np.linspace(0.1, 0.5, model.nq))
    return ClosedLoopModel(model, couplings, [], home=q)


J0, J1, J2, J3, J4 = (f"revolute_{k}" for k in range(5))


@pytest.mark.parametrize(
    "couplings",
    [
        [JointCoupling(J0, {J1: 0.5, J2: -2.0, J4: 1.0}, offset=0.1)],
        [JointCoupling(J1, J3, polynomial=[0.1, 0.5, -0.3, 0.2, 0.1]), JointCoupling(J4, J0, 2.0)],
        [JointCoupling(J2, {}, offset=0.3), JointCoupling(J0, {J3: -1.5})],
    ],
)
def test_couplings(couplings: list[JointCoupling], tmp_path: Path) -> None:
    mechanism = coupled(*couplings)
    assert_agrees(agreement(mechanism, mechanism.to_mjcf(tmp_path / "m.xml")))


def test_a_polynomial_above_the_fourth_degree_is_refused(tmp_path: Path) -> None:
    mechanism = coupled(JointCoupling(J0, J1, name="cam", polynomial=[0, 1, 0, 0, 0, 0.5]))
    with pytest.raises(MechanismError, match="coupling 'cam' is a polynomial of degree 5"):
        mechanism.to_mjcf(tmp_path / "m.xml")


@pytest.mark.parametrize("seed", range(6))
def test_damping_springs_and_rotors(seed: int, tmp_path: Path) -> None:
    mechanism = case(seed, joints=EVEN, effects=True, armature=True).mechanism
    assert_agrees(agreement(mechanism, mechanism.to_mjcf(tmp_path / "m.xml")))


def sprung_ball(below: pin.JointModel, **given: object) -> ClosedLoopModel:
    """A joint on the world, placed anywhere, a ball below it; both with springs."""
    rng, model = np.random.default_rng(3), pin.Model()
    for name, joint in (("first", below), ("ball", pin.JointModelSpherical())):
        index = model.addJoint(model.njoints - 1, joint, random_placement(rng), name)
        model.addJointFrame(index)
        model.appendBodyToJoint(index, SOLID, random_placement(rng))
        model.addBodyFrame(f"{name}_link", index, pin.SE3.Identity(), model.nframes - 1)
    effects = JointEffects.named(model, damping={"ball": 0.3}, **given)
    return ClosedLoopModel(model, [], [], effects=effects)


@pytest.mark.parametrize(
    ("stiffness", "rest", "written"),
    [
        (7.0, 0.0, "free"),
        ([7.0] * 3 + [2.0] * 3, 0.0, "slides"),
        (7.0, [0.2, -0.1, 0.4, 0.0, 0.0, 0.0], "slides"),
    ],
)
def test_springs_of_balls_and_free_joints(
    stiffness: object, rest: object, written: str, tmp_path: Path
) -> None:
    springs = {"stiffness": {"first": stiffness, "ball": 5.0}, "rest": {"first": rest}}
    mechanism = sprung_ball(pin.JointModelFreeFlyer(), **springs)
    path = mechanism.to_mjcf(tmp_path / "m.xml")
    assert_agrees(agreement(mechanism, path))
    assert ('type="free"' in path.read_text()) == (written == "free")


@pytest.mark.parametrize("name", ["first", "ball"])
def test_turns_at_rest_elsewhere_are_refused(name: str, tmp_path: Path) -> None:
    turned = {"first": [0.0, 0.0, 0.0, 0.1, 0.2, 0.3], "ball": [0.1, 0.2, 0.3]}[name]
    springs = {"stiffness": {name: 5.0}, "rest": {name: turned}}
    mechanism = sprung_ball(pin.JointModelFreeFlyer(), **springs)
    why = rf"joint '{name}': its spring is at rest where it is turned by \[0.1, 0.2, 0.3\] rad; Mu"
    with pytest.raises(MechanismError, match=why):
        mechanism.to_mjcf(tmp_path / "m.xml")
    assert not (tmp_path / "m.xml").exists()


@pytest.mark.parametrize("seed", range(4))
def test_loops_of_a_plane_with_redundant_rows(seed: int, tmp_path: Path) -> None:
    mechanism = drivable(case(seed, planar=True).mechanism)
    assert_agrees(agreement(mechanism, mechanism.to_mjcf(tmp_path / "m.xml")))


def test_the_home_is_a_key_frame_and_closed(tmp_path: Path) -> None:
    mechanism = case(3, kinds=["planar", "universal", "point_on_plane"]).mechanism
    model = mujoco.MjModel.from_xml_path(str(mechanism.to_mjcf(tmp_path / "m.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_forward(model, data)
    assert data.nefc > 0
    assert np.abs(data.efc_pos).max() < 1e-12


def four_bar(**changes: object) -> ClosedLoopModel:
    one = ClosedLoopModel.load(URDF / "four_bar.yaml")
    options: dict[str, object] = {"home": one.home, "effects": one.effects}
    return ClosedLoopModel(one.model, one.closures, one.actuated, **(options | changes))


def test_limits_motors_and_friction(tmp_path: Path) -> None:
    model = pin.Model(four_bar().model)
    model.lowerPositionLimit[:] = [-np.inf, -2.0, -np.inf]
    model.upperPositionLimit[:] = [np.inf, 3.0, 4.0]
    model.lowerEffortLimit[:], model.upperEffortLimit[:] = -5.0, 7.0
    effects = JointEffects.named(model, friction={"crank_joint": 0.4}, damping={"rocker_joint": 2})
    one = four_bar()
    mechanism = ClosedLoopModel(model, one.closures, one.actuated, home=one.home, effects=effects)
    there = mujoco.MjModel.from_xml_path(str(mechanism.to_mjcf(tmp_path / "m.xml")))
    assert [there.joint(name).limited[0] for name in list(model.names)[1:]] == [0, 1, 1]
    assert there.joint(model.names[2]).range.tolist() == [-2, 3]
    assert there.joint(model.names[3]).range.tolist() == [-1e10, 4]
    assert there.nu == 1
    assert there.actuator("crank_joint").ctrlrange.tolist() == [-5, 7]
    assert there.actuator("crank_joint").forcerange.tolist() == [-5, 7]
    frictions = {n: float(there.joint(n).frictionloss[0]) for n in list(model.names)[1:]}
    assert frictions == {"crank_joint": 0.4, model.names[2]: 0, "rocker_joint": 0}
    assert float(there.joint("rocker_joint").damping[0]) == 2


def test_a_ball_has_three_motors(tmp_path: Path) -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Random(), "ball")
    model.appendBodyToJoint(1, SOLID, pin.SE3.Identity())
    mechanism = ClosedLoopModel(model, [], ["ball"])
    there = mujoco.MjModel.from_xml_path(str(mechanism.to_mjcf(tmp_path / "m.xml")))
    data = mujoco.MjData(there)
    data.ctrl[:] = [1, 2, 3]
    mujoco.mj_forward(there, data)
    assert data.qfrc_actuator.tolist() == [1, 2, 3]


def body(inertia: pin.Inertia, joint: object = None, **effects: object) -> ClosedLoopModel:
    model = pin.Model()
    model.addJoint(0, joint or pin.JointModelRX(), pin.SE3.Identity(), "joint")
    model.appendBodyToJoint(1, inertia, pin.SE3.Identity())
    model.addBodyFrame("arm", 1, pin.SE3.Identity(), 0)
    given = JointEffects.named(model, **effects)
    return ClosedLoopModel(model, [], ["joint"], effects=given)


def test_one_coordinate_of_a_joint_has_one_motor(tmp_path: Path) -> None:
    """Of a ball, and of joints that MuJoCo has as rows: the force acts on that velocity alone."""
    model = random_tree(np.random.default_rng(4), ["ball", "universal", "zyx"], planar=False)
    driven = []
    for name in list(model.names)[1:]:
        driven.append(joint_coordinates(model, name)[1])
    mechanism = ClosedLoopModel(model, [], driven)
    there = mujoco.MjModel.from_xml_path(str(mechanism.to_mjcf(tmp_path / "m.xml")))
    assert there.nu == len(driven)
    data = mujoco.MjData(there)
    data.ctrl[:] = forces = 1.0 + np.arange(there.nu)
    mujoco.mj_forward(there, data)
    expected = np.zeros(model.nv)
    expected[mechanism.actuated_indices] = forces
    assert np.abs(data.qfrc_actuator - expected).max() < 1e-12


@pytest.mark.parametrize(
    ("joint", "driven"), [(pin.JointModelPlanar(), "joint.x"), (pin.JointModelFreeFlyer(), "joint")]
)
def test_drives_along_axes_of_the_moving_body_are_refused(
    joint: object, driven: str, tmp_path: Path
) -> None:
    mechanism = body(SOLID, joint).with_actuated([driven])
    with pytest.raises(MechanismError, match="joint 'joint' is driven along axes of the moving"):
        mechanism.to_mjcf(tmp_path / "m.xml")
    turning = body(SOLID, joint).with_actuated(["joint.rz"])
    assert mujoco.MjModel.from_xml_path(str(turning.to_mjcf(tmp_path / "m.xml"))).nu == 1


def test_limits_that_are_equal_or_on_one_side_bound_in_mujoco_too(tmp_path: Path) -> None:
    model = pin.Model(body(SOLID).model)
    model.lowerPositionLimit[:] = model.upperPositionLimit[:] = 0.5
    model.lowerEffortLimit[:], model.upperEffortLimit[:] = -3.0, np.inf
    mechanism = ClosedLoopModel(model, [], ["joint"], home=[0.5])
    there = mujoco.MjModel.from_xml_path(str(mechanism.to_mjcf(tmp_path / "m.xml")))
    assert there.jnt_limited.tolist() == [1]
    assert np.abs(there.jnt_range - 0.5).max() < 1e-15
    assert there.actuator_forcerange.tolist() == [[-3, 1e10]]


def test_what_is_left_out_is_told(tmp_path: Path) -> None:
    planar = pin.Model(body(SOLID, pin.JointModelPlanar()).model)
    planar.upperPositionLimit[0] = 2.0
    with pytest.warns(UserWarning, match="joint 'joint': limits of its position are left out"):
        ClosedLoopModel(planar, [], []).to_mjcf(tmp_path / "planar.xml")
    odd = pin.Inertia(2.0, np.zeros(3), np.diag([1.0, 1.0, 2.0 + 1e-10]))
    with pytest.warns(UserWarning, match="link 'arm': a moment of inertia is 1e-10 kg m"):
        body(odd).to_mjcf(tmp_path / "odd.xml")


def test_names_that_mujoco_keeps_for_itself(tmp_path: Path) -> None:
    """A link called world, and a joint called as a motor of a ball would be."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    model.addJoint(1, pin.JointModelRX(), pin.SE3.Random(), "ball_1")
    for index, name in enumerate(("world", "a/b <c>"), 1):
        model.appendBodyToJoint(index, SOLID, pin.SE3.Identity())
        model.addBodyFrame(name, index, pin.SE3.Identity(), 0)
    mechanism = ClosedLoopModel(model, [], ["ball", "ball_1"])
    path = mechanism.to_mjcf(tmp_path / "m.xml")
    assert mujoco.MjModel.from_xml_path(str(path)).nu == 4
    assert_agrees(agreement(mechanism, path))


def test_files_are_replaced_only_if_asked(tmp_path: Path) -> None:
    mechanism, path = body(SOLID), tmp_path / "m.xml"
    path.write_text("mine")
    with pytest.raises(InputError, match=r"m\.xml exists; overwrite=True replaces it"):
        mechanism.to_mjcf(path)
    assert path.read_text() == "mine"
    mechanism.to_mjcf(path, overwrite=True)
    (tmp_path / "n.yaml").write_text("mine")
    with pytest.raises(InputError, match=r"n\.yaml exists; overwrite=True replaces it"):
        mechanism.to_urdf(tmp_path / "n.urdf")
    assert not (tmp_path / "n.urdf").exists()


POINT = pin.Inertia(2.0, np.array([0.1, 0.2, 0.3]), np.zeros((3, 3)))
#: A moment that no body has.
ODD = pin.Inertia(2.0, np.zeros(3), np.diag([1.0, 1.0, 2.5]))


@pytest.mark.parametrize(
    ("mechanism", "said"),
    [
        (body(pin.Inertia.Zero()), "link 'arm' has a mass of 0 kg .* --least-mass"),
        (body(POINT), "link 'arm' has a mass of 2 kg and a least moment of inertia of 0 kg m"),
        (body(ODD), "link 'arm': no body .* exceeds the sum of the others by 0.5"),
        (
            body(SOLID, pin.JointModelSpherical(), damping={"joint": [1, 2, 3]}),
            "joint 'joint': damping .* MuJoCo has one number for all",
        ),
        (
            body(SOLID, pin.JointModelPlanar(), friction={"joint": 1}),
            "joint 'joint': friction .* axes of the moving body",
        ),
        (body(SOLID, pin.JointModelEllipsoid(1, 2, 3)), "'joint' .Ellipsoid."),
    ],
)
def test_what_mujoco_has_not_is_named(
    mechanism: ClosedLoopModel, said: str, tmp_path: Path
) -> None:
    with pytest.raises(MechanismError) as error:
        mechanism.to_mjcf(tmp_path / "m.xml")
    assert re.search(said, str(error.value))
    assert not list(tmp_path.iterdir())


def test_bodies_are_mended_where_asked(tmp_path: Path) -> None:
    path = tmp_path / "m.xml"
    body(POINT).to_mjcf(path, least_inertia=1e-6)
    there = mujoco.MjModel.from_xml_path(str(path))
    assert there.body("arm").inertia.tolist() == [1e-6] * 3
    assert float(there.body("arm").mass[0]) == 2
    body(ODD).to_mjcf(path, mend_inertia=True, overwrite=True)
    assert sorted(mujoco.MjModel.from_xml_path(str(path)).body("arm").inertia) == [1, 1, 2]
    with pytest.raises(InputError, match="least_mass"):
        body(POINT).to_mjcf(path, least_mass=-1)
    with pytest.raises(InputError, match=r"must end in \.xml"):
        body(POINT).to_mjcf(tmp_path / "m.urdf")


def test_links_without_mass_between_two_joints_are_no_bodies(tmp_path: Path) -> None:
    """A cross and a slide's carriage: three joints of one body, as they turn and slide it."""
    model = pin.Model()
    for index, joint in enumerate((pin.JointModelRX(), pin.JointModelPY(), pin.JointModelRZ())):
        model.addJoint(index, joint, pin.SE3.Random(), f"joint_{index}")
    model.appendBodyToJoint(3, SOLID, pin.SE3.Identity())
    mechanism = ClosedLoopModel(model, [], ["joint_0", "joint_1", "joint_2"])
    path = mechanism.to_mjcf(tmp_path / "m.xml")
    assert mujoco.MjModel.from_xml_path(str(path)).nbody == 2
    assert_agrees(agreement(mechanism, path))


def test_mujoco_moves_as_the_mechanism_does(tmp_path: Path) -> None:
    """Its equalities are soft: a second's swing agrees to a thousandth."""
    mechanism = ClosedLoopModel.load(URDF / "five_bar.yaml")
    there = mujoco.MjModel.from_xml_path(str(mechanism.to_mjcf(tmp_path / "m.xml")))
    data = mujoco.MjData(there)
    mujoco.mj_resetDataKeyframe(there, data, 0)
    there.opt.timestep = 2e-4
    while data.time < 0.3:
        mujoco.mj_step(there, data)
    run = mechanism.simulate(mechanism.home, duration=0.3)
    names = list(mechanism.model.names)[1:]
    found = [float(data.qpos[there.joint(name).qposadr[0]]) for name in names]
    travelled = np.abs(run.q[-1] - run.q[0]).max()
    assert travelled > 0.1
    assert np.abs(run.q[-1] - found).max() < 5e-3 * travelled
