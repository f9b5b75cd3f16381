"""Layer ``reactions``: the forces in the closed joints, on the first frame's side.

Where constraint rows are redundant the reactions are not unique; those of least norm are shown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import LoopClosure
from rps_pin.errors import InputError
from rps_pin.viewer.layers.arrows import NO_FORCES, ArrowKind, Vectors, closed_state, draw_arrows
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, RobotSizedLayer
from rps_pin.viewer.layers.colours import SKY
from rps_pin.viewer.layers.parts import arrow
from rps_pin.viewer.motion import MotionState
from rps_pin.viewer.scene.links import node_name


@dataclass(frozen=True)
class Reactions(RobotSizedLayer):
    """Forces (not moments) in the closures; of a 3-RPS, of each leg on the platform.

    Parameters
    ----------
    newtons_per_metre
        Force of an arrow of 1 m, N. Default: a round number.
    """

    newtons_per_metre: float | None = None

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the arrows; see `Layer`."""
        mechanism, model = context.subject.mechanism, context.subject.model
        data = model.createData()
        frames = {
            closure.name: closure.frame_ids(model)[0]
            for closure in mechanism.closures
            if isinstance(closure, LoopClosure)
        }
        if not frames:
            raise InputError("layer 'reactions': the mechanism has no loop closures")

        def vectors(state: MotionState) -> Vectors:
            try:
                forces = _constraint_forces(context, state)
            except NO_FORCES:
                return {}
            wrenches = mechanism.closure_wrenches(state.q, forces)
            pin.framesForwardKinematics(model, data, state.q)
            return {
                node_name(name): (np.array(data.oMf[frame].translation), wrenches[name][:3])
                for name, frame in frames.items()
            }

        kinds = {node_name(name): ArrowKind(arrow, "N") for name in frames}
        scales = {"N": self.newtons_per_metre}
        return draw_arrows(
            "reactions", "forces in the closed joints", SKY, context, kinds, vectors, scales
        )


def _constraint_forces(context: LayerContext, state: MotionState) -> Array:
    if state.constraint_forces is not None:
        return state.constraint_forces
    mechanism, wrenches = context.subject.mechanism, context.motion.wrenches
    q, v, a, tau, _ = closed_state(context, state)
    if tau is not None:
        return mechanism.constraint_forces(q, v, a, tau, wrenches=wrenches)
    return mechanism.inverse_dynamics(q, v, a, wrenches=wrenches).constraint_forces
