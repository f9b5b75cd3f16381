"""Layer ``reactions``: the forces in the closed joints, on the first frame's side.

Where rows are redundant the reactions are not unique; those shown are of least norm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel, LoopClosure
from rps_pin.errors import InputError, SingularityError
from rps_pin.viewer.layers.arrows import Sized, Vectors, arrows_drawing
from rps_pin.viewer.layers.base import Context, Drawing, Framed
from rps_pin.viewer.layers.shapes import SKY, arrow
from rps_pin.viewer.motion import State


@dataclass(frozen=True)
class Reactions(Framed):
    """Forces (not moments) in the closures; of a 3-RPS, of each leg on the platform.

    Parameters
    ----------
    newtons_per_metre
        What an arrow of 1 m stands for, N. Left out: a round number.
    """

    newtons_per_metre: float | None = None

    def draw(self, context: Context) -> Drawing:
        """Return the arrows; see `Layer`."""
        mechanism, model = context.subject.mechanism, context.subject.model
        data, outside = model.createData(), context.motion.wrenches
        frames = {
            closure.name: closure.frame_ids(model)[0]
            for closure in mechanism.closures
            if isinstance(closure, LoopClosure)
        }
        if not frames:
            raise InputError("layer 'reactions': the mechanism closes no frames")

        def vectors(state: State) -> Vectors:
            try:
                forces = _constraint_forces(mechanism, state, outside)
            except SingularityError:
                return {}
            wrenches = mechanism.closure_wrenches(state.q, forces)
            pin.framesForwardKinematics(model, data, state.q)
            return {
                _node(name): (np.array(data.oMf[frame].translation), wrenches[name][:3])
                for name, frame in frames.items()
            }

        sized = {_node(name): Sized(arrow, "N") for name in frames}
        given = {"N": self.newtons_per_metre}
        return arrows_drawing(
            "reactions", "forces in the closed joints", SKY, context, sized, vectors, given
        )


def _constraint_forces(
    mechanism: ClosedLoopModel, state: State, wrenches: Mapping[str, ArrayLike]
) -> Array:
    q, v, a, tau, known = state
    if known is not None:
        return known
    if tau is not None:
        return mechanism.constraint_forces(q, v, a, tau, wrenches=wrenches)
    return mechanism.inverse_dynamics(q, v, a, wrenches=wrenches).constraint_forces


def _node(closure: str) -> str:
    return closure.replace("/", ".")
