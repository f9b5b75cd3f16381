"""Trajectories of poses with exact first and second derivatives."""

from rps_pin.trajectories.helix import HelixPath, helix
from rps_pin.trajectories.path import PathSample, Trajectory

__all__ = ["HelixPath", "PathSample", "Trajectory", "helix"]
