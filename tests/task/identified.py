"""Machines with known dynamics, and logs of them, for the tests of identification."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from rps_pin import ClosedLoopModel, RPSRobot, Task
from rps_pin.arrays import Array
from rps_pin.task.identification import DynamicsModel, Log, force_log
from rps_pin.task.identification.result import with_parameters

#: Amplitudes of the motions, m and rad.
AMPLITUDES = {
    "delta": (0.06, 0.06, 0.04),
    "five_bar": (0.03, 0.03),
    "rps": (0.02, 0.1, 0.1),
}
#: Samples a second, and length, s.
RATE, DURATION = 60.0, 5.0


class Motion(NamedTuple):
    """A motion of all joints, exact."""

    time: Array
    q: Array
    v: Array
    a: Array


@cache
def task_of(name: str) -> Task:
    if name == "rps":
        task: Task = RPSRobot.from_preset("sokolov").task
        return task
    found: Task = ClosedLoopModel.load(f"urdf/{name}.yaml").task
    return found


@cache
def model_of(name: str) -> DynamicsModel:
    return DynamicsModel(task_of(name))


def truth(model: DynamicsModel, rng: np.random.Generator) -> Array:
    """Parameters of a machine: bodies heavier or lighter by up to 30 %, and friction."""
    p = model.nominal.copy()
    for k, label in enumerate(model.labels):
        if label.endswith(".mass"):
            p[k : k + 10] *= rng.uniform(0.7, 1.3)
        elif not label.startswith("inertia:"):
            p[k] = rng.uniform(0.5, 2.0)
    return p


@cache
def motion(name: str, seed: int) -> Motion:
    """A periodic motion of five harmonics about home."""
    model, rng = model_of(name), np.random.default_rng(seed)
    task = model.task
    t = np.arange(0.0, DURATION, 1 / RATE)
    x = np.zeros((3, t.size, task.size))
    for k in range(1, 6):
        cosine, sine = rng.normal(size=(2, task.size)) * AMPLITUDES[name] / k / 1.5
        w = 2 * np.pi * 0.2 * k
        c, s = np.cos(w * t)[:, None], np.sin(w * t)[:, None]
        x += [
            cosine * c + sine * s,
            w * (sine * c - cosine * s),
            -(w**2) * (cosine * c + sine * s),
        ]
    q = task.follow(task.home + x[0], within_limits=False)
    return Motion(t, *task.motion(q, x[1], x[2], x=task.home + x[0]))


@cache
def forces(name: str, seed: int, machine: int) -> Array:
    """Return the forces of a machine in a motion, by the Pinocchio engine."""
    model = model_of(name)
    made = with_parameters(model, truth(model, np.random.default_rng(machine)))
    _, *states = motion(name, seed)
    return np.array([made.inverse_dynamics(*one).tau for one in zip(*states, strict=True)])


def noise_of(name: str, machine: int, share: float) -> Array:
    """Return a share of the root mean squares of a machine's forces in the first motion."""
    return share * np.asarray(np.sqrt((forces(name, 1, machine) ** 2).mean(axis=0)))


def log_of(name: str, seed: int, machine: int, share: float, rng: np.random.Generator) -> Log:
    """A log with noise on the forces."""
    t, q, _, _ = motion(name, seed)
    tau = forces(name, seed, machine)
    noise = noise_of(name, machine, share) * rng.normal(size=tau.shape)
    return force_log(model_of(name), t, q[:, task_of(name).of_actuators], tau + noise)
