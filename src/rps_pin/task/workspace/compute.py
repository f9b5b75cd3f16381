"""The workspace of any mechanism with a task, in one assembly mode that is followed over a grid."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from numpy.typing import ArrayLike

from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.loads import Payload
from rps_pin.task.paths.limits import Cone
from rps_pin.task.sizing.demands import Limits
from rps_pin.task.task import Task
from rps_pin.task.workspace.evaluate import MIN_CONDITIONING
from rps_pin.task.workspace.filling.job import Job
from rps_pin.task.workspace.filling.rounds import Rounds
from rps_pin.task.workspace.filling.seeds import InMemory
from rps_pin.task.workspace.grids import TaskGrid
from rps_pin.task.workspace.result import TaskWorkspace

Progress = Callable[[Iterable[int]], Iterable[int]]

#: Memory that the fields of a workspace may take, bytes.
MOST_BYTES = 4e9
#: Steps of a progress bar.
_STEPS = 1000


@refuses_other_kinds
def workspace(
    task: Task,
    grid: TaskGrid,
    *,
    start: ArrayLike | None = None,
    min_conditioning: float = MIN_CONDITIONING,
    cones: Sequence[Cone] = (),
    holding: bool = False,
    clearance: float | None = None,
    ignore: Sequence[tuple[str, str]] = (),
    payload: Payload | None = None,
    wrench: ArrayLike | None = None,
    force: float | None = None,
    moment: float | None = None,
    speed: float | None = None,
    turning_speed: float | None = None,
    rates: ArrayLike | None = None,
    limits: Limits | None = None,
    progress: Progress = iter,
) -> TaskWorkspace:
    """Return which points of a grid a mechanism reaches, why not the others, and fields over them.

    The assembly mode of the start is followed from point to point. A point is inside if it is
    reached so, every limit of positions is kept there, and those of the actuators' forces and
    speeds if a load or a speed is asked for, and it lies on the start's side of the type II
    singularities. Points beyond a limit or such a singularity are followed all the same, so that
    each has all its reasons, and parts of the workspace that broken limits keep apart are all
    found.

    Parameters
    ----------
    task
        The task; a compiled one (`Task.compile`) takes some microseconds a point, another some
        milliseconds.
    grid
        The points: `task_grid`.
    start
        Task coordinates (m,), followed straight from home, or a closed configuration (nq,), that
        decide the assembly mode; home if left out. One that is given must be within the grid's
        ends.
    min_conditioning
        Conditioning, 1/cond of K in one unit, below which a point counts as singular; from 0 to 1.
    cones
        Limits of balls and universal joints.
    holding
        Whether the actuators' forces at rest are computed: gravity, springs, what the mechanism
        carries, and the payload.
    clearance
        Least distance of two links, m, of mechanisms with collision shapes; left out, links are not
        looked at. It takes some 0.1 ms a point.
    ignore
        Pairs of links, by name, that may be nearer.
    payload
        Fixed to the output frame; its weight is held at every point within the actuators' limits of
        force.
    wrench
        Wrenches on the output frame, one by one: at every point the actuators hold each at rest
        within these limits, and so all that are between them. (force, moment) that the surroundings
        exert at the frame's origin, world axes, N and N m, shape (6,) or (k, 6). Zeros ask for the
        own weight alone. More actuators than coordinates share the forces with the least norm.
    force, moment
        Sizes of a force and of a moment in any directions, N and N m, that act there besides.
    speed, turning_speed
        Speeds of the task that the actuators reach at every point in all directions, within their
        limits of speed: of its lengths, m/s, and of its angles at the same time, rad/s (rates of
        the rotation vector).
    rates
        Rates of the task's coordinates that they reach, each alone, shape (m,) or (k, m).
    limits
        The actuators' limits of force and speed, `DriveLimits`, one of all or of each; left out,
        those of the mechanism's file (of 1e6 or more: none).
    progress
        Wraps a loop, for a progress bar.

    Raises
    ------
    InputError
        If the grid is not one of this task or too large for memory, the start is outside the grid,
        or another argument is not what it should be; if links are to be looked at that have no
        shapes, or forces or speeds of actuators none of which has a limit.
    MechanismError
        If there are fewer actuators than coordinates, a cone's frame is unknown, or a task of
        joints is to carry a load.
    ClosureError, SingularityError
        If the start cannot be reached from home, its loops are open, or it is singular.
    UnreachableError
        If the grid's point nearest to the start is not reached from it.
    """
    job = Job(
        task,
        grid,
        start=start,
        min_conditioning=min_conditioning,
        cones=cones,
        holding=holding,
        clearance=clearance,
        ignore=ignore,
        payload=payload,
        wrench=wrench,
        force=force,
        moment=moment,
        speed=speed,
        turning_speed=turning_speed,
        rates=rates,
        limits=limits,
        most_bytes=MOST_BYTES,
    )
    fields = job.evaluation.empty(job.grid.shape)
    bar = Bar(progress, grid.size)
    rounds = Rounds(job.division, lambda _: InMemory(), job.first, job.q)
    for blocks in rounds:
        for block in blocks:
            found = job.compute(rounds.work(block))
            rounds.take(block, found.at, found.beside)
            place = job.division.places(block, found.at)
            for field, values in zip(fields, found.fields, strict=True):
                field[place] = values
            bar.add(len(found.at))
    bar.close()
    name, actuated = task.mechanism.name or "mechanism", task.mechanism.actuated
    return TaskWorkspace(
        name, actuated, job.grid, job.start, job.min_conditioning, job.evaluation.reasons, fields
    )


class Bar:
    """A progress bar over points that are done in portions of any size."""

    def __init__(self, progress: Progress, size: int) -> None:
        self._steps, self._size, self._done, self._told = iter(progress(range(_STEPS))), size, 0, 0

    def add(self, points: int) -> None:
        """Tell that points are done."""
        self._done += points
        while self._told < _STEPS * self._done // self._size:
            next(self._steps, None)
            self._told += 1

    def close(self) -> None:
        """Tell that all is done."""
        for _ in self._steps:
            pass
