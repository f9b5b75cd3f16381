"""Files of other formats, recognised by their contents, with the way to what is read."""

from __future__ import annotations

import re

from rps_pin.closed_loop.io.xml_file import without_comments
from rps_pin.errors import MechanismError

_XACRO_ELEMENT = re.compile(r"<xacro:\w+")
_XACRO_VALUE = re.compile(r"\$\{[^}$]*\}|\$\((?:find|arg|env|optenv|eval|dirname)\b[^)$]*\)")
_ROOT = re.compile(r"<([A-Za-z_][\w:.-]*)")
_DESCRIPTION = re.compile(r"^(urdf|mjcf|closed_loop|name_mot):", re.MULTILINE)
#: The root element of what is read.
_OWN = {"URDF": "robot", "MJCF": "mujoco"}
_KINDS = {
    "sdf": "an SDFormat file; convert it, for example with 'sdformat_urdf' or Gazebo's "
    "'gz sdf', or give its tree as a URDF and its loops as closures of a description",
    "gazebo": "an old SDFormat file; convert it with 'gz sdf -p' and write its tree as a URDF",
    "world": "a Gazebo world; give the URDF of its robot",
    "robot": "a URDF; use ClosedLoopModel.from_urdf, the suffix .urdf, or urdf: in a description",
    "mujoco": "a MuJoCo file; use ClosedLoopModel.from_mjcf, the suffix .xml, or mjcf: in a "
    "description",
    "mujocoinclude": "a part of a MuJoCo file; read the file that includes it, with from_mjcf",
    "COLLADA": "a COLLADA file, which has shapes, not a robot",
    "OpenRAVE": "an OpenRAVE file; convert it to URDF",
    "Robot": "an OpenRAVE file; convert it to URDF",
    "package": "a ROS package's manifest; the URDF is in its folder urdf, most often",
    "launch": "a ROS launch file; give the URDF that it names",
}


def refuse_other_formats(text: str, origin: str, form: str) -> None:
    """Raise `MechanismError` if a text is not of a format but of another one.

    Parameters
    ----------
    text, origin
        The text, and its name for messages.
    form
        ``"URDF"`` or ``"MJCF"``.
    """
    invalid, start = f"{origin} is not a valid {form}", text.lstrip("\ufeff \t\r\n")
    if not start.startswith("<"):
        raise MechanismError(f"{invalid}{_no_xml(start)}")
    plain = without_comments(text)
    root = _ROOT.search(plain)
    tag, own = root[1] if root else "", _OWN[form]
    if tag in ("robot", own):
        for pattern in (_XACRO_ELEMENT, _XACRO_VALUE):
            if found := pattern.search(plain):
                line = plain.count("\n", 0, found.start()) + 1
                raise MechanismError(
                    f"{invalid} but a xacro file (line {line}: {found[0]}); expand it first: "
                    "'xacro FILE.xacro > FILE.urdf' (from ROS, or 'pip install xacro')"
                )
    if tag in _KINDS and tag != own:
        raise MechanismError(f"{invalid} but {_KINDS[tag]}")
    if tag and tag != own:
        raise MechanismError(f"{invalid}: its root element is <{tag}>, not <{own}>")


def _no_xml(text: str) -> str:
    """Return what to say of a text that does not begin as XML does."""
    if not text:
        return ": it is empty"
    if text[0] in "{[":
        return " but JSON, as it seems"
    if _DESCRIPTION.search(text):
        return " but a mechanism's description; use ClosedLoopModel.load, the suffix .yaml"
    return f": it is not XML; it begins with {text.splitlines()[0][:40]!r}"
