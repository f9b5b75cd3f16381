"""Designs from YAML files: the robot, what may vary, what must hold, and what is to be best.

    robot: delta                    # a description beside this file, or a name of the package
    dimensions:
      arm: {range: [0.1, 0.4], length: [[rod_1_left.a, rod_1_right.a], ...]}
      rod: {range: [0.3, 0.9], step: 0.01, distance: [rod_1_left, rod_1_right, ...]}
      base: {value: 0.2, radius: [arm_1_joint, arm_2_joint, arm_3_joint]}       # held
    requirements:
      region:
        box: {z: [-0.55, -0.4]}
        round: [{coordinates: [x, y], centre: [0, 0], radius: 0.15}]
      min_conditioning: 0.2
    objectives: [size, conditioning, {of: {arm: 1, rod: 1}}]

Keys of a dimension are those of `Dimension`, with ``range`` or ``value`` for its ends; those of a
3-RPS are the fields of its parameters, and take ``range``, ``value`` and ``step`` alone. SI units.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module, resources
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from rps_pin.closed_loop import ClosedLoopModel
from rps_pin.config import Entry, Faults, Finite, Positive, Text, Three, YamlFile, read_config
from rps_pin.errors import InputError, MechanismError, RPSPinError, shown
from rps_pin.files import is_there
from rps_pin.task.design.geometry.dimensions import Dimension
from rps_pin.task.design.geometry.rods import Rod, RodClearances
from rps_pin.task.design.region import Region, RoundPart
from rps_pin.task.design.requirements import Objective, Requirements
from rps_pin.task.design.space import DesignSpace, Space
from rps_pin.task.motion.described_limits import numbers_by_name
from rps_pin.task.task import Task
from rps_pin.task.trajectory_file import load_task_trajectory

Names = list[Text]
Groups = list[Text | Names]
Ends = Annotated[list[Finite], Field(min_length=2, max_length=2)]
#: Keys of a mechanism's description, one of which each has.
_OF_MECHANISMS = ("urdf", "mjcf", "closed_loop", "name_mot")


class DimensionEntry(Entry):
    """See `Dimension`."""

    range: Ends | None = None
    value: Finite | None = None
    step: Positive | None = None
    length: Groups = Field(default_factory=list)
    radius: Groups = Field(default_factory=list)
    height: Groups = Field(default_factory=list)
    spread: list[Names] = Field(default_factory=list)
    turn: Groups = Field(default_factory=list)
    distance: Names = Field(default_factory=list)
    stroke: Names = Field(default_factory=list)
    lower_limit: Names = Field(default_factory=list)
    upper_limit: Names = Field(default_factory=list)
    scale: bool = False
    axis: Three = Field(default_factory=lambda: [0.0, 0.0, 1.0])
    stretch: dict[Text, Three | list[Three]] = Field(default_factory=dict)


class RoundEntry(Entry):
    """See `RoundPart`."""

    coordinates: Names
    centre: list[Finite]
    radius: Positive


class RegionEntry(Entry):
    """See `Region`."""

    box: dict[Text, Ends] = Field(default_factory=dict)
    round: list[RoundEntry] = Field(default_factory=list)
    held: dict[Text, Finite] = Field(default_factory=dict)
    points: int = 5


class RodEntry(Entry):
    """See `Rod`."""

    ends: Annotated[Names, Field(min_length=2, max_length=2)]
    radius: Finite = 0.0


class RequirementsEntry(Entry):
    """See `Requirements`."""

    region: RegionEntry
    min_conditioning: Finite = 0.0
    limit_margin: Finite = 0.0
    motions: Names = Field(default_factory=list)
    samples: int = 41
    stiffness: Positive | dict[Text, Positive] | list[Positive] | None = None
    min_stiffness: Positive | None = None
    rods: dict[Text, RodEntry] = Field(default_factory=dict)
    min_clearance: Finite | None = None


class ObjectiveEntry(Entry):
    """See `Objective`."""

    of: Text | dict[Text, Finite]
    largest: bool | None = None


class SearchEntry(Entry):
    """Options of `design`."""

    candidates: int = 10_000
    population: int = 100
    seed: int = 0


class DesignEntry(Entry):
    """A file of a design."""

    robot: Text
    dimensions: dict[Text, DimensionEntry]
    requirements: RequirementsEntry
    objectives: Annotated[list[Text | ObjectiveEntry], Field(min_length=1, max_length=3)]
    search: SearchEntry = SearchEntry()


@dataclass(frozen=True)
class DescribedDesign:
    """What a file of a design holds: the arguments of `design`."""

    space: Space
    requirements: Requirements
    objectives: tuple[Objective, ...]
    candidates: int
    population: int
    seed: int
    files: tuple[Path, ...]
    """The files that were read besides it."""


def load_design(path: str | os.PathLike[str]) -> DescribedDesign:
    """Read a design from a YAML file; see the module's text.

    Raises
    ------
    InputError
        If the file cannot be read, a key is unknown or missing, a dimension, coordinate, joint or
        closure is unknown, or a value is not possible; all of a file at once, with their lines.
    RPSPinError
        If the robot's file cannot be read, or is no robot with a task.
    """
    file, entry = read_config(path, "design", DesignEntry)
    folder = Path(path).parent
    with file.at("robot"):
        robot, read = _robot(folder, entry.robot)
    faults = Faults(file.origin)
    if isinstance(robot, Task):
        space = _space(file, faults, robot, entry.dimensions)
    else:
        space = robot.design_space(file, faults, entry.dimensions)
    task = robot if isinstance(robot, Task) else robot.task
    requirements, motions = _requirements(file, faults, folder, task, entry.requirements)
    objectives = tuple(
        Objective(one) if isinstance(one, str) else Objective(one.of, one.largest)
        for one in entry.objectives
    )
    if requirements is not None:
        for index, one in enumerate(objectives):
            with faults, file.at("objectives", index):
                one.refuse_unknown([*entry.dimensions], requirements)
    faults.tell()
    assert space is not None
    assert requirements is not None
    search = entry.search
    return DescribedDesign(
        space,
        requirements,
        objectives,
        search.candidates,
        search.population,
        search.seed,
        (*read, *motions),
    )


def _robot(folder: Path, name: str) -> tuple[Any, list[Path]]:
    """Return a mechanism's task, or the module of the 3-RPS with its robot; and its file."""
    file, own = folder / name, Path(str(resources.files("rps_pin"))) / "urdf"
    if not is_there(file) and not Path(name).suffix:
        presets = import_module("rps_pin.rps.parameters").RPSParameters.presets()
        if name in presets:
            return import_module("rps_pin.rps.design").robot_of(name, folder), []
        file = own / f"{name}.yaml"
        if not file.exists():
            known = sorted([*(one.stem for one in own.glob("*.yaml")), *presets])
            raise InputError(
                f"{shown(name)} is not a file or a robot of the package; those are: "
                f"{', '.join(known)}"
            )
    kind = import_module("rps_pin.rps.robot_file").kind_of_file(file)
    if kind == "parameters":
        return import_module("rps_pin.rps.design").robot_of(name, folder), [file]
    if file.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(f"{name}: a robot's file is a description or parameters of a 3-RPS, .yaml")
    return ClosedLoopModel.load(file).task, [file]


