"""Selected rows of a closure, as wrenches: the rate of its gap, and derivatives of the rows.

Let M = (R, p) be frame b's placement in frame a, and xi = (linear, angular) the twist of b relative
to a in a's axes at a's origin, dM/dt = xi^ M. Pinocchio's constraint model of a whole frame gives
X = J6 v = -xi, the twist of a relative to b. Each row of a closure is a wrench w of that frame,

    rate of the gap = w . X,

and, by duality, the wrench that a unit of its multiplier exerts on a's side, in a's axes at a's
origin. A `Rows` object stacks some: W(M), shape (k, 6). There are five sorts:

- `PointRows`: p stays in the planes through the origin across directions u fixed in a,
  gap -u . p, w = (u, p x u): a force along u through b's origin;
- `AxisRows`: a direction n = R n_b fixed in b stays perpendicular to m fixed in a, gap m . n,
  w = (0, m x n);
- `FrameRows`: the frames stay parallel, gap -log(R), w = (0, e_i);
- `DistanceRows`: |p| stays as it is, gap L - |p|, w = (p / |p|, 0);
- `RotationVectorRows`: components of R's rotation vector r, gap -r_i, w = (0, row i of A(r)), see
  `rotation_vector`; with `PointRows` along the axes they are `FrameCoordinates`, whose joints'
  values are added to the gaps.

Since W depends on M, accelerations need its first derivative along a twist eta of b relative to a,
and derivatives of the dynamics its first and second.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from operator import mul

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Bools
from rps_pin.closed_loop.constraints import rotation_vector
from rps_pin.closed_loop.constraints.closures import LoopClosure
from rps_pin.closed_loop.constraints.frame_coordinates import FrameCoordinates

skew = pin.skew

Floats = tuple[float, ...]


class Rows(ABC):
    """Some rows of a closure; all in frame a's axes."""

    #: Which rows are angular: their gaps in rad, their multipliers in N m.
    angular: Bools

    @abstractmethod
    def squared_gap(self, lever: float, p: Floats, R: Floats) -> float:
        """Return the square of the gap, m^2, angles times a lever, in plain floats.

        To second order in the gap, for a fast test of whether a closure is open. p are b's origin
        in a (3 numbers), R the columns of its rotation (9 numbers).
        """

    @abstractmethod
    def gap(self, placement: pin.SE3) -> Array:
        """Return the gaps (k,) where b stands at M in a."""

    @abstractmethod
    def wrenches(self, placement: pin.SE3) -> Array:
        """Return W, shape (k, 6), (force, moment) at a's origin."""

    def bias(self, placement: pin.SE3, twist: Array) -> Array:
        """Return W' X, shape (k,), where a moves with the twist X relative to b: -(D X) X.

        This and the next two are zero for a W that does not depend on M.
        """
        return np.zeros(self.angular.size)

    def slope(self, placement: pin.SE3) -> Array:
        """Return D, shape (k, 6, 6): dW along a relative twist eta is D @ eta."""
        return np.zeros((self.angular.size, 6, 6))

    def slope_rate(self, placement: pin.SE3, twist: Array) -> Array:
        """Return E, shape (k, 6, 6): d(D @ twist) along eta, the twist held, is E @ eta."""
        return self.slope(placement)


class PointRows(Rows):
    """b's origin stays in planes through a's origin, across the directions (k, 3)."""

    def __init__(self, directions: Array) -> None:
        self.directions = directions
        self._at_origin = np.hstack([directions, np.zeros_like(directions)])
        self.angular = np.zeros(len(directions), dtype=bool)
        self._cross = np.array([skew(u) for u in directions]).reshape(-1, 3, 3)
        self._rows: list[list[float]] = directions.tolist()

    def squared_gap(self, lever: float, p: Floats, R: Floats) -> float:
        """Return the sum of (u . p)^2, |p|^2 for three directions, which are orthonormal."""
        x, y, z = p
        if len(self._rows) == 3:
            return x * x + y * y + z * z
        return sum([(u * x + v * y + w * z) ** 2 for u, v, w in self._rows])

    def gap(self, placement: pin.SE3) -> Array:
        """Return -u . p."""
        gap: Array = -self.directions @ placement.translation
        return gap

    def wrenches(self, placement: pin.SE3) -> Array:
        """Return (u, p x u)."""
        wrenches = self._at_origin.copy()
        wrenches[:, 3:] = -self._cross @ placement.translation
        return wrenches

    def bias(self, placement: pin.SE3, twist: Array) -> Array:
        """Return (u x s) . X_a = u . (s x X_a), s = X_l + X_a x p."""
        linear, angular = twist[:3], twist[3:]
        s = linear + skew(angular) @ placement.translation
        bias: Array = self.directions @ (skew(s) @ angular)
        return bias

    def slope(self, placement: pin.SE3) -> Array:
        """Return d(u, p x u) = (0, -u x dp)."""
        return _angular(-self._cross @ _point_motion(placement.translation))

    def slope_rate(self, placement: pin.SE3, twist: Array) -> Array:
        """Return d(-u x (xi_l + xi_a x p)) = -u x (xi_a x dp)."""
        return _angular(-self._cross @ skew(twist[3:]) @ _point_motion(placement.translation))


