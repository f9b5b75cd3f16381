"""Curves of poses x(u), laws of time u(t), and the trajectories x(u(t)).

By the chain rule:

    x' = x_u u',    x'' = x_u u'' + x_uu u'^2.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.trajectories.path import PathSample, checked_times


class CurveSample(NamedTuple):
    """A curve at given parameters u; poses of m coordinates, m and rad."""

    pose: Array
    """Shape (..., m)."""
    first: Array
    """First derivative by u, shape (..., m)."""
    second: Array
    """Second derivative by u, shape (..., m)."""


class Curve(Protocol):
    """Poses over a parameter u from 0 to `length`, without times."""

    @property
    def length(self) -> float:
        """Largest u; positive. Its unit is the curve's own: a fraction, an angle, a length."""
        ...

    def at(self, u: ArrayLike) -> CurveSample:
        """Return pose and exact derivatives at parameters of shape (...)."""
        ...


class LawSample(NamedTuple):
    """A law of time at given times; u in the unit of its curve."""

    u: Array
    """Shape (...)."""
    rate: Array
    """First time derivative, shape (...)."""
    acceleration: Array
    """Second time derivative, shape (...)."""


class TimeLaw(Protocol):
    """A parameter u over time, from 0 at time 0."""

    @property
    def duration(self) -> float:
        """Length in time, s."""
        ...

    def at(self, t: ArrayLike) -> LawSample:
        """Return u and its exact time derivatives at times of shape (...), s."""
        ...


@refuses_other_kinds
class TimedCurve:
    """A trajectory made of a curve and a law of time.

    Attributes
    ----------
    curve : Curve
        x(u).
    law : TimeLaw
        u(t).
    """

    def __init__(self, curve: Curve, law: TimeLaw) -> None:
        self.curve = curve
        self.law = law

    @property
    def duration(self) -> float:
        """Length in time, s."""
        return self.law.duration

    def __repr__(self) -> str:
        return f"TimedCurve({self.curve!r}, {self.law!r})"

    def sample(self, t: ArrayLike) -> PathSample:
        """Return pose, rate and acceleration at times t of shape (...), s; exact.

        Raises
        ------
        InputError
            If a time lies outside the trajectory.
        """
        u, du, ddu = self.law.at(checked_times(t, self.duration))
        pose, first, second = self.curve.at(u)
        rate = first * du[..., None]
        return PathSample(pose, rate, first * ddu[..., None] + second * (du**2)[..., None])
