"""Open trees from URDF files.

A file is data: it is refused if it declares a document type (nothing in a URDF needs one, and
entities are declared there), and read without reaching for anything outside itself.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

import pinocchio as pin
from lxml import etree

from rps_pin.errors import InputError, MechanismError

#: Attributes that hold numbers. Pinocchio's parser only prints a complaint about a bad one, and
#: goes on without the element.
_NUMBERS = {
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "limit": ("lower", "upper", "effort", "velocity"),
}


def model_from_urdf(path_or_xml: str | os.PathLike[str]) -> pin.Model:
    """Return the open tree of a URDF: a file's path, or its text (which begins with ``<``).

    Raises
    ------
    InputError
        If the file cannot be read.
    MechanismError
        If it is no URDF; with the line where that shows.
    """
    if not isinstance(path_or_xml, (str, os.PathLike)):
        raise InputError(f"a URDF is given by its path or its text, not by {path_or_xml!r}")
    text = os.fspath(path_or_xml).lstrip("\ufeff")  # a byte-order mark is no part of the text
    origin = "the URDF text"
    if not text.lstrip().startswith("<"):
        origin = text
        try:
            text = Path(text).read_text("utf-8-sig")
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "not a UTF-8 text"
            raise InputError(f"cannot read the URDF {origin}: {reason}") from None
    _check(text, origin)
    try:
        return pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        raise MechanismError(f"{origin} is not a valid URDF: {error}") from None


def _check(text: str, origin: str) -> None:
    """Refuse what is no XML, declares entities, or has something else where numbers belong."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    try:
        root = etree.fromstring(text.strip().encode(), parser)
    except etree.XMLSyntaxError as error:
        raise MechanismError(f"{origin} is not a valid URDF: {error}") from None
    if root.getroottree().docinfo.doctype:
        raise MechanismError(f"{origin} declares a document type, which no URDF needs: refused")
    for element in root.iter(*_NUMBERS):
        for attribute in _NUMBERS[str(element.tag)]:
            for part in element.get(attribute, "0").split() or [""]:
                if not _is_finite(part):
                    raise MechanismError(
                        f"{origin}, line {element.sourceline}: {element.tag} {attribute} = "
                        f"{element.get(attribute)!r} must be finite numbers"
                    )


def _is_finite(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
