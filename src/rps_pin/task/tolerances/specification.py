"""Tolerances of a mechanism's numbers: sizes with units, by name or pattern, and distributions.

A tolerance t says that a number lies within +-t of what the drawing has. As a random number it is
*normal* with t = k sigma, or *uniform* between -t and t, whose standard deviation is t / sqrt(3).
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from rps_pin.arrays import Array, Bools
from rps_pin.config import Entry, Positive, Text, read_config
from rps_pin.errors import InputError, did_you_mean, few, shown
from rps_pin.validation import choice, non_negative_number, positive_number

Distribution = Literal["normal", "uniform"]
DISTRIBUTIONS: tuple[Distribution, ...] = ("normal", "uniform")

#: Factors to m, rad and 1.
UNITS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "angle": {
        "rad": 1.0,
        "mrad": 1e-3,
        "urad": 1e-6,
        "µrad": 1e-6,
        "deg": math.radians(1),
        "arcmin": math.radians(1 / 60),
        "arcsec": math.radians(1 / 3600),
    },
    "ratio": {"%": 1e-2, "ppm": 1e-6},
}
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


class Tolerance(NamedTuple):
    """A tolerance of the numbers that a name or pattern stands for."""

    pattern: str
    """Of names, ``*``, ``?`` and ``[xyz]`` as in file names: ``placement:leg_*.x``."""
    size: float
    """t, m, rad, or a ratio; 0 or more."""
    kind: str
    """``"length"``, ``"angle"`` or ``"ratio"``; empty if a number was given, in SI units."""
    distribution: Distribution
    sigmas: float
    """k of a normal one: t is k standard deviations."""
    place: str = ""
    """Where it stands, for messages: a file and line."""

    @property
    def deviation(self) -> float:
        """The standard deviation, in the unit of `size`."""
        return self.size / (self.sigmas if self.distribution == "normal" else math.sqrt(3.0))


class Chosen(NamedTuple):
    """Tolerances of single numbers, in the order of the mechanism's names."""

    labels: tuple[str, ...]
    limits: Array
    """t of each, shape (p,), m, rad or a ratio; positive."""
    deviations: Array
    """Standard deviations, shape (p,)."""
    normal: Bools
    """Which are normal; the others are uniform."""

    def of(self, which: Any) -> Chosen:
        """Return some of them."""
        at = np.asarray(which)
        names = tuple(np.array(self.labels, dtype=object)[at])
        return Chosen(names, self.limits[at], self.deviations[at], self.normal[at])

    def scaled(self, factor: float) -> Chosen:
        """Return tolerances that are larger by a factor."""
        return self._replace(limits=factor * self.limits, deviations=factor * self.deviations)


def tolerances(
    given: Mapping[str, Any],
    *,
    distribution: Distribution = "normal",
    sigmas: float = 3.0,
) -> tuple[Tolerance, ...]:
    """Return tolerances of numbers by name or pattern, checked.

    Parameters
    ----------
    given
        By name or pattern: a number (m, rad, or a ratio of a ``scale``), a text with a unit
        (``"0.05 mm"``, ``"0.5 mrad"``, ``"20 arcsec"``, ``"100 ppm"``), or a `Tolerance`.
    distribution
        ``"normal"`` or ``"uniform"``.
    sigmas
        k of normal ones: t is k standard deviations.

    Raises
    ------
    InputError
        If there is none, one is negative or not finite, or a unit is unknown.
    """
    choice(distribution, "distribution", DISTRIBUTIONS)
    positive_number(sigmas, "sigmas")
    if not given:
        raise InputError("no tolerances are given")
    found = []
    for pattern, value in given.items():
        if isinstance(value, Tolerance):
            found.append(value._replace(pattern=pattern))
            continue
        what = f"the tolerance of {pattern}"
        if isinstance(value, str):
            size, kind = quantity(value, what)
        else:
            size, kind = float(value), ""
        non_negative_number(size, what)
        found.append(Tolerance(pattern, size, kind, distribution, float(sigmas)))
    return tuple(found)


