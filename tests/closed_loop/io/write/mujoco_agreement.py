"""A mechanism and MuJoCo's model of it, compared at closed states; none of the writer's formulas.

MuJoCo's joints are found by their names. Coordinates of those that the mechanism does not have (of
bodies that the writer cut) are found by making MuJoCo's own residuals small.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rps_pin import ClosedLoopModel

Array = NDArray[np.float64]


class Agreement(NamedTuple):
    """Largest differences; each but the ranks relative to the mechanism's own number."""

    gap: float
    """MuJoCo's residuals, m or rad."""
    rate: float
    """Rates of those for motions that the mechanism allows."""
    mobility: int
    """Of the mechanism, less MuJoCo's."""
    mass: float
    """N' M N, N the mechanism's allowed motions."""
    weight: float
    """N' (gravity + springs)."""
    losses: float
    """N' (damping)."""
    force: float
    """N' (M a + bias) of a motion."""


class MujocoTwin:
    """A file in MuJoCo, that takes on states of the mechanism it was written of."""

    def __init__(self, mechanism: ClosedLoopModel, path: Path) -> None:
        self.mechanism, self.tree = mechanism, mechanism.model
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
        self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.data = mujoco.MjData(self.model)
        if self.model.nkey:
            mujoco.mj_resetDataKeyframe(self.model, self.data, 0)

    # Coordinates ----------------------------------------------------------------------------------

    def _joint(self, name: str) -> Any:
        return self.model.joint(name)

    def _has(self, name: str) -> bool:
        return mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0

    def _rows(self, name: str) -> list[str]:
        """The joints in MuJoCo that stand for one of the mechanism, from the base outwards."""
        parts = [f"{name}:{k}" for k in range(1, 9)]
        letters = [f"{name}_{letter}" for letter in "xyz"]
        others = [part for part in [*parts, *letters] if self._has(part)]
        return [*others, name, *([f"{name}_slide"] if self._has(f"{name}_slide") else [])]

    def put(self, q: Array) -> None:
        """Take on a configuration, and find the coordinates of the other joints."""
        own = np.zeros(self.model.nv, dtype=bool)
        for index in range(1, self.tree.njoints):
            self._put_joint(index, q, own)
        for _ in range(20):
            mujoco.mj_fwdPosition(self.model, self.data)
            rows = self.rows()[:, ~own]
            if not rows.size:
                return
            step = np.zeros(self.model.nv)
            step[~own] = -np.linalg.lstsq(rows, self.residuals(), rcond=None)[0]
            mujoco.mj_integratePos(self.model, self.data.qpos, step, 1.0)
        mujoco.mj_fwdPosition(self.model, self.data)

    def _put_joint(self, index: int, q: Array, own: NDArray[np.bool_]) -> None:
        name, one = self.tree.names[index], self.tree.joints[index]
        values = q[one.idx_q : one.idx_q + one.nq]
        rows = [self._joint(part) for part in self._rows(name)]
        for row in rows:
            size = {0: 6, 1: 3}.get(int(row.type[0]), 1)
            own[row.dofadr[0] : row.dofadr[0] + size] = True
        kind = one.shortname().removeprefix("JointModel")
        if kind == "FreeFlyer" and len(rows) == 1:
            placed = self.tree.jointPlacements[index] * pin.XYZQUATToSE3(values)
            quaternion = Rotation.from_matrix(placed.rotation).as_quat()
            values = np.concatenate([placed.translation, np.roll(quaternion, 1)])
            self._set(rows[0], values)
            return
        if kind in ("FreeFlyer", "Planar"):
            for row, value in zip(rows[:-1], values, strict=False):
                self._set(row, [value])
            values, rows = values[len(rows) - 1 :], rows[-1:]
        if kind.startswith("Helical") or kind.startswith("H"):
            data = one.createData()
            one.calc(data, np.zeros(self.tree.nq))
            twist = np.asarray(data.S).reshape(6)
            values = np.array([values[0], values[0] * (twist[:3] @ twist[3:])])
        if kind.startswith("RUB") or kind.startswith("RevoluteUnb") or kind == "Planar":
            values = np.array([np.arctan2(values[1], values[0])])
        if kind in ("Spherical", "FreeFlyer"):
            values = np.roll(values, 1)
            self._set(rows[0], values)
            return
        for row, value in zip(rows, values, strict=True):
            self._set(row, [value])

    def _set(self, row: Any, values: Any) -> None:
        start = row.qposadr[0]
        self.data.qpos[start : start + len(values)] = values

    # Constraints ----------------------------------------------------------------------------------

    def rows(self) -> Array:
        """The Jacobian of the equalities at the configuration that was put."""
        count = int(np.sum(self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY))
        return np.array(self.data.efc_J).reshape(-1, self.model.nv)[:count]

    def residuals(self) -> Array:
        """Their residuals."""
        count = int(np.sum(self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY))
        return np.array(self.data.efc_pos[:count])

    # Velocities -----------------------------------------------------------------------------------

    def motions(self, q: Array, motions: Array) -> Array:
        """MuJoCo's velocities for those of the mechanism, exact: names, axes and its residuals."""
        self.put(q)
        columns = np.zeros((self.model.nv, motions.shape[1]))
        own = np.zeros(self.model.nv, dtype=bool)
        for index in range(1, self.tree.njoints):
            one, name = self.tree.joints[index], self.tree.names[index]
            block = motions[one.idx_v : one.idx_v + one.nv]
            rows = [self._joint(part) for part in self._rows(name)]
            kind = one.shortname().removeprefix("JointModel")
            if kind in ("FreeFlyer", "Planar"):
                values = q[one.idx_q : one.idx_q + one.nq]
                if kind == "Planar":
                    c, s = values[2:]
                    turn = np.array([[c, -s], [s, c]])
                else:
                    turn = pin.XYZQUATToSE3(values).rotation
                    if len(rows) == 1:
                        turn = self.tree.jointPlacements[index].rotation @ turn
                size = len(turn)
                block = np.vstack([turn @ block[:size], block[size:]])
            if kind.startswith("H"):
                data = one.createData()
                one.calc(data, np.zeros(self.tree.nq))
                twist = np.asarray(data.S).reshape(6)
                block = np.vstack([block, block * (twist[:3] @ twist[3:])])
            at = 0
            for row in rows:
                size = {0: 6, 1: 3}.get(int(row.type[0]), 1)
                dofs = slice(row.dofadr[0], row.dofadr[0] + size)
                columns[dofs], own[dofs] = block[at : at + size], True
                at += size
            assert at == len(block)
        jacobian = self.rows()
        if (~own).any():
            columns[~own] = -np.linalg.lstsq(
                jacobian[:, ~own], jacobian[:, own] @ columns[own], rcond=None
            )[0]
        return columns


