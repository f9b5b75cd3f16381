"""The convex program, under the name it had; see `rps_pin.task.motion.fastest_profile`."""

from rps_pin.task.motion.fastest_profile import ProfileLimits, fastest_profile

__all__ = ["ProfileLimits", "fastest_profile"]
