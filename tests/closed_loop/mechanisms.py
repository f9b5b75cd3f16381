"""Mechanisms that are not the 3-RPS, with closed forms that share nothing with the package."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, LoopClosure, RPSRobot

Array = NDArray[np.float64]
State = tuple[Array, Array, Array]

GRAVITY = 9.81
STEP = 1e-40  # of complex steps


def link(name: str, mass: float = 0.0, com: str = "0 0 0", inertia: float = 0.0) -> str:
    """A link; its inertia is that of a sphere, about its centre of mass."""
    if not mass:
        return f'<link name="{name}"/>'
    return (
        f'<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/><inertia '
        f'ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial>'
        "</link>"
    )


def joint(
    kind: str, parent: str, child: str, xyz: str = "0 0 0", axis: str = "0 -1 0", name: str = ""
) -> str:
    """A joint, named after its child if it has no name; about -y, x turns towards z."""
    moving = ""
    if kind != "fixed":
        moving = f'<axis xyz="{axis}"/><limit lower="-9" upper="9" effort="9" velocity="9"/>'
    return (
        f'<joint name="{name or child + "_joint"}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{xyz}"/>{moving}</joint>'
    )


def robot(*parts: str) -> str:
    return f'<robot name="mechanism"><link name="base"/>{"".join(parts)}</robot>'


def loop_jacobian(mechanism: ClosedLoopModel, q: Array) -> Array:
    """The closures' Jacobian at a closed q, from the Jacobians of their frames."""
    model = mechanism.model
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    rows = []
    for closure in mechanism.closures:
        a, b = (
            pin.getFrameJacobian(model, data, model.getFrameId(frame), axes)
            for frame in (closure.frame_a, closure.frame_b)
        )
        rows.append((a - b)[: closure.size])
    return np.concatenate(rows)


def derivative(f: Callable[[float], Array], at: float = 0.0, h: float = 5e-4) -> Array:
    """Central difference of fourth order."""
    return (f(at - 2 * h) - 8 * f(at - h) + 8 * f(at + h) - f(at + 2 * h)) / (12 * h)


def second_derivative(f: Callable[[float], Array], at: float = 0.0, h: float = 1e-3) -> Array:
    """Central difference of fourth order."""
    outer, inner = f(at - 2 * h) + f(at + 2 * h), f(at - h) + f(at + h)
    return (16 * inner - outer - 30 * f(at)) / (12 * h**2)


# The planar four-bar ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Bar:
    """A bar with its centre of mass at (along, across) from its first joint."""

    length: float
    mass: float
    along: float
    across: float
    inertia: float

    def urdf(self, name: str) -> str:
        return link(name, self.mass, f"{self.along} 0 {self.across}", self.inertia)


def turned(u: Array) -> Array:
    """A plane vector (x, z), a quarter turn from x towards z."""
    return np.array([-u[1], u[0]])


