"""Random mechanisms: trees of every joint, loops of every closure, motions that keep them closed.

A tree is drawn together with a configuration, and every loop is closed where the tree stands there:
frame b is put where a joint of the closure's kind, moved by chance, takes it from frame a. So each
mechanism has a closed configuration before the package is asked to find one.

With `planar` all joints move in one plane. Most closures are then overconstrained: those rows are
redundant which say again that nothing leaves the plane.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rps_pin import ClosedLoopModel, JointCoupling, JointEffects, LoopClosure
from rps_pin.closed_loop.constraints.closures import KINDS, Closure
from tests.strategies import rigid_body_inertia

Array = NDArray[np.float64]
Rng = np.random.Generator

ALL_KINDS = (*KINDS, "coupling")
#: Further couplings, which a draw of any kind leaves out.
EVERY_KIND = (*ALL_KINDS, "polynomial", "differential")
#: Joints of a tree, as often as they come.
SPATIAL = ["revolute"] * 8 + ["prismatic"] * 3 + ["ball", "free", "turn", "planar", "translation"]
PLANAR = ["revolute"] * 5 + ["prismatic"] * 2 + ["turn", "planar"]

#: Of singular values relative to the largest: what is accepted as regular, and as zero.
_REGULAR, _ZERO = 0.02, 1e-10


class Case(NamedTuple):
    """A mechanism in motion, its loops closed, under some external wrenches."""

    mechanism: ClosedLoopModel
    q: Array
    v: Array
    a: Array
    wrenches: dict[str, Array]


class RefusedError(Exception):
    """A draw that gives no well conditioned mechanism."""


def case(
    seed: int,
    *,
    kinds: Sequence[str] | None = None,
    planar: bool = False,
    massless: bool = False,
    effects: bool = False,
    armature: bool = False,
    joints: Sequence[str] | None = None,
) -> Case:
    """A random mechanism and a random motion of it; the same for the same arguments.

    Parameters
    ----------
    seed
        Of the draw.
    kinds
        Kinds of its closures, the first of which it surely has; all if left out.
    planar
        Whether all moves in one plane.
    massless
        Whether some links have no mass (as many as leave every motion some inertia).
    effects, armature
        Whether joints have damping, friction and springs, and rotors.
    joints
        Sorts of joints to draw from.
    """
    for attempt in range(100):
        rng = np.random.default_rng([seed, attempt])
        try:
            return _drawn(rng, kinds, planar, massless, effects, armature, joints)
        except RefusedError:
            continue
    raise AssertionError(f"no mechanism of seed {seed} is well conditioned")


#: Tests of properties take their mechanisms from a pool of so many seeds (and their options).
POOL = 12

pool = st.integers(0, POOL - 1)
"""Seeds of the pool."""


@cache
def pooled(
    seed: int,
    *,
    planar: bool = False,
    massless: bool = False,
    effects: bool = False,
    armature: bool = False,
    joints: tuple[str, ...] | None = None,
) -> Case:
    """A case of the pool, as `case` draws it: made once in a process, and not to be changed."""
    assert 0 <= seed < POOL
    c = case(
        seed, planar=planar, massless=massless, effects=effects, armature=armature, joints=joints
    )
    for array in (c.q, c.v, c.a):
        array.setflags(write=False)
    return c


def _drawn(
    rng: Rng,
    kinds: Sequence[str] | None,
    planar: bool,
    massless: bool,
    effects: bool,
    armature: bool,
    joints: Sequence[str] | None,
) -> Case:
    model = random_tree(rng, joints or (PLANAR if planar else SPATIAL), planar)
    q = pin.integrate(model, pin.neutral(model), 0.8 * rng.normal(size=model.nv))
    closures = _closures(rng, model, q, kinds, planar)
    if armature:
        model.armature = rng.uniform(0.1, 1.0, size=model.nv)
    resisting = random_effects(rng, model) if effects else None
    probe = ClosedLoopModel(model, closures, model.names[1])
    actuated = _actuated(rng, probe, q)
    if massless:
        _take_masses(rng, probe, q)
    mechanism = ClosedLoopModel(
        model, closures, actuated, home=q, effects=resisting, name=f"random_{len(closures)}"
    )
    q = mechanism.close(q)
    count = mechanism.actuated_indices.size
    v = mechanism.velocity(q, rng.normal(size=count))
    a = mechanism.acceleration(q, v, rng.normal(size=count))
    frames = [frame.name for frame in model.frames]
    wrenches = {str(name): rng.normal(size=6) for name in rng.choice(frames, size=3)}
    return Case(mechanism, q, v, a, wrenches)


# Trees --------------------------------------------------------------------------------------------


def random_tree(rng: Rng, sorts: Sequence[str], planar: bool) -> pin.Model:
    """Five to eight bodies, and gravity in any direction.

    Pinocchio wants trees built branch by branch: a parent is the last joint or one before it.
    """
    model = pin.Model()
    branch = [0]
    model.gravity.linear = 9.81 * unit(rng)
    for index in range(int(rng.integers(5, 9))):
        if rng.random() < 0.4:
            branch = branch[: int(rng.integers(1, len(branch) + 1))]
        sort = str(rng.choice(sorts))
        turn = pin.exp3(np.array([0, 0, rng.normal()])) if planar else rotation(rng)
        joint = model.addJoint(
            branch[-1],
            joint_model(rng, sort, planar),
            pin.SE3(turn, 0.4 * rng.normal(size=3)),
            f"{sort}_{index}",
        )
        branch.append(joint)
        model.appendBodyToJoint(joint, random_inertia(rng), pin.SE3.Identity())
        model.addFrame(
            pin.Frame(f"body_{index}", joint, 0, random_placement(rng), pin.FrameType.OP_FRAME)
        )
    plain = [joint for joint in list(model.joints)[1:] if joint.nq == joint.nv]
    for joint in plain:
        model.lowerPositionLimit[joint.idx_q : joint.idx_q + joint.nq] = -20.0
        model.upperPositionLimit[joint.idx_q : joint.idx_q + joint.nq] = 20.0
    return model


def joint_model(rng: Rng, sort: str, planar: bool) -> object:
    """A joint of a sort, about or along any axis, or about z or along any in the x-y plane."""
    axis = np.array([0.0, 0.0, 1.0]) if planar else unit(rng)
    along = unit(rng) * [1, 1, 0] if planar else axis
    along = along / np.linalg.norm(along)
    makers: dict[str, Callable[[], object]] = {
        "revolute": lambda: pin.JointModelRevoluteUnaligned(*axis),
        "prismatic": lambda: pin.JointModelPrismaticUnaligned(*along),
        "turn": pin.JointModelRUBZ,
        "helical": lambda: pin.JointModelHelicalUnaligned(*axis, 0.3),
        "ball": pin.JointModelSpherical,
        "zyx": pin.JointModelSphericalZYX,
        "free": pin.JointModelFreeFlyer,
        "planar": pin.JointModelPlanar,
        "translation": pin.JointModelTranslation,
        "universal": lambda: pin.JointModelUniversal(axis, crosswise(rng, axis)),
    }
    return makers[sort]()


def random_inertia(rng: Rng) -> pin.Inertia:
    """Any that a body of about 1 kg and 0.3 m can have."""
    mass = rng.uniform(0.5, 2.0)
    inertia = rigid_body_inertia(rng, mass, 0.3)
    return pin.Inertia(mass, 0.2 * rng.normal(size=3), inertia)


def random_effects(rng: Rng, model: pin.Model) -> JointEffects:
    """Damping and friction of all joints, springs on those that can have one."""
    stiffness = rng.uniform(0, 20, size=model.nv)
    for joint in list(model.joints)[1:]:
        own = stiffness[joint.idx_v : joint.idx_v + joint.nv]
        if joint.shortname() in ("JointModelSpherical", "JointModelFreeFlyer"):
            own[:] = np.repeat(own[::3], 3)  # one of turns, one of shifts
        elif joint.nq != joint.nv:
            own[:] = 0.0
    return JointEffects(
        damping=rng.uniform(0, 1, size=model.nv),
        friction=rng.uniform(0, 1, size=model.nv),
        stiffness=stiffness,
        rest=rng.normal(size=model.nv),
        friction_speed=0.5,
    )


# Loops --------------------------------------------------------------------------------------------


def joint_of(closure: LoopClosure) -> tuple[pin.Model, pin.SE3]:
    """The joint that a closure replaces: a chain from frame a, and frame b at its end.

    At the chain's neutral configuration the frames coincide, but for what `axis_b` turns, and for
    a rod's length.
    """
    axis = np.array(closure.axis) if closure.axis is not None else np.array([0.0, 0.0, 1.0])
    axis_b = np.array(closure.axis_b) if closure.axis_b is not None else axis
    slide = pin.JointModelPrismaticUnaligned(*axis)
    in_plane = [pin.JointModelPrismaticUnaligned(*t) for t in np.linalg.svd(axis[None])[2][1:]]
    turn, ball = pin.JointModelRevoluteUnaligned(*axis), pin.JointModelSpherical()
    end = pin.SE3(pin.Quaternion.FromTwoVectors(axis_b, axis).matrix(), np.zeros(3))
    joints = {
        "spherical": [ball],
        "rigid": [],
        "revolute": [turn],
        "prismatic": [slide],
        "cylindrical": [slide, turn],
        "universal": [turn],
        "planar": [*in_plane, turn],
        "point_on_line": [slide, ball],
        "point_on_plane": [*in_plane, ball],
        "distance": [ball],
    }[closure.kind]
    model = pin.Model()
    last = 0
    for index, joint in enumerate(joints):
        last = model.addJoint(last, joint, pin.SE3.Identity(), str(index))
    if closure.kind == "universal":  # the cross: b's axis stands across a's
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        cross = pin.Quaternion.FromTwoVectors(axis_b, across / np.linalg.norm(across))
        second = pin.JointModelRevoluteUnaligned(*axis_b)
        model.addJoint(last, second, pin.SE3(cross.matrix(), np.zeros(3)), "second")
        end = pin.SE3.Identity()
    if closure.kind == "distance":
        rod = pin.SE3(np.eye(3), np.array([closure.distance, 0.0, 0.0]))
        model.addJoint(last, pin.JointModelSpherical(), rod, "second")
    return model, end


def allowed_placement(closure: LoopClosure, rng: Rng) -> pin.SE3:
    """Frame b in frame a, the closure's joint moved by chance."""
    model, end = joint_of(closure)
    data = model.createData()
    pin.forwardKinematics(model, data, moved(rng, model, 0.7))
    return data.oMi[model.njoints - 1] * end


