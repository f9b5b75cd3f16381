"""Couplings: equations between the coordinates of joints, as gears, belts and differentials make.

With q_j the coordinate of one joint and q_k those of others,

    q_j = sum_k r_k q_k + offset      or      q_j = c_0 + c_1 q_k + c_2 q_k^2 + ...,

that is, q_j - offset - sum_k p_k(q_k) = 0 with polynomials p_k without a constant term. Its row is
(1, -p_k'), its multiplier the generalised force (N or N m) that the coupling exerts on joint j.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from numbers import Real
from typing import NamedTuple

import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.errors import MechanismError, shown
from rps_pin.other_kinds import refuses_other_kinds


@refuses_other_kinds
@dataclass(frozen=True)
class JointCoupling:
    """A joint whose coordinate follows from those of others.

    One other joint: q_joint = ratio * q_other + offset; several: q_joint = sum of ratio_k q_k +
    offset; or a polynomial of one: q_joint = c_0 + c_1 q_other + c_2 q_other^2 + ...

    Parameters
    ----------
    joint
        Name of a joint of one coordinate.
    other
        Name of another one; or several with their ratios, ``{"pitch": 10.0, "roll": 10.0}`` for
        q_joint = 10 (q_pitch + q_roll). None at all, ``{}``, holds the joint at the offset.
    ratio
        Of a single other joint, rad/rad, m/m, or m/rad where the two differ; not zero.
    offset
        rad or m.
    name
        For messages and for `ClosedLoopModel.rows`; ``"joint = other"`` if left out.
    polynomial
        Coefficients c_0, c_1, ... of a single other joint, in place of ratio and offset: c_i in the
        unit of q_joint over that of q_other^i.

    Raises
    ------
    MechanismError
        If a joint is coupled to itself, a ratio is zero, a number is not finite, or ratio and
        offset stand beside what replaces them.
    """

    joint: str
    other: str | Mapping[str, float] = field(hash=False)
    ratio: float = 1.0
    offset: float = 0.0
    name: str = ""
    _: KW_ONLY
    polynomial: Sequence[float] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.other, str):
            given = self.other
            if not isinstance(given, Mapping):
                raise MechanismError(
                    f"coupling of {self.joint!r}: other = {shown(given)} must be a joint's name, "
                    "or ratios by joints' names"
                )
            object.__setattr__(self, "other", dict(given))
        if self.joint in self.others:
            raise MechanismError(f"a coupling cannot tie joint {self.joint!r} to itself")
        if not self.name:
            object.__setattr__(self, "name", f"{self.joint} = {' + '.join(self.others) or 'fixed'}")
        for option in ("ratio", "offset"):
            self._number(option, getattr(self, option))
        if self.polynomial is not None:
            self._check_polynomial(self.polynomial)
        elif isinstance(self.other, Mapping):
            self._check_ratios(self.other)
        elif self.ratio == 0:
            raise MechanismError(f"coupling {self.name!r}: a ratio of 0 couples nothing")

    def _check_ratios(self, ratios: Mapping[str, float]) -> None:
        if self.ratio != 1:
            raise MechanismError(
                f"coupling {self.name!r}: ratio = {self.ratio:g} stands beside ratios by joints' "
                "names; give one or the other"
            )
        for name, value in ratios.items():
            if self._number(f"ratio of {name!r}", value) == 0:
                raise MechanismError(
                    f"coupling {self.name!r}: a ratio of 0 couples nothing; leave {name!r} out"
                )
        object.__setattr__(self, "other", {name: float(value) for name, value in ratios.items()})

    def _check_polynomial(self, given: Sequence[float]) -> None:
        if not isinstance(self.other, str):
            raise MechanismError(
                f"coupling {self.name!r}: a polynomial is of one other joint, not of "
                f"{len(self.other)}"
            )
        if (self.ratio, self.offset) != (1, 0):
            raise MechanismError(
                f"coupling {self.name!r}: polynomial = {shown(given)} holds ratio and offset "
                "already; leave them out"
            )
        try:
            coefficients = [*given]
        except TypeError:
            coefficients = []
        coefficients = [self._number("polynomial", value) for value in coefficients]
        if not any(coefficients[1:]):
            raise MechanismError(
                f"coupling {self.name!r}: polynomial = {shown(given)} couples nothing; it must "
                "have coefficients c_0, c_1, ..., of which one after the first is not zero"
            )
        object.__setattr__(self, "polynomial", tuple(coefficients))

    def _number(self, option: str, value: object) -> float:
        if not isinstance(value, Real) or not math.isfinite(value):
            raise MechanismError(f"coupling {self.name!r}: {option} = {value!r} must be finite")
        return float(value)

    @property
    def size(self) -> int:
        """Number of constraint rows."""
        return 1

    @property
    def others(self) -> tuple[str, ...]:
        """Names of the joints that `joint` follows."""
        return (self.other,) if isinstance(self.other, str) else tuple(self.other)

    @property
    def terms(self) -> tuple[tuple[float, ...], ...]:
        """Coefficients (c_1, c_2, ...) of each other joint's polynomial p_k."""
        if self.polynomial is not None:
            return (tuple(self.polynomial[1:]),)
        if isinstance(self.other, str):
            return ((float(self.ratio),),)
        return tuple((ratio,) for ratio in self.other.values())

    @property
    def constant(self) -> float:
        """Value of q_joint where all others are 0, rad or m."""
        return float(self.offset if self.polynomial is None else self.polynomial[0])

    def joint_ids(self, model: pin.Model) -> tuple[int, ...]:
        """Return the indices of the joint and of the others in a model.

        Raises
        ------
        MechanismError
            If a joint is unknown (lists those there are), or has not exactly one coordinate.
        """
        return tuple(self._joint_id(model, name) for name in (self.joint, *self.others))

    def _joint_id(self, model: pin.Model, name: str) -> int:
        pairs = list(zip(model.names, model.joints, strict=True))[1:]  # not the world's
        found = next((joint for candidate, joint in pairs if candidate == name), None)
        if found is not None and (found.nq, found.nv) == (2, 1):
            raise MechanismError(
                f"coupling {self.name!r}: joint {name!r} ({found.shortname()}) has a cosine and a "
                "sine as its coordinates, which count no turns, and a coupling needs an angle; "
                "make it a revolute joint without limits (JointModelRX, RY, RZ, RevoluteUnaligned)"
            )
        simple = [candidate for candidate, joint in pairs if joint.nq == joint.nv == 1]
        if name not in simple:
            raise MechanismError(
                f"coupling {self.name!r}: no joint {name!r} of one coordinate; there are: "
                f"{', '.join(simple)}"
            )
        return int(model.getJointId(name))


