"""Files of other formats, recognised by their contents, with the way to a URDF."""

from __future__ import annotations

import re

from rps_pin.closed_loop.io.xml_file import BINARY_USD
from rps_pin.errors import MechanismError

_XACRO_ELEMENT = re.compile(r"<xacro:\w+")
_XACRO_VALUE = re.compile(r"\$\{[^}]*\}|\$\((?:find|arg|env|optenv|eval|dirname)\b[^)]*\)")
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_ROOT = re.compile(r"<([A-Za-z_][\w:.-]*)")
_KINDS = {
    "sdf": "an SDFormat file; convert it, for example with 'sdformat_urdf' or Gazebo's "
    "'gz sdf', or give its tree as a URDF and its loops as closures of a description",
    "gazebo": "an old SDFormat file; convert it with 'gz sdf -p' and write its tree as a URDF",
    "world": "a Gazebo world; give the URDF of its robot",
    "mujoco": "a MuJoCo file; use ClosedLoopModel.from_mjcf, the suffix .xml, or mjcf: in a "
    "description",
    "mujocoinclude": "a part of a MuJoCo file; read the file that includes it, with from_mjcf",
    "COLLADA": "a COLLADA file, which has shapes, not a robot",
    "OpenRAVE": "an OpenRAVE file; convert it to URDF",
    "Robot": "an OpenRAVE file; convert it to URDF",
    "package": "a ROS package's manifest; the URDF is in its folder urdf, most often",
    "launch": "a ROS launch file; give the URDF that it names",
}


def refuse_other_formats(text: str, origin: str) -> None:
    """Raise `MechanismError` if a text is not a URDF but a file of another kind that is known."""
    start = text.lstrip()
    if start.startswith(("#usda", BINARY_USD.decode())):
        raise MechanismError(
            f"{origin} is a USD file, not a URDF; convert it with Isaac Sim's URDF exporter"
        )
    plain = _COMMENT.sub(lambda found: "\n" * found[0].count("\n"), text)
    root = _ROOT.search(plain)
    tag = root[1] if root else ""
    if tag in _KINDS:
        raise MechanismError(f"{origin} is not a valid URDF but {_KINDS[tag]}")
    for pattern in (_XACRO_ELEMENT, _XACRO_VALUE):
        if found := pattern.search(plain):
            line = plain.count("\n", 0, found.start()) + 1
            raise MechanismError(
                f"{origin} is not a valid URDF but a xacro file (line {line}: {found[0]}); expand "
                "it first: 'xacro FILE.xacro > FILE.urdf' (from ROS, or 'pip install xacro')"
            )
    if tag and tag != "robot":
        raise MechanismError(
            f"{origin} is not a valid URDF: its root element is <{tag}>, not <robot>"
        )
