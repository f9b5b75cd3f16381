"""Write the tables of docs/parallel_robots.md.

Run it from the checkout, in an environment with the development dependencies:

    .venv/bin/python docs/parallel_robots.py
"""

from __future__ import annotations

from pathlib import Path

from marked import replaced

from rps_pin import ClosedLoopModel, Task
from rps_pin.control import ComputedTorque, Gains, Plant, TaskSummary, run_loop
from rps_pin.control.simulation.task_scenario import changed
from rps_pin.task import check_path, size_trajectory
from rps_pin.trajectories import point_to_point

DOCS = Path(__file__).parent
PAGE = DOCS / "parallel_robots.md"
URDF = DOCS.parent / "urdf"
DURATION = 0.25  # s, of the motions from home to the poses
FREQUENCY, HEAVIER = 15.0, 1.2  # of the controllers, Hz; masses of the plants, over the model's

#: Where the motions lead: coordinates of each robot's task.
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

#: A line from home that leads into a singularity: coordinates of its end, others are the home's.
SINGULAR = {
    "stewart": ({"rz": 1.7}, "the platform is turned by a right angle"),
    "rotary_stewart": ({"z": 0.32}, "seen along its axis, each crank is in line with its rod"),
    "delta": ({"x": -0.42, "y": 0.455, "z": -0.24}, "rods are parallel to one plane"),
    "linear_delta": ({"x": -0.12}, "the rods of a carriage are level"),
    "rrs": ({"rx": 0.6}, "forces along the shanks and across the legs do not span"),
    "planar_rrr": ({"rz": 1.0}, "the forearms' lines meet in one point"),
    "five_bar": ({"x": 0.163, "z": 0.15}, "the arms are in line"),
    "ankle": ({"cross_joint": -0.9}, "seen along its axis, a crank is in line with its rod"),
}


def main() -> None:
    """Write all tables."""
    mechanisms = {name: ClosedLoopModel.load(URDF / f"{name}.yaml") for name in POSES}
    functions = ("kinematics", "closing", "dynamics")
    tasks = {name: one.task.compile(functions=functions) for name, one in mechanisms.items()}
    text = PAGE.read_text("utf-8")
    for part, head, row in (
        ("singularities", OF_SINGULARITIES, singularity),
        ("motions", OF_MOTIONS, demands),
        ("runs", OF_RUNS, controlled),
    ):
        text = replaced(text, part, "\n".join([*head, *(row(*one) for one in tasks.items())]))
    PAGE.write_text(text, "utf-8")


def moved(task: Task, changes: dict[str, float]) -> list[float]:
    """Return the home's coordinates, some of them changed."""
    return [changes.get(name, x) for name, x in zip(task.coordinates, task.home, strict=True)]


def units(task: Task) -> tuple[str, str]:
    """Return the units of the actuators' speeds and of their forces."""
    turning = task.mechanism.angular_velocities[task.mechanism.actuated_indices]
    return ("rad/s", "N m") if turning.all() else ("m/s", "N")


OF_SINGULARITIES = [
    "| robot | from home to | `check_path` finds | least distance | there |",
    "|---|---|---|---|---|",
]


def singularity(name: str, task: Task) -> str:
    """Return what a path through a singularity meets."""
    changes, there = SINGULAR[name]
    end = ", ".join(f"{coordinate} = {value:g}" for coordinate, value in changes.items())
    found = check_path(task, point_to_point(task.home, moved(task, changes), duration=1.0))
    event = found.singularities[0]
    at = dict(zip(task.coordinates, event.pose, strict=True))
    where = ", ".join(f"{coordinate} = {at[coordinate]:.6g}" for coordinate in changes)
    what = "ends: " if event.kind == "ends" else ""
    cells = [f"{what}{event.singularity} at {where}", f"{found.minimum_distance:.0e}", there]
    return f"| `{name}` | {end} | {' | '.join(cells)} |"


OF_MOTIONS = [
    "| robot | largest speed | of the limit | largest force | of the limit | RMS force "
    "| largest power | largest load of a joint | least distance | `check_path` |",
    "|---|---|---|---|---|---|---|---|---|---|",
]


def demands(name: str, task: Task) -> str:
    """Return what a motion from home to the robot's pose takes."""
    motion = point_to_point(task.home, POSES[name], duration=DURATION)
    sheet, check = size_trajectory(task, motion, 2000.0), check_path(task, motion)
    per_second, force = units(task)
    speed = max(one.speed_peak for one in sheet.actuators)
    largest, rms = (
        max(getattr(one, f"force_{kind}") for one in sheet.actuators) for kind in ("peak", "rms")
    )
    margins = [margin for one in sheet.actuators for margin in one.margins]
    used = {
        quantity: max(one.value / one.limit for one in margins if one.quantity == quantity)
        for quantity in ("speed", "force")
    }
    load = max(sheet.joints, key=lambda one: one.force_peak)
    power = max(one.power_peak for one in sheet.actuators)
    events = len(check.singularities) + len(check.limits)
    return (
        f"| `{name}` | {speed:.3g} {per_second} | {used['speed']:.0%} | {largest:.3g} {force} "
        f"| {used['force']:.0%} | {rms:.3g} {force} | {power:.3g} W "
        f"| {load.force_peak:.3g} N, `{load.name}` | {check.minimum_distance:.2f} "
        f"| {f'{events} events' if events else 'ok'} |"
    )


OF_RUNS = [
    "| robot | largest error | 0.1 s after | largest force | of the limit | statuses |",
    "|---|---|---|---|---|---|",
]


def controlled(name: str, task: Task) -> str:
    """Return the errors of computed torque along the motion, with a plant that is heavier."""
    motion = point_to_point(task.home, POSES[name], duration=DURATION)
    controller = ComputedTorque(task, task.home, Gains.placed(FREQUENCY, integral=0.2))
    plant = Plant(changed(task.interpreted(), HEAVIER), task.home, delay=1)
    run = run_loop(controller, plant, motion, settle=0.2, duration=0.55)
    found = TaskSummary.of(run, begin=0.2)
    errors = {}
    for figures in ("largest", "at_end"):
        sizes: dict[str, float] = {}
        for unit, value in zip(found.units, getattr(found, figures), strict=True):
            sizes[unit] = max(sizes.get(unit, 0.0), 1e6 * value)
        errors[figures] = ", ".join(
            f"{value:.3g} {'µm' if unit == 'm' else 'µrad'}" for unit, value in sizes.items()
        )
    model = task.mechanism.model
    limit = model.effortLimit[task.mechanism.actuated_indices].min()
    told = ", ".join(found.statuses) or "none"
    return (
        f"| `{name}` | {errors['largest']} | {errors['at_end']} | {found.force_peak:.3g} "
        f"{units(task)[1]} | {found.force_peak / limit:.0%} | {told} |"
    )


if __name__ == "__main__":
    main()
