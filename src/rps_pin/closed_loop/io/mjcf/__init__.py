"""Mechanisms from MuJoCo's files (MJCF), read by MuJoCo's own compiler."""

from rps_pin.closed_loop.io.mjcf.reader import parts_from_mjcf

__all__ = ["parts_from_mjcf"]
