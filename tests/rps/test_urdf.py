"""The URDF: the same robot to every program that reads it, digit by digit."""

from __future__ import annotations

import io
import math
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from hypothesis import given, settings
from lxml import etree
from numpy.typing import NDArray

import rps_pin
from rps_pin import RPSParameters, RPSRobot
from rps_pin.rps.leg_frames import URDF_UNLIMITED, ball_frames
from rps_pin.rps.urdf import build_urdf
from tests import strategies
from tests.strategies import LEG_ANGLES

Array = NDArray[np.float64]

LEGS = (1, 2, 3)
PRESETS = RPSParameters.presets()


def by_yourdfpy(text: str) -> yourdfpy.URDF:
    return yourdfpy.URDF.load(io.BytesIO(text.encode()), build_scene_graph=True, load_meshes=False)


def limited() -> RPSParameters:
    return RPSParameters.from_preset("micro").replace(
        platform_inertia=strategies.rigid_body_inertia(np.random.default_rng(0), 1.2, 0.06),
        spherical_cone_limit=0.5,
    )


# The files ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", PRESETS)
def test_files_are_what_the_generator_writes(preset: str) -> None:
    """Byte for byte, at the top of the tree and in the package."""
    expected = build_urdf(RPSParameters.from_preset(preset)).encode()
    name = f"rps_{preset}.urdf"
    assert (resources.files(rps_pin) / "urdf" / name).read_bytes() == expected
    assert (Path(__file__).parents[2] / "urdf" / name).read_bytes() == expected


def test_generated_files_are_those_of_presets_that_exist() -> None:
    folder = resources.files(rps_pin) / "urdf"
    found = {entry.name for entry in folder.iterdir() if entry.name.startswith("rps_")}
    assert found == {f"rps_{preset}.urdf" for preset in PRESETS}


def test_generation_is_reproducible() -> None:
    assert build_urdf(limited()) == build_urdf(limited())


@given(strategies.parameters())
@settings(max_examples=15)
def test_any_legal_robot_loads_in_both_readers(p: RPSParameters) -> None:
    text = build_urdf(p)
    assert pin.buildModelFromXML(text).nv == 12
    assert by_yourdfpy(text).robot.name == p.name


# The tree -----------------------------------------------------------------------------------------


def test_joints_are_a_free_platform_and_three_revolute_prismatic_legs() -> None:
    model = pin.buildModelFromXML(build_urdf(limited()))
    legs = [name for leg in LEGS for name in (f"leg_{leg}_revolute", f"leg_{leg}_prismatic")]
    assert set(model.names) == {"universe", "platform_free", *legs}
    assert (model.nq, model.nv) == (13, 12)
    for leg in LEGS:
        assert model.parents[model.getJointId(f"leg_{leg}_prismatic")] == model.getJointId(
            f"leg_{leg}_revolute"
        )
        assert model.parents[model.getJointId(f"leg_{leg}_revolute")] == 0


def test_ball_frames_of_a_leg_are_on_platform_and_rod() -> None:
    model = pin.buildModelFromXML(build_urdf(limited()))
    for leg in LEGS:
        carriers = [model.frames[model.getFrameId(name)].parentJoint for name in ball_frames(leg)]
        assert [model.names[i] for i in carriers] == ["platform_free", f"leg_{leg}_prismatic"]


# Masses -------------------------------------------------------------------------------------------


def expected_bodies(p: RPSParameters) -> dict[str, tuple[float, float, float]]:
    """Mass, centre of mass along the leg, and moment of inertia in the plane it moves in."""
    cylinder = (p.leg_mass, p.leg_com, p.leg_inertia_about_com)
    rod = (p.rod_mass, -p.rod_com, p.rod_inertia)
    return {
        name: body
        for leg in LEGS
        for name, body in ((f"leg_{leg}_cylinder", cylinder), (f"leg_{leg}_rod", rod))
    }


@given(strategies.parameters())
@settings(max_examples=15)
def test_masses_in_yourdfpy_are_the_parameters_exactly(p: RPSParameters) -> None:
    links = by_yourdfpy(build_urdf(p)).link_map
    platform = links["platform"].inertial
    assert platform.mass == p.platform_mass
    np.testing.assert_array_equal(platform.inertia, p.platform_inertia)
    np.testing.assert_array_equal(platform.origin, np.eye(4))
    for name, (mass, com, inertia) in expected_bodies(p).items():
        inertial = links[name].inertial
        if mass == 0:
            assert inertial is None
            continue
        assert inertial.mass == mass
        np.testing.assert_array_equal(inertial.origin[:3, 3], [com, 0, 0])
        np.testing.assert_array_equal(inertial.origin[:3, :3], np.eye(3))
        assert inertial.inertia[1, 1] == inertial.inertia[2, 2] == inertia
        assert not (inertial.inertia - np.diag(np.diag(inertial.inertia))).any()


