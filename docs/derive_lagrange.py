"""Derive Lagrange's equations of the 3-RPS (Eq. 8 to 25) with SymPy, and print their terms.

The Lagrangian is written down from the energies, in the paper's coordinates x = (d, phi), and
differentiated; no algebra is done by hand. The tests evaluate the same expressions and compare the
terms of `rps_pin.paper.lagrange_terms` with them. Run it from the checkout (some ten seconds):

    .venv/bin/python docs/derive_lagrange.py
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import sympy as sp

g, h, m = sp.symbols("g h m", positive=True)
Ixx, Iyy, Izz, Ixy, Ixz, Iyz = sp.symbols("Ixx Iyy Izz Ixy Ixz Iyz")
m_leg, r, I_com = sp.symbols("m_leg r I_com", nonnegative=True)
m_rod, c_rod, I_rod = sp.symbols("m_rod c_rod I_rod", real=True)
GRAVITY = sp.Matrix(sp.symbols("G_x G_y G_z", real=True))

D, PHI = sp.symbols("d1:4", positive=True), sp.symbols("phi1:4", real=True)
D_RATE, PHI_RATE = sp.symbols("dd1:4", real=True), sp.symbols("dphi1:4", real=True)
X, X_RATE = sp.Matrix([*D, *PHI]), sp.Matrix([*D_RATE, *PHI_RATE])

INERTIA = sp.Matrix([[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]])
MOMENTS = INERTIA.trace() / 2 * sp.eye(3) - INERTIA  # S, the second moments of the mass
#: What the functions of `compiled` take, in this order.
ARGUMENTS = (
    *(g, h, m, Ixx, Iyy, Izz, Ixy, Ixz, Iyz),
    *(m_leg, r, I_com, m_rod, c_rod, I_rod),
    *GRAVITY,
    *X,
    *X_RATE,
)


class Terms(NamedTuple):
    """M x'' + coriolis + gravity = (F, 0) + A' lambda."""

    mass_matrix: sp.Matrix
    coriolis: sp.Matrix
    gravity: sp.Matrix


# The robot, from the paper's figure and Eq. 2 and 7 -----------------------------------------------


def radial(leg: int) -> sp.Matrix:
    """Return e_i."""
    angle = (0, 2 * sp.pi / 3, -2 * sp.pi / 3)[leg]
    return sp.Matrix([sp.cos(angle), sp.sin(angle), 0])


def along(leg: int) -> sp.Matrix:
    """Return s_i, the unit vector from the revolute joint to the tip."""
    return -sp.cos(PHI[leg]) * radial(leg) + sp.Matrix([0, 0, sp.sin(PHI[leg])])


def on_leg(leg: int, distance: sp.Expr) -> sp.Matrix:
    """Return a point of the leg, base axes."""
    return g * radial(leg) + distance * along(leg)


TIPS = [on_leg(leg, D[leg]) for leg in range(3)]  # Eq. 7
CENTRE = (TIPS[0] + TIPS[1] + TIPS[2]) / 3
U = (TIPS[0] - CENTRE) / h  # Eq. 2
V = (TIPS[1] - TIPS[2]) / (sp.sqrt(3) * h)


def constraints() -> sp.Matrix:
    """Return Eq. 8 as the paper prints it."""
    rows = []
    for i, j in ((0, 1), (1, 2), (2, 0)):
        ci, cj, si, sj = sp.cos(PHI[i]), sp.cos(PHI[j]), sp.sin(PHI[i]), sp.sin(PHI[j])
        rows.append(
            D[i] ** 2 + D[j] ** 2 + 3 * g**2 - 3 * h**2 + D[i] * D[j] * ci * cj
            - 2 * D[i] * D[j] * si * sj - 3 * g * D[i] * ci - 3 * g * D[j] * cj
        )  # fmt: skip
    return sp.Matrix(rows)


# Energies -----------------------------------------------------------------------------------------


def velocity(vector: sp.Matrix) -> sp.Matrix:
    """Return the time derivative of a function of x."""
    return vector.jacobian(X) * X_RATE


def platform_energies() -> tuple[sp.Expr, sp.Expr]:
    """Return the platform's kinetic (Eq. 13) and potential (Eq. 19) energies.

    The rotational energy is sum_ab S_ab r_a'.r_b'/2 with r = (u, v, n) and S = tr(I)/2 - I, which
    is Eq. 13's (see `print_checks`).
    """
    speed = velocity(CENTRE)
    u_rate, v_rate = velocity(U), velocity(V)
    rates = [u_rate, v_rate, u_rate.cross(V) + U.cross(v_rate)]
    turning = sum(MOMENTS[a, b] * rates[a].dot(rates[b]) for a in range(3) for b in range(3)) / 2
    return m * speed.dot(speed) / 2 + turning, -m * GRAVITY.dot(CENTRE)


def cylinder_energies() -> tuple[sp.Expr, sp.Expr]:
    """Return the cylinders' kinetic (Eq. 16, I_leg about the com) and potential energies."""
    return _bodies_energies([on_leg(leg, r) for leg in range(3)], m_leg, I_com)


def rod_energies() -> tuple[sp.Expr, sp.Expr]:
    """Return the rods' kinetic and potential energies."""
    return _bodies_energies([on_leg(leg, D[leg] - c_rod) for leg in range(3)], m_rod, I_rod)


