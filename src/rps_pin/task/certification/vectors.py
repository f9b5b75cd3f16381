"""Vectors of three numbers, which may be intervals or enclosures."""

from __future__ import annotations

from typing import Any

Number = Any


def cross(a: Any, b: Any) -> list[Number]:
    """Return the cross product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a: Any, b: Any) -> Number:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def norm(v: list[Number]) -> Number:
    """Return the length."""
    return dot(v, v).sqrt()