def cross(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


@dataclass(frozen=True)
class FourBar:
    """Crank from (0, 0), rocker from (ground, 0), a coupler between, in the x-z plane.

    The crank is driven. Everything is worked out in the plane, with vectors (x, z), from the
    intersection of two circles; complex-safe in the crank's angle.
    """

    ground: float = 0.45
    crank: Bar = Bar(0.2, 1.1, 0.08, 0.03, 0.02)
    coupler: Bar = Bar(0.5, 2.3, 0.3, -0.05, 0.07)
    rocker: Bar = Bar(0.4, 0.9, 0.15, 0.02, 0.05)

    def urdf(self) -> str:
        """The open tree; the coupler carries a knee, free to turn, where the rocker ends."""
        return robot(
            self.crank.urdf("crank"),
            self.coupler.urdf("coupler"),
            self.rocker.urdf("rocker"),
            *(link(name) for name in ("coupler_tip", "knee", "rocker_tip")),
            joint("revolute", "base", "crank"),
            joint("revolute", "crank", "coupler", f"{self.crank.length} 0 0"),
            joint("revolute", "base", "rocker", f"{self.ground} 0 0"),
            joint("fixed", "coupler", "coupler_tip", f"{self.coupler.length} 0 0"),
            joint("revolute", "coupler", "knee", f"{self.coupler.length} 0 0"),
            joint("fixed", "rocker", "rocker_tip", f"{self.rocker.length} 0 0"),
        )

    def mechanism(self, **options: object) -> ClosedLoopModel:
        """Closed rigidly at the knee: six rows, three of them redundant."""
        closure = LoopClosure("knee", "rocker_tip", "rigid", name="knee")
        options = {"actuated": ["crank_joint"]} | options
        return ClosedLoopModel.from_urdf(self.urdf(), [closure], **options)

    def spherical_mechanism(self, **options: object) -> ClosedLoopModel:
        """Without the knee, closed by a point: three rows, one of them redundant."""
        urdf = self.urdf().replace(
            joint("revolute", "coupler", "knee", f"{self.coupler.length} 0 0"), ""
        )
        closure = LoopClosure("coupler_tip", "rocker_tip", name="tips")
        options = {"actuated": ["crank_joint"]} | options
        return ClosedLoopModel.from_urdf(urdf.replace(link("knee"), ""), [closure], **options)

    def directions(self, angle: complex) -> tuple[Array, Array, Array]:
        """Unit vectors of crank, coupler and rocker."""
        crank = np.array([np.cos(angle), np.sin(angle)])
        gap = np.array([self.ground, 0]) - self.crank.length * crank
        squared = gap @ gap
        b, c = self.coupler.length, self.rocker.length
        t = (squared + b**2 - c**2) / (2 * squared)
        coupler = (t * gap + np.sqrt(b**2 / squared - t**2) * turned(gap)) / b
        return crank, coupler, (b * coupler - gap) / c

    def bodies(self, angle: complex) -> list[tuple[Bar, Array, Array, Array]]:
        """Of each bar: itself, its first joint, its centre of mass, its direction."""
        crank, coupler, rocker = self.directions(angle)
        joints = (np.zeros(2), self.crank.length * crank, np.array([self.ground, 0.0]))
        bars = zip(
            (self.crank, self.coupler, self.rocker), joints, (crank, coupler, rocker), strict=True
        )
        return [
            (bar, place, place + bar.along * u + bar.across * turned(u), u)
            for bar, place, u in bars
        ]

    def joint_values(self, angle: float) -> dict[str, float]:
        crank, coupler, rocker = (np.arctan2(u[1], u[0]) for u in self.directions(angle))
        return {
            "crank_joint": crank,
            "coupler_joint": coupler - crank,
            "rocker_joint": rocker,
            "knee_joint": rocker - coupler,
        }

    def joint_rates(self, angle: float) -> dict[str, float]:
        """Per crank rate: a unit vector u turns at turned(u) . u'."""
        now = self.directions(angle)
        ahead = [np.imag(u) / STEP for u in self.directions(angle + 1j * STEP)]
        crank, coupler, rocker = (turned(u) @ du for u, du in zip(now, ahead, strict=True))
        return {
            "crank_joint": crank,
            "coupler_joint": coupler - crank,
            "rocker_joint": rocker,
            "knee_joint": rocker - coupler,
        }

    def inertia(self, angle: float) -> float:
        """The one generalised inertia M: kinetic energy M rate^2 / 2."""
        return sum(
            bar.mass * (dcom @ dcom) + bar.inertia * (du @ du)
            for bar, dcom, du in self.rates(angle)
        )

    def rates(self, angle: float) -> list[tuple[Bar, Array, Array]]:
        """Derivatives of centres of mass and directions with respect to the crank's angle."""
        return [
            (bar, np.imag(com) / STEP, np.imag(u) / STEP)
            for bar, _, com, u in self.bodies(angle + 1j * STEP)
        ]

    def torque(self, angle: float, rate: float, acceleration: float) -> float:
        """Lagrange: M q'' + M' q'^2 / 2 + V'."""
        slope = derivative(lambda x: np.array(self.inertia(x)), angle)
        weight = sum(bar.mass * GRAVITY * dcom[1] for bar, dcom, _ in self.rates(angle))
        return float(self.inertia(angle) * acceleration + slope * rate**2 / 2 + weight)

    def knee_force(self, angle: float, rate: float, acceleration: float) -> Array:
        """Force (x, z) of the rocker on the coupler: the moments of each about its other joint."""
        bends = [(derivative(lambda x, i=i: self.rates(x)[i][1], angle), i) for i in range(3)]
        turns = [derivative(lambda x, i=i: self.rates(x)[i][2], angle) for i in range(3)]
        matrix, right = np.zeros((2, 2)), np.zeros(2)
        for row, (i, sign) in enumerate(((1, 1.0), (2, -1.0))):
            bar, place, com, u = self.bodies(angle)[i]
            _, dcom, du = self.rates(angle)[i]
            pull = bends[i][0] * rate**2 + dcom * acceleration + [0, GRAVITY]
            spin = turned(u) @ (turns[i] * rate**2 + du * acceleration)
            arm = sign * bar.length * u
            matrix[row] = -arm[1], arm[0]
            right[row] = cross(com - place, bar.mass * pull) + bar.inertia * spin
        return np.linalg.solve(matrix, right)


def values(mechanism: ClosedLoopModel, of_joints: dict[str, float]) -> Array:
    """Values of one-coordinate joints in the order of the model."""
    return np.array([of_joints[name] for name in list(mechanism.model.names)[1:]])


# A spatial four-bar, and a planar five-bar --------------------------------------------------------


def spatial_four_bar(**options: object) -> ClosedLoopModel:
    """Revolute crank, universal joint, coupler, a ball, a rocker about a slanted axis.

    Three passive joints and three rows, none redundant.
    """
    urdf = robot(
        link("crank", 1.2, "0.1 0.01 0.02", 0.02),
        link("cross", 0.1, "0 0 0", 0.001),
        link("coupler", 2.0, "0.25 0.02 -0.03", 0.06),
        link("rocker", 1.5, "0.02 0.05 0.2", 0.04),
        link("coupler_tip"),
        link("rocker_tip"),
        joint("revolute", "base", "crank", axis="0 0 1"),
        joint("revolute", "crank", "cross", "0.2 0 0.05", "0 1 0"),
        joint("revolute", "cross", "coupler", "0 0 0", "0 0 1"),
        joint("revolute", "base", "rocker", "0.6 0.1 0", "0.6 0.8 0"),
        joint("fixed", "coupler", "coupler_tip", "0.5 0 0"),
        joint("fixed", "rocker", "rocker_tip", "0 0 0.35"),
    )
    closure = LoopClosure("coupler_tip", "rocker_tip", name="ball")
    return ClosedLoopModel.from_urdf(urdf, [closure], **({"actuated": ["crank_joint"]} | options))


def five_bar(**options: object) -> ClosedLoopModel:
    """Planar, of mobility 2, driven at both ends."""
    bar = "0.15 0 0.01"
    urdf = robot(
        link("left", 1.0, bar, 0.02),
        link("left_arm", 0.8, bar, 0.02),
        link("right", 1.1, bar, 0.03),
        link("right_arm", 0.7, bar, 0.01),
        link("left_tip"),
        link("right_tip"),
        joint("revolute", "base", "left"),
        joint("revolute", "left", "left_arm", "0.3 0 0"),
        joint("revolute", "base", "right", "0.4 0 0"),
        joint("revolute", "right", "right_arm", "0.3 0 0"),
        joint("fixed", "left_arm", "left_tip", "0.4 0 0"),
        joint("fixed", "right_arm", "right_tip", "0.4 0 0"),
    )
    closure = LoopClosure("left_tip", "right_tip", name="tips")
    actuated = {"actuated": ["left_joint", "right_joint"]}
    return ClosedLoopModel.from_urdf(urdf, [closure], **(actuated | options))


def guess(mechanism: ClosedLoopModel) -> Array:
    """A rough guess from which the spatial four-bar, or the five-bar, closes."""
    names = list(mechanism.model.names)[1:]
    rough = {"left_joint": 2.2, "left_arm_joint": -1.2, "right_joint": 0.9, "right_arm_joint": 1.2}
    return np.array([rough.get(name, 0.3) for name in names])


def wide_apart() -> ClosedLoopModel:
    """A four-bar whose bars (1.1 m) are too short for its ground (1.5 m): 0.4 m stay open."""
    return FourBar(ground=1.5).spherical_mechanism()


# The mechanisms that the tests run through --------------------------------------------------------

FOUR_BAR = FourBar()


def rigid() -> ClosedLoopModel:
    return FOUR_BAR.mechanism()


def spherical() -> ClosedLoopModel:
    return FOUR_BAR.spherical_mechanism()


def three_rps() -> ClosedLoopModel:
    return RPSRobot.from_preset("sokolov").mechanism


def closed_guess(mechanism: ClosedLoopModel) -> Array:
    """Some closed configuration, well away from singular ones."""
    if mechanism.model.existJointName("platform_free"):
        pose = [0.4, 0.2, -0.1], [0, 0, 0], [0, 0, 0]
        return RPSRobot.from_preset("sokolov").state(*pose)[0]
    if mechanism.model.existJointName("coupler_joint") and not mechanism.model.existJointName(
        "cross_joint"
    ):
        return values(mechanism, FOUR_BAR.joint_values(1.0))
    return mechanism.close(guess(mechanism))


def state(mechanism: ClosedLoopModel, seed: int = 0) -> State:
    rng = np.random.default_rng(seed)
    q = closed_guess(mechanism)
    v = mechanism.velocity(q, rng.normal(size=len(mechanism.actuated)))
    return q, v, mechanism.acceleration(q, v, rng.normal(size=len(mechanism.actuated)))


def build(**changes: object) -> ClosedLoopModel:
    arguments = {
        "path_or_xml": FOUR_BAR.urdf(),
        "closures": [LoopClosure("knee", "rocker_tip", "rigid")],
        "actuated": ["crank_joint"],
    }
    return ClosedLoopModel.from_urdf(**(arguments | changes))


ALL = [rigid, spherical, spatial_four_bar, five_bar, three_rps]
every_mechanism = pytest.mark.parametrize("make", ALL, ids=lambda make: make.__name__)
