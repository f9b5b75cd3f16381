"""Frames of beams by direct stiffness: an independent model of the mechanisms with beams.

Two-noded elements of 12 degrees of freedom with the stiffness of Przemieniecki (Theory of Matrix
Structural Analysis, 1968, equation 5.116), assembled with hinges as nodes that share some freedoms.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rps_pin.arrays import Array
from rps_pin.task.stiffness import Beam


def element_stiffness(beam: Beam, length: float) -> Array:
    """Return the stiffness of one element in its own axes, (12, 12): shifts, turns at both ends."""
    E, G, s, L = beam.material.young_modulus, beam.material.shear_modulus, beam.section, length
    k = np.zeros((12, 12))

    def pair(i: int, value: float) -> None:
        k[i, i] = k[i + 6, i + 6] = value
        k[i, i + 6] = k[i + 6, i] = -value

    pair(0, E * s.area / L)
    pair(3, G * s.torsion_constant / L)
    for shift, turn, inertia, area, sign in (
        (1, 5, s.second_moment_z, s.shear_area_y, 1.0),
        (2, 4, s.second_moment_y, s.shear_area_z, -1.0),
    ):
        phi = 0.0 if area is None else 12 * E * inertia / (G * area * L**2)
        c = E * inertia / (L**3 * (1 + phi))
        at = [shift, turn, shift + 6, turn + 6]
        block = c * np.array(
            [
                [12, 6 * L, -12, 6 * L],
                [6 * L, (4 + phi) * L**2, -6 * L, (2 - phi) * L**2],
                [-12, -6 * L, 12, -6 * L],
                [6 * L, (2 - phi) * L**2, -6 * L, (4 + phi) * L**2],
            ]
        )
        signs = np.array([1.0, sign, 1.0, sign])
        k[np.ix_(at, at)] += block * np.outer(signs, signs)
    return k


class Frame:
    """A frame of beams: nodes are rows of six numbers of freedoms, which they may share."""

    def __init__(self, size: int) -> None:
        self.K = np.zeros((size, size))
        self._elements: list[tuple[Array, Array, Array]] = []

    def add(
        self, beam: Beam, ends: tuple[Array, Array], axes: Array, freedoms: Sequence[int]
    ) -> int:
        """Add an element between two places, section axes in the world's as columns."""
        length = float(np.linalg.norm(ends[1] - ends[0]))
        turn = np.kron(np.eye(4), axes.T)
        k = turn.T @ element_stiffness(beam, length) @ turn
        at = np.array(freedoms)
        self.K[np.ix_(at, at)] += k
        self._elements.append((k, at, turn))
        return len(self._elements) - 1

    def solve(self, loads: Array, fixed: Sequence[int]) -> Array:
        """Return displacements of loads, shape (size, ...)."""
        free = np.setdiff1d(np.arange(len(self.K)), fixed)
        found = np.zeros(loads.shape)
        found[free] = np.linalg.solve(self.K[np.ix_(free, free)], loads[free])
        return found

    def end_forces(self, element: int, displacements: Array) -> Array:
        """Return forces and moments on an element's ends, in world axes, shape (12, ...)."""
        k, at, _ = self._elements[element]
        return np.asarray(k @ displacements[at])
