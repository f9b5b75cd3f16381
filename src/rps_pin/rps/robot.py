"""The 3-RPS parallel robot: closed-form kinematics, and dynamics through its closed-loop model."""

from __future__ import annotations

from functools import cached_property, partial
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel, InverseDynamics, LoopClosure
from rps_pin.closed_loop.io.urdf import model_from_urdf
from rps_pin.errors import InputError, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.dynamics.actuator_forces import actuator_forces
from rps_pin.rps.dynamics.force_equations import ForceTerms
from rps_pin.rps.dynamics.friction import friction_effects
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.generated import engine
from rps_pin.rps.generated.calls import RobotCalls
from rps_pin.rps.generated.engine import CompilerName
from rps_pin.rps.kinematics import pose as poses
from rps_pin.rps.kinematics.assembly_modes import AssemblyModes, assembly_modes
from rps_pin.rps.kinematics.forward_kinematics import forward_kinematics
from rps_pin.rps.kinematics.inverse_kinematics import inverse_kinematics, reachable_motion
from rps_pin.rps.kinematics.legs import LegMotion, Legs, PoseLegs, check_legs
from rps_pin.rps.kinematics.samples import Errors, maskable
from rps_pin.rps.leg_frames import LEGS, ball_frames
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.task import RPSTask
from rps_pin.rps.urdf import build_urdf
from rps_pin.validation import whole_number

#: Calls of microseconds where code is generated.
_FAST = (
    *("actuator_forces", "inverse_dynamics", "inverse_kinematics", "forward_kinematics"),
    *("platform_placement", "motion", "state"),
)


