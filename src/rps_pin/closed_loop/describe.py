"""What a mechanism is made of and how it can move: joints, rows, rank, mobility, actuation.

With the closures' Jacobian J of rank r at a regular configuration (one where the rank is the
largest there is nearby), nv - r motions are allowed (the mobility), and nc - r rows say what others
say already. The actuators determine the motion if none of the allowed motions leaves them all at
rest: if S N has full column rank, N a basis of those motions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import Closure, LoopClosure
from rps_pin.errors import ClosureError
from rps_pin.numerics.linear_algebra import rank, singular_values

if TYPE_CHECKING:
    from rps_pin.closed_loop.model import ClosedLoopModel


#: Where a regular configuration is looked for: so many random steps of this length (rad).
_TRIES, _STEP = 10, 0.15

_JOINT_KINDS = {
    "JointModelR": "revolute",
    "JointModelP": "prismatic",
    "JointModelH": "helical",
    "JointModelFreeFlyer": "free",
    "JointModelSpherical": "spherical",
    "JointModelUniversal": "universal",
    "JointModelPlanar": "planar",
    "JointModelTranslation": "translation",
    "JointModelComposite": "composite",
}


class JointDescription(NamedTuple):
    """One joint of the tree."""

    name: str
    kind: str
    nq: int
    nv: int
    actuated: bool
    lower: tuple[float, ...]
    """Limits of its coordinates, rad or m; ``-inf`` and ``inf`` where there are none."""
    upper: tuple[float, ...]


class ClosureDescription(NamedTuple):
    """One closure."""

    name: str
    kind: str
    between: tuple[str, str]
    """The two frames, or joints."""
    rows: int
    needed: int
    """How far the rank falls without it: the rows that no other closure stands in for."""


@dataclass(frozen=True, eq=False)
class MechanismDescription:
    """What `ClosedLoopModel.describe` finds; ``str()`` of it is a table.

    Attributes
    ----------
    name : str
    joints, closures : tuples
        Of `JointDescription` and `ClosureDescription`.
    configuration : (nq,) array
        The closed configuration that it is computed at.
    home_is_singular : bool
        Whether the rank is lower where the search for that configuration began.
    nv, rows, rank, mobility, redundant_rows : int
        Velocities of the tree; rows of J; its rank; nv - rank; rows - rank.
    singular_values : (min(nc, nv),) array
        Of J, all entries in one unit (see `ClosedLoopModel`'s ``characteristic_length``).
    actuated, passive : tuples of str
        Joints' names.
    actuated_velocities, actuated_rank : int
        How many velocities are driven, and how many allowed motions they determine.
    actuation : str
        ``"sufficient"``: as many as the mobility, and they determine the motion; ``"redundant"``:
        more than that; ``"lacking"``: mobility - actuated_rank motions are driven by nothing.
    condition : float
        Condition number of the passive joints' Jacobian there.
    """

    name: str
    joints: tuple[JointDescription, ...]
    closures: tuple[ClosureDescription, ...]
    configuration: Array
    home_is_singular: bool
    nv: int
    rows: int
    rank: int
    singular_values: Array
    actuated: tuple[str, ...]
    actuated_velocities: int
    actuated_rank: int
    condition: float

    @property
    def mobility(self) -> int:
        """Number of independent motions that the closures allow."""
        return self.nv - self.rank

    @property
    def redundant_rows(self) -> int:
        """Number of rows that say what others say already."""
        return self.rows - self.rank

    @property
    def passive(self) -> tuple[str, ...]:
        """Names of the joints without an actuator."""
        return tuple(joint.name for joint in self.joints if not joint.actuated)

    @property
    def actuation(self) -> Literal["sufficient", "redundant", "lacking"]:
        """Whether the actuators determine the motion, and no more than that."""
        if self.actuated_rank < self.mobility:
            return "lacking"
        return "redundant" if self.actuated_velocities > self.mobility else "sufficient"

    def as_dict(self) -> dict[str, Any]:
        """Return all of it as plain data, ready for JSON (infinities as None)."""
        return {
            "name": self.name,
            "joints": [
                joint._asdict() | {"lower": _plain(joint.lower), "upper": _plain(joint.upper)}
                for joint in self.joints
            ],
            "closures": [
                closure._asdict() | {"between": list(closure.between)} for closure in self.closures
            ],
            "configuration": self.configuration.tolist(),
            "home_is_singular": self.home_is_singular,
            "nv": self.nv,
            "rows": self.rows,
            "rank": self.rank,
            "mobility": self.mobility,
            "redundant_rows": self.redundant_rows,
            "singular_values": self.singular_values.tolist(),
            "actuated": list(self.actuated),
            "passive": list(self.passive),
            "actuated_velocities": self.actuated_velocities,
            "actuated_rank": self.actuated_rank,
            "actuation": self.actuation,
            "condition": _plain([self.condition])[0],
        }

    def __str__(self) -> str:
        joints = [
            (j.name, j.kind, "actuated" if j.actuated else "passive", _limits(j))
            for j in self.joints
        ]
        closures = [
            (c.name, c.kind, " = ".join(c.between), f"{c.rows} ({c.needed} needed)")
            for c in self.closures
        ]
        lines = [
            f"{self.name}: mobility {self.mobility}, actuation {self.verdict()}",
            "",
            *_table(("joint", "kind", "", "limits (rad, m)"), joints),
            "",
            *_table(("closure", "kind", "between", "rows"), closures),
            "",
            f"velocities {self.nv}, closure rows {self.rows}, rank {self.rank}, "
            f"redundant rows {self.redundant_rows}",
            f"singular values of the closures' Jacobian: {_numbers(self.singular_values)}",
            f"condition number of the passive joints' part: {self.condition:.4g}",
        ]
        if self.home_is_singular:
            lines.append("the home configuration is singular: all this holds beside it")
        return "\n".join(lines)

    def verdict(self) -> str:
        """Return the actuation in words."""
        driven, left = self.actuated_velocities, self.mobility - self.actuated_rank
        if self.actuation == "lacking":
            return f"lacking: {left} of {self.mobility} motions are driven by nothing"
        if self.actuation == "redundant":
            return f"redundant: {driven} actuators, {driven - self.mobility} more than needed"
        return f"sufficient: {driven} actuator{'s' if driven > 1 else ''}"


def describe(mechanism: ClosedLoopModel, q: Array | None) -> MechanismDescription:
    """Return what a mechanism is made of, at q or at a regular configuration near home."""
    at, singular = (q, False) if q is not None else _regular(mechanism)
    jacobian = _scaled(mechanism, at)
    found = _rank(jacobian)
    motions = mechanism.allowed_motions(at)[mechanism.actuated_indices]
    motions = motions / mechanism.velocity_scale[mechanism.actuated_indices][:, None]
    model = mechanism.model
    return MechanismDescription(
        name=mechanism.name,
        joints=tuple(_joint(model, i, mechanism.actuated) for i in range(1, model.njoints)),
        closures=tuple(_closure(mechanism, c, jacobian, found) for c in mechanism.closures),
        configuration=at,
        home_is_singular=singular,
        nv=model.nv,
        rows=mechanism.constraint_size,
        rank=found,
        singular_values=singular_values(jacobian),
        actuated=mechanism.actuated,
        actuated_velocities=mechanism.actuated_indices.size,
        actuated_rank=_rank(motions),
        condition=mechanism.condition(at),
    )


def _regular(mechanism: ClosedLoopModel) -> tuple[Array, bool]:
    """Return a closed configuration near home of the largest rank met, and if home's is lower."""
    home = q = mechanism.close(mechanism.home)
    rng = np.random.default_rng(0)
    ranks = [_rank(_scaled(mechanism, home))]
    places = [home]
    for _ in range(_TRIES):
        motions = mechanism.allowed_motions(q)
        step = _STEP * rng.normal(size=motions.shape[1]) * mechanism.characteristic_length
        try:
            q = mechanism.close(pin.integrate(mechanism.model, q, motions @ step), restarts=0)
        except ClosureError:  # a step too far: go on from where it stood
            continue
        places.append(q)
        ranks.append(_rank(_scaled(mechanism, q)))
    best = int(np.argmax(ranks))
    return places[best], ranks[0] < ranks[best]


def _scaled(mechanism: ClosedLoopModel, q: Array) -> Array:
    scaled: Array = mechanism.row_scale[:, None] * mechanism.jacobian(q) * mechanism.velocity_scale
    return scaled


def _rank(matrix: Array) -> int:
    return rank(singular_values(matrix))


def _joint(model: pin.Model, index: int, actuated: tuple[str, ...]) -> JointDescription:
    joint = model.joints[index]
    name, short = model.names[index], joint.shortname()
    span = slice(joint.idx_q, joint.idx_q + joint.nq)
    kind = _JOINT_KINDS.get(short) or _JOINT_KINDS.get(short[:11], short)
    huge = 0.5 * np.finfo(np.float64).max
    bounded = joint.nq == joint.nv  # quaternions and full turns have none
    lower = [x if bounded and x > -huge else -np.inf for x in model.lowerPositionLimit[span]]
    upper = [x if bounded and x < huge else np.inf for x in model.upperPositionLimit[span]]
    return JointDescription(
        name,
        kind,
        joint.nq,
        joint.nv,
        name in actuated,
        tuple(map(float, lower)),
        tuple(map(float, upper)),
    )


def _closure(
    mechanism: ClosedLoopModel, closure: Closure, jacobian: Array, found: int
) -> ClosureDescription:
    others = np.delete(jacobian, mechanism.rows(closure.name), axis=0)
    if isinstance(closure, LoopClosure):
        kind, between = str(closure.kind), (closure.frame_a, closure.frame_b)
    else:
        kind, between = "coupling", (closure.joint, closure.other)
    return ClosureDescription(closure.name, kind, between, closure.size, found - _rank(others))


def _plain(values: Any) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]


def _limits(joint: JointDescription) -> str:
    if not np.isfinite(joint.lower + joint.upper).any():
        return "none"
    pairs = zip(joint.lower, joint.upper, strict=True)
    return ", ".join(f"{low:.4g} to {high:.4g}" for low, high in pairs)


def _numbers(values: Array) -> str:
    return " ".join(f"{value:.3g}" for value in values)


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Return lines of left-aligned columns."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (head, *rows)
    ]
