"""Open tree of a MuJoCo model: joints, masses, frames, limits, gravity, key frames.

A body with several joints is a chain of joints, massless but for the last; bodies without joints
belong to what they are fixed on. A hinge or slide with a ``ref`` has that coordinate at the
placements of the file. Coordinates are those of MuJoCo's ``qpos`` in its order, but quaternions are
(x, y, z, w); after them come the lengths of the tendons that are joints here (see `tendons`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.column_names import joint_coordinates
from rps_pin.closed_loop.io.mjcf.source import MjcfSource
from rps_pin.errors import MechanismError
from rps_pin.validation import LARGEST

#: Frame of the world that bears MuJoCo's name for it.
WORLD = "world"
#: Kinds of joints, as MuJoCo numbers them.
FREE, BALL, SLIDE, HINGE = range(4)

_REVOLUTE = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelRevoluteUnaligned)
_PRISMATIC = (
    pin.JointModelPX,
    pin.JointModelPY,
    pin.JointModelPZ,
    pin.JointModelPrismaticUnaligned,
)


class MjcfTree:
    """The tree of a file, and the names in it.

    Attributes
    ----------
    source : MjcfSource
    model : pin.Model
        The tree, with limits, sites, gravity and reference configurations.
    joints : list of str
        Names of the joints, by MuJoCo's numbers.
    parts : list of list of str
        Names of the joints of the model that each of them is: one, or two of a free joint with
        rotors or dry friction, which are per axis of the world there.
    bodies, sites : list of str
        Names of their frames, by MuJoCo's numbers. They differ from MuJoCo's names where a joint,
        or a body, has the same: then ``_body``, or ``_site``, is appended.
    lengths : list of array
        Coefficients by qpos of the coordinates that follow it, each of shape (nq,).
    """

    def __init__(self, source: MjcfSource) -> None:
        self.source, m = source, source.model
        if not m.njnt:
            raise MechanismError(f"{source.origin} has no joints, so it is not a mechanism")
        self._taken = {"universe", WORLD}
        self.lengths: list[Array] = []
        given = [m.joint(i).name for i in range(m.njnt)]
        self.joints = [name and self.fresh(name, "joint") for name in given]
        self.parts: list[list[str]] = []
        self.bodies = [WORLD] + [self._named(m.body(i).name, "body") for i in range(1, m.nbody)]
        self.sites = [self._named(m.site(i).name, "site") for i in range(m.nsite)]
        self.model = pin.Model()
        self.model.name = source.name or "mechanism"
        self._on: list[tuple[int, pin.SE3]] = []
        for body in range(m.nbody):
            self._add_body(body)
        for site in range(m.nsite):
            if self.sites[site]:
                pose = pose_of(m.site_pos[site], m.site_quat[site])
                self._add_frame(self.sites[site], int(m.site_bodyid[site]), pose)
        self.model.gravity.linear = _gravity(source)

    def fresh(self, name: str, kind: str) -> str:
        """Return a name that nothing has: with the kind appended, then ``_``, if it is taken."""
        if name in self._taken:
            name = f"{name}_{kind}"
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return name

    def _named(self, name: str, kind: str) -> str:
        return name and self.fresh(name, kind)

    def anchor(self, name: str, body: int, pose: pin.SE3) -> str:
        """Add a frame fixed in a body; return its name, to which ``_`` is added if it is taken."""
        return self._add_frame(self.fresh(name, ""), body, pose)

    def _add_frame(self, name: str, body: int, pose: pin.SE3) -> str:
        joint, on = self._on[body]
        parent = self.model.getFrameId(self.bodies[body])
        frame = pin.Frame(name, joint, parent, on * pose, pin.FrameType.OP_FRAME)
        self.model.addFrame(frame)
        return name

    # Bodies and joints ----------------------------------------------------------------------------

    def _add_body(self, body: int) -> None:
        """Add a body with its joints; those before it, its parent among them, are there."""
        m, model = self.source.model, self.model
        joint, pose = self._on[m.body_parentid[body]] if body else (0, pin.SE3.Identity())
        pose = pose * pose_of(m.body_pos[body], m.body_quat[body])
        count = int(m.body_jntnum[body])
        if not self.bodies[body]:
            parent = self.bodies[m.body_parentid[body]]
            self.bodies[body] = self.fresh(f"{parent}_child", "")
        for k in range(count):
            number = int(m.body_jntadr[body]) + k
            if not self.joints[number]:
                unnamed = f"{self.bodies[body]}_joint" + (f"_{k + 1}" if count > 1 else "")
                self.joints[number] = self.fresh(unnamed, "")
            joint, pose = self._add_joint(number, joint, pose)
        self._on.append((joint, pose))
        if joint:
            inertia = np.diag(m.body_inertia[body])
            own = pose_of(m.body_ipos[body], m.body_iquat[body])
            at_com = pin.Inertia(float(m.body_mass[body]), np.zeros(3), inertia)
            model.appendBodyToJoint(joint, own.act(at_com), pose)
        model.addBodyFrame(self.bodies[body], joint, pose, model.frames[-1].parentFrame)

    def _add_joint(self, number: int, parent: int, pose: pin.SE3) -> tuple[int, pin.SE3]:
        """Add a joint; return its index and the placement of what it carries."""
        m = self.source.model
        kind = m.jnt_type[number]
        name, axis = self.joints[number], m.jnt_axis[number]
        ref = float(m.qpos0[m.jnt_qposadr[number]])
        still = pin.SE3.Identity()
        self.parts.append([name])
        if kind == FREE:
            if not axes_of_world(m, number):
                return self._added(name, parent, pin.JointModelFreeFlyer(), still), still
            self.parts[-1].insert(0, self.fresh(f"{name}_position", ""))
            parent = self._added(self.parts[-1][0], parent, pin.JointModelTranslation(), still)
            return self._added(name, parent, pin.JointModelSpherical(), still), still
        at = pin.SE3(np.eye(3), m.jnt_pos[number] if kind != SLIDE else np.zeros(3))
        placement = pose * at
        if kind == BALL:
            joint = pin.JointModelSpherical()
        elif kind == HINGE:
            joint = _about(axis, _REVOLUTE)
            placement *= pin.SE3(pin.exp3(-ref * axis) if ref else np.eye(3), np.zeros(3))
        else:
            joint = _about(axis, _PRISMATIC)
            placement *= pin.SE3(np.eye(3), -ref * axis)
        return self._added(name, parent, joint, placement), at.inverse()

    def _added(self, name: str, parent: int, joint: pin.JointModel, placement: pin.SE3) -> int:
        index = int(self.model.addJoint(parent, joint, placement, name))
        self.model.addJointFrame(index)
        place = self.model.joints[index]
        for limits, start, size in (
            (("PositionLimit",), place.idx_q, place.nq),
            (("EffortLimit", "VelocityLimit"), place.idx_v, place.nv),
        ):
            for limit in limits:
                getattr(self.model, f"lower{limit}")[start : start + size] = -np.inf
                getattr(self.model, f"upper{limit}")[start : start + size] = np.inf
        return index

    def add_length(self, name: str, coefficients: Array) -> str:
        """Add a slide without mass, on the world, for a sum of coordinates; return its name."""
        name = self.fresh(name, "tendon")
        self._added(name, 0, pin.JointModelPX(), pin.SE3.Identity())
        self.lengths.append(coefficients)
        return name

    def velocity(self, number: int, place: int) -> str:
        """Return the name of a joint, or of one of its velocities if it has several."""
        for name in self.parts[number]:
            coordinates = joint_coordinates(self.model, name) or (name,)
            if place < len(coordinates):
                found = coordinates[place]
                if found != name and self.model.existJointName(found):
                    self.source.refuse("joints", number, f"is driven in {found!r}, also a joint")
                return found
            place -= len(coordinates)
        raise IndexError(place)

    # Configurations -------------------------------------------------------------------------------

    def configuration(self, qpos: ArrayLike) -> Array:
        """Return the configuration of MuJoCo's ``qpos``, shape (nq,)."""
        m, values = self.source.model, np.array(qpos, dtype=np.float64)
        q = values.copy()
        for kind, start in zip(m.jnt_type, m.jnt_qposadr, strict=True):
            if kind in (FREE, BALL):
                first = int(start) + (3 if kind == FREE else 0)
                w, x, y, z = values[first : first + 4]
                q[first : first + 4] = np.array([x, y, z, w]) / np.linalg.norm([w, x, y, z])
        return np.concatenate([q, [length @ values for length in self.lengths]])

    def add_key_frames(self) -> Array:
        """Add the key frames that have names, and ``qpos0``; return ``home``, or else ``qpos0``."""
        m, configurations = self.source.model, self.model.referenceConfigurations
        found = {"qpos0": self.configuration(m.qpos0)}
        for key in range(m.nkey):
            if name := m.key(key).name:
                found[name] = self.configuration(m.key_qpos[key])
        for name, q in found.items():
            if not (np.abs(q) <= LARGEST).all():
                raise MechanismError(
                    f"{self.source.origin}: key frame {name!r} has numbers that are not finite, or "
                    f"beyond {LARGEST:g}"
                )
            configurations[name] = q
        return found.get("home", found["qpos0"])


