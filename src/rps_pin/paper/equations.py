# ruff: noqa: RUF001 (Greek letters are meant)
"""The paper's equations 1 to 29, each beside what this project computes, as lines of a table."""

from __future__ import annotations

from typing import NamedTuple

from rps_pin.paper.compute import Reproduction
from rps_pin.paper.misprints import Misprint
from rps_pin.paper.printing import error

REPRODUCED, CORRECTED, DEFINITION = "reproduced", "corrected", "a definition"

#: Largest error of an equation that counts as reproduced (what central differences leave).
_LIMIT = 1e-6


class EquationLine(NamedTuple):
    """One equation."""

    number: int
    says: str
    where: str
    """Module of `rps_pin` that computes it."""
    measured: str
    status: str


def equation_lines(found: Reproduction) -> list[EquationLine]:
    """Return the lines of equations 1 to 29, in order."""
    return [*_kinematics(found), *_dynamics(found), *_inverse_dynamics(found), *_helix(found)]


def _kinematics(found: Reproduction) -> list[EquationLine]:
    check = found.checks
    degree = found.degree

    def line(number: int, says: str, where: str, beside: str, unit: str = " h") -> EquationLine:
        value = check[str(number)]
        return EquationLine(number, says, where, f"{beside}{error(value)}{unit}", _held(value))

    return [
        line(1, "q_i = p + R b_i", "rps.legs", "beside Eq. 2: "),
        line(2, "the same by components of R", "rps.legs", "beside Eq. 7: "),
        line(3, "each tip stays in its leg's plane", "rps.placement", ""),
        line(4, "u_y = v_x, p_y = -h u_y, p_x = h (u_x - v_y)/2", "rps.pose", "", ""),
        EquationLine(
            5, "p_x, p_y by α and β; γ = -α", "rps.conversions", _errors(found, 5),
            _corrected(found, 5),
        ),
        line(6, "d_i = q_i - a_i", "rps.legs", ""),
        line(7, "q_i by d_i and φ_i", "rps.legs", "beside Eq. 1: "),
        EquationLine(
            8,
            "the tips are √3 h apart; up to 8 solutions",
            "rps.leg_equations, rps.assembly",
            f"as printed beside ours, not closed: {error(check['8'])} h²; on closed robots: "
            f"{error(check['8 closed'])} h². {2 * degree} complex solutions, and up to "
            f"{max(found.counts)} real ones met",
            f"{_held(check['8'], check['8 closed'])}; the number of solutions {CORRECTED}",
        ),
    ]  # fmt: skip


def _dynamics(found: Reproduction) -> list[EquationLine]:
    check = found.checks
    balance = {each.variant: each.error for each in found.balances}
    whole = balance["Eq. 13 to 21 corrected"]
    terms, differences = "rps.lagrange_terms", "beside central differences: "

    def line(number: int, says: str, where: str, beside: str = "") -> EquationLine:
        value = check[str(number)]
        return EquationLine(number, says, where, f"{beside}{error(value)}", _held(value))

    def mended(number: int, says: str, where: str) -> EquationLine:
        measured = _errors(found, number)
        printed = balance.get(f"Eq. {number} as printed")
        if printed is not None:
            measured += f"; as printed the power balance misses by {error(printed)}"
        return EquationLine(number, says, where, measured, _corrected(found, number))

    legs = mended(16, "legs: m_leg VᵀV/2 + I_leg φ'²/2", "rps.parameters (`leg_inertia_about`)")
    return [
        EquationLine(
            9, "L = K - P", terms,
            f"energy rate beside the constraint models' power: {error(whole)}", _held(whole),
        ),
        EquationLine(10, "q = (d, φ)", terms, "", DEFINITION),
        mended(11, "constraints f_j = 0, said to be Eq. 7", terms),
        mended(12, "L̄ = L - Σ λ_j ∂f_j/∂q_i", "rps.lagrange"),
        line(13, "platform: m VᵀV/2 + ΩᵀIΩ/2", terms),
        mended(14, "I = R I_local R", terms),
        line(15, "V, Ω by a Jacobian", "rps.rates", differences),
        legs._replace(status=f"{legs.status}; both readings kept"),
        line(17, "V_leg = r φ'", terms, differences),
        line(18, "φ' of the three legs", "rps.legs", differences),
        mended(19, "P_plat = 9.81 p_z", terms),
        line(20, "p_z is the mean height of the tips", "rps.pose"),
        line(21, "P_leg = 9.81 r m_leg Σ sin φ_i", terms),
    ]  # fmt: skip


def _inverse_dynamics(found: Reproduction) -> list[EquationLine]:
    agreed = (
        f"forces beside the constraint models', {found.random.states} random states: "
        f"{error(found.random.lagrange)}"
    )
    status = _held(found.random.lagrange)
    return [
        EquationLine(22, "Lagrange's equations of the first kind", "rps.lagrange", agreed, status),
        EquationLine(
            23, "forces F_i of d, torques T_i of φ, T = 0", "rps.lagrange", "", DEFINITION
        ),
        EquationLine(24, "F_i from the rows of d", "rps.lagrange", "as Eq. 22", status),
        EquationLine(25, "λ from the rows of φ", "rps.lagrange", "as Eq. 22", status),
    ]


def _helix(found: Reproduction) -> list[EquationLine]:
    lines = [
        EquationLine(number, says, "trajectories.helix", error(value), _held(value))
        for number, says in (
            (26, "p_x = r_h cos φ"),
            (27, "p_y = r_h sin φ"),
            (28, "p_z = z_0 + p_h φ/2π"),
        )
        for value in (found.checks[str(number)],)
    ]
    law = found.law
    ends = (
        f"{_errors(found, 29)}; corrected it ends at rest at {law.end:.5f} s with φ = "
        f"{law.turn_at_end:.6f}, as printed with {law.printed_end_turn:.1f} rad at "
        f"{law.printed_end_rate:.1f} rad/s"
    )
    return [
        *lines,
        EquationLine(
            29, "φ(t): up, steady, down", "trajectories.helix", ends, _corrected(found, 29)
        ),
    ]


def _held(*errors: float) -> str:
    return REPRODUCED if max(errors) < _LIMIT else f"**not {REPRODUCED}**"


def _corrected(found: Reproduction, number: int) -> str:
    return CORRECTED if _misprint(found, number).confirmed else f"**not {CORRECTED}**"


def _errors(found: Reproduction, number: int) -> str:
    one = _misprint(found, number)
    return f"printed {error(one.error_printed)}, corrected {error(one.error_right)}"


def _misprint(found: Reproduction, number: int) -> Misprint:
    return next(each for each in found.misprints if each.where == f"Eq. {number}")
