"""Splitting of joints with a variable motion subspace into joints with constant ones.

Pinocchio's derivatives (`pin.computeRNEADerivatives`, `pin.getFrameAccelerationDerivatives`, ...)
assume that the motion subspace S of a joint is constant in the frame of its body. That of a
universal joint, of one of Z-Y-X angles, and of most composites depends on q; the derivatives of a
tree with such a joint are wrong, without an error. The same tree with several joints in a row, and
massless links between, has constant subspaces, the same q and v, and the same dynamics:

    universal, axes a_1 and a_2:    R = exp(a_1 q_1) exp(a_2 q_2)        two revolute joints
    Z-Y-X angles:                   R = R_z(q_1) R_y(q_2) R_x(q_3)       three revolute joints
    composite:                      P_1 M_1(q_1) P_2 M_2(q_2) ...        its joints, placed at P_i
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.editing.rebuild import JointRow, NewJoint, rebuilt
from rps_pin.errors import MechanismError

_UNIVERSAL = "JointModelUniversal"
_ZYX = "JointModelSphericalZYX"
_COMPOSITE = "JointModelComposite"
#: Change of S, against its largest entry or 1, below which it counts as constant.
_CONSTANT = 1e-9
#: Axes count as of unit length within this.
_UNIT = 1e-9
#: Configurations at which S is compared with that of the neutral one.
_SAMPLES = 3


#: One of the joints in a row that a joint is split into: its placement in the part before, or in
#: the joint's own frame, and a Pinocchio joint model.
_Part = tuple[pin.SE3, Any]


def split(model: pin.Model) -> pin.Model:
    """Return the same tree with joints of constant motion subspace only.

    q and v keep their entries and order, frames their indices and names, and everything else is
    kept: inertias, limits, armature, rotors, friction, damping, gravity, reference configurations.
    The last joint of a row has the name and the body of the joint that was split; those before
    are called ``name:1``, ``name:2`` and have no frames.

    Parameters
    ----------
    model
        Any open tree; it is not changed.

    Returns
    -------
    pin.Model
        `model` itself if there is nothing to split.

    Raises
    ------
    MechanismError
        If a joint's subspace changes and it cannot be split (an ellipsoid joint, or a universal
        one whose axes are not of unit length), if a joint mimics another, or if the name of a new
        joint is taken.
    """
    for joint in model.mimicking_joints:
        raise MechanismError(
            f"Pinocchio's derivatives are not those of joint {model.names[joint]!r} (Mimic): it "
            "has none for a model with mimic joints; couple the joints instead"
        )
    rows = {joint: _row(model, joint) for joint in _changing(model)}
    if not rows:
        return model
    result = rebuilt(model, rows)
    for entry in model.referenceConfigurations:
        result.referenceConfigurations[entry.key()] = entry.data()
    return result


def _changing(model: pin.Model) -> list[int]:
    """Return the indices of the joints whose motion subspace depends on q."""
    neutral = pin.neutral(model)
    # Tangents without equal or zero entries, so that no joint is at a special angle.
    tangents = [np.cos(1.0 + k + np.arange(model.nv)) for k in range(_SAMPLES)]
    samples = [neutral] + [pin.integrate(model, neutral, tangent) for tangent in tangents]
    joints = range(1, model.njoints)
    return [joint for joint in joints if not _is_constant(model.joints[joint], samples)]


def _is_constant(joint: Any, samples: list[Array]) -> bool:
    """Return whether S is the same at all configurations q (nq,) of the model."""
    data, subspaces = joint.createData(), []
    for q in samples:
        joint.calc(data, q)
        subspaces.append(np.array(data.S))
    change = np.abs(np.subtract(subspaces, subspaces[0])).max()
    return bool(change <= _CONSTANT * max(1.0, np.abs(subspaces[0]).max()))


def _row(model: pin.Model, joint: int) -> JointRow:
    """Return the joints in a row that are joint number `joint`; the last has its name."""
    name, at = model.names[joint], model.jointPlacements[joint]
    parts = list(_parts(model.joints[joint], f"joint {name!r}"))
    names = [f"{name}:{number}" for number in range(1, len(parts))]
    for new in names:
        if new in set(model.names):
            raise MechanismError(
                f"joint {name!r} is split into {len(parts)} joints, one of them called {new!r}; "
                "that name is taken"
            )
    (first, kind), *others = parts
    new_parts = [(at * first, kind), *others]
    labelled = zip([*names, name], new_parts, strict=True)
    return JointRow([NewJoint(label, kind, at) for label, (at, kind) in labelled], [joint])


def _parts(joint: Any, what: str) -> Iterator[_Part]:
    here = pin.SE3.Identity()
    kind = joint.shortname()
    if kind == _UNIVERSAL:
        one = joint.extract()
        for axis in (one.axis1, one.axis2):
            length = float(np.linalg.norm(axis))
            if abs(length - 1) > _UNIT:
                raise MechanismError(
                    f"{what} is universal with an axis of length {length:.6g}; axes have length 1"
                )
            yield here, pin.JointModelRevoluteUnaligned(axis)
    elif kind == _ZYX:
        for one in (pin.JointModelRZ(), pin.JointModelRY(), pin.JointModelRX()):
            yield here, one
    elif kind == _COMPOSITE:
        composite = joint.extract()
        for placement, member in zip(composite.jointPlacements, composite.joints, strict=True):
            for number, (at, part) in enumerate(_parts(member, f"{what} (Composite)")):
                yield at if number else placement * at, part
    else:
        _refuse_indivisible(joint, kind, what)
        yield here, joint


def _refuse_indivisible(joint: Any, kind: str, what: str) -> None:
    """Refuse a joint of its own kind whose subspace depends on q; a model of it alone tells."""
    alone = pin.Model()
    alone.addJoint(0, joint, pin.SE3.Identity(), "joint")
    if _changing(alone):
        raise MechanismError(
            f"Pinocchio's derivatives are not those of {what} "
            f"({kind.removeprefix('JointModel')}): its axes turn with its own coordinates, and it "
            "cannot be split into joints whose axes do not"
        )
