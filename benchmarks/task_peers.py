"""Newton's method on closures and on a task's coordinates, as one writes it by hand.

Kinematics of the tree is Pinocchio's, MuJoCo's, or plain NumPy: loops over joints, no libraries.
Nothing checks for singularities, assembly modes or limits.
"""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any, NamedTuple, Protocol

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from benchmarks.mujoco_twin import mujoco_model
from rps_pin import Task

Array = NDArray[np.float64]


class Frame(NamedTuple):
    """A frame at an offset in the frame of a joint's body."""

    joint: int
    place: Array
    turn: Array


class Kinematics(Protocol):
    """What Newton's method needs of a tree; q and v are its own."""

    def start(self, q: Array) -> Array:
        """Return Pinocchio's q in its own coordinates."""

    def look(self, q: Array) -> None:
        """Compute placements and Jacobians."""

    def frame(self, frame: Frame) -> tuple[Array, Array, Array]:
        """Return place, rotation and Jacobian (6, nv) in world axes of a frame."""

    def moved(self, q: Array, step: Array) -> Array:
        """Return q, moved along a velocity for unit time."""


class Pinocchio:
    """By Pinocchio's C++ functions."""

    def __init__(self, model: pin.Model) -> None:
        self.model, self.data = model, model.createData()
        joints = list(model.joints)
        self.idx_q, self.idx_v = ([getattr(j, f"idx_{x}") for j in joints] for x in "qv")

    def start(self, q: Array) -> Array:
        return q

    def look(self, q: Array) -> None:
        pin.computeJointJacobians(self.model, self.data, q)

    def frame(self, frame: Frame) -> tuple[Array, Array, Array]:
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        placed = self.data.oMi[frame.joint]
        arm = placed.rotation @ frame.place
        J = pin.getJointJacobian(self.model, self.data, frame.joint, world)
        J[:3] -= cross_matrix(arm) @ J[3:]
        return placed.translation + arm, placed.rotation @ frame.turn, J

    def moved(self, q: Array, step: Array) -> Array:
        found: Array = pin.integrate(self.model, q, step)
        return found


class Mujoco:
    """By MuJoCo's C functions."""

    def __init__(self, model: pin.Model) -> None:
        weighed = pin.Model(model)  # MuJoCo moves no link without mass
        for index in range(model.njoints):
            weighed.inertias[index] = pin.Inertia.FromSphere(1.0, 1.0)
        tree = SimpleNamespace(model=weighed, effects=None, closures=())
        self.model = mujoco_model(tree, False, "Euler", 1e-3)  # type: ignore[arg-type]
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(name) for name in list(model.names)[1:]]
        self.idx_q = [-1, *(int(joint.qposadr[0]) for joint in joints)]
        self.idx_v = [-1, *(int(joint.dofadr[0]) for joint in joints)]
        self.bodies = [0, *(self.model.body(f"body_{name}").id for name in list(model.names)[1:])]
        self.joints = list(model.joints)

    def start(self, q: Array) -> Array:
        found = np.zeros(self.model.nq)
        for joint, place in itertools.islice(zip(self.joints, self.idx_q, strict=True), 1, None):
            own = q[joint.idx_q :][: joint.nq]
            found[place : place + joint.nq] = own if joint.nq == 1 else own[[0, 1, 2, 6, 3, 4, 5]]
        return found

    def look(self, q: Array) -> None:
        self.data.qpos = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def frame(self, frame: Frame) -> tuple[Array, Array, Array]:
        body, J = self.bodies[frame.joint], np.empty((6, self.model.nv))
        turn = self.data.xmat[body].reshape(3, 3)
        place = self.data.xpos[body] + turn @ frame.place
        mujoco.mj_jac(self.model, self.data, J[:3], J[3:], place, body)
        return place, turn @ frame.turn, J

    def moved(self, q: Array, step: Array) -> Array:
        found = q.copy()
        mujoco.mj_integratePos(self.model, found, step, 1.0)
        return found


