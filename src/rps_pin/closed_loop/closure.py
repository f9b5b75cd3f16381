"""Loop closures: what holds two frames of an open tree together.

Each closure is one Pinocchio constraint model. With frames a and b it demands

- ``spherical`` (3 rows): the two origins coincide, p_a - p_b = 0;
- ``rigid`` (6 rows): the two frames coincide, in position and in orientation.

Rows are written in *world* axes at frame a's origin (linear first, then angular), so that the
constraint forces read as the force (N), and moment (N m), that b's side exerts on a's side there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import pinocchio as pin

from rps_pin.errors import MechanismError

Kind = Literal["spherical", "rigid"]

_ROWS = {"spherical": 3, "rigid": 6}
_CONTACT = {"spherical": pin.ContactType.CONTACT_3D, "rigid": pin.ContactType.CONTACT_6D}


@dataclass(frozen=True)
class LoopClosure:
    """Two frames of a tree, by name, that a joint without coordinates holds together.

    Parameters
    ----------
    frame_a, frame_b
        Names of frames of the model (links or joints of its URDF). ``"universe"`` is the world.
    kind
        ``"spherical"`` or ``"rigid"``; see the module's text for their rows.
    name
        For messages and for `ClosedLoopModel.rows`; ``"frame_a = frame_b"`` if left out.

    Raises
    ------
    MechanismError
        If the kind is unknown, or a frame is joined to itself.
    """

    frame_a: str
    frame_b: str
    kind: Kind = "spherical"
    name: str = ""

    def __post_init__(self) -> None:
        if self.kind not in _ROWS:
            raise MechanismError(f"no closure kind {self.kind!r}; there are: {', '.join(_ROWS)}")
        if self.frame_a == self.frame_b:
            raise MechanismError(f"a closure cannot join frame {self.frame_a!r} to itself")
        if not self.name:
            object.__setattr__(self, "name", f"{self.frame_a} = {self.frame_b}")

    @property
    def size(self) -> int:
        """Number of constraint rows."""
        return _ROWS[self.kind]

    def frame_ids(self, model: pin.Model) -> tuple[int, int]:
        """Return the indices of the two frames in a model.

        Raises
        ------
        MechanismError
            If a frame is unknown; the message lists the frames there are.
        """
        return frame_id(model, self.frame_a, self.name), frame_id(model, self.frame_b, self.name)

    def constraint_model(self, model: pin.Model) -> Any:
        """Return the Pinocchio constraint model of this closure in `model`."""
        a, b = (model.frames[i] for i in self.frame_ids(model))
        constraint = pin.RigidConstraintModel(
            _CONTACT[self.kind],
            model,
            a.parentJoint,
            a.placement,
            b.parentJoint,
            b.placement,
            pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
        )
        constraint.name = self.name
        return constraint


def frame_id(model: pin.Model, name: str, closure: str) -> int:
    """Return the index of a frame, or say which frames there are."""
    index = model.getFrameId(name)
    if index >= model.nframes:
        names = ", ".join(frame.name for frame in model.frames)
        raise MechanismError(f"closure {closure!r}: no frame {name!r}; there are: {names}")
    return int(index)
