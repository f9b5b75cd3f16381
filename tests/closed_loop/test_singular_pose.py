"""A parallelogram that lies in a line: one rule there and beside it, in both engines.

Its coupler does not turn, so that all follows from the crank's angle x by virtual work: with the
masses m, the levers s of their centres of mass about the pivots, and the moments of inertia I,

    V = g sin x sum(m s),   tau = d/dt dT/dx' - dT/dx + dV/dx = M x'' + g cos x sum(m s),

with M = I_crank + I_rocker + sum(m s^2), and the links' speeds are (1, -1, 1) x'. At x = 0 the two
rows of the closure are one: the linkage could go on as an antiparallelogram, and nothing is right.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from rps_pin import ClosedLoopModel, LoopClosure
from rps_pin.errors import SingularityError
from tests.proofs.common import both_engines, through
from tests.worst import worst

Array = NDArray[np.float64]

#: Mass, kg; distance of the centre of mass from the joint, m; moment of inertia about it, kg m^2.
CRANK, COUPLER, ROCKER = (0.3, 0.2, 2e-3), (0.5, 0.5, 6e-3), (0.4, 0.2, 4e-3)
ARM, GRAVITY = 0.4, 9.81
#: sum(m s); the coupler moves as a point at the crank's end.
MOMENT = CRANK[0] * CRANK[1] + COUPLER[0] * ARM + ROCKER[0] * ROCKER[1]
#: M.
INERTIA = (
    CRANK[2]
    + CRANK[0] * CRANK[1] ** 2
    + COUPLER[0] * ARM**2
    + ROCKER[2]
    + ROCKER[0] * ROCKER[1] ** 2
)
SPEEDS = np.array([1.0, -1.0, 1.0])

#: Angles where it is singular, or so nearly that its condition number passes 1e8; and others.
SINGULAR, REGULAR = (0.0, 1e-9, -3e-10), (1e-6, -1e-6, 1e-3, 0.4)


def link(name: str, mass: float, centre: float, moment: float) -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="{centre} 0 0"/><mass value="{mass}"/>'
        f'<inertia ixx="1e-4" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/>'
        "</inertial></link>"
    )


def joint(name: str, kind: str, parent: str, child: str, x: float) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="0 0 1"/></joint>'
    )


URDF = (
    '<robot name="parallelogram"><link name="base"/><link name="coupler_end"/>'
    '<link name="rocker_end"/>'
    + link("crank", *CRANK)
    + link("coupler", *COUPLER)
    + link("rocker", *ROCKER)
    + joint("crank_joint", "continuous", "base", "crank", 0.0)
    + joint("coupler_joint", "continuous", "crank", "coupler", ARM)
    + joint("rocker_joint", "continuous", "base", "rocker", 1.0)
    + joint("end_of_coupler", "fixed", "coupler", "coupler_end", 1.0)
    + joint("end_of_rocker", "fixed", "rocker", "rocker_end", ARM)
    + "</robot>"
)


def parallelogram() -> ClosedLoopModel:
    pin = LoopClosure("coupler_end", "rocker_end", "revolute", name="pin", axis=(0, 0, 1))
    return ClosedLoopModel.from_urdf(URDF, [pin], ["crank_joint"], gravity=(0.0, -GRAVITY, 0.0))


MECHANISM = parallelogram()


def at(x: float) -> Array:
    return x * SPEEDS


def holding(x: float) -> float:
    return float(GRAVITY * np.cos(x) * MOMENT)


def calls(engine: Any, q: Array) -> dict[str, Any]:
    """Each quantity that the crank alone has to determine."""
    still = np.zeros(3)
    return {
        "velocity": lambda: engine.velocity(q, [1.3]),
        "acceleration": lambda: engine.acceleration(q, still, [-0.7]),
        "inverse_dynamics": lambda: engine.inverse_dynamics(q, still, still),
        "forward_dynamics": lambda: engine.forward_dynamics(q, still, [0.5]),
        "mass_matrix": lambda: engine.mass_matrix(q),
        "gravity_forces": lambda: engine.gravity_forces(q),
        "simulate": lambda: engine.simulate(q, duration=1e-3, step=1e-3),
    }


@both_engines
@pytest.mark.parametrize("x", SINGULAR)
@pytest.mark.parametrize("name", calls(None, np.zeros(3)))
def test_singular_pose_is_refused_by_each_call(engine: str, name: str, x: float) -> None:
    with pytest.raises(SingularityError, match=r"singular|do not determine|stand still") as caught:
        calls(through(engine, MECHANISM), at(x))[name]()
    assert caught.value.condition > 1e8


@both_engines
@pytest.mark.parametrize("x", REGULAR)
def test_beside_it_all_is_as_by_virtual_work(engine: str, x: float) -> None:
    model, q, still = through(engine, MECHANISM), at(x), np.zeros(3)
    error = 1e-14 / min(abs(x), 1.0) + 1e-12  # rounding error by the condition number
    v = 1.3 * SPEEDS  # that of `velocity` has its rounding error, which would count twice
    assert worst(np.abs(model.velocity(q, [1.3]) - v)) < error
    assert worst(np.abs(model.acceleration(q, v, [-0.7]) + 0.7 * SPEEDS)) < 10 * error
    held = model.inverse_dynamics(q, still, still)
    assert worst(np.abs(held.tau - holding(x))) < 10 * error
    assert held.condition < 1e8
    moved = model.inverse_dynamics(q, v, -0.7 * SPEEDS)
    assert worst(np.abs(moved.tau - (-0.7 * INERTIA + holding(x)))) < 10 * error
    found = model.forward_dynamics(q, v, [0.5])
    assert worst(np.abs(found - (0.5 - holding(x)) / INERTIA * SPEEDS)) < 1000 * error


@both_engines
def test_simulated_from_beside_it(engine: str) -> None:
    """Away from the line, as M x'' = - g cos x sum(m s) says."""

    def rate(_: float, y: Array) -> list[float]:
        return [y[1], -holding(y[0]) / INERTIA]

    exact = solve_ivp(rate, (0.0, 0.1), [1e-3, 3.0], rtol=1e-11, atol=1e-12).y[:, -1]
    model = through(engine, MECHANISM)
    motion = model.simulate(at(1e-3), 3.0 * SPEEDS, duration=0.1, step=1e-3)
    assert worst(np.abs(motion.q[-1] - at(exact[0]))) < 1e-9
    assert worst(np.abs(motion.v[-1] - exact[1] * SPEEDS)) < 1e-8