class NumPy:
    """By loops over joints: hinges, slides and free bodies."""

    def __init__(self, model: pin.Model) -> None:
        self.parents = [int(parent) for parent in model.parents]
        self.places = [(one.rotation.copy(), one.translation.copy())
                       for one in model.jointPlacements]  # fmt: skip
        joints = list(model.joints)
        self.idx_q, self.idx_v = ([getattr(j, f"idx_{x}") for j in joints] for x in "qv")
        self.kinds, self.axes = ["fixed"], [np.zeros(3)]
        data = model.createData()
        for index, joint in enumerate(joints[1:], 1):
            own = pin.computeJointJacobian(model, data, pin.neutral(model), index)
            axis = own[:, joint.idx_v]
            turns = bool(axis[3:].any())
            self.kinds.append("free" if joint.nv == 6 else "hinge" if turns else "slide")
            self.axes.append(axis[3:] if turns else axis[:3])
        self.crosses = [cross_matrix(axis) for axis in self.axes]
        self.squares = [cross @ cross for cross in self.crosses]
        #: Which velocities move a joint's body.
        self.moving = np.zeros((len(joints), model.nv), dtype=bool)
        for index, joint in enumerate(joints[1:], 1):
            self.moving[index] = self.moving[self.parents[index]]
            self.moving[index, joint.idx_v : joint.idx_v + joint.nv] = True
        self.R = np.tile(np.eye(3), (len(joints), 1, 1))
        self.p = np.zeros((len(joints), 3))
        #: Of each velocity: the axis of its rotation or translation, a point on it, and which.
        self.along, self.at = np.zeros((model.nv, 3)), np.zeros((model.nv, 3))
        self.turning = np.zeros(model.nv, dtype=bool)

    def start(self, q: Array) -> Array:
        return q

    def look(self, q: Array) -> None:
        for index in range(1, len(self.kinds)):
            parent, (turn, place) = self.parents[index], self.places[index]
            R, p = self.R[parent] @ turn, self.p[parent] + self.R[parent] @ place
            at, v, kind = self.idx_q[index], self.idx_v[index], self.kinds[index]
            if kind == "hinge":
                angle = q[at]
                self.along[v], self.turning[v] = R @ self.axes[index], True
                R = R + R @ (
                    np.sin(angle) * self.crosses[index] + (1 - np.cos(angle)) * self.squares[index]
                )
                self.at[v] = p
            elif kind == "slide":
                self.along[v] = R @ self.axes[index]
                p = p + q[at] * self.along[v]
            else:
                p, R = p + R @ q[at : at + 3], R @ rotation(q[at + 3 : at + 7])
                self.along[v : v + 3] = self.along[v + 3 : v + 6] = R.T
                self.at[v + 3 : v + 6], self.turning[v + 3 : v + 6] = p, True
            self.R[index], self.p[index] = R, p

    def frame(self, frame: Frame) -> tuple[Array, Array, Array]:
        turn = self.R[frame.joint]
        place = self.p[frame.joint] + turn @ frame.place
        moving, turning = self.moving[frame.joint], self.turning
        J = np.zeros((6, len(moving)))
        J[:3] = np.where(turning[:, None], np.cross(self.along, place - self.at), self.along).T
        J[3:, turning] = self.along[turning].T
        return place, turn @ frame.turn, J * moving

    def moved(self, q: Array, step: Array) -> Array:
        found = q.copy()
        for index in range(1, len(self.kinds)):
            at, v = self.idx_q[index], self.idx_v[index]
            if self.kinds[index] != "free":
                found[at] += step[v]
                continue
            found[at : at + 3] += rotation(q[at + 3 : at + 7]) @ step[v : v + 3]
            half = 0.5 * step[v + 3 : v + 6]
            x, y, z, w = q[at + 3 : at + 7]
            turned = np.array([x, y, z, w]) + np.array(
                [
                    w * half[0] + y * half[2] - z * half[1],
                    w * half[1] + z * half[0] - x * half[2],
                    w * half[2] + x * half[1] - y * half[0],
                    -x * half[0] - y * half[1] - z * half[2],
                ]
            )
            found[at + 3 : at + 7] = turned / np.linalg.norm(turned)
        return found


