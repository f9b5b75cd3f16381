"""Stiffness: closed forms, direct stiffness of frames, energies, and equations of motion."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from rps_pin import (
    ClosedLoopModel,
    InputError,
    JointEffects,
    LoopClosure,
    SingularityError,
    Task,
)
from rps_pin.arrays import Array
from rps_pin.errors import MechanismError
from rps_pin.task.stiffness import Beam, Compliances, Deflection, Material, Section, StiffnessModel
from rps_pin.task.stiffness.compliances import DIRECTIONS
from tests.task import robots
from tests.task.frame_elements import Frame
from tests.worst import worst

STEEL = Material(210e9, 81e9)
UP = [0.0, 1.0, 0.0]


def random_section(rng: np.random.Generator) -> Section:
    return Section(*10 ** rng.uniform([-4, -8, -8, -8, -4, -4], [-3, -7, -7, -7, -3, -3]))


# One beam -----------------------------------------------------------------------------------------


def cantilever(beam: dict[str, object], turn: Array, length: float, mass: float = 0.0) -> Task:
    """Return a slide with one link, a beam in it to the tip."""
    model = pin.Model()
    model.gravity = pin.Motion(np.array([0.0, 0.0, -9.81, 0.0, 0.0, 0.0]))
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3(turn, np.zeros(3)), "slide")
    tip = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
    model.addFrame(pin.Frame("tip", joint, 0, tip, pin.FrameType.OP_FRAME))
    if mass:
        section = beam["section"]
        assert isinstance(section, Section)
        Iy, Iz = section.second_moment_y, section.second_moment_z
        rotary = mass / section.area * np.array([Iy + Iz, Iy, Iz])
        about = rotary + np.array([0.0, 1.0, 1.0]) * mass * length**2 / 12
        model.inertias[joint] = pin.Inertia(mass, tip.translation / 2, np.diag(about))
    mechanism = ClosedLoopModel(model, [], ["slide"])
    axis = "xyz"[int(np.argmax(abs(turn[:, 0])))]
    return Task(mechanism, "tip", [axis])


@pytest.mark.parametrize("segments", [1, 3])
def test_a_cantilever_is_that_of_the_books(segments: int) -> None:
    rng = np.random.default_rng(0)
    error: list[float] = []
    for _ in range(10):
        section, L, turn = random_section(rng), rng.uniform(0.2, 2), Rotation.random(rng=rng)
        beam = Beam("slide", "slide", "tip", section, STEEL, [0, 0, 1], segments)
        task = cantilever({}, turn.as_matrix(), L)
        found = StiffnessModel(task, Compliances(beams={"arm": beam}), gravity=False)
        C = found.deflection(task.mechanism.home).compliance
        E, G, Iy, Iz = 210e9, 81e9, section.second_moment_y, section.second_moment_z
        expected = np.diag(
            [
                L / (E * section.area),
                L**3 / (3 * E * Iz) + L / (G * section.shear_area_y),
                L**3 / (3 * E * Iy) + L / (G * section.shear_area_z),
                L / (G * section.torsion_constant),
                L / (E * Iy),
                L / (E * Iz),
            ]
        )
        expected[1, 5] = expected[5, 1] = L**2 / (2 * E * Iz)
        expected[2, 4] = expected[4, 2] = -(L**2) / (2 * E * Iy)
        axes = np.kron(np.eye(2), turn.as_matrix())
        expected = axes @ expected @ axes.T
        error.append(np.abs(C - expected).max() / np.abs(expected).max())
    assert worst(*error) < 1e-10


def test_weight_vibration_and_buckling_converge_with_the_segments() -> None:
    """To those of a uniform cantilever of Euler and Bernoulli, with the square of the segments."""
    width, height, L = 0.02, 0.01, 1.0
    whole = Section.rectangle(width, height)
    Iy = whole.second_moment_y
    section = Section(whole.area, Iy, whole.second_moment_z, whole.torsion_constant)
    density, E = 1000.0, 210e9
    line = density * section.area
    sag = line * 9.81 * L**4 / (8 * E * Iy)
    first = 1.8751040687**2 * np.sqrt(E * Iy / line) / L**2 / (2 * np.pi)
    critical = np.pi**2 * E * Iy / (4 * L**2)
    errors = []
    for segments in (4, 8):
        material = Material(E, 81e9, density)
        beam = Beam("slide", "slide", "tip", section, material, [0, 0, 1], segments)
        task = cantilever({"section": section}, np.eye(3), L, line * L)
        q = task.mechanism.home
        heavy = StiffnessModel(task, Compliances(beams={"arm": beam}))
        light = StiffnessModel(task, Compliances(beams={"arm": beam}), gravity=False)
        found = heavy.deflection(q)
        free = light.deflection(q)
        # The stiffness across falls nearly linearly with the load, to zero at the critical one.
        half = light.deflection(q, [-0.9 * critical, 0, 0, 0, 0, 0])
        fallen = free.compliance[2, 2] / half.compliance[2, 2]
        k = np.sqrt(0.9) * np.pi / 2
        column = k**3 / (3 * (np.tan(k) - k))  # of a beam column: tan u / u - 1 over u^2 / 3
        errors.append(
            [-found.displacement[2] / sag - 1, free.frequencies[0] / first - 1, fallen / column - 1]
        )
    coarse, fine = np.abs(errors)
    assert (fine < [3e-3, 1e-3, 0.1]).all()
    assert np.allclose(coarse / fine, 4.0, rtol=0.2)


# Bearings -----------------------------------------------------------------------------------------


def test_bearings_in_a_row_add_their_compliances() -> None:
    """A drive, its slide's bearing, and that of a closure whose frame b is turned."""
    rng = np.random.default_rng(5)
    pin.seed(5)
    errors = []
    for _ in range(5):
        slide, foot, tip = (pin.SE3.Random() for _ in range(3))
        model = pin.Model()
        first = model.addJoint(0, pin.JointModelPX(), slide, "slide")
        second = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
        kind = pin.FrameType.OP_FRAME
        mount = pin.SE3.Random()
        model.addFrame(pin.Frame("mount", first, 0, mount, kind))
        model.addFrame(pin.Frame("foot", second, 0, foot, kind))
        model.addFrame(pin.Frame("tip", second, 0, tip, kind))
        closure = LoopClosure("mount", "foot", "rigid", name="weld")
        start = pin.neutral(model)
        start[1:] = pin.SE3ToXYZQUAT(slide * mount * foot.inverse())
        mechanism = ClosedLoopModel(model, [closure], ["slide"], home=start)
        axis = "xyz"[int(np.argmax(np.abs(slide.rotation[:, 0])))]
        k, joint, weld = 10 ** rng.uniform(4, 6), *10 ** rng.uniform(4, 6, (2, 6))
        given = Compliances(
            actuators={"slide": k},
            joints={"slide": dict(zip(DIRECTIONS[1:], joint[1:], strict=True))},
            closures={"weld": dict(zip(DIRECTIONS, weld, strict=True))},
        )
        task = Task(mechanism, "tip", [axis])
        found = StiffnessModel(task, given).deflection(mechanism.home).compliance
        joint[0] = k
        at = slide * mount * foot.inverse() * tip
        expected = sum(
            moved_to(at, frame) @ np.diag(1 / values) @ moved_to(at, frame).T
            for frame, values in ((slide, joint), (slide * mount, weld))
        )
        errors.append(np.abs(found - expected).max() / np.abs(expected).max())
    assert worst(*errors) < 1e-9


