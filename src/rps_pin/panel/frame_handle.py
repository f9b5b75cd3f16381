"""Handle of a task's frame: the frame's placement as task coordinates, and back."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.task import Task

_LINEAR, _ANGULAR = ("x", "y", "z"), ("rx", "ry", "rz")


class FrameHandle:
    """The frame of a task, as something to drag.

    Parameters
    ----------
    task
        A task of a frame.

    Attributes
    ----------
    moves, turns : tuple of 3 bool
        Along and about which axes of the reference frame the task has coordinates.
    """

    def __init__(self, task: Task) -> None:
        self._task = task
        self.moves = tuple(name in task.coordinates for name in _LINEAR)
        self.turns = tuple(name in task.coordinates for name in _ANGULAR)

    def placement(self, q: Array) -> Array:
        """Return the frame's placement in the world at a configuration, shape (4, 4)."""
        return np.asarray(self._frames(q)[1].homogeneous)

    def axes(self, q: Array) -> Array:
        """Return the rotation of the frame that coordinates are taken in, shape (3, 3)."""
        return np.asarray(self._frames(q)[0].rotation)

    def coordinates(self, placement: Array, q: Array, x: Array) -> Array:
        """Return the task's coordinates of a placement of the frame, shape (m,).

        Parameters
        ----------
        placement
            In the world, shape (4, 4).
        q
            Configuration, which says where the reference frame is.
        x
            The task's coordinates there: of turns that are the same, those next to it.
        """
        wanted = self._frames(q)[0].actInv(pin.SE3(placement))
        turn = pin.log3(wanted.rotation)
        found = dict(zip((*_LINEAR, *_ANGULAR), (*wanted.translation, *turn), strict=True))
        angle = float(np.linalg.norm(turn))
        names = self._task.coordinates
        if angle > np.pi / 2 and all(self.turns):  # w and w - 2 pi w / |w| are the same rotation
            other = turn * (1.0 - 2.0 * np.pi / angle)
            here = np.array([x[names.index(name)] for name in _ANGULAR])
            if np.linalg.norm(other - here) < np.linalg.norm(turn - here):
                found.update(zip(_ANGULAR, other, strict=True))
        return np.array([found[name] for name in names])

    def _frames(self, q: Array) -> tuple[pin.SE3, pin.SE3]:
        """Return the placements of the reference frame and of the task's frame."""
        model = self._task.mechanism.model
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        held = self._task.extension
        reference = data.oMf[model.getFrameId(held.reference)].copy()
        frame = data.oMf[model.getFrameId(held.frame)] * held.placement
        return reference, frame
