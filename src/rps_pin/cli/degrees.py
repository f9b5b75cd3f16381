"""What ``--degrees`` makes of the results of commands: angles in degrees, said with their unit.

Single values are converted by `rps_pin.cli.task_options.in_unit`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rps_pin.arrays import Array
from rps_pin.task.paths.events import LimitEvent, PathCheck
from rps_pin.task.paths.signals import pose_in_words
from rps_pin.task.task import Task
from rps_pin.trajectories.csv_columns import in_degrees


def check_in_degrees(found: PathCheck, task: Task) -> PathCheck:
    """Return findings along a path of a task with angles of poses and limits in degrees."""
    factors = np.where(task.angular, math.degrees(1.0), 1.0)

    def turned(event: Any) -> Any:
        pose = event.pose * factors
        changed = event._replace(pose=pose)
        if not isinstance(event, LimitEvent):
            return changed._replace(where=pose_in_words(task, pose, "deg"))
        if not event.unit.startswith("rad"):
            return changed
        limit, unit = math.degrees(event.limit), event.unit.replace("rad", "deg")
        return changed._replace(limit=limit, unit=unit)

    links = found.interference
    if links is not None:
        links = links._replace(events=tuple(map(turned, links.events)))
    return found._replace(
        singularities=tuple(map(turned, found.singularities)),
        limits=tuple(map(turned, found.limits)),
        minimum_pose=found.minimum_pose * factors,
        interference=links,
    )


def table_in_degrees(names: Sequence[str], rows: Array) -> tuple[list[str], Array]:
    """Return names of columns and rows (n, columns) of a table with its angles in degrees."""
    turned = [in_degrees(name) for name in names]
    angles = [old != new for old, new in zip(names, turned, strict=True)]
    return turned, np.where(angles, np.degrees(rows), rows)
