r"""Reference kinematics and inverse dynamics of the 3-RPS robot, for tests only.

Shares no code and no formula sheet with the package.  NumPy only; every function is batched
over the leading dimensions of ``pose``, ``rate`` and ``acceleration``, all ``(..., 3)``.

Notation (SI units; base frame; i = 1, 2, 3 with th_i = 0, +120, -120 degrees)::

    e_i = (cos th_i, sin th_i, 0)       radial            A_i = g e_i
    n_i = Z x e_i                       revolute axis, normal of the plane of leg i
    P, R                                platform's centre of mass and rotation
    b_i = h R e_i                       B_i = P + b_i     (e_i also in body coordinates)
    s_i = (B_i - A_i) / d_i             unit vector along the leg = -cos(phi) e_i + sin(phi) Z
    t_i = n_i x s_i                     in-plane perpendicular;  s_i' = phi_i' t_i

**Kinematics.**  The pose is (z, w_x, w_y) and R = exp([w]) with w = (w_x, w_y, 0):
R = I + a(x) W + b(x) W W, W = [w], x = |w|^2, where a(x) = sin(sqrt x) / sqrt x and
b(x) = (1 - cos(sqrt x)) / x are entire functions of x, summed here as power series: nothing is
divided by |w|.  The three plane conditions n_i . B_i = 0 give P_x and P_y; as
sum_i n_i n_i^T = 3/2 I in the horizontal plane, P_xy = -(2/3) sum_i n_i (n_i . b_i).
Every derivative is by second-order jets, (f, f', f'') carried along the curve
pose(t) = pose + rate t + acceleration t^2 / 2.

**Dynamics.**  With f_i the force of leg i on the platform at B_i and G the gravity vector:

* cylinder (mass m1, com c s_i, inertia I1) and rod (m2, com (d - r) s_i, inertia I2) together,
  moments about A_i along n_i (neither joint resists turning about n_i)::

      n . [c s x m1 (c s'' - G) + (d - r) s x m2 (a2 - G)] + (I1 + I2) phi'' = n . (d s x -f)
                                                                             = -d (f . t)
      a2 = ((d - r) s)'' = d'' s + 2 d' s' + (d - r) s''

* rod alone, along s (the cylinder acts on the rod along s through the actuator only)::

      m2 s . (a2 - G) = F - f . s

  hence f_i = F_i s_i + N_i n_i + k_i, where k_i = -m2 s.(a2 - G) s + (f.t) t is known and the
  actuator force F_i and the out-of-plane reaction N_i are not;

* platform (mass m, inertia J = R I_P R^T about P), six equations for the six unknowns::

      sum_i f_i           = m (P'' - G)
      sum_i (b_i x f_i)   = J alpha + omega x J omega
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import factorial
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]
"""Real arrays; complex ones where a function says it is complex-safe."""

ANGLES = np.array([0.0, 2.0 * np.pi / 3.0, -2.0 * np.pi / 3.0])
RADIAL = np.stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros(3)], axis=-1)
"""e_i, one per row."""
NORMAL = np.stack([-np.sin(ANGLES), np.cos(ANGLES), np.zeros(3)], axis=-1)
"""n_i, one per row."""
VERTICAL = np.array([0.0, 0.0, 1.0])

_TERMS = 20  # of the power series: below rounding for |w| up to 2 pi
_SINC_SERIES = [(-1.0) ** k / factorial(2 * k + 1) for k in range(_TERMS)]
_COSC_SERIES = [(-1.0) ** k / factorial(2 * k + 2) for k in range(_TERMS)]
_STEP = 1e-40  # of the complex step; its square is lost in rounding


class RobotParameters(Protocol):
    """What this module reads of a robot."""

    @property
    def base_radius(self) -> float: ...
    @property
    def platform_radius(self) -> float: ...
    @property
    def platform_mass(self) -> float: ...
    @property
    def platform_inertia(self) -> ArrayLike: ...
    @property
    def leg_mass(self) -> float: ...
    @property
    def leg_com(self) -> float: ...
    @property
    def leg_inertia_about_com(self) -> float: ...
    @property
    def rod_mass(self) -> float: ...
    @property
    def rod_com(self) -> float: ...
    @property
    def rod_inertia(self) -> float: ...
    @property
    def gravity(self) -> ArrayLike: ...


def _earth_gravity() -> Array:
    return np.array([0.0, 0.0, -9.81])


@dataclass(frozen=True)
class ReferenceRobot:
    """A plain holder of the parameters, in SI units."""

    base_radius: float
    platform_radius: float
    platform_mass: float
    platform_inertia: Array
    leg_mass: float = 0.0
    leg_com: float = 0.0
    leg_inertia_about_com: float = 0.0
    rod_mass: float = 0.0
    rod_com: float = 0.0
    rod_inertia: float = 0.0
    gravity: Array = field(default_factory=_earth_gravity)


# --- second-order jets ---------------------------------------------------------------------


@dataclass(frozen=True)
class Jet:
    """A function of time at t = 0: its value, first and second derivative (arrays)."""

    value: Array
    first: Array
    second: Array

    def map(self, linear: Callable[[Array], Array]) -> "Jet":
        """Apply a linear function, which commutes with differentiation."""
        return Jet(linear(self.value), linear(self.first), linear(self.second))

    def shift(self, constant: ArrayLike) -> "Jet":
        """Add a constant."""
        return Jet(self.value + np.asarray(constant), self.first, self.second)

    def __add__(self, other: "Jet") -> "Jet":
        return Jet(self.value + other.value, self.first + other.first, self.second + other.second)

    def __mul__(self, other: "Jet") -> "Jet":
        return bilinear(np.multiply, self, other)


def bilinear(op: Callable[[Array, Array], Array], f: Jet, g: Jet) -> Jet:
    """Leibniz: (fg)' = f'g + fg', (fg)'' = f''g + 2f'g' + fg'', for any bilinear product."""
    return Jet(
        op(f.value, g.value),
        op(f.first, g.value) + op(f.value, g.first),
        op(f.second, g.value) + 2.0 * op(f.first, g.first) + op(f.value, g.second),
    )


