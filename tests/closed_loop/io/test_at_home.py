"""``at_home`` in a mechanism file: closures of frames as they stand at home."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, ClosureError, InputError
from tests.worst import worst

#: Three links of 1 m in a plane.
ARM = """<robot name="arm">
  <link name="base"/>
  {}
  <link name="tip"/>
  <joint name="tip_joint" type="fixed"><parent link="link_3"/><child link="tip"/>
    <origin xyz="1 0 0"/></joint>
</robot>""".format(
    "".join(
        f'<link name="link_{k}"><inertial><mass value="1"/><origin xyz="0.5 0 0"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        f'<joint name="joint_{k}" type="continuous"><axis xyz="0 1 0"/>'
        f'<parent link="{parent}"/><child link="link_{k}"/><origin xyz="{at} 0 0"/></joint>'
        for k, parent, at in ((1, "base", 0), (2, "link_1", 1), (3, "link_2", 1))
    )
)
HOME = (0.4, -0.7, 0.2)


def loaded(folder: Path, closures: str, more: str = "") -> ClosedLoopModel:
    (folder / "arm.urdf").write_text(ARM)
    home = ", ".join(f"joint_{k}: {angle}" for k, angle in enumerate(HOME, 1))
    text = f"urdf: arm.urdf\nactuated: []\nhome: {{{home}}}\n{more}closures:\n{closures}"
    (folder / "arm.yaml").write_text(text)
    return ClosedLoopModel.load(folder / "arm.yaml")


def tip(q: np.ndarray) -> np.ndarray:
    """By hand: angles add up; about y, x turns to -z."""
    angles = np.cumsum(q)
    return np.array([np.cos(angles).sum(), 0.0, -np.sin(angles).sum()])


def test_the_tip_is_held_where_it_stands(tmp_path: Path) -> None:
    held = loaded(tmp_path, "  - {frame_a: tip, frame_b: universe, at_home: true}\n")
    assert worst(held.home - HOME) == 0
    assert held.describe().mobility == 1
    for guess in ([1.0, -1.2, 0.1], [0.2, 0.1, -0.5]):
        assert worst(tip(held.close(guess)) - tip(np.array(HOME))) < 1e-10
    assert held.closures[0].name == "tip = universe"


def test_other_loops_are_closed_first(tmp_path: Path) -> None:
    closures = (
        "  - {frame_a: tip, frame_b: universe, kind: rigid, name: tip, at_home: true}\n"
        "  - {frame_a: link_3, frame_b: universe, kind: distance, distance: 1.7}\n"
    )
    held = loaded(tmp_path, closures, "couplings: [{joint: joint_3, other: joint_1}]\n")
    q = held.home
    assert held.closures[0].name == "tip"  # in the file's order
    elbow = tip(np.array([q[0], q[1]]))  # of two links
    assert worst(q[2] - q[0], np.linalg.norm(elbow) - 1.7) < 1e-10
    assert held.loop_gap(q) < 1e-12
    at = held.closures[0].offsets()[1]
    assert worst(at.translation - tip(q)) < 1e-12
    written = held.to_urdf(tmp_path / "out.urdf")
    again = ClosedLoopModel.load(written)
    assert again.loop_gap(q) < 1e-12
    assert again.closures[0].name == "tip"


def test_a_rod_has_the_length_at_home_and_a_point_an_offset(tmp_path: Path) -> None:
    rod = loaded(tmp_path, "  - {frame_a: tip, frame_b: base, kind: distance, at_home: true}\n")
    assert rod.closures[0].distance == pytest.approx(np.linalg.norm(tip(np.array(HOME))))
    foot = loaded(
        tmp_path,
        "  - {frame_a: tip, frame_b: universe, at_home: true, placement_a: {xyz: [0.5, 0, 0]}}\n",
    )
    beyond = tip(np.array(HOME)) * 1.0 + 0.5 * np.array(
        [np.cos(sum(HOME)), 0.0, -np.sin(sum(HOME))]
    )
    assert worst(foot.closures[0].offsets()[1].translation - beyond) < 1e-12


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("placement_b: {xyz: [1, 0, 0]}", r"line 5: .*placement_b follows from q"),
        ("kind: distance, distance: 2.0", r"line 5: .*distance follows from q"),
        ("axis: [0, 0, 1]", r"line 5: .*axis does not belong to kind 'spherical'"),
    ],
)
def test_what_follows_from_home_is_not_given(tmp_path: Path, more: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        loaded(tmp_path, f"  - {{frame_a: tip, frame_b: universe, at_home: true, {more}}}\n")


def test_loops_that_do_not_close_at_home(tmp_path: Path) -> None:
    closures = (
        "  - {frame_a: tip, frame_b: universe, at_home: true}\n"
        "  - {frame_a: link_3, frame_b: universe, kind: distance, distance: 9.0}\n"
    )
    with pytest.raises(ClosureError, match="do not close"):
        loaded(tmp_path, closures)
