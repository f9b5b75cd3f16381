"""A mechanism with closed loops: an open Pinocchio tree, its loop closures, its actuated joints."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import Closure
from rps_pin.closed_loop.constraints.loops import Loops
from rps_pin.closed_loop.describe import MechanismDescription, describe
from rps_pin.closed_loop.dynamics.derivatives import (
    Following,
    ForwardDynamicsDerivatives,
    InverseDynamicsDerivatives,
    Linearisation,
    Solved,
    dynamics_slopes,
    forward_derivatives,
    inverse_derivatives,
    linearisation,
)
from rps_pin.closed_loop.dynamics.dynamics import ClosedLoopDynamics
from rps_pin.closed_loop.dynamics.kinematics import MAX_CONDITION
from rps_pin.closed_loop.dynamics.passive_joint_forces import FRICTION_SPEED, JointEffects
from rps_pin.closed_loop.dynamics.wrenches import Wrenches, closure_wrenches, forces_on_joints
from rps_pin.closed_loop.editing.split import split
from rps_pin.closed_loop.io.mechanism_file import parts_from_yaml
from rps_pin.closed_loop.io.mjcf import parts_from_mjcf
from rps_pin.closed_loop.io.parts import MechanismParts
from rps_pin.closed_loop.io.urdf import model_from_urdf
from rps_pin.closed_loop.simulation.result import Simulation
from rps_pin.closed_loop.simulation.simulate import simulate
from rps_pin.errors import InputError
from rps_pin.numerics.linear_algebra import pseudo_inverse
from rps_pin.validation import real_vector


class ClosedLoopModel(ClosedLoopDynamics):
    """Any mechanism: an open tree whose loops are closed by Pinocchio constraint models.

    Build once, call often: the scratch memory is allocated here. For that reason one object serves
    one thread; `model` itself is never written to and may be shared.

    Parameters
    ----------
    model
        The open tree. Its gravity, and its armature, are used as they stand.
    closures
        What closes its loops: `LoopClosure` and `JointCoupling` objects.
    actuated
        Names of the actuated joints; `tau` comes in this order.
    home
        Configuration to start from, shape (nq,); Pinocchio's neutral one if left out.
    effects
        Damping, friction and springs of the joints; none if left out.
    name
        For tables and messages; that of the model if left out.
    characteristic_length
        Length (m) that makes angles and lengths comparable: in condition numbers, and in the norm
        that `close` makes small. Left out, it is the longest lever of a closure, that is, the
        distance of a closed frame from the joint that carries it (1 m if all are zero).
    max_condition
        `SingularityError` is raised where the condition number exceeds this.

    Raises
    ------
    MechanismError
        If a frame or joint is unknown or named twice, or no joint is actuated.
    InputError
        If a number or an array does not fit.
    """

    _split_loops: Loops | None = None  # made when first needed

    @classmethod
    def from_urdf(
        cls,
        path_or_xml: str | os.PathLike[str],
        closures: Sequence[Closure],
        actuated: Sequence[str],
        *,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        **options: Any,
    ) -> ClosedLoopModel:
        """Build a mechanism from a URDF: a file's path, or the XML text itself.

        Parameters
        ----------
        path_or_xml
            Path of a URDF file, or its text (recognised by its leading ``<``). A joint of type
            ``floating`` becomes a free-flyer.
        closures, actuated
            As for the class.
        gravity
            Acceleration of gravity in world axes, shape (3,), m/s^2.
        **options
            The class's other parameters.

        Raises
        ------
        InputError
            If the file cannot be read, or gravity is no finite vector.
        MechanismError
            If it is no URDF, or as for the class.
        """
        model = model_from_urdf(path_or_xml)
        model.gravity.linear = real_vector(gravity, 3, "gravity")
        return cls(model, closures, actuated, **options)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> ClosedLoopModel:
        """Build a mechanism from its description, a YAML file; see `description`.

        The file names a URDF or MJCF, the closures, the actuated joints, and where `home` is: the
        loops are closed from there.

        Raises
        ------
        InputError, MechanismError
            If a file cannot be read, or what it says does not hold together; with file and line.
        ClosureError
            If the loops do not close from the home that the file gives; says by how much, and
            which.
        """
        return cls._from_parts(parts_from_yaml(path))

    @classmethod
    def from_mjcf(
        cls,
        path_or_xml: str | os.PathLike[str],
        *,
        closures: Sequence[Closure] = (),
        actuated: Sequence[str] | None = None,
    ) -> ClosedLoopModel:
        """Build a mechanism from a MuJoCo file: its path, or its text (which begins with ``<``).

        Its ``equality`` elements (connect, weld, joint) are the closures, its ``actuator`` elements
        say what is actuated. MuJoCo itself is not needed.

        Parameters
        ----------
        path_or_xml
            The file, or its text.
        closures
            Further closures, after those of the file.
        actuated
            Names of the actuated joints, instead of the file's.

        Raises
        ------
        InputError, MechanismError
            As `load`; also for elements that have no counterpart here.
        ClosureError
            As `load`.
        """
        return cls._from_parts(parts_from_mjcf(path_or_xml, closures=closures, actuated=actuated))

    @classmethod
    def _from_parts(cls, parts: MechanismParts) -> ClosedLoopModel:
        effects = None
        if parts.damping or parts.friction or parts.stiffness:
            effects = JointEffects.named(
                parts.model,
                damping=parts.damping,
                friction=parts.friction,
                stiffness=parts.stiffness,
                rest=parts.rest,
                friction_speed=parts.friction_speed or FRICTION_SPEED,
            )
        mechanism = cls(
            parts.model,
            parts.closures,
            parts.actuated,
            home=parts.home,
            effects=effects,
            name=parts.name,
            characteristic_length=parts.characteristic_length,
            max_condition=parts.max_condition or MAX_CONDITION,
        )
        if parts.home is not None:
            mechanism._home = mechanism.close(parts.home)
        return mechanism

    def __reduce__(self) -> tuple[Any, ...]:
        """Give copies, and other processes, scratch memory of their own."""
        return _rebuilt, (
            type(self),
            (self.model, self.closures, self.actuated),
            {
                "home": self._home,
                "effects": self.effects,
                "name": self.name,
                "characteristic_length": self.characteristic_length,
                "max_condition": self.max_condition,
            },
        )

    def describe(self, q: ArrayLike | None = None) -> MechanismDescription:
        """Return joints, rows, rank, mobility, redundant rows and actuation; `print` it.

        Parameters
        ----------
        q
            Closed configuration to compute it at, shape (nq,). Left out: a regular one, found by
            small steps from `home`.

        Raises
        ------
        ClosureError
            If the loops do not close from `home`.
        """
        return describe(self, None if q is None else real_vector(q, self.model.nq, "q"))

    # Wrenches -------------------------------------------------------------------------------------

    def closure_wrenches(self, q: ArrayLike, constraint_forces: ArrayLike) -> dict[str, Array]:
        """Return the wrench in each closure of frames, by name.

        What frame b's side exerts on frame a's side: (force, moment), shape (6,), N and N m, at
        frame a's origin, in world axes.

        Parameters
        ----------
        q
            Closed configuration, shape (nq,).
        constraint_forces
            lambda, shape (nc,), as `inverse_dynamics` returns it.
        """
        multipliers = real_vector(constraint_forces, self.constraint_size, "constraint_forces")
        return closure_wrenches(self._loops, real_vector(q, self.model.nq, "q"), multipliers)

    def joint_wrenches(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        constraint_forces: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        axes: Literal["world", "joint"] = "joint",
    ) -> dict[str, Array]:
        """Return the wrench that each joint of the tree carries, by name.

        What the link before the joint exerts on the link after it: (force, moment), shape (6,), N
        and N m, at the origin of the joint's frame (which moves with the link after it), in that
        frame's axes or the world's. Actuator, damping, friction and spring are parts of it.

        Parameters
        ----------
        q, v, a, constraint_forces, wrenches
            A motion, and the answer of `inverse_dynamics` or `constraint_forces` to it.
        axes
            ``"joint"`` or ``"world"``.
        """
        if axes not in ("joint", "world"):
            raise InputError(f"axes = {axes!r}; it must be 'joint' or 'world'")
        q_, v_, a_ = self._checked_state(q, v, a)
        on_closures = self.closure_wrenches(q_, constraint_forces)
        model, data = self.model, self._loops.data
        pin.framesForwardKinematics(model, data, q_)
        forces = forces_on_joints(self._loops, on_closures, self._by_frame(wrenches))
        pin.rnea(model, data, q_, v_, a_, forces)
        carried = {}
        for index, name in enumerate(model.names):
            if index:
                turn = data.oMi[index].rotation if axes == "world" else np.eye(3)
                carried[name] = (data.f[index].vector.reshape(2, 3) @ turn.T).ravel()
        return carried

    # Derivatives ----------------------------------------------------------------------------------

    def inverse_dynamics_derivatives(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, wrenches: Wrenches | None = None
    ) -> InverseDynamicsDerivatives:
        """Return the derivatives of the actuator forces, analytic; see `derivatives`.

        Parameters
        ----------
        q, v, a, wrenches
            As for `inverse_dynamics`. Configurations are varied in their tangent,
            ``pin.integrate(model, q, dq)``.

        Raises
        ------
        SingularityError
            If the actuated joints do not determine the motion here, or are more than the mobility.
        MechanismError
            If the tree holds a joint whose derivatives are not known (ellipsoid, mimic).
        """
        q_, v_, a_ = self._checked_state(q, v, a)
        basis = self.motion_basis(q_)
        multipliers = self.inverse_dynamics(q_, v_, a_, wrenches=wrenches).constraint_forces
        slopes, rows = dynamics_slopes(
            self._differentiable(),
            (q_, v_, a_),
            multipliers,
            self._by_frame(wrenches),
            self.effects,
        )
        following = Following(basis, self._actuated, self._solution(q_), rows)
        return inverse_derivatives(slopes, following)

    def forward_dynamics_derivatives(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        independent: Sequence[str] | None = None,
        *,
        wrenches: Wrenches | None = None,
    ) -> ForwardDynamicsDerivatives:
        """Return the derivatives of the acceleration, analytic; see `derivatives`.

        Parameters
        ----------
        q, v, tau, wrenches
            As for `forward_dynamics`.
        independent
            Joints whose positions the mechanism follows; the actuated ones if left out.

        Raises
        ------
        SingularityError
            If these joints do not determine the motion here, or a motion moves no mass.
        """
        q_, v_ = real_vector(q, self.model.nq, "q"), real_vector(v, self.model.nv, "v")
        a = self.forward_dynamics(q_, v_, tau, wrenches=wrenches)
        multipliers = self.constraint_forces(q_, v_, a, tau, wrenches=wrenches)
        basis, chosen = self.motion_basis(q_, independent), self._independent(independent)
        slopes, rows = dynamics_slopes(
            self._differentiable(), (q_, v_, a), multipliers, self._by_frame(wrenches), self.effects
        )
        following = Following(basis, chosen, self._solution(q_), rows)
        return forward_derivatives(slopes, rows, following, (chosen, self._actuated))

    def linearize(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        independent: Sequence[str] | None = None,
        *,
        wrenches: Wrenches | None = None,
    ) -> Linearisation:
        """Return A and B of the motion about an operating point, dx/dt = A dx + B dtau.

        The state x stacks positions and velocities of the independent joints (the actuated ones if
        left out), shape (2 m,): deviations from the motion through q, v under tau. Exact for joints
        of one coordinate.

        Parameters
        ----------
        q, v, tau, independent, wrenches
            As for `forward_dynamics_derivatives`.
        """
        return linearisation(
            self.forward_dynamics_derivatives(q, v, tau, independent, wrenches=wrenches)
        )

    # Motion in time -------------------------------------------------------------------------------

    def simulate(
        self, q: ArrayLike, v: ArrayLike | None = None, *, duration: float, **options: Any
    ) -> Simulation:
        """Return the motion from a closed state; see `simulation.simulate` for all its options.

        Parameters
        ----------
        q, v
            Closed configuration (nq,), and a velocity that keeps it closed (nv,); at rest if left
            out.
        duration
            s.
        **options
            ``step``, ``method``, ``controller``, ``tau``, ``wrenches``, ``closing`` and others.
        """
        return simulate(self, q, v, duration=duration, **options)

    def _differentiable(self) -> Loops:
        """Return the loops on a tree whose derivatives Pinocchio knows; see `splitting`."""
        if self._split_loops is None:
            twin = split(self.model)
            self._split_loops = (
                self._loops
                if twin is self.model
                else Loops(twin, self.closures, self.characteristic_length)
            )
        return self._split_loops

    def _solution(self, q: Array) -> Solved:
        """Return what solves J x = b at q: of x, the passive joints' rows if they determine it."""
        jacobian = self._loops.jacobian(q).copy()
        if self._solver.solve(jacobian, np.zeros((self.constraint_size, 1))) is None:
            inverse = pseudo_inverse(self._scaled(jacobian))
            unscaled = self._loops.column_scale[:, None] * inverse * self._loops.row_scale
            return lambda right: unscaled @ right

        def solved(right: Array) -> Array:
            x = np.zeros((self.model.nv, right.shape[1]))
            found = self._solver.solve(jacobian, np.asfortranarray(right))
            assert found is not None  # as it was above
            x[self._passive] = found
            return x

        return solved


def _rebuilt(
    cls: type[ClosedLoopModel], description: tuple[Any, ...], options: dict[str, Any]
) -> ClosedLoopModel:
    return cls(*description, **options)