class AxisRows(Rows):
    """Directions n_b (k, 3), fixed in b, stay perpendicular to directions fixed in a, m (k, 3)."""

    def __init__(self, in_a: Array, in_b: Array) -> None:
        self.in_a, self.in_b = in_a, in_b
        self.angular = np.ones(len(in_a), dtype=bool)
        self._cross = np.array([skew(m) for m in in_a])
        # m . R n is the sum of these times the columns of R.
        products = np.einsum("ij,ik->ijk", in_b, in_a).reshape(-1, 9)
        self._products: list[list[float]] = products.tolist()

    def squared_gap(self, lever: float, p: Floats, R: Floats) -> float:
        """Return the sum of (lever m . R n)^2."""
        return sum([(lever * _dot(m, R)) ** 2 for m in self._products])

    def gap(self, placement: pin.SE3) -> Array:
        """Return m . n."""
        gap: Array = np.einsum("ij,ij->i", self.in_a, self.in_b @ placement.rotation.T)
        return gap

    def wrenches(self, placement: pin.SE3) -> Array:
        """Return (0, m x n)."""
        wrenches = np.zeros((len(self.in_a), 6))
        turned = self.in_b @ placement.rotation.T
        wrenches[:, 3:] = np.matmul(self._cross, turned[:, :, None])[:, :, 0]
        return wrenches

    def bias(self, placement: pin.SE3, twist: Array) -> Array:
        """Return -(m x (X_a x n)) . X_a = -m . ((X_a x n) x X_a)."""
        spin = skew(twist[3:])
        turning = self.in_b @ placement.rotation.T @ spin.T  # X_a x n, row by row
        bias: Array = np.einsum("ij,ij->i", self.in_a, turning @ spin.T)
        return bias

    def slope(self, placement: pin.SE3) -> Array:
        """Return d(m x n) = m x (eta_a x n)."""
        return _angular(self._cross @ self._turning(placement))

    def slope_rate(self, placement: pin.SE3, twist: Array) -> Array:
        """Return d(m x (xi_a x n)) = m x (xi_a x dn)."""
        return _angular(self._cross @ skew(twist[3:]) @ self._turning(placement))

    def _turning(self, placement: pin.SE3) -> Array:
        """Return dn = eta_a x n as matrices on eta, shape (k, 3, 6)."""
        turning = np.zeros((len(self.in_b), 3, 6))
        turning[:, :, 3:] = [-skew(n) for n in self.in_b @ placement.rotation.T]
        return turning


class ParallelRows(AxisRows):
    """The direction n_b of b stays parallel to n_a of a, and points the same way.

    With t_1, t_2, n_a a right-handed frame, n stays perpendicular to n_a x t_1 and n_a x t_2: the
    moments are about t_1 and t_2.
    """

    def __init__(self, in_a: Array, in_b: Array) -> None:
        self.axis, self.across = in_a, across(in_a)
        super().__init__(np.cross(in_a, self.across), np.vstack([in_b, in_b]))
        self._product: list[float] = np.outer(in_b, in_a).ravel().tolist()

    def squared_gap(self, lever: float, p: Floats, R: Floats) -> float:
        """Return lever^2 |n - n_a|^2."""
        return 2 * lever * lever * abs(1 - _dot(self._product, R))

    def gap(self, placement: pin.SE3) -> Array:
        """Return the rotation vector from n to n_a; it does not vanish where they are opposite."""
        n = placement.rotation @ self.in_b[0]
        turn = self.across @ (skew(n) @ self.axis)
        sine = math.sqrt(turn @ turn)
        angle = math.atan2(sine, n @ self.axis)
        return angle * (turn / sine if sine > 0 else np.array([1.0, 0.0]))


class FrameRows(Rows):
    """The frames stay parallel."""

    angular = np.ones(3, dtype=bool)

    def squared_gap(self, lever: float, p: Floats, R: Floats) -> float:
        """Return lever^2 (3 - trace R) = lever^2 2 (1 - cos angle)."""
        return lever * lever * abs(3 - (R[0] + R[4] + R[8]))

    def gap(self, placement: pin.SE3) -> Array:
        """Return the rotation vector from b to a."""
        gap: Array = -pin.log3(placement.rotation)
        return gap

    def wrenches(self, placement: pin.SE3) -> Array:
        """Return (0, e_i)."""
        return np.hstack([np.zeros((3, 3)), np.eye(3)])


