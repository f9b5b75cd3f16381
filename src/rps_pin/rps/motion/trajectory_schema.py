"""The keys of a trajectory's YAML file, those that the function of its kind takes."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
)

from rps_pin.config import YamlFile, path_text
from rps_pin.errors import InputError, shown
from rps_pin.trajectories.sampled_path import Ends
from rps_pin.trajectories.time_laws import Profile


def _one_or_three(value: Any) -> Any:
    for number in value if isinstance(value, list) and len(value) == 3 else [value]:
        if not isinstance(number, (int, float)) or isinstance(number, bool) or not number > 0:
            raise ValueError("it must be a positive number, or three: of z, tilt_x and tilt_y")
    try:
        return np.asarray(value, dtype=np.float64).tolist()
    except OverflowError:
        raise ValueError("it is too large") from None


def _size_and_number(value: Any) -> Any:
    if value is not None and not (isinstance(value, list) and len(value) == 2):
        raise ValueError("it must be a list of two: how far, m, and how often")
    return value and tuple(value)


Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Pose = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Pair = Annotated[list[Finite], Field(min_length=2, max_length=2)]
Lift = Annotated[tuple[Finite, int] | None, BeforeValidator(_size_and_number)]
Limit = Annotated[Any, AfterValidator(_one_or_three)]


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Fastest(_Entry):
    """Limits of the actuators that replace the robot's own; see `time_optimal`."""

    force: Positive | None = None
    speed: Positive | None = None


class _Described(_Entry):
    kind: str
    fastest: Fastest | None = None


class Helix(_Described):
    """See `rps_pin.trajectories.helix`."""

    kind: Literal["helix"]
    radius: Finite
    pitch: Finite
    height: Finite
    branch: Literal["+", "-"] = "+"
    duration: Positive | None = None


class PointToPoint(_Described):
    """See `rps_pin.trajectories.point_to_point`."""

    kind: Literal["point_to_point"]
    start: Pose
    end: Pose
    profile: Profile | None = None
    duration: Positive | None = None
    max_rate: Limit | None = None
    max_acceleration: Limit | None = None
    max_jerk: Limit | None = None


class Spline(_Described):
    """See `rps_pin.trajectories.spline`."""

    kind: Literal["spline"]
    poses: list[Pose]
    times: list[Finite] | None = None
    duration: Positive | None = None
    profile: Profile | None = None
    tilt_scale: Positive | None = None

    @field_validator("profile", "tilt_scale")
    @classmethod
    def _not_with_times(cls, value: Any, info: ValidationInfo) -> Any:
        if value is not None and info.data.get("times") is not None:
            raise ValueError("it goes with a duration; here times say when each pose is met")
        return value


class Circle(_Described):
    """See `rps_pin.trajectories.circle`."""

    kind: Literal["circle"]
    height: Finite
    tilt: Finite
    turns: Positive | None = None
    start: Finite | None = None
    duration: Positive
    profile: Profile | None = None


class Lissajous(_Described):
    """See `rps_pin.trajectories.lissajous`."""

    kind: Literal["lissajous"]
    height: Finite
    amplitude: Pair
    frequency: Annotated[list[int], Field(min_length=2, max_length=2)]
    phase: Pair | None = None
    lift: Lift = None
    turns: Positive | None = None
    duration: Positive
    profile: Profile | None = None


class Csv(_Described):
    """See `rps_pin.trajectories.read_csv`; the file's name counts from the YAML file's folder."""

    kind: Literal["csv"]
    file: Annotated[str, Field(min_length=1)]
    max_step: Positive | None = None
    ends: Ends | None = None


Described = Helix | PointToPoint | Spline | Circle | Lissajous | Csv

KINDS: dict[str, type[Described]] = {
    "helix": Helix,
    "point_to_point": PointToPoint,
    "spline": Spline,
    "circle": Circle,
    "lissajous": Lissajous,
    "csv": Csv,
}


def validated(file: YamlFile) -> Described:
    """Return the description that a file holds.

    Raises
    ------
    InputError
        If the kind is missing or unknown (lists those there are), a key is unknown (lists those of
        the kind) or missing, or a value is not what its key takes; with the line.
    """
    kinds = ", ".join(KINDS)
    if "kind" not in file.values:
        raise InputError(f"{file.origin} needs the key 'kind', one of {kinds}")
    kind = file.values["kind"]
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError(
            f"{file.place(('kind',))}: kind = {shown(kind)}: it must be one of {kinds}"
        )
    model = KINDS[kind]
    try:
        return model.model_validate(dict(file.values))
    except ValidationError as error:
        errors = error.errors(include_url=False)
    # A key that is misspelt is unknown, and the right one missing: the first says more.
    first = min(errors, key=lambda one: one["type"] != "extra_forbidden")
    path = file.held(first["loc"])
    if first["type"] == "missing":
        inside = path_text(path) if path else f"kind {kind}"
        raise InputError(f"{file.place(path or ('kind',))}: {inside} needs {first['loc'][-1]}")
    if first["type"] == "extra_forbidden":
        keys, owner = (Fastest, "fastest") if path[1:] else (model, f"kind {kind}")
        raise InputError(
            f"{file.place(path)}: unknown key {path[-1]!r}; those of {owner} are "
            f"{', '.join(keys.model_fields)}"
        )
    rule = first["msg"].removeprefix("Value error, ")
    rule = rule[0].lower() + rule[1:]
    raise InputError(f"{file.place(path)}: {path_text(path)} = {shown(first['input'])}: {rule}")
