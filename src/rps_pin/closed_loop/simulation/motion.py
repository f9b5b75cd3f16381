"""Motion of a mechanism under actuator forces and wrenches, for `simulate` and `Stepper`.

The applied forces, the acceleration they give, and the closed state that a motion starts from.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.assembly.closing import CLOSED, closed_gap, independent_gap
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.closed_loop.simulation.damped import Damping, stiff_damping
from rps_pin.closed_loop.simulation.manifold import ClosedManifold
from rps_pin.errors import ClosureError, InputError, SingularityError
from rps_pin.validation import real_vector

State = tuple[Array, Array]
Controller = Callable[[float, Array, Array], ArrayLike]
WrenchesInTime = Callable[[float, Array, Array], Wrenches]
#: Actuator forces (na,) of time, configuration and velocity.
ForceLaw = Callable[[float, Array, Array], Array]

#: Gap of an initial configuration, relative to what its rounding error is relative to, and opening
#: rate per speed, above which it is refused.
OPEN = 1e-9
_OPENING = 1e-8


class Drive:
    """Actuator forces, held from one command to the next, and wrenches."""

    def __init__(
        self,
        system: ConstraintSystem,
        controller: Controller | None,
        tau: ArrayLike | None,
        wrenches: Wrenches | WrenchesInTime | None,
    ) -> None:
        if controller is not None and tau is not None:
            raise InputError("give a controller or constant forces tau, not both")
        self._controller, self._size = controller, system.actuated.size
        given = np.zeros(self._size) if tau is None else tau
        self.tau = real_vector(given, self._size, "tau").copy()
        #: Of forces that follow the state, in place of `tau`.
        self.law: ForceLaw | None = None
        self._wrenches = wrenches

    def command(self, time: float, q: Array, v: Array) -> None:
        """Ask the controller, which gets copies of the state."""
        if self._controller is not None:
            answer = self._controller(time, q.copy(), v.copy())
            self.tau = real_vector(answer, self._size, "the controller's tau").copy()

    def forces(self, time: float, q: Array, v: Array) -> Array:
        """Return the actuator forces that act now, (na,)."""
        return self.tau if self.law is None else self.law(time, q, v)

    def wrenches(self, time: float, q: Array, v: Array) -> Wrenches | None:
        """Return the wrenches that act now."""
        given = self._wrenches
        return given(time, q, v) if callable(given) else given


class Motion:
    """The dynamics under a drive, on a manifold that each finished step returns to."""

    def __init__(self, system: ConstraintSystem, start: State, drive: Drive, gain: float) -> None:
        self.model, self._drive, self._gain = system.model, drive, gain
        self._system, self._manifold = system, ClosedManifold(system, start[0])
        self.gap = self._manifold.gap
        #: Of the applied forces (see `ClosedManifold.acceleration`) at the last acceleration, W.
        self.power = 0.0

    def acceleration(self, t: float, q: Array, v: Array) -> Array:
        """Return a, shape (nv,).

        Raises
        ------
        SingularityError
            If the state is not finite, or the motion not determined.
        """
        refuse_infinite(q, v)
        wrenches = self._drive.wrenches(t, q, v)
        tau = self._drive.forces(t, q, v)
        a, self.power = self._manifold.acceleration(q, v, tau, wrenches, self._gain)
        return a

    def stiff_damping(self, q: Array, v: Array, step: float) -> Damping | None:
        """Return the damping if it is stiff for a step from q, v; after `acceleration` there."""
        return stiff_damping(self._system, q, v, self._manifold.basis, step)

    def finish(self, state: State) -> tuple[State, float]:
        """Return the state, projected unless Baumgarte's method was chosen, and its largest gap.

        Raises
        ------
        SingularityError
            If the state is not finite, or has lost rows.
        """
        q, v = state
        refuse_infinite(q, v)
        if self._gain:
            gap = self.gap(q)
        else:
            q, v, gap = self._manifold.project(q, v)
        self._manifold.renew(q)
        return (q, v), gap


def refuse_infinite(q: Array, v: Array) -> None:
    """Raise `SingularityError` if a state is not finite."""
    if not math.isfinite(q.dot(q) + v.dot(v)):
        raise SingularityError(
            "the motion grows beyond all numbers (unstable control, or too long a step in time, as "
            "for stiff springs: take a shorter one, or method='adaptive')",
            np.inf,
            np.inf,
        )


def closed_start(system: ConstraintSystem, q: ArrayLike, v: ArrayLike | None) -> State:
    """Return the initial state closed to rounding error, or say how far open it is."""
    nv, equations = system.model.nv, system.equations
    q_ = real_vector(q, system.model.nq, "q")
    v_ = np.zeros(nv) if v is None else real_vector(v, nv, "v")
    gaps = equations.gaps(q_)
    gap = equations.largest_gap(gaps)
    if gap <= system.settle_rule(q_).gap:
        gap = independent_gap(system, q_, gaps)
    if not gap <= OPEN / CLOSED * closed_gap(system, q_):
        raise ClosureError(
            f"the loops are open by {gap:.3g} m at the start; close them with close() first", gap
        )
    rates = system.row_scale * (equations.jacobian(q_) @ v_)
    opening = float(np.abs(rates).max(initial=0.0))
    accepted = max(_OPENING, system.rule.consistent)
    speed = float(np.abs(v_ / system.column_scale).max(initial=0.0))
    if opening > accepted * max(speed, equations.speed):
        raise ClosureError(
            f"v opens the loops at {opening:.3g} m/s at the start; make it with velocity() first",
            opening,
        )
    q_, v_, _ = ClosedManifold(system, q_).project(q_, v_)
    return q_.copy(), v_.copy()
