"""The 3-RPS in a control loop: no exceptions, no allocation that grows, a status every tick.

- In the loop: `RealTimeRobot` for laws of one's own; `ComputedTorque`, `PDControl` with `Gains`;
  `PacedTrajectory` for targets that wait; `LoopClock` for the rate; `loop_margins` for the tuning.
- Beside it, for trying: `Plant` with `Encoders`, `wrong_parameters` and `Fault`; `run_loop`, which
  gives a `LoopRun`, and `LoopSummary` of it; `load_scenario` for YAML files.

What the robot is stands in `rps_pin.rps`; `rps_pin.viewer.server.live_view` shows a running loop.
"""

from rps_pin.control.estimator.effective_inertia import effective_inertia
from rps_pin.control.estimator.output_arrays import Answers
from rps_pin.control.estimator.real_time_robot import RealTimeRobot
from rps_pin.control.loop.clock import LoopClock
from rps_pin.control.loop.computed_torque import ComputedTorque
from rps_pin.control.loop.controller import Controller
from rps_pin.control.loop.gains import Gains
from rps_pin.control.loop.paced_trajectory import PacedTrajectory
from rps_pin.control.loop.pd_control import PDControl
from rps_pin.control.loop.status import Status
from rps_pin.control.margins import loop_margins
from rps_pin.control.simulation.encoders import Encoders
from rps_pin.control.simulation.faults import Fault
from rps_pin.control.simulation.loop_run import LoopRun, run_loop, write_loop_csv
from rps_pin.control.simulation.loop_summary import LoopSummary
from rps_pin.control.simulation.plant import Plant
from rps_pin.control.simulation.scenario import load_scenario
from rps_pin.control.simulation.wrong_parameters import wrong_parameters

__all__ = [
    "Answers",
    "ComputedTorque",
    "Controller",
    "Encoders",
    "Fault",
    "Gains",
    "LoopClock",
    "LoopRun",
    "LoopSummary",
    "PDControl",
    "PacedTrajectory",
    "Plant",
    "RealTimeRobot",
    "Status",
    "effective_inertia",
    "load_scenario",
    "loop_margins",
    "run_loop",
    "write_loop_csv",
    "wrong_parameters",
]
