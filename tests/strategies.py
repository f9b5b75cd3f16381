"""Random robots and states, from NumPy's generators and from Hypothesis's."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rps_pin import RPSParameters

Array = NDArray[np.float64]
Motion = tuple[Array, Array, Array]

#: Directions of the legs, from the paper: +X, +120 and -120 degrees.
LEG_ANGLES = np.deg2rad([0.0, 120.0, -120.0])


def relative_error(found: Array, expected: Array, axes: int = 1) -> float:
    """Largest error of the arrays' items over the item's largest entry."""
    over = tuple(range(-axes, 0))
    error = np.abs(np.subtract(found, expected)).max(axis=over)
    return float((error / np.abs(expected).max(axis=over)).max())


# With NumPy's generators --------------------------------------------------------------------------


def rigid_body_inertia(rng: np.random.Generator, mass: float, size: float) -> Array:
    """Full inertia tensor of eight equal points: as valid as a rigid body's can be."""
    points = rng.normal(scale=size, size=(8, 3))
    second_moment = mass / 8 * points.T @ points
    inertia: Array = np.trace(second_moment) * np.eye(3) - second_moment
    return (inertia + inertia.T) / 2


def random_parameters(
    rng: np.random.Generator, *, heavy_rods: bool = True, tilted_gravity: bool = False
) -> RPSParameters:
    """A robot with all its masses and without limits."""
    base_radius = rng.uniform(0.2, 0.8)
    platform_radius = base_radius * rng.uniform(0.3, 1.2)
    mass = rng.uniform(0.5, 20.0)
    direction = rng.normal(size=3) if tilted_gravity else np.array([0.0, 0.0, -1.0])
    rods = {
        "rod_mass": rng.uniform(0.5, 10.0),
        "rod_com": rng.uniform(-0.1, 0.5),
        "rod_inertia": rng.uniform(0.01, 0.5),
    }
    return RPSParameters(
        name="random",
        base_radius=base_radius,
        platform_radius=platform_radius,
        platform_mass=mass,
        platform_inertia=rigid_body_inertia(rng, mass, platform_radius / 2),
        leg_mass=rng.uniform(0.5, 10.0),
        leg_com=rng.uniform(0.05, 0.5),
        leg_inertia=rng.uniform(0.01, 0.5),
        leg_inertia_about="com",
        gravity=9.81 * direction / np.linalg.norm(direction),
        **(rods if heavy_rods else {}),
    )


def random_motions(
    rng: np.random.Generator, parameters: RPSParameters, count: int, largest_tilt: float = 1.0
) -> Motion:
    """Pose, rate and acceleration, (count, 3) each; so fast that Coriolis terms rival gravity."""
    height = parameters.base_radius * rng.uniform(0.7, 3.0, size=count)
    size = rng.uniform(0.0, largest_tilt, size=count)
    way = rng.uniform(0.0, 2 * np.pi, size=count)
    pose = np.stack([height, size * np.cos(way), size * np.sin(way)], axis=-1)
    return pose, rng.normal(scale=3.0, size=(count, 3)), rng.normal(scale=20.0, size=(count, 3))


def random_poses(count: int, seed: int = 0, largest_tilt: float = 3.1) -> Array:
    """Poses with tilts of every size, tiny ones among them."""
    rng = np.random.default_rng(seed)
    size = largest_tilt * rng.uniform(size=count) ** rng.choice([1, 1, 8, 40], size=count)
    way = rng.uniform(-np.pi, np.pi, size=count)
    height = rng.uniform(0.2, 2, count)
    poses: Array = np.stack([height, size * np.cos(way), size * np.sin(way)], axis=-1)
    return poses


def matrices(pose: Array) -> Array:
    """Rotations by SciPy."""
    turn = Rotation.from_rotvec(np.append(pose[..., 1:], 0 * pose[..., :1], axis=-1))
    found: Array = turn.as_matrix()
    return found


# With Hypothesis ----------------------------------------------------------------------------------


def floats(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False, allow_subnormal=False)


@st.composite
def poses(draw: st.DrawFn, largest_tilt: float = 3.0) -> Array:
    """Poses (3,), level ones and tiny tilts among them."""
    size = draw(st.one_of(floats(0.0, largest_tilt), st.floats(0.0, 1e-6), st.just(0.0)))
    way = draw(floats(-math.pi, math.pi))
    return np.array([draw(floats(0.2, 2.0)), size * math.cos(way), size * math.sin(way)])


def vectors(largest: float) -> st.SearchStrategy[Array]:
    return st.tuples(*[floats(-largest, largest)] * 3).map(np.array)


@st.composite
def inertias(draw: st.DrawFn, mass: float) -> Array:
    """Of four equal points, which is any full tensor a rigid body can have."""
    points = np.array([draw(vectors(0.5)) for _ in range(4)]) + 0.01 * np.eye(4)[:, :3]
    second_moment = mass / 4 * points.T @ points
    inertia: Array = np.trace(second_moment) * np.eye(3) - second_moment
    return (inertia + inertia.T) / 2


def limits(low: float, middle: float, high: float) -> st.SearchStrategy[tuple[float, float]]:
    return st.tuples(floats(low, middle), floats(middle + 1e-3, high))


@st.composite
def parameters(draw: st.DrawFn) -> RPSParameters:
    """Any legal robot; each optional field sometimes left out."""
    mass = draw(floats(1e-3, 1e3))
    leg_mass = draw(st.one_of(st.just(0.0), floats(1e-3, 1e2)))
    leg_com = draw(floats(0.0, 1.0))
    about = draw(st.sampled_from(["joint", "com"]))
    own = draw(floats(0.0, 10.0)) if leg_mass else 0.0
    values: dict[str, Any] = {
        "base_radius": draw(floats(1e-3, 10.0)),
        "platform_radius": draw(floats(1e-3, 10.0)),
        "platform_mass": mass,
        "platform_inertia": draw(inertias(mass)),
        "leg_mass": leg_mass,
        "leg_com": leg_com,
        "leg_inertia_about": about,
        "leg_inertia": own + (leg_mass * leg_com**2 if about == "joint" else 0.0),
    }
    optional = {
        "name": st.from_regex(r"[A-Za-z][A-Za-z0-9_\-]{0,12}", fullmatch=True),
        "leg_length_limits": limits(0.0, 0.3, 5.0),
        "leg_angle_limits": limits(-math.pi, 0.0, math.pi),
        "spherical_cone_limit": floats(1e-3, math.pi),
        "spherical_rest_angle": floats(-math.pi, math.pi),
        "actuator_force_limit": floats(1e-3, 1e5),
        "actuator_speed_limit": floats(1e-3, 1e3),
        "gravity": vectors(20.0),
    }
    rods = {
        "rod_mass": floats(1e-3, 1e2),
        "rod_com": floats(-1.0, 1.0),
        "rod_inertia": floats(0.0, 10.0),
    }
    for field, strategy in optional.items():
        if draw(st.booleans()):
            values[field] = draw(strategy)
    if draw(st.booleans()):
        values |= {field: draw(strategy) for field, strategy in rods.items()}
    return RPSParameters(**values)
