"""Peers of the benchmarks: closed-loop dynamics written with Pinocchio alone and with MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from lxml import etree
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel

Array = NDArray[np.float64]

URDF = Path(__file__).parent.parent / "urdf"


class PlainPinocchio:
    """Closed-loop dynamics as in Pinocchio's examples, for spherical closures.

    `rows` selects the rows of each closure, in world axes: ``[0, 2]`` leaves a point free along y,
    as a `point_on_line` closure of a planar mechanism does.
    """

    def __init__(self, mechanism: ClosedLoopModel, rows: Sequence[int] = (0, 1, 2)) -> None:
        self.rows = [3 * k + row for k in range(len(mechanism.closures)) for row in rows]
        self.model = model = mechanism.model
        self.data = model.createData()
        self.models = pin.StdVec_RigidConstraintModel()
        self.datas = pin.StdVec_RigidConstraintData()
        for closure in mechanism.closures:
            self.models.append(closure.constraint_model(model))
        for constraint_model in self.models:
            self.datas.append(constraint_model.createData())
        self.actuated = list(mechanism.actuated_indices)
        self.passive = [i for i in range(model.nv) if i not in self.actuated]
        self.frames = [closure.frame_ids(model) for closure in mechanism.closures]

    def jacobian(self, q: Array) -> Array:
        pin.computeJointJacobians(self.model, self.data, q)
        for constraint_model, constraint_data in zip(self.models, self.datas, strict=True):
            constraint_model.calc(self.model, self.data, constraint_data)
        jacobian: Array = pin.getConstraintsJacobian(self.model, self.data, self.models, self.datas)
        return jacobian if len(self.rows) == len(jacobian) else jacobian[self.rows]

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        force = pin.rnea(self.model, self.data, q, v, a)
        jacobian = self.jacobian(q)
        multipliers = np.linalg.solve(jacobian[:, self.passive].T, force[self.passive])
        tau: Array = force[self.actuated] - jacobian[:, self.actuated].T @ multipliers
        return tau

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        """Solve the full KKT system, which massless links do not make singular."""
        model, data = self.model, self.data
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        axes = pin.LOCAL_WORLD_ALIGNED
        drift = np.concatenate(
            [
                pin.getFrameClassicalAcceleration(model, data, a, axes).linear
                - pin.getFrameClassicalAcceleration(model, data, b, axes).linear
                for a, b in self.frames
            ]
        )[self.rows]
        jacobian = self.jacobian(q)
        mass = pin.crba(model, data, q)
        force = -pin.nle(model, data, q, v)
        force[self.actuated] += tau
        size = len(drift)
        kkt = np.block([[mass, -jacobian.T], [jacobian, np.zeros((size, size))]])
        a: Array = np.linalg.solve(kkt, np.concatenate([force, -drift]))[: model.nv]
        return a


class ConstraintDynamics(PlainPinocchio):
    """Pinocchio's `constraintDynamics`; all links must have mass."""

    def __init__(self, mechanism: ClosedLoopModel) -> None:
        super().__init__(mechanism)
        pin.initConstraintDynamics(self.model, self.data, self.models, self.datas)
        self.settings = pin.ProximalSettings(1e-12, 1e-12, 10)
        self.force = np.zeros(self.model.nv)

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        self.force[self.actuated] = tau
        a: Array = pin.constraintDynamics(
            self.model, self.data, q, v, self.force, self.models, self.datas, self.settings
        )
        return a


class LoopConstrainedABA(ConstraintDynamics):
    """Pinocchio's `lcaba`, the articulated-body algorithm with loop constraints.

    It is proximal: with these settings it is within about 1e-10 of the exact accelerations.
    """

    def __init__(self, mechanism: ClosedLoopModel) -> None:
        super().__init__(mechanism)
        pin.computeJointMinimalOrdering(self.model, self.data, self.models)
        self.settings = pin.ProximalSettings(1e-12, 1e-4, 100)

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        self.force[self.actuated] = tau
        a: Array = pin.lcaba(
            self.model, self.data, q, v, self.force, self.models, self.datas, self.settings
        )
        return a


class Mujoco:
    """The same URDF in MuJoCo, with `connect` equalities for spherical closures."""

    def __init__(self, mechanism: ClosedLoopModel, urdf: str, q: Array, v: Array) -> None:
        tree = etree.fromstring(urdf.encode())
        options = {
            "balanceinertia": "true",  # the paper's platform is flatter than a rigid body can be
            "boundmass": "0",
            "boundinertia": "0",
            "discardvisual": "true",
        }
        etree.SubElement(etree.SubElement(tree, "mujoco"), "compiler", options)
        spec = mujoco.MjSpec.from_string(etree.tostring(tree, encoding="unicode"))
        for closure in mechanism.closures:
            sites = [self._site(spec, mechanism, f) for f in (closure.frame_a, closure.frame_b)]
            equality = spec.add_equality(
                type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_SITE
            )
            equality.name1, equality.name2 = sites
        for key in spec.joints:
            key.limited = False
        self.model = spec.compile()
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.data = mujoco.MjData(self.model)
        self._take_on(mechanism, q, v)
        self.actuated = [int(self.model.joint(n).dofadr[0]) for n in mechanism.actuated]
        self.passive = [i for i in range(self.model.nv) if i not in self.actuated]

    @staticmethod
    def _site(spec: mujoco.MjSpec, mechanism: ClosedLoopModel, frame: str) -> str:
        """Add a site at a frame of a link, and return its name."""
        body = spec.body(frame)
        body.add_site(name=f"{frame}_closed", pos=[0, 0, 0])
        return f"{frame}_closed"

    def _take_on(self, mechanism: ClosedLoopModel, q: Array, v: Array) -> None:
        for name, joint in list(zip(mechanism.model.names, mechanism.model.joints, strict=True))[
            1:
        ]:
            own = self.model.joint(name)
            at, dof = own.qposadr[0], own.dofadr[0]
            if joint.nq == 1:
                self.data.qpos[at], self.data.qvel[dof] = q[joint.idx_q], v[joint.idx_v]
                continue
            place, twist = q[joint.idx_q : joint.idx_q + 7], v[joint.idx_v : joint.idx_v + 6]
            turn = pin.Quaternion(place[3:]).matrix()
            self.data.qpos[at : at + 7] = [*place[:3], place[6], *place[3:6]]
            self.data.qvel[dof : dof + 6] = [*(turn @ twist[:3]), *twist[3:]]

    def inverse_dynamics(self) -> Array:
        """Solve with MuJoCo's position and velocity stages, its recursion, and NumPy."""
        model, data = self.model, self.data
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        force = np.zeros(model.nv)
        mujoco.mj_rne(model, data, 1, force)
        jacobian = data.efc_J.reshape(-1, model.nv)
        multipliers = np.linalg.solve(jacobian[:, self.passive].T, force[self.passive])
        tau: Array = force[self.actuated] - jacobian[:, self.actuated].T @ multipliers
        return tau

    def forward_dynamics(self) -> Array:
        """Return MuJoCo's acceleration, with soft constraints."""
        mujoco.mj_forward(self.model, self.data)
        a: Array = self.data.qacc
        return a
