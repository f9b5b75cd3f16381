"""Boxes of task coordinates of any mechanism, proven by interval Newton; see `growth`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, MechanismError, SingularityError
from rps_pin.numerics.boxes import Ball, CertifiedBoxes, Progress, met
from rps_pin.numerics.intervals import Interval
from rps_pin.task.certification.cones import Cones
from rps_pin.task.certification.equations import Equations
from rps_pin.task.certification.exclusion import Exclusion
from rps_pin.task.certification.growth import Growth, Start
from rps_pin.task.certification.margins import Margins
from rps_pin.task.certification.newton import sheets
from rps_pin.task.certification.reasons import limit_words
from rps_pin.task.paths.limits import Cone
from rps_pin.task.start import started
from rps_pin.task.task import Task
from rps_pin.validation import non_negative_number, whole_number

#: Largest size of the rotation vectors of a box, rad: the series of its functions end there.
LARGEST_TURN = 2.0


def certify_general(
    task: Task,
    lower: Array,
    upper: Array,
    *,
    start: ArrayLike | None,
    cones: Sequence[Cone] = (),
    balls: Sequence[Ball] = (),
    free: float,
    undecided: float,
    most_boxes: int,
    progress: Progress,
) -> CertifiedBoxes:
    """Return what is proven of a box; see `rps_pin.task.certify`."""
    free = non_negative_number(free, "free")
    undecided = non_negative_number(undecided, "undecided")
    whole_number(most_boxes, "most_boxes", least=1)
    if task.extension.reference != "universe":
        raise MechanismError(
            f"the task's coordinates refer to {task.extension.reference!r}; boxes are certified of "
            "coordinates in the world"
        )
    equations = Equations(task)
    if equations.symbols.turn is not None:
        refuse_turns(task, lower, upper)
    x, q = _started(task, lower, upper, start)
    if not met(balls, Interval(x[:, None]))[0].all():
        raise InputError(f"the start, {x.tolist()}, is not in the round parts of the box")
    z = equations.closed(equations.state(q)[None], x[None])
    first = sheets(equations, z, x[None], np.zeros((1, task.size)))
    words = limit_words(task, cones)
    margins = Margins(equations, first, words, Cones(equations, cones) if cones else None)
    if not first.proven[0] or margins.side == 0.0:
        raise SingularityError(
            "the start is singular, so that it decides no assembly mode", np.inf, 1e9
        )
    growth = Growth(
        equations,
        margins,
        Start(x, z[0]),
        lower,
        upper,
        exclusion=Exclusion(equations, z[0], free),
        undecided=undecided,
        most_boxes=most_boxes,
        progress=progress,
        balls=balls,
    )
    return growth.run()


def _started(
    task: Task, lower: Array, upper: Array, start: ArrayLike | None
) -> tuple[Array, Array]:
    """Return the start's task coordinates (m,) and configuration (nq,)."""
    x, q = started(task, np.clip(task.home, lower, upper) if start is None else start)
    if not ((x >= lower) & (x <= upper)).all():
        raise InputError(f"the start, {x.tolist()}, is not in the box")
    return x, q


def refuse_turns(task: Task, lower: Array, upper: Array) -> None:
    """Refuse boxes with rotation vectors beyond what the series of their functions take."""
    most = np.maximum(np.abs(lower), np.abs(upper))[list(task.angular)]
    turn = float(np.linalg.norm(most))
    if turn >= LARGEST_TURN:
        raise InputError(
            f"the box has rotation vectors up to {turn:.4g} rad; below {LARGEST_TURN} rad is "
            "possible"
        )
