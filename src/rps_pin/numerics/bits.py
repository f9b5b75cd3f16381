"""Named bits of numbers: which reasons hold of each of many points or boxes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from rps_pin.arrays import Bools
from rps_pin.errors import InputError, shown

Flags = NDArray[np.uint64]

#: Names that a number of 64 bits holds.
MOST_NAMES = 64


def bit_of(names: Sequence[str], name: str) -> np.uint64:
    """Return the bit of a reason.

    Raises
    ------
    InputError
        If there is no such reason.
    """
    if name not in names:
        raise InputError(f"no reason {shown(name)}; there are: {', '.join(names)}")
    return np.uint64(1) << np.uint64(list(names).index(name))


def holds(flags: Flags, names: Sequence[str], name: str) -> Bools:
    """Return where a reason holds, of the shape of the flags; see `bit_of`."""
    return np.asarray((flags & bit_of(names, name)) != 0)


def distinct(names: Iterable[str]) -> tuple[str, ...]:
    """Return names without repetitions, in their order; each gets the bit of its place.

    Raises
    ------
    InputError
        If there are more than bits.
    """
    found = tuple(dict.fromkeys(names))
    if len(found) > MOST_NAMES:
        raise InputError(
            f"there are {len(found)} limits and other reasons to be outside; at most {MOST_NAMES} "
            "are told apart: leave out limits that cannot be met (infinite in the URDF), or cones"
        )
    return found
