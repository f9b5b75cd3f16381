"""The distance of two segments."""

from __future__ import annotations

import numpy as np

from rps_pin.arrays import Array


def segment_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Return the least distance of points of the segments a b and c d, shape (...).

    It is that of an end from the other segment, or that of the two lines, if their nearest points
    are between the ends. A segment may be a point.

    Parameters
    ----------
    a, b, c, d
        Ends, shape (..., 3), m; leading dimensions are broadcast.
    """
    found = np.minimum(
        np.minimum(_from_segment(a, c, d), _from_segment(b, c, d)),
        np.minimum(_from_segment(c, a, b), _from_segment(d, a, b)),
    )
    u, v, w = b - a, d - c, a - c
    normal = np.cross(u, v)
    square = (normal * normal).sum(axis=-1)
    there = square > 0  # of parallel segments an end is as near as any point
    safe = np.where(there, square, 1.0)
    # w + s u - t v is normal to both:
    s = (np.cross(v, w) * normal).sum(axis=-1) / safe
    t = (np.cross(u, w) * normal).sum(axis=-1) / safe
    between = there & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    lines = np.abs((w * normal).sum(axis=-1)) / np.sqrt(safe)
    return np.asarray(np.where(between, np.minimum(found, lines), found))


def _from_segment(p: Array, a: Array, b: Array) -> Array:
    """Return the distance of a point p from the segment a b."""
    along = b - a
    square = (along * along).sum(axis=-1)
    share = ((p - a) * along).sum(axis=-1) / np.where(square > 0, square, 1.0)
    nearest = a + np.clip(share, 0.0, 1.0)[..., None] * along
    return np.asarray(np.linalg.norm(p - nearest, axis=-1))