def jet_sqrt(f: Jet) -> Jet:
    """r = sqrt f, from r r = f: 2 r r' = f' and 2 r r'' + 2 r'^2 = f''."""
    root = np.sqrt(f.value)
    first = f.first / (2.0 * root)
    return Jet(root, first, (0.5 * f.second - first * first) / root)


def jet_reciprocal(f: Jet) -> Jet:
    """q = 1/f, from q f = 1: q' = -q f' q and q'' = -q (2 q' f' + q f'')."""
    value = 1.0 / f.value
    first = -value * f.first * value
    return Jet(value, first, -value * (2.0 * first * f.first + value * f.second))


def _series(coefficients: list[float], x: Jet) -> Jet:
    """Power series at a jet, by Horner's rule."""
    total = x.map(np.zeros_like)
    for coefficient in reversed(coefficients):
        total = (total * x).shift(coefficient)
    return total


def _dot(a: Array, b: Array) -> Array:
    """Scalar product over the last axis, without conjugation."""
    product: Array = np.sum(a * b, axis=-1)
    return product


def _cross(a: Array, b: Array) -> Array:
    return np.cross(a, b)


def _apply(matrix: Array, vector: Array) -> Array:
    """Matrix times vector, batched."""
    product: Array = np.einsum("...ij,...j->...i", matrix, vector)
    return product


# --- kinematics ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Motion:
    """Jets of the robot's motion; complex-safe.  Legs are on the axis after the batch."""

    position: Jet  # P, (..., 3)
    rotation: Jet  # R, (..., 3, 3)
    length: Jet  # d_i, (..., 3)
    direction: Jet  # s_i, (..., 3, 3) as [leg, xyz]