def moved_to(place: pin.SE3, frame: pin.SE3) -> Array:
    """Return the matrix that takes twists of a frame to those of a place in world axes."""
    turn = frame.rotation
    lever = frame.translation - place.translation
    return np.block([[turn, pin.skew(lever) @ turn], [np.zeros((3, 3)), turn]])


# The overconstrained four-bar ---------------------------------------------------------------------


class FourBar(NamedTuple):
    model: StiffnessModel
    beams: dict[str, Beam]


def four_bar(rng: np.random.Generator) -> FourBar:
    ends = {
        "crank": ("crank_joint", "coupler_joint"),
        "coupler": ("coupler_joint", "knee"),
        "rocker": ("rocker_joint", "knee"),
    }
    beams = {
        link: Beam(link, start, end, random_section(rng), STEEL, UP)
        for link, (start, end) in ends.items()
    }
    given = Compliances(beams=beams)
    return FourBar(
        StiffnessModel(four_bar_task(), given, frame="coupler_tip", gravity=False), beams
    )


@cache
def four_bar_task() -> Task:
    return ClosedLoopModel.load("urdf/four_bar.yaml").task


def assembled(case: FourBar, q: Array) -> tuple[Array, Array]:
    """Return the coupler tip's compliance and the wrench of the rocker on it."""
    mechanism = four_bar_task().mechanism
    places = [
        mechanism.frame_placement(q, name)[:3, 3]
        for name in ("crank_joint", "coupler_joint", "coupler_tip", "rocker_joint")
    ]
    A, B, C, D = places
    frame = Frame(26)
    # At hinges everything is shared but the turn about y.
    at_a, at_b, at_c, at_d = (list(range(k, k + 6)) for k in (0, 6, 13, 20))
    coupler_b, rocker_c = [*at_b], [*at_c]
    coupler_b[4], rocker_c[4] = 12, 19
    frame.add(case.beams["crank"], (A, B), _axes(A, B), [*at_a, *at_b])
    frame.add(case.beams["coupler"], (B, C), _axes(B, C), [*coupler_b, *at_c])
    rocker = frame.add(case.beams["rocker"], (D, C), _axes(D, C), [*at_d, *rocker_c])
    loads = np.zeros((26, 6))
    loads[at_c] = np.eye(6)
    moved = frame.solve(loads, [*at_a, 20, 21, 22, 23, 25])
    return moved[at_c], -frame.end_forces(rocker, moved)[6:]


