"""Millimetres and grams are doubted, in URDFs and MJCFs; SI units are not."""

from __future__ import annotations

import pytest

from rps_pin import ClosedLoopModel
from tests.each import each

#: Of a gripper: a palm, and a finger 50 mm away, of steel, 60 by 20 by 10 mm.
LENGTHS, MASS = (0.05, 0.03), 7850 * 0.06 * 0.02 * 0.01
SIDES = (0.06, 0.02, 0.01)
#: Solid ellipsoids of a box's inertia are larger than it: 7850 kg/m^3 become 7850 / 1.127 = 6968.


def gripper(form: str, metre: float, kilogram: float, kg_m2: float) -> ClosedLoopModel:
    """Return the gripper with its numbers multiplied."""
    (at, centre), mass = (metre * one for one in LENGTHS), kilogram * MASS
    a, b, c = (kg_m2 * MASS / 12 * side**2 for side in SIDES)
    tensor = (b + c, a + c, a + b)
    if form == "URDF":
        xx, yy, zz = tensor
        return ClosedLoopModel.from_urdf(
            f'''<robot name="g"><link name="palm"/><link name="finger"><inertial>
            <origin xyz="{centre} 0 0"/><mass value="{mass}"/>
            <inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/></inertial></link>
            <joint name="j" type="continuous"><parent link="palm"/><child link="finger"/>
            <origin xyz="0 {at} 0"/><axis xyz="0 1 0"/></joint></robot>''',
            [],
            ["j"],
        )
    diagonal = " ".join(map(str, tensor))
    return ClosedLoopModel.from_mjcf(
        f'''<mujoco><worldbody><body pos="0 {at} 0"><joint name="j" axis="0 1 0"/>
        <inertial pos="{centre} 0 0" mass="{mass}" diaginertia="{diagonal}"/></body></worldbody>
        </mujoco>'''
    )


def told(mechanism: ClosedLoopModel) -> list[str]:
    return [note for note in mechanism.notes if note.endswith("Units are SI: m, kg, kg m^2")]


@each("form", ["URDF", "MJCF"])
def test_si_units_are_not_doubted(form: str) -> None:
    pytest.importorskip("mujoco")
    for size in (0.05, 1.0, 20.0):  # a gripper of 3 mm, and a robot of a metre
        assert told(gripper(form, size, size**3, size**5)) == []


@each("form", ["URDF", "MJCF"])
@each(
    ("metre", "kilogram", "kg_m2", "words"),
    [
        (1e3, 1, 1, "joint 'j' is at 50 m from the one before; 50 mm would be 0.05 m"),
        (1e3, 1, 1e6, "are those of bodies of 7e-06 kg/m"),  # kg and mm in all
        (1, 1, 1e6, "radius of gyration of 18.26 m, where no offset is above 0.05 m"),
        (1, 1e3, 1e3, "are those of bodies of 7e+06 kg/m"),  # grams in all
        (1, 1e3, 1, "are those of bodies of 2.2e+11 kg/m"),
    ],
)
def test_other_units_are_doubted(
    form: str, metre: float, kilogram: float, kg_m2: float, words: str
) -> None:
    pytest.importorskip("mujoco")
    mechanism = gripper(form, metre, kilogram, kg_m2)
    assert any(words in note for note in told(mechanism)), mechanism.notes