class DistanceRows(Rows):
    """The origins stay a distance apart. Its multiplier is the rod's tension."""

    angular = np.zeros(1, dtype=bool)

    def __init__(self, distance: float) -> None:
        self.distance = distance

    def squared_gap(self, lever: float, p: Floats, R: Floats) -> float:
        """Return (L - |p|)^2."""
        return (self.distance - math.hypot(*p)) ** 2

    def gap(self, placement: pin.SE3) -> Array:
        """Return L - |p|."""
        return np.array([self.distance - math.hypot(*placement.translation.tolist())])

    def wrenches(self, placement: pin.SE3) -> Array:
        """Return (u, 0), u = p / |p|."""
        u, _ = self._direction(placement)
        wrench = np.zeros((1, 6))
        wrench[0, :3] = u
        return wrench

    def bias(self, placement: pin.SE3, twist: Array) -> Array:
        """Return -(P s / |p|) . X_l, s = X_l + X_a x p, P = 1 - u u'."""
        u, length = self._direction(placement)
        linear = twist[:3]
        s = linear + skew(twist[3:]) @ placement.translation
        return np.array([((u @ s) * (u @ linear) - s @ linear) / length])

    def slope(self, placement: pin.SE3) -> Array:
        """Return du = P dp / |p|, P = 1 - u u'."""
        u, length = self._direction(placement)
        across = (np.eye(3) - np.outer(u, u)) / length
        return _linear((across @ _point_motion(placement.translation))[None])

    def slope_rate(self, placement: pin.SE3, twist: Array) -> Array:
        """Return d(P s / |p|), s = xi_l + xi_a x p, by the product rule; du = P dp / |p|."""
        u, length = self._direction(placement)
        motion = _point_motion(placement.translation)
        s = motion @ twist
        across = np.eye(3) - np.outer(u, u)
        of_projection = -((u @ s) * across + np.outer(u, across @ s)) / length  # (dP) s
        of_point = across @ skew(twist[3:])  # P ds
        of_length = -np.outer(across @ s, u) / length
        return _linear(((of_projection + of_point + of_length) / length @ motion)[None])

    def _direction(self, placement: pin.SE3) -> tuple[Array, float]:
        """Return u and |p|; where the origins coincide, any direction will do."""
        p = placement.translation
        length = math.sqrt(p @ p)
        if length < 1e-12 * self.distance:
            return np.array([1.0, 0.0, 0.0]), 1e-12 * self.distance
        return p / length, length


class RotationVectorRows(Rows):
    """Components of the rotation vector r of b in a, by their axes (k,).

    Of the two rotation vectors below a whole turn it is the one whose components are nearer to
    `near` (3,), which is set before each use; NaN where a component does not count.
    """

    def __init__(self, axes: Sequence[int]) -> None:
        self.axes = list(axes)
        self.angular = np.ones(len(self.axes), dtype=bool)
        self.near = np.full(3, np.nan)

    def squared_gap(self, lever: float, p: Floats, R: Floats) -> float:
        """Return NaN: joints hold the values of these rows, which are not known here."""
        return math.nan

    def gap(self, placement: pin.SE3) -> Array:
        """Return -r_i."""
        return -self._vector(placement)[self.axes]

    def wrenches(self, placement: pin.SE3) -> Array:
        """Return (0, A)."""
        rates = rotation_vector.rate_matrix(self._vector(placement))
        return np.hstack([np.zeros((len(self.axes), 3)), rates[self.axes]])

    def bias(self, placement: pin.SE3, twist: Array) -> Array:
        """Return A' X_a, A' along r' = -A X_a."""
        r, spin = self._vector(placement), twist[3:]
        rate = -rotation_vector.rate_matrix(r) @ spin
        return np.asarray(rotation_vector.rate_slope(r, rate) @ spin)[self.axes]

    def slope(self, placement: pin.SE3) -> Array:
        """Return dA along dr = A eta_a."""
        r = self._vector(placement)
        slopes = np.zeros((3, 6, 6))
        for k, along in enumerate(rotation_vector.rate_matrix(r).T):
            slopes[:, 3:, 3 + k] = rotation_vector.rate_slope(r, along)
        return slopes[self.axes]

    def slope_rate(self, placement: pin.SE3, twist: Array) -> Array:
        """Return d(dA along A xi_a): the second derivative of A, and dA along (dA) xi_a."""
        r, spin = self._vector(placement), twist[3:]
        rates = rotation_vector.rate_matrix(r)
        along, slopes = rates @ spin, np.zeros((3, 6, 6))
        for k, moved in enumerate(rates.T):
            turned = rotation_vector.rate_slope(r, moved) @ spin
            slopes[:, 3:, 3 + k] = rotation_vector.rate_curvature(r, along, moved)
            slopes[:, 3:, 3 + k] += rotation_vector.rate_slope(r, turned)
        return slopes[self.axes]

    def _vector(self, placement: pin.SE3) -> Array:
        near = None if np.isnan(self.near).all() else self.near
        return rotation_vector.rotation_vector(placement.rotation, near)


