"""The workspace of any mechanism with a task: which points it reaches, and why not the others.

`workspace` computes it on a `task_grid` in two to six of the task's coordinates, in one assembly
mode that is followed from a start; the result says of each point whether it is inside, or why not,
and carries fields over the grid. The 3-RPS has a faster way of its own in `rps_pin.rps.workspace`.
"""

from rps_pin.task.workspace.compute import workspace
from rps_pin.task.workspace.evaluate import TaskFields
from rps_pin.task.workspace.grids import TaskGrid, task_grid
from rps_pin.task.workspace.result import TaskWorkspace
from rps_pin.task.workspace.volume import TaskVolume, volume

__all__ = [
    "TaskFields",
    "TaskGrid",
    "TaskVolume",
    "TaskWorkspace",
    "task_grid",
    "volume",
    "workspace",
]
