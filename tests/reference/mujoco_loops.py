"""The same URDF in MuJoCo, its loops closed by algebra of our own: S' tau + J' lambda = M a + bias.

MuJoCo gives the right side (`mj_inverse`, its own constraints off) and the Jacobians of points.
Its free joint's velocity is (linear in world axes, angular in body axes).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.reference import jets
from tests.reference.newton_euler import Jet
from tests.worst import worst

Array = NDArray[np.float64]
Point = tuple[str, Array]

URDF = Path(__file__).resolve().parents[2] / "urdf"


class MujocoLoops:
    """An open tree in MuJoCo, and pairs of points of its bodies that coincide."""

    def __init__(self, name: str, pairs: Sequence[tuple[Point, Point]]) -> None:
        self.mujoco: Any = pytest.importorskip("mujoco")
        tree = etree.fromstring((URDF / f"{name}.urdf").read_bytes())
        options = {"balanceinertia": "false", "boundmass": "0", "boundinertia": "0"}
        etree.SubElement(etree.SubElement(tree, "mujoco"), "compiler", options)
        self.model = self.mujoco.MjModel.from_xml_string(etree.tostring(tree, encoding="unicode"))
        self.model.opt.disableflags |= self.mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.data = self.mujoco.MjData(self.model)
        self.pairs = tuple(pairs)

    def put(self, joints: Mapping[str, Jet]) -> None:
        """Take on a motion, given joint by joint (one coordinate each)."""
        for name, jet in joints.items():
            joint = self.model.joint(name)
            self.data.qpos[joint.qposadr[0]] = jet.value
            self.data.qvel[joint.dofadr[0]] = jet.first
            self.data.qacc[joint.dofadr[0]] = jet.second

    def put_free(self, name: str, position: Jet, rotation: Jet) -> None:
        """Take on the motion of a free body."""
        joint = self.model.joint(name)
        place, dof = joint.qposadr[0], joint.dofadr[0]
        R = rotation.value
        quaternion = Rotation.from_matrix(R).as_quat()[[3, 0, 1, 2]]
        self.data.qpos[place : place + 7] = np.concatenate([position.value, quaternion])
        spin, spin_rate = R.T @ jets.spin(rotation), R.T @ jets.spin_rate(rotation)
        self.data.qvel[dof : dof + 6] = np.concatenate([position.first, spin])
        self.data.qacc[dof : dof + 6] = np.concatenate([position.second, spin_rate])

    def inverse_dynamics(self, driven: Sequence[str]) -> tuple[Array, Array, float]:
        """Of the motion taken on: tau, the force at each pair (k, 3), and the relative residual.

        The force is that of the second body on the first.
        """
        acceleration = self.data.qacc.copy()
        self.mujoco.mj_inverse(self.model, self.data)
        assert np.array_equal(acceleration, self.data.qacc)
        right = self.data.qfrc_inverse.copy()
        columns = [np.eye(self.model.nv)[int(self.model.joint(n).dofadr[0])] for n in driven]
        rows = [self._row(*pair) for pair in self.pairs]
        matrix = np.column_stack([*columns, *(row.T for row in rows)])
        solution = np.linalg.lstsq(matrix, right, rcond=None)[0]
        residual = np.linalg.norm(matrix @ solution - right) / np.linalg.norm(right)
        k = len(driven)
        return solution[:k], solution[k:].reshape(-1, 3), float(residual)

    def reduced_mass(self, driven: Sequence[str]) -> Array:
        """T' M T, T_a = 1 and T_p = -J_p^-1 J_a, at the motion taken on."""
        self.mujoco.mj_fwdPosition(self.model, self.data)
        nv = self.model.nv
        a = [int(self.model.joint(name).dofadr[0]) for name in driven]
        p = [i for i in range(nv) if i not in a]
        rows = np.vstack([self._row(*pair) for pair in self.pairs])
        basis, mass = np.zeros((nv, len(a))), np.zeros((nv, nv))
        basis[a] = np.eye(len(a))
        # Of a plane mechanism one row of each pair is zero.
        basis[p] = -np.linalg.lstsq(rows[:, p], rows[:, a], rcond=None)[0]
        self.mujoco.mj_fullM(self.model, self.data, mass)
        return basis.T @ mass @ basis

    def gap(self) -> float:
        """The largest distance between the points of a pair."""
        self.mujoco.mj_kinematics(self.model, self.data)
        return worst([np.linalg.norm(self._at(a) - self._at(b)) for a, b in self.pairs])

    def loop_rate(self) -> float:
        """The largest speed at which a pair opens."""
        self.mujoco.mj_fwdPosition(self.model, self.data)
        return worst(*(self._row(a, b) @ self.data.qvel for a, b in self.pairs))

    def _at(self, point: Point) -> Array:
        body = self.data.body(point[0])
        return body.xpos + body.xmat.reshape(3, 3) @ point[1]

    def _row(self, a: Point, b: Point) -> Array:
        jacobians = []
        for point in (a, b):
            jacobian = np.zeros((3, self.model.nv))
            where, body = self._at(point), self.model.body(point[0]).id
            self.mujoco.mj_jac(self.model, self.data, jacobian, None, where, body)
            jacobians.append(jacobian)
        return jacobians[0] - jacobians[1]
