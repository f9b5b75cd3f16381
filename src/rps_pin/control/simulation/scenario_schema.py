"""Keys of a control scenario's YAML file and the types of their values."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from rps_pin.config import Entry, Finite, NonNegative, Positive, Text, Three
from rps_pin.control.simulation.faults import Kind

Share = Annotated[float, Field(gt=0, le=1)]
Count = Annotated[int, Field(ge=0)]
OneOrThree = NonNegative | Annotated[list[NonNegative], Field(min_length=3, max_length=3)]


class Machine(Entry):
    """Differences from the scenario's robot: factors of its masses, and its friction.

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


class DrivesEntry(Entry):
    """Drives that take positions or speeds; see `ServoDrives`."""

    command: Literal["position", "speed"] = "position"
    bandwidth: Positive = 30.0
    damping: Positive = 1.0
    speed_limit: Positive | None = None

    @model_validator(mode="after")
    def _damping_of_positions(self) -> DrivesEntry:
        if self.command == "speed" and "damping" in self.model_fields_set:
            raise ValueError("damping is that of drives that take positions")
        return self


class PlantEntry(Machine):
    """See `Plant` and `Encoders`; `payload` is a mass at the platform's centre, kg."""

    payload: Positive | None = None
    drives: DrivesEntry | None = None
    delay: Count | None = None
    substeps: Annotated[int, Field(ge=1)] | None = None
    encoder_resolution: NonNegative = 0.0
    encoder_noise: NonNegative = 0.0
    seed: Count = 0


class GainsEntry(Entry):
    """See `Gains`."""

    proportional: OneOrThree
    derivative: OneOrThree
    integral: OneOrThree = 0.0


class ControllerEntry(Entry):
    """See `ComputedTorque` and `PDControl`.

    Gains are given by `bandwidth` (Hz), `damping` and `integral`, as `Gains.placed` takes them; for
    ``law: pd`` they are multiplied by `effective_inertia` at the trajectory's start. Or they are
    given by `gains`, in the law's own units. ``law: drives`` is `DriveControl`, for a plant with
    drives: without gains for positions; for speeds Kp is 2 pi `bandwidth`, or none.
    """

    law: Literal["computed_torque", "pd", "drives"] = "computed_torque"
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
        if self.law == "drives":
            return self._for_drives()
        if (self.gains is None) == (self.bandwidth is None):
            raise ValueError("it needs either bandwidth (Hz) or gains")
        if self.gains is not None and any(one is not None for one in placed):
            raise ValueError("damping and integral go with bandwidth, not with gains")
        if self.law == "computed_torque" and self.compensation is not None:
            raise ValueError("compensation is for law: pd; computed torque has its own")
        return self

    def _for_drives(self) -> ControllerEntry:
        """Refuse what commands of drives have no use for."""
        for name in ("space", "compensation", "damping", "integral", "force_limit"):
            if getattr(self, name) is not None:
                raise ValueError(f"{name} is not for law: drives")
        if self.gains is not None and self.bandwidth is not None:
            raise ValueError("it takes bandwidth (Hz) or gains, not both")
        return self


class FaultEntry(Entry):
    """See `Fault`; times count from the start of the run."""

    kind: Kind
    start: NonNegative
    duration: Positive | None = None
    leg: Annotated[int, Field(ge=1, le=3)] | None = None
    size: Finite | None = None
    offset: Three | None = None


class ScenarioEntry(Entry):
    """A control scenario."""

    robot: Text
    trajectory: Text | dict[str, Any]
    controller: ControllerEntry
    plant: PlantEntry = PlantEntry()
    faults: list[FaultEntry] = Field(default_factory=list)
    period: Positive = 1e-3
    settle: NonNegative = 1.0
    duration: Positive | None = None
