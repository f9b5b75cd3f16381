"""The keys of a control scenario's YAML file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from rps_pin.config import YamlFile, path_text
from rps_pin.control.simulation.faults import Kind
from rps_pin.errors import InputError, shown

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(gt=0, le=1)]
Count = Annotated[int, Field(ge=0)]
Text = Annotated[str, Field(min_length=1)]
Three = Annotated[list[Finite], Field(min_length=3, max_length=3)]
OneOrThree = NonNegative | Annotated[list[NonNegative], Field(min_length=3, max_length=3)]


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Machine(_Entry):
    """What differs from the scenario's robot: factors of its masses, and its friction.

    See `wrong_parameters`.
    """

    masses: Positive | None = None
    platform: Positive | None = None
    legs: Positive | None = None
    rods: Positive | None = None
    prismatic_damping: NonNegative | None = None
    prismatic_friction: NonNegative | None = None
    revolute_damping: NonNegative | None = None
    revolute_friction: NonNegative | None = None
    friction_speed: Positive | None = None


class PlantEntry(Machine):
    """See `Plant` and `Encoders`; `payload` is a mass at the platform's centre, kg."""

    payload: Positive | None = None
    delay: Count | None = None
    substeps: Annotated[int, Field(ge=1)] | None = None
    encoder_resolution: NonNegative = 0.0
    encoder_noise: NonNegative = 0.0
    seed: Count = 0


class GainsEntry(_Entry):
    """See `Gains`."""

    proportional: OneOrThree
    derivative: OneOrThree
    integral: OneOrThree = 0.0


class ControllerEntry(_Entry):
    """See `ComputedTorque` and `PDControl`.

    Gains are given by `bandwidth` (Hz), `damping` and `integral`, as `Gains.placed` takes them; for
    ``law: pd`` they are multiplied by `effective_inertia` at the trajectory's start. Or they are
    given by `gains`, in the law's own units.
    """

    law: Literal["computed_torque", "pd"] = "computed_torque"
    space: Literal["actuator", "task"] | None = None
    compensation: Literal["gravity", "feed_forward", "none"] | None = None
    bandwidth: Positive | None = None
    damping: Positive | None = None
    integral: NonNegative | None = None
    gains: GainsEntry | None = None
    model: Machine = Machine()
    speeds: Literal["filtered", "measured"] = "filtered"
    cut_off: Positive | None = None
    force_limit: Positive | Annotated[list[Positive], Field(min_length=3, max_length=3)] | None = (
        None
    )
    near_singular: Share | None = None
    stop_singular: Share | None = None
    largest_jump: Positive | None = None
    most_lost: Count | None = None
    paced: bool = False

    @model_validator(mode="after")
    def _gains_once(self) -> ControllerEntry:
        placed = (self.bandwidth, self.damping, self.integral)
        if (self.gains is None) == (self.bandwidth is None):
            raise ValueError("it needs either bandwidth (Hz) or gains")
        if self.gains is not None and any(one is not None for one in placed):
            raise ValueError("damping and integral go with bandwidth, not with gains")
        if self.law == "computed_torque" and self.compensation is not None:
            raise ValueError("compensation is for law: pd; computed torque has its own")
        return self


class FaultEntry(_Entry):
    """See `Fault`; times count from the start of the run."""

    kind: Kind
    start: NonNegative
    duration: Positive | None = None
    leg: Literal[1, 2, 3] | None = None
    size: Finite | None = None
    offset: Three | None = None


class ScenarioEntry(_Entry):
    """The file: all keys."""

    robot: Text
    trajectory: Text | dict[str, Any]
    controller: ControllerEntry
    plant: PlantEntry = PlantEntry()
    faults: list[FaultEntry] = []
    period: Positive = 1e-3
    settle: NonNegative = 1.0
    duration: Positive | None = None


_ENTRIES: dict[tuple[str, ...], type[BaseModel]] = {
    (): ScenarioEntry,
    ("controller",): ControllerEntry,
    ("controller", "model"): Machine,
    ("controller", "gains"): GainsEntry,
    ("plant",): PlantEntry,
    ("faults",): FaultEntry,
}


def validated(file: YamlFile) -> ScenarioEntry:
    """Return the scenario that a file holds.

    Raises
    ------
    InputError
        If a key is unknown (lists those there are) or missing, or a value is not what its key
        takes; with the line.
    """
    try:
        return ScenarioEntry.model_validate(dict(file.values))
    except ValidationError as error:
        errors = error.errors(include_url=False)
    # A key that is misspelt is unknown, and the right one missing: the first says more.
    first = min(errors, key=lambda one: one["type"] != "extra_forbidden")
    path = file.held(first["loc"])
    inside = path_text(path)
    if first["type"] == "missing":
        raise InputError(f"{file.place(path)}: {inside or 'a scenario'} needs {first['loc'][-1]}")
    if first["type"] == "extra_forbidden":
        owner = path[:-1]
        keys = _ENTRIES[tuple(part for part in owner if isinstance(part, str))].model_fields
        where = f" in {path_text(owner)}" if owner else ""
        raise InputError(
            f"{file.place(path)}: unknown key {path[-1]!r}{where}; the keys are: {', '.join(keys)}"
        )
    rule = first["msg"].removeprefix("Value error, ")
    rule = rule[0].lower() + rule[1:]
    value = first["input"]
    said = "" if isinstance(value, dict) else f" = {shown(value)}"
    raise InputError(f"{file.place(path)}: {inside or 'a scenario'}{said}: {rule}")
