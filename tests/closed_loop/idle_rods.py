"""Rods between two balls in the place of distances: the same mechanism, and each rod spins idly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from rps_pin import ClosedLoopModel, LoopClosure
from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import Closure
from tests.closed_loop.random_mechanisms import Case, case


def case_with_rods(seed: int, *, off: float = 0.0, mass: float = 0.3) -> tuple[Case, Case]:
    """A random mechanism with distances, and the same one with rods; in the same motion.

    Parameters
    ----------
    seed
        Of the draw.
    off
        How far the rods' centres of mass are off their lines, in lengths of the rods.
    mass
        Of each rod, kg.
    """
    kinds = ("distance", "spherical", "distance", "point_on_line", "distance")
    given = case(seed, kinds=kinds, effects=seed % 2 == 0)
    rng = np.random.default_rng([seed, 7])
    old = given.mechanism
    model, closures = pin.Model(old.model), list[Closure]()
    q, v = given.q, given.v
    for closure in old.closures:
        if isinstance(closure, LoopClosure) and closure.kind == "distance":
            place, ends = _rod(rng, model, old.model, given.q, closure, off, mass)
            closures += ends
            q = np.concatenate([q, pin.SE3ToXYZQUAT(place)])
        else:
            closures.append(closure)
    effects = old.effects
    if effects is not None:
        effects = replace(
            effects,
            **{
                name: np.concatenate([getattr(effects, name), np.zeros(model.nv - old.model.nv)])
                for name in ("damping", "friction", "stiffness", "rest")
            },
        )
    new = ClosedLoopModel(model, closures, old.actuated, home=q, effects=effects)
    q = new.home
    at = old.actuated_indices
    v = new.velocity(q, given.v[at])
    a = new.acceleration(q, v, given.a[at])
    return given, Case(new, q, v, a, given.wrenches)


def _rod(
    rng: np.random.Generator,
    model: pin.Model,
    before: pin.Model,
    q: Array,
    closure: LoopClosure,
    off: float,
    mass: float,
) -> tuple[pin.SE3, Sequence[LoopClosure]]:
    """Add a rod on a free-flyer; return its placement and the closures at its two ends."""
    data = before.createData()
    pin.framesForwardKinematics(before, data, q)
    a, b = (
        data.oMf[before.getFrameId(frame)].act(offset.translation)
        for frame, offset in zip((closure.frame_a, closure.frame_b), closure.offsets(), strict=True)
    )
    length, name = float(np.linalg.norm(b - a)), f"rod_{closure.name}"
    assert abs(length - float(closure.distance or 0.0)) < 1e-9
    along = pin.Quaternion.FromTwoVectors(np.array([1.0, 0.0, 0.0]), b - a).matrix()
    spin = pin.exp3(np.array([rng.uniform(-3, 3), 0.0, 0.0]))
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name)
    centre = np.array([length / 2, off * length, 0.0])
    thin = mass * length**2 * np.diag([0.002, 1 / 12, 1 / 11.9])
    if mass:
        model.appendBodyToJoint(joint, pin.Inertia(mass, centre, thin), pin.SE3.Identity())
    ends = []
    for end, frame, x in (("a", closure.frame_a, 0.0), ("b", closure.frame_b, length)):
        place = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        own = model.addFrame(pin.Frame(f"{name}_{end}", joint, 0, place, pin.FrameType.OP_FRAME))
        offset = closure.offsets()[0 if end == "a" else 1]
        ends.append(
            LoopClosure(model.frames[own].name, frame, name=f"{name} {end}", placement_b=offset)
        )
    return pin.SE3(along @ spin, a), ends


def spinning(c: Case, seed: int) -> Case:
    """The same with rods that spin at random rates."""
    mechanism = c.mechanism
    rng = np.random.default_rng(seed)
    motions = mechanism.allowed_motions(c.q)
    at_rest = motions[mechanism.actuated_indices]
    spins = motions @ np.linalg.svd(at_rest)[2][at_rest.shape[0] :].T
    assert spins.shape[1]
    v = c.v + spins @ rng.normal(size=spins.shape[1])
    rates = rng.normal(size=mechanism.actuated_indices.size)
    return c._replace(v=v, a=mechanism.acceleration(c.q, v, rates))
