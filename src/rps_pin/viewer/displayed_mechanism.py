"""Mechanism and motion of a view, from what its user gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.simulation.result import Simulation
from rps_pin.closed_loop.visuals import own_shapes, skeleton
from rps_pin.errors import InputError
from rps_pin.rps.dynamics.motion_run import MotionRun
from rps_pin.rps.robot import RPSRobot
from rps_pin.task.sizing.motion_run import sample_times
from rps_pin.validation import real_vector
from rps_pin.viewer.motion import Motion

_SAMPLE_RATE = 100.0
"""Samples per second of a trajectory."""


@dataclass(frozen=True)
class DisplayedMechanism:
    """A mechanism with its visual geometry."""

    mechanism: ClosedLoopModel
    """Its tree, closures and actuated joints."""
    visual: pin.GeometryModel
    """Its geometry."""
    robot: RPSRobot | None
    """The 3-RPS, if it is one."""
    is_skeleton: bool = False
    """Whether the geometry is bars between the joints, in place of shapes of its own."""

    @property
    def model(self) -> pin.Model:
        """The open tree."""
        return self.mechanism.model

    @property
    def title(self) -> str:
        """The robot's name, for captions."""
        return f"3-RPS {self.robot.parameters.name}" if self.robot else self.mechanism.name


def displayed(
    what: RPSRobot | ClosedLoopModel, visual: pin.GeometryModel | None = None
) -> DisplayedMechanism:
    """Return a mechanism with its visual geometry.

    Parameters
    ----------
    what
        A 3-RPS, or any mechanism.
    visual
        Its geometry. Default: a robot's own; for a mechanism, the shapes in its file, or bars
        between its joints where there are none. Meshes that are not found are told in a warning.

    Raises
    ------
    InputError
        If `what` is neither.
    """
    if isinstance(what, RPSRobot):
        shapes = what.visual_model() if visual is None else visual
        return DisplayedMechanism(what.mechanism, shapes, what)
    if isinstance(what, ClosedLoopModel):
        shapes = own_shapes(what) if visual is None else visual
        bars = shapes is None
        return DisplayedMechanism(what, skeleton(what) if bars else shapes, None, bars)
    raise InputError(f"{type(what).__name__} cannot be shown: an RPSRobot or ClosedLoopModel can")


def without_shapes(what: RPSRobot | ClosedLoopModel) -> DisplayedMechanism:
    """Return a mechanism with nothing to draw, for what does not depend on shapes.

    Raises
    ------
    InputError
        If `what` is no mechanism.
    """
    return displayed(what, pin.GeometryModel())


def motion_of(subject: DisplayedMechanism, given: Any = None) -> Motion:
    """Return the motion of a mechanism.

    Parameters
    ----------
    subject
        The mechanism.
    given
        A `Motion`, a `Simulation`, a `MotionRun`, or a trajectory of the pose or of the mechanism's
        task; or one pose (3,) of a 3-RPS, or one configuration (nq,). Default: the mechanism's
        home.

    Raises
    ------
    InputError
        If it does not fit the mechanism, or is left out for a 3-RPS, which has no home.
    UnreachableError
        If a pose is out of reach.
    """
    model, robot = subject.model, subject.robot
    if isinstance(given, Motion):
        return given
    if isinstance(given, Simulation):
        states, reactions = (given.q, given.v, given.a), given.constraint_forces
        return Motion(model, given.time, *states, forces=given.tau, constraint_forces=reactions)
    if robot is None:
        return _of_mechanism(subject.mechanism, given)
    if isinstance(given, MotionRun):
        states = given.configuration, given.generalised_velocity, given.generalised_acceleration
        reactions = given.reaction.reshape(len(given.time), -1)
        return Motion(model, given.time, *states, forces=given.force, constraint_forces=reactions)
    if hasattr(given, "sample") and hasattr(given, "duration"):
        times = sample_times(given.duration, _SAMPLE_RATE)
        return Motion(model, times, *robot.state(*given.sample(times)))
    if given is None:
        raise InputError("a 3-RPS is shown at a pose (z, tilt_x, tilt_y), or along a trajectory")
    return Motion(model, [0.0], configuration_of(subject, given)[None])


def _of_mechanism(mechanism: ClosedLoopModel, given: Any) -> Motion:
    """Return the motion of a trajectory of the mechanism's task from its home, or of one pose."""
    model = mechanism.model
    if not (hasattr(given, "sample") and hasattr(given, "duration")):
        return Motion(model, [0.0], _one(mechanism.home if given is None else given, model))
    times = sample_times(given.duration, _SAMPLE_RATE)
    x, rate, acceleration = given.sample(times)
    q = mechanism.task.follow(x)
    return Motion(model, times, *mechanism.task.motion(q, rate, acceleration))


def configuration_of(subject: DisplayedMechanism, given: Any) -> Array:
    """Return a configuration (nq,), given as such or as a pose (3,) of a 3-RPS."""
    if subject.robot is not None and np.shape(given) == (3,):
        still = np.zeros(3)
        return subject.robot.state(given, still, still)[0]
    return _one(given, subject.model).ravel()


def _one(given: Any, model: pin.Model) -> Array:
    try:
        return real_vector(given, model.nq, f"a configuration of {model.name!r}")[None]
    except InputError as error:
        raise InputError(f"not a motion, a pose or a configuration: {error}") from None
