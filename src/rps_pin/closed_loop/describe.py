"""Description of a mechanism: joints, closures, rank, mobility, redundant rows, actuation.

With the closures' Jacobian J of rank r at a regular configuration (one where the rank is the
largest nearby), nv - r motions are allowed (the mobility), and nc - r rows are redundant. The
actuators determine the motion if no allowed motion leaves them all at rest: if S N has full column
rank, N a basis of the null space of J.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import Closure, JointCoupling
from rps_pin.closed_loop.constraints.rank_rule import Rounding
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.freedoms import NAMED, Freedom, freedoms, of_actuators
from rps_pin.closed_loop.regular import actuated_rank, regular_near
from rps_pin.errors import few
from rps_pin.numerics.linear_algebra import rank, singular_values
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.plain_text import plain

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


class Actuation(str):
    """Value of `MechanismDescription.actuation`; "lacking" is the deprecated "underactuated"."""

    __slots__ = ()
    __hash__ = str.__hash__

    def __eq__(self, other: object) -> bool:
        return str.__eq__(self, "underactuated" if other == "lacking" else other) is True

    def __ne__(self, other: object) -> bool:
        return not self == other


class JointDescription(NamedTuple):
    """One joint of the tree."""

    name: str
    kind: str
    nq: int
    nv: int
    actuated: int
    """How many of its velocities are driven."""
    lower: tuple[float, ...]
    """Limits of its coordinates, rad or m; ``-inf`` and ``inf`` where there are none."""
    upper: tuple[float, ...]


class ClosureDescription(NamedTuple):
    """One closure."""

    name: str
    kind: str
    between: tuple[str, ...]
    """The two frames, or the joint and those that it follows."""
    rows: int
    needed: int
    """How far the rank falls without it: the rows that no other closure replaces."""
    offsets: tuple[tuple[float, ...] | None, ...] = ()
    """Of a closure of frames, where the closed frames stand in these: x, y, z (m) and the rotation
    vector (rad), None for the frame itself."""

    def ends(self) -> str:
        """Return what it is between, in words."""
        if self.offsets:
            pairs = zip(self.between, self.offsets, strict=True)
            return " = ".join(f"{name}{_offset(offset)}" for name, offset in pairs)
        first, *others = self.between
        return f"{first} = {' + '.join(others) or 'fixed'}"


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class MechanismDescription:
    """Result of `ClosedLoopModel.describe`; ``str()`` of it is a table.

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
    idle, lacking : tuples of Freedom
        Idle freedoms (see `freedoms`), and motions that no actuator drives though something needs
        them; each with its size, joints and links.
    actuation : str
        ``"sufficient"``: the actuators determine all but idle freedoms, and none is superfluous;
        ``"redundant"``: some are; ``"underactuated"``: there are `lacking` motions.
        (Compares equal to ``"lacking"``, its former name, too.)
    condition : float
        Condition number of the passive joints' Jacobian there, idle freedoms left out.
    gap : float
        Largest gap of a closure there, m.
    tolerance : float
        Singular values up to this, over the largest (or 1 if that is less), count as zero.
    rounding : Rounding or None
        What the file's rounded numbers do to the closures; None if they are exact.
    notes : tuple of str
        What the reader of its file has decided.
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
    gap: float
    tolerance: float
    rounding: Rounding | None = None
    notes: tuple[str, ...] = ()
    idle: tuple[Freedom, ...] = ()
    lacking: tuple[Freedom, ...] = ()

    @property
    def mobility(self) -> int:
        """Number of independent motions that the closures allow."""
        return self.nv - self.rank

    @property
    def redundant_rows(self) -> int:
        """Number of rows that depend on others."""
        return self.rows - self.rank

    @property
    def passive(self) -> tuple[str, ...]:
        """Names of the joints without an actuator."""
        return tuple(joint.name for joint in self.joints if not joint.actuated)

    @property
    def actuation(self) -> Actuation:
        """``"sufficient"``, ``"redundant"`` or ``"underactuated"``."""
        if self.lacking:
            return Actuation("underactuated")
        redundant = self.actuated_velocities > self.actuated_rank
        return Actuation("redundant" if redundant else "sufficient")

    def as_dict(self) -> dict[str, Any]:
        """Return all of it as plain data, ready for JSON (infinities as None)."""
        names = [field.name for field in fields(self)]
        names += ["mobility", "redundant_rows", "passive", "actuation"]
        return {name: _plain(getattr(self, name)) for name in names}

    def __str__(self) -> str:
        joints = [(j.name, j.kind, _driven(j), _limits(j)) for j in self.joints]
        closures = [
            (c.name, c.kind, c.ends(), f"{c.rows} ({c.needed} needed)") for c in self.closures
        ]
        lines = [
            f"{self.name or 'mechanism'}: mobility {self.mobility}, actuation {self.verdict()}",
            "",
            *_table(("joint", "kind", "", "limits (rad, m)"), joints),
            "",
        ]
        if closures:
            lines += [*_table(("closure", "kind", "between", "rows"), closures), ""]
        lines += [
            f"velocities {self.nv}, closure rows {self.rows}, rank {self.rank}, "
            f"redundant rows {self.redundant_rows}"
        ]
        if self.rows:
            values = " ".join(f"{value:.3g}" for value in self.singular_values)
            lines += [
                f"singular values of the closures' Jacobian: {values}",
                f"condition number of the passive joints' part: {self.condition:.4g}",
            ]
        lines += [f"idle: {_in_words(freedom)}" for freedom in self.idle]
        lines += [f"without actuator: {_in_words(freedom)}" for freedom in self.lacking]
        if self.home_is_singular:
            lines.append("the home configuration is singular: all this holds next to it")
        if self.rounding is not None:
            lines.append(
                f"the file's numbers are rounded: {self.rounding}; singular values up to "
                f"{self.tolerance:.2g} count as zero"
            )
        lines += [f"note: {note}" for note in self.notes]
        return plain("\n".join(lines))

    def verdict(self) -> str:
        """Return the actuation in words."""
        driven, left = self.actuated_velocities, sum(freedom.size for freedom in self.lacking)
        if not driven:
            return f"{self.actuation}: nothing driven"
        if self.actuation == "underactuated":
            return f"underactuated: {left} of {self.mobility} motions have no actuator"
        idle = sum(freedom.size for freedom in self.idle)
        beside = f", {counted(idle, 'idle freedom')}" if idle else ""
        if self.actuation == "redundant":
            more = driven - self.actuated_rank
            return f"redundant: {driven} actuators, {more} more than needed{beside}"
        return f"sufficient: {counted(driven, 'actuator')}{beside}"