class ByHand:
    """Maps of a task: closures are points and rods."""

    def __init__(self, task: Task, kinematics: Any) -> None:
        model = task.mechanism.model
        self.tree: Kinematics = kinematics(model)
        self.size, self.nv = task.size, model.nv

        def frame(name: str) -> Frame:
            found = model.frames[model.getFrameId(name)]
            place = found.placement
            return Frame(found.parentJoint, place.translation.copy(), place.rotation.copy())

        self.pairs = [
            (frame(one.frame_a), frame(one.frame_b), one.distance)
            for one in task.mechanism.closures
        ]
        idx_q, idx_v = self.tree.idx_q, self.tree.idx_v  # type: ignore[attr-defined]
        driven = [model.getJointId(name) for name in task.mechanism.actuated]
        self.of_actuators = [idx_q[joint] for joint in driven]
        self.driven = [idx_v[joint] for joint in driven]
        self.output = None if task.frame is None else frame(task.frame)
        if self.output is None:
            joints = [model.getJointId(name) for name in task.coordinates]
            self.of_task = [idx_q[joint] for joint in joints]
            self.task_rows = np.zeros((self.size, self.nv))
            self.task_rows[range(self.size), [idx_v[joint] for joint in joints]] = 1.0
        else:
            self.axes = [["x", "y", "z", "rx", "ry", "rz"].index(c) for c in task.coordinates]
            self.turns = max(self.axes) > 2
        self.drive_rows = np.zeros((len(driven), self.nv))
        self.drive_rows[range(len(driven)), self.driven] = 1.0

    def closures(self, q: Array) -> tuple[list[Array], list[Array]]:
        """Gaps and rows of the closures at q."""
        self.tree.look(q)
        gaps, rows = [], []
        for a, b, distance in self.pairs:
            p, _, J = self.tree.frame(a)
            other, _, J_other = self.tree.frame(b)
            e, J = p - other, J[:3] - J_other[:3]
            gap, row = gap_and_rows(e, J, distance)
            gaps.append(gap)
            rows.append(row)
        return gaps, rows

    def coordinates(self, q: Array) -> tuple[Array, Array]:
        """The task's coordinates and their rows, after `closures` at q."""
        if self.output is None:
            return q[self.of_task], self.task_rows
        place, turn, J = self.tree.frame(self.output)
        if not self.turns:
            return place[self.axes], J[self.axes]
        r = rotation_vector(turn)
        whole = np.concatenate([J[:3], rates(r) @ J[3:]])
        return np.concatenate([place, r])[self.axes], whole[self.axes]

    def to_actuators(self, x: Array, near: Array) -> Array:
        """Return actuators' positions of coordinates; near is a configuration of the tree's own."""
        q = near
        for _ in range(20):
            gaps, rows = self.closures(q)
            now, own = self.coordinates(q)
            error = np.concatenate([*gaps, now - x])
            if np.abs(error).max() < 1e-12:
                return q[self.of_actuators]
            q = self.tree.moved(q, solved(np.vstack([*rows, own]), -error))
        raise RuntimeError("Newton's method does not end")

    def to_task(self, a: Array, near: Array) -> Array:
        """Return coordinates of actuators' positions."""
        q = near
        for _ in range(20):
            gaps, rows = self.closures(q)
            error = np.concatenate([*gaps, q[self.of_actuators] - a])
            if np.abs(error).max() < 1e-12:
                return self.coordinates(q)[0]
            q = self.tree.moved(q, solved(np.vstack([*rows, self.drive_rows]), -error))
        raise RuntimeError("Newton's method does not end")

    def jacobian(self, q: Array) -> Array:
        """Return d(actuators)/d(task)."""
        _, rows = self.closures(q)
        _, own = self.coordinates(q)
        matrix = np.vstack([*rows, own])
        right = np.zeros((len(matrix), self.size))
        right[-self.size :] = np.eye(self.size)
        return solved(matrix, right)[self.driven]


def gap_and_rows(e: Array, J: Array, distance: float | None) -> tuple[Array, Array]:
    """Return gap and rows of a point, of offset e and rows J (3, nv), or of a rod so long."""
    if distance is None:
        return e, J
    length = np.sqrt(e @ e)
    return np.array([length - distance]), ((e / length) @ J)[None]


def solved(matrix: Array, right: Array) -> Array:
    """Return the solution, of least norm if there are idle freedoms."""
    if matrix.shape[0] == matrix.shape[1]:
        return np.linalg.solve(matrix, right)
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0])


def cross_matrix(v: Array) -> Array:
    """Return [v], with [v] w = v x w."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation(quaternion: Array) -> Array:
    """Return the rotation of a unit quaternion (x, y, z, w)."""
    x, y, z, w = quaternion
    cross = cross_matrix(np.array([x, y, z]))
    return np.asarray(np.eye(3) + 2 * w * cross + 2 * cross @ cross)


def rotation_vector(turn: Array) -> Array:
    """Return the rotation vector of a rotation below half a turn."""
    s = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine = np.sqrt(s @ s)
    if sine < 1e-9:
        return s
    return np.asarray(s * (np.arctan2(sine, 0.5 * (np.trace(turn) - 1)) / sine))


def rates(r: Array) -> Array:
    """Return A: r' = A w of an angular velocity in world axes."""
    angle = np.sqrt(r @ r)
    cross = cross_matrix(r)
    if angle < 1e-4:
        factor = 1 / 12
    else:
        factor = 1 / angle**2 - (1 + np.cos(angle)) / (2 * angle * np.sin(angle))
    return np.asarray(np.eye(3) - 0.5 * cross + factor * cross @ cross)
