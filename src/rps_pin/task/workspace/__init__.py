"""The workspace of any mechanism with a task: which points it reaches, and why not the others.

`workspace` computes it on a `task_grid` in two to six of the task's coordinates, in one assembly
mode that is followed from a start, and `workspace_to_file` on one too large for memory, with many
workers; the result says of each point whether it is inside, or why not,
and carries fields over the grid. `orientation_workspace` does so for sets of orientations. The
3-RPS has a faster way of its own in `rps_pin.rps.workspace`.
"""

from rps_pin.task.workspace.boundary import boundary, save_mesh
from rps_pin.task.workspace.compute import workspace
from rps_pin.task.workspace.evaluate import TaskFields
from rps_pin.task.workspace.grids import TaskGrid, task_grid
from rps_pin.task.workspace.inscribed import (
    InscribedBall,
    InscribedBox,
    InscribedCylinder,
    largest_ball,
    largest_box,
    largest_cylinder,
)
from rps_pin.task.workspace.orientations import OrientationWorkspace, orientation_workspace
from rps_pin.task.workspace.result import TaskWorkspace
from rps_pin.task.workspace.scale import TaskCounts, workspace_to_file
from rps_pin.task.workspace.storage import load_workspace, save_workspace
from rps_pin.task.workspace.volume import TaskVolume, volume

__all__ = [
    "InscribedBall",
    "InscribedBox",
    "InscribedCylinder",
    "OrientationWorkspace",
    "TaskCounts",
    "TaskFields",
    "TaskGrid",
    "TaskVolume",
    "TaskWorkspace",
    "boundary",
    "largest_ball",
    "largest_box",
    "largest_cylinder",
    "load_workspace",
    "orientation_workspace",
    "save_mesh",
    "save_workspace",
    "task_grid",
    "volume",
    "workspace",
    "workspace_to_file",
]
