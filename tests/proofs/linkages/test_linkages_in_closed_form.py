"""Closed chains that people build, in urdf/: ankle, legs, differential, 3-RRS in closed form."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel
from tests.proofs.common import loaded
from tests.reference import jets
from tests.reference.parallel import ankle
from tests.worst import worst

Array = NDArray[np.float64]

GRAVITY = 9.81


def about(axis: str, angle: float) -> Array:
    """The rotation about a coordinate axis."""
    c, s, k = math.cos(angle), math.sin(angle), "xyz".index(axis)
    turn = np.eye(3)
    i, j = (k + 1) % 3, (k + 2) % 3
    turn[[i, j], [i, j]], turn[i, j], turn[j, i] = c, -s, s
    return turn


def angle_at_distance(
    centre: Array, arm: Array, target: Array, length: float, near: float
) -> float:
    """The turn of an arm about y that puts its tip at a distance from a target.

    |centre + R(t) arm - target|^2 = length^2 is a cos t + b sin t = c.
    """
    d = centre - target
    a = 2 * (d[0] * arm[0] + d[2] * arm[2])
    b = 2 * (d[0] * arm[2] - d[2] * arm[0])
    c = length**2 - d @ d - arm @ arm - 2 * d[1] * arm[1]
    both = [math.atan2(b, a) + sign * math.acos(c / math.hypot(a, b)) for sign in (-1, 1)]
    turns = [math.remainder(t - near, 2 * math.pi) for t in both]
    return near + min(turns, key=abs)


def coordinate(mechanism: ClosedLoopModel, q: Array, name: str) -> float:
    model = mechanism.model
    return float(q[model.joints[model.getJointId(name)].idx_q])


# Ankle --------------------------------------------------------------------------------------------


def ankle_cranks(pitch: float, roll: float) -> Array:
    """The cranks' angles of a foot's pose: the inverse kinematics of a 2-RSU."""
    return ankle.drives(jets.constant([pitch, roll])).value


def test_ankle_cranks() -> None:
    mechanism, rng = loaded("ankle"), np.random.default_rng(0)
    q = mechanism.home
    for _ in range(20):
        pitch, roll = rng.uniform(-0.4, 0.4), rng.uniform(-0.25, 0.25)
        q = mechanism.complete({"cross_joint": pitch, "foot_joint": roll}, mechanism.home)
        found = [coordinate(mechanism, q, f"{side}_crank_joint") for side in ("left", "right")]
        assert worst(found - ankle_cranks(pitch, roll)) < 1e-10


def test_ankle_speeds() -> None:
    """Cranks that turn as the closed form's derivative says turn the foot as asked."""
    mechanism, rng = loaded("ankle"), np.random.default_rng(1)
    h = 1e-4
    for _ in range(10):
        pose = rng.uniform([-0.4, -0.25], [0.4, 0.25])
        K = np.column_stack(
            [  # d cranks / d pose, of fourth order
                (
                    8 * (ankle_cranks(*(pose + d)) - ankle_cranks(*(pose - d)))
                    - ankle_cranks(*(pose + 2 * d))
                    + ankle_cranks(*(pose - 2 * d))
                )
                / (12 * h)
                for d in h * np.eye(2)
            ]
        )
        q = mechanism.complete({"cross_joint": pose[0], "foot_joint": pose[1]}, mechanism.home)
        v = mechanism.velocity(q, K @ [0.3, -0.7])
        model = mechanism.model
        foot = [v[model.joints[model.getJointId(n)].idx_v] for n in ("cross_joint", "foot_joint")]
        assert worst(np.array(foot) - [0.3, -0.7]) < 1e-8


# Legs ---------------------------------------------------------------------------------------------


def test_cassie_leg_hock_and_foot() -> None:
    """The achilles rod turns the hock with the knee; the shank's rod the foot with its crank."""
    mechanism, rng = loaded("cassie_leg"), np.random.default_rng(2)
    knee, shin = np.array([0.15, 0, -0.2]), np.array([-0.2, 0, -0.3])
    rod, heel = np.array([0.07, 0.04, -0.14]), np.array([-0.09, 0.03, 0.05])
    tarsus, crank, arm = (
        np.array(x) for x in ([0.07, 0, -0.36], [0.02, 0, -0.06], [-0.05, 0.02, 0.0])
    )
    back = np.array([-0.05, 0.025, 0.01])
    achilles = float(np.linalg.norm(knee + shin + heel - rod))
    shank = float(np.linalg.norm(tarsus + back - crank - arm))
    for _ in range(20):
        bend, turn = rng.uniform(-0.4, 0.4), rng.uniform(-0.5, 0.5)
        given = {"left_shin_joint": bend, "left_crank_joint": turn}
        q = mechanism.complete(given, mechanism.home)
        # the heel turns about the hock by the tarsus' angle in the shin, seen from the shin
        seen = about("y", bend).T @ (rod - knee)
        hock = angle_at_distance(shin, heel, seen, achilles, 0.0)
        assert coordinate(mechanism, q, "left_tarsus_joint") == pytest.approx(hock, abs=1e-10)
        tip = crank + about("y", turn) @ arm
        foot = angle_at_distance(tarsus, back, tip, shank, 0.0)
        assert coordinate(mechanism, q, "left_foot_joint") == pytest.approx(foot, abs=1e-10)


