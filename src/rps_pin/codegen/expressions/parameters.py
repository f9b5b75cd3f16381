"""Numbers of a mechanism for generated code, some of which stay symbols: its parameters.

=================  ===  ===========================================================================
group              np   what it is
=================  ===  ===========================================================================
gravity            3    the acceleration of gravity in the world's axes, m/s^2
inertia:JOINT      10   of the joint's body: mass, first moment, inertia about the joint's origin,
                        as `pinocchio.Inertia.toDynamicParameters` has them, kg, kg m, kg m^2
mass:JOINT         1    the mass, kg, of a body that has one, centre and inertia per mass kept
placement:JOINT    6    a shift, m, and a turn (roll, pitch, yaw), rad, of the joint in its own
                        frame, nominal 0
closure:NAME       12   the same of the closure's frames a and b
distance:NAME      1    the length of the rod of a ``distance`` closure, m
payload:FRAME      10   a body added at the frame, as inertia:JOINT about the frame's origin in its
                        axes, nominal 0
=================  ===  ===========================================================================

A turn by roll, pitch and yaw is R_z(yaw) R_y(pitch) R_x(roll).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.editing.split import split
from rps_pin.codegen.expressions.joints import Expression, Placement, clean, sparse
from rps_pin.errors import InputError, MechanismError, did_you_mean, shown
from rps_pin.validation import real_vector

#: Mass, first moment (3, 1) and inertia (3, 3) about the origin.
Inertia = tuple[Expression, Expression, Expression]

_KINDS = (
    "gravity",
    "inertia:JOINT",
    "mass:JOINT",
    "placement:JOINT",
    "closure:NAME",
    "distance:NAME",
    "payload:FRAME",
)
_BODY = ("mass", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
_MOVE = ("x", "y", "z", "roll", "pitch", "yaw")


class Parameters:
    """Placements, inertias and gravity of a mechanism, those of named groups as symbols.

    Parameters
    ----------
    system
        The mechanism.
    names
        Groups that stay symbols; see the module's table. Each has its numbers in the order given.

    Attributes
    ----------
    model : pinocchio.Model
        The mechanism's tree, its joints split: joints are counted as there.
    symbols : SX
        Shape (np, 1).
    nominal : array
        The numbers of the mechanism as it is, shape (np,).
    labels : tuple of str
        What each number is, as ``"inertia:platform.mass"`` or ``"gravity[0]"``.

    Raises
    ------
    InputError
        If a group is unknown, named twice, or in conflict with another.
    """

    def __init__(self, system: ConstraintSystem, names: Sequence[str] = ()) -> None:
        self._system, self.model = system, split(system.model)
        self._closures = {closed.closure.name: closed for closed in system.equations.closed_frames}
        self._rods = {
            name: float(closed.closure.distance)
            for name, closed in self._closures.items()
            if closed.closure.distance is not None
        }
        self._length = max(
            [float(np.abs(m.translation).max()) for m in self.model.jointPlacements]
            + [float(np.abs(f.placement.translation).max()) for f in self.model.frames]
            + [
                float(np.abs(frame.placement.translation).max())
                for closed in self._closures.values()
                for frame in (closed.a, closed.b)
            ]
        )
        #: The joint of the mechanism's own model that starts with a velocity.
        self._starts = {joint.idx_v: joint.id for joint in list(system.model.joints)[1:]}
        self.groups = (names,) if isinstance(names, str) else tuple(names)
        self._refuse_groups()
        symbols, nominal, labels = [ca.SX(0, 1)], [np.zeros(0)], []
        self._symbols: dict[str, Expression] = {}
        for group in self.groups:
            values, own = self._group(group)
            self._symbols[group] = ca.SX.sym(group, values.size)
            symbols.append(self._symbols[group])
            nominal.append(values)
            labels.extend(own)
        self.symbols, self.nominal = ca.vertcat(*symbols), np.concatenate(nominal)
        self.labels = tuple(labels)
        self._payloads = self._payloads_of_joints()

    # Groups ---------------------------------------------------------------------------------------

    @property
    def possible(self) -> tuple[str, ...]:
        """All groups of the mechanism."""
        joints = list(self._system.model.names)[1:]
        frames = [frame.name for frame in self.model.frames if frame.parentJoint]
        with_mass = [name for name in joints if self._body(name).mass > 0]
        return (
            "gravity",
            *(f"inertia:{name}" for name in joints),
            *(f"mass:{name}" for name in with_mass),
            *(f"placement:{name}" for name in joints),
            *(f"closure:{name}" for name in self._closures),
            *(f"distance:{name}" for name in self._rods),
            *(f"payload:{name}" for name in frames),
        )

    def vector(self, changes: Mapping[str, ArrayLike]) -> Array:
        """Return the nominal numbers with some changed, shape (np,).

        Parameters
        ----------
        changes
            New numbers, by label, or all of a group by its name.

        Raises
        ------
        InputError
            If a name is neither a label nor a group that is a symbol here, or its numbers have the
            wrong shape or are not finite.
        """
        result = self.nominal.copy()
        starts = np.cumsum([0] + [self._symbols[group].numel() for group in self.groups])
        for name, value in changes.items():
            if name in self.groups:
                k = self.groups.index(name)
                size = int(starts[k + 1] - starts[k])
                result[starts[k] : starts[k + 1]] = real_vector(np.atleast_1d(value), size, name)
            elif name in self.labels:
                result[self.labels.index(name)] = real_vector(np.atleast_1d(value), 1, name)[0]
            else:
                known = (*self.groups, *self.labels)
                raise InputError(
                    f"no parameter {name!r}{did_you_mean(name, known)}; there are: "
                    f"{', '.join(known) or 'none'}"
                )
        return result

    def _refuse_groups(self) -> None:
        possible = self.possible
        for group in self.groups:
            if group not in possible:
                kind = str(group).partition(":")[0]
                same = [name for name in possible if name.partition(":")[0] == kind] or _KINDS
                raise InputError(
                    f"no parameter {shown(group)}{did_you_mean(str(group), possible)}; there are: "
                    f"{', '.join(same)}"
                )
            if self.groups.count(group) > 1:
                raise InputError(f"parameter {group!r} is named twice; name it once")
            kind, _, name = group.partition(":")
            if kind == "mass" and f"inertia:{name}" in self.groups:
                raise InputError(
                    f"parameters {group!r} and 'inertia:{name}' both hold the mass of one body; "
                    "name one of them"
                )

    def _group(self, group: str) -> tuple[Array, list[str]]:
        """Return a group's nominal numbers and their labels."""
        kind, _, name = group.partition(":")
        if kind == "gravity":
            return np.array(self.model.gravity.linear), [f"gravity[{k}]" for k in range(3)]
        if kind == "inertia":
            return self._body(name).toDynamicParameters(), [f"{group}.{part}" for part in _BODY]
        if kind in ("mass", "distance"):
            one = self._rods[name] if kind == "distance" else self._body(name).mass
            return np.array([one]), [group]
        if kind == "placement":
            return np.zeros(6), [f"{group}.{part}" for part in _MOVE]
        if kind == "closure":
            return np.zeros(12), [f"{group}.{end}.{part}" for end in "ab" for part in _MOVE]
        return np.zeros(10), [f"{group}.{part}" for part in _BODY]  # payload

    def _body(self, joint: str) -> Any:
        return self._system.model.inertias[self._system.model.getJointId(joint)]

    # Numbers and symbols --------------------------------------------------------------------------

    @property
    def gravity(self) -> Expression:
        """The acceleration of gravity in the world's axes, m/s^2, shape (3, 1)."""
        linear = np.array(self.model.gravity.linear)
        return self._symbols.get("gravity", sparse(clean(linear, float(np.abs(linear).max()))))

    def inertia(self, joint: int) -> Inertia:
        """Return mass, first moment and inertia about the joint's origin, in the joint's axes.

        Parameters
        ----------
        joint
            Index in the split model.
        """
        name, body = self.model.names[joint], self.model.inertias[joint]
        if (own := self._symbols.get(f"inertia:{name}")) is not None:
            result = _of_dynamic_parameters(own)
        else:
            mass, first, inertia = _cleaned(body)
            result = ca.SX(mass), sparse(first), sparse(inertia)
            if (own := self._symbols.get(f"mass:{name}")) is not None:
                result = own, own * sparse(first / mass), own * sparse(inertia / mass)
        for payload in self._payloads.get(joint, ()):
            result = summed(result, payload)
        return result

    def joint_placement(self, joint: int) -> Placement:
        """Return R and p (m) in the parent's frame of where a joint stands, as its model has it."""
        placement = self.model.jointPlacements[joint]
        whole = self._starts.get(self.model.joints[joint].idx_v)
        own = self._symbols.get(f"placement:{self._system.model.names[whole]}") if whole else None
        if own is None:
            return self._numbers(placement)
        # The first of the joints in a row stands in the frame of the joint that was split.
        at = self._system.model.jointPlacements[whole]
        first = self._numbers(at.inverse() * placement)
        return _product(_product(self._numbers(at), _small_move(own)), first)

    def frame_placement(self, frame: int) -> Placement:
        """Return R and p (m) of a frame, by its index, in its joint's frame."""
        return self._numbers(self.model.frames[frame].placement)

    def closure_placements(self, closure: str) -> tuple[Placement, Placement]:
        """Return R and p (m) of a closure's frames a and b in their joints' frames.

        Raises
        ------
        MechanismError
            If there is no such closure of frames.
        """
        if closure not in self._closures:
            known = ", ".join(self._closures) or "none"
            raise MechanismError(f"no closure of frames {closure!r}; there are: {known}")
        closed = self._closures[closure]
        a, b = self._numbers(closed.a.placement), self._numbers(closed.b.placement)
        own = self._symbols.get(f"closure:{closure}")
        if own is None:
            return a, b
        return _product(a, _small_move(own[:6])), _product(b, _small_move(own[6:]))

    def rod(self, closure: str) -> Expression:
        """Return the length of the rod of a ``distance`` closure, m."""
        return self._symbols.get(f"distance:{closure}", ca.SX(self._rods[closure]))

    def _numbers(self, placement: Any) -> Placement:
        """Return a placement without its rounding errors."""
        shift = clean(placement.translation, self._length)
        return sparse(clean(placement.rotation)), sparse(shift)

    def _payloads_of_joints(self) -> dict[int, list[Inertia]]:
        result: dict[int, list[Inertia]] = {}
        for group, own in self._symbols.items():
            kind, _, name = group.partition(":")
            if kind == "payload":
                frame = self._system.frame(name)
                body = moved_inertia(_of_dynamic_parameters(own), self.frame_placement(frame))
                result.setdefault(int(self.model.frames[frame].parentJoint), []).append(body)
        return result