class Term(NamedTuple):
    """One joint that another follows, in a model."""

    idx_q: int
    idx_v: int
    coefficients: tuple[float, ...]
    """c_1, c_2, ... of p(q) = c_1 q + c_2 q^2 + ..."""

    def derivatives(self, q: float) -> tuple[float, float, float, float]:
        """Return p and its first three derivatives, by Horner's rule."""
        p = first = second = third = 0.0
        for c in (*reversed(self.coefficients), 0.0):
            third = third * q + 3 * second
            second = second * q + 2 * first
            first = first * q + p
            p = p * q + c
        return p, first, second, third


class CouplingRow(NamedTuple):
    """Row of a coupling in a model."""

    row: int
    """In J."""
    idx_q: int
    idx_v: int
    """Of the joint that follows."""
    constant: float
    terms: tuple[Term, ...]

    @property
    def is_linear(self) -> bool:
        """Whether the row of J does not depend on q."""
        return all(len(term.coefficients) == 1 for term in self.terms)

    def gap(self, q: Array) -> float:
        """Return q_j - offset - sum of p_k(q_k), rad or m."""
        gap: float = q[self.idx_q] - self.constant
        for term in self.terms:
            c = term.coefficients
            x = q[term.idx_q]
            gap -= c[0] * x if len(c) == 1 else term.derivatives(x)[0]
        return gap

    def slopes(self, q: Array) -> list[tuple[int, tuple[float, float, float, float]]]:
        """Return, for each other joint, its index in v, and p_k and its first derivatives at q."""
        return [(term.idx_v, term.derivatives(q[term.idx_q])) for term in self.terms]


def coupling_row(coupling: JointCoupling, model: pin.Model, row: int) -> CouplingRow:
    """Return the row of a coupling; raises as `JointCoupling.joint_ids`."""
    one, *others = (model.joints[index] for index in coupling.joint_ids(model))
    pairs = zip(others, coupling.terms, strict=True)
    terms = tuple(Term(joint.idx_q, joint.idx_v, c) for joint, c in pairs)
    return CouplingRow(row, one.idx_q, one.idx_v, coupling.constant, terms)
