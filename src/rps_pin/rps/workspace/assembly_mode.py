"""Direct kinematics of a whole grid of leg lengths in one assembly mode.

Lengths allow several assembly modes; a workspace is that of one. Its mode here is the one that the
robot keeps when its legs go *straight*, in the space of leg lengths, from a start pose to the
lengths asked for, without meeting a parallel singularity.

A coarse map of the grid is made that way, in short steps, each solved by Newton's method on Eq. 8
(`rps_pin.rps.kinematics.leg_equations`). Every other point starts Newton's method from the coarse
map's angles, interpolated, and must end beside them; the few that cannot are followed from the
start themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import SingularityError
from rps_pin.rps.kinematics.leg_equations import determinant, placement_from_angles, solve_angles
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.grids import WHOLE, Block, Grid
from rps_pin.rps.workspace.jacobian import leg_jacobian

#: Points per axis of the coarse map: at most, and at least where the grid has as many.
_COARSE, _FEWEST = 17, 5
#: Longest step of a leg while the mode is followed, in platform radii.
_STEP = 0.05
#: Largest turn of a leg in such a step, rad: a larger one is a jump to another mode.
_JUMP = 0.3
#: How far from its interpolated start a point may end, rad.
_BESIDE = 0.02
#: Newton's method converges in four steps where there is a solution near; more do not help.
_ITERATIONS = 12
#: Largest error of the tips' distances, in platform radii.
_TOLERANCE = 1e-11
#: A start whose |determinant| is below this decides no mode.
_SINGULAR_START = 1e-9


class ModePoses(NamedTuple):
    """Poses of one assembly mode."""

    pose: Array
    """(z, tilt_x, tilt_y), shape (..., 3), m and rad; zeros where there is none."""
    found: Bools
    """Whether the lengths close in this mode, shape (...)."""


class AssemblyMode:
    """One assembly mode over a grid of leg lengths.

    Parameters
    ----------
    parameters
        The robot.
    start
        Pose (3,) that decides the mode, m and rad.
    grid
        Leg lengths, for the coarse map.

    Raises
    ------
    SingularityError
        If the start pose is singular: it lies in no mode.
    """

    def __init__(self, parameters: RPSParameters, start: Array, grid: Grid) -> None:
        self._radii = (parameters.base_radius, parameters.platform_radius)
        self._tolerance = _TOLERANCE * parameters.platform_radius
        legs = leg_jacobian(start, *self._radii)
        self._length, self._angle = legs.length, legs.angle
        self._side = float(determinant(self._length, self._angle, *self._radii))
        if abs(self._side) < _SINGULAR_START:
            raise SingularityError(
                f"the start pose {tuple(start.tolist())} is singular, so that it decides no "
                f"assembly mode: the determinant of Eq. 8 is {self._side:.3g} there, and must be "
                f"at least {_SINGULAR_START:.3g} in size",
                1 / max(abs(self._side), 1e-300),
                1 / _SINGULAR_START,
            )
        coarse = [_thinned(axis) for axis in grid.axes]
        self._weights = [_interpolation(c, a) for c, a in zip(coarse, grid.axes, strict=True)]
        nodes = np.stack(np.meshgrid(*coarse, indexing="ij"), axis=-1)
        self._map, self._known = self.follow(nodes)

    def follow(self, length: Array) -> tuple[Array, Bools]:
        """Return leg angles (..., 3) reached straight from the start, and where that works.

        A point is given up where Newton's method does not converge, where a leg turns too far in
        one step, or where the determinant changes its sign: a singularity was met.
        """
        goal = length.reshape(-1, 3)
        angle = np.broadcast_to(self._angle, goal.shape).copy()
        travel = goal - self._length
        farthest = float(np.abs(travel).max(initial=0.0))
        steps = max(1, int(np.ceil(farthest / (_STEP * self._radii[1]))))
        alive = np.arange(len(goal))
        for step in range(1, steps + 1):
            target = self._length + step / steps * travel[alive]
            new, kept = self._solve(target, angle[alive], _JUMP)
            alive = alive[kept]
            angle[alive] = new[kept]
        found = np.zeros(len(goal), dtype=bool)
        found[alive] = True
        return angle.reshape(length.shape), found.reshape(length.shape[:-1])

    def angles(self, length: Array, block: Block = WHOLE) -> tuple[Array, Bools]:
        """Return leg angles (..., 3) of a block of the grid, and whether there are any."""
        start, known = self._interpolated(block)
        angle, found = self._solve(length, start, _BESIDE)
        found &= known
        lost = ~found
        if lost.any():
            angle[lost], found[lost] = self.follow(length[lost])
        return angle, found

    def poses(self, length: Array, block: Block = WHOLE) -> ModePoses:
        """Return the poses of a block of the grid, whose points are `length`."""
        angle, found = self.angles(length, block)
        pose = np.zeros(length.shape)
        if found.all():
            placement = placement_from_angles(length, angle, *self._radii)
            pose[...], found = placement.pose, placement.in_plane_mode
        elif found.any():
            placement = placement_from_angles(length[found], angle[found], *self._radii)
            pose[found] = placement.pose
            found[found] = placement.in_plane_mode
        pose[~found] = 0.0
        return ModePoses(pose, found)

    def _solve(self, length: Array, start: Array, farthest: float) -> tuple[Array, Bools]:
        solution = solve_angles(
            length, start, *self._radii, tolerance=self._tolerance, iterations=_ITERATIONS
        )
        turn = np.abs(solution.angle - start)
        turn = np.minimum(turn, 2 * np.pi - turn).max(axis=-1)  # angles come from (-pi, pi]
        same_side = solution.determinant * self._side > 0
        return solution.angle, solution.converged & same_side & (turn < farthest)

    def _interpolated(self, block: Block) -> tuple[Array, Bools]:
        """Return angles interpolated in the coarse map, and where all its corners are known."""
        first, second, third = self._weights
        corners = np.where(self._known[..., None], self._map, 0.0)
        unknown = (~self._known).astype(np.float64)[..., None]
        values = np.concatenate([corners, unknown], axis=-1)
        # One axis after the other: v_ijk = sum W1_ia W2_jb W3_kc v_abc.
        planes, rows = block
        values = np.tensordot(first[planes], values, axes=(1, 0))
        values = np.einsum("jb,ibcm->ijcm", second[rows], values, optimize=True)
        values = np.einsum("kc,ijcm->ijkm", third, values, optimize=True)
        return values[..., :3], values[..., 3] == 0


def _thinned(axis: Array) -> Array:
    """Return an axis over the same range with a third of the points, `_COARSE` at most."""
    if len(axis) <= _FEWEST:
        return axis
    return np.linspace(axis[0], axis[-1], min(_COARSE, max(_FEWEST, len(axis) // 3)))


def _interpolation(coarse: Array, fine: Array) -> Array:
    """Return the matrix (fine, coarse) of linear interpolation."""
    columns = [np.interp(fine, coarse, unit) for unit in np.eye(len(coarse))]
    return np.stack(columns, axis=-1)
