"""The reproduction page's tables in Markdown: all but those of the readings."""

from __future__ import annotations

from rps_pin.paper import paper_data as paper
from rps_pin.paper.agreement import Agreement
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.equations import equation_lines
from rps_pin.paper.printing import FORCES, between, error, forces, markdown
from rps_pin.rps.parameters import RPSParameters


def equations(found: Reproduction) -> str:
    """Return the table of equations 1 to 29."""
    return markdown(
        ["Eq.", "the paper", "code (`rps_pin.`)", "largest error", "status"],
        [[str(n), says, where, measured, status]
         for n, says, where, measured, status in equation_lines(found)],
    )  # fmt: skip


def misprints(found: Reproduction) -> str:
    """Return the table of the formulas' misprints."""
    return markdown(
        ["where", "printed", "right", "test", "printed misses by", "right misses by", "verdict"],
        [
            [
                one.where,
                one.printed,
                one.right,
                one.test,
                error(one.error_printed),
                error(one.error_right),
                "confirmed" if one.confirmed else "**not confirmed**",
            ]
            for one in found.misprints
        ],
    )


def statements(found: Reproduction) -> str:
    """Return what the paper states beside what is computed."""
    return markdown(["where", "the paper", "computed", "verdict"], found.statements)


def balances(found: Reproduction) -> str:
    """Return how the energies, as read, balance the actuators' work."""
    return markdown(
        ["energies", "power and energy rate differ by, of the largest power"],
        [[one.variant, error(one.error)] for one in found.balances],
    )


def table_1() -> str:
    """Return Table 1 beside the preset `sokolov`, as it is read from the package."""
    p = RPSParameters.from_preset("sokolov")
    xx, yy, zz = (p.platform_inertia[i, i] for i in range(3))
    ramp, steady, end = paper.PRINTED_TIMES
    rows = [
        ["g", f"{paper.BASE_RADIUS_MM:g} mm", f"{p.base_radius:g} m"],
        ["h", f"{paper.PLATFORM_RADIUS_MM:g} mm", f"{p.platform_radius:g} m"],
        ["m", f"{paper.PLATFORM_MASS:g} kg", f"{p.platform_mass:g} kg"],
        ["I_xx; I_yy; I_zz", "; ".join(f"{x:g}" for x in paper.PLATFORM_INERTIA) + " kg m²",
         f"{xx:g}; {yy:g}; {zz:g} kg m², kept as printed"],
        ["r", f"{paper.LEG_COM_MM:g} mm", f"{p.leg_com:g} m"],
        ["m_leg", f"{paper.LEG_MASS:g} kg", f"{p.leg_mass:g} kg"],
        ["I_leg", f"{paper.LEG_INERTIA:g} kg m²",
         f"{p.leg_inertia:g} kg m², about the {p.leg_inertia_about}"],
        ["moving rods", "not given", f"{p.rod_mass:g} kg"],
        ["r_h, p_h", f"{paper.HELIX_RADIUS:g} mm, {paper.HELIX_PITCH:g} mm", "as printed"],
        ["z_0", f"{paper.HELIX_HEIGHT:g} mm", f"{paper.HELIX_HEIGHT:g} m: see Table 2"],
        ["t_a, t_b, t_t", f"{ramp:g}, {steady:g}, {end:g} s",
         f"{paper.RAMP_END:g}, {paper.BRAKE_START - paper.RAMP_END:.5f}, {paper.END:.5f} s"],
    ]  # fmt: skip
    return markdown(["", "printed", "used"], rows)


def reach(found: Reproduction) -> str:
    """Return the workspace of several base radii beside the paper's statement."""
    return markdown(
        ["g (mm)", "p_x (mm)", "p_y (mm)", "p_z (mm)", "within the paper's 2.5 mm"],
        [
            [
                f"{1e3 * row.base_radius:.0f}",
                between(row.x),
                between(row.y),
                between(row.z),
                "yes" if row.holds else f"no: {1e3 * row.reach:.2f} mm",
            ]
            for row in found.reach
        ],
    )


def helix_ranges(found: Reproduction) -> str:
    """Return lengths and forces of Table 1's helix from 0.4 m, both branches."""
    return markdown(
        ["branch", "leg", "force (N)", "length (mm)"],
        [
            [branch, str(leg + 1), between(run.force[:, leg], 1.0), between(run.length[:, leg])]
            for branch, run in found.runs.items()
            for leg in range(3)
        ],
    )


def agreement(found: Reproduction) -> str:
    """Return how well the ways to the forces agree."""
    columns: dict[str, Agreement] = {
        f"{found.random.states + found.random.left_out} random states": found.random,
        **{f"helix, branch {branch}": one for branch, one in found.helix.items()},
    }
    quantities = {
        "loop gap (m)": "gap",
        "rate at which loops open (m/s)": "rate",
        "its acceleration (m/s²)": "acceleration",
        "KKT residual, of the largest force": "residual",
        "Lagrange beside the constraint models": "lagrange",
        "virtual work beside the constraint models": "virtual_work",
        "Lagrange beside virtual work": "lagrange_virtual_work",
    }
    return markdown(
        ["largest", *columns],
        [
            [text, *(error(getattr(one, name)) for one in columns.values())]
            for text, name in quantities.items()
        ],
    )


def table_2() -> str:
    """Return the paper's Table 2, N."""
    return markdown(
        ["", *FORCES],
        [
            ["Sokolov, as the paper quotes him", *forces(paper.SOKOLOV)],
            ["This study", *forces(paper.THIS_STUDY)],
        ],
    )
