"""Files that MuJoCo refuses, included and attached files, and the lines that messages name."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, InputError, MechanismError
from rps_pin.closed_loop.io.mjcf import parts_from_mjcf
from tests.closed_loop.io.mjcf.twin import BODY, fourbar, mujoco_file, read
from tests.each import each

INCLUDE = '<mujoco>\n<include file="{}.xml"/></mujoco>'
ATTACH = """<mujoco><asset>
    <model name="m" file="{}.xml"/></asset><worldbody><attach model="m" prefix="a"/></worldbody>
    </mujoco>"""
BAD = 'stiffness="1 2"'
WHY = "a stiffness that is not linear"


@each(
    ("text", "why"),
    [
        ("<robot/>", "is not a valid MJCF but a URDF; use ClosedLoopModel.from_urdf"),
        ("<mujocoinclude/>", "but a part of a MuJoCo file; read the file that includes it"),
        ("<!DOCTYPE mujoco []><mujoco/>", "declares a document type"),
        ("<mujoco/>", "has no joints"),
        ("<mujoco", "is not a valid MJCF"),
        ("<mujoco>" + "<body>" * 5000 + "</body>" * 5000 + "</mujoco>", "is not a valid MJCF"),
        (mujoco_file(BODY.replace("axis", "axi")).replace("name=", "nam=", 1), "line 1"),
        (mujoco_file(BODY, "\n<equaliti/>"), "unrecognized element Element 'equaliti', line 2"),
        (mujoco_file(BODY.replace('mass="1.3"', 'mass="1_3"')), "bad format in attribute 'mass'"),
        (mujoco_file(BODY.replace('"j"', '"j" class="x"')), "'x'"),
        (fourbar('<equality><weld body1="crnk"/></equality>'), "unknown element 'crnk'"),
        (fourbar('<actuator><motor joint="j9"/></actuator>'), "'j9'"),
        (mujoco_file(BODY, '<include file="none.xml"/>'), "Error opening file 'none.xml'"),
        (fourbar('<keyframe><key qpos="1 2 3 4"/></keyframe>'), "invalid qpos size, expected 3"),
    ],
)
def test_what_mujoco_refuses_is_refused_with_its_reason(text: str, why: str) -> None:
    with pytest.raises(MechanismError) as caught:
        parts_from_mjcf(text)
    assert why in str(caught.value)
    assert str(caught.value).startswith("the MJCF text ")


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot read the MJCF .*none\.xml: No such file"):
        parts_from_mjcf(tmp_path / "none.xml")
    (tmp_path / "binary.xml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"binary\.xml: not a UTF-8 text"):
        parts_from_mjcf(tmp_path / "binary.xml")


WIDE = "is in UTF-16 or UTF-32; MuJoCo reads UTF-8 alone"


@each("encoding", ["utf-16", "utf-16-le", "utf-32"])
@each("included", [False, True])
def test_files_in_other_encodings_are_refused(
    encoding: str, included: bool, tmp_path: Path
) -> None:
    main = written(tmp_path, main='<mujoco><include file="wide.xml"/></mujoco>')
    wide = tmp_path / "wide.xml"
    mark = "\ufeff" if encoding.endswith("le") else ""
    wide.write_bytes((mark + mujoco_file(BODY)).encode(encoding))
    with pytest.raises(MechanismError, match=rf"wide\.xml {WIDE}"):
        parts_from_mjcf(main if included else wide)


def test_names_that_are_not_utf8_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    text = '<?xml version="1.0" encoding="iso-8859-1"?><!-- \xb5m -->' + mujoco_file(BODY)
    path.write_text(text, "latin-1")
    assert parts_from_mjcf(path).model.nv == 1
    path.write_text(text.replace('"j"', '"j\xe9"'), "latin-1")
    with pytest.raises(MechanismError, match=r"robot\.xml has names that are not in UTF-8"):
        parts_from_mjcf(path)


ENTITIES = '<!DOCTYPE m [<!ENTITY a0 "aaaaaaaaaa">' + "".join(
    f'<!ENTITY a{i} "{10 * f"&a{i - 1};"}">' for i in range(1, 12)
)


@each(
    ("files", "why"),
    [
        (
            {"main": INCLUDE.format("main")},
            r"main\.xml, line 2: include of .*main\.xml', which lea",
        ),
        (
            {"main": INCLUDE.format("two"), "two": INCLUDE.format("main")},
            r"two\.xml, line 2: include of .*main\.xml', which leads back to itself",
        ),
        ({"main": ATTACH.format("main")}, r"main\.xml, line 2: model of .*main\.xml', which leads"),
        (
            {"main": ATTACH.format("two"), "two": ATTACH.format("main")},
            r"two\.xml, line 2: model of .*main\.xml', which leads back to itself",
        ),
        (
            {"main": INCLUDE.format("two"), "two": ENTITIES + "]>" + mujoco_file(BODY)},
            r"two\.xml declares a document type, which no MJCF needs: refused",
        ),
        (
            {"main": ENTITIES + "]>" + mujoco_file(BODY)},
            r"main\.xml declares a document type, which no MJCF needs: refused",
        ),
        (
            {"main": INCLUDE.format("two"), "two": " " * (64 * 2**20 + 1)},
            r"two\.xml has more than 67108864 bytes",
        ),
        (
            {"main": INCLUDE.format("two"), "two": "<mujoco>\n<worldbody></mujoco>"},
            r"Include error.*two\.xml: .*line 2",
        ),
        ({"main": INCLUDE.format("none")}, r"Error opening file 'none\.xml' .*line 2"),
        (
            {"main": INCLUDE.format(f"{'a' * 300}")},
            r"Error opening file 'a*\.xml' .*line 2",
        ),
        (
            {
                "main": INCLUDE.format("f1"),
                **{f"f{i}": INCLUDE.format(f"f{i + 1}") for i in range(1, 110)},
            },
            r"f100\.xml, line 2: include of .*, too deep",
        ),
    ],
)
def test_files_that_are_hostile_or_broken_are_refused(
    files: dict[str, str], why: str, tmp_path: Path
) -> None:
    path = written(tmp_path, **files)
    with pytest.raises((MechanismError, InputError), match=why):
        parts_from_mjcf(path)


def test_a_document_type_in_a_comment_is_none() -> None:
    assert parts_from_mjcf(mujoco_file(BODY, "<!-- <!DOCTYPE mujoco> -->")).model.nv == 1


def test_text_that_only_mujoco_takes_is_taken() -> None:
    """Two hyphens in a comment, a version of XML that there is not, a byte-order mark."""
    text = mujoco_file(BODY, "<!-- a -- b -->")
    assert parts_from_mjcf(f'\ufeff<?xml version="0.0"?>{text}').model.nv == 1


def test_nothing_is_written_where_the_program_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """MuJoCo writes its warnings to a file there."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MechanismError, match="mass and inertia of moving bodies"):
        parts_from_mjcf(mujoco_file(BODY.replace('mass="1.3"', 'mass="nan"')))
    assert list(tmp_path.iterdir()) == []


