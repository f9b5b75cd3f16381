"""What the paper states in words, recomputed from scratch."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from lxml import etree

from rps_pin import RPSParameters, RPSRobot
from rps_pin.paper.compute import Reproduction
from rps_pin.paper.page import render
from rps_pin.paper.workspace_comparison import greatest_base_radius, theoretical_reach
from tests.paper.markdown_rows import rows, section
from tests.worst import worst


@pytest.fixture(scope="module")
def statements(found: Reproduction) -> list[list[str]]:
    """The rows of the page's table: where, the paper's words, what is computed, the verdict."""
    return rows(section(render(found), "What the paper states"))[1:]


def test_verdicts(statements: list[list[str]]) -> None:
    assert [(where, verdict) for where, _, _, verdict in statements] == [
        ("Sec. 2.2, Eq. 8", "corrected"),
        ("Fig. 2", "holds"),
        ("Sec. 3, Fig. 3", "holds"),
        ("Sec. 3", "corrected"),
        ("Sec. 3, Fig. 6", "open"),
        ("Sec. 3, Fig. 6", "holds"),
        ("Fig. 4", "holds"),
        ("Table 1, Eq. 29", "corrected"),
        ("Eq. 26 to 29", "the proportions explain Eq. 29"),
        ("Table 1", "corrected"),
        ("Table 1", "open"),
        ("Table 1", "open"),
        ("Sec. 4.3, Table 2", "holds"),
    ]


def test_the_numbers_in_them(statements: list[list[str]]) -> None:
    all_of_it = "\n".join(computed for _, _, computed, _ in statements)
    assert f"{len(range(200, 251))} points, or steps of {50 / 49:.4f} mm" in all_of_it
    t_t = (1 + math.sqrt(1 + 9 * math.pi**2)) / 2
    assert f"t_b = {t_t - 1:.5f} s, t_t = {t_t:.5f} s" in all_of_it
    assert "I_zz exceeds I_xx + I_yy by 0.001" in all_of_it
    assert f"{2 * 0.187 / 0.23**2:.2f} kg" in all_of_it
    assert f"{math.sqrt(0.05 / 0.09):.3f} m" in all_of_it
    assert f"{6 / 11:.2f} to {305 / 329:.2f} times" in all_of_it


def test_the_base_radius_that_just_keeps_the_statement() -> None:
    """By inverse thinking: the corner of the stroke that goes farthest, by forward kinematics."""
    g = greatest_base_radius()
    assert g > 0.12
    for base, within in ((g - 1e-5, True), (g + 1e-5, False)):
        micro = RPSParameters.from_preset("micro").replace(
            base_radius=base, leg_angle_limits=(-math.pi, math.pi), spherical_cone_limit=math.pi
        )
        robot = RPSRobot(micro)
        reached = []
        for a in np.linspace(0.2, 0.25, 6):
            for b in np.linspace(0.2, 0.25, 6):
                for c in np.linspace(0.2, 0.25, 6):
                    pose = robot.forward_kinematics([a, b, c], near=[0.22, 0, 0])
                    reached.append(robot.platform_placement(pose)[0][:2])
        assert (worst(*reached) <= 2.5e-3) is within


def test_the_theoretical_cylinder() -> None:
    error, reach = theoretical_reach()
    assert error <= 1e-12
    assert reach == pytest.approx(1.0, abs=1e-12)


def test_mujoco_refuses_table_1_s_platform_and_takes_a_disc() -> None:
    """The statement on the triangle inequality; MuJoCo is another engine's word for it."""

    def body(inertia: str) -> str:
        root = etree.Element("mujoco")
        platform = etree.SubElement(etree.SubElement(root, "worldbody"), "body")
        etree.SubElement(platform, "freejoint")
        etree.SubElement(platform, "inertial", pos="0 0 0", mass="0.18", diaginertia=inertia)
        return etree.tostring(root, encoding="unicode")

    mujoco.MjModel.from_xml_string(body("0.0935 0.0935 0.187"))
    with pytest.raises(ValueError, match="inertia must satisfy A \\+ B >= C"):
        mujoco.MjModel.from_xml_string(body("0.093 0.093 0.187"))