def moved(rng: Rng, model: pin.Model, spread: float) -> Array:
    """A configuration about the neutral one."""
    q: Array = pin.integrate(model, pin.neutral(model), spread * rng.normal(size=model.nv))
    return q


def random_closure(
    rng: Rng, kind: str, name: str = "", *, axis: Array | None = None, frames: str = "ab"
) -> LoopClosure:
    """A closure of a kind with axes in any direction, or along one in frame a."""
    a, b = (f"{name}{letter}" for letter in frames)
    options: dict[str, object] = {}
    if kind == "distance":
        options["distance"] = float(rng.uniform(0.3, 1.0))
    elif kind not in ("spherical", "rigid"):
        options["axis"] = rng.normal(size=3) if axis is None else axis
    if kind in ("revolute", "cylindrical", "universal", "planar"):
        options["axis_b"] = rng.normal(size=3)
    return LoopClosure(a, b, kind, name or f"{a} = {b}", **options)


def _closures(
    rng: Rng, model: pin.Model, q: Array, kinds: Sequence[str] | None, planar: bool
) -> list[Closure]:
    """One to three closures that leave some mobility, well conditioned; frames are added."""
    closures: list[Closure] = []
    wanted = int(rng.integers(1, 4))
    for attempt in range(12):
        must = bool(kinds) and not closures
        kind = kinds[0] if must else str(rng.choice(list(kinds or ALL_KINDS)))
        closure = (
            _COUPLINGS[kind](rng, model, q, f"loop_{attempt}")
            if kind in _COUPLINGS
            else _loop(rng, model, q, kind, f"loop_{attempt}_", planar)
        )
        if closure is not None and _regular(
            ClosedLoopModel(model, [*closures, closure], model.names[1]), q
        ):
            closures.append(closure)
        if len(closures) == wanted:
            return closures
    if closures:
        return closures
    raise RefusedError


