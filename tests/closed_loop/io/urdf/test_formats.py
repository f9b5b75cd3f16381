"""Declarations and encodings of URDF files; names; files of other formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, InputError, LoopClosure, MechanismError, bounds
from rps_pin.closed_loop.io.urdf import model_from_urdf, parts_from_urdf
from tests.closed_loop.io.urdf.texts import joint, link, robot
from tests.each import each

ARM = robot(link("base"), link("arm", 1.0), joint("j", "continuous", "base", "arm"), name="Jörg")


@each(
    "start",
    [
        '<?xml version="1.0"?>',
        '<?xml version="0.0" ?>\n',
        '<?xml version="1.1"?>\n\n',
        "<?xml version='1.0' encoding='utf-8'?><!-- made by hand -->\n",
        '<!-- a comment first -->\n<?xml version="1.0"?>\n',
        '\n  <?xml version="1.0"?>',
        "\ufeff",
        '\ufeff<?xml version="1.0" encoding="UTF-8"?>',
        '<?xml version="1.0" encoding="latin-1"?>',  # a text is what it is
        '<?xml version="1.0"?><?xml-model href="urdf.xsd"?>',
    ],
)
def test_declarations_do_no_harm(start: str) -> None:
    assert model_from_urdf(start + ARM).name == "Jörg"


def test_many_comments_before_the_declaration_take_no_time() -> None:
    """Patterns that try every way to read them took hours for 60."""
    comments = "<!-- by hand -->\n" * 3000
    for text in (ARM, f'<?xml version="1.0"?>{ARM}'):
        assert model_from_urdf(comments + text).name == "Jörg"
    with pytest.raises(MechanismError, match=r"line 3002: <robot> has a <lnk>"):
        model_from_urdf(f"{comments}<?xml version='1.0'?>\n{ARM}".replace("<link", "<lnk", 1))


@each("unended", ["<!--", "${", "$(arg ", "<?xml ", '<link a="', "<link ", "]]>", "&amp;"])
def test_what_does_not_end_takes_no_time(unended: str) -> None:
    for start in ("", "<robot>"):
        with pytest.raises(MechanismError):
            model_from_urdf(f"<robot>{start}{unended * 50_000}")


@each(
    ("declared", "encoding"),
    [
        ("utf-8", "utf-8"),
        ("UTF-8", "utf-8-sig"),
        ("ISO-8859-1", "latin-1"),
        ("windows-1252", "cp1252"),
        ("utf-16", "utf-16"),
        ("us-ascii", "utf-8"),  # which it is not
        ("klingon", "utf-8"),
    ],
)
def test_files_are_read_in_their_encoding(tmp_path_factory, declared: str, encoding: str) -> None:
    path = tmp_path_factory.mktemp("encoded") / "r.urdf"
    path.write_bytes(f'<?xml version="1.0" encoding="{declared}"?>\n{ARM}'.encode(encoding))
    assert model_from_urdf(path).name == "Jörg"


def test_lines_are_those_of_the_file(tmp_path: Path) -> None:
    text = f'\n<!-- two\nlines -->\n<?xml version="1.0"\n?>\n{ARM}'.replace("base", "bse", 1)
    (tmp_path / "r.urdf").write_text(text, "utf-8")
    with pytest.raises(MechanismError, match=r"line 6: .*no link 'base'; did you mean 'bse'"):
        model_from_urdf(tmp_path / "r.urdf")


def test_large_files_are_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounds, "XML", 1000)
    (tmp_path / "r.urdf").write_text(ARM + " " * 1000, "utf-8")
    for source in (tmp_path / "r.urdf", ARM + " " * 1000):
        with pytest.raises(InputError, match=r"more than 1000 .*RPS_PIN_BOUNDS=10"):
            model_from_urdf(source)


@each(
    ("text", "told"),
    [
        ('<sdf version="1.9"><model name="m"/></sdf>', "an SDFormat file; convert it"),
        ("<?xml version='1.0'?><sdf/>", "an SDFormat file"),
        ("<mujoco><worldbody/></mujoco>", "a MuJoCo file; use ClosedLoopModel.from_mjcf"),
        ('<robot name="r"><xacro:include filename="a"/></robot>', "a xacro file (line 1: <xacro:"),
        (
            '<robot name="r"\n xmlns:xacro="http://www.ros.org/wiki/xacro">\n<xacro:a/></robot>',
            "a xacro file (line 3: <xacro:a); expand it first: 'xacro FILE.xacro > FILE.urdf'",
        ),
        (ARM.replace('xyz="0 0 0"', 'xyz="0 0 ${h}"'), "a xacro file (line 1: ${h})"),
        (ARM.replace('name="arm"', 'name="$(arg p)arm"', 1), "a xacro file (line 1: $(arg p))"),
        ("<COLLADA/>", "a COLLADA file"),
        ("<launch/>", "a ROS launch file"),
        ("<html/>", "an HTML page, as a server sends"),
        ("<svg/>", "its root element is <svg>, not <robot>"),
    ],
)
def test_files_of_other_formats_are_named(text: str, told: str) -> None:
    with pytest.raises(MechanismError, match="not a valid URDF") as caught:
        model_from_urdf(text)
    assert told in str(caught.value)


def test_usd_is_named(tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text("#usda 1.0\ndef Xform")
    with pytest.raises(MechanismError, match="not a valid URDF but a USD file; convert it"):
        model_from_urdf(tmp_path / "r.urdf")
    (tmp_path / "c.urdf").write_bytes(b"PXR-USDC\0\0\xff")
    with pytest.raises(MechanismError, match="not a valid URDF but a USD file; convert it"):
        model_from_urdf(tmp_path / "c.urdf")


def test_what_xacro_leaves_behind_is_no_xacro() -> None:
    text = ARM.replace("<robot ", '<robot xmlns:xacro="http://ros.org/wiki/xacro" ')
    text = text.replace("<link", "<!-- from ${file} by <xacro:arm/> --><link", 1)
    assert model_from_urdf(text).nq == 1


# Names --------------------------------------------------------------------------------------------


def test_a_link_and_a_joint_may_have_one_name() -> None:
    """A closure, a wrench, a frame of that name is the link's."""
    text = robot(
        link("base"),
        link("arm", 1.0, "0.5 0 0"),
        link("tip"),
        link("anchor"),
        joint("arm", "revolute", "base", "arm", xyz="0 0 0.2"),
        joint("arm_tip", "fixed", "arm", "tip", xyz="1 0 0"),
        joint("tip", "fixed", "base", "anchor", xyz="0.5 0 0.2"),
    )
    closure = LoopClosure("tip", "anchor", "distance", distance=0.6)
    mechanism = ClosedLoopModel.from_urdf(text, [closure], ["arm"])
    q = mechanism.close([0.1])
    place = mechanism.frame_placement(q, "tip")[:3, 3]
    np.testing.assert_allclose(place, [np.cos(q[0]), 0, 0.2 - np.sin(q[0])], atol=1e-12)
    assert np.linalg.norm(place - [0.5, 0, 0.2]) == pytest.approx(0.6, abs=1e-12)
    tau = mechanism.inverse_dynamics(
        q, np.zeros(1), np.zeros(1), wrenches={"tip": [0, 0, 9.81 / 2, 0, 0, 0]}
    )
    assert np.isfinite(tau.tau).all()


