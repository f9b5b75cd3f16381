"""A leg, a biped and a humanoid on a floating base, driven by cranks and rods: nv 31, 56 and 62.

Each leg has seven joints: hip yaw, roll, pitch, knee, ankle pitch, roll, and toe. The hip yaw is
driven directly, the other six by cranks: two for hip roll and pitch, one for the knee, two for the
ankle, one for the toe. A rod stands on a universal joint at its crank's tip and has a ball at the
link that it moves: three closure rows. All links have mass. The zero configuration is closed.

The humanoid's rods have balls at both ends, as Digit's, and spin idly; its toes are passive, and
each arm has one joint.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, LoopClosure

Array = NDArray[np.float64]
Place = tuple[float, float, float]

TURNS = {"x": pin.JointModelRX, "y": pin.JointModelRY, "z": pin.JointModelRZ}
ROTOR = 0.02
"""Armature of the driven joints, kg m^2."""
TILT = (0.15, 0.1, 0.0)
"""Roll and pitch of a leg's axes in the base, rad: frames of real legs are not parallel to it."""


class Joint(NamedTuple):
    """A joint of a leg and the link after it."""

    parent: str
    axis: str
    place: Place
    """In the parent's frame, m; y is that of the left leg."""
    mass: float
    """Of the link, kg."""
    middle: Place
    """Half of the link's length and its direction, m."""


class Drive(NamedTuple):
    """A crank and its rod."""

    on: str
    """The link that carries the crank."""
    place: Place
    """Of the crank's joint in that link's frame, m."""
    arm: Place
    """The crank, m; it turns about y."""
    second: str
    """Axis of the rod's second joint; the first is y."""
    moves: str
    """The link that the rod moves."""
    ball: Place
    """Of the rod's ball in that link's frame, m."""


JOINTS = {
    "hip_yaw": Joint("base", "z", (0.0, 0.1, -0.1), 1.0, (0.0, 0.0, -0.05)),
    "hip_roll": Joint("hip_yaw", "x", (0.0, 0.0, -0.08), 0.5, (0.0, 0.0, -0.03)),
    "hip_pitch": Joint("hip_roll", "y", (0.0, 0.0, -0.02), 3.0, (0.0, 0.0, -0.2)),
    "knee": Joint("hip_pitch", "y", (0.0, 0.01, -0.4), 2.0, (0.0, 0.0, -0.2)),
    "ankle_pitch": Joint("knee", "y", (0.0, 0.0, -0.4), 0.3, (0.0, 0.0, -0.02)),
    "ankle_roll": Joint("ankle_pitch", "x", (0.0, 0.0, -0.02), 0.8, (0.06, 0.0, -0.02)),
    "toe": Joint("ankle_roll", "y", (0.12, 0.0, -0.04), 0.2, (0.03, 0.0, 0.0)),
}
BACK = (-0.05, 0.0, 0.0)
DRIVES = {
    "hip_outer": Drive("hip_yaw", (0.0, 0.06, 0.05), BACK, "x", "hip_pitch", (-0.05, 0.06, 0.0)),
    "hip_inner": Drive("hip_yaw", (0.0, -0.06, 0.05), BACK, "x", "hip_pitch", (-0.05, -0.06, 0.0)),
    "knee": Drive("hip_pitch", (0.0, 0.03, -0.08), BACK, "x", "knee", (-0.05, 0.02, 0.0)),
    "ankle_outer": Drive("knee", (0.0, 0.05, -0.1), BACK, "x", "ankle_roll", (-0.05, 0.05, 0.0)),
    "ankle_inner": Drive("knee", (0.0, -0.05, -0.2), BACK, "x", "ankle_roll", (-0.05, -0.05, 0.0)),
    "toe": Drive("ankle_roll", (0.03, 0.02, 0.0), (0.0, 0.0, 0.04), "z", "toe", (0.0, 0.02, 0.04)),
}


def leg() -> ClosedLoopModel:
    """Return one leg on a floating base: nv = 31, 18 rows, 7 actuators, mobility 13."""
    return _mechanism("leg", {"leg": 1.0}, 5.0)


def biped() -> ClosedLoopModel:
    """Return two legs on a floating base: nv = 56, 36 rows, 14 actuators, mobility 20."""
    return _mechanism("biped", {"left": 1.0, "right": -1.0}, 12.0)


def humanoid() -> ClosedLoopModel:
    """Return two legs and two arms: nv = 62, 30 rows, 14 actuators, mobility 32, 10 of it idle."""
    return _mechanism("humanoid", {"left": 1.0, "right": -1.0}, 15.0, humanoid=True)


