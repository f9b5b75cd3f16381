"""Trajectories of poses with exact first and second derivatives.

Each has a ``duration`` and a ``sample(t)``. They are made by `point_to_point`, `spline`, `read_csv`
and `pose_path` for the coordinates of any task, and by `helix`, `circle` and `lissajous` for the
3-RPS, or of a curve and a law of time. Whether a mechanism can follow one, how fast, and with which
forces: see `rps_pin.task` and `rps_pin.rps`.
"""

from rps_pin.trajectories.csv_file import read_csv
from rps_pin.trajectories.curve import Curve, CurveSample, LawSample, TimedCurve, TimeLaw
from rps_pin.trajectories.helix import HelixCurve, HelixPath, helix
from rps_pin.trajectories.orientation.pose_path import PoseCurve, PosePath, pose_path
from rps_pin.trajectories.orientation.rotation_curve import RotationCurve
from rps_pin.trajectories.path import PathSample, Trajectory, end_states
from rps_pin.trajectories.point_to_point import LineCurve, point_to_point
from rps_pin.trajectories.sampled_path import SampledPath
from rps_pin.trajectories.spline import ChordSpline, TimedSpline, spline
from rps_pin.trajectories.tilt_figures import HarmonicCurve, circle, lissajous
from rps_pin.trajectories.time_laws import QuinticLaw, SCurveLaw, TrapezoidalLaw

__all__ = [
    "ChordSpline",
    "Curve",
    "CurveSample",
    "HarmonicCurve",
    "HelixCurve",
    "HelixPath",
    "LawSample",
    "LineCurve",
    "PathSample",
    "PoseCurve",
    "PosePath",
    "QuinticLaw",
    "RotationCurve",
    "SCurveLaw",
    "SampledPath",
    "TimeLaw",
    "TimedCurve",
    "TimedSpline",
    "Trajectory",
    "TrapezoidalLaw",
    "circle",
    "end_states",
    "helix",
    "lissajous",
    "point_to_point",
    "pose_path",
    "read_csv",
    "spline",
]
