"""Actuator forces and reactions through the constraint models, memory allocated once.

With S picking the actuators and J the loop closures' Jacobian, both follow from one solution of

    [J' S'] [lambda; tau] = rnea(q, v, a) + friction,

twelve equations. The robot's `pin.Model` is shared and never changed; data, constraint models and
their data are this object's own.
"""

from __future__ import annotations

import math
import struct

import eigenpy
import numpy as np
import pinocchio as pin
from pinocchio import computeJointJacobians, getConstraintsJacobian, rnea

from rps_pin.arrays import Array
from rps_pin.closed_loop import LoopClosure
from rps_pin.control.estimator.robot_state import RobotState
from rps_pin.rps.dynamics.friction import has_friction
from rps_pin.rps.robot import RPSRobot

#: q (13), v (12) and a (12), one after the other: packed at once, faster than by slices.
_STATE = struct.Struct("37d")


class ConstrainedForces:
    """The forces of one robot; for use in one thread.

    Parameters
    ----------
    robot
        The robot, with its payload and friction.
    """

    def __init__(self, robot: RPSRobot) -> None:
        mechanism = robot.mechanism
        self._model = model = mechanism.model
        self._data = model.createData()
        self._constraints = pin.StdVec_RigidConstraintModel()
        self._constraint_data = pin.StdVec_RigidConstraintData()
        for closure in mechanism.closures:
            if isinstance(closure, LoopClosure):  # all of them are
                constraint = closure.constraint_model(model)
                self._constraints.append(constraint)
                self._constraint_data.append(constraint.createData())
        # Iterating a StdVec makes new Python objects each time.
        self._calls = [
            (constraint.calc, data)
            for constraint, data in zip(self._constraints, self._constraint_data, strict=True)
        ]
        self._memory = bytearray(_STATE.size)
        state = np.frombuffer(self._memory)
        self._q, self._v, self._a = state[:13], state[13:25], state[25:]
        self._matrix = np.zeros((model.nv, model.nv), order="F")
        self._factors = eigenpy.PartialPivLU(model.nv)
        self._closures = self._matrix.T[:9]  # J, in the rows that are the matrix's columns
        for column, name in enumerate(mechanism.actuated):
            self._matrix[model.joints[model.getJointId(name)].idx_v, 9 + column] = 1.0
        p = robot.parameters
        self._friction_speed = p.friction_speed
        self._revolute = p.revolute_damping, p.revolute_friction
        self._prismatic = p.prismatic_damping, p.prismatic_friction
        self._resisted = has_friction(p)

    def solve(self, state: RobotState) -> list[float] | None:
        """Return nine reactions, then three forces, N; None where they are not determined.

        Reactions are those of `RPSRobot.inverse_dynamics`: the force of each leg on the platform,
        in base axes.
        """
        _STATE.pack_into(self._memory, 0, *state)
        return self.solve_state(self._q, self._v, self._a)

    def solve_state(self, q: Array, v: Array, a: Array) -> list[float] | None:
        """Return the same of a Pinocchio state: (13,), (12,), (12,), closed (see `solve`)."""
        model, data = self._model, self._data
        force = rnea(model, data, q, v, a)
        computeJointJacobians(model, data, q)
        for calc, scratch in self._calls:  # getConstraintsJacobian reads what they refresh
            calc(model, data, scratch)
        self._closures[:] = getConstraintsJacobian(
            model, data, self._constraints, self._constraint_data
        )
        if self._resisted:
            self._add_friction(force, v)
        self._factors.compute(self._matrix)
        found: list[float] = self._factors.solve(force).tolist()
        return found if math.isfinite(sum(found)) else None

    def _add_friction(self, force: Array, v: Array) -> None:
        """Add d v + f tanh(v / v_s) of the legs' joints."""
        speeds = v.tolist()
        for index in range(6):
            damping, dry = self._prismatic if index % 2 else self._revolute
            speed = speeds[index]
            force[index] += damping * speed + dry * math.tanh(speed / self._friction_speed)
