"""Open trees from files, which are data: nothing in them is run, expanded or fetched."""

from __future__ import annotations

from pathlib import Path

import pytest

from rps_pin import InputError, MechanismError
from rps_pin.closed_loop.io.urdf import model_from_urdf
from tests.closed_loop.mechanisms import FOUR_BAR, build


def test_urdf_is_read_from_paths_and_from_text(tmp_path: Path) -> None:
    file = tmp_path / "four_bar.urdf"
    file.write_text(FOUR_BAR.urdf())
    for source in (FOUR_BAR.urdf(), "\n  " + FOUR_BAR.urdf(), file, str(file)):
        assert build(path_or_xml=source).model.nv == 4
    assert build(path_or_xml='<?xml version="1.0"?>\n' + FOUR_BAR.urdf()).model.nv == 4


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot read the URDF .*none\.urdf: No such file"):
        build(path_or_xml=tmp_path / "none.urdf")
    with pytest.raises(InputError, match=r"cannot read the URDF .*directory"):
        build(path_or_xml=tmp_path)
    (tmp_path / "binary.urdf").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"binary\.urdf: not a UTF-8 text"):
        build(path_or_xml=str(tmp_path / "binary.urdf"))


@pytest.mark.parametrize(
    "text",
    [
        "<robot",
        "<robot name='r'><link name='a'></robot>",
        "<html><body/></html>",
        "<robot name='r'/>",
        FOUR_BAR.urdf()[:-20],
        FOUR_BAR.urdf().replace('child link="knee"', 'child link="nowhere"'),
    ],
)
def test_text_that_is_no_urdf_is_refused(text: str, tmp_path: Path) -> None:
    with pytest.raises(MechanismError, match="the URDF text is not a valid URDF"):
        build(path_or_xml=text)
    (tmp_path / "bad.urdf").write_text(text)
    with pytest.raises(MechanismError, match=r"bad\.urdf is not a valid URDF"):
        build(path_or_xml=tmp_path / "bad.urdf")


@pytest.mark.parametrize("bad", ["heavy", "", "nan", "inf"])
def test_masses_that_are_no_numbers_are_refused(bad: str) -> None:
    """Not dropped, which would leave a robot that looks right and weighs less."""
    with pytest.raises(InputError):
        build(path_or_xml=FOUR_BAR.urdf().replace('mass value="1.1"', f'mass value="{bad}"'))


def with_entities(declarations: str, name: str) -> str:
    """The four-bar, its robot named by an entity."""
    text = FOUR_BAR.urdf().replace('name="mechanism"', f'name="{name}"')
    return f'<?xml version="1.0"?><!DOCTYPE robot [{declarations}]>{text}'


def names_in(text: str) -> str:
    """Everything that a reader could learn from building the model."""
    try:
        model = build(path_or_xml=text).model
    except MechanismError as error:
        return str(error)
    return " ".join([model.name, *model.names, *(frame.name for frame in model.frames)])


def test_entities_are_not_expanded() -> None:
    """Neither one, nor the billion that ten levels of ten make."""
    assert "laughter" not in names_in(with_entities('<!ENTITY ha "laughter">', "&ha;"))
    levels = '<!ENTITY a0 "laughter">'
    for level in range(1, 10):
        levels += f'<!ENTITY a{level} "{f"&a{level - 1};" * 10}">'
    assert len(names_in(with_entities(levels, "&a9;"))) < 100_000


def test_external_entities_are_not_read(tmp_path: Path) -> None:
    secret = tmp_path / "secret.txt"
    secret.write_text("swordfish")
    for declaration in (
        f'<!ENTITY leak SYSTEM "{secret.as_uri()}">',
        f'<!ENTITY leak SYSTEM "{secret}">',
    ):
        assert "swordfish" not in names_in(with_entities(declaration, "&leak;"))
        inside = FOUR_BAR.urdf().replace("</robot>", "&leak;</robot>")
        text = f"<?xml version='1.0'?><!DOCTYPE robot [{declaration}]>{inside}"
        assert "swordfish" not in names_in(text)


def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    text = "\ufeff" + FOUR_BAR.urdf()
    assert build(path_or_xml=text).model.nv == build().model.nv
    (tmp_path / "marked.urdf").write_text(text, "utf-8")
    assert build(path_or_xml=tmp_path / "marked.urdf").model.nv == build().model.nv


@pytest.mark.parametrize("bad", [None, 3, "a\0b"])
def test_what_is_neither_path_nor_text_is_refused(bad: object) -> None:
    with pytest.raises(InputError, match="URDF"):
        build(path_or_xml=bad)


def test_a_document_type_is_refused_even_where_it_is_not_used() -> None:
    with pytest.raises(MechanismError, match="document type"):
        build(path_or_xml=f"<!DOCTYPE robot []>{FOUR_BAR.urdf()}")


def test_a_bad_number_is_told_with_its_line() -> None:
    lines = FOUR_BAR.urdf().replace("><", ">\n<").replace('mass value="1.1"', 'mass value="1,1"')
    number = next(i for i, line in enumerate(lines.splitlines(), 1) if "1,1" in line)
    with pytest.raises(MechanismError, match=rf"line {number}: mass value = '1,1'"):
        build(path_or_xml=lines)


def test_the_root_can_float() -> None:
    fixed, free = (model_from_urdf(FOUR_BAR.urdf(), root) for root in ("fixed", "free"))
    assert (fixed.nv, free.nv) == (4, 10)
    assert list(free.names) == ["universe", "root_joint", *list(fixed.names)[1:]]
    with pytest.raises(InputError, match="root = 'loose': it must be 'fixed' or 'free'"):
        model_from_urdf(FOUR_BAR.urdf(), "loose")
