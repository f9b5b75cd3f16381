"""The same mechanism in MuJoCo: tree, masses, inertias, gravity, armature, damping, closures.

Bodies are made joint by joint from the `pin.Model`; spherical closures become `connect` and rigid
ones `weld` equalities between sites. MuJoCo keeps them by soft constraints (`solref`, `solimp`).
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel

Array = NDArray[np.float64]

KINDS = {"spherical": mujoco.mjtEq.mjEQ_CONNECT, "rigid": mujoco.mjtEq.mjEQ_WELD}


class MujocoTwin:
    """A mechanism in MuJoCo, with default or with the stiffest constraints that its step allows."""

    def __init__(
        self,
        mechanism: ClosedLoopModel,
        *,
        stiff: bool,
        integrator: str = "Euler",
        step: float = 1e-3,
    ) -> None:
        self.mechanism = mechanism
        self.model = model = mujoco_model(mechanism, stiff, integrator, step)
        self.data = mujoco.MjData(model)
        pairs = zip(model.eq_obj1id, model.eq_obj2id, strict=True)
        self.sites = np.array([list(pair) for pair in pairs])
        self.driven = [int(model.joint(name).dofadr[0]) for name in mechanism.actuated]

    def put(self, q: Array, v: Array, tau: Array) -> None:
        """Take on a state, and actuator forces that stay."""
        mujoco.mj_resetData(self.model, self.data)
        for name, joint, place, dof in self._joints():
            own, rate = q[joint.idx_q :][: joint.nq], v[joint.idx_v :][: joint.nv].copy()
            if name in self.free:  # quaternion (w, x, y, z), linear velocity in world axes
                rate[:3] = pin.Quaternion(own[3:]).matrix() @ rate[:3]
                own = own[[0, 1, 2, 6, 3, 4, 5]]
            self.data.qpos[place : place + joint.nq] = own
            self.data.qvel[dof : dof + joint.nv] = rate
        self.data.qfrc_applied[self.driven] = tau

    def forward(self) -> None:
        mujoco.mj_forward(self.model, self.data)

    def step(self) -> None:
        mujoco.mj_step(self.model, self.data)

    def acceleration(self, q: Array, v: Array) -> Array:
        """Return MuJoCo's acceleration (after `forward`) in the coordinates of the `pin.Model`."""
        found = np.zeros(self.mechanism.model.nv)
        for name, joint, _, dof in self._joints():
            own = self.data.qacc[dof : dof + joint.nv].copy()
            if name in self.free:  # of the linear velocity in body axes
                turn = pin.Quaternion(q[joint.idx_q :][3:7]).matrix()
                twist = v[joint.idx_v :][:6]
                own[:3] = turn.T @ own[:3] - np.cross(twist[3:], twist[:3])
            found[joint.idx_v :][: joint.nv] = own
        return found

    def gap(self) -> float:
        """Return the largest gap of a closure at the data's placements, m."""
        ends = self.data.site_xpos[self.sites]
        return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max())

    @property
    def free(self) -> set[str]:
        """Names of the free joints."""
        model = self.mechanism.model
        return {
            name for name, joint in zip(model.names, model.joints, strict=True) if joint.nq == 7
        }

    def _joints(self) -> list[tuple[str, Any, int, int]]:
        """Return name, Pinocchio's joint, and MuJoCo's addresses of q and v."""
        tree = self.mechanism.model
        found = []
        for name, joint in list(zip(tree.names, tree.joints, strict=True))[1:]:
            own = self.model.joint(name)
            found.append((name, joint, int(own.qposadr[0]), int(own.dofadr[0])))
        return found


def mujoco_model(
    mechanism: ClosedLoopModel, stiff: bool, integrator: str, step: float
) -> mujoco.MjModel:
    """Return the compiled model; raise if MuJoCo has no such joint or closure."""
    tree, spec = mechanism.model, mujoco.MjSpec()
    spec.compiler.balanceinertia = False
    spec.compiler.autolimits = False
    spec.option.timestep = step
    spec.option.gravity = tree.gravity.linear
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    bodies = [spec.worldbody]
    effects = mechanism.effects
    for index in range(1, tree.njoints):
        body = bodies[tree.parents[index]].add_body(name=f"body_{tree.names[index]}")
        place = tree.jointPlacements[index]
        body.pos, body.quat = place.translation, _quaternion(place.rotation)
        _set_inertia(body, tree.inertias[index])
        joint = _add_joint(body, tree, index)
        dof = tree.joints[index].idx_v
        if joint.type != mujoco.mjtJoint.mjJNT_FREE:
            joint.armature = float(tree.armature[dof])
            if effects is not None:
                joint.damping = _like(joint.damping, float(effects.damping[dof]))
        bodies.append(body)
    for closure in mechanism.closures:
        _add_equality(spec, bodies, tree, closure, stiff)
    return spec.compile()


def _set_inertia(body: Any, inertia: pin.Inertia) -> None:
    body.explicitinertial = True
    body.mass, body.ipos = inertia.mass, inertia.lever
    I = inertia.inertia  # noqa: E741
    body.fullinertia = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]


def _add_joint(body: Any, tree: pin.Model, index: int) -> Any:
    joint, name = tree.joints[index], tree.names[index]
    if joint.shortname() == "JointModelFreeFlyer":
        return body.add_freejoint(name=name)
    if (joint.nq, joint.nv) != (1, 1):
        raise NotImplementedError(f"{name}: no joint of MuJoCo for {joint.shortname()}")
    own = pin.computeJointJacobian(tree, tree.createData(), pin.neutral(tree), index)
    axis = own[:, joint.idx_v]
    kind = mujoco.mjtJoint.mjJNT_HINGE if axis[3:].any() else mujoco.mjtJoint.mjJNT_SLIDE
    return body.add_joint(name=name, type=kind, axis=axis[3:] if axis[3:].any() else axis[:3])


def _add_equality(spec: Any, bodies: list[Any], tree: pin.Model, closure: Any, stiff: bool) -> None:
    if closure.kind not in KINDS:
        raise NotImplementedError(f"{closure.name}: no equality of MuJoCo for {closure.kind}")
    ends = closure.frame_a, closure.frame_b
    for name in ends:
        frame = tree.frames[tree.getFrameId(name)]
        place = frame.placement
        bodies[frame.parentJoint].add_site(
            name=f"{closure.name}_{name}",
            pos=place.translation,
            quat=_quaternion(place.rotation),
        )
    equality = spec.add_equality(type=KINDS[closure.kind], objtype=mujoco.mjtObj.mjOBJ_SITE)
    equality.name1, equality.name2 = (f"{closure.name}_{name}" for name in ends)
    if stiff:  # MuJoCo keeps the time constant at two steps or more
        equality.solref[:] = 2 * spec.option.timestep, 1
        equality.solimp[:] = 0.9999, 0.9999, 0.001, 0.5, 2


def _quaternion(rotation: Array) -> Array:
    found: Array = pin.Quaternion(rotation).coeffs()[[3, 0, 1, 2]]
    return found


def _like(given: Any, number: float) -> Any:
    """Return a number, or a vector with the number first: MuJoCo's versions differ."""
    return number if np.ndim(given) == 0 else [number, *np.zeros(np.size(given) - 1)]
