"""Loop closures: constraints between two frames, or two joints, of an open tree.

A `LoopClosure` joins frame a and frame b by a joint without coordinates. It removes some of b's
degrees of freedom relative to a, one by each row:

==================  ====  =========================================================================
kind                rows  condition
==================  ====  =========================================================================
``spherical``       3     the origins coincide
``rigid``           6     the frames coincide
``revolute``        5     the origins coincide, and the axes
``prismatic``       5     b's origin lies on a's axis, and the frames are parallel
``cylindrical``     4     b's origin lies on a's axis, and the axes are parallel
``universal``       4     the origins coincide, and a's axis is perpendicular to b's
``planar``          3     b's origin lies in the plane through a's, and the normals are parallel
``point_on_line``   2     b's origin lies on a's axis
``point_on_plane``  1     b's origin lies in the plane through a's origin, across a's axis
``distance``        1     the origins are a given distance apart (a rod with a ball at each end)
==================  ====  =========================================================================

The closed frames are those named, or stand at an offset in them (`placement_a`, `placement_b`).

A `JointCoupling` (1 row) ties the coordinates of joints; see `couplings`.

Each closure of frames is built on one Pinocchio constraint model, of a point (``spherical``) or
of a whole frame (all others), of which it selects some combinations of rows; see `rows`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, ClassVar, Literal, get_args

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.couplings import JointCoupling
from rps_pin.errors import InputError, MechanismError, did_you_mean, shown
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import numbers, real

__all__ = [
    "KINDS",
    "ClosedFrame",
    "Closure",
    "JointCoupling",
    "Kind",
    "LoopClosure",
    "frame_id",
    "joint_id",
]

Kind = Literal[
    "spherical",
    "rigid",
    "revolute",
    "prismatic",
    "cylindrical",
    "universal",
    "planar",
    "point_on_line",
    "point_on_plane",
    "distance",
]
Vector = tuple[float, float, float]
#: Four rows of four numbers.
Placement = tuple[tuple[float, ...], ...]

KINDS: tuple[Kind, ...] = get_args(Kind)
_ROWS = dict(zip(KINDS, (3, 6, 5, 5, 4, 4, 3, 2, 1, 1), strict=True))
_WITHOUT_AXIS = ("spherical", "rigid", "distance", "coordinates")
#: How far R R' of a placement may be from 1: as files round it, and as computers do.
_RIGID, _EXACT = 1e-4, 1e-12
_WITH_AXIS_OF_B = ("revolute", "cylindrical", "universal", "planar")


@dataclass(frozen=True, eq=False)
class ClosedFrame:
    """A frame that a closure holds, on a body of a model."""

    joint: int
    """Index of the joint that carries it."""
    placement: pin.SE3
    """In that joint's frame."""

    def at(self, data: pin.Data) -> pin.SE3:
        """Return its placement in the world, after `forwardKinematics` of the data."""
        return data.oMi[self.joint] * self.placement


