"""Masses and inertias of URDF files that say too little, or say it twice."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, MechanismError
from rps_pin.closed_loop.io.urdf import parts_from_urdf
from tests.closed_loop.io.urdf.texts import body, joint, link, robot
from tests.each import each

TENSOR = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/>'
ZERO = '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0.0"/>'
COM = '<origin xyz="0.5 0 0"/>'


def arm(*inside: str, kind: str = "fixed", axis: str = '<axis xyz="0 1 0"/>') -> str:
    """A beam of 1 kg about y, and 2 m out a link with something inside, each in lines."""
    return robot(
        link("base"),
        body("beam", 1.0, "1 0 0", "0.1 0.1 0.1"),
        "\n".join(('<link name="tip">', *inside, "</link>")),
        joint("turn", "continuous", "base", "beam", axis=None, more=axis),
        joint("end", kind, "beam", "tip", xyz="2 0 0"),
    )


def mass_matrix(text: str) -> np.ndarray:
    model = parts_from_urdf(text).model
    data = model.createData()
    return np.triu(pin.crba(model, data, pin.neutral(model)))


def inertial(*inside: str) -> tuple[str, ...]:
    return ("<inertial>", *inside, "</inertial>")


BEAM = 1.1
"""Of the beam about its joint, kg m^2."""


@each("mass", ["", "<mass/>"])
@each("inside", [ZERO, COM + ZERO, ""])
def test_a_link_without_mass_value_has_none_if_it_has_no_inertia(mass: str, inside: str) -> None:
    """As urdfdom leaves it; and a moving one stays without mass, not with some of its own."""
    parts = parts_from_urdf(arm(*inertial(inside, mass)))
    assert mass_matrix(arm(*inertial(inside, mass)))[0, 0] == pytest.approx(BEAM, rel=1e-14)
    (note,) = parts.notes
    assert note.endswith("has no mass value, taken as without mass: 'tip' (line 2)")
    moving = mass_matrix(arm(*inertial(inside, mass), kind="continuous"))
    np.testing.assert_allclose(moving, np.diag([BEAM, 0.0]), atol=1e-15)


def test_an_inertia_without_a_mass_value_is_refused() -> None:
    with pytest.raises(MechanismError, match=r"line 2: link 'tip': its inertial has no mass value"):
        parts_from_urdf(arm(*inertial(TENSOR)))


def test_a_mass_without_inertia_is_in_one_point_as_in_drake() -> None:
    """tau = (I + m r^2) a - g (m_1 + m r) at r = 2.5 m."""
    text = arm(*inertial(COM, '<mass value="3"/>'))
    mechanism = ClosedLoopModel.from_urdf(text, [], ["turn"])
    assert "has no inertia, taken as masses in one point: 'tip' (line 2)" in mechanism.notes[-1]
    tau = mechanism.inverse_dynamics(np.zeros(1), np.zeros(1), np.ones(1)).tau[0]
    assert tau == pytest.approx(BEAM + 3 * 2.5**2 - 9.81 * (1.0 + 3 * 2.5), rel=1e-13)
    assert (
        mass_matrix(text)[0, 0] == mass_matrix(arm(*inertial(COM, '<mass value="3"/>', ZERO)))[0, 0]
    )


@each(("word", "same"), [("iyx", "ixy"), ("izx", "ixz"), ("izy", "iyz")])
def test_the_lower_half_of_a_tensor_must_repeat_the_upper(word: str, same: str) -> None:
    right = TENSOR.replace(f'{same}="0"', f'{same}="0.01"')
    both = right.replace("<inertia", f'<inertia {word}="1e-2"')
    mass = '<mass value="1"/>'
    plain, twice = (arm(*inertial(mass, one), kind="floating") for one in (right, both))
    np.testing.assert_array_equal(mass_matrix(plain), mass_matrix(twice))
    assert parts_from_urdf(twice).notes == ()
    other = both.replace("1e-2", "-0.01")
    with pytest.raises(MechanismError, match=rf"line 4: .*{word} = -0.01 and {same} = 0.01 kg m"):
        parts_from_urdf(arm(*inertial(mass, other)))
    with pytest.raises(MechanismError, match=f"its inertia has no {same}"):
        parts_from_urdf(arm(*inertial(mass, both.replace(f'{same}="0.01"', ""))))


def test_what_is_said_twice_counts_once() -> None:
    """Pinocchio reads the first of two; so does this, if they are the same."""
    once = inertial(COM, '<mass value="3"/>', TENSOR)
    again = inertial('<origin xyz="0.50 0.0 0"/>', '<mass value="3.0"/>', TENSOR)
    text = arm(*once, *again)
    np.testing.assert_array_equal(mass_matrix(text), mass_matrix(arm(*once)))
    (note,) = parts_from_urdf(text).notes
    assert "line 7: <link> repeats its <inertial> of line 2, which counts once" in note
    text = arm(axis='<axis xyz="0 1 0"/>\n<axis xyz="0 1.0 0"/>')
    assert mass_matrix(text)[0, 0] == pytest.approx(BEAM, rel=1e-14)
    assert "<joint> repeats its <axis>" in parts_from_urdf(text).notes[0]


@each(
    ("text", "why"),
    [
        (
            arm(
                *inertial(COM, '<mass value="3"/>', TENSOR),
                *inertial(COM, '<mass value="0.3"/>', TENSOR),
            ),
            r"line 7: <link> has a second <inertial>, which differs from the first \(line 2\)",
        ),
        (
            arm(
                *inertial(COM, '<mass value="3"/>', TENSOR), *inertial('<mass value="3"/>', TENSOR)
            ),
            "has a second <inertial>, which differs",
        ),
        (arm(axis='<axis xyz="0 1 0"/><axis xyz="0 0 1"/>'), "a second <axis>, which differs"),
        (arm(axis='<axis xyz="1 0 0"/><axis/>'), "a second <axis>, which differs"),
    ],
)
def test_two_that_differ_are_refused(text: str, why: str) -> None:
    with pytest.raises(MechanismError, match=why):
        parts_from_urdf(text)


def test_an_inertia_without_mass_counts_and_is_told() -> None:
    """A tip of no mass and 0.2 kg m^2 about y, fixed to the beam: the file's sum is 1.3.

    MuJoCo adds it where the tip has any mass, and leaves it out where it has none.
    """
    none, dust = (arm(*inertial(f'<mass value="{mass}"/>', TENSOR)) for mass in ("0", "1e-14"))
    assert mass_matrix(none)[0, 0] == pytest.approx(BEAM + 0.2, rel=1e-14)
    (note,) = parts_from_urdf(none).notes
    assert note.endswith("which counts (MuJoCo leaves it out): 'tip' (line 2)")
    assert in_mujoco(none) == pytest.approx(BEAM, rel=1e-12)
    assert in_mujoco(dust) == pytest.approx(mass_matrix(none)[0, 0], rel=1e-12)
    moving = mass_matrix(arm(*inertial('<mass value="0"/>', TENSOR), kind="continuous"))
    np.testing.assert_allclose(moving, [[BEAM + 0.2, 0.2], [0, 0.2]], rtol=1e-14)


def in_mujoco(text: str) -> float:
    model = mujoco.MjModel.from_xml_string(text)
    data, mass = mujoco.MjData(model), np.zeros((1, 1))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    return float(mass[0, 0])
