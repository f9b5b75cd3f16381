"""Text of XML files (URDF, MJCF), and its root element.

Files are data: a document type, which could declare entities, is refused, and nothing outside the
file is read.
"""

from __future__ import annotations

import codecs
import os
import re
from pathlib import Path
from typing import Any, BinaryIO

from lxml import etree

from rps_pin import bounds
from rps_pin.bounds import FOR_MORE, most
from rps_pin.errors import InputError, MechanismError
from rps_pin.files import known_format, opened

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
    (b"<\0", "utf-16-le"),
    (b"\0<", "utf-16-be"),
)
_ENCODING = re.compile(rb"<\?xml[^>]*encoding\s*=\s*[\"']([A-Za-z0-9._-]+)[\"']")
_SPACE = re.compile(r"\s*")


def absolute(path_or_xml: str | os.PathLike[str]) -> str:
    """Return an absolute path, or a text as it is."""
    given = os.fspath(path_or_xml)
    return given if is_text(given) else str(Path(given).absolute())


def is_text(path_or_xml: str | os.PathLike[str]) -> bool:
    """Return whether it is a text, which begins with ``<``, and no path."""
    return os.fspath(path_or_xml).lstrip("\ufeff").lstrip().startswith("<")


def xml_text(path_or_xml: str | os.PathLike[str], form: str) -> tuple[str, str]:
    """Return an XML text without its declaration, its lines kept; and its name for messages.

    Parameters
    ----------
    path_or_xml
        A file's path, or the text itself (which begins with ``<``).
    form
        ``"URDF"`` or ``"MJCF"``.

    Raises
    ------
    InputError
        If the file cannot be read, or is larger than `bounds.XML`.
    MechanismError
        If it is a file of another kind that is known: an archive, a web page.
    """
    if not isinstance(path_or_xml, (str, os.PathLike)):
        raise InputError(f"a {form} is given by its path or its text, not by {path_or_xml!r}")
    text = os.fspath(path_or_xml).lstrip("\ufeff")  # without a byte-order mark
    if text.lstrip().startswith("<"):
        origin = f"the {form} text"
        _refuse_known(text[:1000].encode("utf-8", "replace"), origin, form)
    else:
        origin = text
        with opened(text, form) as file:
            content = read_whole(file, origin, form)
            _refuse_known(content, origin, form)
            text = _decoded(content)
    if len(text) > (limit := most(bounds.XML)):
        raise InputError(
            f"{origin} has more than {limit} characters, the most that is read; {FOR_MORE}"
        )
    return _without_declaration(text), origin


def read_whole(file: BinaryIO, origin: str, form: str) -> bytes:
    """Return the content of an open file; `InputError` if it is larger than `bounds.XML`."""
    limit = most(bounds.XML)
    content = file.read(limit + 1)
    if len(content) > limit:
        raise InputError(
            f"the {form} {origin} has more than {limit} bytes, the most that is read; {FOR_MORE}"
        )
    return content


def _without_declaration(text: str) -> str:
    """Take out the XML declaration, also of a version that there is not, or after comments."""
    start = 0
    while True:
        space = _SPACE.match(text, start)
        start = space.end() if space else start
        if not text.startswith("<!--", start):
            break
        end = text.find("-->", start + 4)
        if end < 0:
            return text
        start = end + 3
    end = text.find("?>", start)
    if not re.match(r"<\?xml\s", text[start : start + 6]) or end < 0:
        return text
    return text[:start] + "\n" * text.count("\n", start, end) + text[end + 2 :]


def without_comments(text: str) -> str:
    """Return an XML text without its comments, lines kept."""
    first, *others = text.split("<!--")
    parts = [first]
    inside = False
    for other in others:
        comment, end, after = other.partition("-->")
        inside = not end
        parts += ["\n" * comment.count("\n"), after]
    return text if inside else "".join(parts)


def _refuse_known(content: bytes, origin: str, form: str) -> None:
    """Raise `MechanismError` if a content is of another kind that is known."""
    if what := known_format(content):
        raise MechanismError(f"{origin} is not a valid {form} but {what}")


def _decoded(content: bytes) -> str:
    """Return a file's text by its byte-order mark or declared encoding; else it is UTF-8."""
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            return content.decode(encoding)
    declared = _ENCODING.search(content[:1000])
    if declared:
        try:
            return content.decode(declared[1].decode("ascii"))
        except (LookupError, UnicodeDecodeError):
            pass  # many files declare one encoding and are in another
    return content.decode("utf-8")


def xml_root(text: str, origin: str, form: str) -> Any:
    """Return the root element of an XML text in which nothing is expanded or fetched.

    Raises
    ------
    MechanismError
        If it is not XML, or declares a document type.
    """
    content, strict = text.encode("utf-8", "surrogatepass"), parser()
    try:
        root = etree.fromstring(content, strict)
    except etree.XMLSyntaxError as error:
        if any(entry.domain != etree.ErrorDomains.NAMESPACE for entry in strict.error_log):
            why = str(error).replace(", use XML_PARSE_HUGE option", "")
            raise MechanismError(f"{origin} is not a valid {form}: {why}") from None
        # A prefix that the file does not declare, as most readers of robots do not ask for.
        root = etree.fromstring(content, parser(recover=True))
    if root.getroottree().docinfo.doctype:
        raise MechanismError(f"{origin} declares a document type, which no {form} needs: refused")
    return root


def parser(*, recover: bool = False, huge_tree: bool = False) -> etree.XMLParser:
    """Return a parser of UTF-8 that expands and fetches nothing."""
    return etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        encoding="utf-8",
        recover=recover,
        huge_tree=huge_tree,
    )