def test_warnings_of_mujoco_are_told() -> None:
    """Two joints about one axis without rotors: a singular mass matrix."""
    text = mujoco_file(BODY.replace("<joint", '<joint name="k"/><joint'))
    _, told = read(text)
    assert len(told) == 1
    assert told[0].startswith("the MJCF text: MuJoCo warns: Inertia matrix is too close to sing")


# Lines --------------------------------------------------------------------------------------------


@each(
    ("text", "where"),
    [
        (mujoco_file("\n" + BODY.replace('"j"', f'"j" {BAD}')), "line 2: joint 'j'"),
        (mujoco_file("\n\n" + BODY.replace('name="j"', BAD)), "line 3: joint has"),
        (
            mujoco_file(BODY, f'<default>\n<default class="x">\n<joint {BAD}/></default></default>')
            .replace("<body", "\n<body")
            .replace('"j"', '"j" class="x"'),
            "line 4: joint 'j'",
        ),
        (
            mujoco_file(
                f'\n<replicate count="2">\n{BODY.replace("<joint", f"<joint {BAD}")}'
            ).replace("</worldbody>", "</replicate></worldbody>"),
            "line 3: joint 'j0'",
        ),
        (mujoco_file(f"\n<frame>\n{BODY}</frame>").replace('"j"', f'"j" {BAD}'), "line 3: joint"),
    ],
)
def test_the_line_is_that_of_the_element(text: str, where: str, tmp_path: Path) -> None:
    with pytest.raises(MechanismError, match=f"the MJCF text, {where}.*{WHY}"):
        parts_from_mjcf(text)
    file = tmp_path / "robot.xml"
    file.write_text(text)
    with pytest.raises(MechanismError, match=rf"robot\.xml, {where}.*{WHY}"):
        parts_from_mjcf(file)


