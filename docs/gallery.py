"""Draw the figures of rps_pin.plots: docs/gallery.md, with the code of each, and its pictures.

.venv/bin/python docs/gallery.py
"""

from __future__ import annotations

import contextlib
import inspect
import re
import textwrap
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from rps_pin import ClosedLoopModel, RPSRobot, helix, plots
from rps_pin.control import ComputedTorque, Encoders, Gains, Plant, run_loop
from rps_pin.paper import paper_comparison
from rps_pin.rps import ActuatorLimits, Payload, force_causes, size_trajectory, time_optimal
from rps_pin.rps.dynamics.motion_run import run_motion
from rps_pin.rps.workspace import leg_grid, pose_grid, workspace
from rps_pin.task import size_trajectory as size_of_task
from rps_pin.task.design import DesignSpace, Dimension, Region, Requirements, design
from rps_pin.task.stiffness import Compliances, StiffnessModel, stiffness_map
from rps_pin.task.tolerances import tolerance
from rps_pin.task.workspace import task_grid
from rps_pin.task.workspace import workspace as workspace_of_task
from rps_pin.trajectories import circle, point_to_point

sokolov = RPSRobot.from_preset("sokolov")
micro = RPSRobot.from_preset("micro")

DOCS = Path(__file__).parent
IMAGES = DOCS / "images" / "gallery"
#: Lines of this file that the page's first block has.
_FIRST = re.compile(
    r"^(?:from rps_pin.*|import numpy as np|sokolov = .*|micro = .*)$", re.MULTILINE
)
Draw = Callable[[], Figure]
#: Caption and function of each figure, by the name of its picture.
FIGURES: dict[str, tuple[str, Draw]] = {}


def shown(caption: str) -> Callable[[Draw], Draw]:
    """Let the page have what a function draws, and its code."""

    def kept(draw: Draw) -> Draw:
        FIGURES[draw.__name__.removeprefix("_")] = caption, draw
        return draw

    return kept


@shown("Path of the platform's centre")
def _plot_path() -> Figure:
    run = run_motion(sokolov, helix(sokolov, radius=0.75e-3, pitch=0.5e-3, height=0.4), 200.0)
    return plots.plot_path(run)


@shown("Leg lengths over time, with their limits")
def _plot_lengths() -> Figure:
    run = run_motion(micro, circle(height=0.223, tilt=0.15, duration=0.6), 200.0)
    return plots.plot_lengths(run)


@shown("Actuator forces over time; where the acceleration jumps, so do they")
def _plot_forces() -> Figure:
    run = run_motion(sokolov, helix(sokolov, radius=0.75e-3, pitch=0.5e-3, height=0.4), 200.0)
    return plots.plot_forces(run)


@shown("Speed of the legs over their length")
def _plot_length_phase() -> Figure:
    run = run_motion(sokolov, helix(sokolov, radius=0.75e-3, pitch=0.5e-3, height=0.4), 200.0)
    return plots.plot_length_phase(run)


@shown("Actuator forces by cause")
def _plot_force_causes() -> Figure:
    loaded = micro.with_payload(Payload(mass=0.5, centre=(0.0, 0.0, 0.05)))
    motion = circle(height=0.223, tilt=0.1, duration=0.6)
    time = np.linspace(0.0, motion.duration, 601)
    return plots.plot_force_causes(time, force_causes(loaded, *motion.sample(time)))


@shown("Actuator forces by cause in the shortest time along a circle, at a limit of force")
def _plot_force_causes_fastest() -> Figure:
    limits = ActuatorLimits(force=9.0, speed=0.3)
    motion = time_optimal(micro, circle(height=0.223, tilt=0.1, duration=0.6), limits=limits)
    time = np.linspace(0.0, motion.duration, 601)
    causes = force_causes(micro, *motion.sample(time))
    return plots.plot_force_causes(time, causes, limit=limits.force)


@shown("Force over speed of the actuators, within limits of force, speed and power")
def _plot_sizing() -> Figure:
    motion = circle(height=0.223, tilt=0.1, duration=0.6)
    limits = ActuatorLimits(force=10.0, speed=0.2, power=1.0)
    return plots.plot_sizing(size_trajectory(micro, motion, limits=limits))


