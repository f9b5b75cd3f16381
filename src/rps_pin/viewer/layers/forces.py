"""Layers ``forces`` and ``reactions``: arrows of forces and moments, in one scale for each unit.

Both layers of a view are in the same scale, unless one is given; the legend says it.

An arrow of an actuator begins at its joint and points, for a positive force, where the joint's
coordinate grows. A torque has two heads, and its own scale. Reactions are the forces in the closed
joints, on the first frame's side. Where constraint rows are redundant the reactions are not unique;
those of least norm are shown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop import ClosedLoopModel, LoopClosure
from rps_pin.errors import ClosureError, InfeasibleError, InputError, SingularityError
from rps_pin.viewer.displayed_mechanism import DisplayedMechanism
from rps_pin.viewer.layers.base import DrawnLayer, LayerContext, NodeState, RobotSizedLayer
from rps_pin.viewer.layers.colours import BLACK, GOLD, css
from rps_pin.viewer.layers.parts import SMALLEST, arrow, double_arrow, pointing
from rps_pin.viewer.motion import Motion, MotionState
from rps_pin.viewer.scene.legend import LegendEntry
from rps_pin.viewer.scene.links import node_name
from rps_pin.viewer.scene.shapes import Part, translated
from rps_pin.viewer.scene.stage import length_text, round_number

Vectors = Mapping[str, tuple[Array, Array]]
"""Origin of each arrow, m, and the force or moment that it shows, by node."""
_UNSEEN_GAP = 1e-2
"""Gap of the closures between samples of a motion that is closed here, in radii of the picture."""

_LONGEST = 0.7
"""Length of the longest arrow, at most, in radii of the picture."""
_MOST_STATES = 50
_STOUT = 1.7
"""Thickness of reactions: they are seen around an actuator's force along the same line."""


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

    def missing(self, subject: DisplayedMechanism, motion: Motion) -> str:
        """Return whether there are no actuators, no forces, or no masses; see `Layer`."""
        none = "" if subject.mechanism.actuated else "no joint is actuated"
        if motion.forces is not None and not motion.forces.any():
            none = none or "the actuators exert no force in this motion"
        return none or _without_masses(subject, motion.forces)

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the arrows; see `Layer`."""
        mechanism, model = context.subject.mechanism, context.subject.model
        data, outside = model.createData(), context.motion.wrenches
        actuators = _actuators(mechanism)

        def vectors(state: MotionState) -> Vectors:
            tau = state.tau
            if tau is None:
                q, v, a = _closed_state(context, state)[:3]
                tau = mechanism.inverse_dynamics(q, v, a, wrenches=outside).tau
            pin.computeJointJacobians(model, data, state.q)
            found = {}
            for (node, joint, column, turns), force in zip(actuators, tau, strict=True):
                axis = _column(model, data, joint, column)[3 * turns :][:3]
                found[node] = (np.array(data.oMi[joint].translation), force * axis)
            return found

        units = {one.node: "N m" if one.turns else "N" for one in actuators}
        scales = {"N": self.newtons_per_metre, "N m": self.newton_metres_per_metre}
        title = LegendEntry("forces", "actuators' forces", css(GOLD))
        return _arrows(title, GOLD, context, units, vectors, scales)


@dataclass(frozen=True)
class Reactions(RobotSizedLayer):
    """Forces (not moments) in the closures; of a 3-RPS, of each leg on the platform.

    Parameters
    ----------
    newtons_per_metre
        Force of an arrow of 1 m, N. Default: a round number.
    """

    newtons_per_metre: float | None = None

    def missing(self, subject: DisplayedMechanism, motion: Motion) -> str:
        """Return whether there are no loop closures, or no masses; see `Layer`."""
        closed = any(isinstance(one, LoopClosure) for one in subject.mechanism.closures)
        none = "" if closed else "the mechanism has no loop closures"
        return none or _without_masses(subject, motion.constraint_forces)

    def draw(self, context: LayerContext) -> DrawnLayer:
        """Return the arrows; see `Layer`."""
        mechanism, model = context.subject.mechanism, context.subject.model
        data, outside = model.createData(), context.motion.wrenches
        closures = [one for one in mechanism.closures if isinstance(one, LoopClosure)]

        def vectors(state: MotionState) -> Vectors:
            forces = state.constraint_forces
            if forces is None:
                q, v, a, tau, _ = _closed_state(context, state)
                if tau is None:
                    forces = mechanism.inverse_dynamics(q, v, a, wrenches=outside).constraint_forces
                else:
                    forces = mechanism.constraint_forces(q, v, a, tau, wrenches=outside)
            wrenches = mechanism.closure_wrenches(state.q, forces)
            pin.forwardKinematics(model, data, state.q)
            return {
                node_name(one.name): (
                    np.array(one.closed_frames(model)[0].at(data).translation),
                    wrenches[one.name][:3],
                )
                for one in closures
            }

        units = {node_name(one.name): "N" for one in closures}
        title = LegendEntry("reactions", "forces in the closed joints", css(BLACK))
        scales = {"N": self.newtons_per_metre}
        return _arrows(title, BLACK, context, units, vectors, scales, _STOUT)


def _without_masses(subject: DisplayedMechanism, known: Array | None) -> str:
    """Return a sentence where forces are not known, and would all be zero for want of masses."""
    massive = known is not None or any(one.mass for one in subject.model.inertias)
    return "" if massive else "no link has a mass"


def _arrows(
    title: LegendEntry,
    colour: int,
    context: LayerContext,
    units: Mapping[str, str],
    vectors_in: Callable[[MotionState], Vectors],
    scales: Mapping[str, float | None],
    stout: float = 1.0,
) -> DrawnLayer:
    """Return a layer of arrows.

    Parameters
    ----------
    title, colour
        The begin of the layer's entry in the legend; colour of the arrows.
    context
        The mechanism and motion.
    units
        ``N`` or ``N m`` of each arrow, by node.
    vectors_in
        Returns the vectors in a state. Arrows without one are not seen, and none are where it
        raises an error of forces that are not determined.
    scales
        By unit, the force or moment of an arrow of 1 m; None for a round number.
    stout
        Thickness of the arrows, in that of others.
    """
    motion = context.motion
    for given in scales.values():
        if given is not None and not 0.0 < given < np.inf:
            raise InputError(f"layer {title.name!r}: a scale of {given}; it must be positive")

    def vectors(state: MotionState) -> Vectors:
        try:
            return vectors_in(state)
        except (ClosureError, InfeasibleError, SingularityError):
            return {}

    greatest = dict.fromkeys(units.values(), 0.0)
    for elapsed in np.linspace(0.0, motion.duration, min(_MOST_STATES, len(motion.times))):
        for node, (_, vector) in vectors(motion.state_at(float(elapsed))).items():
            greatest[units[node]] = max(greatest[units[node]], float(np.linalg.norm(vector)))
    parts: list[Part] = []
    for node, unit in units.items():
        parts += (arrow if unit == "N" else double_arrow)(node, colour, stout)
    hidden = translated(context.box.centre)
    hidden[:3, :3] *= SMALLEST

    def in_scale(of_all: Mapping[str, float]) -> DrawnLayer:
        """Return the layer in the scale of the greatest force and moment of all arrows."""
        per_metre = {
            unit: scales[unit] or _round_scale(of_all[unit], context.radius)
            for unit in sorted(greatest)
        }

        def update(state: MotionState) -> dict[str, NodeState]:
            states = dict.fromkeys(units, NodeState(hidden))
            for node, (origin, vector) in vectors(state).items():
                states[node] = NodeState(pointing(origin, vector / per_metre[units[node]]))
            return states

        lengths = ", ".join(
            _scale_text(unit, one, context.radius) for unit, one in per_metre.items()
        )
        first = motion.state_at(0.0)
        known = first.tau if title.name == "forces" else first.constraint_forces
        at_rest = ", at rest" if len(motion.times) == 1 else ", of each pose at rest"
        if known is not None or not motion.at_rest:
            at_rest = ""
        most = ", ".join(f"at most {greatest[unit]:.3g} {unit}" for unit in per_metre)
        text = f"{title.text}{at_rest}: {lengths}; {most}"
        legend = LegendEntry(title.name, text, title.colour)
        return DrawnLayer(legend, parts, update, greatest=greatest, in_scale=in_scale)

    return in_scale(greatest)


def _round_scale(greatest: float, radius: float) -> float:
    """Return the force of an arrow of 1 m, such that the longest fits and lengths are round."""
    return 1.0 / (round_number(_LONGEST * radius / greatest) if greatest else radius)


def _closed_state(context: LayerContext, state: MotionState) -> MotionState:
    """Return a state with closed loops: interpolation between samples opens them a little.

    A state with a gap that can be seen is returned as it is.
    """
    mechanism = context.subject.mechanism
    if mechanism.loop_gap(state.q) > _UNSEEN_GAP * context.radius:
        return state
    return state._replace(q=mechanism.close(state.q, within_limits=False, restarts=0))


def _scale_text(unit: str, scale: float, radius: float) -> str:
    """Return a scale in words: the length of the arrow of a round force."""
    force = round_number(0.5 * radius * scale)
    return f"{length_text(force / scale)} for {force:g} {unit}"


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
