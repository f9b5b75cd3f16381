"""Speed profiles, under the name they had; see `rps_pin.task.motion.speed_profile`."""

from rps_pin.task.motion.speed_profile import SpeedProfile

__all__ = ["SpeedProfile"]