@given(strategies.parameters())
@settings(max_examples=15)
def test_masses_in_pinocchio_are_the_parameters(p: RPSParameters) -> None:
    """To the last bit or two: it turns every inertia by R I R' and has (m c) / m for c."""
    model = pin.buildModelFromXML(build_urdf(p))
    platform = model.inertias[model.getJointId("platform_free")]
    assert platform.mass == p.platform_mass
    size = np.abs(p.platform_inertia).max()
    np.testing.assert_allclose(platform.inertia, p.platform_inertia, rtol=0, atol=1e-15 * size)
    np.testing.assert_array_equal(platform.lever, np.zeros(3))
    joint_of = {"cylinder": "revolute", "rod": "prismatic"}
    for name, (mass, com, inertia) in expected_bodies(p).items():
        leg, part = name.rsplit("_", 1)
        body = model.inertias[model.getJointId(f"{leg}_{joint_of[part]}")]
        assert body.mass == mass
        if mass:
            np.testing.assert_allclose(body.lever, [com, 0, 0], rtol=1e-15, atol=0)
            assert body.inertia[1, 1] == pytest.approx(inertia, rel=1e-15)
        else:
            assert not body.toDynamicParameters().any()


@given(strategies.parameters())
@settings(max_examples=15)
def test_legs_are_rigid_bodies(p: RPSParameters) -> None:
    """The moment along the leg, which does no work, obeys the triangle inequality all the same."""
    for link in by_yourdfpy(build_urdf(p)).robot.links:
        if link.name.startswith("leg") and link.inertial is not None:
            along, across, same = np.diag(link.inertial.inertia)
            assert 0 <= along <= across + same


def test_massless_rods_have_no_inertial() -> None:
    tree = etree.fromstring(build_urdf(RPSParameters.from_preset("sokolov")))
    with_mass = {
        link.get("name") for link in tree.iter("link") if link.find("inertial") is not None
    }
    assert with_mass == {"platform", *(f"leg_{leg}_cylinder" for leg in LEGS)}


# Joints -------------------------------------------------------------------------------------------


