"""Stiffness: how a mechanism with a task gives way under loads, and how it vibrates.

`Compliances` says what gives way: drives, bearings of joints and closures, and beams in links;
`load_compliances` reads it from a file. `StiffnessModel` has it as springs in the mechanism's tree,
and `Deflection` is what comes out: the output's displacement and compliance, reactions, and
frequencies; `stiffness_map` has these over a workspace, `write_map` writes them.
"""

from rps_pin.task.stiffness.beams import Beam, Material, Section
from rps_pin.task.stiffness.compliances import Compliances
from rps_pin.task.stiffness.deflection import Deflection
from rps_pin.task.stiffness.file import load_compliances
from rps_pin.task.stiffness.maps import StiffnessMap, stiffness_map, write_map
from rps_pin.task.stiffness.model import StiffnessModel

__all__ = [
    "Beam",
    "Compliances",
    "Deflection",
    "Material",
    "Section",
    "StiffnessMap",
    "StiffnessModel",
    "load_compliances",
    "stiffness_map",
    "write_map",
]