def _axes(a: Array, b: Array) -> Array:
    x = (b - a) / np.linalg.norm(b - a)
    return np.column_stack([x, np.cross(UP, x), UP])


def test_the_overconstrained_four_bar_is_the_assembled_frame() -> None:
    """Compliance, and the reaction in the closure of which three of five rows are redundant."""
    rng = np.random.default_rng(1)
    compliance: list[float] = []
    reaction: list[float] = []
    energy: list[float] = []
    mechanism = four_bar_task().mechanism
    for angle in (0.4, 1.0, 2.2, 4.0):
        case, q = four_bar(rng), mechanism.complete([angle], mechanism.home)
        C, W = assembled(case, q)
        found = case.model.deflection(q)
        compliance.append(np.abs(found.compliance - C).max() / np.abs(C).max())
        load = rng.normal(size=6) * 1e-3
        loaded = case.model.deflection(q, load)
        expected = W @ load
        reaction.append(
            np.abs(loaded.closure_wrenches["knee"] - expected).max() / np.abs(expected).max()
        )
        energy.append(abs(2 * loaded.energy / (load @ C @ load) - 1))
        assert loaded.undetermined == ()
    assert worst(*compliance) < 1e-9
    assert worst(*reaction) < 1e-5
    assert worst(*energy) < 1e-5


def test_a_rigid_part_that_is_held_twice_is_named() -> None:
    mechanism = four_bar_task().mechanism
    drive = Compliances(actuators={"crank_joint": 1e4})
    found = StiffnessModel(four_bar_task(), drive).deflection(mechanism.home, [5.0])
    assert found.undetermined == ("knee",)
    tau = found.actuator_forces["crank_joint"]
    assert tau == pytest.approx(-1e4 * found.stretch[0])


# The Stewart platform in closed form --------------------------------------------------------------


