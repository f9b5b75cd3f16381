"""What gives way in a mechanism: actuators, bearings of joints and closures, beams in links."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rps_pin.errors import InputError, did_you_mean, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.stiffness.beams import Beam
from rps_pin.validation import positive_number

#: Directions of springs: shifts along axes, then turns about them.
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
#: Their stiffness by direction.
Bearing = Mapping[str, float]


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class Compliances:
    """What gives way in a mechanism; whatever is not named is rigid.

    Parameters
    ----------
    actuators
        Stiffness of drives between the commanded position and the joint (control, gear, screw), by
        the actuated joint's name, N/m or N m/rad. The joint's armature moves with the joint.
    joints
        Stiffness of joints' bearings by joint name and direction, ``{"hinge": {"x": 1e8}}``, in the
        axes of the joint's frame on the link before it: ``x``, ``y``, ``z`` in N/m, ``rx``, ``ry``,
        ``rz`` in N m/rad. Directions in which the joint moves freely are refused.
    closures
        The same of closures, by name, in the axes of closed frame b, on b's side.
    beams
        Beams in links, by a name of their own.

    Raises
    ------
    InputError
        If a stiffness is not positive, or a direction is unknown.
    """

    actuators: Mapping[str, float] = field(default_factory=dict)
    joints: Mapping[str, Bearing] = field(default_factory=dict)
    closures: Mapping[str, Bearing] = field(default_factory=dict)
    beams: Mapping[str, Beam] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, stiffness in self.actuators.items():
            positive_number(stiffness, f"stiffness of actuator {name!r}", "N/m or N m/rad")
        for kind, bearings in (("joint", self.joints), ("closure", self.closures)):
            for name, bearing in bearings.items():
                for direction, stiffness in bearing.items():
                    if direction not in DIRECTIONS:
                        raise InputError(
                            f"{kind} {name!r}: no direction {shown(direction)}"
                            f"{did_you_mean(str(direction), DIRECTIONS)}; there are: "
                            f"{', '.join(DIRECTIONS)}"
                        )
                    unit = "N m/rad" if direction.startswith("r") else "N/m"
                    positive_number(stiffness, f"{kind} {name!r}: stiffness {direction}", unit)
        for name, beam in self.beams.items():
            if not isinstance(beam, Beam):
                raise InputError(f"beam {name!r} = {shown(beam)}: it must be a Beam")
