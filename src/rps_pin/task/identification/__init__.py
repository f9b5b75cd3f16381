"""Identification: masses, inertias, friction and springs of a mechanism from logs of its forces.

`DynamicsModel` says what is unknown, `force_log` checks what was recorded, and `identify` finds the
base parameters with their covariance, and physically possible parameters beside them.
"""

from rps_pin.task.identification.base import BaseParameters
from rps_pin.task.identification.description import write_identified
from rps_pin.task.identification.exciting.excitation import ExcitingMotion, exciting_motion
from rps_pin.task.identification.exciting.fourier import FourierMotion
from rps_pin.task.identification.log import Log, force_log
from rps_pin.task.identification.log_file import read_log
from rps_pin.task.identification.model import DynamicsModel, States
from rps_pin.task.identification.physical import Possible
from rps_pin.task.identification.result import Identification, Prediction, with_parameters
from rps_pin.task.identification.solve import identify

__all__ = [
    "BaseParameters",
    "DynamicsModel",
    "ExcitingMotion",
    "FourierMotion",
    "Identification",
    "Log",
    "Possible",
    "Prediction",
    "States",
    "exciting_motion",
    "force_log",
    "identify",
    "read_log",
    "with_parameters",
    "write_identified",
]