def _bodies_energies(
    places: list[sp.Matrix], mass: sp.Symbol, inertia: sp.Symbol
) -> tuple[sp.Expr, sp.Expr]:
    kinetic, potential = sp.Integer(0), sp.Integer(0)
    for place, turning in zip(places, PHI_RATE, strict=True):
        speed = velocity(place)
        kinetic += sp.trigsimp(mass * speed.dot(speed) / 2) + inertia * turning**2 / 2
        # from the base's centre; what the joints' places add cancels over the three legs
        potential -= mass * GRAVITY.dot(place)
    return kinetic, potential


# Lagrange's equations -----------------------------------------------------------------------------


def lagrange(kinetic: sp.Expr, potential: sp.Expr) -> Terms:
    """Return d/dt dL/dx' - dL/dx as M x'' + coriolis + gravity."""
    momentum = sp.Matrix([kinetic]).jacobian(X_RATE).T
    slope = sp.Matrix([kinetic]).jacobian(X).T
    return Terms(
        momentum.jacobian(X_RATE),
        momentum.jacobian(X) * X_RATE - slope,
        sp.Matrix([potential]).jacobian(X).T,
    )


def compiled() -> Callable[..., Mapping[str, Any]]:
    """Return a function of the numbers `ARGUMENTS` that evaluates every term with NumPy."""
    platform = platform_energies()
    legs = [a + b for a, b in zip(cylinder_energies(), rod_energies(), strict=True)]
    terms = lagrange(platform[0] + legs[0], platform[1] + legs[1])
    f = constraints()
    named = {
        "mass_matrix": terms.mass_matrix,
        "coriolis": terms.coriolis,
        "gravity": terms.gravity,
        "constraints": f,
        "constraint_jacobian": f.jacobian(X),
        "energies": sp.Matrix([platform[0], legs[0], platform[1], legs[1]]),
    }
    function = sp.lambdify(ARGUMENTS, list(named.values()), modules="numpy", cse=True)

    def evaluate(*values: float) -> dict[str, Any]:
        return dict(zip(named, function(*values), strict=True))

    return evaluate


# Printing -----------------------------------------------------------------------------------------


def main() -> None:
    """Print the derived terms."""
    print_checks()
    print_legs("Cylinders (Eq. 16, 21)", cylinder_energies())
    print_legs("Rods", rod_energies())
    print_platform()
    print("\nConstraint Jacobian (Eq. 8), row 1; the others by turning the indices:")
    first = constraints().jacobian(X).row(0)
    for index in (0, 1, 3, 4):
        print(f"  df_1/d{X[index]} = {sp.collect(sp.expand(first[index]), D)}")


def print_checks() -> None:
    """Check the equations from which the derivation starts, and print the result."""
    print("Eq. 8 less |B_i - B_j|^2 - 3 h^2:")
    for row, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
        side = TIPS[i] - TIPS[j]
        print(f"  f_{row + 1}: {sp.simplify(constraints()[row] - side.dot(side) + 3 * h**2)}")
    spin = sp.Matrix(sp.symbols("w_x w_y w_z"))
    rates = [spin.cross(sp.eye(3)[:, k]) for k in range(3)]
    by_moments = sum(MOMENTS[a, b] * rates[a].dot(rates[b]) for a in range(3) for b in range(3))
    difference = sp.expand(by_moments - (spin.T * INERTIA * spin)[0])
    print(f"sum_ab S_ab r_a'.r_b' less w' I w, r_a' = w x e_a, S = tr(I)/2 - I: {difference}")


def print_legs(title: str, energies: tuple[sp.Expr, sp.Expr]) -> None:
    """Print the terms of leg 1; legs interact only through the platform."""
    terms = lagrange(*energies)
    print(f"\n{title}, leg 1:")
    names = (D[0], PHI[0])
    for i, name in zip((0, 3), names, strict=True):
        print(f"  M[{name}, {name}] = {sp.simplify(terms.mass_matrix[i, i])}")
    for i, name in zip((0, 3), names, strict=True):
        print(f"  coriolis[{name}] = {sp.factor(sp.simplify(terms.coriolis[i]))}")
        print(f"  gravity[{name}] = {sp.factor(terms.gravity[i])}")
    print(f"  M[{names[0]}, {names[1]}] = {sp.simplify(terms.mass_matrix[0, 3])}")


def print_platform() -> None:
    """Print the terms of the platform."""
    speed = velocity(CENTRE)
    terms = lagrange(m * speed.dot(speed) / 2, -m * GRAVITY.dot(CENTRE))
    print("\nPlatform, translation (Eq. 13, 19), rows of leg 1; the others by turning the indices:")
    for i in (0, 3):
        for j in range(6):
            print(f"  M[{X[i]}, {X[j]}] = {sp.trigsimp(sp.expand(terms.mass_matrix[i, j]))}")
        print(f"  coriolis[{X[i]}] = {sp.factor(sp.trigsimp(sp.expand(terms.coriolis[i])))}")
        print(f"  gravity[{X[i]}] = {sp.factor(terms.gravity[i])}")
    print("\nPlatform, rotation: M = sum_ab S_ab (dr_a/dx)' dr_b/dx,")
    print("coriolis = sum_ab S_ab (dr_a/dx)' (d/dt dr_b/dx) x', S = tr(I)/2 - I, with")
    for name, vector in (("u", U), ("v", V)):
        by_x = vector.jacobian(X)
        rate = velocity(by_x.reshape(18, 1)).reshape(3, 6)
        for j, coordinate in enumerate(X):
            print(f"  d{name}/d{coordinate} = {[sp.factor(part) for part in by_x[:, j]]}")
            print(f"    its rate = {[sp.factor(part) for part in rate[:, j]]}")
    print("  n = u x v, so that dn/dx = du/dx x v + u x dv/dx")


if __name__ == "__main__":
    main()
