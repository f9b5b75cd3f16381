"""Keys of a trajectory's YAML file, by kind: the arguments of the function of that name."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, field_validator

from rps_pin.config import Entry, Finite, Positive, Text, Three, YamlFile
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
        raise ValueError("it must be a list of two: amplitude, m, and frequency")
    return value and tuple(value)


Pair = Annotated[list[Finite], Field(min_length=2, max_length=2)]
Lift = Annotated[tuple[Finite, int] | None, BeforeValidator(_size_and_number)]
Limit = Annotated[Any, AfterValidator(_one_or_three)]


class Fastest(Entry):
    """Limits of the actuators that replace the robot's own; see `time_optimal`."""

    force: Positive | None = None
    speed: Positive | None = None


class _Described(Entry):
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
    start: Three
    end: Three
    profile: Profile | None = None
    duration: Positive | None = None
    max_rate: Limit | None = None
    max_acceleration: Limit | None = None
    max_jerk: Limit | None = None


class Spline(_Described):
    """See `rps_pin.trajectories.spline`."""

    kind: Literal["spline"]
    poses: list[Three]
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
    file: Text
    max_step: Positive | None = None
    ends: Ends | None = None


Described = Helix | PointToPoint | Spline | Circle | Lissajous | Csv

KINDS: dict[str, type[Described]] = {
    get_args(schema.model_fields["kind"].annotation)[0]: schema for schema in get_args(Described)
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
        raise InputError(f"{file.place(())} needs the key 'kind', one of {kinds}")
    kind = file.values["kind"]
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError(
            f"{file.place(('kind',))}: kind = {shown(kind)}: it must be one of {kinds}"
        )
    return file.validated(KINDS[kind], f"kind {kind}", ("kind",))