def axes_of_world(model: Any, number: int) -> bool:
    """Return whether a free joint is two here: its rotors or dry friction are along the world's."""
    dof = model.jnt_dofadr[number]
    return bool(model.dof_armature[dof] or model.dof_frictionloss[dof])


def _about(axis: Array, kinds: tuple[type, ...]) -> pin.JointModel:
    """Return a joint about, or along, an axis; about x, y, z if it is one of them exactly."""
    *aligned, any_axis = kinds
    for unit, kind in zip(np.eye(3), aligned, strict=True):
        if np.array_equal(axis, unit):
            return kind()
    return any_axis(axis)


def pose_of(position: Array, quaternion: Array) -> pin.SE3:
    """Return the placement of MuJoCo's position and quaternion (w, x, y, z)."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), np.array(position))


def _gravity(source: MjcfSource) -> Array:
    """Return the acceleration of gravity less what ``gravcomp`` takes away, m/s^2."""
    m = source.model
    gravity = np.zeros(3) if source.disabled("gravity") else np.array(m.opt.gravity)
    moving = [b for b in range(1, m.nbody) if m.body_weldid[b] and m.body_mass[b]]
    shares = m.body_gravcomp
    lifted = [body for body in moving if shares[body]]
    if not (lifted and gravity.any()) or source.without_passive_forces:
        return gravity
    by_actuators = source.model.jnt_actgravcomp.astype(bool)
    if by_actuators.all():
        return gravity
    if by_actuators.any():
        source.refuse(
            "joints",
            int(by_actuators.argmax()),
            "has actuatorgravcomp, and other joints do not: read are gravcomp without it, and "
            "with it at all joints",
        )
    for body in moving:
        if shares[body] != shares[lifted[0]]:
            source.refuse(
                "bodies",
                body,
                f"has gravcomp {shares[body]:g}, and {m.body(lifted[0]).name!r} has "
                f"{shares[lifted[0]]:g}: it is read where all moving bodies have the same",
            )
    return np.asarray(gravity * (1.0 - shares[lifted[0]]))