def _loop(
    rng: Rng, model: pin.Model, q: Array, kind: str, name: str, planar: bool
) -> LoopClosure | None:
    """A closure of two bodies, or of one and the world, frame b standing where it may."""
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    joint_a, joint_b = (int(index) for index in rng.choice(model.njoints, size=2, replace=False))
    own = random_placement(rng)
    placed_a = data.oMi[joint_a] * own
    axis = None
    if planar and kind in ("revolute", "cylindrical", "universal", "planar"):
        axis = placed_a.rotation.T @ [0, 0, 1]
    if planar and kind == "prismatic":
        axis = placed_a.rotation.T @ (rng.normal(size=3) * [1, 1, 0])
    closure = random_closure(rng, kind, name, axis=axis)
    placed_b = placed_a * allowed_placement(closure, rng)
    for frame, joint, placement in (
        (closure.frame_a, joint_a, own),
        (closure.frame_b, joint_b, data.oMi[joint_b].actInv(placed_b)),
    ):
        model.addFrame(pin.Frame(frame, joint, 0, placement, pin.FrameType.OP_FRAME))
    return closure


def _coupling(rng: Rng, model: pin.Model, q: Array, name: str) -> JointCoupling | None:
    simple = [joint for joint in list(model.joints)[1:] if joint.nq == joint.nv == 1]
    if len(simple) < 2:
        return None
    first, second = rng.choice(len(simple), size=2, replace=False)
    one, other = simple[first], simple[second]
    ratio = float(rng.choice([-1, 1]) * rng.uniform(0.4, 2.0))
    offset = float(q[one.idx_q] - ratio * q[other.idx_q])
    return JointCoupling(model.names[one.id], model.names[other.id], ratio, offset, name)