@dataclass(frozen=True)
class Kinematics:
    """Motion of platform (base frame) and legs."""

    position: Array
    rotation: Array
    velocity: Array
    acceleration: Array
    angular_velocity: Array
    angular_acceleration: Array
    leg_lengths: Array
    leg_length_rates: Array
    leg_length_accelerations: Array
    leg_angles: Array
    leg_angle_rates: Array
    leg_angle_accelerations: Array


def _skew(w: Array) -> Array:
    """[w] such that [w] v = w x v."""
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    zero = np.zeros_like(x)
    entries = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1)
    return entries.reshape(*w.shape[:-1], 3, 3)


def _unskew(matrix: Array) -> Array:
    """Vector of the skew part of a matrix."""
    return 0.5 * np.stack(
        [
            matrix[..., 2, 1] - matrix[..., 1, 2],
            matrix[..., 0, 2] - matrix[..., 2, 0],
            matrix[..., 1, 0] - matrix[..., 0, 1],
        ],
        axis=-1,
    )


def _rotation_vector(pose: Array) -> Array:
    """w = (w_x, w_y, 0); linear in the pose."""
    return np.stack([pose[..., 1], pose[..., 2], np.zeros_like(pose[..., 0])], axis=-1)


def rotation_of(w: Jet) -> Jet:
    """R = I + a W + b W W (Rodrigues)."""
    skew = w.map(_skew)
    squared_angle = bilinear(_dot, w, w).map(lambda x: x[..., None, None])
    linear = _series(_SINC_SERIES, squared_angle) * skew
    quadratic = _series(_COSC_SERIES, squared_angle) * bilinear(np.matmul, skew, skew)
    return (linear + quadratic).shift(np.eye(3))


def _arms(rotation: Array, platform_radius: float) -> Array:
    """b_i = h R e_i as [leg, xyz]; linear in R."""
    arms: Array = platform_radius * (RADIAL @ np.swapaxes(rotation, -1, -2))
    return arms


def _position(height: Array, arms: Array) -> Array:
    """P = z Z - (2/3) sum n_i (n_i . b_i); linear in (z, b)."""
    horizontal = -(2.0 / 3.0) * _dot(arms, NORMAL) @ NORMAL
    position: Array = horizontal + height[..., None] * VERTICAL
    return position


def motion(
    robot: RobotParameters, pose: ArrayLike, rate: ArrayLike, acceleration: ArrayLike
) -> Motion:
    """Jets along pose + rate t + acceleration t^2 / 2; complex-safe."""
    curve = Jet(*(x + 0.0 for x in np.broadcast_arrays(pose, rate, acceleration)))
    rotation = rotation_of(curve.map(_rotation_vector))
    arms = rotation.map(lambda x: _arms(x, robot.platform_radius))
    height = curve.map(lambda x: x[..., 0])
    position = Jet(
        _position(height.value, arms.value),
        _position(height.first, arms.first),
        _position(height.second, arms.second),
    )
    tips = position.map(lambda x: x[..., None, :]) + arms
    legs = tips.shift(-robot.base_radius * RADIAL)
    length = jet_sqrt(bilinear(_dot, legs, legs))
    direction = legs * jet_reciprocal(length).map(lambda x: x[..., None])
    return Motion(position, rotation, length, direction)


def _angular_velocity(rotation: Jet) -> Array:
    """[omega] = R' R^T."""
    return _unskew(rotation.first @ np.swapaxes(rotation.value, -1, -2))


def _angular_acceleration(rotation: Jet) -> Array:
    """alpha: the skew part of (R' R^T)' = R'' R^T + R' R'^T, whose last term is symmetric."""
    return _unskew(rotation.second @ np.swapaxes(rotation.value, -1, -2))