def written(folder: Path, **files: str) -> Path:
    for name, text in files.items():
        path = folder / f"{name.replace('__', '/')}.xml"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return folder / "main.xml"


def test_lines_of_included_files_are_theirs(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        main='<mujoco><include file="parts/one.xml"/></mujoco>',
        parts__one='<mujoco>\n<include file="two.xml"/></mujoco>',
        parts__two=mujoco_file("\n\n\n" + BODY.replace('"j"', f'"j" {BAD}')),
    )
    with pytest.raises(MechanismError, match=rf"two\.xml, line 4: joint 'j' has {WHY}"):
        parts_from_mjcf(path)


def test_files_of_any_suffix_are_read_with_what_they_include(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        main="""<mujoco><compiler meshdir="meshes"/><include file="parts/one.xml"/>
            <asset><model name="leg" file="parts/leg.xml"/><mesh name="t" file="t.stl"/></asset>
            <worldbody><body><joint name="k"/><geom type="mesh" mesh="t"/></body>
            <attach model="leg" prefix="left_"/></worldbody></mujoco>""",
        parts__one='<mujoco><include file="parts/two.xml"/></mujoco>',
        parts__two=mujoco_file(
            BODY.replace("</body>", '<geom type="mesh" mesh="u"/></body>'),
            '<asset><mesh name="u" file="u.stl"/></asset>',
        ),
        parts__leg=mujoco_file(BODY),
    )
    (tmp_path / "meshes").mkdir()
    corners = np.vstack([np.zeros(3), np.eye(3)])
    faces = b"".join(
        struct.pack("<12fH", 0, 0, 0, *corners[face].ravel(), 0)
        for face in ([0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2])
    )
    for mesh in ("t.stl", "u.stl"):
        (tmp_path / "meshes" / mesh).write_bytes(b"\0" * 80 + struct.pack("<I", 4) + faces)
    right = parts_from_mjcf(path)
    assert set(right.model.names) == {"universe", "j", "k", "left_j"}
    for suffix in (".mjcf", ".XML", ".txt", ""):
        other = path.with_suffix(suffix)
        other.write_text(path.read_text())
        assert parts_from_mjcf(other).model == right.model


def test_lines_of_elements_without_names_in_included_files_are_theirs(tmp_path: Path) -> None:
    two = BODY.replace(' name="j"', "") + BODY.replace(' name="j"', f" {BAD}")
    path = written(
        tmp_path,
        main=f'<mujoco><include file="one.xml"/><worldbody>\n{BODY}</worldbody></mujoco>',
        one=mujoco_file(two.replace(' name="b"', "").replace("<body", "\n<body")),
    )
    with pytest.raises(MechanismError, match=rf"one\.xml, line 3: joint has {WHY}"):
        parts_from_mjcf(path)


def test_lines_of_attached_files_are_theirs(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        main="""<mujoco><asset><model name="leg" file="leg.xml"/></asset><worldbody>
            <body name="b"><joint name="other"/><geom size="1"/></body>
            <attach model="leg" body="b" prefix="left_"/></worldbody></mujoco>""",
        leg=mujoco_file("\n\n\n\n" + BODY.replace('"j"', f'"j" {BAD}')),
    )
    with pytest.raises(MechanismError, match=rf"leg\.xml, line 5: joint 'left_j' has {WHY}"):
        parts_from_mjcf(path)


def test_a_setting_is_named_where_it_stands(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        main=mujoco_file(BODY, '<option gravity="0 0 1"/><include file="more.xml"/>'),
        more='<mujoco>\n\n<option density="3"/></mujoco>',
    )
    with pytest.raises(MechanismError, match=r"more\.xml, line 3: option has density = 3"):
        parts_from_mjcf(path)


