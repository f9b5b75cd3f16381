"""What a writer is given, and its tree with joints that the formats know.

Both formats have turns, slides and a few joints of several coordinates. A joint that is a row of
others (a translation, Z-Y-X angles, a composite; for some formats a universal joint) is written as
that row, with massless links between: q and v keep their entries.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.column_names import joint_coordinates, named_velocities
from rps_pin.closed_loop.constraints.closures import Closure
from rps_pin.closed_loop.dynamics.passive_joint_forces import JointEffects
from rps_pin.closed_loop.editing.rebuild import JointRow, NewJoint, rebuilt
from rps_pin.closed_loop.interference.shapes import CollisionShapes
from rps_pin.errors import MechanismError, shown

_NO_SHAPES = CollisionShapes()
#: Axes count as perpendicular below this cosine.
PERPENDICULAR = 1e-9
#: Limits from here on bound nothing; MuJoCo's mjMAXVAL.
FAR = 1e10
#: YAML's longest key.
_LONGEST = 1000


class Source(NamedTuple):
    """A mechanism to be written.

    Attributes
    ----------
    model, closures, actuated, effects, name
        As `ClosedLoopModel` has them; `effects` with arrays of shape (nv,).
    home
        A closed configuration, shape (nq,), or None if the mechanism has none.
    characteristic_length
        m.
    max_condition, accuracy, task, collision
        Of `ClosedLoopModel`; the last with the collision shapes.
    """

    model: pin.Model
    closures: tuple[Closure, ...]
    actuated: tuple[str, ...]
    effects: JointEffects
    home: Array | None
    name: str
    characteristic_length: float
    max_condition: float
    accuracy: float | None = None
    task: Mapping[str, Any] | None = None
    collision: CollisionShapes = _NO_SHAPES


_IN_XML = re.compile("[\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]*")

#: Joints in a row: the placement of each in the one before, and a Pinocchio joint model.
Parts = list[tuple[pin.SE3, Any]]


def without_rows(source: Source, whole: Callable[[Any], bool]) -> Source:
    """Return the mechanism with joints that are rows of others split.

    The last joint of a row has the joint's name, those before are called ``name:1``, ``name:2``.

    Parameters
    ----------
    source
        The mechanism.
    whole
        Whether a joint (`shortname` tells its kind) is written as it is, though it could be split.

    Raises
    ------
    MechanismError
        If a joint is of a kind that no format has (ellipsoid, mimic); names it.
    """
    model = source.model
    _check_names(source)
    taken = Names([*model.names, *(frame.name for frame in model.frames)])
    rows: dict[int, JointRow] = {}
    for index in range(1, model.njoints):
        name, joint = model.names[index], model.joints[index]
        parts = list(_parts(joint, name, whole))
        if len(parts) == 1 and parts[0][1] is joint:
            continue
        labels = [taken.fresh(f"{name}:{k}") for k in range(1, len(parts))] + [name]
        new = [NewJoint(label, kind, at) for label, (at, kind) in zip(labels, parts, strict=True)]
        new[0] = new[0]._replace(placement=model.jointPlacements[index] * new[0].placement)
        rows[index] = JointRow(new, [index])
    if not rows:
        return source
    split = rebuilt(model, rows)
    driven = [named_velocities(model, name) or [] for name in source.actuated]
    actuated = tuple(name for own in driven for name in _driven(split, own))
    return source._replace(model=split, actuated=actuated)


def _check_names(source: Source) -> None:
    """Refuse names that no XML or YAML file can hold."""
    model = source.model
    names = [*list(model.names)[1:], *(frame.name for frame in list(model.frames)[1:])]
    names += [closure.name for closure in source.closures]
    for name in [*names, source.name or "mechanism"]:
        if not name or len(name) > _LONGEST or not _IN_XML.fullmatch(name):
            raise MechanismError(
                f"the name {shown(name)} cannot be written: a name in a file has 1 to {_LONGEST} "
                "characters, and no control characters"
            )


def _driven(model: pin.Model, velocities: Sequence[int]) -> list[str]:
    """Return the names of joints, or of their coordinates, that have some velocities."""
    found = []
    for index in range(1, model.njoints):
        name, joint = model.names[index], model.joints[index]
        own = [k for k in velocities if joint.idx_v <= k < joint.idx_v + joint.nv]
        if own and len(own) < joint.nv:
            coordinates = joint_coordinates(model, name)
            found += [coordinates[k - joint.idx_v] for k in own]
        elif own:
            found.append(name)
    return found


def _parts(joint: Any, name: str, whole: Callable[[Any], bool]) -> Iterator[tuple[pin.SE3, Any]]:
    here, kind = pin.SE3.Identity(), joint.shortname()
    if kind in ("JointModelEllipsoid", "JointModelMimic"):
        raise MechanismError(
            f"joint {name!r} ({kind.removeprefix('JointModel')}) cannot be written: no format has "
            "such a joint"
        )
    if kind == "JointModelComposite":
        composite = joint.extract()
        for placement, member in zip(composite.jointPlacements, composite.joints, strict=True):
            for number, (at, part) in enumerate(_parts(member, name, whole)):
                yield at if number else placement * at, part
    elif whole(joint):
        yield here, joint
    elif kind == "JointModelUniversal":
        one = joint.extract()
        for axis in (one.axis1, one.axis2):
            yield here, pin.JointModelRevoluteUnaligned(axis)
    elif kind == "JointModelSphericalZYX":
        for turn in (pin.JointModelRZ(), pin.JointModelRY(), pin.JointModelRX()):
            yield here, turn
    elif kind == "JointModelTranslation":
        for slide in (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelPZ()):
            yield here, slide
    else:
        yield here, joint


class Names:
    """Names that are taken."""

    def __init__(self, taken: Sequence[str] = ()) -> None:
        self._taken = set(taken)

    def fresh(self, wanted: str) -> str:
        """Return a name, with a number behind it if it is taken, and take it."""
        name, number = wanted, 1
        while name in self._taken:
            number += 1
            name = f"{wanted}_{number}"
        self._taken.add(name)
        return name


# Joints -------------------------------------------------------------------------------------------


def kind_of(joint: Any) -> str:
    """Return the kind of a joint without rows, in plain words.

    ``"revolute"``, ``"continuous"`` (a turn without bounds), ``"prismatic"``, ``"helical"``,
    ``"universal"``, ``"ball"``, ``"planar"``, ``"free"``, ``"translation"`` or ``"zyx"``.
    """
    name = joint.shortname().removeprefix("JointModel")
    special = {
        "Spherical": "ball",
        "SphericalZYX": "zyx",
        "FreeFlyer": "free",
        "Planar": "planar",
        "Translation": "translation",
        "Universal": "universal",
    }
    if name in special:
        return special[name]
    for start, kind in (
        ("RevoluteUnbounded", "continuous"),
        ("RUB", "continuous"),
        ("R", "revolute"),
        ("P", "prismatic"),
        ("H", "helical"),
    ):
        if name.startswith(start):
            return kind
    raise MechanismError(f"a joint of Pinocchio's kind {name} cannot be written")


def axis_of(joint: Any, nq: int) -> Array:
    """Return the axis of a turn, slide or screw, in the joint's frame, shape (3,)."""
    data = joint.createData()
    q = np.zeros(nq)
    q[joint.idx_q] = float(joint.nq == 2)  # the cosine of a turn without bounds
    joint.calc(data, q)
    subspace = np.asarray(data.S).reshape(6)
    axis = subspace[:3] if kind_of(joint) == "prismatic" else subspace[3:]
    return np.asarray(axis / np.linalg.norm(axis)) + 0.0  # no -0.0


