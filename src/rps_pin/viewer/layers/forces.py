"""Layer ``forces``: actuator forces, as arrows along their joints' axes.

An arrow begins at its joint and points, for a positive force, where the joint's coordinate grows. A
torque has two heads, and its own scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.viewer.layers.arrows import NO_FORCES, ArrowKind, Vectors, closed_state, draw_arrows
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, RobotSizedLayer
from rps_pin.viewer.layers.colours import ORANGE
from rps_pin.viewer.layers.parts import arrow, double_arrow
from rps_pin.viewer.motion import MotionState
from rps_pin.viewer.scene.links import node_name


@dataclass(frozen=True)
class Forces(RobotSizedLayer):
    """Actuator forces.

    Parameters
    ----------
    newtons_per_metre
        Force of an arrow of 1 m, N. Default: a round number.
    newton_metres_per_metre
        The same for torques, N m.
    """

    newtons_per_metre: float | None = None
    newton_metres_per_metre: float | None = None

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the arrows; see `Layer`."""
        mechanism, model = context.subject.mechanism, context.subject.model
        data, outside = model.createData(), context.motion.wrenches
        actuators = _actuators(mechanism)

        def vectors(state: MotionState) -> Vectors:
            try:
                tau = state.tau
                if tau is None:
                    q, v, a = closed_state(context, state)[:3]
                    tau = mechanism.inverse_dynamics(q, v, a, wrenches=outside).tau
            except NO_FORCES:
                return {}
            pin.computeJointJacobians(model, data, state.q)
            return {
                one.node: (np.array(data.oMi[one.joint].translation), force * one.axis(model, data))
                for one, force in zip(actuators, tau, strict=True)
            }

        kinds = {
            one.node: ArrowKind(double_arrow, "N m") if one.turns else ArrowKind(arrow, "N")
            for one in actuators
        }
        scales = {"N": self.newtons_per_metre, "N m": self.newton_metres_per_metre}
        return draw_arrows("forces", "actuators' forces", ORANGE, context, kinds, vectors, scales)


class _Actuator(NamedTuple):
    """One actuated coordinate."""

    node: str
    """The arrow's node."""
    joint: int
    """Index of the joint."""
    column: int
    """Its index in the velocity."""
    turns: bool
    """Whether its force is a torque."""

    def axis(self, model: pin.Model, data: pin.Data) -> Array:
        """Return its unit direction in world axes, after `computeJointJacobians`."""
        column = _column(model, data, self.joint, self.column)
        return column[3:] if self.turns else column[:3]


def _actuators(mechanism: ClosedLoopModel) -> list[_Actuator]:
    """Return the actuated coordinates in the order of tau."""
    model, data = mechanism.model, mechanism.model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    found: list[_Actuator] = []
    for column in (int(index) for index in mechanism.actuated_indices):
        joint = max(j for j in range(1, model.njoints) if model.joints[j].idx_v <= column)
        own, name = model.joints[joint], node_name(model.names[joint])
        node = name if own.nv == 1 else f"{name}_{column - own.idx_v + 1}"
        turns = not _column(model, data, joint, column)[:3].any()
        found.append(_Actuator(node, joint, column, turns))
    return found


def _column(model: pin.Model, data: pin.Data, joint: int, column: int) -> Array:
    """Return the twist of a joint's origin at unit speed, world axes, shape (6,)."""
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    return np.array(pin.getJointJacobian(model, data, joint, frame)).reshape(6, -1)[:, column]
