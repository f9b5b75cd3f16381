"""Calibration: a mechanism's lengths, placements and sensors from readings at poses.

`CalibrationModel` says which numbers are parameters and what is read, `readings` what was read (or
`read_readings`, of a CSV file), and `calibrate` finds the parameters that explain it best, with
their covariance. `write_calibrated` writes the mechanism with these, and `plan_poses` finds the
poses to measure; `write_plan` writes these as a file in which readings are filled in.
"""

from rps_pin.task.calibration.checks import (
    CrossValidation,
    Explained,
    by_kind,
    by_pose,
    by_sensor,
    cross_validate,
)
from rps_pin.task.calibration.description import calibrated_mechanism, write_calibrated
from rps_pin.task.calibration.information import Identifiable
from rps_pin.task.calibration.measured.instruments import BallBar, Height, Inclinometer, Tracker
from rps_pin.task.calibration.measured.instruments_file import load_instruments
from rps_pin.task.calibration.measured.measured_file import read_readings
from rps_pin.task.calibration.measured.plan_file import write_plan
from rps_pin.task.calibration.plan import (
    Plan,
    candidate_poses,
    plan_poses,
    pose_deviations,
)
from rps_pin.task.calibration.prediction import CalibrationModel, Predicted, geometric_groups
from rps_pin.task.calibration.sensors import Readings, readings
from rps_pin.task.calibration.solve import Calibration, calibrate
from rps_pin.task.calibration.words import unseen_in_words

__all__ = [
    "BallBar",
    "Calibration",
    "CalibrationModel",
    "CrossValidation",
    "Explained",
    "Height",
    "Identifiable",
    "Inclinometer",
    "Plan",
    "Predicted",
    "Readings",
    "Tracker",
    "by_kind",
    "by_pose",
    "by_sensor",
    "calibrate",
    "calibrated_mechanism",
    "candidate_poses",
    "cross_validate",
    "geometric_groups",
    "load_instruments",
    "plan_poses",
    "pose_deviations",
    "read_readings",
    "readings",
    "unseen_in_words",
    "write_calibrated",
    "write_plan",
]
