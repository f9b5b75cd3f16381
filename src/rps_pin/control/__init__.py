"""The 3-RPS in a control loop: no exceptions, no allocation that grows, a status every tick."""

from rps_pin.control.answers import Answers
from rps_pin.control.computed_torque import ComputedTorque
from rps_pin.control.controller import Controller
from rps_pin.control.gains import Gains
from rps_pin.control.pd_control import PDControl
from rps_pin.control.real_time import RealTimeRobot
from rps_pin.control.reduced_mass import effective_inertia
from rps_pin.control.status import Status

__all__ = [
    "Answers",
    "ComputedTorque",
    "Controller",
    "Gains",
    "PDControl",
    "RealTimeRobot",
    "Status",
    "effective_inertia",
]
