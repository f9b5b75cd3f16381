"""Open trees from files. A file is data: nothing in it is executed, no entity of it is expanded."""

from __future__ import annotations

import os
from pathlib import Path

import pinocchio as pin

from rps_pin.errors import InputError, MechanismError


def model_from_urdf(path_or_xml: str | os.PathLike[str]) -> pin.Model:
    """Return the open tree of a URDF: a file's path, or its text (which begins with ``<``).

    Raises
    ------
    InputError
        If the file cannot be read.
    MechanismError
        If it is no URDF.
    """
    text = os.fspath(path_or_xml)
    origin = "the URDF text"
    if not text.lstrip().startswith("<"):
        origin = text
        try:
            text = Path(text).read_text("utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or "not a UTF-8 text"
            raise InputError(f"cannot read the URDF {origin}: {reason}") from None
    try:
        return pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        raise MechanismError(f"{origin} is not a valid URDF: {error}") from None
