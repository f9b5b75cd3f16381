"""Calibration: a mechanism's lengths, placements and sensors from readings at poses.

`CalibrationModel` says which numbers are parameters and what is read, `readings` what was read, and
`calibrate` finds the parameters that explain it best, with their covariance.
"""

from rps_pin.task.calibration.information import Identifiable
from rps_pin.task.calibration.prediction import CalibrationModel, Predicted
from rps_pin.task.calibration.sensors import Readings, readings
from rps_pin.task.calibration.solve import Calibration, calibrate

__all__ = [
    "Calibration",
    "CalibrationModel",
    "Identifiable",
    "Predicted",
    "Readings",
    "calibrate",
    "readings",
]