def agreement(mechanism: ClosedLoopModel, path: Path, seed: int = 0) -> Agreement:
    """Compare a mechanism with its file at a closed configuration near its home."""
    rng = np.random.default_rng(seed)
    twin, model = MujocoTwin(mechanism, path), mechanism.model
    start = mechanism.home
    N = mechanism.allowed_motions(start)
    q = mechanism.project(pin.integrate(model, start, N @ _random(N, 0.1, rng)))
    N = mechanism.allowed_motions(q)
    T = twin.motions(q, N)
    gap = np.abs(twin.residuals()).max(initial=0.0)
    rows = twin.rows()
    rate = np.abs(rows @ T).max(initial=0.0)
    rank = np.linalg.matrix_rank(rows, 1e-7) if rows.size else 0
    mobility = N.shape[1] - (twin.model.nv - rank)
    mass = np.zeros((twin.model.nv, twin.model.nv))
    mujoco.mj_fullM(twin.model, twin.data, mass)
    own = pin.crba(model, model.createData(), q)
    own = np.triu(own) + np.triu(own, 1).T
    twin.data.qvel[:] = 0
    mujoco.mj_forward(twin.model, twin.data)
    weight = twin.data.qfrc_bias - twin.data.qfrc_passive
    still = np.zeros(model.nv)
    u = _random(N, 1.0, rng)
    v = N @ u
    opening = mechanism.loop_errors(q, v, still).acceleration
    a = N @ _random(N, 1.0, rng)
    if opening.size:
        a -= np.linalg.lstsq(mechanism.jacobian(q), opening, rcond=None)[0]
    effects = mechanism.effects
    losses = effects.damping * v if effects is not None else 0.0 * v
    twin.data.qvel[:] = T @ u
    mujoco.mj_forward(twin.model, twin.data)
    damped = -twin.data.qfrc_passive.copy()
    twin.data.qvel[:] = 0
    mujoco.mj_forward(twin.model, twin.data)
    damped += twin.data.qfrc_passive
    return Agreement(
        float(gap),
        float(rate),
        int(mobility),
        _relative(T.T @ mass @ T, N.T @ own @ N),
        _relative(T.T @ weight, N.T @ mechanism.generalised_force(q, still, still)),
        _relative(T.T @ damped, N.T @ losses),
        _force(mechanism, twin, q, v, a, N),
    )


def _random(N: Array, norm: float, rng: np.random.Generator) -> Array:
    """Return coefficients of a random motion: of this norm, so that no joint meets its limit."""
    found = rng.normal(size=N.shape[1])
    return found * (norm / max(float(np.linalg.norm(N @ found)), 1e-300))


def _force(
    mechanism: ClosedLoopModel, twin: MujocoTwin, q: Array, v: Array, a: Array, N: Array
) -> float:
    """Of N' (M a + bias); MuJoCo's acceleration by differences of its velocities."""
    model, h = mechanism.model, 1e-3

    def velocity(t: float) -> Array:
        there = pin.integrate(model, q, t * v + t * t / 2 * a)
        there = mechanism.project(there)
        moved = mechanism.allowed_motions(there)
        v_there = moved @ np.linalg.lstsq(moved, v + t * a, rcond=None)[0]
        return twin.motions(there, v_there[:, None])[:, 0]

    near, far = velocity(h) - velocity(-h), velocity(2 * h) - velocity(-2 * h)
    acceleration = (8 * near - far) / (12 * h)
    T = twin.motions(q, N)
    twin.data.qvel[:] = twin.motions(q, v[:, None])[:, 0]
    twin.data.qacc[:] = acceleration
    mujoco.mj_fwdPosition(twin.model, twin.data)
    mujoco.mj_fwdVelocity(twin.model, twin.data)
    mass = np.zeros((twin.model.nv, twin.model.nv))
    mujoco.mj_fullM(twin.model, twin.data, mass)
    found = T.T @ (mass @ acceleration + twin.data.qfrc_bias)
    return _relative(found, N.T @ pin.rnea(model, model.createData(), q, v, a))


def _relative(found: Array, expected: Array) -> float:
    scale = max(1e-3, float(np.abs(expected).max(initial=0.0)))
    return float(np.abs(found - expected).max(initial=0.0) / scale)
