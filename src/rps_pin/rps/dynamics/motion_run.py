"""Motion of a 3-RPS: inverse dynamics sample by sample, and its summary."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import trapezoid

from rps_pin.arrays import Array
from rps_pin.errors import SingularityError
from rps_pin.rps.kinematics.legs import PoseLegs, legs_of_pose
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot
from rps_pin.rps.singularity.path_refusal import require_clear
from rps_pin.task.paths.events import PathCheck
from rps_pin.task.sizing.motion_run import sample_times
from rps_pin.trajectories.path import Trajectory

Progress = Callable[[Iterable[int]], Iterable[int]]


@dataclass(frozen=True)
class MotionRun:
    """Everything computed along a motion; n samples, SI units, legs in the paper's order."""

    time: Array
    """Shape (n,), s."""
    pose: Array
    """(z, tilt_x, tilt_y), shape (n, 3), m and rad."""
    rate: Array
    """Its first time derivative, shape (n, 3)."""
    acceleration: Array
    """Its second time derivative, shape (n, 3)."""
    position: Array
    """Of the platform's centre in base axes, shape (n, 3), m."""
    configuration: Array
    """Pinocchio configurations, shape (n, nq)."""
    generalised_velocity: Array
    """Pinocchio velocities, shape (n, nv)."""
    generalised_acceleration: Array
    """Their time derivatives, shape (n, nv)."""
    length: Array
    """Of the legs, shape (n, 3), m."""
    speed: Array
    """Of the actuators, shape (n, 3), m/s; positive is out."""
    leg_acceleration: Array
    """Of the actuators, shape (n, 3), m/s^2."""
    force: Array
    """Of the actuators, shape (n, 3), N; positive pushes the leg out."""
    reaction: Array
    """Of each leg on the platform at its spherical joint, base axes, shape (n, 3 legs, 3), N."""
    loop_gap: Array
    """Largest gap of the closures, shape (n,), m."""
    residual: Array
    """KKT residual over the largest generalised force, shape (n,)."""
    passive_conditioning: Array
    """1 / condition number of the passive Jacobian, shape (n,): 0 at a singularity, 1 at best; see
    `rps_pin.rps.singularity.measures`."""
    path_check: PathCheck
    """Of the trajectory: its smallest distance to a singularity, and where."""
    legs: PoseLegs | None = field(default=None, repr=False, compare=False)
    """Legs of the poses, of which `force_causes` need not compute them again; None if unknown."""
    parameters: RPSParameters | None = field(default=None, repr=False, compare=False)
    """Of the robot; None if unknown."""

    @property
    def singularity_distance(self) -> Array:
        """Deprecated name of `passive_conditioning`."""
        return self.passive_conditioning

    @property
    def power(self) -> Array:
        """Mechanical power of the actuators, F d', shape (n, 3), W."""
        return self.force * self.speed


@dataclass(frozen=True)
class ActuatorSummary:
    """Demands of a motion on one actuator."""

    actuator: int
    """1 to 3."""
    force_min: float
    """N."""
    force_max: float
    """N."""
    force_rms: float
    """Root of the time average of the squared force, N."""
    length_min: float
    """m."""
    length_max: float
    """m."""
    speed_peak: float
    """Largest magnitude, m/s."""
    power_peak: float
    """Largest magnitude, W."""
    power_mean: float
    """Time average of the magnitude, W."""