class Stack(Rows):
    """Several sorts of rows, one below the other."""

    def __init__(self, parts: Sequence[Rows]) -> None:
        self.parts = tuple(parts)
        self.angular = np.concatenate([part.angular for part in self.parts])

    def squared_gap(self, lever: float, p: Floats, R: Floats) -> float:
        """Return the sum over the parts."""
        return sum([part.squared_gap(lever, p, R) for part in self.parts])

    def gap(self, placement: pin.SE3) -> Array:
        """Return the parts' gaps."""
        return np.concatenate([part.gap(placement) for part in self.parts])

    def wrenches(self, placement: pin.SE3) -> Array:
        """Return the parts' wrenches."""
        return np.concatenate([part.wrenches(placement) for part in self.parts])

    def bias(self, placement: pin.SE3, twist: Array) -> Array:
        """Return the parts' W' X."""
        return np.concatenate([part.bias(placement, twist) for part in self.parts])

    def slope(self, placement: pin.SE3) -> Array:
        """Return the parts' slopes."""
        return np.concatenate([part.slope(placement) for part in self.parts])

    def slope_rate(self, placement: pin.SE3, twist: Array) -> Array:
        """Return the parts' rates of slopes."""
        return np.concatenate([part.slope_rate(placement, twist) for part in self.parts])


class WholeRows(Stack):
    """The frames coincide. Of all six rows any basis will do: W = 1, Pinocchio's own rows."""

    bias, slope, slope_rate = Rows.bias, Rows.slope, Rows.slope_rate

    def __init__(self) -> None:
        super().__init__([PointRows(np.eye(3)), FrameRows()])

    def wrenches(self, placement: pin.SE3) -> Array:
        """Return 1."""
        return np.eye(6)


def _dot(a: Sequence[float], b: Floats) -> float:
    total: float = sum(map(mul, a, b))
    return total


def rows_of(closure: LoopClosure) -> Rows:
    """Return the rows of a closure, in frame a's axes, forces before moments."""
    point = PointRows(np.eye(3))
    if isinstance(closure, FrameCoordinates):
        positions = PointRows(np.eye(3)[list(closure.linear)])
        return Stack([positions, RotationVectorRows(closure.angular)])
    if closure.kind == "spherical":
        return point
    if closure.kind == "rigid":
        return WholeRows()
    if closure.kind == "distance":
        assert closure.distance is not None  # its constructor saw to that
        return DistanceRows(closure.distance)
    axis = np.array(closure.axis, dtype=np.float64)
    axis_b = np.array(closure.axis_b or closure.axis, dtype=np.float64)
    made: dict[str, Callable[[], Rows]] = {
        "revolute": lambda: Stack([point, ParallelRows(axis, axis_b)]),
        "prismatic": lambda: Stack([PointRows(across(axis)), FrameRows()]),
        "cylindrical": lambda: Stack([PointRows(across(axis)), ParallelRows(axis, axis_b)]),
        "universal": lambda: Stack([point, AxisRows(axis[None], axis_b[None])]),
        "planar": lambda: Stack([PointRows(axis[None]), ParallelRows(axis, axis_b)]),
        "point_on_line": lambda: PointRows(across(axis)),
        "point_on_plane": lambda: PointRows(axis[None]),
    }
    return made[closure.kind]()


def across(axis: Array) -> Array:
    """Return t_1 and t_2, shape (2, 3), that make a right-handed frame with a unit axis.

    For the coordinate axes they are the next two in cyclic order: x, y for z.
    """
    first = np.roll(np.eye(3)[int(np.argmax(np.abs(axis)))], 1)
    first = first - (first @ axis) * axis
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first)])


def _point_motion(p: Array) -> Array:
    """Return the matrix of dp = eta_l + eta_a x p on eta, shape (3, 6)."""
    return np.hstack([np.eye(3), -skew(p)])


def _linear(matrices: Array) -> Array:
    """Return slopes that change forces only, (k, 3, 6) made (k, 6, 6)."""
    return np.concatenate([matrices, np.zeros_like(matrices)], axis=1)


def _angular(matrices: Array) -> Array:
    """Return slopes that change moments only, (k, 3, 6) made (k, 6, 6)."""
    return np.concatenate([np.zeros_like(matrices), matrices], axis=1)