def kinematics(
    robot: RobotParameters, pose: ArrayLike, rate: ArrayLike, acceleration: ArrayLike
) -> Kinematics:
    """Positions, velocities and accelerations of platform and legs.

    phi from s = -cos(phi) e + sin(phi) Z; then s' = phi' t and s'' = phi'' t - phi'^2 s, so
    phi' = n . (s x s') and phi'' = n . (s x s'').
    """
    now = motion(robot, pose, rate, acceleration)
    s = now.direction
    return Kinematics(
        position=now.position.value,
        rotation=now.rotation.value,
        velocity=now.position.first,
        acceleration=now.position.second,
        angular_velocity=_angular_velocity(now.rotation),
        angular_acceleration=_angular_acceleration(now.rotation),
        leg_lengths=now.length.value,
        leg_length_rates=now.length.first,
        leg_length_accelerations=now.length.second,
        leg_angles=np.arctan2(s.value[..., 2], -_dot(s.value, RADIAL)),
        leg_angle_rates=_dot(NORMAL, _cross(s.value, s.first)),
        leg_angle_accelerations=_dot(NORMAL, _cross(s.value, s.second)),
    )


# --- inverse dynamics ----------------------------------------------------------------------


@dataclass(frozen=True)
class InverseDynamics:
    """Actuator forces, reactions and what is left of the equations.

    ``forces`` (..., 3) in N, positive lengthens; ``reactions`` (..., 3, 3) in N as [leg, xyz],
    force of each leg on the platform at B_i in the base frame; ``residual`` (..., 6) of the
    platform's equations, force (N) then moment about P (N m).
    """

    forces: Array
    reactions: Array
    residual: Array


def _cylinder_acceleration(robot: RobotParameters, now: Motion) -> Array:
    """(c s)'' = c s''."""
    return robot.leg_com * now.direction.second


def _rod_acceleration(robot: RobotParameters, now: Motion) -> Array:
    """((d - r) s)'' = d'' s + 2 d' s' + (d - r) s''."""
    d, s = now.length.map(lambda x: x[..., None]), now.direction
    outward = d.second * s.value
    coriolis = 2.0 * d.first * s.first
    return outward + coriolis + (d.value - robot.rod_com) * s.second


def _leg_moment(robot: RobotParameters, now: Motion, rod_force: Array) -> Array:
    """Left side of the leg's moment balance; rod_force = m2 (a2 - G)."""
    s = now.direction
    reach = (now.length.value - robot.rod_com)[..., None]
    cylinder_force = robot.leg_mass * (_cylinder_acceleration(robot, now) - robot.gravity)
    moment = _cross(robot.leg_com * s.value, cylinder_force) + _cross(reach * s.value, rod_force)
    inertia = robot.leg_inertia_about_com + robot.rod_inertia
    return _dot(NORMAL, moment + inertia * _cross(s.value, s.second))


def _known_reactions(robot: RobotParameters, now: Motion) -> Array:
    """k_i: the reaction on the platform without F_i s_i and N_i n_i."""
    s = now.direction.value
    t = _cross(NORMAL, s)
    rod_force = robot.rod_mass * (_rod_acceleration(robot, now) - robot.gravity)
    along = -_dot(s, rod_force)
    across = -_leg_moment(robot, now, rod_force) / now.length.value
    return along[..., None] * s + across[..., None] * t


def _platform_force(robot: RobotParameters, now: Motion) -> Array:
    """m (P'' - G)."""
    gravity: Array = np.asarray(robot.gravity)
    return robot.platform_mass * (now.position.second - gravity)


def _platform_moment(robot: RobotParameters, now: Motion) -> Array:
    """J alpha + omega x J omega, J = R I_P R^T."""
    R = now.rotation.value
    inertia = R @ np.asarray(robot.platform_inertia) @ np.swapaxes(R, -1, -2)
    omega = _angular_velocity(now.rotation)
    alpha = _angular_acceleration(now.rotation)
    return _apply(inertia, alpha) + _cross(omega, _apply(inertia, omega))


