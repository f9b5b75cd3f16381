"""Boxes of numbers of which something is proven, or its contrary, by bounds and by cutting.

`prove` cuts a box until bounds of margins decide its parts, `CertifiedBoxes` holds what is proven,
and `Ball` restricts what is asked to discs and balls. What the margins are is said by others.
"""

from rps_pin.numerics.boxes.balls import Ball, met
from rps_pin.numerics.boxes.bounds import Bounds, bounded, either
from rps_pin.numerics.boxes.found import CertifiedBoxes, Places, Verdict, ends_of
from rps_pin.numerics.boxes.proving import Group, Groups, Progress, checked_box, prove

__all__ = [
    "Ball",
    "Bounds",
    "CertifiedBoxes",
    "Group",
    "Groups",
    "Places",
    "Progress",
    "Verdict",
    "bounded",
    "checked_box",
    "either",
    "ends_of",
    "met",
    "prove",
]