def expected_placement(p: RPSParameters, leg: int) -> Array:
    """Revolute joint at g e, x towards the centre, z up (so y = z x (-e))."""
    e = np.array([math.cos(LEG_ANGLES[leg - 1]), math.sin(LEG_ANGLES[leg - 1]), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    placement = np.eye(4)
    placement[:3] = np.stack([-e, np.cross(up, -e), up, p.base_radius * e], axis=-1)
    return placement


def test_joints_stand_where_they_should_in_both_readers() -> None:
    p = limited()
    text = build_urdf(p)
    joints, model = by_yourdfpy(text).joint_map, pin.buildModelFromXML(text)
    for leg in LEGS:
        expected = expected_placement(p, leg)
        found = joints[f"leg_{leg}_revolute"].origin
        in_pinocchio = model.jointPlacements[model.getJointId(f"leg_{leg}_revolute")].homogeneous
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15)
        np.testing.assert_allclose(in_pinocchio, expected, rtol=0, atol=1e-15)
        np.testing.assert_array_equal(joints[f"leg_{leg}_prismatic"].origin, np.eye(4))
        np.testing.assert_array_equal(joints[f"leg_{leg}_revolute"].axis, [0, -1, 0])
        np.testing.assert_array_equal(joints[f"leg_{leg}_prismatic"].axis, [1, 0, 0])
    np.testing.assert_array_equal(joints["platform_free"].origin, np.eye(4))


def expected_limits(p: RPSParameters) -> dict[str, tuple[float, float, float, float]]:
    """Lower, upper, effort, velocity; where there is none, the stand-in the docstring names."""
    longest = p.leg_length_limits[1]
    if math.isinf(longest):
        longest = 10 * (p.base_radius + p.platform_radius)
    force = min(p.actuator_force_limit, URDF_UNLIMITED)
    speed = min(p.actuator_speed_limit, URDF_UNLIMITED)
    revolute = (*p.leg_angle_limits, URDF_UNLIMITED, URDF_UNLIMITED)
    prismatic = (p.leg_length_limits[0], longest, force, speed)
    return {
        name: values
        for leg in LEGS
        for name, values in ((f"leg_{leg}_revolute", revolute), (f"leg_{leg}_prismatic", prismatic))
    }


@pytest.mark.parametrize("p", [limited(), *map(RPSParameters.from_preset, PRESETS)])
def test_limits_are_the_parameters_in_both_readers(p: RPSParameters) -> None:
    text = build_urdf(p)
    joints, model = by_yourdfpy(text).joint_map, pin.buildModelFromXML(text)
    for name, expected in expected_limits(p).items():
        limit = joints[name].limit
        assert (limit.lower, limit.upper, limit.effort, limit.velocity) == expected
        joint = model.joints[model.getJointId(name)]
        assert (
            model.lowerPositionLimit[joint.idx_q],
            model.upperPositionLimit[joint.idx_q],
            model.upperEffortLimit[joint.idx_v],
            model.upperVelocityLimit[joint.idx_v],
        ) == expected


# Frames -------------------------------------------------------------------------------------------


def test_frames_stand_where_the_closed_form_says() -> None:
    """Rod tips at angle phi and length d; balls at h e on the platform; both readers."""
    p = limited()
    text = build_urdf(p)
    angles, lengths = np.array([0.3, 1.2, 2.0]), np.array([0.21, 0.24, 0.23])
    e = np.stack([np.cos(LEG_ANGLES), np.sin(LEG_ANGLES), np.zeros(3)], axis=-1)
    inwards = (p.base_radius - lengths * np.cos(angles))[:, None]
    tips = inwards * e + (lengths * np.sin(angles))[:, None] * [0, 0, 1]
    placement = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.1])), np.array([0.01, 0.02, 0.2]))
    balls = placement.translation + p.platform_radius * e @ placement.rotation.T

    model = pin.buildModelFromXML(text)
    data, q = model.createData(), pin.neutral(model)
    for leg in LEGS:
        q[model.joints[model.getJointId(f"leg_{leg}_revolute")].idx_q] = angles[leg - 1]
        q[model.joints[model.getJointId(f"leg_{leg}_prismatic")].idx_q] = lengths[leg - 1]
    start = model.joints[model.getJointId("platform_free")].idx_q
    q[start : start + 7] = pin.SE3ToXYZQUAT(placement)
    pin.framesForwardKinematics(model, data, q)
    for leg in LEGS:
        on_platform, on_rod = (data.oMf[model.getFrameId(name)] for name in ball_frames(leg))
        np.testing.assert_allclose(on_rod.translation, tips[leg - 1], rtol=0, atol=5e-16)
        np.testing.assert_allclose(on_platform.translation, balls[leg - 1], rtol=0, atol=5e-16)

    tree = by_yourdfpy(text)
    values = {f"leg_{leg}_revolute": angles[leg - 1] for leg in LEGS}
    tree.update_cfg(values | {f"leg_{leg}_prismatic": lengths[leg - 1] for leg in LEGS})
    for leg in LEGS:
        found = tree.get_transform(f"leg_{leg}_ball", "base")[:3, 3]
        np.testing.assert_allclose(found, tips[leg - 1], rtol=0, atol=5e-16)
        found = tree.get_transform(f"platform_ball_{leg}", "platform")[:3, 3]
        np.testing.assert_allclose(found, p.platform_radius * e[leg - 1], rtol=0, atol=2e-16)


# Shapes -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", PRESETS)
def test_every_body_can_be_seen_and_hit(preset: str) -> None:
    tree = etree.fromstring(build_urdf(RPSParameters.from_preset(preset)))
    bodies = ["base", "platform", *(f"leg_{i}_{x}" for i in LEGS for x in ("cylinder", "rod"))]
    for name in bodies:
        (link,) = tree.xpath("link[@name=$name]", name=name)
        shapes = [
            [
                etree.tostring(x.find(part), with_tail=False)
                for x in link.findall(kind)
                for part in ("geometry", "origin")
            ]
            for kind in ("visual", "collision")
        ]
        seen, hit = shapes
        assert hit, name
        assert {(tuple(hit[i : i + 2])) for i in range(0, len(hit), 2)} <= {
            tuple(seen[i : i + 2]) for i in range(0, len(seen), 2)
        }, name  # decoration is only seen


@pytest.mark.parametrize("kind", [pin.GeometryType.VISUAL, pin.GeometryType.COLLISION])
def test_pinocchio_reads_the_shapes(kind: pin.GeometryType) -> None:
    text = build_urdf(limited())
    model = pin.buildModelFromXML(text)
    shapes = pin.buildGeomFromUrdfString(model, text, kind)
    carriers = {model.names[shape.parentJoint] for shape in shapes.geometryObjects}
    assert carriers == set(model.names)