@refuses_other_kinds
@dataclass(frozen=True)
class LoopClosure:
    """Two frames of a tree, by name, that a joint without coordinates connects.

    Parameters
    ----------
    frame_a, frame_b
        Names of frames of the model (links or joints of its file). ``"universe"`` is the world.
    kind
        One of the kinds in the module's table.
    name
        For messages and for `ClosedLoopModel.rows`; ``"frame_a = frame_b"`` if left out.
    axis
        Direction fixed in closed frame a, in its coordinates, of any length: axis of a revolute,
        prismatic or cylindrical closure, first axis of a universal one, the line's direction, or
        the plane's normal. Left out: z, or x for a universal closure.
    axis_b
        Direction fixed in closed frame b, in its coordinates, that ``revolute``, ``cylindrical``
        and ``planar`` hold parallel to `axis` (pointing the same way), and ``universal``
        perpendicular to it. Left out: as `axis`, or y for a universal closure.
    distance
        Length of the rod of a ``distance`` closure, m; positive.
    placement_a, placement_b
        Where the closed frames stand in the frames named, as `pin.SE3` or as a matrix of shape
        (4, 4), m; at these frames if left out. Kept as rows of numbers.

    Raises
    ------
    MechanismError
        If the kind is unknown, a frame is joined to itself, an axis has no direction, a placement
        is not one, or an option does not belong to the kind.
    """

    _kinds: ClassVar[tuple[str, ...]] = KINDS

    frame_a: str
    frame_b: str
    kind: Kind = "spherical"
    name: str = ""
    axis: Sequence[float] | None = None
    axis_b: Sequence[float] | None = None
    distance: float | None = None
    _: KW_ONLY
    placement_a: Placement | None = None
    placement_b: Placement | None = None

    def __post_init__(self) -> None:
        if self.kind not in self._kinds:
            raise MechanismError(f"no closure kind {self.kind!r}; there are: {', '.join(KINDS)}")
        if not self.name:
            object.__setattr__(self, "name", f"{self.frame_a} = {self.frame_b}")
        if self.frame_a == self.frame_b:
            raise MechanismError(f"a closure cannot join frame {self.frame_a!r} to itself")
        universal = self.kind == "universal"
        axis = self._direction("axis", (1.0, 0.0, 0.0) if universal else (0.0, 0.0, 1.0))
        object.__setattr__(self, "axis", None if self.kind in _WITHOUT_AXIS else axis)
        axis_b = self._direction("axis_b", (0.0, 1.0, 0.0) if universal else axis)
        object.__setattr__(self, "axis_b", axis_b if self.kind in _WITH_AXIS_OF_B else None)
        given, is_rod = self.distance, self.kind == "distance"
        if not is_rod and given is not None:
            raise MechanismError(
                f"closure {self.name!r}: a distance belongs to kind 'distance' only, not to "
                f"{self.kind!r}"
            )
        if is_rod and not 0 < real(given) < math.inf:
            raise MechanismError(
                f"closure {self.name!r}: distance = {given!r}; it must be a positive length in m"
            )
        object.__setattr__(self, "distance", given and float(given))
        for option in ("placement_a", "placement_b"):
            object.__setattr__(self, option, self._placement(option))

    def _placement(self, option: str) -> Placement | None:
        """Return an offset as rows of numbers, None for the identity; or say what is wrong."""
        given = getattr(self, option)
        if given is None:
            return None
        matrix = _real_numbers(getattr(given, "homogeneous", given))
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise MechanismError(
                f"closure {self.name!r}: {option} = {shown(given)} must be a pin.SE3 or 4 x 4 "
                "finite numbers"
            )
        turn, last = matrix[:3, :3], matrix[3]
        error = float(np.abs(turn @ turn.T - np.eye(3)).max())
        if not (error <= _RIGID and np.linalg.det(turn) > 0 and np.allclose(last, [0, 0, 0, 1])):
            raise MechanismError(
                f"closure {self.name!r}: {option} is not the matrix of a placement: a rotation "
                f"(here R R' differs from 1 by {error:.3g}) beside a translation, above 0 0 0 1"
            )
        if error > _EXACT:
            left, _, right = np.linalg.svd(turn)
            matrix[:3, :3] = left @ right
        if np.array_equal(matrix, np.eye(4)):
            return None
        return tuple(tuple(row) for row in matrix.tolist())

    def _direction(self, option: str, default: Vector) -> Vector:
        """Return an axis as a unit vector, or say what is wrong with it."""
        given = getattr(self, option)
        if given is None:
            return default
        with_axis = tuple(kind for kind in KINDS if kind not in _WITHOUT_AXIS)
        taken = with_axis if option == "axis" else _WITH_AXIS_OF_B
        if self.kind not in taken:
            raise MechanismError(
                f"closure {self.name!r}: {option} does not belong to kind {self.kind!r}, only to "
                f"{', '.join(taken)}"
            )
        vector = _real_numbers(given)
        if vector.shape != (3,):
            raise MechanismError(
                f"closure {self.name!r}: {option} = {given!r} must be three numbers"
            )
        x, y, z = vector.tolist()
        length = math.hypot(x, y, z)
        if not 0 < length < math.inf:
            raise MechanismError(f"closure {self.name!r}: {option} = {given!r} has no direction")
        return x / length, y / length, z / length

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
        asked_by = f"closure {self.name!r}"
        return frame_id(model, self.frame_a, asked_by), frame_id(model, self.frame_b, asked_by)

    def closed_frames(self, model: pin.Model) -> tuple[ClosedFrame, ClosedFrame]:
        """Return the two closed frames, offsets included, on the bodies of a model.

        Raises
        ------
        MechanismError
            As `frame_ids`.
        """
        frames = (model.frames[index] for index in self.frame_ids(model))
        a, b = (
            ClosedFrame(int(frame.parentJoint), frame.placement * offset)
            for frame, offset in zip(frames, self.offsets(), strict=True)
        )
        return a, b

    def offsets(self) -> tuple[pin.SE3, pin.SE3]:
        """Return the placements of the closed frames in the frames named."""
        a, b = (
            pin.SE3.Identity() if rows is None else pin.SE3(np.array(rows))
            for rows in (self.placement_a, self.placement_b)
        )
        return a, b

    def constraint_model(self, model: pin.Model) -> Any:
        """Return the Pinocchio constraint model of this closure in `model`.

        A point in world axes (``spherical``), or a frame: in world axes at a's origin (``rigid``)
        or in frame a (the others).
        """
        a, b = self.closed_frames(model)
        world = self.kind in ("spherical", "rigid")
        constraint = pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D if self.kind == "spherical" else pin.ContactType.CONTACT_6D,
            model,
            a.joint,
            a.placement,
            b.joint,
            b.placement,
            pin.ReferenceFrame.LOCAL_WORLD_ALIGNED if world else pin.ReferenceFrame.LOCAL,
        )
        constraint.name = self.name
        return constraint


Closure = LoopClosure | JointCoupling


def _real_numbers(given: Any) -> Array:
    """Return a copy as float64; empty if it holds no real numbers (see `validation.numbers`)."""
    try:
        return numbers(given, "", "").copy()
    except InputError:
        return np.empty(0)


def joint_id(model: pin.Model, name: str, asked_by: str) -> int:
    """Return the index of a joint, or say which joints there are."""
    names = list(model.names)[1:]  # not the world's
    if name not in names:
        near = did_you_mean(name, names)
        raise MechanismError(f"{asked_by}: no joint {name!r}{near}; there are: {', '.join(names)}")
    return names.index(name) + 1


def frame_id(model: pin.Model, name: str, asked_by: str = "") -> int:
    """Return the index of a frame, or say which frames there are.

    Where a link and a joint have one name, it is the link's.
    """
    names = [frame.name for frame in model.frames]
    prefix = f"{asked_by}: " if asked_by else ""
    if name not in names:
        near = did_you_mean(name, names)
        raise MechanismError(f"{prefix}no frame {name!r}{near}; there are: {', '.join(names)}")
    found = [index for index, one in enumerate(names) if one == name]
    if len(found) > 1:
        links = [i for i in found if model.frames[i].type == pin.FrameType.BODY]
        if len(links) != 1:
            raise MechanismError(f"{prefix}{len(found)} frames have the name {name!r}")
        found = links
    return found[0]
