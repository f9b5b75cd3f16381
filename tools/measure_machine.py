"""Measure a simulated five-bar: readings.csv, log.csv and other.csv of `rps-pin examples`.

    .venv/bin/python tools/measure_machine.py

The machine's right motor stands 2 mm and 1 mm off its place, and the left encoder reads 10 mrad too
little. Its bodies are 25 % heavier than those of the drawing, and its motors have friction. The
readings and the forces have noise, and one reading is wrong.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rps_pin import ClosedLoopModel
from rps_pin.task.calibration import CalibrationModel
from rps_pin.task.identification import DynamicsModel, with_parameters

ROOT = Path(__file__).parents[1]
SAMPLES = ROOT / "src" / "rps_pin" / "cli" / "samples"
TASK = ClosedLoopModel.load(ROOT / "urdf" / "five_bar.yaml").task
#: Standard deviations: of encoders, rad, of a tracker, m, and of forces, N m.
ENCODER, TRACKER, FORCE = 1e-4, 3e-5, 0.05


def write(name: str, columns: list[str], rows: np.ndarray) -> None:
    """Write a table as CSV."""
    lines = [",".join(columns), *(",".join(f"{one:.6f}" for one in row) for row in rows)]
    (SAMPLES / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def readings() -> None:
    """Read the joints and the tip of the machine at 40 poses."""
    noise = {"left_joint": ENCODER, "right_joint": ENCODER, "x": TRACKER, "z": TRACKER}
    model = CalibrationModel(TASK, ["placement:right_joint"], list(noise), offsets=["left_joint"])
    machine, rng = model.nominal.copy(), np.random.default_rng(0)
    for label, error in {
        "placement:right_joint.x": 2e-3,
        "placement:right_joint.z": 1e-3,
        "offset:left_joint": 1e-2,
    }.items():
        machine[model.labels.index(label)] += error
    x = TASK.home + rng.uniform(-0.07, 0.07, (40, 2))
    read = model.predict(x, model.home(x, model.nominal), machine).readings
    read = read + rng.normal(size=read.shape) * [*noise.values()]
    read[4, 0] += 0.02
    deviations = np.tile([1e3 * ENCODER, 1e3 * ENCODER, 1e6 * TRACKER, 1e6 * TRACKER], (40, 1))
    columns = ["left_joint_rad", "right_joint_rad", "x_mm", "z_mm"]
    columns += [f"{joint}_deviation_mrad" for joint in ("left_joint", "right_joint")]
    columns += ["x_deviation_um", "z_deviation_um"]
    write("readings.csv", columns, np.hstack([read * [1, 1, 1e3, 1e3], deviations]))


def log(name: str, seed: int) -> None:
    """Record five seconds of a motion of five harmonics at 100 Hz."""
    model = DynamicsModel(TASK)
    heavier = [one.startswith("inertia") for one in model.labels]
    machine = with_parameters(model, np.where(heavier, 1.25 * model.nominal, 0.1))
    rng, t = np.random.default_rng(seed), np.arange(0.0, 5.0, 1 / 100)
    motion = np.zeros((3, t.size, 2))
    for k in range(1, 6):
        w, (c, s) = 0.4 * np.pi * k, 0.03 / k * rng.normal(size=(2, 2))
        cos, sin = np.cos(w * t)[:, None], np.sin(w * t)[:, None]
        motion += [c * cos + s * sin, w * (s * cos - c * sin), -(w**2) * (c * cos + s * sin)]
    q, v, a = TASK.motion(TASK.follow(TASK.home + motion[0]), *motion[1:])
    force = np.array([machine.inverse_dynamics(*one).tau for one in zip(q, v, a, strict=True)])
    force = force + FORCE * rng.normal(size=force.shape)
    joints = TASK.mechanism.actuated
    columns = ["time_s", *(f"{j}_position_rad" for j in joints), *(f"{j}_force_Nm" for j in joints)]
    write(name, columns, np.hstack([t[:, None], q[:, TASK.of_actuators], force]))


if __name__ == "__main__":
    readings()
    log("log.csv", 0)
    log("other.csv", 1)
