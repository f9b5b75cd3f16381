"""A mechanism as a MuJoCo file: bodies, joints, inertias, effects, actuators, closures, a home.

Nothing touches: the file has no shapes, or shapes without contact. MuJoCo's dry friction is a
constraint, not the smooth law of `passive_joint_forces`; its equalities are soft (``solref``).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from rps_pin.arrays import Array
from rps_pin.closed_loop.column_names import named_velocities
from rps_pin.closed_loop.constraints.closures import JointCoupling
from rps_pin.closed_loop.io.write.mjcf_bodies import Bodies, Body
from rps_pin.closed_loop.io.write.mjcf_closures import add_closures, held_joints
from rps_pin.closed_loop.io.write.mjcf_inertia import Mending, add_inertial
from rps_pin.closed_loop.io.write.mjcf_joints import MujocoJoint
from rps_pin.closed_loop.io.write.mjcf_tendons import tendons_of
from rps_pin.closed_loop.io.write.numbers import number, numbers, quaternion
from rps_pin.closed_loop.io.write.source import FAR, Names, Source, kind_of, unwritten_limits
from rps_pin.errors import MechanismError

#: Kinds of MuJoCo's joints with one velocity, and tendons.
_ONE = ("hinge", "slide", "tendon")
#: Time step, s, and the equalities' time constant: the stiffest that MuJoCo's default allows.
_STEP = 1e-3


def mjcf_text(source: Source, mending: Mending, told: list[str]) -> str:
    """Return the MuJoCo file of a mechanism without rows (see `without_rows`).

    Parameters
    ----------
    source
        The mechanism.
    mending
        What is done to bodies that MuJoCo does not take.
    told
        Takes sentences on what is left out.

    Raises
    ------
    MechanismError
        If MuJoCo has no such joint, effect or body; names it.
    """
    return _Mjcf(source, mending, told).text()


class _Mjcf:
    def __init__(self, source: Source, mending: Mending, told: list[str]) -> None:
        self._source, self._model, self._mending = source, source.model, mending
        self._told = told
        self._motor_names = Names()
        self._root = etree.Element("mujoco", model=source.name or "mechanism")
        self._home: list[Array] = []
        self._of_velocity: dict[int, MujocoJoint] = {}

    def text(self) -> str:
        source, root = self._source, self._root
        q = pin.neutral(self._model) if source.home is None else source.home
        for joint in range(1, self._model.njoints):
            self._told += unwritten_limits(self._model, joint, effort=False)
        held = held_joints(source)
        tendons = tendons_of(source, held)
        bodies = Bodies(source, held, tendons, q)
        tied = tuple(one for one in source.closures if one not in tendons.values())
        equalities = add_closures(source._replace(closures=tied), bodies, q)
        for joint, coupling in tendons.items():
            self._add_tendon(equalities.tendon, joint, coupling)
        etree.SubElement(root, "compiler", angle="radian", autolimits="true")
        etree.SubElement(
            root, "option", gravity=numbers(self._model.gravity.linear), timestep=number(_STEP)
        )
        default = etree.SubElement(root, "default")
        etree.SubElement(default, "equality", solref=f"{number(2 * _STEP)} 1")
        world = etree.SubElement(root, "worldbody")
        self._fill(world, bodies.world)
        for section in (equalities.tendon, equalities.equality, self._actuators()):
            if len(section):
                root.append(section)
        if source.home is not None:
            key = etree.SubElement(etree.SubElement(root, "keyframe"), "key", name="home")
            key.set("qpos", numbers(np.concatenate([np.empty(0), *self._home])))
        etree.indent(root, space="  ")
        return str(etree.tostring(root, encoding="unicode")) + "\n"

    def _fill(self, element: Any, body: Body) -> None:
        for joint, frame in body.joints:
            self._add_joint(element, joint, frame)
        if body.joints:
            add_inertial(element, body.name, body.inertia, self._mending, self._told)
        for name, placement in body.sites.items():
            etree.SubElement(element, "site", name=name, **_placement(placement))
        for child in body.children:
            below = etree.SubElement(
                element, "body", name=child.name, **_placement(child.placement)
            )
            self._fill(below, child)

    def _add_joint(self, element: Any, joint: MujocoJoint, frame: pin.SE3) -> None:
        self._home.append(joint.coordinates)
        one = etree.SubElement(element, "joint", name=joint.name, type=joint.kind)
        if frame.translation.any():
            one.set("pos", numbers(frame.translation))
        if joint.axis is not None:
            one.set("axis", numbers(frame.rotation @ joint.axis))
        if joint.idx_q is not None:
            self._add_range(one, joint.idx_q)
        if joint.idx_v is not None:
            self._add_effects(one, joint.idx_v)
            self._of_velocity[joint.idx_v] = joint

    def _add_tendon(self, section: Any, joint: int, coupling: JointCoupling) -> None:
        """Add a fixed tendon for a slide that stands for one; its length is 0 at coordinates 0."""
        place, name = self._model.joints[joint], self._model.names[joint]
        tendon = etree.SubElement(section, "fixed", name=name)
        self._add_range(tendon, place.idx_q, coupling.constant)
        self._add_effects(tendon, place.idx_v)
        if "stiffness" in tendon.attrib:
            tendon.attrib.pop("springref", None)
            rest = self._source.effects.rest[place.idx_v] - coupling.constant
            tendon.set("springlength", number(np.nextafter(-1, 0) if rest == -1 else rest))
        for other, (ratio, *_) in zip(coupling.others, coupling.terms, strict=True):
            etree.SubElement(tendon, "joint", joint=other, coef=number(ratio))
        start = np.empty(0)
        self._of_velocity[place.idx_v] = MujocoJoint(name, "tendon", None, start)

    def _add_range(self, one: Any, idx_q: int, zero: float = 0.0) -> None:
        """Add limits of a coordinate that is `zero` where MuJoCo's is 0."""
        model = self._model
        limits = np.array([model.lowerPositionLimit[idx_q], model.upperPositionLimit[idx_q]])
        limits -= zero
        if (np.abs(limits) < FAR).any():
            low, high = np.clip(limits, -FAR, FAR)
            if low == high:  # which MuJoCo takes for no limits
                high = np.nextafter(high, np.inf)
            one.set("range", numbers([low, high]))

    def _add_effects(self, one: Any, idx_v: int) -> None:
        effects = self._source.effects
        for option, array in (
            ("damping", effects.damping),
            ("frictionloss", effects.friction),
            ("armature", self._model.armature),
            ("stiffness", effects.stiffness),
        ):
            if array[idx_v]:
                one.set(option, number(array[idx_v]))
        if effects.stiffness[idx_v] and effects.rest[idx_v]:
            one.set("springref", number(effects.rest[idx_v]))

    def _actuators(self) -> Any:
        """Return a motor for each coordinate that is driven, in the order of tau."""
        section = etree.Element("actuator")
        for name in self._source.actuated:
            velocities = named_velocities(self._model, name) or []
            for k in velocities:
                self._add_motor(section, name if len(velocities) == 1 else "", k)
        return section

    def _add_motor(self, section: Any, name: str, idx_v: int) -> None:
        """Add the motor of a velocity; `name` is empty if it shares its joint's."""
        joint, place = self._joint_of(idx_v)
        wanted = name or (joint.name if joint.kind in _ONE else f"{joint.name}_{place + 1}")
        motor = etree.SubElement(section, "motor", name=self._motor_names.fresh(wanted))
        motor.set("tendon" if joint.kind == "tendon" else "joint", joint.name)
        if joint.kind not in _ONE:
            motor.set("gear", numbers(np.eye(6)[place]))
        limits = np.array(
            [self._model.lowerEffortLimit[idx_v], self._model.upperEffortLimit[idx_v]]
        )
        if limits[0] < limits[1] and (np.abs(limits) < FAR).any():
            motor.set("ctrlrange", numbers(np.clip(limits, -FAR, FAR)))
            motor.set("forcerange", numbers(np.clip(limits, -FAR, FAR)))

    def _joint_of(self, idx_v: int) -> tuple[MujocoJoint, int]:
        """Return MuJoCo's joint with a velocity, and the velocity's place in it."""
        start = max(k for k in self._of_velocity if k <= idx_v)
        joint, place = self._of_velocity[start], idx_v - start
        own = next(
            i
            for i, one in enumerate(self._model.joints)
            if i and one.idx_v <= idx_v < one.idx_v + one.nv
        )
        slides = {"planar": 2, "free": 3}.get(kind_of(self._model.joints[own]), 0)
        if idx_v - self._model.joints[own].idx_v < slides:
            raise MechanismError(
                f"joint {self._model.names[own]!r} is driven along axes of the moving body; "
                "MuJoCo's motors on joints act along fixed axes. Choose other actuated joints, "
                "by with_actuated()"
            )
        return joint, place


def _placement(placement: pin.SE3) -> dict[str, str]:
    found = {}
    if placement.translation.any():
        found["pos"] = numbers(placement.translation)
    if not np.array_equal(placement.rotation, np.eye(3)):
        found["quat"] = numbers(quaternion(placement.rotation))
    return found
