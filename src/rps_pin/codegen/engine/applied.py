"""A mechanism with parameters of other numbers, for the Pinocchio engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import Closure, LoopClosure, joint_id
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.codegen.expressions.parameters import Parameters
from rps_pin.errors import InputError


def with_parameters(
    mechanism: ClosedLoopModel, groups: Sequence[str], values: Array
) -> ClosedLoopModel:
    """Return a mechanism with other numbers, in the order of `Parameters`; home is not kept.

    Parameters
    ----------
    mechanism
        The mechanism with the nominal numbers.
    groups
        Names of the groups.
    values
        Their numbers, shape (np,).
    """
    model, closures = mechanism.model.copy(), list(mechanism.closures)
    start = 0
    for group in groups:
        size = Parameters(mechanism.system, [group]).nominal.size
        _apply(model, closures, group, np.array(values[start : start + size]))
        start += size
    return ClosedLoopModel(
        model,
        closures,
        mechanism.actuated,
        effects=mechanism.effects,
        name=mechanism.name,
        characteristic_length=mechanism.characteristic_length,
        max_condition=mechanism.max_condition,
        accuracy=mechanism.accuracy,
    )


def _apply(model: pin.Model, closures: list[Closure], group: str, values: Array) -> None:
    kind, _, name = group.partition(":")
    if kind == "gravity":
        model.gravity.linear = values
    elif kind == "inertia":
        model.inertias[joint_id(model, name, group)] = _body(values, group)
    elif kind == "mass":
        joint = joint_id(model, name, group)
        body = model.inertias[joint]
        scaled = body.toDynamicParameters() * (values[0] / body.mass)
        model.inertias[joint] = pin.Inertia.FromDynamicParameters(scaled)
    elif kind == "placement":
        joint = joint_id(model, name, group)
        model.jointPlacements[joint] = model.jointPlacements[joint] * _move(values)
    elif kind == "closure":
        index = next(i for i, closure in enumerate(closures) if closure.name == name)
        closures[index] = _moved_ends(closures[index], values)
    elif kind == "distance":
        index = next(i for i, closure in enumerate(closures) if closure.name == name)
        rod = closures[index]
        assert isinstance(rod, LoopClosure)
        closures[index] = replace(rod, distance=float(values[0]))
    else:
        frame = model.frames[model.getFrameId(name)]
        body = frame.placement.act(_body(values, group))
        model.inertias[frame.parentJoint] = model.inertias[frame.parentJoint] + body


def _body(values: Array, group: str) -> pin.Inertia:
    """Return a body; Pinocchio divides by its mass, which may be zero."""
    if values[0]:
        return pin.Inertia.FromDynamicParameters(values)
    if values[1:4].any():
        raise InputError(
            f"{group}: first moment {values[1:4]} kg m without mass; the Pinocchio engine cannot "
            "answer here"
        )
    xx, xy, yy, xz, yz, zz = values[4:]
    return pin.Inertia(0.0, np.zeros(3), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def _moved_ends(closure: Closure, values: Array) -> LoopClosure:
    """Return a closure whose closed frames stand elsewhere."""
    assert isinstance(closure, LoopClosure)  # a coupling has no placements
    a, b = (
        offset * _move(part)
        for offset, part in zip(closure.offsets(), (values[:6], values[6:]), strict=True)
    )
    return replace(closure, placement_a=a, placement_b=b)


def _move(values: Array) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(*values[3:]), values[:3])
