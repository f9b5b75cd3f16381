"""A file as MuJoCo has it beside what was read of it, and random files."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rps_pin.closed_loop.constraints.closures import JointCoupling
from rps_pin.closed_loop.constraints.equations import ClosureEquations
from rps_pin.closed_loop.dynamics.passive_joint_forces import JointEffects
from rps_pin.closed_loop.dynamics.springs import Springs
from rps_pin.closed_loop.io.mjcf import parts_from_mjcf
from rps_pin.closed_loop.io.parts import MechanismParts

Array = NDArray[np.float64]

INERTIAL = '<inertial pos="0.1 0.02 -0.03" mass="1.3" diaginertia="0.02 0.03 0.04"/>'
BODY = f'<body name="b"><joint name="j"/>{INERTIAL}</body>'


def mujoco_file(world: str, *others: str) -> str:
    return f'<mujoco model="m">{"".join(others)}<worldbody>{world}</worldbody></mujoco>'


def fourbar(*others: str, joint: str = "") -> str:
    """Crank, coupler and rocker, drawn closed; equalities and the like are for `others`."""
    return mujoco_file(
        f"""<body name="crank" pos="0 0 0.2"><joint name="j1" axis="0 1 0" {joint}/>{INERTIAL}
          <body name="coupler" pos="0.3 0 0"><joint name="j2" axis="0 1 0"/>{INERTIAL}
            <site name="tip" pos="0.4 0 0" euler="10 20 30"/></body></body>
        <body name="rocker" pos="0.7 0 0.2" quat="1 0 0.3 0">
          <joint name="j3" axis="0 1 0" pos="0 0 -0.2"/>{INERTIAL}
          <site name="knee" pos="0 0 0.1" zaxis="1 2 3"/></body>""",
        *others,
    )


def equalities(*elements: str) -> str:
    return f"<equality>{''.join(elements)}</equality>"


class Twin:
    """A file in MuJoCo and in Pinocchio, in one state.

    `L` takes MuJoCo's velocities to Pinocchio's, `L_rate` is its rate; `q` and `v` are the state.
    """

    def __init__(self, source: str | Path, parts: MechanismParts | None = None) -> None:
        if isinstance(source, Path):
            self.m = mujoco.MjModel.from_xml_path(str(source))
        else:
            self.m = mujoco.MjModel.from_xml_string(source)
        self.d = mujoco.MjData(self.m)
        self.parts = parts or read(source)[0]
        self.model = self.parts.model
        self.data = self.model.createData()
        self.lengths = {
            closure.joint: closure.other
            for closure in self.parts.closures
            if isinstance(closure, JointCoupling) and closure.name == f"{closure.joint}:length"
        }

    def place(self, name: str) -> Any:
        return self.model.joints[self.model.getJointId(name)]

    def set(self, qpos: Array, qvel: Array) -> None:
        m, model = self.m, self.model
        self.d.qpos[:], self.d.qvel[:] = qpos, qvel
        mujoco.mj_forward(m, self.d)
        q, L, L_rate = np.zeros(model.nq), np.zeros((model.nv, m.nv)), np.zeros((model.nv, m.nv))
        q[: m.nq] = qpos
        np.fill_diagonal(L, 1.0)
        ids = iter(range(1, model.njoints))
        for kind, at, dof in zip(m.jnt_type, m.jnt_qposadr, m.jnt_dofadr, strict=True):
            joint = model.joints[next(ids)]
            if kind in (0, 1):
                first = at + 3 * (kind == 0)
                q[first : first + 4] = q[[first + 1, first + 2, first + 3, first]]
            if kind == 0 and joint.nv == 6:
                rotation = pin.Quaternion(q[at + 3 : at + 7]).toRotationMatrix()
                block = slice(dof, dof + 3)
                L[block, block] = rotation.T
                L_rate[block, block] = -pin.skew(qvel[dof + 3 : dof + 6]) @ rotation.T
            elif kind == 0:
                next(ids)
        for name, others in self.lengths.items():
            place = self.place(name)
            for other, ratio in others.items():
                q[place.idx_q] += ratio * q[self.place(other).idx_q]
                L[place.idx_v] += ratio * L[self.place(other).idx_v]
        self.q, self.v, self.L, self.L_rate = q, L @ qvel, L, L_rate

    def random(self, rng: np.random.Generator, size: float = 1.0) -> None:
        qpos = self.m.qpos0.copy()
        mujoco.mj_integratePos(self.m, qpos, size * rng.normal(size=self.m.nv), 1.0)
        self.set(qpos, rng.normal(size=self.m.nv))

    # In MuJoCo's coordinates ----------------------------------------------------------------------

    def masses(self) -> tuple[Array, Array]:
        """M as read here, and MuJoCo's."""
        full = np.zeros((self.m.nv, self.m.nv))
        for column, unit in zip(full, np.eye(self.m.nv), strict=True):
            mujoco.mj_mulM(self.m, self.d, column, unit)
        return self.L.T @ self._mass() @ self.L, full

    def _mass(self) -> Array:
        mass = pin.crba(self.model, self.data, self.q)
        return np.triu(mass) + np.triu(mass, 1).T

    def bias(self) -> tuple[Array, Array]:
        own = pin.nonLinearEffects(self.model, self.data, self.q, self.v)
        drift = self._mass() @ self.L_rate @ self.d.qvel
        by_actuators = self.m.jnt_actgravcomp[self.m.dof_jntid]
        lifted = np.where(by_actuators, 0.0, self.d.qfrc_gravcomp)
        return self.L.T @ (own + drift), self.d.qfrc_bias - lifted

    def passive(self) -> tuple[Array, Array]:
        """Springs and dampers, without gravity compensation and dry friction."""
        effects = self.effects()
        own = effects.damping * self.v + Springs(self.model, effects).force(self.q)
        return -self.L.T @ own, self.d.qfrc_spring + self.d.qfrc_damper

    def effects(self) -> JointEffects:
        p = self.parts
        return JointEffects.named(
            self.model, damping=p.damping, friction=p.friction, stiffness=p.stiffness, rest=p.rest
        )

    def rows(self) -> tuple[Array, Array]:
        """Rows of the equalities: J here by MuJoCo's velocities, and MuJoCo's."""
        own = ClosureEquations(self.model, self.parts.closures).jacobian(self.q) @ self.L
        of_equalities = self.d.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        dense = np.zeros((self.d.nefc, self.m.nv))
        if mujoco.mj_isSparse(self.m):
            mujoco.mju_sparse2dense(
                dense, self.d.efc_J, self.d.efc_J_rownnz, self.d.efc_J_rowadr, self.d.efc_J_colind
            )
        else:
            dense[:] = self.d.efc_J.reshape(-1, self.m.nv)
        return own, dense[of_equalities]

    def gaps(self) -> Array:
        return self.d.efc_pos[self.d.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]


def read(source: str | Path, **options: Any) -> tuple[MechanismParts, list[str]]:
    """What is read of a file, and what the warnings say."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        parts = parts_from_mjcf(source, **options)
    return parts, [str(one.message) for one in caught]
