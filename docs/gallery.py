"""Draw the figures of rps_pin.plots: docs/gallery.md and its pictures.

.venv/bin/python docs/gallery.py
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from rps_pin import ClosedLoopModel, RPSRobot, helix, plots
from rps_pin.control import ComputedTorque, Encoders, Gains, LoopRun, Plant, run_loop
from rps_pin.paper import paper_comparison
from rps_pin.rps import ActuatorLimits, Payload, force_causes, size_trajectory
from rps_pin.rps.dynamics.motion_run import run_motion
from rps_pin.rps.workspace import leg_grid, pose_grid, workspace
from rps_pin.trajectories import circle

DOCS = Path(__file__).parent
IMAGES = DOCS / "images" / "gallery"
DPI = 72


def figures() -> dict[str, tuple[str, Callable[[], Figure]]]:
    """Return the title and a call of each function, by its name."""
    sokolov, micro = RPSRobot.from_preset("sokolov"), RPSRobot.from_preset("micro")
    path = helix(sokolov, radius=0.75e-3, pitch=0.5e-3, height=0.4)
    run = run_motion(sokolov, path, sample_rate=200.0)
    loaded = micro.with_payload(Payload(mass=0.5, centre=(0.0, 0.0, 0.05)))
    task = circle(height=0.223, tilt=0.1, duration=0.6)
    time = np.linspace(0.0, task.duration, 601)
    limits = ActuatorLimits(force=25.0, speed=0.2, power=2.0)
    space = workspace(micro, leg_grid(micro.parameters, 21))
    tilts = np.linspace(-0.5, 0.5, 121)
    slices = workspace(micro, pose_grid([0.225], tilts))
    controlled = loop(micro)
    four_bar = ClosedLoopModel.load(DOCS.parent / "urdf" / "four_bar.yaml")
    falling = four_bar.simulate(four_bar.home, duration=1.0)
    heights = np.linspace(0.15, 0.6, 61)
    modes = micro.assembly_modes([0.225] * 3)
    return {
        "plot_path": ("path of the platform's centre", lambda: plots.plot_path(run)),
        "plot_lengths": ("leg lengths over time", lambda: plots.plot_lengths(run)),
        "plot_forces": ("actuator forces over time", lambda: plots.plot_forces(run)),
        "plot_length_phase": ("speed over length", lambda: plots.plot_length_phase(run)),
        "plot_force_causes": (
            "actuator forces by cause",
            lambda: plots.plot_force_causes(time, force_causes(loaded, *task.sample(time))),
        ),
        "plot_sizing": (
            "force over speed, and the actuators' limits",
            lambda: plots.plot_sizing(size_trajectory(loaded, task, limits=limits)),
        ),
        "plot_assembly_modes": (
            "assembly modes of given leg lengths",
            lambda: plots.plot_assembly_modes(micro.parameters, modes),
        ),
        "plot_theoretical": (
            "the theoretical workspace",
            lambda: plots.plot_theoretical(micro.parameters),
        ),
        "plot_effective": (
            "the effective workspace within it",
            lambda: plots.plot_effective(space),
        ),
        "plot_space": ("boundary of the workspace in space", lambda: plots.plot_space(space)),
        "plot_views": (
            "positions of the workspace in three planes",
            lambda: plots.plot_views(space),
        ),
        "plot_reasons": (
            "reachable tilts, and the reasons why others are not",
            lambda: plots.plot_reasons(slices, 0.225),
        ),
        "plot_comparison": (
            "extent of the workspace over the base radius, with the paper's values",
            lambda: plots.plot_comparison(paper_comparison(points=11)),
        ),
        "plot_tilt_conditioning": (
            "singularity measure over the tilt",
            lambda: plots.plot_tilt_conditioning(sokolov.parameters, 0.4),
        ),
        "plot_height_conditioning": (
            "singularity measure over height and tilt",
            lambda: plots.plot_height_conditioning(sokolov.parameters, heights),
        ),
        "plot_tracking": (
            "tracking errors of a controller",
            lambda: plots.plot_tracking(controlled),
        ),
        "plot_loop_forces": (
            "forces and status of a controller",
            lambda: plots.plot_loop_forces(controlled),
        ),
        "plot_simulation": (
            "simulation of a mechanism",
            lambda: plots.plot_simulation(falling, four_bar),
        ),
    }


def loop(robot: RPSRobot) -> LoopRun:
    """Return a controlled motion with encoders."""
    path = circle(height=0.223, tilt=0.05, duration=0.5)
    start = path.sample(0.0).pose
    controller = ComputedTorque(robot, start, Gains.placed(15.0, integral=0.2))
    plant = Plant(robot, start, delay=1, encoders=Encoders(resolution=50e-9, noise=20e-9))
    return run_loop(controller, plant, path)


def main() -> None:
    """Write the pictures and the page."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    lines = [
        "<!-- made by docs/gallery.py -->",
        "# Gallery",
        "",
        "The figures of `rps_pin.plots`. Most take existing axes (`axes=`); those in 3D take",
        "an existing figure (`figure=`). `docs/gallery.py` contains the calls.",
    ]
    for name, (shows, draw) in figures().items():
        draw().savefig(IMAGES / f"{name}.png", dpi=DPI)
        lines += ["", f"## {name}", "", f"{shows[0].upper()}{shows[1:]}.", ""]
        lines.append(f"![{shows}](images/gallery/{name}.png)")
    (DOCS / "gallery.md").write_text("\n".join(lines) + "\n", "utf-8")


if __name__ == "__main__":
    main()
