"""Files of shapes and pictures that are missing or cannot be read, and give no mass."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rps_pin import MechanismError
from rps_pin.closed_loop.io.mjcf import parts_from_mjcf
from tests.closed_loop.io.mjcf.twin import INERTIAL, mujoco_file, read
from tests.each import each

SPHERE = '<geom size="0.1"/>'
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
ASSETS = """<asset>
    <mesh name="q" file="q.obj"/>
    <texture name="t" type="2d" file="t.png"/><material name="m" texture="t"/>
    <hfield name="h" file="h.png" size="1 1 1 1"/></asset>"""
SHAPE = '<geom name="shape" type="mesh" mesh="q" {} material="m"/>'


def file(inside: str, *others: str, still: str = "") -> str:
    return mujoco_file(f'{still}<body name="b"><joint name="j"/>{inside}</body>', ASSETS, *others)


def only(groups: str) -> str:
    return f'<compiler inertiagrouprange="{groups}"/>'


WITHOUT_MASS = {
    "inertial": file(INERTIAL + SHAPE.format("")),
    "in a frame": file(INERTIAL + f'<frame pos="1 0 0">{SHAPE.format("")}</frame>'),
    "material": file('<geom size="0.1" material="m"/><site material="m"/>'),
    "mass 0": file(SPHERE + SHAPE.format('mass="0"')),
    "density 0": file(SPHERE + SHAPE.format('density="0"')),
    "group": file(SPHERE + SHAPE.format('group="3"'), only("0 2")),
    "never by shapes": file(
        INERTIAL + SHAPE.format('mass="3"'), '<compiler inertiafromgeom="false"/>'
    ),
    "body that cannot move": file(INERTIAL, still=f"<body>{SHAPE.format('')}</body>"),
    "height field": file(INERTIAL, still='<geom type="hfield" hfield="h"/>'),
    "named by others": file(
        INERTIAL + SHAPE.format("") + '<geom name="o" size="0.1"/>',
        '<contact><pair geom1="shape" geom2="o"/></contact>',
        '<sensor><distance geom1="shape" geom2="o"/></sensor>',
    ),
}
WITH_MASS = {
    "density": file(SPHERE + SHAPE.format("")),
    "mass": file(SPHERE + SHAPE.format('mass="2"')),
    "group": file(SPHERE + SHAPE.format('group="2"'), only("0 2")),
    "always by shapes": file(INERTIAL + SHAPE.format(""), '<compiler inertiafromgeom="true"/>'),
    "fitted box": file('<geom type="box" mesh="q"/>'),
    "part of a body that moves": file(f"{SPHERE}<body>{SHAPE.format('')}</body>"),
    "all masses together": file(
        SPHERE, '<compiler settotalmass="3"/>', still=f"<body>{SHAPE.format('')}</body>"
    ),
}


def written(folder: Path, text: str, **files: str | bytes) -> Path:
    for name, content in files.items():
        data = content if isinstance(content, bytes) else content.encode()
        (folder / name.replace("_", ".")).write_bytes(data)
    (folder / "robot.xml").write_text(text)
    return folder / "robot.xml"


def without_pictures(text: str) -> str:
    return text.replace(' file="h.png"', ' nrow="2" ncol="2"').replace(' file="t.png"', BUILTIN)


BUILTIN = ' builtin="flat" width="2" height="2"'


@each("text", WITHOUT_MASS.values(), ids=WITHOUT_MASS)
@each("mesh", [None, "hello", b"\xff\x00", ""], ids=["missing", "text", "bytes", "empty"])
def test_shapes_that_give_no_mass_need_no_file(
    text: str, mesh: str | bytes | None, tmp_path: Path
) -> None:
    right = parts_from_mjcf(written(tmp_path, without_pictures(text), q_obj=TETRAHEDRON))
    path = written(tmp_path, text) if mesh is None else written(tmp_path, text, q_obj=mesh)
    if mesh is None:
        (tmp_path / "q.obj").unlink()
    parts, told = read(path)
    assert parts.model == right.model
    np.testing.assert_array_equal(parts.home, right.home)
    assert len(told) == 1
    assert told[0].startswith(f"{path}: MuJoCo: Error")
    assert "line 2" in told[0] or "line 3" in told[0]
    assert told[0].endswith("textures, sensors, and shapes that give no mass are left out")


@each("text", WITH_MASS.values(), ids=WITH_MASS)
def test_shapes_that_give_mass_need_their_file(text: str, tmp_path: Path) -> None:
    text = without_pictures(text)
    assert read(written(tmp_path, text, q_obj=TETRAHEDRON))[0].model.nv == 1
    (tmp_path / "q.obj").unlink()
    with pytest.raises(MechanismError, match=r"Error opening file .*q\.obj' \(.*robot\.xml, line"):
        parts_from_mjcf(tmp_path / "robot.xml")


def test_a_picture_that_is_there_is_not_mentioned(tmp_path: Path) -> None:
    text = file(INERTIAL + SHAPE.format(""))
    parts, told = read(written(tmp_path, without_pictures(text), q_obj=TETRAHEDRON))
    assert parts.model.nv == 1 and told == []


def test_shapes_of_attached_and_included_files_too(tmp_path: Path) -> None:
    leg = file(INERTIAL + SHAPE.format(""))
    (tmp_path / "leg.xml").write_text(leg)
    for main in (
        '<mujoco><include file="leg.xml"/></mujoco>',
        '<mujoco><asset><model name="leg" file="leg.xml"/></asset><worldbody>'
        '<attach model="leg" prefix="left_"/></worldbody></mujoco>',
    ):
        parts, told = read(written(tmp_path, main))
        assert parts.model.nv == 1 and parts.model.inertias[1].mass == 1.3
        assert len(told) == 1
        assert "leg.xml, line 2" in told[0]
