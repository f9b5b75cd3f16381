"""What a Pinocchio model keeps of a joint beside its kind and place: limits, losses, rotors."""

from __future__ import annotations

import pinocchio as pin

#: Vectors of a model with an entry for each coordinate of a configuration.
_OF_POSITION = ("lowerPositionLimit", "upperPositionLimit", "positionLimitMargin")
#: Vectors of a model with an entry for each coordinate of a velocity.
_OF_VELOCITY = (
    "lowerVelocityLimit",
    "upperVelocityLimit",
    "lowerEffortLimit",
    "upperEffortLimit",
    "lowerDryFrictionLimit",
    "upperDryFrictionLimit",
    "damping",
    "armature",
    "rotorInertia",
    "rotorGearRatio",
)


def copy_joint_properties(
    source: pin.Model, joints: list[int], target: pin.Model, joint: int
) -> None:
    """Give a joint of `target` the limits, losses and rotors of joints of `source`, in a row.

    The coordinates of the joints of `source`, one after the other, must be those of the joint.
    """
    place = target.joints[joint]
    idx_q, idx_v = place.idx_q, place.idx_v
    for one in (source.joints[i] for i in joints):
        for names, size, start, index in (
            (_OF_POSITION, one.nq, idx_q, one.idx_q),
            (_OF_VELOCITY, one.nv, idx_v, one.idx_v),
        ):
            for name in names:
                getattr(target, name)[start : start + size] = getattr(source, name)[
                    index : index + size
                ]
        idx_q, idx_v = idx_q + one.nq, idx_v + one.nv