@cache
def stewart() -> Task:
    return ClosedLoopModel.load("urdf/stewart.yaml").task


class Legs:
    """A Stewart platform by its points: six springs between them, and a force on the platform."""

    def __init__(self, q: Array, stiffness: Array, force: Array) -> None:
        mechanism = stewart().mechanism
        data = mechanism.model.createData()
        pin.forwardKinematics(mechanism.model, data, q)
        place = mechanism.frame_placement(q, "platform")
        self.start, self.at = Rotation.from_matrix(place[:3, :3]), place[:3, 3]
        base, balls = [], []
        for leg in range(1, 7):
            index = mechanism.model.getJointId(f"leg_{leg}_rod_joint")
            while mechanism.model.parents[index] != 0:
                index = mechanism.model.parents[index]
            base.append(np.array(data.oMi[index].translation))
            balls.append(mechanism.frame_placement(q, f"platform_ball_{leg}")[:3, 3])
        self.base, self.balls = np.array(base), self.start.inv().apply(np.array(balls) - self.at)
        self.k, self.force = stiffness, force
        self.rest = self.lengths(np.zeros(6))

    def lengths(self, y: Array) -> Array:
        """Return the legs' lengths where the platform is displaced by y, shift and turn."""
        points = (Rotation.from_rotvec(y[3:]) * self.start).apply(self.balls)
        return np.linalg.norm(self.at + y[:3] + points - self.base, axis=1)

    def energy(self, y: Array) -> float:
        stretch = self.lengths(y) - self.rest
        return float(self.k @ stretch**2 / 2 - self.force @ y[:3])

    def jacobian(self, y: Array) -> Array:
        return _differences(self.lengths, y, 1e-5)

    def slope(self, y: Array) -> Array:
        pushed = self.jacobian(y).T @ (self.k * (self.lengths(y) - self.rest))
        pushed[:3] -= self.force
        return np.asarray(pushed)

    def move(self, y: Array) -> None:
        """Measure displacements from another pose; the springs' lengths at rest stay."""
        self.at = self.at + y[:3]
        self.start = Rotation.from_rotvec(y[3:]) * self.start


def test_a_stewart_platform_is_its_legs_energy() -> None:
    """Equilibrium by SciPy, stiffness by differences of the energy of six springs.

    The energy, sum k (l(p, r) - l_0)^2 / 2 - f . p, has the platform's place p and rotation vector
    r from the equilibrium: this is K = J' k J and the geometric part of legs under load.
    """
    rng = np.random.default_rng(2)
    task = stewart()
    actuated = task.mechanism.actuated
    moved, stiffness, geometric = [], [], []
    for _ in range(3):
        q = task.configuration(task.home + rng.uniform(-0.05, 0.05, 6) * [1, 1, 1, 2, 2, 2])
        k, force = rng.uniform(1e5, 3e5, 6), rng.normal(size=3) * 2e3
        drives = Compliances(actuators=dict(zip(actuated, k, strict=True)))
        model = StiffnessModel(task, drives, gravity=False)
        found = model.deflection(q, [*force, 0, 0, 0])
        legs = Legs(q, k, force)
        y = root(legs.slope, np.zeros(6), tol=1e-13).x
        moved.append(np.abs(found.displacement - y).max() / np.abs(y).max())
        legs.move(y)
        K, J = _hessian(legs.energy, 3e-4), legs.jacobian(np.zeros(6))
        stiffness.append(np.abs(found.stiffness - K).max() / np.abs(K).max())
        geometric.append(np.abs(K - J.T @ (k[:, None] * J)).max() / np.abs(K).max())
    assert worst(*moved) < 1e-8
    assert worst(*stiffness) < 1e-6
    assert min(geometric) > 1e-3  # the part is there to be seen


def _differences(function: Callable[[Array], Array], y: Array, h: float) -> Array:
    steps = h * np.eye(y.size)
    return np.array([function(y + s) - function(y - s) for s in steps]).T / (2 * h)


