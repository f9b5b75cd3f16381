"""A motion as keyframes that Meshcat plays by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin
import umsgpack
from numpy.typing import NDArray

from rps_pin.viewer.links import Link, link_poses
from rps_pin.viewer.window import RawCommand

_FLOAT32_ARRAY = 0x17
"""Meshcat's MessagePack code for numbers that the browser reads as a ``Float32Array``."""


def animation_command(
    model: pin.Model,
    links: Sequence[Link],
    paths: Mapping[str, str],
    elapsed: NDArray[np.float64],
    configurations: NDArray[np.float64],
) -> RawCommand:
    """Return the command that loads a motion, starts it and repeats it for ever.

    Meshcat's own ``Animation`` writes one dictionary for each keyframe; packed arrays, which
    three.js reads as well, are a tenth of the size.

    Parameters
    ----------
    model
        The robot.
    links
        Its links; those that never move get no track.
    paths
        The scene-tree path of each link, by the link's name.
    elapsed : ndarray, shape (n,)
        Times of the keyframes in seconds, from zero.
    configurations : ndarray, shape (n, nq)
        The configurations at these times.
    """
    moving = [link for link in links if link.moves]
    poses = link_poses(model, moving, configurations)
    clips = [
        {"path": paths[link.name], "clip": _clip(elapsed, poses[:, index])}
        for index, link in enumerate(moving)
    ]
    options = {"play": True, "repetitions": float("inf")}
    return RawCommand(
        {"type": "set_animation", "path": "", "animations": clips, "options": options}
    )


def _clip(elapsed: NDArray[np.float64], poses: NDArray[np.float64]) -> dict[str, object]:
    """Return one link's clip from its poses of shape (n, 4, 4)."""
    return {
        # The tracks' times count frames of 1 / fps; with one frame a second they are seconds.
        "fps": 1,
        "name": "default",
        "tracks": [
            _track("position", "vector3", elapsed, poses[:, :3, 3]),
            _track("quaternion", "quaternion", elapsed, continuous_quaternions(poses[:, :3, :3])),
        ],
    }


def _track(
    name: str, kind: str, elapsed: NDArray[np.float64], values: NDArray[np.float64]
) -> dict[str, object]:
    return {"name": f".{name}", "type": kind, "times": _packed(elapsed), "values": _packed(values)}


def _packed(values: NDArray[np.float64]) -> umsgpack.Ext:
    return umsgpack.Ext(_FLOAT32_ARRAY, values.astype("<f4").tobytes())


def continuous_quaternions(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit quaternions without jumps of sign between one rotation and the next.

    Parameters
    ----------
    rotations : ndarray, shape (n, 3, 3)
        Rotation matrices.

    Returns
    -------
    ndarray, shape (n, 4)
        Quaternions (x, y, z, w); a quaternion and its negative are the same rotation, but what
        lies between keyframes of opposite sign is a whirl.
    """
    quaternions = np.array([pin.Quaternion(rotation).coeffs() for rotation in rotations])
    turns = np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1]) < 0.0
    signs = np.where(np.cumsum(np.concatenate([[False], turns])) % 2, -1.0, 1.0)
    continuous: NDArray[np.float64] = quaternions * signs[:, None]
    return continuous
