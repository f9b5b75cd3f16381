"""The 3-RPS in a control loop: no exceptions, no allocation that grows, a status every tick."""

from rps_pin.control.answers import Answers
from rps_pin.control.real_time import RealTimeRobot
from rps_pin.control.status import Status

__all__ = ["Answers", "RealTimeRobot", "Status"]