def moved_inertia(body: Inertia, placement: Placement) -> Inertia:
    """Return a body's mass, first moment and inertia in and about the frame it is placed in.

    With h' = R h and u = h' + m p / 2: h = h' + m p, and I = R I R' - (X + X') where
    X = skew(p) skew(u).
    """
    (mass, first, inertia), (rotation, origin) = body, placement
    turned = rotation @ first
    half = ca.sparsify(ca.skew(turned + mass * origin / 2))
    shifted = ca.sparsify(ca.skew(origin)) @ half
    full = rotation @ inertia @ rotation.T - (shifted + shifted.T)
    return mass, turned + mass * origin, _symmetric(full)


def summed(one: Inertia, other: Inertia) -> Inertia:
    """Return mass, first moment and inertia of two bodies together."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def _symmetric(matrix: Expression) -> Expression:
    """Return a symmetric matrix made of its lower half."""
    lower = ca.tril(matrix)
    return lower + ca.tril(lower, False).T


def _product(one: Placement, other: Placement) -> Placement:
    return one[0] @ other[0], one[1] + one[0] @ other[1]


def _small_move(move: Expression) -> Placement:
    """Return the placement of a shift and a turn by roll, pitch and yaw, shape (6, 1)."""
    c, s = ca.cos(move[3:]).elements(), ca.sin(move[3:]).elements()
    roll = ca.blockcat([[1, 0, 0], [0, c[0], -s[0]], [0, s[0], c[0]]])
    pitch = ca.blockcat([[c[1], 0, s[1]], [0, 1, 0], [-s[1], 0, c[1]]])
    yaw = ca.blockcat([[c[2], -s[2], 0], [s[2], c[2], 0], [0, 0, 1]])
    return ca.sparsify(yaw) @ ca.sparsify(pitch) @ ca.sparsify(roll), move[:3]


def _of_dynamic_parameters(numbers: Expression) -> Inertia:
    mass, first, (xx, xy, yy, xz, yz, zz) = numbers[0], numbers[1:4], numbers[4:].elements()
    return mass, first, ca.blockcat([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _cleaned(body: Any) -> tuple[float, Array, Array]:
    """Return the mass, first moment and inertia of a `pinocchio.Inertia` without rounding errors.

    The units are those of the body's radius of gyration about the origin.
    """
    numbers = np.array(body.toDynamicParameters())
    mass, first, (xx, xy, yy, xz, yz, zz) = float(numbers[0]), numbers[1:4], numbers[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    unit = float(np.trace(inertia))
    return mass, clean(first, math.sqrt(max(unit * mass, 0.0))), clean(inertia, unit)
