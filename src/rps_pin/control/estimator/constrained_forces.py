"""Inverse dynamics of the robot in a control loop: actuator forces and reactions.

With S selecting the actuators and J the closures' Jacobian, both follow from one solution of

    [J' S'] [lambda; tau] = rnea(q, v, a) + friction,

twelve equations. It is `rps_pin.closed_loop.dynamics.inverse_dynamics` for a robot whose state is
closed and whose J_p is square and regular, checked before, without its reports (condition, residual
force): one LU factorisation in memory allocated once takes 4.1 us where that takes 6.1 us, with
friction 4.9 us for 9.8 us.
"""

from __future__ import annotations

import math
import struct
from typing import Any

import eigenpy
import numpy as np
from pinocchio import computeJointJacobians, getConstraintsJacobian, rnea

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.equations import ClosureEquations
from rps_pin.closed_loop.dynamics.passive_joint_forces import friction_force
from rps_pin.control.estimator.robot_state import RobotState
from rps_pin.rps.robot import RPSRobot

#: q (13), v (12) and a (12) in one buffer: faster to fill at once than by slices.
_STATE = struct.Struct("37d")


class ConstrainedForces:
    """Inverse dynamics of one robot, with its memory allocated once; for use in one thread.

    Parameters
    ----------
    robot
        The robot, with its payload and friction. Its `pin.Model` is shared and not changed.
    """

    def __init__(self, robot: RPSRobot) -> None:
        self._robot = robot
        system = robot.mechanism.system
        model = self._model = system.model
        self._equations = ClosureEquations(model, system.equations.closures)
        self._memory = bytearray(_STATE.size)
        state = np.frombuffer(self._memory)
        self._q, self._v, self._a = state[:13], state[13:25], state[25:]
        self._matrix = np.zeros((model.nv, model.nv), order="F")
        self._factors = eigenpy.PartialPivLU(model.nv)
        self._closures = self._matrix.T[:9]  # J, in the rows that are the matrix's columns
        self._matrix[system.actuated, 9 + np.arange(3)] = 1.0
        self._friction: list[tuple[int, float, float]] = []
        if system.effects is not None:
            joints = zip(system.effects.damping.tolist(), system.effects.friction, strict=True)
            self._friction = [(i, d, float(f)) for i, (d, f) in enumerate(joints) if d or f]
            self._friction_speed = system.effects.friction_speed

    def __reduce__(self) -> tuple[Any, ...]:
        """Give copies scratch memory of their own; there is no state."""
        return type(self), (self._robot,)

    def solve(self, state: RobotState) -> list[float] | None:
        """Return nine reactions, then three forces, N; None where they are not determined.

        Reactions are those of `RPSRobot.inverse_dynamics`: the force of each leg on the platform,
        in base axes.
        """
        _STATE.pack_into(self._memory, 0, *state)
        return self.solve_state(self._q, self._v, self._a)

    def solve_state(self, q: Array, v: Array, a: Array) -> list[float] | None:
        """Return the same for a closed Pinocchio state: (13,), (12,), (12,)."""
        model, equations = self._model, self._equations
        data = equations.data
        force = rnea(model, data, q, v, a)
        computeJointJacobians(model, data, q)
        for calc, scratch in equations.calls:  # getConstraintsJacobian reads what they refresh
            calc(model, data, scratch)
        self._closures[:] = getConstraintsJacobian(
            model, data, equations.constraints, equations.constraint_data
        )
        for i, damping, friction in self._friction:
            passive = friction_force(v.item(i), damping, friction, self._friction_speed)
            force[i] = force.item(i) + passive  # floats: NumPy's numbers would warn of overflow
        self._factors.compute(self._matrix)
        found: list[float] = self._factors.solve(force).tolist()
        return found if math.isfinite(sum(found)) else None
