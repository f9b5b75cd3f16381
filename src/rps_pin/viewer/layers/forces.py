"""Layer ``forces``: what the actuators exert, as arrows along their joints' axes.

An arrow begins where its joint is and points where the joint's coordinate grows, if the force is
positive. A turning joint's torque has two heads, and a scale of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rps_pin.errors import SingularityError
from rps_pin.viewer.layers.arrows import Sized, Vectors, arrows_drawing
from rps_pin.viewer.layers.base import Array, Context, Drawing, Framed
from rps_pin.viewer.layers.shapes import ORANGE, arrow, double_arrow
from rps_pin.viewer.motion import State

_AXIS = np.eye(6)


@dataclass(frozen=True)
class Forces(Framed):
    """Actuator forces.

    Parameters
    ----------
    newtons_per_metre
        What an arrow of 1 m stands for, N. Left out: a round number.
    newton_metres_per_metre
        The same for torques, N m.
    """

    newtons_per_metre: float | None = None
    newton_metres_per_metre: float | None = None

    def draw(self, context: Context) -> Drawing:
        """Return the arrows; see `Layer`."""
        mechanism, model = context.subject.mechanism, context.subject.model
        data = model.createData()
        joints = [int(model.getJointId(name)) for name in mechanism.actuated]
        columns: list[tuple[str, int, int, bool]] = []  # node, joint, row of tau, turns
        row = 0
        for joint, name in zip(joints, mechanism.actuated, strict=True):
            for index in range(model.joints[joint].nv):
                label = name.replace("/", ".")
                node = label if model.joints[joint].nv == 1 else f"{label}_{index + 1}"
                turns = not bool(np.any(_subspace(model, joint)[:3, index]))
                columns.append((node, joint, row, turns))
                row += 1

        def vectors(state: State) -> Vectors:
            try:
                tau = mechanism.inverse_dynamics(*state).tau
            except SingularityError:
                return {}
            pin.forwardKinematics(model, data, state.q)
            found = {}
            for node, joint, row, turns in columns:
                subspace = _subspace(model, joint)
                first = next(r for n, j, r, t in columns if j == joint)
                axis = subspace[:, row - first]
                direction = data.oMi[joint].rotation @ (axis[3:] if turns else axis[:3])
                found[node] = (np.array(data.oMi[joint].translation), tau[row] * direction)
            return found

        sized = {
            node: Sized(double_arrow if turns else arrow, "N m" if turns else "N")
            for node, _, _, turns in columns
        }
        given = {"N": self.newtons_per_metre, "N m": self.newton_metres_per_metre}
        return arrows_drawing("forces", "actuators' forces", ORANGE, context, sized, vectors, given)


def _subspace(model: pin.Model, joint: int) -> Array:
    """Return a joint's motion subspace in its own frame, shape (6, nv)."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, pin.neutral(model), np.zeros(model.nv))
    return np.array(data.S).reshape(6, -1)