def _wrench(arms: Array, forces: Array) -> Array:
    """Force and moment about P of a force at each B_i: (..., 3, 3) to (..., 3, 6)."""
    return np.concatenate([forces, _cross(arms, forces)], axis=-1)


def inverse_dynamics(
    robot: RobotParameters, pose: ArrayLike, rate: ArrayLike, acceleration: ArrayLike
) -> InverseDynamics:
    """Solve the platform's six equations for the F_i and N_i."""
    now = motion(robot, pose, rate, acceleration)
    s = now.direction.value
    n = np.broadcast_to(NORMAL, s.shape)
    arms = _arms(now.rotation.value, robot.platform_radius)
    known = _known_reactions(robot, now)
    required = np.concatenate([_platform_force(robot, now), _platform_moment(robot, now)], axis=-1)
    columns = np.concatenate([_wrench(arms, s), _wrench(arms, n)], axis=-2)
    scale = np.repeat([1.0, 1.0 / robot.platform_radius], 3)  # moments as forces: conditioning
    right = scale * (required - _wrench(arms, known).sum(axis=-2))
    unknowns = np.linalg.solve(np.swapaxes(scale * columns, -1, -2), right[..., None])
    forces, normal = unknowns[..., :3, 0], unknowns[..., 3:, 0]
    reactions = forces[..., None] * s + normal[..., None] * n + known
    return InverseDynamics(forces, reactions, _wrench(arms, reactions).sum(axis=-2) - required)


# --- energy --------------------------------------------------------------------------------


def _platform_energy(robot: RobotParameters, now: Motion) -> Array:
    """m P'.P' / 2 + v.(I_P v) / 2 - m G.P, with v = R^T omega in the platform's axes."""
    velocity = now.position.first
    spin = _apply(np.swapaxes(now.rotation.value, -1, -2), _angular_velocity(now.rotation))
    turning = _dot(spin, _apply(np.asarray(robot.platform_inertia), spin))
    fall = _dot(now.position.value, np.asarray(robot.gravity))
    return robot.platform_mass * (0.5 * _dot(velocity, velocity) - fall) + 0.5 * turning


def _body_energy(mass: float, inertia: float, com: Jet, s: Jet, gravity: ArrayLike) -> Array:
    """One body of each leg, summed: m c'.c' / 2 + I s'.s' / 2 - m G.c  (s'.s' = phi'^2)."""
    sliding = 0.5 * _dot(com.first, com.first) - _dot(com.value, np.asarray(gravity))
    total: Array = np.sum(mass * sliding + 0.5 * inertia * _dot(s.first, s.first), axis=-1)
    return total


def energy(robot: RobotParameters, pose: ArrayLike, rate: ArrayLike) -> Array:
    """Kinetic plus potential energy (zero height: the origin O); complex-safe."""
    now = motion(robot, pose, rate, np.zeros(3))
    s = now.direction
    base = robot.base_radius * RADIAL
    cylinder = s.map(lambda x: robot.leg_com * x).shift(base)
    reach = now.length.shift(-robot.rod_com).map(lambda x: x[..., None])
    rod = (reach * s).shift(base)
    return (
        _platform_energy(robot, now)
        + _body_energy(robot.leg_mass, robot.leg_inertia_about_com, cylinder, s, robot.gravity)
        + _body_energy(robot.rod_mass, robot.rod_inertia, rod, s, robot.gravity)
    )


def power(
    robot: RobotParameters, pose: ArrayLike, rate: ArrayLike, acceleration: ArrayLike
) -> Array:
    """dE/dt along the motion by complex step: exact to rounding."""
    step = 1j * _STEP
    moved = np.asarray(pose) + step * np.asarray(rate)
    sped = np.asarray(rate) + step * np.asarray(acceleration)
    return np.imag(energy(robot, moved, sped)) / _STEP