def _hessian(energy: Callable[[Array], float], h: float) -> Array:
    """Return second differences at zero, by Richardson's extrapolation, shape (6, 6)."""
    found = []
    for step in (h, 2 * h):
        e = step * np.eye(6)
        found.append(
            [
                [
                    (energy(a + b) - energy(a - b) - energy(b - a) + energy(-a - b)) / (4 * step**2)
                    for b in e
                ]
                for a in e
            ]
        )
    fine, coarse = np.array(found)
    return np.asarray((4 * fine - coarse) / 3)


# Any mechanism ------------------------------------------------------------------------------------


ROBOTS = ("sokolov", "five_bar", "delta", "rotary_stewart")


def bearings(task: Task, rng: np.random.Generator) -> Compliances:
    """Return drives, and bearings of all joints and closures in directions that they hold."""
    model = task.mechanism.model
    joints = {}
    for index in range(1, model.njoints):
        joint = model.joints[index]
        if joint.nv != 1 or model.names[index] in task.coordinates:
            continue
        moves = _subspace(joint)
        held = [
            d
            for d, part in zip(["x", "y", "z", "rx", "ry", "rz"], moves, strict=True)
            if part < 0.5
        ]
        joints[model.names[index]] = {d: 10 ** rng.uniform(5, 6) for d in held}
    drives = {name: 10 ** rng.uniform(4, 5) for name in task.mechanism.actuated}
    return Compliances(actuators=drives, joints=joints)


def _subspace(joint: object) -> Array:
    data = joint.createData()  # type: ignore[attr-defined]
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Identity(), "one")
    joint.calc(data, pin.neutral(model))  # type: ignore[attr-defined]
    return np.abs(np.array(data.S)).reshape(6)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_compliance_is_the_slope_of_the_deflection(name: str) -> None:
    """By differences of loaded equilibria; so is Maxwell's reciprocity, of shifts and forces."""
    rng = np.random.default_rng(3)
    task = robots.task(name)
    model = StiffnessModel(task, bearings(task, rng))
    q = task.mechanism.home
    load = np.concatenate([rng.normal(size=3) * 20, np.zeros(3)])
    if len(model.output) < 6:
        pytest.skip("a task of joints")
    found = model.deflection(q, load)
    slope = np.empty((6, 3))
    for k in range(3):
        step = np.eye(6)[k] * 1.0
        more, less = (model.deflection(q, load + s * step) for s in (1, -1))
        place = [more, less]
        slope[:, k] = (place[0].displacement - place[1].displacement) / 2
    C = found.compliance
    assert np.abs(slope[:3] - C[:3, :3]).max() < 1e-5 * np.abs(C[:3, :3]).max()
    assert np.abs(slope[:3] - slope[:3].T).max() < 1e-5 * np.abs(C[:3, :3]).max()


@pytest.mark.parametrize("name", ROBOTS)
def test_frequencies_are_those_of_the_equations_of_motion(name: str) -> None:
    """Of the same mechanism with springs at its actuated joints: `linearize` of forward dynamics.

    It is at rest where the deflection is, by its forward dynamics.
    """
    rng = np.random.default_rng(4)
    task = robots.task(name)
    mechanism = task.mechanism
    q = mechanism.home
    k = 10 ** rng.uniform(4, 5, len(mechanism.actuated))
    drives = dict(zip(mechanism.actuated, k, strict=True))
    model = StiffnessModel(task, Compliances(actuators=drives))
    found = model.deflection(q)
    at = found.configuration
    assert at.shape == q.shape  # no joints were added
    rest = dict(zip(mechanism.actuated, q[task.of_actuators], strict=True))
    effects = JointEffects.named(mechanism.model, stiffness=drives, rest=rest)
    sprung = with_effects(mechanism, effects)
    a = sprung.forward_dynamics(at, np.zeros(mechanism.model.nv), np.zeros(k.size))
    assert np.abs(a).max() < 1e-6
    A = sprung.linearize(at, np.zeros(mechanism.model.nv), np.zeros(k.size)).A
    omega = np.sort(np.abs(np.linalg.eigvals(A).imag))[::2]
    expected = np.sort(omega) / (2 * np.pi)
    assert np.allclose(found.frequencies, expected, rtol=1e-7)