def _polynomial(rng: Rng, model: pin.Model, q: Array, name: str) -> JointCoupling | None:
    """Of degree 2 to 5, about 1 in size near where the tree stands."""
    simple = [joint for joint in list(model.joints)[1:] if joint.nq == joint.nv == 1]
    if len(simple) < 2:
        return None
    first, second = rng.choice(len(simple), size=2, replace=False)
    one, other = simple[first], simple[second]
    x = float(q[other.idx_q])
    degrees = np.arange(1, int(rng.integers(2, 6)) + 1)
    above = rng.normal(size=degrees.size) / (degrees * (1 + abs(x)) ** degrees)
    below = float(q[one.idx_q] - above @ x**degrees)
    joints = (model.names[joint.id] for joint in (one, other))
    return JointCoupling(*joints, name=name, polynomial=(below, *above))


def _differential(rng: Rng, model: pin.Model, q: Array, name: str) -> JointCoupling | None:
    simple = [joint for joint in list(model.joints)[1:] if joint.nq == joint.nv == 1]
    if len(simple) < 3:
        return None
    one, *others = (simple[k] for k in rng.choice(len(simple), size=3, replace=False))
    ratios = {
        model.names[joint.id]: float(rng.choice([-1, 1]) * rng.uniform(0.4, 2)) for joint in others
    }
    offset = float(q[one.idx_q] - sum(ratios[model.names[j.id]] * q[j.idx_q] for j in others))
    return JointCoupling(model.names[one.id], ratios, offset=offset, name=name)


_COUPLINGS = {"coupling": _coupling, "polynomial": _polynomial, "differential": _differential}


def _regular(mechanism: ClosedLoopModel, q: Array) -> bool:
    """Whether its rank is beyond doubt, some mobility is left, and the closures do something."""
    jacobian = mechanism.jacobian(q)
    values = np.linalg.svd(jacobian, compute_uv=False)
    rank = int(np.count_nonzero(values > _REGULAR * values[0]))
    small = values[rank:]
    moving = values[0] > 0.1 and rank < mechanism.model.nv
    return bool(moving and (small < _ZERO * values[0]).all())


def _actuated(rng: Rng, probe: ClosedLoopModel, q: Array) -> list[str]:
    """Joints that determine the motion, well conditioned, in any order."""
    motions = probe.allowed_motions(q)
    joints = list(probe.model.joints)[1:]
    for _ in range(30):
        rows, chosen = np.zeros((0, motions.shape[1])), []
        for index in rng.permutation(len(joints)):
            joint = joints[index]
            more = np.vstack([rows, motions[joint.idx_v : joint.idx_v + joint.nv]])
            if more.shape[0] > more.shape[1]:
                continue
            if np.linalg.svd(more, compute_uv=False)[-1] > 0.1:
                rows = more
                chosen.append(str(probe.model.names[joint.id]))
        if rows.shape[0] == rows.shape[1]:
            return chosen
    raise RefusedError


