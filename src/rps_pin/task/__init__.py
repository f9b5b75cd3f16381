"""A task: the coordinates that a mechanism is for, and what they have to do with its actuators.

`Task` is where to begin: the pose of an output frame, part of it, or angles of joints. It maps
positions, velocities, accelerations, forces and gains both ways between these and the actuators,
of any mechanism, single and in batches, and `Task.compile` does so in generated code.
"""

from rps_pin.task.maps import TaskState
from rps_pin.task.polytope import Ball, Polytope
from rps_pin.task.singularity import SingularityMeasures
from rps_pin.task.task import Task

__all__ = ["Ball", "Polytope", "SingularityMeasures", "Task", "TaskState"]
