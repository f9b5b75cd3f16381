"""Boxes of task coordinates that are proven to be inside a mechanism's workspace, or outside.

Of mechanisms in general by `rps_pin.task.certification`; of a platform on six legs between points
in closed form. A box of its coordinates (x, y, z, rx, ry, rz) is inside if in all of its poses

- every leg's length |p + R a - b| keeps the limits of its actuator, and is not zero;
- the angles of its universal joint (`rps_pin.task.point_legs`) keep their limits, without passing
  the angle at which that joint is singular;
- the cosines of the angles of cones are above those of their limits;
- the platform is at no parallel (type II) singularity, on the start's side of these: the
  determinant of the legs' Pluecker coordinates (u, R a x u) has the start's sign. A matrix of
  intervals is regular if it is nearly the identity once it is multiplied with the inverse of its
  middle.

A 3-RPS has its own: `rps_pin.rps.workspace.certify`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from rps_pin.errors import MechanismError
from rps_pin.numerics.boxes import CertifiedBoxes, Progress, checked_box, prove
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.certification.general import certify_general, refuse_turns
from rps_pin.task.certification.round_parts import Box, balls_of
from rps_pin.task.certification.six_legs import LegMargins
from rps_pin.task.paths.limits import Cone
from rps_pin.task.point_legs import point_legs
from rps_pin.task.task import Task
from rps_pin.validation import real_vector

if TYPE_CHECKING:
    from rps_pin.task.design.region import RoundPart


@refuses_other_kinds
def certify(
    task: Task,
    lower: ArrayLike,
    upper: ArrayLike,
    *,
    start: ArrayLike | None = None,
    cones: Sequence[Cone] = (),
    round: Sequence[RoundPart] = (),
    free: float = 0.02,
    undecided: float = 0.01,
    most_boxes: int = 200_000,
    progress: Progress = iter,
) -> CertifiedBoxes:
    """Prove of which task coordinates of a box a mechanism reaches them, by intervals.

    A box is inside if for each of its points there is one closed configuration, that of the start's
    assembly mode, every joint and cone keeps its limits there (by whole turns, where these make no
    difference), the closures are regular given the task's coordinates (no type I singularity), and
    K is regular, on the start's side (no type II singularity). It is joined to the start's box by
    boxes for all of whose points that configuration is proven.

    A box is outside if in all of its configurations, joined so, one limit is broken or K has the
    other sign; or if nothing closes at any of its points within the joints' limits, as far as the
    part of the output frame's pose that is no coordinate of the task stays within `free` of the
    start's.

    Parameters
    ----------
    task
        The task, of a frame in the world or of joints. A platform on six legs with universal
        joints, prismatic actuators and balls is certified in closed form; others need CasADi,
        ``pip install rps-pin[compile]``.
    lower, upper
        Least and greatest coordinates of the box, shape (m,), m and rad; equal where a coordinate
        is held.
    start
        Task coordinates (m,), followed straight from home, or a closed configuration (nq,), that
        decide the assembly mode and the side of the singularities; within the box. Left out: home,
        or the point of the box nearest to it. Of a platform on six legs, coordinates (6,) anywhere,
        home if left out.
    cones
        Limits of balls and universal joints, or of any two frames, that count beside the joints'
        limits, as those of `rps_pin.task.workspace.workspace`.
    round
        Discs and balls of coordinates, of lengths or of angles: points of the box outside of these
        do not count, so that boxes that do not meet them are left out.
    free
        See above, rad and characteristic lengths. A Delta's platform could turn: boxes beyond its
        reach are excluded for turns of at most this.
    undecided
        Undecided share of the volume inside at which the cutting ends.
    most_boxes
        It ends also where this many boxes are undecided.
    progress
        Wraps the loops over blocks of boxes, for a progress bar.

    Raises
    ------
    MechanismError
        If the closures are redundant or leave idle freedoms, there are fewer actuators than
        coordinates, the task's reference frame is not the world, or a cone's frame is unknown. In
        closed form, if a cone is of a body that is neither the base, the platform nor a link of a
        leg.
    InputError
        If the box is empty or has rotation vectors longer than 2 rad, the start is outside it, a
        round part is none of its coordinates, or there are more than 64 limits and cones.
    ClosureError, SingularityError
        If the start cannot be reached from home, or is singular.
    CompileError
        If CasADi is needed and not installed.
    """
    ends = checked_box(lower, upper, task.size, held=True)
    options: dict[str, Any] = {
        "undecided": undecided, "most_boxes": most_boxes, "progress": progress,
        "balls": balls_of(Box(task.coordinates, task.angular, *ends), round),
    }  # fmt: skip
    try:
        legs = point_legs(task)
    except MechanismError:
        return certify_general(task, *ends, start=start, cones=cones, free=free, **options)
    refuse_turns(task, *ends)
    at_start = task.home if start is None else real_vector(start, 6, "start")
    margins = LegMargins(task, legs, at_start, cones)
    return prove(margins.groups, *ends, **options)
