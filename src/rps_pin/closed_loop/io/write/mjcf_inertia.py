"""Inertias as MuJoCo has them: principal moments and axes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from lxml import etree

from rps_pin.arrays import Array
from rps_pin.closed_loop.io.write.mjcf_bodies import NONE
from rps_pin.closed_loop.io.write.numbers import number, numbers, quaternion
from rps_pin.errors import MechanismError

#: By how much the largest moment of inertia may exceed the sum of the others, relative to it, and
#: be called rounding.
_ROUNDING = 1e-9
#: Above this part of it, that is told.
_TOLD = 1e-14


class Mending(NamedTuple):
    """What is done to bodies that MuJoCo does not take.

    Attributes
    ----------
    least_mass, least_inertia
        Mass (kg) and moments of inertia (kg m^2) given to a body that has less.
    lower
        Whether a moment that exceeds the sum of the other two is lowered to it.
    """

    least_mass: float = 0.0
    least_inertia: float = 0.0
    lower: bool = False


def add_inertial(
    element: Any, name: str, body: pin.Inertia, mending: Mending, told: list[str]
) -> None:
    """Add the ``inertial`` of a moving body.

    Parameters
    ----------
    element
        The ``body``.
    name
        Its name, for messages.
    body
        In its frame.
    mending
        What is done to it if MuJoCo does not take it.
    told
        Takes a sentence on a moment that is lowered by more than rounding.

    Raises
    ------
    MechanismError
        If MuJoCo does not take it: without mass or moments, or not those of a body.
    """
    moments, axes = np.diag(body.inertia), np.eye(3)
    if np.abs(body.inertia - np.diag(moments)).any():
        moments, axes = np.linalg.eigh(body.inertia)
        axes = axes * np.linalg.det(axes)
    mass = max(body.mass, mending.least_mass)
    moments = np.maximum(moments, mending.least_inertia)
    if mass < NONE or moments.min() < NONE:
        raise MechanismError(
            f"link {name!r} has a mass of {body.mass:.6g} kg and a least moment of inertia of "
            f"{moments.min():.6g} kg m^2; MuJoCo moves nothing with less than {NONE:g}: give a "
            "least mass and inertia (least_mass, least_inertia; --least-mass, --least-inertia)"
        )
    given, moments = moments, _possible(moments, name, mending.lower)
    excess = float(np.max(given - moments))
    if excess > _TOLD * moments.max() and not mending.lower:
        told.append(f"link {name!r}: a moment of inertia is {excess:.3g} kg m^2 less, for MuJoCo")
    attributes = {"pos": numbers(body.lever), "mass": number(mass)}
    attributes["diaginertia"] = numbers(moments)
    if not np.array_equal(axes, np.eye(3)):
        attributes["quat"] = numbers(quaternion(axes))
    etree.SubElement(element, "inertial", attributes)


def _possible(moments: Array, name: str, lower: bool) -> Array:
    """Return principal moments of which none is more than the other two together."""
    largest = int(np.argmax(moments))
    others = float(np.sum(np.delete(moments, largest)))
    excess = moments[largest] - others
    if excess > _ROUNDING * others and not lower:
        raise MechanismError(
            f"link {name!r}: no body has the principal moments of inertia {numbers(moments)} kg "
            f"m^2, of which one exceeds the sum of the others by {excess:.6g}, and MuJoCo refuses "
            "it; it can be lowered to that sum (mend_inertia, --mend-inertia)"
        )
    if excess > 0:
        moments = moments.copy()
        moments[largest] = others
    return moments