def with_effects(mechanism: ClosedLoopModel, effects: JointEffects) -> ClosedLoopModel:
    return ClosedLoopModel(
        mechanism.model,
        mechanism.closures,
        mechanism.actuated,
        home=mechanism.home,
        effects=effects,
        characteristic_length=mechanism.characteristic_length,
    )


def test_a_joint_task_has_the_stiffness_of_its_drive() -> None:
    """With K of the task: C = K^-1 c K^-T of the drive's compliance c, without load."""
    task = four_bar_task()
    drive = Compliances(actuators={"crank_joint": 1e4})
    found = StiffnessModel(task, drive, gravity=False).deflection(task.mechanism.home)
    K = task.jacobian(task.mechanism.home)
    assert found.output == ("rocker_joint",)
    assert found.compliance == pytest.approx(1e-4 / K[0, 0] ** 2)
    assert found.stiffness == pytest.approx(1e4 * K[0, 0] ** 2)


# Errors -------------------------------------------------------------------------------------------


def rigid_in_part() -> Deflection:
    task = robots.task("five_bar")
    drives = Compliances(actuators=dict.fromkeys(task.mechanism.actuated, 1e4))
    return StiffnessModel(task, drives).deflection(task.mechanism.home)


def test_a_rigid_direction_has_no_stiffness() -> None:
    found = rigid_in_part()
    assert found.compliance[1] == pytest.approx(0, abs=1e-12)
    with pytest.raises(SingularityError, match=r"rigid in a direction \(.*y"):
        _ = found.stiffness


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"actuators": {"crank": 1.0}}, "no actuator 'crank'; there are: crank_joint"),
        ({"joints": {"knee": {"x": 1.0}}}, "no joint 'knee'; there are: crank_joint"),
        ({"closures": {"elbow": {"x": 1.0}}}, "no closure 'elbow'; there are: knee"),
        ({"joints": {"coupler_joint": {"ry": 1.0}}}, "moves freely in direction ry"),
    ],
)
def test_what_there_is_not_is_told(given: dict[str, dict[str, object]], match: str) -> None:
    with pytest.raises(MechanismError, match=match):
        StiffnessModel(four_bar_task(), Compliances(**given))


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"actuators": {"crank_joint": -1.0}}, "stiffness of actuator 'crank_joint' = -1.0"),
        ({"joints": {"coupler_joint": {"xx": 1.0}}}, "no direction 'xx'"),
        ({}, "nothing gives way"),
    ],
)
def test_numbers_that_cannot_be_are_told(given: dict[str, dict[str, object]], match: str) -> None:
    with pytest.raises(InputError, match=match):
        StiffnessModel(four_bar_task(), Compliances(**given))


def test_what_nothing_holds_is_told() -> None:
    """A mechanism with a drive too few."""
    task = robots.task("five_bar")
    mechanism = task.mechanism.with_actuated(["left_joint"])
    loose = Task(mechanism, "tip" if mechanism.model.existFrame("tip") else task.frame, ["x", "z"])
    model = StiffnessModel(loose, Compliances(actuators={"left_joint": 1e4}))
    with pytest.raises(SingularityError, match="nothing holds it here in 1 of its directions"):
        model.deflection(mechanism.home)


def test_beams_heavier_than_their_link_are_told() -> None:
    beam = Beam("slide", "slide", "tip", Section.tube(0.05), Material(210e9, 81e9, 7850.0))
    task = cantilever({"section": beam.section}, np.eye(3), 1.0, 1.0)
    with pytest.raises(MechanismError, match="leave out the density"):
        StiffnessModel(task, Compliances(beams={"arm": beam}))
