"""What is shown: a mechanism, what it looks like, and the 3-RPS it may be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.closed_loop.simulation.result import Simulation
from rps_pin.closed_loop.visuals import skeleton
from rps_pin.errors import InputError, shown
from rps_pin.rps.dynamics.motion_run import MotionRun, sample_times
from rps_pin.rps.robot import RPSRobot
from rps_pin.viewer.motion import Motion

_SAMPLE_RATE = 100.0
"""Samples a second of a trajectory."""


@dataclass(frozen=True)
class Subject:
    """A mechanism with its shapes."""

    mechanism: ClosedLoopModel
    """Its tree, closures and actuated joints."""
    visual: pin.GeometryModel
    """Its shapes."""
    robot: RPSRobot | None
    """The 3-RPS that it is, or None."""

    @property
    def model(self) -> pin.Model:
        """The open tree."""
        return self.mechanism.model


def subject_of(
    what: RPSRobot | ClosedLoopModel, visual: pin.GeometryModel | None = None
) -> Subject:
    """Return what is to be shown.

    Parameters
    ----------
    what
        A 3-RPS, or any mechanism.
    visual
        What to draw. Left out: a robot's own shapes; of a mechanism, bars between its joints.

    Raises
    ------
    InputError
        If it is neither.
    """
    if isinstance(what, RPSRobot):
        return Subject(what.mechanism, visual or what.visual_model(), what)
    if isinstance(what, ClosedLoopModel):
        return Subject(what, visual or skeleton(what), None)
    raise InputError(f"{type(what).__name__} cannot be shown: an RPSRobot or ClosedLoopModel can")


def motion_of(subject: Subject, given: Any = None) -> Motion:
    """Return the motion that is meant.

    Parameters
    ----------
    subject
        What moves.
    given
        A `Motion`, a `Simulation`, a `MotionRun` or a trajectory of a 3-RPS; or what stands still:
        a pose (3,) of a 3-RPS, or a configuration (nq,). Left out: the mechanism's home.

    Raises
    ------
    InputError
        If it does not fit the subject; a 3-RPS has no home, and needs one of these.
    UnreachableError
        If a pose is out of reach.
    """
    model, robot = subject.model, subject.robot
    if isinstance(given, Motion):
        return given
    if isinstance(given, Simulation):
        return Motion(
            model,
            given.time,
            given.q,
            given.v,
            given.a,
            forces=given.tau,
            constraint_forces=given.constraint_forces,
        )
    if robot is None:
        return Motion(model, [0.0], _one(subject.mechanism.home if given is None else given, model))
    if isinstance(given, MotionRun):
        states = robot.state(given.pose, given.rate, given.acceleration)
        reactions = given.reaction.reshape(len(given.time), -1)
        return Motion(model, given.time, *states, forces=given.force, constraint_forces=reactions)
    if hasattr(given, "sample") and hasattr(given, "duration"):
        times = sample_times(given.duration, _SAMPLE_RATE)
        return Motion(model, times, *robot.state(*given.sample(times)))
    if given is None:
        raise InputError("a 3-RPS is shown at a pose (z, tilt_x, tilt_y), or along a trajectory")
    return Motion(model, [0.0], configuration_of(subject, given)[None])


def configuration_of(subject: Subject, given: Any) -> Array:
    """Return the configuration (nq,) that is meant: itself, or a pose (3,) of a 3-RPS."""
    if subject.robot is not None and np.shape(given) == (3,):
        still = np.zeros(3)
        q: Array = subject.robot.state(given, still, still)[0]
        return q
    return _one(given, subject.model).ravel()


def _one(given: Any, model: pin.Model) -> Array:
    try:
        q = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{shown(given)} is no motion, and no configuration") from None
    if q.shape != (model.nq,):
        raise InputError(
            f"a configuration of {model.name!r} has shape ({model.nq},), not {q.shape}"
        )
    return q[None]
