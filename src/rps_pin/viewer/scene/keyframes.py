"""Keyframes of a motion: how nodes of the scene tree move and change colour over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array


class NodeKeyframes(NamedTuple):
    """Motion of one node of the scene tree; n keyframes."""

    path: str
    """Of the node."""
    poses: Array
    """Homogeneous matrices, shape (n, 4, 4); their columns' lengths are scales."""
    parts: Sequence[str] = ()
    """Paths of the parts below it whose colour changes."""
    colours: Array | None = None
    """Red, green and blue of these, 0 to 1, shape (n, 3)."""


def continuous_quaternions(rotations: Array) -> Array:
    """Return unit quaternions whose sign does not jump from one rotation to the next.

    Parameters
    ----------
    rotations : ndarray, shape (n, 3, 3)
        Rotation matrices.

    Returns
    -------
    ndarray, shape (n, 4)
        Quaternions (x, y, z, w). A quaternion and its negative are the same rotation, but between
        keyframes of opposite sign an interpolation makes a whole turn.
    """
    quaternions = np.array([pin.Quaternion(rotation).coeffs() for rotation in rotations])
    turns = np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1]) < 0.0
    signs = np.where(np.cumsum(np.concatenate([[False], turns])) % 2, -1.0, 1.0)
    return np.asarray(quaternions * signs[:, None])
