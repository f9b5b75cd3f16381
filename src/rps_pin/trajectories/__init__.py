"""Trajectories of poses with exact first and second derivatives."""

from rps_pin.trajectories.curve import Curve, CurveSample, LawSample, TimedCurve, TimeLaw
from rps_pin.trajectories.helix import HelixPath, helix
from rps_pin.trajectories.path import PathSample, Trajectory

__all__ = [
    "Curve",
    "CurveSample",
    "HelixPath",
    "LawSample",
    "PathSample",
    "TimeLaw",
    "TimedCurve",
    "Trajectory",
    "helix",
]
