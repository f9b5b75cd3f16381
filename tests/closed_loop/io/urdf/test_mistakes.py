"""A URDF's usual mistakes: refused with their line, before Pinocchio would print and go on."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin.closed_loop.io.urdf import model_from_urdf
from rps_pin.errors import MechanismError
from tests.each import each

ROOT = Path(__file__).resolve().parents[4]
FILE = ROOT / "urdf" / "four_bar.urdf"
TEXT = FILE.read_text("utf-8")


@each(
    ("right", "wrong", "message"),
    [
        (
            'parent link="crank"',
            'parent link="crnak"',
            "joint 'coupler_joint': parent: no link 'crnak'; did you mean 'crank'?",
        ),
        ('parent link="crank"', 'parent link="x"', "there are: base, crank, coupler"),
        (
            'child link="crank"',
            'child name="crank"',
            "<child> has no attribute 'name'; it can have: 'link'",
        ),
        (
            'type="revolute"',
            'type="hinge"',
            "joint 'crank_joint': no type 'hinge'; there are: "
            "revolute, continuous, prismatic, fixed, floating, planar",
        ),
        ('ixx="0.004"', 'ixxx="0.004"', "<inertia> has no attribute 'ixxx'; did you mean 'ixx'?"),
        ('ixx="0.004"', "", "link 'crank': its inertia has no ixx"),
        (
            'ixx="0.004"',
            'ixx="-0.004"',
            "link 'crank': ixx = -0.004 kg m^2 is negative",
        ),
        ('<mass value="1.1"/>', '<mass value="-1.1"/>', "link 'crank': mass = -1.1 kg is negative"),
        ('<mass value="1.1"/>', "", "link 'crank': its inertial has no mass value"),
        (
            '<mass value="1.1"/>',
            '<mass value="1.1 kg"/>',
            "mass value = '1.1 kg' must be a finite number",
        ),
        (
            '<origin xyz="0.08 0 0.03"/>',
            '<origin xyz="0.08 0"/>',
            "origin xyz = '0.08 0' must be 3 finite numbers",
        ),
        (
            '<link name="rocker">',
            '<link name="rokcer">',
            "no link 'rocker'; did you mean 'rokcer'?",
        ),
    ],
)
def test_mistakes_are_refused_with_their_line(right: str, wrong: str, message: str, capfd) -> None:
    assert right in TEXT
    line = TEXT[: TEXT.index(right)].count("\n") + 1
    with pytest.raises(MechanismError, match=re.escape(message)) as caught:
        model_from_urdf(TEXT.replace(right, wrong, 1))
    if "link 'rocker'" not in message:  # there it is the joint's line
        stated = int(re.search(r"line (\d+)", str(caught.value))[1])
        assert abs(stated - line) <= 2  # of the element, or of the one around it
    assert capfd.readouterr().err == ""  # Pinocchio was not asked


def test_a_joint_that_is_no_joint_is_found() -> None:
    begin = TEXT.index("<joint")
    end = TEXT.index("</joint>", begin)
    text = f"{TEXT[:begin]}<jonit{TEXT[begin + 6 : end]}</jonit>{TEXT[end + 8 :]}"
    line = TEXT[:begin].count("\n") + 1
    with pytest.raises(MechanismError, match=rf"line {line}: .*<jonit>; did you mean <joint>\?"):
        model_from_urdf(text)


def test_files_of_real_robots_pass() -> None:
    """Those of example-robot-data and our own: bodies, placements and names as Pinocchio's."""
    data = [*FILE.parent.glob("*.urdf"), *Path(pin.__file__).parents[4].rglob("*.urdf")]
    assert len(data) > 50
    refused = {
        "ur3.urdf": "<robot> has no link",  # as it is: an empty robot
        "pr2.urdf": "its principal moments of inertia are 0.001, 0.001, 0.01",
        "romeo_small.urdf": "moments of inertia are 0.0006618, 0.0006794, 0.006565",
        "romeo_laas_small.urdf": "its principal moments of inertia are -0.02135",
        "alex_psyonic_hands.urdf": "mimic: no joint 'index_q1'; did you mean 'Left_index_q1'?",
    }
    for path in data:
        if path.name in refused:
            with pytest.raises(MechanismError, match=re.escape(refused.pop(path.name))):
                model_from_urdf(path)
            continue
        model, plain = model_from_urdf(path), pin.buildModelFromUrdf(str(path))
        assert list(model.names) == list(plain.names)
        same = [*zip(model.inertias, plain.inertias, strict=True)]
        assert all(np.array_equal(a.matrix(), b.matrix()) for a, b in same)
        same = [*zip(model.jointPlacements, plain.jointPlacements, strict=True)]
        assert all(np.array_equal(a.homogeneous, b.homogeneous) for a, b in same)
    assert not refused
