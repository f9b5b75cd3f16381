"""Actuators' forces of a motion of a task by cause: the parts of inverse dynamics.

At a configuration, inverse dynamics is linear in gravity, in the accelerations, in the squares of
the velocities, in the joints' own forces and in the load. With a = a_i + a_c, a_i what belongs to
the task's acceleration at rest and a_c to its rate,

    gravity  = tau(q, 0, 0)              springs  = tau_j(q, 0, 0) - tau(q, 0, 0)
    inertia  = tau(q, 0, a_i) - gravity  friction = tau_j(q, v, a) - tau(q, v, a) - springs
    coriolis = tau(q, v, a) - gravity - inertia

where tau has no forces of joints and tau_j has them, both without the load. Payload and wrench are
what they add. So the parts add up to the forces.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.loads import Loads, Payload
from rps_pin.task.task import Task
from rps_pin.validation import real_array


@dataclass(frozen=True)
class ForceParts:
    """Parts of the actuators' forces, a field for each, all of one shape; they add up."""

    @property
    def total(self) -> Array:
        """The actuators' forces."""
        whole: Array = np.sum(list(self.parts().values()), axis=0)
        return whole

    def parts(self) -> dict[str, Array]:
        """Return the parts by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


@dataclass(frozen=True)
class TaskForceCauses(ForceParts):
    """Parts of the actuators' forces, shape (n, na) each, N or N m."""

    gravity: Array
    """Holding the mechanism against gravity."""
    inertia: Array
    """Accelerating it: what is proportional to the task's acceleration."""
    coriolis: Array
    """Coriolis and centrifugal forces: what is quadratic in the task's rate."""
    springs: Array
    """Of springs in joints."""
    friction: Array
    """Of damping and friction in joints."""
    payload: Array
    """Carrying and moving the payload: its gravity, inertia and Coriolis forces."""
    external: Array
    """Withstanding the external wrench."""


@refuses_other_kinds
def force_causes(
    task: Task,
    q: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike,
    *,
    x: ArrayLike | None = None,
    payload: Payload | None = None,
    wrench: ArrayLike | None = None,
) -> TaskForceCauses:
    """Return the parts of the actuators' forces of samples of a motion.

    Parameters
    ----------
    task
        The task.
    q
        Closed configurations, shape (n, nq): `Task.follow` of the coordinates.
    rate, acceleration
        x' and x'', shape (n, m) each.
    x
        The coordinates, shape (n, m), that decide between two rotation vectors: see
        `Task.jacobian`.
    payload, wrench
        Fixed to, and exerted on, the output frame: see `Loads`.

    Raises
    ------
    InputError
        If arrays do not fit.
    SingularityError
        If a configuration is singular.
    MechanismError
        If a task of joints is to carry a load.
    """
    loads = Loads(task, payload, wrench)
    size = task.size
    q_ = real_array(q, "q", (task.mechanism.model.nq,))
    dx, ddx = real_array(rate, "rate", (size,)), real_array(acceleration, "acceleration", (size,))
    if q_.ndim != 2 or not dx.shape == ddx.shape == (len(q_), size):
        raise InputError(
            f"q, rate and acceleration have shapes {q_.shape}, {dx.shape} and {ddx.shape}; they "
            f"must be (n, {q_.shape[-1]}), (n, {size}) and (n, {size})"
        )
    loads.refuse_other_count(len(q_))
    zero = np.zeros_like(dx)
    states = [task.motion(q_, *one, x=x) for one in ((dx, ddx), (zero, ddx), (zero, zero))]
    with_joints = task.mechanism
    bodies = _without_joint_forces(with_joints)
    found = np.empty((len(fields(TaskForceCauses)), len(q_), task.mechanism.actuated_indices.size))
    for k in range(len(q_)):
        (moving, pushed, still) = ([part[k] for part in state] for state in states)
        gravity = bodies.inverse_dynamics(*still).tau
        inertia = bodies.inverse_dynamics(*pushed).tau - gravity
        own = bodies.inverse_dynamics(*moving).tau
        springs = friction = empty = loaded = np.zeros_like(gravity)
        unloaded = own
        if with_joints.effects is not None:
            unloaded = with_joints.inverse_dynamics(*moving).tau
            springs = with_joints.inverse_dynamics(*still).tau - gravity
            friction = unloaded - own - springs
        carried = unloaded
        if payload is not None:
            carried = loads.mechanism.inverse_dynamics(*moving).tau
            empty = carried - unloaded
        if wrench is not None:
            loaded = loads.dynamics(moving[0], moving[1], moving[2], k).tau - carried
        coriolis = own - gravity - inertia
        found[:, k] = gravity, inertia, coriolis, springs, friction, empty, loaded
    return TaskForceCauses(*found)


def _without_joint_forces(mechanism: ClosedLoopModel) -> ClosedLoopModel:
    """Return a mechanism without damping, friction and springs."""
    return mechanism if mechanism.effects is None else mechanism.without_effects()
