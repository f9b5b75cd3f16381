"""Closed forms of the robots of examples/design, of many candidates at all points of a region.

Forces are left out; in the examples they bind nowhere. All else that a design requires is here, so
that a grid of candidates has the same fronts.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from rps_pin.arrays import Array, Bools
from rps_pin.numerics.boxes import CertifiedBoxes
from rps_pin.rps.kinematics.legs import geometry_of_pose
from rps_pin.rps.kinematics.rates import leg_jacobians
from rps_pin.rps.parameters import RPSParameters
from rps_pin.task.design import DescribedDesign, Objective
from tests.task.workspaces import DELTA_SIDE, delta_arms

FOLDER = Path(__file__).parents[2] / "examples" / "design"
MICRO = RPSParameters.from_preset("micro")
#: Where the ankle's cranks are: y, and height of the axis.
CRANKS = ((0.035, 0.13), (-0.035, 0.21))
#: Of the Stewart platform: the directions of its three pairs of legs, and the side of each.
PAIRS = np.repeat(np.deg2rad([0.0, 120.0, 240.0]), 2)
SIDES = np.tile([1.0, -1.0], 3)


class Poses(NamedTuple):
    """What closed forms say of a candidate at points (p, m)."""

    reached: Bools
    """(p,)."""
    K: Array
    """(p, na, m)."""
    actuators: Array
    """(p, na)."""
    room: Array
    """To the nearest limit of a joint, as a share of the way between its limits, (p,)."""


class Judged(NamedTuple):
    """What closed forms say of candidates."""

    met: Bools
    """Whether all requirements but those of forces hold, (n,)."""
    scores: Array
    """Objectives, (n, k)."""


def rps(values: Array, x: Array) -> Poses:
    """Base and platform radius, by the closed forms of the 3-RPS."""
    legs = geometry_of_pose(x, *values)
    K = leg_jacobians(rps_parameters(values), x).length_jacobian
    room = np.minimum(_room(legs.length, 0.2, 0.25), _room(legs.angle, np.pi / 4, 3 * np.pi / 4))
    return Poses(~legs.vanishing.any(axis=-1), K, legs.length, room.min(axis=-1))


def rps_parameters(values: Array) -> RPSParameters:
    """Return the parameters of the 3-RPS with other radii."""
    return MICRO.replace(base_radius=float(values[0]), platform_radius=float(values[1]))


def stewart(values: Array, x: Array) -> Poses:
    """Radii of base and platform, and the angles between neighbours there.

    Leg i is l s = p + R b - a, and its rate s . p' + (R b x s) . omega, with omega = J r' of the
    rate of the rotation vector r.
    """
    base, platform, base_angle, platform_angle = values
    a = _ring(base, PAIRS + SIDES * base_angle / 2)
    b = _ring(platform, PAIRS + SIDES * (np.pi / 3 - platform_angle / 2))
    turned = Rotation.from_rotvec(x[:, 3:]).as_matrix() @ b.T
    turned = np.swapaxes(turned, 1, 2)
    leg = x[:, None, :3] + turned - a
    length = np.linalg.norm(leg, axis=-1)
    s = leg / length[..., None]
    moments = np.einsum("pim,pmk->pik", np.cross(turned, s), _omega_by_rate(x[:, 3:]))
    e = a / base
    tangent = np.cross([0.0, 0.0, 1.0], e)
    first = np.arctan2(np.einsum("pik,ik->pi", s, tangent), s[..., 2])
    second = np.arcsin(np.einsum("pik,ik->pi", s, e))
    room = np.minimum(_room(length, 0.45, 0.95), _room(first, -1.5, 1.5))
    room = np.minimum(room, _room(second, -1.5, 1.5))
    return Poses(
        np.ones(len(x), dtype=bool),
        np.concatenate([s, moments], axis=-1),
        length,
        room.min(axis=-1),
    )


def delta(values: Array, x: Array) -> Poses:
    """Arm, rod, radius of the base."""
    found = delta_arms(x, *values)
    room = _room(found.actuators, -1.2, 1.5).min(axis=-1)
    return Poses(found.exists, found.gain, found.actuators, room)


def ankle(values: Array, x: Array) -> Poses:
    """Crank, place of the rods' joints behind the pitch axis, left and right rod.

    With d from a crank's axis to the rod's joint at the foot and the crank's tip u = a (-cos t, 0,
    sin t), |u - d| = L gives -d_x cos t + d_z sin t = (d^2 + a^2 - L^2) / 2 a; and with the rod
    r = d - u, r . u' = r . d'.
    """
    a, behind, *rods = values
    pitch = Rotation.from_rotvec(x[:, :1] * [0.0, 1.0, 0.0])
    foot = pitch * Rotation.from_rotvec(x[:, 1:] * [1.0, 0.0, 0.0])
    angles, rows = [], []
    reached = np.ones(len(x), dtype=bool)
    for (y, height), rod in zip(CRANKS, rods, strict=True):
        p = foot.apply([-behind, y, 0.005])
        d = p - [0.0, y, height]
        far = np.hypot(d[:, 0], d[:, 2])
        share = (np.einsum("pk,pk->p", d, d) + a**2 - rod**2) / (2 * a * far)
        reached &= np.abs(share) < 1
        t = np.arctan2(d[:, 2], -d[:, 0]) + np.arccos(np.clip(share, -1, 1))
        t = (t + np.pi) % (2 * np.pi) - np.pi
        u = a * np.stack([-np.cos(t), np.zeros_like(t), np.sin(t)], axis=-1)
        r = d - u
        moved = np.stack(
            [np.cross([0.0, 1.0, 0.0], p), np.cross(pitch.apply([1.0, 0.0, 0.0]), p)], axis=-1
        )
        lever = np.einsum("pk,pk->p", r, np.cross([0.0, 1.0, 0.0], u))
        with np.errstate(divide="ignore", invalid="ignore"):
            rows.append(np.einsum("pk,pkm->pm", r, moved) / lever[:, None])
        angles.append(t)
    cranks = np.stack(angles, axis=-1)
    room = np.minimum(_room(x[:, 0], -0.8, 0.8), _room(x[:, 1], -0.4, 0.4))
    room = np.minimum(room, _room(cranks, -1.4, 1.4).min(axis=-1))
    return Poses(reached, np.stack(rows, axis=-2), cranks, room)


class Example(NamedTuple):
    """A design with its closed form."""

    file: str
    poses: Callable[[Array, Array], Poses]
    length: float
    """That makes angles lengths, m."""
    angular: bool
    """Whether the actuators turn."""
    side: float
    """The sign of det K at home."""


EXAMPLES = {
    "3-RPS": Example("micro_motion.yaml", rps, 0.12, False, 1.0),
    "Stewart": Example("flight_simulator.yaml", stewart, 0.3, False, 1.0),
    "Delta": Example("pick_and_place_delta.yaml", delta, 0.2531797780234433, True, DELTA_SIDE),
    "ankle": Example("walking_ankle.yaml", ankle, 0.2, True, -1.0),
}


def judged(example: Example, design: DescribedDesign, values: Array) -> Judged:
    """Judge candidates (n, d) by closed forms."""
    space, asked = design.space, design.requirements
    points = asked.region.grid(space.task)
    scale = np.where(space.task.angular, example.length, 1.0)
    motions = asked.sampled(space.task)
    most = np.asarray(space.task.mechanism.model.velocityLimit)
    most = most[space.task.mechanism.actuated_indices]
    met, scores = [], []
    for row in values:
        poses = example.poses(row, points)
        one = _finite(poses.K) / scale * (example.length if example.angular else 1.0)
        singular = np.linalg.svd(one, compute_uv=False)
        worst = float((singular[:, -1] / np.maximum(singular[:, 0], 1e-300)).min())
        measures = {
            "conditioning": worst,
            "stroke": float(np.ptp(poses.actuators, axis=0).max()),
        }
        good = poses.reached.all() and bool((np.sign(np.linalg.det(one)) == example.side).all())
        good &= worst >= asked.min_conditioning
        good &= poses.room.min() >= asked.limit_margin - 1e-12
        if asked.stiffness is not None:
            least = np.linalg.svd(_finite(poses.K) / scale, compute_uv=False)[:, -1].min()
            measures["stiffness"] = float(asked.stiffness) * float(least) ** 2
            good &= measures["stiffness"] >= (asked.min_stiffness or 0.0)
        speeds = []
        for motion in motions:
            on_way = example.poses(row, motion.x)
            good &= bool(on_way.reached.all())
            speeds.append(np.abs(np.einsum("kam,km->ka", _finite(on_way.K), motion.rate)))
        speed = np.concatenate(speeds)
        measures["speed"] = float(speed.max())
        good &= bool((speed <= most).all())
        met.append(bool(good))
        names = dict(zip([d.name for d in space.dimensions], row, strict=True)) | measures
        scores.append([_score(one, names) for one in design.objectives])
    return Judged(np.array(met), np.array(scores))


def grid(design: DescribedDesign, counts: int | list[int]) -> Array:
    """Return candidates on a grid over the whole ranges, (n, d)."""
    dimensions = design.space.dimensions
    each = [counts] * len(dimensions) if isinstance(counts, int) else counts
    axes = [np.linspace(d.lower, d.upper, k) for d, k in zip(dimensions, each, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(dimensions))


def area(scores: Array, objectives: tuple[Objective, ...], ends: Array) -> float:
    """Return the area of two objectives that a set is better than, within ends (2, 2)."""
    signs = np.array([-1.0 if one.maximised else 1.0 for one in objectives])
    worst = (signs * ends).max(axis=0)
    span = np.ptp(ends, axis=0)
    left = (worst - signs * scores) / span  # how much better than the worst, as a share
    left = left[(left > 0).all(axis=1)]
    total, height = 0.0, 0.0
    for width, tall in left[np.argsort(-left[:, 0])]:
        if tall > height:
            total += width * (tall - height)
            height = tall
    return total


def beyond(boxes: CertifiedBoxes, columns: list[int], radius: float) -> bool:
    """Whether all that is not proven inside is farther from zero than a radius, in some columns."""
    left = np.concatenate([boxes.outside, boxes.undecided])[:, :, columns]
    nearest = np.clip(0.0, left[:, 0], left[:, 1])
    return bool((np.linalg.norm(nearest, axis=-1) > radius).all())


def _score(objective: Objective, measures: dict[str, float]) -> float:
    if isinstance(objective.of, str):
        return measures[objective.of]
    return float(sum(weight * measures[name] for name, weight in objective.of.items()))


def _finite(K: Array) -> Array:
    return np.nan_to_num(K, nan=0.0, posinf=0.0, neginf=0.0)


def _room(values: Array, lower: float, upper: float) -> Array:
    return np.asarray(np.minimum(values - lower, upper - values) / (upper - lower))


def _ring(radius: float, angles: Array) -> Array:
    return radius * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1)


def _omega_by_rate(r: Array) -> Array:
    """Return J of omega = J r', world axes: 1 + (1 - cos)/t^2 [r] + (t - sin)/t^3 [r]^2."""
    t = np.linalg.norm(r, axis=-1)[:, None, None]
    zero = np.zeros(len(r))
    x, y, z = r.T
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    small = t < 1e-8
    safe = np.where(small, 1.0, t)
    first = np.where(small, 0.5, (1 - np.cos(safe)) / safe**2)
    second = np.where(small, 1 / 6, (safe - np.sin(safe)) / safe**3)
    return np.asarray(np.eye(3) + first * skew + second * skew @ skew)
