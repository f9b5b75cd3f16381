"""What a file is that was taken for another: told by how it begins."""

from __future__ import annotations

import re

_USD = "a USD file; convert it with Isaac Sim's URDF exporter"
_BEGINNINGS: tuple[tuple[bytes, str], ...] = (
    (b"\x1f\x8b", "a gzip archive; unpack it first"),
    (b"PK\x03\x04", "a zip archive; unpack it first"),
    (b"BZh", "a bzip2 archive; unpack it first"),
    (b"\xfd7zXZ\0", "an xz archive; unpack it first"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive; unpack it first"),
    (b"\x89HDF", "an HDF5 file"),
    (b"\x89PNG", "a PNG image"),
    (b"%PDF", "a PDF"),
    (b"\x7fELF", "a program or library"),
    (b"PXR-USDC", _USD),
    (b"#usda", _USD),
    (
        b"version https://git-lfs.github.com/spec/",
        "a pointer of Git LFS, which stands for the file; fetch the file with 'git lfs pull'",
    ),
)
_BEFORE_ROOT = re.compile(rb"<!--.*?-->|<\?[^>]*\?>", re.DOTALL)
_HTML = re.compile(rb"\s*<(!doctype\s+html|html)\b", re.I)
_ROOT = re.compile(rb"\s*<([A-Za-z_][\w:.-]*)")
_TITLE = re.compile(rb"<title[^>]*>\s*([^<]{1,80}?)\s*</title>", re.I)
#: Bytes that are looked at.
_ENOUGH = 10000
_MARK = b"\xef\xbb\xbf"


def known_format(content: bytes) -> str:
    """Return what a file is that no reader of robots takes, with its article; or nothing.

    Parameters
    ----------
    content
        The file's content, or its first bytes.
    """
    start = _start(content)
    for beginning, what in _BEGINNINGS:
        if start.startswith(beginning):
            return what
    if _HTML.match(_BEFORE_ROOT.sub(b"", start)):
        title = _TITLE.search(start)
        named = f" ({title[1].decode('utf-8', 'replace')!r})" if title else ""
        return f"an HTML page{named}, as a server sends in place of a file"
    return ""


def xml_root_tag(content: bytes) -> str:
    """Return the tag of the root element if a file begins as XML, or nothing."""
    root = _ROOT.match(_BEFORE_ROOT.sub(b"", _start(content)))
    return root[1].decode() if root and b"\0" not in content else ""


def _start(content: bytes) -> bytes:
    return content[:_ENOUGH].removeprefix(_MARK).lstrip()
