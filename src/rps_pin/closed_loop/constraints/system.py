"""Constraint system of a mechanism: the tree, its closure equations, its actuated joints.

This is what the algorithms of kinematics, assembly, dynamics and simulation take. It holds the
closures' selected rows and their scales, one factorisation of the passive joints' Jacobian, and the
passive joint forces. `ClosedLoopModel` is the public face of one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Indices
from rps_pin.bounds import check_velocities
from rps_pin.closed_loop.assembly.joint_limits import JointLimits
from rps_pin.closed_loop.column_names import joint_coordinates, named_velocities
from rps_pin.closed_loop.constraints.closures import Closure, JointCoupling, frame_id
from rps_pin.closed_loop.constraints.completion import (
    CompletedFactorisation,
    PassiveVelocities,
    choose,
)
from rps_pin.closed_loop.constraints.equations import ClosureEquations, names_of, refuse_twice
from rps_pin.closed_loop.constraints.factorisation import PassiveFactorisation
from rps_pin.closed_loop.constraints.rank_rule import EXACT, RankRule
from rps_pin.closed_loop.dynamics.passive_joint_forces import JointEffects
from rps_pin.closed_loop.dynamics.springs import Springs
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.errors import ClosureError, InputError, MechanismError, shown
from rps_pin.numerics.linear_algebra import Decomposition, refuse_condition
from rps_pin.one_thread import Guard
from rps_pin.validation import real, real_vector

#: Beyond this condition number half of the digits are lost (1 / sqrt of the rounding unit), and no
#: machine is built well enough to know its forces.
MAX_CONDITION = 1e8

#: How often the rule of rank is looked for in vain, before the file counts as exact.
_ATTEMPTS = 5


class ConstraintSystem:
    """Tree, closure equations and actuated joints; for the parameters see `ClosedLoopModel`.

    Attributes
    ----------
    model, data
        The open tree, and scratch memory: one thread at a time.
    equations : ClosureEquations
    actuated, passive : index arrays
        Velocities with and without actuator, shapes (na,) and (np,); `order` holds the passive
        ones, then the actuated ones.
    actuated_names : tuple of str
    row_scale, column_scale : (nc,) and (nv,) arrays
        ``row_scale[:, None] * J * column_scale`` has entries of one unit.
    factorisation : PassiveFactorisation
        Of J_p.
    rule : RankRule
        By which the rank of the closures' Jacobian is decided; found out when first asked for.
    effects : JointEffects or None
        Passive joint forces.
    limits : JointLimits
    max_condition : float
    guard : lock
        Held by public calls while they use the scratch memory; see `one_thread`.
    """

    def __init__(
        self,
        model: pin.Model,
        closures: Sequence[Closure],
        actuated: Sequence[str],
        *,
        effects: JointEffects | None = None,
        characteristic_length: float | None = None,
        max_condition: float = MAX_CONDITION,
        rule: RankRule | None = EXACT,
    ) -> None:
        for joint in model.mimicking_joints:
            raise MechanismError(
                f"joint {model.names[joint]!r} mimics another one in the Pinocchio model, which "
                "Pinocchio's constraints do not take: build the model without mimic joints, and "
                "give a JointCoupling"
            )
        check_velocities(model.nv, "the model")
        self.model = model
        self.actuated_names = names_of(actuated, "actuated joint")
        refuse_twice("actuated joint", self.actuated_names)
        self.equations = equations = ClosureEquations(model, closures, characteristic_length)
        if not model.nv:
            raise MechanismError(f"the tree {model.name!r} has no joints: nothing can move")
        if not real(max_condition) >= 1:
            raise InputError(f"max_condition = {shown(max_condition)}: it must be at least 1")
        if effects is not None and effects.damping.size != model.nv:
            raise InputError(f"effects are of {effects.damping.size} velocities, not {model.nv}")
        self.data = equations.data
        #: Names of the joints, and indices of velocities that were asked for by name.
        self.joint_names, self._velocities = frozenset(model.names), dict[str, list[int]]()
        #: The joint of each coordinate, and of each velocity.
        joints = list(model.joints)[1:]
        self._joint_of_q = np.repeat(np.arange(len(joints)), [joint.nq for joint in joints])
        self._joint_of_v = np.repeat(np.arange(len(joints)), [joint.nv for joint in joints])
        self.actuated = self.velocity_indices(self.actuated_names, "to actuate")
        self.passive = np.setdiff1d(np.arange(model.nv), self.actuated)
        self.passive_size = self.passive.size
        self.order = np.concatenate([self.passive, self.actuated])
        self.identity = np.eye(self.actuated.size)
        self.row_scale, self.column_scale = equations.row_scale, equations.column_scale
        self._scale = self.row_scale[:, None] * self.column_scale
        scale = self.column_scale[self.actuated]
        #: Scaling of the actuated velocities to one unit, (na,); None where they have one.
        self.actuated_scale: Array | None = scale if scale.size and np.ptp(scale) else None
        self.max_condition = max_condition
        self._rule, self._attempts = rule, 0
        #: Finds out the rule, from a system and configurations to start from; None if it cannot.
        self.find_rule: Callable[[ConstraintSystem, Sequence[Array]], RankRule | None] | None = None
        #: Of J and of the actuators at regular configurations, once they were asked for.
        self.ranks: tuple[int, int] | None = None
        #: For actuators that are more or fewer than the motions, or not independent, once needed.
        self.completion: CompletedFactorisation | None = None
        self.effects = effects
        _ = self.springs  # refuses what can have none
        self.limits = JointLimits(model, equations.angular_velocities)
        self._frame_ids: dict[str, int] = {}
        self.guard = Guard()

    def __getstate__(self) -> dict[str, Any]:
        """Leave out scratch memory, and factorisations, which are made again when needed."""
        state = self.__dict__.copy()
        for name in ("data", "guard", "springs", "factorisation"):
            state.pop(name, None)
        return state | {"completion": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.data, self.guard = self.equations.data, Guard()

    @cached_property
    def arcs(self) -> Array:
        """What a unit of each coordinate of q counts for as a length, shape (nq,), m.

        Lengths 1, angles the characteristic length, parts of a quaternion, a cosine or a sine twice
        as much.
        """
        equations = self.equations
        found = np.full(self.model.nq, 2 * equations.length)
        for joint in list(self.model.joints)[1:]:
            turns = equations.angular_velocities[joint.idx_v : joint.idx_v + joint.nv]
            if joint.nq == joint.nv:
                found[joint.idx_q : joint.idx_q + joint.nq] = np.where(turns, equations.length, 1.0)
            else:
                found[joint.idx_q : joint.idx_q + int(np.count_nonzero(~turns))] = 1.0
        return found

    @cached_property
    def springs(self) -> Springs | None:
        """Springs of the joints; None where no joint has one."""
        if self.effects is None or not self.effects.stiffness.any():
            return None
        return Springs(self.model, self.effects)

    # Rule of rank ---------------------------------------------------------------------------------

    @property
    def rule(self) -> RankRule:
        """Rule by which the rank of the closures' Jacobian is decided."""
        return self._rule or self.settle_rule()

    def settle_rule(self, *guesses: Array) -> RankRule:
        """Find out the rule if it is not known, if need be from guesses of a configuration (nq,).

        If the loops do not close from there, those of exact files hold until they do.
        """
        if self._rule is not None:
            return self._rule
        if self._attempts and not guesses:
            return EXACT
        self._attempts += 1
        found = EXACT if self.find_rule is None else self.find_rule(self, guesses)
        if found is None and self._attempts < _ATTEMPTS:
            return EXACT
        found = found or EXACT
        self._rule = found
        if found.rank is not None:
            self.equations.accept(found.gap)
            self.__dict__.pop("factorisation", None)
            self.ranks = self.completion = None
        return found

    def trial(self, rule: RankRule) -> ConstraintSystem:
        """Return a system of the same mechanism with another rule, and scratch memory of its own.

        Without joint limits and effects.
        """
        equations = self.equations
        return ConstraintSystem(
            self.model,
            equations.closures,
            self.actuated_names,
            characteristic_length=equations.length,
            max_condition=self.max_condition,
            rule=rule,
        )

    def rescale(self, row_scale: Array, column_scale: Array) -> None:
        """Take another scaling of J to one unit."""
        self.row_scale, self.column_scale = row_scale, column_scale
        self._scale = row_scale[:, None] * column_scale

    # Arguments ------------------------------------------------------------------------------------

    def state(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> tuple[Array, Array, Array]:
        """Return q, v and a as finite arrays of the right shapes."""
        nv = self.model.nv
        return real_vector(q, self.model.nq, "q"), real_vector(v, nv, "v"), real_vector(a, nv, "a")

    def displacement(self, q: Array) -> float:
        """Return the largest displacement of a slide or free-flyer along an axis, m."""
        return max(map(abs, q.take(self.equations.displacements).tolist()), default=0.0)

    def normalised(self, q: ArrayLike, name: str) -> Array:
        """Return a checked configuration with quaternions of unit length."""
        normal: Array = pin.normalize(self.model, real_vector(q, self.model.nq, name))
        if not pin.isNormalized(self.model, normal, 1e-9):
            raise InputError(f"{name} holds a quaternion of length zero, which is no orientation")
        return normal

    def velocity_indices(self, joints: Sequence[str], purpose: str) -> Indices:
        """Return the indices of the velocities of joints, or of their coordinates (``ball.x``).

        Raises
        ------
        MechanismError
            If there is no such joint or coordinate (says which there are), or one comes twice.
        """
        indices: list[int] = []
        for name in names_of(joints, f"joint {purpose}"):
            found = self._velocities.get(name) or named_velocities(self.model, name)
            if found is None:
                raise MechanismError(f"no joint {name!r} {purpose}; {self._possible(name)}")
            self._velocities[name] = found
            if not set(found).isdisjoint(indices):
                raise MechanismError(f"a coordinate of {name!r} {purpose} is named twice")
            indices.extend(found)
        return np.array(indices, dtype=np.intp)

    def coordinates_of(self, velocities: Indices) -> Indices:
        """Return the indices in q of the joints that velocities belong to."""
        wanted = np.zeros(self.model.njoints, dtype=bool)
        wanted[self._joint_of_v[velocities]] = True
        return np.flatnonzero(wanted[self._joint_of_q])

    def _possible(self, name: str) -> str:
        """Return what could have been named: the coordinates of a joint, or all joints."""
        owner = name.rpartition(".")[0]
        if owner and self.model.existJointName(owner):
            one = joint_coordinates(self.model, owner)
            return f"joint {owner!r} has " + (", ".join(one) or "one coordinate: name the joint")
        return f"there are: {', '.join(list(self.model.names)[1:])}"

    def independent(self, joints: Sequence[str] | None) -> Indices:
        """Return the velocities of joints, each named once; the actuated ones if left out."""
        if joints is None:
            return self.actuated
        names = names_of(joints, "independent joint")
        refuse_twice("independent joint", names)
        return self.velocity_indices(names, "to move independently")

    def frame(self, name: str) -> int:
        """Return the index of a frame, or say which frames there are."""
        if not isinstance(name, str):
            raise MechanismError(f"no frame {shown(name)}: frames are given by their names")
        if name not in self._frame_ids:
            self._frame_ids[name] = frame_id(self.model, name)
        return self._frame_ids[name]

    def by_frame(self, wrenches: Wrenches | None) -> dict[int, Array]:
        """Return wrenches, checked, by frame index."""
        if not isinstance(wrenches, Mapping | None):
            raise InputError(
                f"wrenches = {shown(wrenches)}: they must be given by frame name, "
                '{"platform": (force, moment)}'
            )
        return {
            self.frame(name): real_vector(value, 6, f"the wrench at frame {name!r}")
            for name, value in (wrenches or {}).items()
        }

    def refuse_open(self, q: Array) -> None:
        """Raise `ClosureError` if q is open (see `OPEN`); after a Jacobian at q."""
        equations = self.equations
        if not equations.is_open(q):
            return
        gaps = equations.gaps(real_vector(q, self.model.nq, "q"))
        self.settle_rule(q)  # a rounded file may leave larger gaps
        if equations.is_open(q):
            raise ClosureError(
                f"q is not a closed configuration: {equations.open_closure(gaps)}, and at "
                f"most {equations.open_limit:.3g} m is accepted; close it first with close()",
                equations.largest_gap(gaps),
            )

    # Factorisations -------------------------------------------------------------------------------

    @cached_property
    def factorisation(self) -> PassiveFactorisation:
        """Of J_p."""
        return self.factorisation_of(self.passive, self.actuated)

    def factorisation_of(self, dependent: Indices, independent: Indices) -> PassiveFactorisation:
        """Return the factorisation of J_d for some partition of the velocities."""
        scales = self.row_scale, self.column_scale
        return PassiveFactorisation(dependent, independent, *scales, self.max_condition, self.rule)

    def completed(self, factors: Decomposition, idle: int) -> CompletedFactorisation:
        """Return one for velocities that are chosen here, and keep it as `completion`.

        Parameters
        ----------
        factors
            Of J, all entries in one unit.
        idle
            Number of idle freedoms.
        """
        chosen = choose(factors, self.actuated, self.rule.tolerance)
        independent = np.concatenate([chosen.driven, chosen.passive])
        dependent = np.setdiff1d(np.arange(self.model.nv), independent)
        self.completion = CompletedFactorisation(
            chosen,
            self.factorisation_of(dependent, independent),
            self.actuated,
            PassiveVelocities(self.passive, idle),
            self.unmoving(),
            self.column_scale,
        )
        return self.completion

    def unmoving(self) -> Indices:
        """Return velocities whose columns of J are zero: they move both frames of each closure."""
        model, moving = self.model, np.zeros(self.model.nv, dtype=bool)
        for closed in self.equations.closed_frames:
            for index in set(model.supports[closed.a.joint]) ^ set(model.supports[closed.b.joint]):
                joint = model.joints[index]
                moving[joint.idx_v : joint.idx_v + joint.nv] = True
        for closure in self.equations.closures:
            if isinstance(closure, JointCoupling):
                names = (closure.joint, *closure.others)
                moving[self.velocity_indices(names, "to couple")] = True
        return np.flatnonzero(~moving)

    # Jacobian -------------------------------------------------------------------------------------

    def scaled(self, jacobian: Array) -> Array:
        """Return J with all entries in one unit."""
        return self._scale * jacobian

    def decomposed(self, jacobian: Array) -> Decomposition:
        """Return the singular value decomposition of J with all entries in one unit."""
        return Decomposition(self._scale * jacobian, self.rule.tolerance)

    def condition(self, jacobian: Array) -> float:
        """Return the condition number of J_p."""
        return self.factorisation.condition(jacobian[:, self.passive])

    def refuse_singular(self, condition: float) -> None:
        """Raise `SingularityError` if a condition number of J_p is too large."""
        reason = "the actuated joints do not determine the motion here"
        refuse_condition(condition, self.max_condition, reason)


class Mechanism(Protocol):
    """What has a constraint system: a `ClosedLoopModel`."""

    @property
    def system(self) -> ConstraintSystem:
        """The constraint system."""