def pitch_of(joint: Any, nq: int) -> float:
    """Return the pitch of a screw, m/rad."""
    data = joint.createData()
    joint.calc(data, np.zeros(nq))
    subspace = np.asarray(data.S).reshape(6)
    return float(subspace[:3] @ subspace[3:])


def axes_of(joint: Any) -> tuple[Array, Array]:
    """Return the two axes of a universal joint."""
    one = joint.extract()
    return np.array(one.axis1), np.array(one.axis2)


def is_cardan(joint: Any) -> bool:
    """Return whether a joint is universal, with perpendicular axes of unit length."""
    if kind_of(joint) != "universal":
        return False
    first, second = axes_of(joint)
    lengths = np.abs([first @ first - 1, second @ second - 1, first @ second])
    return bool(lengths.max() < PERPENDICULAR)


def unwritten_limits(model: pin.Model, joint: int, *, effort: bool) -> list[str]:
    """Return what is told of a planar or free joint's limits, which the formats do not have."""
    one, name = model.joints[joint], model.names[joint]
    slides = {"planar": 2, "free": 3}.get(kind_of(one), 0)
    at = slice(one.idx_q, one.idx_q + slides)
    found = []
    if slides and (_bounds(model.lowerPositionLimit[at]) or _bounds(model.upperPositionLimit[at])):
        found.append(f"joint {name!r}: limits of its position are left out")
    if slides and effort and _bounds(velocities(model, joint, model.upperEffortLimit)):
        found.append(f"joint {name!r}: limits of its effort are left out")
    return found


def _bounds(limits: Array) -> bool:
    return bool((np.abs(limits) < FAR).any())


def coordinates(model: pin.Model, joint: int, q: Array) -> Array:
    """Return a joint's coordinates in a configuration."""
    one = model.joints[joint]
    return np.asarray(q[one.idx_q : one.idx_q + one.nq])


def velocities(model: pin.Model, joint: int, array: Array) -> Array:
    """Return a joint's entries in an array of shape (nv,)."""
    one = model.joints[joint]
    return np.asarray(array[one.idx_v : one.idx_v + one.nv])