def test_minitaur_toe_in_polar_coordinates() -> None:
    """The pin lies on the bisector, at l1 cos(d) - sqrt(l2^2 - l1^2 sin(d)^2) along it."""
    mechanism, rng = loaded("minitaur_leg"), np.random.default_rng(3)
    q = mechanism.home
    for _ in range(30):
        left, right = rng.uniform(3.2, 4.1), rng.uniform(-0.9, -0.1)
        q = mechanism.complete({"left_upper_joint": left, "right_upper_joint": right}, q)
        middle, half = (left + right) / 2, (left - right) / 2
        r = 0.1 * math.cos(half) - math.sqrt(0.2**2 - (0.1 * math.sin(half)) ** 2)
        pin_at = mechanism.frame_placement(q, "left_lower_tip")[:3, 3]
        assert worst(pin_at - [r * math.cos(middle), 0.0, r * math.sin(middle)]) < 1e-12
        toe = mechanism.frame_placement(q, "toe")[:3, 3]
        elbow = 0.1 * np.array([math.cos(right), 0.0, math.sin(right)])
        assert worst(toe - (elbow + 1.1 * (pin_at - elbow))) < 1e-12


# Differential -------------------------------------------------------------------------------------


def test_differential_is_linear() -> None:
    """Gears (pitch + 1.5 roll, pitch - 1.5 roll); torques by the potential's gradient."""
    mechanism, rng = loaded("differential"), np.random.default_rng(4)
    W = np.array([[1.0, 1.5], [1.0, -1.5]])
    rest = np.zeros(mechanism.model.nv)

    def potential(pitch: float, roll: float) -> float:
        yoke = about("y", pitch) @ [0.005, 0.0, 0.002]
        arm = about("y", pitch) @ ([0.04, 0.0, 0.0] + about("x", roll) @ [0.17, 0.004, 0.01])
        return GRAVITY * (0.3 * yoke[2] + 1.1 * arm[2])

    for _ in range(10):
        pitch, roll = rng.uniform(-1.5, 1.5, 2)
        q = mechanism.complete({"yoke_joint": pitch, "arm_joint": roll}, mechanism.home)
        gears = [coordinate(mechanism, q, f"{side}_gear_joint") for side in ("left", "right")]
        assert worst(gears - W @ [pitch, roll]) < 1e-12
        h = 1e-3
        slope = np.array(
            [
                (
                    8 * (potential(pitch + dp, roll + dr) - potential(pitch - dp, roll - dr))
                    - potential(pitch + 2 * dp, roll + 2 * dr)
                    + potential(pitch - 2 * dp, roll - 2 * dr)
                )
                / (12 * h)
                for dp, dr in h * np.eye(2)
            ]
        )
        found = mechanism.inverse_dynamics(q, rest, rest).tau
        assert worst(found - np.linalg.solve(W.T, slope)) < 1e-10


# 3-RRS --------------------------------------------------------------------------------------------


def test_rrs_by_circles_in_the_legs_planes() -> None:
    """Platform poses that keep the balls in the legs' planes, and two-bar inverse kinematics."""
    mechanism, rng = loaded("rrs"), np.random.default_rng(5)
    base, proximal, distal, platform = 0.2, 0.15, 0.25, 0.12
    turns = [about("z", 2 * math.pi / 3 * i) for i in range(3)]
    for _ in range(20):
        R = pin.exp3(np.array([*rng.uniform(-0.25, 0.25, 2), 0.0]))
        out = np.array([R @ turn[:, 0] * platform for turn in turns])
        across = np.array([turn[:, 1] for turn in turns])
        x, *_ = np.linalg.lstsq(across[:, :2], -(across * out).sum(axis=1), rcond=None)
        p = np.array([*x, rng.uniform(0.2, 0.27)])
        assert worst((across * (p + out)).sum(axis=1)) < 1e-15  # the planes hold the torsion
        values = {"platform_joint": [*p, *pin.Quaternion(R).coeffs()]}
        for i, turn in enumerate(turns):
            radial, _, z = turn.T @ (p + out[i]) - [base, 0.0, 0.0]
            r = math.hypot(radial, z)
            bend = math.acos((r * r - proximal**2 - distal**2) / (2 * proximal * distal))
            reach = math.atan2(distal * math.sin(bend), proximal + distal * math.cos(bend))
            values[f"arm_{i + 1}_joint"] = math.atan2(z, radial) - reach
            values[f"shank_{i + 1}_joint"] = bend
        q = np.empty(mechanism.model.nq)
        for name, value in values.items():
            joint = mechanism.model.joints[mechanism.model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = value
        assert mechanism.loop_gap(q) < 1e-14
        driven = {name: values[name] for name in mechanism.actuated}
        found = mechanism.complete(driven, mechanism.home)
        assert worst(found - q) < 1e-9
