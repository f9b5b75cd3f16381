"""What a controller knows of a 3-RPS; see `rps_pin.control.model`."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from numpy.typing import ArrayLike

from rps_pin.control.estimator.effective_inertia import TaskSpaceInertia
from rps_pin.control.estimator.leg_formulas import LegFormulas
from rps_pin.control.estimator.leg_geometry import (
    LARGEST_LENGTH,
    LegGeometry,
    closure_determinant,
    in_range,
    leg_geometry,
)
from rps_pin.control.estimator.leg_jacobian import leg_jacobian
from rps_pin.control.estimator.loop_arguments import three_floats
from rps_pin.control.estimator.real_time_robot import RealTimeRobot
from rps_pin.control.estimator.robot_state import robot_state
from rps_pin.control.estimator.state_estimate import StateEstimate
from rps_pin.control.loop.limits import RobotLimits
from rps_pin.control.loop.rejoining import rejoining_time
from rps_pin.control.loop.vectors import difference
from rps_pin.rps.kinematics.tracking import Triple
from rps_pin.rps.robot import RPSRobot


class LegModel(LegFormulas):
    """A 3-RPS in closed form, and its state estimate.

    Parameters
    ----------
    robot, near
        As for `RealTimeRobot`.
    period, largest_jump
        Likewise; a largest jump of None is 1.2 times what the actuators' speed limit allows.
    **settings
        Likewise.
    """

    size = actuators = 3
    units: tuple[str, ...] = ("m", "rad", "rad")
    rows = "triples"
    coordinates = staticmethod(three_floats)

    def __init__(
        self,
        robot: RPSRobot,
        near: ArrayLike,
        *,
        period: float,
        largest_jump: float | None,
        **settings: Any,
    ) -> None:
        p, self._robot = robot.parameters, robot
        super().__init__(float(p.platform_radius))
        self._g, self._radius = float(p.base_radius), float(p.platform_radius)
        self.largest = LARGEST_LENGTH * (self._g + self._radius)
        jump = 1.2 * p.actuator_speed_limit * period if largest_jump is None else largest_jump
        self.estimate = RealTimeRobot(
            robot, near, period=period, largest_jump=jump, compiled=False, **settings
        )
        self._limits, self._inertia = RobotLimits(p), TaskSpaceInertia(robot)
        self.violated, self.messages = self._limits.violated, self._limits.messages
        self.mass = self._inertia.of
        self._speed_limit = p.actuator_speed_limit

    def geometry(self, pose: Triple, near: Any = None) -> LegGeometry | None:
        """Return the legs of a pose, which are the same wherever they come from."""
        return leg_geometry(pose, self._g, self._radius)

    def out_of_reach(self, pose: Triple, near: Any = None) -> str:
        """Return why a pose has no legs."""
        reached = in_range(pose, self._g, self._radius)
        return "makes the length of a leg zero" if reached else "is out of range"

    def determinant(self, geometry: LegGeometry) -> float:
        """Return Eq. 8's determinant."""
        return float(closure_determinant(geometry, self._g, self._radius))

    def near_singular(self, state: StateEstimate, least: float) -> bool:
        """Return whether a determinant, 1 at most, is below a limit."""
        determinant = closure_determinant(state.geometry, self._g, self._radius)
        return not (abs(state.jacobian.determinant) > least < abs(determinant))

    def rejoining_time(self, held: LegGeometry, target: LegGeometry) -> float:
        """Return the duration at half of the actuators' speed limit."""
        legs = difference(held.length, target.length)
        return rejoining_time(max(map(abs, legs)), self._speed_limit)

    def extrapolated(self, state: StateEstimate, time: float) -> StateEstimate | None:
        """Return the state after a time at the last rate."""
        (z, wx, wy), (dz, dwx, dwy) = state.geometry.pose, state.rate
        geometry = self.geometry((z + time * dz, wx + time * dwx, wy + time * dwy))
        if geometry is None:
            return None
        return StateEstimate(
            geometry, state.rate, state.speed, leg_jacobian(geometry, self._radius)
        )

    def numbers(self) -> dict[str, Any]:
        """Return what generated code takes of the robot."""
        terms = self._robot.force_terms
        own = {one.name: getattr(terms, one.name) for one in fields(terms)}
        return {**self.estimate.numbers(), **own}

    def setpoint_memory(self, geometry: LegGeometry) -> dict[str, Any]:
        """Return what the next tick takes of the target's geometry."""
        return {"target_pose": geometry.pose}

    def setpoint_geometry(self, memory: dict[str, Any]) -> LegGeometry:
        """Return the geometry of the target in generated code's memory."""
        geometry = self.geometry(memory["target_pose"])
        assert geometry is not None  # of a regular tick
        return geometry

    def forces(self, geometry: LegGeometry, rate: Triple, acceleration: Triple) -> Triple | None:
        """Return the actuator forces of a motion, None if they are not determined."""
        state = robot_state(geometry, rate, acceleration, self._radius)
        solved = self.estimate.dynamics.solve(state)
        return None if solved is None else (solved[9], solved[10], solved[11])
