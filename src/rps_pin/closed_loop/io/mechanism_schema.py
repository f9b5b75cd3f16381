"""Keys of a mechanism file and the types of their values."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from rps_pin.closed_loop.editing.merge import MergedKind
from rps_pin.config import Entry, Finite, NonNegative, Positive, Text, Three


class PlacementEntry(Entry):
    """An offset as URDF's ``origin``: a shift, m, and roll, pitch and yaw, rad."""

    xyz: Three = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    rpy: Three = Field(default_factory=lambda: [0.0, 0.0, 0.0])


class ClosureEntry(Entry):
    """The fields of a `LoopClosure`; `at_home` is one of the frames as they stand at home."""

    frame_a: Text
    frame_b: Text
    kind: Text = "spherical"
    name: str = ""
    axis: Three | None = None
    axis_b: Three | None = None
    distance: Finite | None = None
    placement_a: PlacementEntry | None = None
    placement_b: PlacementEntry | None = None
    at_home: bool = False


class CouplingEntry(Entry):
    """The fields of a `JointCoupling`; `others` is its `other` with ratios by name."""

    joint: Text
    other: Text | None = None
    others: dict[Text, Finite] | None = None
    ratio: Finite = 1.0
    offset: Finite = 0.0
    polynomial: list[Finite] | None = None
    name: str = ""


class MergeEntry(Entry):
    """The fields of a `JointMerge`."""

    joints: list[Text]
    into: MergedKind
    name: Text


class TaskEntry(Entry):
    """The arguments of a `Task`: a frame and its coordinates, or joints."""

    frame: Text | None = None
    coordinates: list[Text] | None = None
    joints: list[Text] | None = None
    reference: Text = "universe"
    placement: PlacementEntry | None = None
    characteristic_length: Positive | None = None


class InterferenceEntry(Entry):
    """Pairs of links, by name, that may overlap."""

    ignore: list[Annotated[list[Text], Field(min_length=2, max_length=2)]] = Field(
        default_factory=list
    )


class Description(Entry):
    """A mechanism file; it has one of `urdf` and `mjcf`.

    Joints are of the `joint_types` before they are merged. Joint names in `home` may be those
    before or after merging; all others are those after.
    `closures` and `couplings` are added to those of `mjcf`, `actuated` and `gravity` replace its
    own, and the other keys do so joint by joint, as they do for the damping and friction of a
    URDF's ``dynamics`` elements.
    """

    name: Text | None = None
    urdf: Text | None = None
    mjcf: Text | None = None
    root: Literal["fixed", "free"] | None = None
    within_limits: bool = True
    gravity: Three | None = None
    closures: list[ClosureEntry] = Field(default_factory=list)
    couplings: list[CouplingEntry] = Field(default_factory=list)
    actuated: list[Text] | None = None
    home: dict[str, Finite | list[Finite]] = Field(default_factory=dict)
    joint_types: dict[Text, Text] = Field(default_factory=dict)
    merge: list[MergeEntry] = Field(default_factory=list)
    damping: dict[str, NonNegative | list[NonNegative]] = Field(default_factory=dict)
    friction: dict[str, NonNegative | list[NonNegative]] = Field(default_factory=dict)
    stiffness: dict[str, NonNegative | list[NonNegative]] = Field(default_factory=dict)
    rest: dict[str, Finite | list[Finite]] = Field(default_factory=dict)
    armature: dict[str, NonNegative | list[NonNegative]] = Field(default_factory=dict)
    friction_speed: Positive | None = None
    characteristic_length: Positive | None = None
    max_condition: Annotated[float, Field(ge=1, allow_inf_nan=False)] | None = None
    accuracy: NonNegative | None = None
    task: TaskEntry | None = None
    interference: InterferenceEntry | None = None