@each(
    ("two", "why"),
    [
        (mujoco_file("<body>\n<joint axs='1'/></body>"), "attribute: 'axs' .*{}, line 2"),
        (mujoco_file("\n\n<body name='x'><joint/></body>"), "moving bodies .* 'x', .*{}, line 3"),
        (
            mujoco_file('<body>\n<joint/><geom type="mesh" mesh="q"/></body>'),
            "mesh 'q' not found in geom .*{}, line 2",
        ),
        (mujoco_file(BODY, '<equality>\n<weld body1="c"/></equality>'), "'c'.*{}, line 2"),
    ],
)
def test_mujocos_errors_have_the_line_in_the_included_file(
    two: str, why: str, tmp_path: Path
) -> None:
    path = written(tmp_path, main=INCLUDE.format("parts/two"), parts__two=two)
    with pytest.raises(MechanismError, match=why.format(r"parts/two\.xml")):
        parts_from_mjcf(path)


# MuJoCo itself ------------------------------------------------------------------------------------


def test_without_mujoco_a_sentence_names_the_extra(tmp_path: Path) -> None:
    """In a process of its own: the package itself is imported without MuJoCo."""
    path = written(tmp_path, main=mujoco_file(BODY))
    program = f"""
import sys
sys.modules["mujoco"] = None
from rps_pin import ClosedLoopModel, RPSPinError
try:
    ClosedLoopModel.from_mjcf({str(path)!r})
except RPSPinError as error:
    print(error)
"""
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert run.stdout == "MuJoCo's files are read by MuJoCo: pip install 'rps-pin[mjcf]'\n"


def test_importing_the_package_does_not_import_mujoco() -> None:
    program = "import sys, rps_pin; rps_pin.ClosedLoopModel; print('mujoco' in sys.modules)"
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert run.stdout == "False\n"


def test_the_name_is_the_models() -> None:
    assert ClosedLoopModel.from_mjcf(mujoco_file(BODY)).name == "m"


@each("asset", ['<mesh name="m" file="f"/>', '<texture name="t" type="2d" file="f"/>', None])
def test_a_fifo_is_refused_not_waited_for(asset: str | None, tmp_path: Path) -> None:
    fifo = tmp_path / "parts" / "f"
    fifo.parent.mkdir(exist_ok=True)
    fifo.unlink(missing_ok=True)
    os.mkfifo(fifo)
    inside = '<include file="parts/f"/>' if asset is None else f"<asset>{asset}</asset>"
    (tmp_path / "m.xml").write_text(
        f'<mujoco><compiler assetdir="parts"/>{inside}<worldbody><body><joint name="j"/>'
        '<geom size=".1"/></body></worldbody></mujoco>'
    )
    with pytest.raises(MechanismError, match=r"m\.xml, line 1: .*f' is not a regular file"):
        parts_from_mjcf(tmp_path / "m.xml")


def test_attached_files_of_other_suffixes(tmp_path: Path) -> None:
    """MuJoCo takes those that end in .xml; it found no decoder for the others."""
    main = """<mujoco><asset><model name="leg" file="{}"/></asset><worldbody>
        <body name="b"><joint name="other"/><geom size="1"/></body>
        <attach model="leg" body="b" prefix="left_"/></worldbody></mujoco>"""
    path = written(tmp_path, main=main.format("leg.xml"), leg=mujoco_file(BODY))
    right = parts_from_mjcf(path)
    assert "left_j" in right.model.names
    for suffix in (".mjcf", ".XML", ""):
        leg = (tmp_path / "leg.xml").with_suffix(suffix)
        leg.write_text(mujoco_file(BODY))
        for name in ("main.xml", "main.mjcf"):
            (tmp_path / name).write_text(main.format(leg.name))
            assert parts_from_mjcf(tmp_path / name).model == right.model
        (tmp_path / "scene.xml").write_text('<mujoco><include file="main.xml"/></mujoco>')
        assert parts_from_mjcf(tmp_path / "scene.xml").model == right.model
        leg.write_text(mujoco_file("\n\n\n" + BODY.replace('"j"', f'"j" {BAD}')))
        with pytest.raises(MechanismError, match=rf"leg.*, line 4: joint 'left_j' has {WHY}"):
            parts_from_mjcf(tmp_path / "main.xml")
