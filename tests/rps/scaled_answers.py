"""Every call of a 3-RPS, its answers counted in other units; see `tests.scaled`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rps_pin import RPSParameters, RPSPinError, RPSRobot, helix
from rps_pin.rps import (
    EncoderTracker,
    Payload,
    check_path,
    force_causes,
    joint_reactions,
    leg_jacobians,
    pose_from_placement,
    pose_from_position,
    singular_surface,
    singularity_measures,
    size_trajectory,
    time_optimal,
)
from rps_pin.rps.workspace import leg_grid, pose_grid, workspace
from tests.scaled import Array, Units, UnitsOf, scaled_parameters, scaled_payload

Answer = Array | str


def answers(
    parameters: RPSParameters, units: Units, payload: Payload | None = None
) -> dict[str, Answer]:
    """The answers of a robot in other units, in those of its parameters; errors by their names."""
    asked = _Asked(parameters, units, payload)
    asked.kinematics()
    asked.forces()
    asked.paths()
    asked.workspaces()
    return asked.found


class _Asked:
    """The calls of a robot, by kind."""

    def __init__(self, p: RPSParameters, units: Units, payload: Payload | None) -> None:
        self.units, self.p = units, scaled_parameters(p, units)
        load = None if payload is None else scaled_payload(payload, units)
        self.robot, self.length, self.time = RPSRobot(self.p, load), units.length, units.time
        self.of_pose = np.array([self.length, 1.0, 1.0])
        rng, g, h = np.random.default_rng(4), p.base_radius, p.platform_radius
        level = RPSRobot(p)
        height = float(level.mechanism.home[level._free_q + 2])
        spread = np.array([0.01 * height, 0.02, 0.02])
        pose = np.array([height, 0.0, 0.0]) + spread * rng.uniform(-1, 1, (12, 3))
        swing = np.sqrt(float(np.linalg.norm(p.gravity)) / g)
        rate = swing * np.array([0.1 * g, 0.3, 0.3]) * rng.normal(size=(12, 3))
        motion = pose, rate / self.time, swing * rate[::-1] / self.time**2
        self.pose, self.rate, self.acceleration = (self.of_pose * one for one in motion)
        weight = 9.81 * (p.platform_mass + 3 * p.leg_mass)
        wrench = 0.1 * weight * np.repeat([1.0, h], 3) * rng.normal(size=6)
        self.wrench = wrench * np.repeat([units.force, units.energy], 3)
        self.height, self.h = height * self.length, h * self.length
        self.far = self.pose * np.array([3.0, 5.0, 5.0])
        self.legs = self.robot.inverse_kinematics(self.pose)
        self.found: dict[str, Answer] = {}

    @property
    def motion(self) -> tuple[Array, Array, Array]:
        return self.pose, self.rate, self.acceleration

    def add(self, name: str, call: Callable[[], Any], *factors: Any) -> None:
        """Keep an answer, or several, each divided by its factor."""
        try:
            given = call()
        except RPSPinError as error:
            self.found[name] = type(error).__name__
            return
        parts = given if isinstance(given, tuple) else (given,)
        assert len(parts) == len(factors), name
        for k, (part, factor) in enumerate(zip(parts, factors, strict=True)):
            values = np.ma.filled(np.ma.asarray(part, dtype=float), np.nan)
            self.found[f"{name} {k}"] = np.nan_to_num(values / factor, nan=-7.0)

    def kinematics(self) -> None:
        robot, legs, length, time, of_pose = (
            self.robot,
            self.legs,
            self.length,
            self.time,
            self.of_pose,
        )
        self.add("legs", lambda: (legs.length, legs.angle, legs.reachable), length, 1.0, 1.0)
        masked = robot.inverse_kinematics(self.far, errors="mask")
        self.add("out of reach", lambda: (masked.length, masked.reachable), length, 1.0)
        self.add("refused", lambda: robot.inverse_kinematics(self.far).length, length)
        for near in (self.pose[0], self.pose):
            self.add("pose", lambda x=near: robot.forward_kinematics(legs.length, x), of_pose)
        self.add("tracked", lambda: _tracked(self.p, self.pose, legs.length), of_pose)
        names = "position", "pose", "above", "double", "has_pose"
        self.add(
            "modes",
            lambda: _parts(robot.assembly_modes(legs.length), *names),
            *(length, of_pose, 1.0, 1.0, 1.0),
        )
        place = robot.platform_placement(self.pose)
        self.add("placement", lambda: place[0], length)
        self.add("pose of placement", lambda: pose_from_placement(*place, self.h), of_pose)
        self.add(
            "pose of position",
            lambda: pose_from_position(place[0], self.h, errors="mask"),
            of_pose,
        )
        platform, moving = robot.motion(*self.motion)
        rates = length / time, length / time**2
        self.add("platform", lambda: (platform.velocity, platform.acceleration), *rates)
        self.add("moving", lambda: (moving.speed, moving.acceleration), *rates)
        self.add(
            "jacobian",
            lambda: leg_jacobians(self.p, self.pose),
            *(length, 1.0, length / of_pose, 1.0 / of_pose),
        )
        for one, poses in (("near", self.pose), ("far", self.far)):
            self.add(
                f"measures {one}",
                lambda x=poses: tuple(singularity_measures(self.p, x)),
                *[1.0] * 4,
            )

    def forces(self) -> None:
        robot, force, of = self.robot, self.units.force, UnitsOf(self.robot.mechanism, self.units)
        state = robot.state(*(one[0] for one in self.motion))
        self.add("state", lambda: state, of.q, of.v / self.time, of.v / self.time**2)
        inverse = robot.inverse_dynamics(*state)
        self.add("inverse", lambda: (inverse.tau, inverse.constraint_forces), force, force)
        for name, wrench in (("", None), (" with a wrench", self.wrench)):
            self.add(
                f"forces{name}",
                lambda w=wrench: robot.actuator_forces(*self.motion, wrench=w),
                force,
            )
        causes = force_causes(robot, *self.motion)
        self.add("causes", lambda: tuple(vars(causes).values()), *[force] * 6)
        self.add("reactions", lambda: joint_reactions(robot, *self.motion).spherical, force)

    def paths(self) -> None:
        path = helix(
            self.robot,
            radius=0.002 * self.h,
            pitch=0.01 * self.h,
            height=self.height,
            duration=2.0 * self.time,
        )
        rate = 100 / self.time
        self.add("check", lambda: _checked(check_path(self.robot, path), self.units), 1.0)
        self.add("size", lambda: _sized(size_trajectory(self.robot, path, rate), self.units), 1.0)
        fastest = time_optimal(self.robot, path, intervals=12)
        self.add("fastest", lambda: fastest.duration, self.time)

    def workspaces(self) -> None:
        ends = float(self.legs.length.min()), float(self.legs.length.max())
        heights, tilts = np.linspace(0.5, 1.5, 5) * self.height, np.linspace(-0.4, 0.4, 5)
        grids = {"legs": leg_grid(self.p, 6, limits=ends), "poses": pose_grid(heights, tilts)}
        for name, grid in grids.items():
            made = workspace(self.robot, grid)
            self.add(
                f"workspace {name}",
                lambda made=made: (made.inside, made.pose, made.conditioning),
                *(1.0, self.of_pose, 1.0),
            )
        surface = singular_surface(
            self.p,
            z=(0.1 * self.height, 2 * self.height),
            tilt_x=(-2.0, 2.0),
            tilt_y=(-2.0, 2.0),
            points=9,
        )
        self.add("surface", lambda: surface.vertices, self.of_pose)


def _parts(result: Any, *names: str) -> tuple[Any, ...]:
    return tuple(getattr(result, name) for name in names)


def _tracked(parameters: RPSParameters, poses: Array, lengths: Array) -> Array:
    tracker = EncoderTracker(poses[0], parameters.base_radius, parameters.platform_radius)
    return np.array([tracker.update(one).copy() for one in lengths])


def _checked(check: Any, units: Units) -> Array:
    events = [(e.time / units.time, e.distance) for e in check.singularities]
    return np.array([len(check.limits), len(events), *np.ravel(events)])


def _sized(sheet: Any, units: Units) -> Array:
    return np.concatenate(
        [
            np.ravel(sheet.time) / units.time,
            np.ravel(sheet.force) / units.force,
            np.ravel(sheet.speed) / units.length * units.time,
        ]
    )
