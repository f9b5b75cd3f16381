"""A mechanism beside the model that MuJoCo compiles from the same file.

Both are put into the same random closed state. Compared are the mass matrix of the tree, the forces
of a motion (`mj_inverse` with contacts, limits, equalities and dry friction off: masses, armature,
gravity, springs, damping), the equalities' residual and the motions that they allow, and the
acceleration from rest, which MuJoCo's own matrices give when its equalities are kept exactly.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from benchmarks.robot_files.find import MJCF, URDF
from rps_pin import ClosedLoopModel
from rps_pin.errors import RPSPinError

Array = NDArray[np.float64]

_SIZES = {"mjJNT_HINGE": (1, 1), "mjJNT_SLIDE": (1, 1), "mjJNT_BALL": (4, 3), "mjJNT_FREE": (7, 6)}
_CONTINUOUS = (2, 1)
"""Sizes of a turn without limits: cosine and sine."""
_OFF = ("CONTACT", "LIMIT", "FRICTIONLOSS")
_HEADER = (
    '<mujoco><compiler balanceinertia="false" fusestatic="true" discardvisual="true"/></mujoco>'
)


class NotComparableError(Exception):
    """The two models have no common coordinates."""


def compiled(path: Path, kind: str) -> tuple[Any, str]:
    """Return MuJoCo's model of an MJCF or URDF, or None and the reason."""
    try:
        if kind == MJCF:
            return mujoco.MjModel.from_xml_path(str(path)), ""
        if kind == URDF:
            return mujoco.MjModel.from_xml_string(_without_shapes(path)), ""
    except (ValueError, RuntimeError, mujoco.FatalError, UnicodeDecodeError) as error:
        return None, " ".join(str(error).split())
    return None, "not a file of MuJoCo's"


def _without_shapes(path: Path) -> str:
    """Return the text of a URDF without shapes, whose files MuJoCo looks for elsewhere."""
    text = re.sub(r"^\s*<\?xml[^>]*\?>", "", path.read_text("utf-8-sig"))
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    for tag in ("visual", "collision", "mujoco", "gazebo", "transmission"):
        text = re.sub(rf"<{tag}\b[^>]*?/>", "", text)
        text = re.sub(rf"<{tag}\b.*?</{tag}\s*>", "", text, flags=re.DOTALL)
    return text.replace("</robot>", f"{_HEADER}</robot>")


def not_a_mechanism(model: Any, why: str) -> str:
    """Return why an MJCF is counted apart, or nothing."""
    if model is None:
        return f"MuJoCo does not compile it: {why}"
    if model.nflex or model.nskin:
        return "flexible bodies"
    if not model.njnt:
        return "no joints"
    return ""


def differences(mechanism: ClosedLoopModel, model: Any, seed: int = 1) -> dict[str, float]:
    """Return the relative differences by quantity, in a random closed state.

    Raises
    ------
    NotComparableError
        If the joints are not the same.
    """
    twin = Twin(mechanism, model)
    rng = np.random.default_rng(seed)
    q = random_closed(mechanism, rng)
    motions = mechanism.allowed_motions(q)
    v = motions @ rng.normal(size=motions.shape[1])
    a = rng.normal(size=v.size)
    mass, forces = twin.mass_and_forces(q, v, a)
    tree, effects = mechanism.model, mechanism.effects
    ours = mechanism.generalised_force(q, v, a)
    if effects is not None:
        ours = ours - effects.friction * np.tanh(v / effects.friction_speed)
    found = {
        "mass matrix": _relative(_mass(tree, q), mass),
        "forces": _relative(ours, forces),
    }
    residual, rows = twin.equalities(q)
    if rows.size:
        found["equality residual"] = float(np.abs(residual).max())
        found["allowed motions"] = _relative(rows @ motions + 1.0, np.ones((len(rows), 1)))
    rank = int(np.linalg.matrix_rank(rows, rtol=1e-8)) if rows.size else 0
    found["rank"] = float(abs(v.size - motions.shape[1] - rank))
    tau = rng.normal(size=mechanism.actuated_indices.size)
    still = np.zeros(v.size)
    try:
        ours = mechanism.forward_dynamics(q, still, tau)
    except RPSPinError:
        return found
    found["acceleration"] = _relative(ours, twin.acceleration(q, tau, motions))
    return found


def random_closed(mechanism: ClosedLoopModel, rng: np.random.Generator) -> Array:
    """Return a closed configuration near home, or home itself where none is found."""
    home = mechanism.home
    for size in (0.3, 0.1, 0.03):
        guess = pin.integrate(mechanism.model, home, size * rng.normal(size=mechanism.model.nv))
        try:
            return mechanism.close(guess, within_limits=False, restarts=0)
        except RPSPinError:
            continue
    return home


def _mass(tree: pin.Model, q: Array) -> Array:
    data = tree.createData()
    upper = np.triu(pin.crba(tree, data, q))
    return upper + np.triu(upper, 1).T


def _relative(ours: Array, theirs: Array) -> float:
    return float(np.abs(ours - theirs).max() / max(np.abs(theirs).max(), 1e-9))