@shown("Torque over speed of a Delta's drives, with their limits")
def _plot_sizing_of_a_mechanism() -> Figure:
    task = ClosedLoopModel.load("urdf/delta.yaml").task
    motion = point_to_point(task.home, [0.1, 0.05, -0.4], duration=0.12)
    return plots.plot_sizing(size_of_task(task, motion, 500.0))


@shown("Assembly modes of given leg lengths")
def _plot_assembly_modes() -> Figure:
    modes = micro.assembly_modes([0.225] * 3)
    return plots.plot_assembly_modes(micro.parameters, modes)


@shown("Theoretical workspace")
def _plot_theoretical() -> Figure:
    return plots.plot_theoretical(micro.parameters)


@shown("Effective workspace within the theoretical one")
def _plot_effective() -> Figure:
    space = workspace(micro, leg_grid(micro.parameters, 21))
    return plots.plot_effective(space)


@shown("Boundary of the workspace in space, with the conditioning")
def _plot_space() -> Figure:
    space = workspace(micro, leg_grid(micro.parameters, 21))
    return plots.plot_space(space)


@shown("Outlines of the workspace in three planes")
def _plot_views() -> Figure:
    space = workspace(micro, leg_grid(micro.parameters, 21))
    return plots.plot_views(space)


@shown("Tilts that are reachable at a height, and the reasons why others are not")
def _plot_reasons() -> Figure:
    tilts = workspace(micro, pose_grid([0.225], np.linspace(-0.5, 0.5, 201)))
    return plots.plot_reasons(tilts, 0.225)


@shown("Extent of the workspace over the base radius, with the paper's value")
def _plot_comparison() -> Figure:
    return plots.plot_comparison(paper_comparison(points=11))


@shown("A Delta's workspace in a plane: conditioning, and what puts other points out")
def _plot_map() -> Figure:
    delta = ClosedLoopModel.load("urdf/delta.yaml").task.compile()
    over = {"x": np.linspace(-0.5, 0.5, 101), "z": np.linspace(-0.85, -0.2, 66)}
    return plots.plot_map(workspace_of_task(delta, task_grid(delta, over)))


@shown("Slices of a Stewart platform's workspace at one orientation")
def _plot_slices() -> Figure:
    stewart = ClosedLoopModel.load("urdf/stewart.yaml").task.compile()
    sides = np.linspace(-0.45, 0.45, 46)
    over = {"x": sides, "y": sides, "z": np.linspace(0.3, 0.95, 40)}
    return plots.plot_slices(workspace_of_task(stewart, task_grid(stewart, over)))


@shown("A Delta's rods and arms: the front of size and conditioning")
def _plot_front() -> Figure:
    delta = ClosedLoopModel.load("urdf/delta.yaml").task
    rods = [f"rod_{leg}_{side}" for leg in (1, 2, 3) for side in ("left", "right")]
    elbows = [[f"rod_{leg}_left.a", f"rod_{leg}_right.a"] for leg in (1, 2, 3)]
    arm, rod = Dimension("arm", 0.1, 0.4, length=elbows), Dimension("rod", 0.3, 0.9, distance=rods)
    space = DesignSpace(delta, [arm, rod])
    region = Region(box={"x": (-0.1, 0.1), "y": (-0.1, 0.1), "z": (-0.55, -0.45)}, points=3)
    asked, best = Requirements(region, min_conditioning=0.2), ["size", "conditioning"]
    return plots.plot_front(design(space, asked, best, candidates=400, seed=1))


@shown("A Delta's least stiffness against a force, of its drives, over a plane")
def _plot_stiffness_map() -> Figure:
    delta = ClosedLoopModel.load("urdf/delta.yaml").task
    drives = dict.fromkeys(delta.mechanism.actuated, 5e3)  # N m/rad
    model = StiffnessModel(delta, Compliances(actuators=drives))
    over = np.linspace(-0.2, 0.2, 13)
    x = np.stack(np.meshgrid(over, over, [-0.5], indexing="ij"), axis=-1)[:, :, 0]
    return plots.plot_stiffness_map(stiffness_map(model, x))


@shown("Tolerances of a 3-RPS: which of them the errors of its pose come from")
def _plot_tolerance_shares() -> Figure:
    drawing = {
        "placement:leg_*_revolute.[xyz]": "0.05 mm",
        "placement:leg_*_revolute.??*": "0.2 mrad",
        "offset:*": "0.01 mm",
    }
    return plots.plot_tolerance_shares(tolerance(sokolov, drawing, [0.4, 0.1, 0.0]))


