"""Derivatives of the closures' rates, accelerations and forces by q and v, in closed form.

For a closure of frames a and b let, all in a's axes at a's origin,

- M be b's placement in a, and eta = (B - A) dq its change, dM = eta^ M, with A and B the Jacobians
  of a and b there;
- X = nu_a - nu_b the twist of a relative to b, with nu_b = Ad_M (b's twist in its own axes);
- Y = X' = alpha_a - Ad_M (b's acceleration in its own axes) + X x nu_a its derivative.

Then, the derivatives of nu and alpha being Pinocchio's and x the cross product of twists,

    dX = dnu_a - Ad_M dnu_b - eta x nu_b
    dY = dalpha_a - Ad_M dalpha_b - eta x alpha_b + dX x nu_a + X x dnu_a,

and the rows J v = W X and J a + J' v = W Y + W' X, W' = -D X, follow by the product rule from W,
its derivative D and the derivative of D (see `rows`). Points in world axes are simpler. A coupling
q_j - sum p(q_k) has the rate v_j - sum p' v_k and the acceleration a_j - sum (p' a_k + p'' v_k^2).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import ClosedFrame
from rps_pin.closed_loop.constraints.equations import ClosedFrames, ClosureEquations

_LOCAL = pin.ReferenceFrame.LOCAL


class ClosureDerivatives(NamedTuple):
    """Derivatives at one motion; nc rows, nv columns unless said otherwise."""

    rate_q: Array
    """d(J v)/dq."""
    acceleration_q: Array
    """d(J a + J' v)/dq."""
    acceleration_v: Array
    """d(J a + J' v)/dv."""


class _Frame(NamedTuple):
    """A frame's motion in its own axes, and its derivatives, shapes (6,) and (6, nv)."""

    placement: pin.SE3
    twist: Array
    acceleration: Array
    twist_q: Array
    acceleration_q: Array
    acceleration_v: Array
    jacobian: Array


class FrameMotions:
    """The motions of frames, and their derivatives, at one motion of the tree.

    Parameters
    ----------
    equations
        The tree; its data are filled.
    motion
        q (nq,), v (nv,), a (nv,).
    """

    def __init__(self, equations: ClosureEquations, motion: tuple[Array, Array, Array]) -> None:
        self.equations, self.motion = equations, motion
        self._frames: dict[ClosedFrame, _Frame] = {}
        equations.look_at(motion[0])
        pin.computeForwardKinematicsDerivatives(equations.model, equations.data, *motion)

    def __getitem__(self, frame: ClosedFrame) -> _Frame:
        """Return a frame's; before the data are used for anything else."""
        if frame not in self._frames:
            model, data = self.equations.model, self.equations.data
            of = model, data, frame.joint, frame.placement, _LOCAL
            self._frames[frame] = _Frame(
                frame.at(data),
                pin.getFrameVelocity(*of).vector,
                pin.getFrameAcceleration(*of).vector,
                *(part.reshape(6, model.nv) for part in pin.getFrameAccelerationDerivatives(*of)),
            )
        return self._frames[frame]

    def of_index(self, index: int) -> _Frame:
        """Return that of a frame of the model, by its index."""
        frame = self.equations.model.frames[index]
        return self[ClosedFrame(int(frame.parentJoint), frame.placement)]


def closure_derivatives(motions: FrameMotions) -> ClosureDerivatives:
    """Return the derivatives of the rows' rates and accelerations."""
    equations = motions.equations
    shape = equations.size, equations.model.nv
    found = ClosureDerivatives(np.zeros(shape), np.zeros(shape), np.zeros(shape))
    for frames in equations.closed_frames:
        of_a, of_b = motions[frames.a], motions[frames.b]
        if frames.closure.kind == "spherical":
            derivatives = [a - b for a, b in zip(_point(of_a), _point(of_b), strict=True)]
        else:
            derivatives = [*_of_frames(frames, of_a, of_b)]
        for whole, part in zip(found, derivatives, strict=True):
            whole[frames.rows] = part
    q, v, a = motions.motion
    for coupling in equations.curved:
        for k, (_, _, second, third) in coupling.slopes(q):
            found.rate_q[coupling.row, k] = -second * v[k]
            found.acceleration_q[coupling.row, k] = -second * a[k] - third * v[k] ** 2
            found.acceleration_v[coupling.row, k] = -2 * second * v[k]
    return found


def closure_force_slope(motions: FrameMotions, multipliers: Array) -> Array:
    """Return d(J' lambda)/dq beyond that of wrenches fixed in the bodies, shape (nv, nv).

    That part is Pinocchio's: `computeRNEADerivatives` with the wrenches as external forces.

    On a's side acts f = W' lambda, on b's side -f. With G = sum lambda_k D_k, df = G eta (and, f
    held in world axes, f turns against a's rotation); frame b moving under it by eta adds
    eta x* f, the cross product of a twist and a wrench.
    """
    equations = motions.equations
    slope = np.zeros((equations.model.nv, equations.model.nv))
    for frames in equations.closed_frames:
        force = multipliers[frames.rows]
        of_a, of_b = motions[frames.a], motions[frames.b]
        if frames.closure.kind == "spherical":
            wrench = np.concatenate([force, np.zeros(3)])
            slope += world_wrench_slope(of_a, wrench) - world_wrench_slope(of_b, wrench)
            continue
        placement = of_a.placement.actInv(of_b.placement)
        A, B = of_a.jacobian, placement.toActionMatrix() @ of_b.jacobian
        if frames.in_world:
            f = (force.reshape(2, 3) @ of_a.placement.rotation).ravel()
            change = _turned_back(f) @ A
        else:
            f = frames.selected.wrenches(placement).T @ force
            change = np.tensordot(force, frames.selected.slope(placement), 1) @ (B - A)
        slope += (A - B).T @ change + B.T @ _twist_on_wrench(f) @ (B - A)
    for coupling in equations.curved:
        for k, (_, _, second, _) in coupling.slopes(motions.motion[0]):
            slope[k, k] -= second * multipliers[coupling.row]
    return slope


def world_wrench_slope(frame: _Frame, wrench: Array) -> Array:
    """Return d(J_f' w)/dq beyond that of a wrench fixed in the body, w fixed in world axes."""
    local = (wrench.reshape(2, 3) @ frame.placement.rotation).ravel()
    return frame.jacobian.T @ _turned_back(local) @ frame.jacobian


def external_force_slope(motions: FrameMotions, wrenches: Mapping[int, Array]) -> Array:
    """Return the same of external wrenches by frame index, shape (nv, nv)."""
    nv = motions.equations.model.nv
    slopes = (
        world_wrench_slope(motions.of_index(frame), wrench) for frame, wrench in wrenches.items()
    )
    return sum(slopes, np.zeros((nv, nv)))


def _point(frame: _Frame) -> tuple[Array, Array, Array]:
    """Return the derivatives of R v by q, and of R (v' + w x v) by q and v, (3, nv) each."""
    turn, (v, w) = frame.placement.rotation, frame.twist.reshape(2, 3)
    along = frame.acceleration[:3] + pin.skew(w) @ v
    turning = frame.jacobian[3:]
    rate_q = frame.twist_q[:3] - pin.skew(v) @ turning

    def classical(spatial: Array, twist: Array) -> Array:
        """Return d(v' + w x v) of d(v', w') and d(v, w)."""
        return np.asarray(spatial[:3] + pin.skew(w) @ twist[:3] - pin.skew(v) @ twist[3:])

    by_q = classical(frame.acceleration_q, frame.twist_q) - pin.skew(along) @ turning
    by_v = classical(frame.acceleration_v, frame.jacobian)
    return turn @ rate_q, turn @ by_q, turn @ by_v


def _of_frames(frames: ClosedFrames, of_a: _Frame, of_b: _Frame) -> tuple[Array, Array, Array]:
    """Return the derivatives of the rows W X, and W Y + W' X by q and v."""
    placement = of_a.placement.actInv(of_b.placement)
    Ad = placement.toActionMatrix()
    nu_a, nu_b, alpha_b = of_a.twist, Ad @ of_b.twist, Ad @ of_b.acceleration
    A, B = of_a.jacobian, Ad @ of_b.jacobian
    eta = B - A
    X = nu_a - nu_b
    Y = of_a.acceleration - alpha_b + _cross(X) @ nu_a
    dX = of_a.twist_q - Ad @ of_b.twist_q + _cross(nu_b) @ eta
    dY = of_a.acceleration_q - Ad @ of_b.acceleration_q + _cross(alpha_b) @ eta
    dY += _cross(X) @ of_a.twist_q - _cross(nu_a) @ dX
    dY_v = of_a.acceleration_v - Ad @ of_b.acceleration_v
    dY_v += _cross(X) @ A - _cross(nu_a) @ (A - B)

    W, D = frames.selected.wrenches(placement), frames.selected.slope(placement)
    W_rate = -D @ X
    of_X = W_rate - np.einsum("kij,i->kj", D, X)  # W' dX + dW' X, where X alone changes
    D_X, D_Y = np.einsum("kij,i->kj", D, X), np.einsum("kij,i->kj", D, Y)  # (D eta) X, (D eta) Y
    E_X = np.einsum("kij,i->kj", frames.selected.slope_rate(placement, X), X)
    rate_q = W @ dX + D_X @ eta
    by_q = W @ dY + of_X @ dX + (D_Y - E_X) @ eta
    by_v = W @ dY_v + of_X @ (A - B)
    if not frames.in_world:
        return rate_q, by_q, by_v
    return _in_world(of_a, (W @ X, W @ Y + W_rate @ X), (rate_q, by_q, by_v), W @ (A - B))


def _in_world(
    of_a: _Frame, values: tuple[Array, Array], slopes: tuple[Array, Array, Array], rate_v: Array
) -> tuple[Array, Array, Array]:
    """Return the derivatives of R x and R (w x x + y), for a frame's rows x = J v and y = x'."""
    turn = np.kron(np.eye(2), of_a.placement.rotation)
    spin = np.kron(np.eye(2), pin.skew(of_a.twist[3:]))
    x, y = values
    of_x, by_q, by_v = slopes
    turning = of_a.jacobian[3:]
    total = spin @ x + y
    rate_q = of_x - _skews(x) @ turning
    by_q = by_q + spin @ of_x - _skews(x) @ of_a.twist_q[3:] - _skews(total) @ turning
    by_v = by_v + spin @ rate_v - _skews(x) @ turning
    return turn @ rate_q, turn @ by_q, turn @ by_v


def _skews(x: Array) -> Array:
    """Return the skew matrices of both halves of a (6,) vector, one below the other, (6, 3)."""
    return np.vstack([pin.skew(x[:3]), pin.skew(x[3:])])


def _cross(twist: Array) -> Array:
    """Return the matrix of y -> twist x y."""
    return np.asarray(pin.Motion(twist).action)


def _turned_back(wrench: Array) -> Array:
    """Return the matrix of twist -> the change of R' w, w fixed in world axes: (R' w) x omega."""
    return np.hstack([np.zeros((6, 3)), _skews(wrench)])


def _twist_on_wrench(wrench: Array) -> Array:
    """Return the matrix of eta -> eta x* f = (omega x F, omega x T + v x F)."""
    force, moment = pin.skew(wrench[:3]), pin.skew(wrench[3:])
    return -np.block([[np.zeros((3, 3)), force], [force, moment]])