class Twin:
    """MuJoCo's model with the coordinates of a mechanism."""

    def __init__(self, mechanism: ClosedLoopModel, model: Any) -> None:
        self.mechanism, self.model = mechanism, model
        for flag in _OFF:
            model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")
        model.opt.enableflags = 0
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.data = mujoco.MjData(model)
        self.pairs = self._pairs()
        self.fixed = self._fixed()

    def _pairs(self) -> list[tuple[int, int]]:
        """Return MuJoCo's and Pinocchio's index of each joint: by name, the unnamed in order."""
        tree, model = self.mechanism.model, self.model
        names = {name: index for index, name in enumerate(tree.names) if index}
        pairs, unnamed = [], []
        for joint in range(model.njnt):
            index = names.pop(model.joint(joint).name, None)
            if index is not None:
                pairs.append((joint, index))
            elif not model.joint(joint).name:
                unnamed.append(joint)
        if len(unnamed) < len(names):
            raise NotComparableError(f"MuJoCo has no joint for {', '.join(names)}")
        pairs += zip(unnamed, names.values(), strict=False)
        for joint, index in pairs:
            size = tree.joints[index].nq, tree.joints[index].nv
            size = (1, 1) if size == _CONTINUOUS else size
            if size != _SIZES[mujoco.mjtJoint(model.jnt_type[joint]).name]:
                raise NotComparableError(
                    f"joint {tree.names[index]!r} has other coordinates in MuJoCo"
                )
        return pairs

    def _fixed(self) -> dict[int, float]:
        """Return the coordinates that equalities of one joint fix, by address."""
        model, found = self.model, {}
        for row in range(model.neq):
            alone = model.eq_obj2id[row] < 0 and model.eq_active0[row]
            if model.eq_type[row] == mujoco.mjtEq.mjEQ_JOINT and alone:
                place = model.jnt_qposadr[model.eq_obj1id[row]]
                found[int(place)] = model.qpos0[place] + model.eq_data[row][0]
        return found

    def put(self, q: Array) -> Array:
        """Set qpos; return P with MuJoCo's velocity = P times Pinocchio's."""
        tree, model, data = self.mechanism.model, self.model, self.data
        mujoco.mj_resetData(model, data)
        for place, value in self.fixed.items():
            data.qpos[place] = value
        transform = np.zeros((model.nv, tree.nv))
        for number, index in self.pairs:
            joint = tree.joints[index]
            own = q[joint.idx_q :][: joint.nq]
            turn = np.eye(joint.nv)
            if joint.nq == 7:  # linear velocity in world axes
                own = own[[0, 1, 2, 6, 3, 4, 5]]
                turn[:3, :3] = pin.Quaternion(q[joint.idx_q :][3:7]).matrix()
            elif joint.nq == 4:
                own = own[[3, 0, 1, 2]]
            elif (joint.nq, joint.nv) == _CONTINUOUS:
                own = np.arctan2(own[1:], own[:1])
            place, dof = model.jnt_qposadr[number], model.jnt_dofadr[number]
            data.qpos[place : place + own.size] = own
            transform[dof : dof + joint.nv, joint.idx_v : joint.idx_v + joint.nv] = turn
        return transform

    def mass_and_forces(self, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Return the mass matrix and the forces of a motion in Pinocchio's coordinates."""
        transform = self.put(q)
        model, data = self.model, self.data
        off = mujoco.mjtDisableBit.mjDSBL_EQUALITY
        model.opt.disableflags |= off
        data.qvel[:] = transform @ v
        drift = a.copy()  # of the linear velocity: w x v in body axes
        for _, index in self.pairs:
            joint = self.mechanism.model.joints[index]
            if joint.nq == 7:
                twist = v[joint.idx_v :][:6]
                drift[joint.idx_v : joint.idx_v + 3] += np.cross(twist[3:], twist[:3])
        data.qacc[:] = transform @ drift
        mujoco.mj_inverse(model, data)
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        model.opt.disableflags &= ~int(off)
        return transform.T @ mass @ transform, transform.T @ data.qfrc_inverse

    def equalities(self, q: Array) -> tuple[Array, Array]:
        """Return residual and Jacobian of the equalities between joints that move."""
        transform = self.put(q)
        model, data = self.model, self.data
        mujoco.mj_fwdPosition(model, data)
        kinds = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        rows = data.efc_J.reshape(-1, model.nv)[kinds] @ transform
        moving = np.abs(rows).max(axis=1, initial=0.0) > 0
        return data.efc_pos[kinds][moving], rows[moving]

    def acceleration(self, q: Array, tau: Array, motions: Array) -> Array:
        """Return the acceleration from rest with MuJoCo's masses and forces, exactly constrained.

        N (N' M N)^-1 N' (S' tau - h): `motions` are N, compared with the equalities elsewhere.
        """
        still = np.zeros(motions.shape[0])
        mass, forces = self.mass_and_forces(q, still, still)
        forces = -forces
        forces[self.mechanism.actuated_indices] += tau
        reduced = motions.T @ mass @ motions
        found: Array = motions @ np.linalg.solve(reduced, motions.T @ forces)
        return found
