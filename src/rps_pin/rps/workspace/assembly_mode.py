"""The assembly mode of a whole grid of leg lengths.

Lengths allow several assembly modes; a workspace is that of one. Its mode here is the one that the
robot keeps when its legs go *straight*, in the space of leg lengths, from a start pose to the
lengths wanted, without meeting a parallel singularity.

A coarse map of the grid is made that way by `rps_pin.rps.kinematics.forward_kinematics`. Every
other point starts Newton's method on Eq. 8 (`rps_pin.rps.kinematics.leg_equations`) from the coarse
map's angles, interpolated, and must end beside them; those that do not are followed from the start
themselves.
"""

from __future__ import annotations

import numpy as np

from rps_pin.arrays import Array, Bools
from rps_pin.errors import SingularityError
from rps_pin.rps.kinematics.forward_kinematics import forward_kinematics
from rps_pin.rps.kinematics.leg_equations import determinant, placement_from_angles, solve_angles
from rps_pin.rps.kinematics.legs import geometry_of_pose
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.workspace.grids import WHOLE, Block, Grid

#: Points per axis of the coarse map: at most, and at least where the grid has as many.
_COARSE, _FEWEST = 17, 5
#: How far from its interpolated start a point may end, rad.
_BESIDE = 0.02
#: Newton's method converges in four steps where there is a solution near; more do not help.
_ITERATIONS = 12
#: Largest error of the tips' distances, in platform radii.
_TOLERANCE = 1e-11
#: A start whose |determinant| is below this decides no mode.
_SINGULAR_START = 1e-9


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
        self._start = start
        legs = geometry_of_pose(start[None], *self._radii)
        self._side = float(determinant(legs.length, legs.angle, *self._radii)[0])
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
        """Return leg angles (..., 3) reached straight from the start, and where that works."""
        ways = forward_kinematics(length, self._start, *self._radii, errors="mask")
        return ways.angle, ways.reached

    def poses(self, length: Array, block: Block = WHOLE) -> tuple[Array, Bools]:
        """Return poses (..., 3) of a block of the grid, m and rad, and whether there are any.

        `length` are the points of the block. A pose is zero where lengths do not close.
        """
        start, known = self._interpolated(block)
        solution = solve_angles(
            length, start, *self._radii, tolerance=self._tolerance, iterations=_ITERATIONS
        )
        angle = solution.angle
        turn = np.abs(angle - start)
        turn = np.minimum(turn, 2 * np.pi - turn).max(axis=-1)  # angles come from (-pi, pi]
        found = known & solution.converged & (turn < _BESIDE)
        found &= solution.determinant * self._side > 0
        lost = ~found
        if lost.any():
            angle[lost], found[lost] = self.follow(length[lost])
        pose = np.zeros(length.shape)
        if found.any():
            where = ... if found.all() else found  # the usual case copies nothing
            placement = placement_from_angles(length[where], angle[where], *self._radii)
            pose[where] = placement.pose
            found[where] = placement.in_plane_mode
        pose[~found] = 0.0
        return pose, found

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
    return np.stack([np.interp(fine, coarse, unit) for unit in np.eye(len(coarse))], axis=-1)
