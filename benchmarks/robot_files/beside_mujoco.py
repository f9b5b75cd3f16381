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
DUST = 1e-14
"""Mass of a link with an inertia and no mass, kg: enough for MuJoCo to take it."""
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
    text = re.sub(r"<inertial\b.*?</inertial\s*>", _with_mass, text, flags=re.DOTALL)
    return text.replace("</robot>", f"{_HEADER}</robot>")


def _with_mass(inertial: re.Match[str]) -> str:
    """Give an inertia without mass some dust, without which MuJoCo leaves it out."""
    if not re.search(r"\bi[xyz]{2}\s*=\s*[\"']\s*[-+.0eE]*[1-9]", inertial[0]):
        return inertial[0]
    return re.sub(
        r"(<mass\b[^>]*value\s*=\s*[\"'])\s*[-+]?0*\.?0*([\"'])", rf"\g<1>{DUST}\2", inertial[0]
    )


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
    a = twin.lengths @ rng.normal(size=v.size)
    mass, forces = twin.mass_and_forces(q, v, a)
    tree, effects = mechanism.model, mechanism.effects
    ours = mechanism.generalised_force(q, v, a)
    if effects is not None:
        ours = ours - effects.friction * np.tanh(v / effects.friction_speed)
    found = {
        "mass matrix": _relative(twin.lengths.T @ _mass(tree, q) @ twin.lengths, mass),
        "forces": _relative(twin.lengths.T @ ours, forces),
    }
    residual, rows = twin.equalities(q)
    if rows.size:
        found["equality residual"] = float(np.abs(residual).max())
        found["allowed motions"] = _relative(rows @ motions + 1.0, np.ones((len(rows), 1)))
    rank = int(np.linalg.matrix_rank(rows, rtol=1e-8)) if rows.size else 0
    found["rank"] = float(abs(model.nv - motions.shape[1] - rank))
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
    largest = np.abs(theirs).max(initial=0.0)
    return float(np.abs(ours - theirs).max(initial=0.0) / max(largest, 1e-9))


class Twin:
    """MuJoCo's model with the coordinates of a mechanism.

    A fixed tendon may be a joint of the mechanism, whose coordinate is its length. `lengths`
    expresses a velocity by that without tendons, shape (nv, nv): the identity if there are none.
    """

    def __init__(self, mechanism: ClosedLoopModel, model: Any) -> None:
        self.mechanism, self.model = mechanism, model
        for flag in _OFF:
            model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")
        model.opt.enableflags = 0
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.data = mujoco.MjData(model)
        self.pairs, tendons = self._pairs()
        self.lengths = self._lengths(tendons)

    def _pairs(self) -> tuple[list[tuple[int, list[int]]], list[tuple[int, int]]]:
        """Return MuJoCo's and Pinocchio's indices of joints, and of tendons that are joints.

        Joints are told by name, the unnamed by their order. A free joint may be two of
        Pinocchio's: a translation and a ball.
        """
        tree, model = self.mechanism.model, self.model
        names = {name: index for index, name in enumerate(tree.names) if index}
        given = [model.joint(joint).name for joint in range(model.njnt)]
        tendons = []
        for tendon in range(model.ntendon):
            name = model.tendon(tendon).name or f"tendon_{tendon + 1}"
            for option in (f"{name}_tendon", name):  # the first where another has its name
                if option in names and option not in given and tree.nvs[names[option]] == 1:
                    tendons.append((tendon, names.pop(option)))
                    break
        own = [[names.pop(name)] if name in names else [] for name in given]
        for name, indices in zip(given, own, strict=True):
            if indices and tree.nqs[indices[0]] == 4 and f"{name}_position" in names:
                indices.insert(0, names.pop(f"{name}_position"))
        unnamed = iter(names.values())
        pairs = []
        for joint, indices in enumerate(own):
            size = _SIZES[mujoco.mjtJoint(model.jnt_type[joint]).name]
            while not given[joint] and sum(tree.nvs[i] for i in indices) < size[1]:
                indices.append(next(unnamed, 0))
            if not indices:
                continue  # it does not move in the mechanism
            place = tree.joints[indices[0]]
            ours = sum(tree.nqs[i] for i in indices), sum(tree.nvs[i] for i in indices)
            if size != ((1, 1) if (place.nq, place.nv) == _CONTINUOUS else ours):
                raise NotComparableError(
                    f"joint {tree.names[indices[0]]!r} has other coordinates in MuJoCo"
                )
            pairs.append((joint, indices))
        if left := list(unnamed):
            raise NotComparableError(
                f"MuJoCo has no joint for {', '.join(tree.names[i] for i in left)}"
            )
        return pairs, tendons

    def _lengths(self, tendons: list[tuple[int, int]]) -> Array:
        tree, model = self.mechanism.model, self.model
        found = np.eye(tree.nv)
        places = {joint: tree.idx_vs[indices[0]] for joint, indices in self.pairs}
        for tendon, index in tendons:
            row = tree.idx_vs[index]
            found[row] = 0.0
            for wrap in range(
                model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon]
            ):
                found[row, places[model.wrap_objid[wrap]]] += model.wrap_prm[wrap]
        return found

    def put(self, q: Array) -> Array:
        """Set qpos; return P with MuJoCo's velocity = P times Pinocchio's."""
        tree, model, data = self.mechanism.model, self.model, self.data
        mujoco.mj_resetData(model, data)
        transform = np.zeros((model.nv, tree.nv))
        for number, indices in self.pairs:
            place, dof = model.jnt_qposadr[number], model.jnt_dofadr[number]
            for index in indices:
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
                data.qpos[place : place + own.size] = own
                transform[dof : dof + joint.nv, joint.idx_v : joint.idx_v + joint.nv] = turn
                place, dof = place + own.size, dof + joint.nv
        return transform

    def mass_and_forces(self, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Return the mass matrix and the forces of a motion in Pinocchio's coordinates."""
        transform = self.put(q)
        model, data = self.model, self.data
        off = mujoco.mjtDisableBit.mjDSBL_EQUALITY
        model.opt.disableflags |= off
        data.qvel[:] = transform @ v
        drift = a.copy()  # of the linear velocity: w x v in body axes
        for joint in self.mechanism.model.joints:
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
