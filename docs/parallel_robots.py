"""Write the table of motions and the pictures of docs/parallel_robots.md.

Run it from the checkout, in an environment with the development dependencies and a Chromium:

    .venv/bin/python docs/parallel_robots.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from marked import replaced

from rps_pin import ClosedLoopModel, Task
from rps_pin.closed_loop.visuals import visual_model
from rps_pin.task import check_path
from rps_pin.trajectories import point_to_point
from rps_pin.viewer import save_png

DOCS = Path(__file__).parent
IMAGES = DOCS / "images" / "parallel"
PAGE = DOCS / "parallel_robots.md"
URDF = DOCS.parent / "urdf"
DURATION = 0.25  # s, of the motions from home to the poses

#: Where each is shown: coordinates of its task.
POSES = {
    "stewart": [0.05, 0.0, 0.65, 0.1, 0.15, 0.1],
    "rotary_stewart": [0.01, 0.0, 0.225, 0.05, 0.1, 0.05],
    "delta": [0.08, 0.05, -0.55],
    "linear_delta": [0.03, -0.02, 0.1],
    "rrs": [0.23, 0.1, 0.15],
    "planar_rrr": [0.02, 0.03, 0.2],
    "five_bar": [0.15, 0.5],
    "ankle": [0.2, 0.1],
}


def main() -> None:
    """Write both."""
    mechanisms = {name: ClosedLoopModel.load(URDF / f"{name}.yaml") for name in POSES}
    rows = [row(name, mechanism.task) for name, mechanism in mechanisms.items()]
    PAGE.write_text(replaced(PAGE.read_text("utf-8"), "motions", "\n".join(HEAD + rows)), "utf-8")
    IMAGES.mkdir(parents=True, exist_ok=True)
    for name, mechanism in mechanisms.items():
        save_png(
            IMAGES / f"{name}.png",
            mechanism,
            mechanism.task.configuration(POSES[name]),
            visual=visual_model(URDF / f"{name}.yaml", mechanism.model),
            layers=["closures"],
            size=(480, 360),
            background="white",
            captions=False,
        )


HEAD = [
    "| robot | largest speed | of the limit | largest force | of the limit | RMS force "
    "| least `type_ii` | `check_path` |",
    "|---|---|---|---|---|---|---|---|",
]


def row(name: str, task: Task) -> str:
    """Return what a motion from home to the robot's pose takes."""
    mechanism = task.mechanism
    actuated = mechanism.actuated_indices
    motion = point_to_point(task.home, POSES[name], duration=DURATION)
    states = task.state(*motion.sample(np.linspace(0.0, DURATION, 501)))
    forces = np.array([mechanism.inverse_dynamics(*one).tau for one in zip(*states, strict=True)])
    speed = np.abs(states.v[:, actuated]).max()
    largest, rms = np.abs(forces).max(), np.sqrt((forces**2).mean(axis=0)).max()
    model = mechanism.model
    of_speed = speed / model.velocityLimit[actuated].min()
    of_force = largest / model.effortLimit[actuated].min()
    kind = model.joints[model.getJointId(mechanism.actuated[0])].shortname()
    per_second, force = ("rad/s", "N m") if "JointModelR" in kind else ("m/s", "N")
    check = check_path(task, motion)
    events = len(check.singularities) + len(check.limits)
    return (
        f"| `{name}` | {speed:.3g} {per_second} | {of_speed:.0%} | {largest:.3g} {force} "
        f"| {of_force:.0%} | {rms:.3g} {force} | {task.singularities(states.q).type_ii.min():.2f} "
        f"| {f'{events} events' if events else 'ok'} |"
    )


if __name__ == "__main__":
    main()
