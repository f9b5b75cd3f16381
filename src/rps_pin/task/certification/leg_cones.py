"""Cones of a platform on six legs between points, in closed form: axes of its links in the world.

The directions are as in `rps_pin.task.point_legs`: with u = (u_x, u_y, u_z) in the axes x, y, z of
a leg's universal joint and c = cos(t) = sqrt(u_y^2 + u_z^2), the second axis is

    y' = (0, u_z, -u_y) / c.

The first link has the axes x, y' and x x y' = (0, u_y, u_z) / c, the second y' x u, y' and u.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import frame_id
from rps_pin.errors import MechanismError
from rps_pin.task.certification.vectors import cross, dot
from rps_pin.task.paths.limits import Cone
from rps_pin.task.point_legs import PointLegs
from rps_pin.task.task import Task

Number = Any
#: Turns a vector of the platform, in the task frame's axes, to the world.
Turn = Callable[[Array], list[Number]]


class LegCones:
    """The room of cones of a platform on six legs: the cosine of the angle, less its least.

    Parameters
    ----------
    task, legs
        The platform.
    cones
        Limits of angles between axes of frames of the base, the platform or the legs.

    Raises
    ------
    InputError
        If there is no such frame.
    MechanismError
        If a frame is on none of these.
    """

    def __init__(self, task: Task, legs: PointLegs, cones: Sequence[Cone]) -> None:
        self._legs, model = legs, task.mechanism.model
        name, placement = task.output_frame
        output = model.frames[model.getFrameId(name)]
        self._platform, to_task = output.parentJoint, (output.placement * placement).rotation.T
        self._cones: list[tuple[list[tuple[int, Array]], float]] = []
        for cone in cones:
            ends: list[tuple[int, Array]] = []
            for frame_name, axis in ((cone.frame_a, cone.axis_a), (cone.frame_b, cone.axis_b)):
                frame = model.frames[frame_id(model, frame_name, "cone")]
                local = np.asarray(frame.placement.rotation @ np.asarray(axis))
                joint = int(frame.parentJoint)
                if joint == self._platform:
                    local = to_task @ local
                elif joint and not any(joint in links for links in legs.links):
                    self._refuse(model, frame_name, joint)
                ends.append((joint, local))
            self._cones.append((ends, math.cos(cone.limit)))

    @staticmethod
    def _refuse(model: pin.Model, frame: str, joint: int) -> None:
        raise MechanismError(
            f"the cone's frame {frame!r} is on joint {model.names[joint]!r}, which is neither the "
            "platform's nor of one of its six legs: its cone cannot be certified"
        )

    def __len__(self) -> int:
        return len(self._cones)

    def rooms(self, along: Sequence[list[Number]], turned: Turn) -> list[Number]:
        """Return the rooms, of vectors along the legs and of the platform's rotation."""
        found = []
        for ends, least in self._cones:
            a, b = (self._axis(joint, local, along, turned) for joint, local in ends)
            found.append(dot(a, b) - least + 0.0 * along[0][0])  # a function of the pose
        return found

    def _axis(
        self, joint: int, local: Array, along: Sequence[list[Number]], turned: Turn
    ) -> Sequence[Number]:
        """Return an axis of a link in the world."""
        if joint == 0:
            return list(local)
        if joint == self._platform:
            return turned(local)
        k = next(k for k, links in enumerate(self._legs.links) if joint in links)
        axes, parts = self._legs.axes[k], self._legs.links[k][joint] @ local
        length = dot(along[k], along[k]).sqrt()
        u = [dot(axis, along[k]) / length for axis in axes]
        c = (u[1] * u[1] + u[2] * u[2]).sqrt()
        first = joint == min(self._legs.links[k])
        second = [0.0, u[2] / c, -(u[1] / c)]
        third = [0.0, u[1] / c, u[2] / c] if first else u
        across = [1.0, 0.0, 0.0] if first else cross(second, u)
        own = [parts[0] * across[i] + parts[1] * second[i] + parts[2] * third[i] for i in range(3)]
        return [own[0] * axes[0][i] + own[1] * axes[1][i] + own[2] * axes[2][i] for i in range(3)]