@each(
    ("text", "why"),
    [
        (robot(link("a"), link("a")), "there are two links called 'a': the other is in line 1"),
        (
            robot(
                link("a"),
                link("b"),
                link("c"),
                joint("j", "fixed", "a", "b"),
                joint("j", "fixed", "b", "c"),
            ),
            "there are two joints called 'j': the other is in line 1",
        ),
        (robot("<link/>"), "<link> has no name"),
        (robot('<link nam="a"/>'), "<link> has no attribute 'nam'; did you mean 'name'?"),
        (robot(link("universe")), "a link cannot be called 'universe'"),
        (robot(link("a"), link("b")), "no joint has these as its child: a, b; a URDF has one root"),
        (
            robot(
                link("a"), link("b"), joint("j", "fixed", "a", "b"), joint("k", "fixed", "a", "b")
            ),
            "link 'b' is the child of two joints, 'j' (line 1) and 'k'",
        ),
        (
            robot(
                link("a"), link("b"), joint("j", "fixed", "a", "b"), joint("k", "fixed", "b", "a")
            ),
            "these joints form a cycle, which a tree has not: ",
        ),
        (robot(link("a"), joint("j", "fixed", "a", "a")), "these joints form a cycle"),
        (
            robot(
                link("r"),
                link("a"),
                link("b"),
                joint("j", "fixed", "a", "b"),
                joint("k", "fixed", "b", "a"),
            ),
            "these joints form a cycle",
        ),
        (robot(link("a")) + "<x/>", "Extra content at the end"),
    ],
)
def test_what_is_no_tree_is_refused(text: str, why: str) -> None:
    with pytest.raises(MechanismError, match="not a valid URDF") as caught:
        model_from_urdf(text)
    assert why in str(caught.value)


