"""A motion as keyframes that Meshcat plays by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import umsgpack

from rps_pin.arrays import Array
from rps_pin.viewer.scene.links import Link, link_poses
from rps_pin.viewer.server.window import RawCommand

_FLOAT32_ARRAY = 0x17
"""Meshcat's MessagePack code for numbers that the browser reads as a ``Float32Array``."""


class Clip(NamedTuple):
    """How one node of the scene tree moves; n keyframes."""

    path: str
    """Where it is in the tree."""
    poses: Array
    """Homogeneous matrices, shape (n, 4, 4); their columns' lengths are scales."""
    parts: Sequence[str] = ()
    """Paths of the objects below it whose colour changes."""
    colours: Array | None = None
    """Red, green and blue of these, 0 to 1, shape (n, 3)."""


def link_clips(
    model: pin.Model,
    links: Sequence[Link],
    paths: Mapping[str, str],
    configurations: Array,
) -> list[Clip]:
    """Return how a robot's links move.

    Parameters
    ----------
    model
        The robot.
    links
        Its links; those that never move get no clip.
    paths
        The scene-tree path of each link, by the link's name.
    configurations : ndarray, shape (n, nq)
        The configurations at the keyframes.
    """
    moving = [link for link in links if link.moves]
    poses = link_poses(model, moving, configurations)
    return [Clip(paths[link.name], poses[:, index]) for index, link in enumerate(moving)]


def animation_command(elapsed: Array, clips: Sequence[Clip]) -> RawCommand:
    """Return the command that loads a motion, starts it and repeats it for ever.

    Meshcat's own ``Animation`` writes one dictionary for each keyframe; packed arrays, which
    three.js reads as well, are a tenth of the size.

    Parameters
    ----------
    elapsed : ndarray, shape (n,)
        Times of the keyframes in seconds, from zero.
    clips
        What moves.
    """
    animations: list[dict[str, object]] = []
    for clip in clips:
        animations.append({"path": clip.path, "clip": _clip(_pose_tracks(elapsed, clip.poses))})
        if clip.colours is not None:
            colour = _track("material.color", "color", elapsed, clip.colours)
            animations += [{"path": part, "clip": _clip([colour])} for part in clip.parts]
    options = {"play": True, "repetitions": float("inf")}
    return RawCommand(
        {"type": "set_animation", "path": "", "animations": animations, "options": options}
    )


def _clip(tracks: list[dict[str, object]]) -> dict[str, object]:
    # The tracks' times count frames of 1 / fps; with one frame a second they are seconds.
    return {"fps": 1, "name": "default", "tracks": tracks}


def _pose_tracks(elapsed: Array, poses: Array) -> list[dict[str, object]]:
    """Return the tracks of poses of shape (n, 4, 4)."""
    scales = np.linalg.norm(poses[:, :3, :3], axis=1)
    rotations = poses[:, :3, :3] / scales[:, None, :]
    tracks = [
        _track("position", "vector3", elapsed, poses[:, :3, 3]),
        _track("quaternion", "quaternion", elapsed, continuous_quaternions(rotations)),
    ]
    if not np.allclose(scales, 1.0, rtol=0.0, atol=1e-9):
        tracks.append(_track("scale", "vector3", elapsed, scales))
    return tracks


def _track(name: str, kind: str, elapsed: Array, values: Array) -> dict[str, object]:
    return {"name": f".{name}", "type": kind, "times": _packed(elapsed), "values": _packed(values)}


def _packed(values: Array) -> umsgpack.Ext:
    return umsgpack.Ext(_FLOAT32_ARRAY, values.astype("<f4").tobytes())


def continuous_quaternions(rotations: Array) -> Array:
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
    continuous: Array = quaternions * signs[:, None]
    return continuous
