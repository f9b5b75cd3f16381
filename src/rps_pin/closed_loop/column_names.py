"""Names for the entries of q and v."""

from __future__ import annotations

import pinocchio as pin

#: Names of the velocities of joints that have several; those of other joints are numbered from 0.
_COORDINATES = {
    "JointModelSpherical": ("x", "y", "z"),
    "JointModelFreeFlyer": ("x", "y", "z", "rx", "ry", "rz"),
    "JointModelPlanar": ("x", "y", "rz"),
    "JointModelTranslation": ("x", "y", "z"),
}


def column_names(model: pin.Model) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return a name for each coordinate and each velocity: the joint's, numbered from 0 if many."""
    of_q, of_v = [""] * model.nq, [""] * model.nv
    for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:
        for names, start, size in ((of_q, joint.idx_q, joint.nq), (of_v, joint.idx_v, joint.nv)):
            of_joint = [name] if size == 1 else [f"{name}_{i}" for i in range(size)]
            names[start : start + size] = of_joint
    return tuple(of_q), tuple(of_v)


def joint_coordinates(model: pin.Model, name: str) -> tuple[str, ...]:
    """Return the names of a joint's velocities, as ``ball.x``; none if it has only one.

    About or along the axes of the joint's own frame, which moves with the link after it: ``x``,
    ``y``, ``z`` of a spherical joint are rotations; of a free joint they are translations, and
    ``rx``, ``ry``, ``rz`` rotations. Those of universal and composite joints are numbered from 0.
    """
    joint = model.joints[model.getJointId(name)]
    if joint.nv == 1:
        return ()
    named = _COORDINATES.get(joint.shortname(), tuple(str(i) for i in range(joint.nv)))
    return tuple(f"{name}.{coordinate}" for coordinate in named)


def named_velocities(model: pin.Model, name: str) -> list[int] | None:
    """Return the indices in v of a joint, or of one of its coordinates (``ball.x``).

    None if there is no such joint or coordinate.
    """
    if model.existJointName(name) and name != "universe":
        joint = model.joints[model.getJointId(name)]
        return list(range(joint.idx_v, joint.idx_v + joint.nv))
    owner, _, _ = name.rpartition(".")
    if not model.existJointName(owner) or owner == "universe":
        return None
    coordinates = joint_coordinates(model, owner)
    if name not in coordinates:
        return None
    start = model.joints[model.getJointId(owner)].idx_v
    return [start + coordinates.index(name)]