def _take_masses(rng: Rng, probe: ClosedLoopModel, q: Array) -> None:
    """Make links massless as long as every motion moves some mass."""
    model, motions = probe.model, probe.allowed_motions(q)
    data = model.createData()

    def least() -> float:
        mass = np.array(pin.crba(model, data, q)).reshape(model.nv, model.nv)
        return float(np.linalg.eigvalsh(motions.T @ mass @ motions)[0])

    enough, taken = 0.05 * least(), 0
    for index in rng.permutation(np.arange(1, model.njoints)):
        kept = pin.Inertia(model.inertias[int(index)])
        model.inertias[int(index)] = pin.Inertia.Zero()
        if least() < enough:
            model.inertias[int(index)] = kept
        else:
            taken += 1
    if not taken:
        raise RefusedError


# Bodies one by one --------------------------------------------------------------------------------


def _cross(a: Array, b: Array) -> Array:
    """a x b of single vectors: `np.cross` takes twenty times as long."""
    (u, v, w), (x, y, z) = a.tolist(), b.tolist()
    return np.array([v * z - w * y, w * x - u * z, u * y - v * x])


def body_jacobians(model: pin.Model, q: Array) -> list[Array]:
    """Of each joint, from 1 on: the Jacobian of its body's twist in its own axes, (6, nv)."""
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    own = pin.ReferenceFrame.LOCAL
    return [
        np.array(pin.getJointJacobian(model, data, index, own)).reshape(6, model.nv)
        for index in range(1, model.njoints)
    ]


def mass_of_bodies(model: pin.Model, q: Array) -> Array:
    """The tree's mass matrix, sum of J' I J over the bodies, and rotors."""
    mass = np.diag(np.array(model.armature))
    for jacobian, inertia in zip(body_jacobians(model, q), list(model.inertias)[1:], strict=True):
        mass = mass + jacobian.T @ inertia.matrix() @ jacobian
    return mass


def inertia_wrenches(model: pin.Model, q: Array, v: Array, a: Array) -> list[Array]:
    """What moves each body as it moves, weight included: Newton's and Euler's laws, (6,) each.

    The wrench on the body of joint i, i = 1, ..., in that joint's axes at its origin, that must act
    beside the weight: force m (c'' - g), and I w' + w x I w about the centre of mass c.
    """
    data = model.createData()
    pin.forwardKinematics(model, data, q, v, a)
    wrenches = []
    for index in range(1, model.njoints):
        inertia, turn = model.inertias[index], data.oMi[index].rotation
        twist, rate = data.v[index], data.a[index]
        w, arm = twist.angular, inertia.lever
        origin = rate.linear + _cross(w, twist.linear)  # of the joint's origin, in body axes
        centre = origin + _cross(rate.angular, arm) + _cross(w, _cross(w, arm))
        force = inertia.mass * (centre - turn.T @ model.gravity.linear)
        spin = inertia.inertia @ rate.angular + _cross(w, inertia.inertia @ w)
        wrenches.append(np.concatenate([force, spin + _cross(arm, force)]))
    return wrenches


def force_of_bodies(c: Case, v: Array, a: Array, *, wrenches: bool = True) -> Array:
    """What actuators and closures must produce together: d'Alembert's principle, (nv,)."""
    mechanism, model = c.mechanism, c.mechanism.model
    force: Array = model.armature * a
    pairs = zip(body_jacobians(model, c.q), inertia_wrenches(model, c.q, v, a), strict=True)
    for jacobian, wrench in pairs:
        force = force + jacobian.T @ wrench
    if mechanism.effects is not None:
        force = force + resisting_force(mechanism.model, mechanism.effects, c.q, v)
    if wrenches:
        force = force - external_force(c)
    return force


def resisting_force(model: pin.Model, effects: JointEffects, q: Array, v: Array) -> Array:
    """Damping, friction and springs, joint by joint."""
    force = effects.damping * v + effects.friction * np.tanh(v / effects.friction_speed)
    return np.asarray(force + effects.stiffness * stretches(model, effects, q))


