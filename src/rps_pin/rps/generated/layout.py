"""Named groups of numbers in one array, as floats and as CasADi expressions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rps_pin.numerics.elementary import Number


class Layout:
    """Names and sizes of groups of numbers that lie one after the other.

    Parameters
    ----------
    sizes
        Size of each group, 1 or more.
    """

    def __init__(self, sizes: Mapping[str, int]) -> None:
        self.sizes = dict(sizes)
        self.size = sum(sizes.values())
        ends = [sum(list(sizes.values())[:i]) for i in range(len(sizes))]
        self.slices = {
            name: slice(begin, begin + size)
            for (name, size), begin in zip(sizes.items(), ends, strict=True)
        }

    def split(self, numbers: Sequence[Number]) -> dict[str, Any]:
        """Return the groups by name: a number where the size is 1, else a tuple."""
        return {
            name: numbers[part.start] if part.stop - part.start == 1 else tuple(numbers[part])
            for name, part in self.slices.items()
        }

    def join(self, groups: Mapping[str, Any]) -> list[Number]:
        """Return the numbers of groups, which must be all.

        Raises
        ------
        ValueError
            If a group is missing, unknown or of another size.
        """
        if groups.keys() != self.sizes.keys():
            raise ValueError(f"groups differ: {sorted(groups.keys() ^ self.sizes.keys())}")
        numbers: list[Number] = []
        for name, size in self.sizes.items():
            group = groups[name] if isinstance(groups[name], (tuple, list)) else (groups[name],)
            if len(group) != size:
                raise ValueError(f"{name} has {len(group)} numbers; it must have {size}")
            numbers += group
        return numbers