def quantity(text: str, what: str) -> tuple[float, str]:
    """Return the size of a text such as ``"0.05 mm"`` in m, rad or 1, and its kind.

    Raises
    ------
    InputError
        If it is not a number with a unit that is known.
    """
    matched = _QUANTITY.fullmatch(text)
    units = ", ".join(one for kind in UNITS.values() for one in kind)
    if matched is None:
        raise InputError(f"{what} = {shown(text)}: it must be a number and a unit: 0.05 mm")
    for kind, known in UNITS.items():
        if (factor := known.get(matched[2])) is not None:
            return float(matched[1]) * factor, kind
    told = f"no unit {shown(matched[2])}" if matched[2] else "it has no unit"
    raise InputError(f"{what} = {shown(text)}: {told}; there are: {units}")


class _Entry(Entry):
    """A tolerance with a distribution of its own."""

    tolerance: Text
    distribution: Distribution | None = None
    sigmas: Positive | None = None


class _File(Entry):
    """A file of tolerances."""

    distribution: Distribution = "normal"
    sigmas: Positive = 3.0
    tolerances: Annotated[dict[str, Text | _Entry], Field(min_length=1)]


def load_tolerances(path: str | os.PathLike[str]) -> tuple[Tolerance, ...]:
    """Return the tolerances of a YAML file.

    Its keys are ``distribution`` (``normal`` or ``uniform``), ``sigmas`` (k: a normal tolerance is
    k standard deviations, 3 if left out) and ``tolerances``: by name or pattern a text such as
    ``0.05 mm``, or a mapping of ``tolerance``, ``distribution`` and ``sigmas``.

    Raises
    ------
    InputError
        If the file is no such file; with the line.
    """
    file, read = read_config(path, "tolerances", _File)
    found = []
    for pattern, value in read.tolerances.items():
        one = value if isinstance(value, _Entry) else _Entry(tolerance=value)
        with file.at("tolerances", pattern):
            (checked,) = tolerances(
                {pattern: one.tolerance},
                distribution=one.distribution or read.distribution,
                sigmas=one.sigmas or read.sigmas,
            )
        found.append(checked._replace(place=file.place(("tolerances", pattern))))
    return tuple(found)


def chosen(given: tuple[Tolerance, ...], kinds: Mapping[str, str]) -> Chosen:
    """Return the tolerances of single numbers.

    A name itself goes before a pattern. Numbers with a tolerance of 0 are exact, and left out.

    Parameters
    ----------
    given
        The tolerances.
    kinds
        What each number of the mechanism is, ``"length"``, ``"angle"`` or ``"ratio"``, by name.

    Raises
    ------
    InputError
        If a pattern stands for none, two patterns stand for the same number, or a length is given
        for an angle; with the place.
    """
    exact = {one.pattern: one for one in given if one.pattern in kinds}
    found: dict[str, Tolerance] = {}
    for one in given:
        names = [one.pattern] if one.pattern in kinds else _matched(one, kinds)
        for name in names:
            if name in exact and one.pattern != name:
                continue
            if (other := found.get(name)) is not None:
                raise _at(one, f"{one.pattern!r} and {other.pattern!r} both stand for {name}")
            if one.kind and one.kind != kinds[name]:
                raise _at(one, f"{one.pattern}: a tolerance of {name} is {_KINDS[kinds[name]]}")
            found[name] = one
    labels = tuple(name for name in kinds if name in found and found[name].size > 0)
    if not labels:
        raise InputError("all tolerances are 0")
    each = [found[name] for name in labels]
    return Chosen(
        labels,
        np.array([one.size for one in each]),
        np.array([one.deviation for one in each]),
        np.array([one.distribution == "normal" for one in each]),
    )


_KINDS = {
    "length": "a length, such as 0.05 mm",
    "angle": "an angle, such as 0.5 mrad",
    "ratio": "a ratio, such as 100 ppm",
}


def _matched(one: Tolerance, kinds: Mapping[str, str]) -> list[str]:
    names = [name for name in kinds if fnmatchcase(name, one.pattern)]
    if not names:
        group = one.pattern.partition(":")[0]
        same = [name for name in kinds if name.partition(":")[0] == group] or list(kinds)
        raise _at(
            one, f"no number {one.pattern!r}{did_you_mean(one.pattern, kinds)}; there are: "
            f"{few(same, 20)}",
        )  # fmt: skip
    return names


def _at(one: Tolerance, told: str) -> InputError:
    return InputError(f"{one.place}: {told}" if one.place else told)