def stretches(model: pin.Model, effects: JointEffects, q: Array) -> Array:
    """How far the springs are from their rest, shape (nv,): rotation vectors of balls."""
    found = np.zeros(model.nv)
    for joint in list(model.joints)[1:]:
        at = slice(joint.idx_v, joint.idx_v + joint.nv)
        own, rest = q[joint.idx_q :][: joint.nq].copy(), effects.rest[at].copy()  # SciPy writes
        if joint.nq == joint.nv:
            found[at] = own - rest
        elif effects.stiffness[at].any():  # a ball or a free-flyer
            turn = Rotation.from_quat(own[-4:])
            stretch = (Rotation.from_rotvec(rest[-3:]).inv() * turn).as_rotvec()
            shift = turn.inv().apply(own[:-4] - rest[:-3]) if joint.nv == 6 else np.empty(0)
            found[at] = np.concatenate([shift, stretch])
    return found


def external_force(c: Case) -> Array:
    """The generalised force of the wrenches, by the motions of their frames' origins."""
    model = c.mechanism.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, c.q)
    jacobians = [np.zeros((6, model.nv)), *body_jacobians(model, c.q)]
    force = np.zeros(model.nv)
    for name, wrench in c.wrenches.items():
        frame = model.frames[model.getFrameId(name)]
        turn = data.oMi[frame.parentJoint].rotation
        push, moment = turn.T @ wrench[:3], turn.T @ wrench[3:]
        moment = moment + _cross(frame.placement.translation, push)
        force += jacobians[frame.parentJoint].T @ np.concatenate([push, moment])
    return force


def mechanical_energy(mechanism: ClosedLoopModel, q: Array, v: Array) -> float:
    """Of bodies, rotors and springs, J."""
    model = mechanism.model
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    energy = v @ mass_of_bodies(model, q) @ v / 2
    for index in range(1, model.njoints):
        inertia = model.inertias[index]
        energy -= inertia.mass * model.gravity.linear @ data.oMi[index].act(inertia.lever)
    if mechanism.effects is not None:
        stretch = stretches(model, mechanism.effects, q)
        energy += mechanism.effects.stiffness @ stretch**2 / 2
    return float(energy)


# Vectors and differences --------------------------------------------------------------------------


def unit(rng: Rng) -> Array:
    """Any direction."""
    direction = rng.normal(size=3)
    return np.asarray(direction / np.linalg.norm(direction))


def crosswise(rng: Rng, axis: Array) -> Array:
    """Any direction perpendicular to an axis."""
    direction = np.cross(axis, unit(rng))
    return np.asarray(direction / np.linalg.norm(direction))


def rotation(rng: Rng) -> Array:
    """Any rotation."""
    return np.asarray(pin.exp3(np.pi * rng.uniform(0, 1) * unit(rng)))


def random_placement(rng: Rng) -> pin.SE3:
    """Any placement within about 0.3 m."""
    return pin.SE3(rotation(rng), 0.3 * rng.normal(size=3))


def slopes(f: Callable[[Array], Array], size: int, h: float = 5e-4) -> Array:
    """The derivative of f about 0 by central differences of fourth order, shape (..., size)."""
    columns = []
    for direction in np.eye(size):
        near = f(h * direction) - f(-h * direction)
        far = f(2 * h * direction) - f(-2 * h * direction)
        columns.append((8 * near - far) / (12 * h))
    return np.stack(columns, axis=-1) if columns else np.zeros((*np.shape(f(np.zeros(0))), 0))


def gap_slope(mechanism: ClosedLoopModel, q: Array) -> Array:
    """The derivative of all gaps with respect to the configuration, by differences, (nc, nv)."""
    model = mechanism.model

    def gaps(step: Array) -> Array:
        position: Array = mechanism.loop_errors(pin.integrate(model, q, step)).position
        return position

    return slopes(gaps, model.nv)


def worst_error(found: Array, expected: Array, least: float = 1e-3) -> float:
    """Largest error relative to the largest entry expected, or to a least one."""
    error = np.abs(np.subtract(found, expected)).max(initial=0.0)
    return float(error / max(least, np.abs(expected).max(initial=0.0)))