@dataclass(frozen=True)
class MotionSummary:
    """A motion in a few numbers."""

    duration: float
    """s."""
    samples: int
    actuators: tuple[ActuatorSummary, ...]
    loop_gap_max: float
    """m."""
    residual_max: float
    """Largest KKT residual, relative to the largest generalised force of its sample."""
    minimum_distance: float
    """Smallest `SingularityMeasures.distance` of the path, 0 to 1, as `PathCheck` has it."""
    minimum_singularity: str
    """Which kind of singularity that is to."""
    minimum_time: float
    """When, s."""
    minimum_pose: tuple[float, float, float]
    """Where: (z, tilt_x, tilt_y), m and rad."""
    passive_conditioning_min: float
    """Smallest 1 / condition number of the passive Jacobian."""
    exceeded: tuple[str, ...]
    """Actuator limits that the motion asks too much of, a sentence each."""

    @property
    def singularity_distance_min(self) -> float:
        """Deprecated name of `passive_conditioning_min`."""
        return self.passive_conditioning_min

    @property
    def singularity_time(self) -> float:
        """Deprecated name of `minimum_time`."""
        return self.minimum_time

    @property
    def singularity_pose(self) -> tuple[float, float, float]:
        """Deprecated name of `minimum_pose`."""
        return self.minimum_pose

    def in_degrees(self) -> Self:
        """Return it with the tilts of its pose in degrees."""
        z, tilt_x, tilt_y = self.minimum_pose
        return replace(self, minimum_pose=(z, math.degrees(tilt_x), math.degrees(tilt_y)))

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers, strings, lists and dictionaries, as JSON has them."""
        return asdict(self)


def run_motion(
    robot: RPSRobot,
    trajectory: Trajectory,
    sample_rate: float = 1000.0,
    *,
    wrench: ArrayLike | None = None,
    progress: Progress = iter,
) -> MotionRun:
    """Compute the inverse dynamics of a robot along a trajectory, through its constraint models.

    Parameters
    ----------
    robot
        The 3-RPS.
    trajectory
        Poses and their exact derivatives over time.
    sample_rate
        Samples a second, Hz; the end of the trajectory is always the last sample.
    wrench
        External wrench on the platform during the whole motion: force (N) in base axes and moment
        (N m) about the platform's centre, shape (6,).
    progress
        Wraps the loop over the samples, for a progress bar.

    Raises
    ------
    InputError
        If the sample rate is not a positive number, or gives over ten million samples.
    UnreachableError
        If the trajectory leaves the robot's limits; says when, before any force is computed.
    SingularityError
        If it meets a singularity; likewise.
    """
    time = sample_times(trajectory.duration, sample_rate)
    path_check = require_clear(robot, trajectory)
    motion = trajectory.sample(time)
    p = robot.parameters
    legs = legs_of_pose(motion.pose, p.base_radius, p.platform_radius)
    platform, leg_motion = robot.motion(*motion, legs=legs)
    q, v, a = robot.state_of(motion.pose, platform, leg_motion)
    n = len(time)
    force, reaction = np.empty((n, 3)), np.empty((n, 3, 3))
    gap, residual, conditioning = np.empty(n), np.empty(n), np.empty(n)
    side = 0
    for i in progress(range(n)):
        try:
            result = robot.inverse_dynamics(q[i], v[i], a[i], wrench=wrench)
        except SingularityError as error:
            raise singular_sample(time[i], error) from None
        before, side = side, result.orientation
        if before * side < 0:
            raise crossed_singularity(time[i - 1], time[i], robot)
        force[i] = result.tau
        reaction[i] = result.constraint_forces.reshape(3, 3)
        largest = max(np.abs(result.tau).max(), np.abs(result.constraint_forces).max())
        residual[i] = result.residual / largest if largest > 0 else result.residual
        conditioning[i] = 1 / result.condition
        gap[i] = robot.mechanism.loop_gap(q[i])
    of_legs = leg_motion.length, leg_motion.speed, leg_motion.acceleration
    solved = force, reaction, gap, residual, conditioning
    found = (*motion, platform.position, q, v, a, *of_legs, *solved, path_check, legs)
    return MotionRun(time, *found, robot.parameters)


def summarise(run: MotionRun, robot: RPSRobot) -> MotionSummary:
    """Return a motion in a few numbers, and the limits of the robot's actuators that it exceeds."""
    nearest = run.path_check
    z, tilt_x, tilt_y = (float(x) for x in nearest.minimum_pose)
    return MotionSummary(
        duration=float(run.time[-1]),
        samples=len(run.time),
        actuators=tuple(_actuator_summary(run, leg) for leg in range(3)),
        loop_gap_max=float(run.loop_gap.max()),
        residual_max=float(run.residual.max()),
        minimum_distance=nearest.minimum_distance,
        minimum_singularity=nearest.minimum_singularity,
        minimum_time=nearest.minimum_time,
        minimum_pose=(z, tilt_x, tilt_y),
        passive_conditioning_min=float(run.passive_conditioning.min()),
        exceeded=tuple(_exceeded(run, robot)),
    )


def singular_sample(time: float, error: SingularityError) -> SingularityError:
    """Return the error of a motion that is singular at a sample."""
    text = f"at t = {time:.6g} s the motion meets a singularity: {error}"
    return SingularityError(text, error.condition, error.limit)


def crossed_singularity(before: float, after: float, robot: RPSRobot) -> SingularityError:
    """Return the error of a motion that crosses a singularity between two samples."""
    return SingularityError(
        f"between t = {before:.6g} s and {after:.6g} s the motion crosses a singularity: no "
        "actuator forces carry the robot through it",
        math.inf,
        robot.mechanism.max_condition,
    )


def _actuator_summary(run: MotionRun, leg: int) -> ActuatorSummary:
    force, power = run.force[:, leg], run.power[:, leg]
    return ActuatorSummary(
        actuator=leg + 1,
        force_min=float(force.min()),
        force_max=float(force.max()),
        force_rms=math.sqrt(_time_average(force**2, run.time)),
        length_min=float(run.length[:, leg].min()),
        length_max=float(run.length[:, leg].max()),
        speed_peak=float(np.abs(run.speed[:, leg]).max()),
        power_peak=float(np.abs(power).max()),
        power_mean=_time_average(np.abs(power), run.time),
    )


def _time_average(values: Array, time: Array) -> float:
    return float(trapezoid(values, time) / (time[-1] - time[0]))


def _exceeded(run: MotionRun, robot: RPSRobot) -> Iterable[str]:
    p = robot.parameters
    for what, unit, values, limit in (
        ("force", "N", run.force, p.actuator_force_limit),
        ("speed", "m/s", run.speed, p.actuator_speed_limit),
    ):
        sample, leg = np.unravel_index(int(np.abs(values).argmax()), values.shape)
        peak = float(abs(values[sample, leg]))
        if peak > limit:
            yield (
                f"actuator {leg + 1} would need a {what} of {peak:.4g} {unit} at "
                f"t = {run.time[sample]:.4g} s; its limit is {limit:.4g} {unit}"
            )
