"""The paper's numbers, typed a second time from the paper."""

from __future__ import annotations

import math

from rps_pin.paper import paper_data as paper


def test_table_1_is_what_the_paper_prints() -> None:
    assert (paper.BASE_RADIUS_MM, paper.PLATFORM_RADIUS_MM) == (460, 230)
    assert paper.PLATFORM_MASS == 0.18
    assert paper.PLATFORM_INERTIA == (0.093, 0.093, 0.187)
    assert (paper.LEG_COM_MM, paper.LEG_MASS, paper.LEG_INERTIA) == (200, 0.09, 0.05)
    assert (paper.HELIX_RADIUS, paper.HELIX_PITCH, paper.HELIX_HEIGHT) == (0.75, 0.5, 0.4)
    assert paper.PRINTED_TIMES == (0.5, 4.2, 5.2)


def test_table_2_is_what_the_paper_prints() -> None:
    assert [*paper.SOKOLOV.numbers()] == [-329, 11, -422, 509, 95, 426]
    assert [*paper.THIS_STUDY.numbers()] == [-305, 6, -382, 438, 78, 369]


def test_section_3_is_what_the_paper_prints() -> None:
    assert paper.STROKE_MM == (200, 250)
    assert (paper.STEP_MM, paper.STATED_POINTS) == (1, 50)
    assert paper.STATED_REACH_MM == 2.5
    assert paper.STATED_SOLUTIONS == 8
    assert paper.WORKSPACE_PLATFORM_RADIUS_MM == 120


def test_times_of_equation_29_follow_from_it() -> None:
    root = math.sqrt(1 + 9 * math.pi**2)
    # phi' of the first branch meets that of the second: 8 pi t / root = 4 pi / root
    assert paper.RAMP_END == 4 / 8
    # phi' of the last, (4 (1 + root) - 8 t) pi / root, is the second's first, and 0 later
    assert math.isclose((4 * (1 + root) - 4) / 8, paper.BRAKE_START)
    assert math.isclose(4 * (1 + root) / 8, paper.END)