@shown("Errors of a five-bar's tip over its workspace, by tolerances of lengths and encoders")
def _plot_tolerance_map() -> Figure:
    task = ClosedLoopModel.load("urdf/five_bar.yaml").task.compile()
    axes = {"x": np.linspace(-0.3, 0.7, 81), "z": np.linspace(0.2, 0.7, 41)}
    inside = workspace_of_task(task, task_grid(task, axes))
    drawing = {
        "placement:*joint.[xz]": "0.05 mm",
        "closure:tips.?.x": "0.05 mm",
        "offset:*": "0.2 mrad",
    }
    return plots.plot_tolerance_map(tolerance(task, drawing, inside))


@shown("Distance to a singularity over the tilt")
def _plot_tilt_conditioning() -> Figure:
    return plots.plot_tilt_conditioning(sokolov.parameters, height=0.4)


@shown("Distance to a singularity over height and tilt")
def _plot_height_conditioning() -> Figure:
    return plots.plot_height_conditioning(sokolov.parameters, np.linspace(0.15, 0.6, 61))


@shown("Targets, actual lengths and errors of a controlled 3-RPS, with encoders and a delay")
def _plot_tracking() -> Figure:
    motion = circle(height=0.223, tilt=0.05, duration=0.5)
    start = motion.sample(0.0).pose
    controller = ComputedTorque(micro, start, Gains.placed(15.0, integral=0.2))
    plant = Plant(micro, start, delay=1, encoders=Encoders(resolution=50e-9, noise=20e-9))
    return plots.plot_tracking(run_loop(controller, plant, motion))


@shown("Targets, actual values and errors of a controlled five-bar")
def _plot_tracking_of_a_mechanism() -> Figure:
    task = ClosedLoopModel.load("urdf/five_bar.yaml").task
    motion = point_to_point(task.home, [0.22, 0.52], duration=0.4)
    controller = ComputedTorque(task, task.home, Gains.placed(15.0, integral=0.2))
    plant = Plant(task, task.home, delay=1)
    return plots.plot_tracking(run_loop(controller, plant, motion))


@shown("Forces and status of a controller")
def _plot_loop_forces() -> Figure:
    motion = circle(height=0.223, tilt=0.05, duration=0.5)
    start = motion.sample(0.0).pose
    controller = ComputedTorque(micro, start, Gains.placed(15.0, integral=0.2))
    return plots.plot_loop_forces(run_loop(controller, Plant(micro, start), motion))


@shown("Simulation of a mechanism that falls: positions and energies")
def _plot_simulation() -> Figure:
    four_bar = ClosedLoopModel.load("urdf/four_bar.yaml")
    falling = four_bar.simulate(four_bar.home, duration=1.0)
    return plots.plot_simulation(falling, four_bar)


def page() -> str:
    """Return the page: each figure with its code, which `tests/plots/test_gallery.py` runs."""
    first = _FIRST.findall(Path(__file__).read_text("utf-8"))
    lines = [
        "<!-- made by docs/gallery.py -->",
        "# Gallery",
        "",
        "The figures of `rps_pin.plots`, as wide as a journal's column (85 mm) or page (175 mm),",
        "with letters of 8 pt. Functions with one panel take existing axes (`axes=`), most others",
        "an existing figure (`figure=`). `plots.save_figure` writes PNG and SVG.",
        *("", "```python", first[0], "", *first[1:-2], "", *first[-2:], "```"),
    ]
    for name, (caption, draw) in FIGURES.items():
        code = textwrap.dedent(inspect.getsource(draw).split("-> Figure:\n", 1)[1])
        lines += ["", f"## {caption}", "", "```python"]
        lines += [re.sub("^return ", "figure = ", code, flags=re.MULTILINE).rstrip()]
        lines += ["```", "", f"![{caption}](images/gallery/{name}.png)"]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the pictures and the page."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    with contextlib.chdir(DOCS.parent):  # URDF files are found from there
        for name, (_, draw) in FIGURES.items():
            draw().savefig(IMAGES / f"{name}.png")
    (DOCS / "gallery.md").write_text(page(), "utf-8")


if __name__ == "__main__":
    main()