@given(strategies.parameters())
@settings(max_examples=15)
def test_sizes_of_shapes_are_positive(p: RPSParameters) -> None:
    tree = etree.fromstring(build_urdf(p))
    sizes = [
        float(number)
        for shape in tree.iter("box", "cylinder", "sphere")
        for value in shape.attrib.values()
        for number in value.split()
    ]
    assert min(sizes) > 0


# Another engine -----------------------------------------------------------------------------------


def in_mujoco(text: str, gravity: Array) -> Any:
    """The same URDF text, with the element that keeps MuJoCo from changing any body."""
    mujoco = pytest.importorskip("mujoco")
    tree = etree.fromstring(text)
    options = {"balanceinertia": "false", "boundmass": "0", "boundinertia": "0"}
    etree.SubElement(etree.SubElement(tree, "mujoco"), "compiler", options)
    model = mujoco.MjModel.from_xml_string(etree.tostring(tree, encoding="unicode"))
    model.opt.gravity = gravity
    return mujoco, model


class Coordinates:
    """From Pinocchio's vectors to MuJoCo's.

    A free joint's velocity is (linear, angular), in body axes there, in (world, body) axes here;
    its quaternion is (x, y, z, w) there and (w, x, y, z) here.
    """

    def __init__(self, model: pin.Model, other: Any) -> None:
        self.model, self.nv = model, other.nv
        self.slots = []
        for name in list(model.names)[1:]:
            joint = model.joints[model.getJointId(name)]
            address = other.joint(name)
            self.slots.append((joint, int(address.qposadr[0]), int(address.dofadr[0])))

    def configuration(self, q: Array) -> Array:
        found = np.empty(self.model.nq)
        for joint, place, _ in self.slots:
            own = q[joint.idx_q : joint.idx_q + joint.nq]
            found[place : place + joint.nq] = own[[0, 1, 2, 6, 3, 4, 5]] if joint.nq == 7 else own
        return found

    def velocity(self, q: Array) -> Array:
        """The matrix T of v_mujoco = T v_pinocchio."""
        found = np.zeros((self.nv, self.model.nv))
        for joint, _, place in self.slots:
            block = np.eye(joint.nv)
            if joint.nv == 6:
                block[:3, :3] = pin.Quaternion(q[joint.idx_q + 3 : joint.idx_q + 7]).matrix()
            found[place : place + joint.nv, joint.idx_v : joint.idx_v + joint.nv] = block
        return found

    def drift(self, q: Array, v: Array) -> Array:
        """T' v, of T's own change in time: R (w x v) where a free joint has linear rows."""
        found = np.zeros(self.nv)
        for joint, _, place in self.slots:
            if joint.nv == 6:
                linear, spin = np.split(v[joint.idx_v : joint.idx_v + 6], 2)
                R = pin.Quaternion(q[joint.idx_q + 3 : joint.idx_q + 7]).matrix()
                found[place : place + 3] = R @ np.cross(spin, linear)
        return found


@pytest.mark.parametrize("seed", range(10))
def test_mujoco_has_the_same_masses_and_the_same_bias_forces(seed: int) -> None:
    """M(q), and rnea(q, v, 0), of the open tree at 100 random states, loops open."""
    rng = np.random.default_rng(seed)
    p = strategies.random_parameters(rng, tilted_gravity=True)
    robot = RPSRobot(p)
    mujoco, other = in_mujoco(robot.urdf, p.gravity)
    model, twin = robot.mechanism.model, mujoco.MjData(other)
    data, coordinates = model.createData(), Coordinates(model, other)
    mass, bias, worst = np.zeros((12, 12)), np.zeros(12), np.zeros(2)
    for _ in range(100):
        q = pin.normalize(model, rng.normal(size=13))
        v = rng.normal(scale=3.0, size=12)
        T = coordinates.velocity(q)
        twin.qpos, twin.qvel = coordinates.configuration(q), T @ v
        twin.qacc = coordinates.drift(q, v)
        mujoco.mj_fwdPosition(other, twin)
        mujoco.mj_fwdVelocity(other, twin)
        mujoco.mj_fullM(other, twin, mass)
        mujoco.mj_rne(other, twin, 1, bias)
        expected = pin.crba(model, data, q)
        expected = np.triu(expected) + np.triu(expected, 1).T
        needed = pin.rnea(model, data, q, v, np.zeros(12))
        errors = [
            np.abs(T.T @ mass @ T - expected).max() / np.abs(expected).max(),
            np.abs(T.T @ bias - needed).max() / np.abs(needed).max(),
        ]
        worst = np.maximum(worst, errors)
    print(f"MuJoCo: mass matrix {worst[0]:.1e}, bias {worst[1]:.1e}")
    assert worst.max() < 1e-12
