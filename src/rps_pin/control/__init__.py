"""Control of the 3-RPS, and of any mechanism with a task: a status in each tick, no exceptions.

- `loop`: the laws `ComputedTorque` and `PDControl` with `Gains`, `PacedTrajectory`, `LoopClock`;
  `DriveControl`: commands of drives that take positions or speeds
- `estimator`: `RealTimeRobot`, state estimate and inverse dynamics for other laws; `any_task`:
  `TaskEstimate`, that of a task
- `loop_margins`: stability margins for the tuning
- `simulation`: `Plant` with `Encoders`, `ServoDrives`, `wrong_parameters` and `Fault`; `run_loop`
  gives a `LoopRun`, `LoopSummary` its figures; `load_scenario` reads YAML files

The robot itself is in `rps_pin.rps`; `rps_pin.viewer.server.live_view` displays a running loop.
"""

from rps_pin.control.any_task.estimate import TaskEstimate
from rps_pin.control.drive_control import DriveControl
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
from rps_pin.control.simulation.loop_summary import LoopSummary, TaskSummary
from rps_pin.control.simulation.plant import Plant
from rps_pin.control.simulation.scenario import load_scenario
from rps_pin.control.simulation.servo_drives import ServoDrives
from rps_pin.control.simulation.wrong_parameters import wrong_parameters

__all__ = [
    "Answers",
    "ComputedTorque",
    "Controller",
    "DriveControl",
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
    "ServoDrives",
    "Status",
    "TaskEstimate",
    "TaskSummary",
    "effective_inertia",
    "load_scenario",
    "loop_margins",
    "run_loop",
    "write_loop_csv",
    "wrong_parameters",
]
