"""Files that are something else: each reader says what they are, in one sentence."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path

import pytest

from rps_pin import ClosedLoopModel
from rps_pin.errors import InputError
from tests.each import each

URDF = (
    '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">'
    '<parent link="a"/><child link="b"/></joint></robot>'
)
READERS: dict[str, Callable[[Path], object]] = {
    "URDF": lambda path: ClosedLoopModel.from_urdf(path, [], ["j"]),
    "MJCF": ClosedLoopModel.from_mjcf,
    "mechanism file": ClosedLoopModel.load,
    "description of example-parallel-robots": ClosedLoopModel.from_gepetto,
}
XML, YAML = ("URDF", "MJCF"), ("mechanism file", "description of example-parallel-robots")
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a21\nsize 12345\n"
PAGE = b"<!DOCTYPE html>\n<html><head><title>404 Not Found</title></head></html>"
DEEP = b'<robot name="r">' + b"<link>" * 9000 + b"</link>" * 9000 + b"</robot>"


@each(
    ("content", "readers", "told"),
    [
        (gzip.compress(URDF.encode()), (*XML, *YAML), "a gzip archive; unpack it first"),
        (b"PK\x03\x04" + bytes(90), (*XML, *YAML), "a zip archive; unpack it first"),
        (PAGE, (*XML, *YAML), "an HTML page ('404 Not Found'), as a server sends"),
        (b"\xef\xbb\xbf\n" + PAGE, (*XML, *YAML), "an HTML page ('404 Not Found')"),
        (b"<HTML><body><p>gone<br></body>", (*XML, *YAML), "an HTML page, as a server sends"),
        (b"<?xml version='1.0'?>" + b"<!-- a -->" * 90 + b"<html/>", XML, "an HTML page"),
        (b"<!-- a -->" * 900 + b"<arm/>", YAML, "XML with the root element <arm>"),
        (POINTER, (*XML, *YAML), "a pointer of Git LFS, which stands for the file; fetch"),
        (b"#usda 1.0\n", (*XML, *YAML), "a USD file; convert it with"),
        (b"\x7fELF\x02\x01" + bytes(20), (*XML, *YAML), "a program or library"),
        (b"mesh\0\1\2" + bytes(20), ("URDF",), "it is not XML; it begins with 'mesh\\x00"),
        (b"mesh\0\1\2" + bytes(20), YAML, "it has bytes of value 0"),
        (bytes(range(128, 256)), (*XML, *YAML), "not a UTF-8 text"),
        (b"", XML, "it is empty"),
        (b"\xef\xbb\xbf", XML, "it is empty"),
        (b" \n\n", XML, "it is empty"),
        (b"", YAML, "it holds nothing"),
        (b"\xef\xbb\xbf", YAML, "it holds nothing"),
        (b'{"robot": {"name": "r"}}', XML, "but JSON, as it seems"),
        (b"[1, 2]", XML, "but JSON, as it seems"),
        (b'{"robot": {"name": "r"}}', YAML, "line 1: unknown key 'robot'"),
        (b"[1, 2]", YAML, "must hold 'key: value' lines; it holds a list"),
        (b"solid bar\n", XML, "it is not XML; it begins with 'solid bar'"),
        (b"# mine\nurdf: a.urdf\n", XML, "a mechanism's description; use ClosedLoopModel.load"),
        (URDF.encode("utf-16"), ("MJCF",), "is in UTF-16 or UTF-32; MuJoCo reads UTF-8 alone"),
        (URDF.encode("utf-16"), YAML, "not a UTF-8 text"),
        (URDF.encode("utf-16-le"), YAML, "bytes of value 0, as UTF-16 has"),
        (URDF.encode("utf-16-be"), YAML, "bytes of value 0, as UTF-16 has"),
        (URDF.encode(), ("MJCF",), "a URDF; use ClosedLoopModel.from_urdf"),
        (URDF.encode(), YAML, "but XML with the root element <robot>"),
        (b"<mujoco/>", ("URDF",), "a MuJoCo file; use ClosedLoopModel.from_mjcf"),
        (b"<mujoco/>", YAML, "but XML with the root element <mujoco>"),
        (b"<sdf version='1.9'/>", XML, "an SDFormat file; convert it"),
        (b"<sdf version='1.9'/>", YAML, "but XML with the root element <sdf>"),
        (b"<robot><xacro:arm/></robot>", XML, "a xacro file (line 1: <xacro:arm)"),
        (b"<robot><xacro:arm/></robot>", YAML, "but XML with the root element <robot>"),
        (b"<svg/>", XML, "its root element is <svg>, not <"),
        (DEEP, ("URDF",), "Excessive depth in document: 256, line 1"),
        (DEEP.replace(b"robot", b"mujoco"), ("MJCF",), "is not a valid MJCF"),
        (b"[" * 500 + b"]" * 500, YAML, "is nested too deeply"),
        (b"{a: " * 9000 + b"}" * 9000, YAML, "is nested too deeply"),
    ],
)
def test_a_wrong_file_is_told(
    content: bytes, readers: tuple[str, ...], told: str, tmp_path: Path
) -> None:
    path = tmp_path / "given"
    path.write_bytes(content)
    for reader in readers:
        with pytest.raises(InputError) as caught:
            READERS[reader](path)
        said = str(caught.value)
        assert told in said, (reader, said)
        assert str(path) in said
        assert "\n" not in said


@pytest.mark.parametrize("reader", READERS)
def test_a_folder_is_told(reader: str, tmp_path: Path) -> None:
    told = "Is a directory" if reader in XML else r"is a folder without robot\.yaml"
    with pytest.raises(InputError, match=told):
        READERS[reader](tmp_path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_a_urdf_is_read_in_any_unicode(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_bytes(URDF.replace('"b"', '"bras_gelé"').encode(encoding))
    assert ClosedLoopModel.from_urdf(tmp_path / "r.urdf", [], ["j"]).model.nq == 1
