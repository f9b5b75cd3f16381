"""Open trees from URDF files, and the text of URDF and MJCF files.

Files are data: a document type, which could declare entities, is refused, and nothing outside the
file is read.
"""

from __future__ import annotations

import os
from typing import Any

import pinocchio as pin
from lxml import etree

from rps_pin.closed_loop.io.parts import MechanismParts
from rps_pin.closed_loop.io.urdf_check import refuse_mistakes
from rps_pin.errors import InputError, MechanismError
from rps_pin.files import opened
from rps_pin.validation import choice

#: Whether the root link of a tree is fixed in the world.
ROOTS = ("fixed", "free")


def model_from_urdf(path_or_xml: str | os.PathLike[str], root: str = "fixed") -> pin.Model:
    """Return the open tree of a URDF: a file's path, or its text (which begins with ``<``).

    Parameters
    ----------
    path_or_xml
        The file, or its text.
    root
        ``"fixed"``: the root link is fixed in the world. ``"free"``: it is on a free-flyer joint
        called ``"root_joint"``.

    Raises
    ------
    InputError
        If the file cannot be read, or the root is neither of the two.
    MechanismError
        If it is not a valid URDF; with the line.
    """
    choice(root, "root", ROOTS)
    text, origin = xml_text(path_or_xml, "URDF")
    refuse_mistakes(xml_root(text, origin, "URDF"), origin)
    try:
        if root == "free":
            return pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
        return pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        raise MechanismError(f"{origin} is not a valid URDF: {error}") from None


def parts_from_urdf(path_or_xml: str | os.PathLike[str], root: str = "fixed") -> MechanismParts:
    """Return the open tree of a URDF with the damping and dry friction of its joints.

    Parameters and errors are those of `model_from_urdf`.
    """
    model = model_from_urdf(path_or_xml, root)
    joints = list(zip(model.names, model.idx_vs, strict=True))[1:]
    damping, friction = (
        {name: float(values[index]) for name, index in joints if values[index]}
        for values in (model.damping, model.upperDryFrictionLimit)
    )
    return MechanismParts(model, name=model.name, damping=damping, friction=friction)


def xml_text(path_or_xml: str | os.PathLike[str], form: str) -> tuple[str, str]:
    """Return an XML text and its name for messages.

    Parameters
    ----------
    path_or_xml
        A file's path, or the text itself (which begins with ``<``).
    form
        ``"URDF"`` or ``"MJCF"``.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    if not isinstance(path_or_xml, (str, os.PathLike)):
        raise InputError(f"a {form} is given by its path or its text, not by {path_or_xml!r}")
    text = os.fspath(path_or_xml).lstrip("\ufeff")  # without a byte-order mark
    if text.lstrip().startswith("<"):
        return text.strip(), f"the {form} text"
    with opened(text, form) as file:
        return file.read().decode("utf-8-sig").strip(), text


def xml_root(text: str, origin: str, form: str) -> Any:
    """Return the root element of an XML text in which nothing is expanded or fetched.

    Raises
    ------
    MechanismError
        If it is not XML, or declares a document type.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    try:
        root = etree.fromstring(text.encode(), parser)
    except etree.XMLSyntaxError as error:
        raise MechanismError(f"{origin} is not a valid {form}: {error}") from None
    if root.getroottree().docinfo.doctype:
        raise MechanismError(f"{origin} declares a document type, which no {form} needs: refused")
    return root