def _mechanism(
    name: str, sides: dict[str, float], mass: float, *, humanoid: bool = False
) -> ClosedLoopModel:
    model = pin.Model()
    model.name = name
    rng = np.random.default_rng(5)
    base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    _add_link(model, base, mass, (0.0, 0.0, 0.15), rng)
    closures, actuated = [], []
    for side, sign in sides.items():
        drives = {name: d for name, d in DRIVES.items() if not (humanoid and name == "toe")}
        closures += _add_leg(model, side, sign, rng, drives, balls=humanoid)
        actuated += [f"{side}_hip_yaw", *(f"{side}_{drive}_crank" for drive in drives)]
    for side, sign in sides.items() if humanoid else ():
        shoulder = pin.SE3(np.eye(3), np.array([0.0, sign * 0.2, 0.4]))
        arm = model.addJoint(base, pin.JointModelRY(), shoulder, f"{side}_arm")
        _add_link(model, arm, 2.0, (0.0, 0.0, -0.25), rng)
        actuated.append(f"{side}_arm")
    armature = np.zeros(model.nv)
    for joint in actuated:
        armature[model.joints[model.getJointId(joint)].idx_v] = ROTOR
    model.armature = armature
    limits = np.full(model.nq, np.inf)
    model.lowerPositionLimit, model.upperPositionLimit = -limits, limits
    return ClosedLoopModel(model, closures, actuated, home=pin.neutral(model), name=name)


def _add_leg(
    model: pin.Model,
    side: str,
    sign: float,
    rng: np.random.Generator,
    drives: dict[str, Drive],
    *,
    balls: bool,
) -> list[LoopClosure]:
    """Add a leg, mirrored in y where sign is -1, and return the closures of its rods."""

    def at(place: Place) -> Array:
        return np.array(place) * [1.0, sign, 1.0]

    def turn(parent: int, axis: str, place: pin.SE3, name: str) -> int:
        return int(model.addJoint(parent, TURNS[axis](), place, f"{side}_{name}"))

    here = {"base": model.getJointId("base")}
    for name, joint in JOINTS.items():
        tilt = TILT if joint.parent == "base" else (0.0, 0.0, 0.0)
        place = pin.SE3(pin.rpy.rpyToMatrix(sign * tilt[0], tilt[1], tilt[2]), at(joint.place))
        here[name] = turn(here[joint.parent], joint.axis, place, name)
        _add_link(model, here[name], joint.mass, joint.middle, rng)
        for drive_name, drive in drives.items():  # branch by branch, as Pinocchio demands
            if drive.on == name:
                place = pin.SE3(np.eye(3), at(drive.place))
                crank = turn(here[name], "y", place, f"{drive_name}_crank")
                _add_link(model, crank, 0.2, at(drive.arm) / 2, rng)
                tip, rod_name = pin.SE3(np.eye(3), at(drive.arm)), f"{drive_name}_rod"
                if balls:
                    ball = pin.JointModelSpherical()
                    here[f"{drive_name} rod"] = model.addJoint(
                        crank, ball, tip, f"{side}_{rod_name}"
                    )
                    continue
                cross = turn(crank, "y", tip, f"{drive_name}_cross")
                _add_link(model, cross, 0.02, (0.0, 0.0, 0.01), rng)
                rod = turn(cross, drive.second, pin.SE3.Identity(), rod_name)
                here[f"{drive_name} rod"] = rod
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    closures = []
    for name, drive in drives.items():
        rod, moved = here[f"{name} rod"], here[drive.moves]
        ball = data.oMi[rod].actInv(data.oMi[moved].act(at(drive.ball)))
        if balls:
            _add_rod(model, rod, 0.1, ball)
        else:
            _add_link(model, rod, 0.1, ball / 2, rng)
        ends = {
            f"{side}_{name}_rod_tip": (rod, ball),
            f"{side}_{name}_ball": (moved, at(drive.ball)),
        }
        for frame, (joint_id, point) in ends.items():
            place = pin.SE3(np.eye(3), point)
            model.addFrame(pin.Frame(frame, joint_id, 0, place, pin.FrameType.OP_FRAME))
        closures.append(LoopClosure(*ends, "spherical", name=f"{side}_{name}"))
    return closures


def _add_link(
    model: pin.Model, joint: int, mass: float, middle: Place | Array, rng: np.random.Generator
) -> None:
    """Add a rod of twice the length of `middle`, thickened and moved a little: a full inertia."""
    half = np.asarray(middle)
    cloud = 0.03 * rng.normal(size=(3, 3))
    centre = half + 0.01 * rng.normal(size=3)
    second = np.outer(half, half) / 3 + cloud @ cloud.T
    inertia = mass * (np.trace(second) * np.eye(3) - second)
    model.appendBodyToJoint(joint, pin.Inertia(mass, centre, inertia), pin.SE3.Identity())


def _add_rod(model: pin.Model, joint: int, mass: float, end: Array) -> None:
    """Add a round rod of 1 cm from a joint to a point."""
    length = float(np.linalg.norm(end))
    along = pin.Inertia.FromCylinder(mass, 0.005, length)  # along z, about its middle
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end).matrix()
    model.appendBodyToJoint(joint, along, pin.SE3(turn, end / 2))
