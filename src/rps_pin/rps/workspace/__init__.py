"""The workspace of the 3-RPS: Section 3 of the paper, by leg lengths and by poses.

`workspace` computes it on a `leg_grid` or a `pose_grid`; the result says of each point whether it
is inside, or why not (`Reason`), and carries fields over the grid. `workspace_to_file` does the
same for grids too large for memory. `certify` proves of boxes of poses that they are inside.
"""

from rps_pin.moved import moved_names
from rps_pin.numerics.boxes import CertifiedBoxes
from rps_pin.rps.workspace.certified import certify
from rps_pin.rps.workspace.compute import workspace
from rps_pin.rps.workspace.evaluate import Fields
from rps_pin.rps.workspace.geometry import (
    Volume,
    boundary,
    theoretical_cylinder,
    volume,
)
from rps_pin.rps.workspace.grids import Grid, leg_grid, pose_grid
from rps_pin.rps.workspace.inscribed import TiltRange, free_tilt, largest_tilt_range
from rps_pin.rps.workspace.reasons import Reason
from rps_pin.rps.workspace.result import Workspace
from rps_pin.rps.workspace.scale import WorkspaceCounts, workspace_to_file
from rps_pin.rps.workspace.storage import load_workspace, save_workspace
from rps_pin.task.workspace.boundary import save_mesh

__getattr__ = moved_names(
    __name__, {"PaperComparison": "rps_pin.paper", "paper_comparison": "rps_pin.paper"}
)

__all__ = [
    "CertifiedBoxes",
    "Fields",
    "Grid",
    "Reason",
    "TiltRange",
    "Volume",
    "Workspace",
    "WorkspaceCounts",
    "boundary",
    "certify",
    "free_tilt",
    "largest_tilt_range",
    "leg_grid",
    "load_workspace",
    "pose_grid",
    "save_mesh",
    "save_workspace",
    "theoretical_cylinder",
    "volume",
    "workspace",
    "workspace_to_file",
]