def describe(
    system: ConstraintSystem,
    name: str,
    q: Array | None,
    home: Callable[[], Array],
    notes: tuple[str, ...] = (),
) -> MechanismDescription:
    """Return the description of a mechanism at q, or at a regular configuration near home."""
    at, singular = (q, False) if q is not None else regular_near(system, home())
    model, equations, actuated = system.model, system.equations, system.actuated
    jacobian = equations.jacobian(at).copy()
    scaled, factors = system.scaled(jacobian), system.decomposed(jacobian)
    motions = of_actuators(system, at, jacobian)
    return MechanismDescription(
        name=name,
        joints=tuple(_joint(system, i) for i in range(1, model.njoints)),
        closures=tuple(_closure(system, c, scaled, factors.rank) for c in equations.closures),
        configuration=at,
        home_is_singular=singular,
        nv=model.nv,
        rows=equations.size,
        rank=factors.rank,
        singular_values=factors.values,
        actuated=system.actuated_names,
        actuated_velocities=actuated.size,
        actuated_rank=actuated_rank(system, factors),
        condition=system.factorisation.condition(
            jacobian[:, system.passive], motions.idle.shape[1]
        ),
        gap=equations.largest_gap(equations.gaps(at)),
        tolerance=system.rule.tolerance,
        rounding=system.rule.rounding,
        idle=freedoms(system, at, motions.idle),
        lacking=freedoms(system, at, motions.lacking),
        notes=notes,
    )


def _joint(system: ConstraintSystem, index: int) -> JointDescription:
    model = system.model
    joint = model.joints[index]
    name, short = model.names[index], joint.shortname()
    bounds = np.array([model.lowerPositionLimit, model.upperPositionLimit])
    kind = _JOINT_KINDS.get(short) or _JOINT_KINDS.get(short[:11], short)
    bounds = bounds[:, joint.idx_q : joint.idx_q + joint.nq]
    bounded = joint.nq == joint.nv  # quaternions and full turns have none
    bounded = bounded & (np.abs(bounds) < 0.5 * np.finfo(np.float64).max)
    limits = np.where(bounded, bounds, [[-np.inf], [np.inf]]).tolist()
    own = np.arange(joint.idx_v, joint.idx_v + joint.nv)
    driven = int(np.isin(own, system.actuated).sum())
    return JointDescription(name, kind, joint.nq, joint.nv, driven, *map(tuple, limits))


def _closure(
    system: ConstraintSystem, closure: Closure, scaled: Array, found: int
) -> ClosureDescription:
    others = np.delete(scaled, system.equations.rows(closure.name), axis=0)
    needed = found - rank(singular_values(others), system.rule.tolerance)
    if isinstance(closure, JointCoupling):
        between = (closure.joint, *closure.others)
        return ClosureDescription(closure.name, "coupling", between, closure.size, needed)
    placements = (closure.placement_a, closure.placement_b)
    offsets = tuple(
        None if given is None else (*offset.translation.tolist(), *pin.log3(offset.rotation))
        for given, offset in zip(placements, closure.offsets(), strict=True)
    )
    between = (closure.frame_a, closure.frame_b)
    return ClosureDescription(closure.name, closure.kind, between, closure.size, needed, offsets)


def _offset(offset: tuple[float, ...] | None) -> str:
    if offset is None:
        return ""
    x, y, z, *turn = offset
    turned = f" turned {np.degrees(np.linalg.norm(turn)):.4g} deg" if any(turn) else ""
    return f" + ({x:.4g}, {y:.4g}, {z:.4g}) m{turned}"


def _plain(value: Any) -> Any:
    """Return a value of a description as plain data; infinities and NaN as None."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    elif isinstance(value, (JointDescription, ClosureDescription, Freedom)):
        value = value._asdict()
    elif isinstance(value, Rounding):
        value = vars(value)
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return str(value) if isinstance(value, str) else value


def counted(number: int, what: str) -> str:
    """Return a number of things in words."""
    return f"{number} {what}" + ("" if number == 1 else "s")


def _driven(joint: JointDescription) -> str:
    if 0 < joint.actuated < joint.nv:
        return f"{joint.actuated} of {joint.nv} actuated"
    return "actuated" if joint.actuated else "passive"


def _in_words(freedom: Freedom) -> str:
    """Return what moves in a freedom; not all of many."""
    links, joints = few(freedom.links, NAMED), few(freedom.joints, NAMED)
    return f"{counted(freedom.size, 'motion')} of {links} (joints: {joints})"


def _limits(joint: JointDescription) -> str:
    if not np.isfinite(joint.lower + joint.upper).any():
        return "none"
    pairs = zip(joint.lower, joint.upper, strict=True)
    return ", ".join(f"{low:.4g} to {high:.4g}" for low, high in pairs)


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Return lines of left-aligned columns."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (head, *rows)
    ]