def dimension_of(name: str, entry: DimensionEntry) -> Dimension:
    """Return a dimension of an entry."""
    given = entry.model_dump(exclude_unset=True, exclude={"range", "value"})
    if (entry.range is None) == (entry.value is None):
        raise InputError("give either a range or a value")
    if entry.range is not None and not entry.range[0] < entry.range[1]:
        low, high = entry.range
        raise InputError(f"the range {low:g} to {high:g} is empty; to hold it, give a value")
    lower, upper = entry.range or [float(entry.value or 0.0)] * 2
    return Dimension(name, lower, upper, **given)


def _space(
    file: YamlFile, faults: Faults, task: Task, entries: Mapping[str, DimensionEntry]
) -> Space | None:
    found: list[Dimension] = []
    for name, entry in entries.items():
        with faults, file.at("dimensions", name):
            dimension = dimension_of(name, entry)
            DesignSpace.check(task, dimension)
            found.append(dimension)
    if len(found) != len(entries):
        return None
    with faults, file.at("dimensions"):
        return DesignSpace(task, found)
    return None


def _requirements(
    file: YamlFile, faults: Faults, folder: Path, task: Task, entry: RequirementsEntry
) -> tuple[Requirements | None, list[Path]]:
    part, given = file.part("requirements"), entry.region
    region, before = None, faults.count
    with faults, part.at("region"):
        boxes = {name: (ends[0], ends[1]) for name, ends in given.box.items()}
        rounds = [RoundPart(one.coordinates, one.centre, one.radius) for one in given.round]
        region = Region(boxes, rounds, given.held, given.points)
        region.grid(task)
    motions: dict[str, Any] = {}
    for index, name in enumerate(entry.motions):
        with faults, part.at("motions", index):
            try:
                motions[Path(name).name] = load_task_trajectory(folder / name, task)
            except InputError:
                raise
            except RPSPinError as error:
                raise InputError(str(error)) from None
    stiffness: Any = entry.stiffness
    with faults:
        if isinstance(stiffness, (list, dict)):
            names = task.mechanism.actuated
            missing = set(names) - set(stiffness) if isinstance(stiffness, dict) else set()
            if missing:
                where = part.place(("stiffness",))
                raise MechanismError(
                    f"{where}: stiffness of {', '.join(sorted(missing))} is missing"
                )
            none = np.full(len(names), np.nan)
            stiffness = numbers_by_name(part, ("stiffness",), stiffness, names, none, "actuators")
    rods: dict[str, Rod] = {}
    for name, rod in entry.rods.items():
        with faults, part.at("rods", name):
            rods[name] = Rod((rod.ends[0], rod.ends[1]), rod.radius)
            RodClearances.check(task, rods[name])
    files = [folder / name for name in entry.motions]
    if region is None or faults.count > before:
        return None, files
    with faults, file.at("requirements"):
        return (
            Requirements(
                region,
                entry.min_conditioning,
                entry.limit_margin,
                motions or None,
                entry.samples,
                stiffness,
                entry.min_stiffness,
                rods or None,
                entry.min_clearance,
            ),
            files,
        )
    return None, files
