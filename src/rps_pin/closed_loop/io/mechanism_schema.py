"""The keys of a mechanism file, and what each takes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from rps_pin.closed_loop.editing.merge import MergedKind
from rps_pin.config import YamlFile
from rps_pin.errors import InputError, shown

Text = Annotated[str, Field(min_length=1)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Axis = Annotated[list[Finite], Field(min_length=3, max_length=3)]


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class ClosureEntry(_Entry):
    """The fields of a `LoopClosure`."""

    frame_a: Text
    frame_b: Text
    kind: Text = "spherical"
    name: str = ""
    axis: Axis | None = None
    axis_b: Axis | None = None
    distance: Finite | None = None


class CouplingEntry(_Entry):
    """The fields of a `JointCoupling`."""

    joint: Text
    other: Text
    ratio: Finite = 1.0
    offset: Finite = 0.0
    name: str = ""


class MergeEntry(_Entry):
    """The fields of a `JointMerge`."""

    joints: list[Text]
    into: MergedKind
    name: Text


class Description(_Entry):
    """What a mechanism file may hold; one of `urdf` and `mjcf` it must.

    Joint names in `home` may be those before merging or after; everywhere else they are those
    after. What `mjcf` says itself comes first: `closures` and `couplings` are added to it,
    `actuated` and `gravity` replace it, and the other keys do so joint by joint. The damping and
    friction of a URDF's ``dynamics`` elements likewise.
    """

    name: Text | None = None
    urdf: Text | None = None
    mjcf: Text | None = None
    root: Literal["fixed", "free"] | None = None
    gravity: Axis | None = None
    closures: list[ClosureEntry] = []
    couplings: list[CouplingEntry] = []
    actuated: list[Text] | None = None
    home: dict[str, Finite | list[Finite]] = {}
    merge: list[MergeEntry] = []
    damping: dict[str, NonNegative] = {}
    friction: dict[str, NonNegative] = {}
    stiffness: dict[str, NonNegative] = {}
    rest: dict[str, Finite] = {}
    armature: dict[str, NonNegative] = {}
    friction_speed: Positive | None = None
    characteristic_length: Positive | None = None
    max_condition: Annotated[float, Field(ge=1, allow_inf_nan=False)] | None = None


def validated(file: YamlFile) -> Description:
    """Return the description that a file holds.

    Raises
    ------
    InputError
        If a key is unknown (lists those there are) or missing, or a value is not what its key
        takes; with the line of the first such value.
    """
    try:
        return Description.model_validate(dict(file.values))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
    path = tuple(first["loc"])
    if first["type"] == "missing":
        key, path = path[-1], path[:-1]
        raise InputError(f"{file.place(path)}: {_key(path)} needs {key}")
    if first["type"] == "extra_forbidden":
        keys = ", ".join(_fields(path[:-1]))
        inside = f" in {_key(path[:-1])}" if path[:-1] else ""
        raise InputError(
            f"{file.place(path)}: unknown key {path[-1]!r}{inside}; the keys are: {keys}"
        )
    rule = first["msg"][0].lower() + first["msg"][1:]
    raise InputError(f"{file.place(path)}: {_key(path)} = {shown(first['input'])}: {rule}")


def _key(path: tuple[str | int, ...]) -> str:
    """Return a path as a reader would write it: ``closures[0].axis``."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        elif part not in ("[key]", "float", "list[float]") and "[" not in part:
            text += f".{part}" if text else part
    return text


def _fields(path: tuple[str | int, ...]) -> list[str]:
    entries: dict[str, type[_Entry]] = {
        "closures": ClosureEntry,
        "couplings": CouplingEntry,
        "merge": MergeEntry,
    }
    return list((entries[str(path[0])] if path else Description).model_fields)
