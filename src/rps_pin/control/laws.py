"""Control laws as functions of numbers: floats in a loop, CasADi expressions in generated code.

The formulas are explained in `rps_pin.control.loop.computed_torque` and `pd_control`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol, TypeAlias

from rps_pin.control.estimator.state_estimate import StateEstimate
from rps_pin.control.loop.setpoints import Setpoint
from rps_pin.control.loop.vectors import Vectors

Compensation = Literal["gravity", "feed_forward", "none"]
#: What a law calls once with the error, the wanted rate and the rate: `pid` with its memory.
Feedback: TypeAlias = Callable[[Any, Any, Any], Any]
#: What a law calls with geometry, rate and acceleration of the pose: the actuator forces, or None.
Dynamics: TypeAlias = Callable[[Any, Any, Any], Any]


class Formulas(Protocol):
    """What a law needs of a robot's kinematics, besides its state."""

    vectors: Vectors

    def motion(self, geometry: Any, rate: Any, acceleration: Any) -> tuple[Any, Any]:
        """Return the actuators' speeds and accelerations."""
        ...

    def pose_rate(self, jacobian: Any, speed: Any) -> Any:
        """Return x' of K x' = the actuators' speeds."""
        ...

    def force_of_wrench(self, jacobian: Any, wrench: Any) -> Any:
        """Return f of K' f = wrench on the pose."""
        ...


def computed_torque(
    in_task_space: bool,
    state: StateEstimate,
    setpoint: Setpoint,
    of: Formulas,
    feedback: Feedback,
    dynamics: Dynamics,
) -> Any:
    """Return the law's forces; see the module's text."""
    geometry, rate, speed, jacobian = state
    vectors = of.vectors
    difference, total = vectors.difference, vectors.total
    if in_task_space:
        e = difference(setpoint.geometry.pose, geometry.pose)
        c = feedback(e, setpoint.rate, rate)
        return dynamics(geometry, rate, total(setpoint.acceleration, c))
    speed_wanted, wanted = of.motion(*setpoint)
    e = difference(setpoint.geometry.length, geometry.length)
    c = feedback(e, speed_wanted, speed)
    _, drift = of.motion(geometry, rate, vectors.zero)
    u = difference(total(wanted, c), drift)
    return dynamics(geometry, rate, of.pose_rate(jacobian, u))


def pd_control(
    in_task_space: bool,
    compensation: Compensation,
    state: StateEstimate,
    setpoint: Setpoint,
    of: Formulas,
    feedback: Feedback,
    dynamics: Dynamics,
) -> Any:
    """Return the law's forces; see the module's text."""
    geometry, rate, speed, jacobian = state
    vectors = of.vectors
    if in_task_space:
        e = vectors.difference(setpoint.geometry.pose, geometry.pose)
        c = of.force_of_wrench(jacobian, feedback(e, setpoint.rate, rate))
    else:
        speed_wanted, _ = of.motion(*setpoint)
        e = vectors.difference(setpoint.geometry.length, geometry.length)
        c = feedback(e, speed_wanted, speed)
    if compensation == "none":
        return c
    still = geometry, vectors.zero, vectors.zero
    base = dynamics(*(still if compensation == "gravity" else setpoint))
    return None if base is None else vectors.total(base, c)
