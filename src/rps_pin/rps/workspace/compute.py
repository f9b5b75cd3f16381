"""The workspace by discretised leg lengths, as in the paper's Section 3, or on a grid of poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, SingularityError, UnreachableError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.assembly_mode import AssemblyMode
from rps_pin.rps.workspace.evaluate import Fields, evaluate, side_of_singularity
from rps_pin.rps.workspace.grids import WHOLE, Block, Grid, checked_grid, leg_grid
from rps_pin.rps.workspace.result import Workspace
from rps_pin.task.workspace.evaluate import MIN_CONDITIONING
from rps_pin.validation import real, real_vector

if TYPE_CHECKING:
    from rps_pin.rps.robot import RPSRobot

Progress = Callable[[Iterable[int]], Iterable[int]]

#: Points worked on at a time: enough to amortise a call, few enough for a processor's cache.
BLOCK = 16_384
#: Points of a workspace in memory, about 140 bytes each.
MOST_POINTS = 20_000_000


@refuses_other_kinds
def workspace(
    robot: RPSRobot | RPSParameters,
    grid: Grid | None = None,
    *,
    start: ArrayLike | None = None,
    min_conditioning: float = MIN_CONDITIONING,
    progress: Progress = iter,
) -> Workspace:
    """Return which points of a grid the robot can reach, why not the others, and fields over them.

    By leg lengths (`leg_grid`) every point is solved by direct kinematics in one assembly mode; by
    poses (`pose_grid`) by inverse kinematics. Both ways a point is inside if it keeps every limit
    of the mechanism and lies on the start pose's side of the singularities.

    Parameters
    ----------
    robot
        A robot, or its parameters.
    grid
        What to compute on; by default the paper's, 51 lengths per leg over the stroke.
    start
        Pose (3,) that decides the assembly mode, m and rad. By default level and above the base:
        with the legs at mid-grid if the grid is one of leg lengths, else at mid-stroke, or at the
        middle of the heights if the stroke has no end.
    min_conditioning
        Conditioning, 1/cond(K), below which a pose counts as singular; from 0 to 1.
    progress
        Wraps the loop over the blocks of the grid, for a progress bar.

    Raises
    ------
    InputError
        If the grid is empty, too large for memory or not one, or another argument is not what it
        should be.
    UnreachableError
        If no start is given and legs of mid length carry no level platform.
    SingularityError
        If the start is singular, and so in no assembly mode.
    """
    job = GridJob(robot, grid, start=start, min_conditioning=min_conditioning)
    if job.grid.size > MOST_POINTS:
        raise InputError(
            f"{job.grid.size:.3g} points do not go into memory; at most {MOST_POINTS:.3g} do, and "
            "workspace_to_file computes more"
        )
    fields = job.empty_fields()
    blocks = job.grid.blocks(BLOCK)
    for i in progress(range(len(blocks))):
        fields.fill(blocks[i], job.compute(blocks[i]))
    return Workspace(job.parameters, job.grid, job.start, job.min_conditioning, fields)


class GridJob:
    """A workspace to be computed block by block.

    Arguments and errors are those of `workspace`.
    """

    def __init__(
        self,
        robot: RPSRobot | RPSParameters,
        grid: Grid | None,
        *,
        start: ArrayLike | None = None,
        min_conditioning: float = MIN_CONDITIONING,
    ) -> None:
        self.parameters = parameters_of(robot)
        self.grid = leg_grid(self.parameters) if grid is None else checked_grid(grid)
        self.min_conditioning = real(min_conditioning)
        if not 0 <= self.min_conditioning <= 1:
            raise InputError(f"min_conditioning = {min_conditioning}; it must be from 0 to 1")
        self.start = checked_start(self.parameters, self.grid, start)
        self._side = side_of_singularity(self.parameters, self.start)
        if self._side == 0:
            raise SingularityError("the start pose is singular", math.inf, math.inf)
        self.assembly_mode = None
        if self.grid.kind == "leg lengths":
            self.assembly_mode = AssemblyMode(self.parameters, self.start, self.grid)

    def compute(self, block: Block = WHOLE) -> Fields:
        """Return the fields of a block of the grid."""
        pose, found = self.grid.points(block), None
        if self.assembly_mode is not None:
            pose, found = self.assembly_mode.poses(pose, block)
        least = self.min_conditioning
        return evaluate(self.parameters, pose, self._side, found=found, min_conditioning=least)

    def empty_fields(self) -> Fields:
        """Return fields of the whole grid's shape, to be filled."""
        shape = self.grid.shape
        return Fields(
            np.empty(shape, dtype=np.uint16),
            *(np.empty((*shape, 3)) for _ in range(4)),
            *(np.empty(shape) for _ in range(3)),
        )


def parameters_of(robot: RPSRobot | RPSParameters) -> RPSParameters:
    """Return the parameters of a robot, or those given.

    Raises
    ------
    InputError
        If it is neither.
    """
    parameters = getattr(robot, "parameters", robot)
    if not isinstance(parameters, RPSParameters):
        raise InputError(f"a robot or its parameters are needed, not {type(robot).__name__}")
    return parameters


def level_pose(parameters: RPSParameters, length: float) -> Array:
    """Return the level pose (3,) above the base on three legs of one length, m: d^2 - (g - h)^2.

    Raises
    ------
    UnreachableError
        If legs so short carry no level platform.
    """
    gap = abs(parameters.base_radius - parameters.platform_radius)
    if length <= gap:
        raise UnreachableError(
            f"legs of {length:.6g} m carry no level platform: they must be longer than "
            f"|g - h| = {gap:.6g} m; give a start pose, or other lengths"
        )
    return np.array([math.sqrt(length**2 - gap**2), 0.0, 0.0])


def checked_start(parameters: RPSParameters, grid: Grid, start: ArrayLike | None) -> Array:
    """Return the pose (3,) that decides the assembly mode; see `workspace`."""
    if start is not None:
        return real_vector(start, 3, "start")
    if grid.kind == "leg lengths":
        return level_pose(parameters, float(np.mean([(a[0], a[-1]) for a in grid.axes])))
    shortest, longest = parameters.leg_length_limits
    if math.isfinite(longest):
        return level_pose(parameters, (shortest + longest) / 2)
    z = grid.axes[0]
    return np.array([(z[0] + z[-1]) / 2, 0.0, 0.0])
