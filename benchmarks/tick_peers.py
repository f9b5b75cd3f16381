"""A computed-torque tick as one would write it without this package, for `benchmarks.latency`.

All take the legs' lengths and speeds and a target for them, and return the actuators' forces of

    u = d_d'' + Kd (d_d' - d') + Kp (d_d - d),

the law of `ComputedTorque(space="actuator")`: find the passive joints by Newton's method from those
of the last tick, complete speeds and accelerations, and solve inverse dynamics.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import proxsuite
from numpy.typing import NDArray

from benchmarks.peers import Mujoco, PlainPinocchio
from rps_pin import RPSRobot

Array = NDArray[np.float64]

CLOSED = 1e-12
"""m."""


class PlainTick(PlainPinocchio):
    """Pinocchio and NumPy."""

    def __init__(self, robot: RPSRobot, pose: Array, kp: float, kd: float) -> None:
        super().__init__(robot.mechanism)
        self.kp, self.kd = kp, kd
        self.q = robot.state(pose, np.zeros(3), np.zeros(3))[0]
        self.lengths = [self.model.joints[i].idx_q for i in (2, 4, 6)]
        assert self.lengths == [1, 3, 5]

    def __call__(self, length: Array, speed: Array, goal: tuple[Array, Array, Array]) -> Array:
        model, passive, actuated = self.model, self.passive, self.actuated
        q = self.q
        q[self.lengths] = length
        step = np.zeros(model.nv)
        while True:
            jacobian = self.jacobian(q)
            gap = self.gap()
            if np.abs(gap).max() < CLOSED:
                break
            step[passive] = np.linalg.solve(jacobian[:, passive], -gap)
            q = pin.integrate(model, q, step)
        self.q = q
        v = np.zeros(model.nv)
        v[actuated] = speed
        v[passive] = np.linalg.solve(jacobian[:, passive], -jacobian[:, actuated] @ speed)
        a = np.zeros(model.nv)
        u = goal[2] + self.kd * (goal[1] - speed) + self.kp * (goal[0] - length)
        a[actuated] = u
        drift = self.drift(q, v)
        a[passive] = np.linalg.solve(jacobian[:, passive], -jacobian[:, actuated] @ u - drift)
        return self.forces(q, v, a)

    def gap(self) -> Array:
        """Of the closures at the last Jacobian's configuration, in base axes, m."""
        gaps = []
        for a, b in self.frames:
            at_a = pin.updateFramePlacement(self.model, self.data, a)
            at_b = pin.updateFramePlacement(self.model, self.data, b)
            gaps.append(at_a.translation - at_b.translation)
        return np.concatenate(gaps)

    def drift(self, q: Array, v: Array) -> Array:
        """The rows' acceleration where no joint accelerates."""
        model, data = self.model, self.data
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        axes = pin.LOCAL_WORLD_ALIGNED
        drifts = []
        for a, b in self.frames:
            drifts.append(
                pin.getFrameClassicalAcceleration(model, data, a, axes).linear
                - pin.getFrameClassicalAcceleration(model, data, b, axes).linear
            )
        return np.concatenate(drifts)

    def forces(self, q: Array, v: Array, a: Array) -> Array:
        """Through the constraint models."""
        return self.inverse_dynamics(q, v, a)


class QPTick(PlainTick):
    """Pinocchio, and inverse dynamics as a quadratic program that is built at each tick."""

    limit = 100.0
    """N."""

    def forces(self, q: Array, v: Array, a: Array) -> Array:
        force = pin.rnea(self.model, self.data, q, v, a)
        jacobian = self.jacobian(q)
        select = np.zeros((3, self.model.nv))
        select[[0, 1, 2], self.actuated] = 1.0
        n = 3 + len(jacobian)
        lower, upper = np.full(n, -1e20), np.full(n, 1e20)
        lower[:3], upper[:3] = -self.limit, self.limit
        problem = proxsuite.proxqp.dense.QP(n, self.model.nv, 0, True)
        problem.settings.eps_abs = 1e-9
        problem.init(
            np.diag([1.0] * 3 + [1e-6] * (n - 3)),
            np.zeros(n),
            np.vstack([select, jacobian]).T,
            force,
            None,
            None,
            None,
            lower,
            upper,
        )
        problem.solve()
        tau: Array = problem.results.x[:3].copy()
        return tau


class MujocoTick:
    """MuJoCo's kinematics, Jacobians and recursion, and NumPy; its own solver is not used."""

    def __init__(self, robot: RPSRobot, pose: Array, kp: float, kd: float) -> None:
        q, v, _ = robot.state(pose, np.zeros(3), np.zeros(3))
        own = Mujoco(robot.mechanism, robot.urdf, q, v)
        self.model, self.data = own.model, own.data
        self.actuated, self.passive = own.actuated, own.passive
        self.kp, self.kd = kp, kd
        names = robot.mechanism.actuated
        self.lengths = [int(self.model.joint(name).qposadr[0]) for name in names]
        self.sites = [
            tuple(self.model.site(f"{frame}_closed").id for frame in (c.frame_a, c.frame_b))
            for c in robot.mechanism.closures
        ]
        self.slopes = np.zeros((2, 3, self.model.nv))

    def __call__(self, length: Array, speed: Array, goal: tuple[Array, Array, Array]) -> Array:
        model, data, passive, actuated = self.model, self.data, self.passive, self.actuated
        data.qpos[self.lengths] = length
        step = np.zeros(model.nv)
        while True:
            mujoco.mj_fwdPosition(model, data)
            jacobian = data.efc_J.reshape(-1, model.nv)
            gap = data.efc_pos
            if np.abs(gap).max() < CLOSED:
                break
            step[passive] = np.linalg.solve(jacobian[:, passive], -gap)
            mujoco.mj_integratePos(model, data.qpos, step, 1.0)
        data.qvel[actuated] = speed
        data.qvel[passive] = np.linalg.solve(jacobian[:, passive], -jacobian[:, actuated] @ speed)
        mujoco.mj_fwdVelocity(model, data)
        u = goal[2] + self.kd * (goal[1] - speed) + self.kp * (goal[0] - length)
        data.qacc[actuated] = u
        data.qacc[passive] = np.linalg.solve(
            jacobian[:, passive], -jacobian[:, actuated] @ u - self.drift()
        )
        force = np.zeros(model.nv)
        mujoco.mj_rne(model, data, 1, force)
        multipliers = np.linalg.solve(jacobian[:, passive].T, force[passive])
        tau: Array = force[actuated] - jacobian[:, actuated].T @ multipliers
        return tau

    def drift(self) -> Array:
        """The rows' acceleration where no joint accelerates."""
        model, data, (slope_a, slope_b) = self.model, self.data, self.slopes
        drifts = []
        for a, b in self.sites:
            body_a, body_b = int(model.site_bodyid[a]), int(model.site_bodyid[b])
            mujoco.mj_jacDot(model, data, slope_a, None, data.site_xpos[a], body_a)
            mujoco.mj_jacDot(model, data, slope_b, None, data.site_xpos[b], body_b)
            drifts.append((slope_a - slope_b) @ data.qvel)
        return np.concatenate(drifts)