@partial(refuses_other_kinds, besides=_FAST)
class RPSRobot:
    """A 3-RPS parallel robot.

    Poses are ``(z, tilt_x, tilt_y)``: the height of the platform's centre (m) and the platform's
    rotation vector (rad), which lies in the base plane; see `rps_pin.rps.kinematics.pose`. Arrays
    of poses carry leading batch dimensions, ``(..., 3)``. Legs are counted 1 to 3 in messages, 0 to
    2 in arrays. One object serves one thread (see `ClosedLoopModel`).

    Parameters
    ----------
    parameters
        Geometry, masses, friction and limits.
    payload
        What the platform carries; see `with_payload`.

    Attributes
    ----------
    parameters : RPSParameters
        As given.
    payload : Payload or None
        As given.
    urdf : str
        The URDF of the open tree, generated from the parameters.
    mechanism : ClosedLoopModel
        The tree with its three spherical closures ``leg_1``, ``leg_2``, ``leg_3``; nv = 12, nine
        rows, mobility 3, the prismatic joints actuated. Its characteristic length is h, and in its
        home the platform is level. Friction and payload are in it.

    Raises
    ------
    InputError
        If the parameters are none.
    """

    def __init__(self, parameters: RPSParameters, payload: Payload | None = None) -> None:
        if not isinstance(parameters, RPSParameters):
            raise InputError(
                f"a robot is made of RPSParameters, not of {shown(parameters)}; of a preset: "
                "RPSRobot.from_preset(name); of a file: RPSRobot(RPSParameters.from_yaml(path))"
            )
        self.parameters = parameters
        self.payload = payload
        self.urdf = build_urdf(parameters)
        model = model_from_urdf(self.urdf)
        model.gravity.linear = np.array(parameters.gravity)
        if payload is not None:
            platform = model.getJointId("platform_free")
            model.appendBodyToJoint(platform, payload.as_inertia(), pin.SE3.Identity())
        joints, index = model.joints, model.getJointId
        free = joints[index("platform_free")]
        revolute = [joints[index(f"leg_{leg}_revolute")] for leg in LEGS]
        prismatic = [joints[index(f"leg_{leg}_prismatic")] for leg in LEGS]
        self._free_q, self._free_v = free.idx_q, free.idx_v
        self._angle_q = [joint.idx_q for joint in revolute]
        self._angle_v = [joint.idx_v for joint in revolute]
        self._length_q = [joint.idx_q for joint in prismatic]
        self._length_v = [joint.idx_v for joint in prismatic]
        self.mechanism = ClosedLoopModel(
            model,
            closures=[LoopClosure(*ball_frames(leg), name=f"leg_{leg}") for leg in LEGS],
            actuated=[f"leg_{leg}_prismatic" for leg in LEGS],
            home=self._level(model),
            effects=friction_effects(model, parameters),
            characteristic_length=parameters.platform_radius,
        )
        self._calls: RobotCalls | None = None
        self._threads = 1
        self._dynamics: Any = self.mechanism if parameters.has_bodies else _NoForces(parameters)

    def _level(self, model: pin.Model) -> Array:
        """Return the configuration of the platform level, in the middle of the legs' limits."""
        heights = self.parameters.base_radius * np.linspace(0.05, 3.0, 60)
        pose = np.column_stack([heights, np.zeros((heights.size, 2))])
        legs = inverse_kinematics(self.parameters, pose, errors="mask")
        within = np.flatnonzero(legs.reachable)
        # Heights of the base's radius and about it are well conditioned.
        near = within[heights[within] <= 1.2 * self.parameters.base_radius]
        chosen = near if near.size else within if within.size else np.arange(20)
        at = int(chosen[chosen.size // 2])
        q: Array = pin.neutral(model)
        q[self._free_q + 2] = heights[at]
        q[self._length_q], q[self._angle_q] = legs.length[at], legs.angle[at]
        return q

    @classmethod
    def from_preset(cls, name: str) -> RPSRobot:
        """Return a preset robot: ``"sokolov"`` (the paper's Table 1) or ``"micro"``."""
        return cls(RPSParameters.from_preset(name))

    def __reduce__(self) -> tuple[Any, ...]:
        """Give copies, and other processes, scratch memory of their own."""
        return type(self), (self.parameters, self.payload)

    def __repr__(self) -> str:
        p = self.parameters
        return f"RPSRobot({p.name!r}, g = {p.base_radius} m, h = {p.platform_radius} m)"

    def with_payload(self, payload: Payload | None) -> RPSRobot:
        """Return this robot carrying a payload (instead of the one it carries, if any).

        All its dynamics then include the payload. Its parameters and its URDF are the robot's own,
        without it.
        """
        return type(self)(self.parameters, payload)

    # Generated code -------------------------------------------------------------------------------

    @property
    def engine(self) -> str:
        """What computes kinematics and actuator forces: ``"Python"``, or generated code.

        Then it has the compiler's name and version; see `compile`.
        """
        code = engine.current()
        return "Python" if code is None else str(code)

    def compile(self, *, compiler: CompilerName = "auto", threads: int = 1) -> RPSRobot:
        """Build generated code, if it is not built yet, and return this robot, which uses it.

        `inverse_kinematics`, `forward_kinematics` and `actuator_forces` then take about two
        microseconds a call, and in batches 5 to 30 times less than before. Arguments, answers (to
        rounding) and errors stay: what generated code leaves open, such as a pose near a limit,
        Python's functions answer, and errors are theirs. One library serves all robots: after this
        call all robots of this process use it, and those of later processes find it in the cache by
        themselves (see `engine`), without building anything. ``RPS_PIN_COMPILE=0`` in the
        environment switches that off.

        `inverse_dynamics` without a wrench uses `mechanism.compile()` from this call on: it is
        built for this robot.

        Needs ``pip install rps-pin[compile]``. It takes some seconds the first time.

        Parameters
        ----------
        compiler
            As for `rps_pin.codegen.compile_mechanism`.
        threads
            By how many threads batches of this robot are computed.

        Raises
        ------
        InputError
            If there is no such compiler name, or the number of threads is none.
        CompileError
            If there is no compiler, or it fails, or the code does not agree with Python's functions
            to 1e-10.
        """
        self.parameters.require_bodies()
        self._threads = whole_number(threads, "threads")
        engine.built(compiler)
        self._calls = None
        self._dynamics = self.mechanism.compile(
            functions=("dynamics", "kinematics"), compiler=compiler
        )
        return self

    def _generated(self) -> RobotCalls | None:
        """Return this robot's generated functions, if there are any."""
        code = engine.current()
        if code is None or not self.parameters.has_bodies:
            return None
        if self._calls is None or self._calls.code is not code:
            limit = self.mechanism.max_condition
            self._calls = RobotCalls(code, self.parameters, self.force_terms, limit, self._threads)
        return self._calls

    # Kinematics -----------------------------------------------------------------------------------

    def platform_placement(self, pose: ArrayLike) -> tuple[Array, Array]:
        """Return the platform's position (..., 3) in m and rotation (..., 3, 3), both in base axes.

        Raises
        ------
        InputError
            If the pose has the wrong shape or is not finite.
        """
        x = poses.checked_pose(pose)
        return poses.position(x, self.parameters.platform_radius), poses.rotation(x)

    def inverse_kinematics(self, pose: ArrayLike, *, errors: Errors = "raise") -> Legs:
        """Return leg lengths and angles in closed form: Eq. 1, 4 and 6.

        Parameters
        ----------
        pose
            Shape (..., 3).
        errors
            ``"raise"`` refuses a pose beyond a limit of leg length, leg angle or spherical joint;
            with ``"mask"`` it is computed, and `Legs.reachable` is false.

        Returns
        -------
        Legs
            `length` (..., 3) in m, `angle` (..., 3) in rad, `reachable` (...).

        Raises
        ------
        InputError
            If the pose has the wrong shape or is not finite.
        UnreachableError
            With ``errors="raise"``, if a pose breaks a limit (names leg, value and limits), or
            gives a leg no length.
        """
        generated = self._generated()
        if generated is not None:
            return generated.inverse_kinematics(pose, errors)
        return inverse_kinematics(self.parameters, pose, errors=errors)

    def assembly_modes(self, length: ArrayLike) -> AssemblyModes:
        """Return every real pose of given leg lengths: all solutions of Eq. 8.

        Parameters
        ----------
        length
            Leg lengths d, shape (..., 3), m.

        Returns
        -------
        AssemblyModes
            `angle` (k, 3), `position` (k, 3), `rotation` (k, 3, 3) and more; a batch is padded to
            k = 16 (see `AssemblyModes.exists`). No limit of the robot is applied.

        Raises
        ------
        InputError
            If the lengths have the wrong shape, or are not finite and positive.
        """
        p = self.parameters
        return assembly_modes(length, p.base_radius, p.platform_radius)

    def forward_kinematics(
        self, length: ArrayLike, near: ArrayLike, *, errors: Errors = "raise"
    ) -> Array:
        """Return the pose of given leg lengths that continues a known one.

        Parameters
        ----------
        length
            Leg lengths d, shape (..., 3), m.
        near
            Known poses, of a shape that broadcasts with that of `length`. The lengths are followed
            from theirs to those wanted, on the straight line between them.
        errors
            ``"raise"`` refuses lengths that cannot be followed to their end; ``"mask"`` returns a
            masked array (`numpy.ma`), such poses masked.

        Returns
        -------
        array
            Poses, shape (..., 3). `rps_pin.rps.kinematics.forward_kinematics` also tells how far
            lengths were followed, and has a tracker for encoders in a loop.

        Raises
        ------
        InputError
            If an argument is not finite, a length not positive, or shapes do not go together.
        SingularityError
            If a line of lengths meets a singularity; says how far along.
        ClosureError
            If no pose has the lengths; says by how much they miss.
        """
        generated = self._generated()
        if generated is not None:
            return generated.forward_kinematics(length, near, errors)
        p = self.parameters
        radii = p.base_radius, p.platform_radius
        found = forward_kinematics(length, near, *radii, errors=errors)
        if errors == "raise":
            return found.pose
        return np.ma.MaskedArray(found.pose, np.repeat(~found.reached[..., None], 3, axis=-1))

    @maskable("legs", pose=1, rate=1, acceleration=1)
    def motion(
        self,
        pose: ArrayLike,
        rate: ArrayLike,
        acceleration: ArrayLike,
        *,
        legs: PoseLegs | None = None,
        errors: Errors = "raise",
    ) -> tuple[poses.PlatformMotion, LegMotion]:
        """Return how the platform and the legs move, in closed form.

        Parameters
        ----------
        pose, rate, acceleration
            Pose (m, rad, rad) and its first and second time derivatives, shape (..., 3) each.
        legs
            `rps_pin.rps.kinematics.legs.legs_of_pose` of the poses, if they are known.
        errors
            ``"raise"`` refuses a pose that is out of reach; with ``"mask"`` its results are NaN.

        Raises
        ------
        InputError, UnreachableError
            As `inverse_kinematics`.
        """
        x, dx, ddx = poses.checked_motion(pose, rate, acceleration)
        check_legs(legs, x)
        leg_motion = reachable_motion(self.parameters, x, dx, ddx, legs)
        return poses.platform_motion(x, dx, ddx, self.parameters.platform_radius), leg_motion

    @maskable(pose=1, rate=1, acceleration=1)
    def state(
        self,
        pose: ArrayLike,
        rate: ArrayLike,
        acceleration: ArrayLike,
        *,
        errors: Errors = "raise",
    ) -> tuple[Array, Array, Array]:
        """Return the full Pinocchio state whose loops are closed, by formula.

        Parameters
        ----------
        pose, rate, acceleration
            Pose (m, rad, rad) and its first and second time derivatives, shape (..., 3) each.
        errors
            ``"raise"`` refuses a pose that is out of reach; with ``"mask"`` its results are NaN.

        Returns
        -------
        q, v, a : arrays
            Configuration (..., 13), velocity (..., 12) and acceleration (..., 12) of
            ``mechanism.model``.

        Raises
        ------
        InputError, UnreachableError
            As `inverse_kinematics`.
        """
        platform, legs = self.motion(pose, rate, acceleration)
        return self.state_of(poses.checked_motion(pose, rate, acceleration)[0], platform, legs)

    def state_of(
        self, pose: Array, platform: poses.PlatformMotion, legs: LegMotion
    ) -> tuple[Array, Array, Array]:
        """Return `state` of poses (..., 3) whose `motion` is known."""
        x, model = pose, self.mechanism.model
        q = np.empty((*x.shape[:-1], model.nq))
        v = np.empty((*x.shape[:-1], model.nv))
        a = np.empty_like(v)

        # A free-flyer's velocity and spatial acceleration are in body axes:
        # v = R' p', and a = R' p'' - w x v.
        to_body = np.swapaxes(platform.rotation, -1, -2)
        linear = (to_body @ platform.velocity[..., None])[..., 0]
        spin = platform.angular_velocity
        pull = (to_body @ platform.acceleration[..., None])[..., 0] - np.cross(spin, linear)
        i, j = self._free_q, self._free_v
        q[..., i : i + 7] = np.concatenate([platform.position, poses.quaternion(x)], axis=-1)
        v[..., j : j + 6] = np.concatenate([linear, spin], axis=-1)
        a[..., j : j + 6] = np.concatenate([pull, platform.angular_acceleration], axis=-1)

        q[..., self._length_q], q[..., self._angle_q] = legs.length, legs.angle
        v[..., self._length_v], v[..., self._angle_v] = legs.speed, legs.angle_rate
        a[..., self._length_v] = legs.acceleration
        a[..., self._angle_v] = legs.angle_acceleration
        return q, v, a

    # Task -----------------------------------------------------------------------------------------

    @cached_property
    def task(self) -> RPSTask:
        """Its pose as a `rps_pin.task.Task`, coordinates z, rx and ry, with closed forms."""
        return RPSTask(self)

    @cached_property
    def force_terms(self) -> ForceTerms:
        """What the closed form of the actuator forces is made of."""
        self.parameters.require_bodies()
        return ForceTerms.of(self.parameters, self.payload)

    # Dynamics -------------------------------------------------------------------------------------

    def inverse_dynamics(
        self, q: Array, v: Array, a: Array, *, wrench: ArrayLike | None = None
    ) -> InverseDynamics:
        """Return actuator forces and joint reactions of one state, through the constraint models.

        Parameters
        ----------
        q, v, a
            One state as `state` gives it: (13,), (12,), (12,).
        wrench
            External wrench on the platform: force (N) in base axes and moment (N m) about the
            platform's centre, shape (6,).

        Returns
        -------
        InverseDynamics
            `tau`: the force of each actuator (3,), N, positive pushes the leg out;
            `constraint_forces`: the reactions at the spherical joints (9,), N;
            ``constraint_forces.reshape(3, 3)[i]`` is the force of leg i + 1 on the platform in base
            axes.

        Raises
        ------
        InputError, SingularityError
            As `ClosedLoopModel.inverse_dynamics`; and if q is a pose.
        """
        if _is_pose(q):
            raise InputError(
                "q has shape (3,), as a pose has; it must be (13,): state(pose, rate, "
                "acceleration) gives q, v and a; or take actuator_forces"
            )
        if wrench is None:
            found: InverseDynamics = self._dynamics.inverse_dynamics(q, v, a)
            return found
        self.parameters.require_bodies()
        return self.mechanism.inverse_dynamics(q, v, a, wrenches={"platform": wrench})

    def actuator_forces(
        self,
        pose: ArrayLike,
        rate: ArrayLike,
        acceleration: ArrayLike,
        *,
        wrench: ArrayLike | None = None,
        errors: Errors = "raise",
    ) -> Array:
        """Return the actuator forces of whole trajectories, in closed form.

        The same forces as `inverse_dynamics`, for many samples at once.

        Parameters
        ----------
        pose, rate, acceleration
            Pose (m, rad, rad) and its first and second time derivatives, shape (..., 3) each.
        wrench
            External wrench on the platform: force (N) in base axes and moment (N m) about the
            platform's centre, shape (6,) or one for each sample (..., 6).
        errors
            ``"raise"`` refuses the first sample that is out of reach or singular; ``"mask"``
            returns a masked array (`numpy.ma`), such samples masked.

        Returns
        -------
        array
            Shape (..., 3), N; positive pushes the leg out.

        Raises
        ------
        InputError
            If an argument is not finite, or shapes do not go together.
        UnreachableError
            As `inverse_kinematics`; names the sample.
        SingularityError
            If a pose is singular: where ``mechanism.condition`` exceeds
            ``mechanism.max_condition``. Names the sample, the condition and its limit.
        """
        motion = pose, rate, acceleration
        generated = self._generated()
        if generated is not None:
            return generated.actuator_forces(motion, wrench, errors)
        limit = self.mechanism.max_condition
        return actuator_forces(
            self.parameters, self.force_terms, limit, motion, wrench=wrench, errors=errors
        )

    def visual_model(self) -> pin.GeometryModel:
        """Return the shapes of the robot's links, for `rps_pin.viewer`."""
        return pin.buildGeomFromUrdfString(self.mechanism.model, self.urdf, pin.GeometryType.VISUAL)


class _NoForces:
    """The dynamics of a robot without bodies: refused."""

    def __init__(self, parameters: RPSParameters) -> None:
        self._parameters = parameters

    def inverse_dynamics(self, *state: Array) -> InverseDynamics:
        """Refuse: see `RPSParameters.require_bodies`."""
        self._parameters.require_bodies()
        raise AssertionError


def _is_pose(q: object) -> bool:
    """Return whether a configuration has a pose's shape."""
    return q.shape == (3,) if isinstance(q, np.ndarray) else isinstance(q, list) and len(q) == 3