def test_long_rows_and_many_velocities_are_refused() -> None:
    """Not by a segmentation fault of Pinocchio's parser, nor by 20 GB of memory."""

    def row(count: int, kind: str) -> str:
        parts = [link("l0")]
        for i in range(1, count):
            parts += [link(f"l{i}"), joint(f"j{i}", kind, f"l{i - 1}", f"l{i}")]
        return robot(*parts)

    assert model_from_urdf(row(500, "fixed")).nframes > 900
    with pytest.raises(MechanismError, match="'l1001' is the last of 1001 in a row, and at"):
        model_from_urdf(row(5000, "fixed"))
    with pytest.raises(MechanismError, match=r"500 velocities, and at most 400 .*RPS_PIN_BOUNDS"):
        model_from_urdf(row(501, "continuous"))


def test_the_world_of_drake_need_not_be_declared() -> None:
    parts = parts_from_urdf(robot(link("arm", 1.0), joint("j", "continuous", "world", "arm")))
    assert parts.model.nq == 1
    assert "the link 'world' is not in the file" in parts.notes[0]


def test_what_gazebo_alone_acts_on_is_told() -> None:
    text = ARM.replace(
        "</robot>",
        '<gazebo reference="arm"><turnGravityOff>true</turnGravityOff><mu1>1</mu1></gazebo>'
        '<gazebo reference="j"><springStiffness>9</springStiffness></gazebo>'
        '<ros2_control><joint name="j"><param name="mimic">k</param></joint></ros2_control>'
        "</robot>",
    )
    told = " ".join(parts_from_urdf(text).notes)
    assert "without gravity in Gazebo only, which have weight here: 'arm'" in told
    assert "<springStiffness> acts in Gazebo only" in told
    assert "ros2_control couples 'j' with 'k'" in told


def test_tensors_that_no_body_has_are_told_or_refused() -> None:
    inertia = '<inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/>'
    assert inertia in ARM
    three_fold = ARM.replace('izz="0.001"', 'izz="0.006"')
    (note,) = parts_from_urdf(three_fold).notes
    assert note.endswith("inertias that no body has, used as they are: 'arm' (line 1)")
    for wrong in (
        ARM.replace('izz="0.001"', 'izz="0.01"'),  # five times the sum of the others
        ARM.replace('ixy="0"', 'ixy="0.005"'),
        ARM.replace('ixy="0"', 'ixy="0.00105"'),  # -5e-5, 2 % of the largest
        ARM.replace(inertia, '<inertia ixx="3" ixy="4" ixz="0" iyy="5" iyz="0" izz="9"/>'),
    ):
        with pytest.raises(MechanismError, match=r"line 1: link 'arm': its principal moments of"):
            parts_from_urdf(wrong)


@each(
    "tensor",
    [
        '<inertia ixx="0" iyy="0" izz="0.02" ixy="0" ixz="0" iyz="0"/>',  # of a plane mechanism
        '<inertia ixx="1e-7" iyy="1e-7" izz="1e-6" ixy="0" ixz="0" iyz="0"/>',  # a placeholder
        '<inertia ixx="1e-8" iyy="1e-8" izz="1e-8" ixy="1e-6" ixz="0" iyz="0"/>',
    ],
)
def test_tensors_that_real_files_have_are_told(tensor: str) -> None:
    inertia = '<inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/>'
    (note,) = parts_from_urdf(ARM.replace(inertia, tensor)).notes
    assert note.endswith("inertias that no body has, used as they are: 'arm' (line 1)")


@each("number", ["1_0", "٣", "1\u00a0", "0x1", "1e999", "1d3", "nan", ""])
def test_numbers_are_those_of_xml_schema(number: str) -> None:
    with pytest.raises(MechanismError, match=r"line 1: mass value = .* finite"):
        model_from_urdf(ARM.replace('mass value="1.0"', f'mass value="{number}"'))
