"""Events along a path: singularities met, limits left; and the check's findings."""

from __future__ import annotations

from typing import NamedTuple

from rps_pin.arrays import Array
from rps_pin.plain_text import short


class SingularityEvent(NamedTuple):
    """A path meets a singularity, or comes nearer to it than the threshold."""

    kind: str
    """``"crosses"`` (the signed distance changes sign), ``"grazes"`` (the distance has a minimum
    below the threshold, or the path begins or ends there), ``"stays"`` (in the singularity) or
    ``"ends"`` (the assembly mode ends there: the path cannot be followed beyond)."""
    singularity: str
    """``"type I"``, ``"type II"`` or ``"constraint"``; see `SingularityMeasures`."""
    time: float
    """When, s; of a stay, when it begins."""
    width: float
    """Width of the bracket around `time`, s; of a stay, how long it lasts."""
    pose: Array
    """(z, tilt_x, tilt_y), or the task's coordinates, at that time, m and rad."""
    distance: float
    """The signed measure at that time, dimensionless; what the bracket leaves of zero."""
    leg: int = 0
    """The leg of a 3-RPS without length in a type I singularity, 1 to 3; else 0."""
    where: str = ""
    """The pose in words; empty for (z, tilt_x, tilt_y)."""

    @property
    def which(self) -> str:
        """The singularity in words."""
        return f"{self.singularity} singularity" + (f" of leg {self.leg}" if self.leg else "")

    def __str__(self) -> str:
        where, which = self.where or pose_of_robot_in_words(self.pose), self.which
        if self.kind == "ends":
            return (
                f"{self.time:.9f} s: the assembly mode ends in a {which} (+- {self.width / 2:.1g} "
                f"s), and the rest is not checked; {where}"
            )
        if self.kind == "stays":
            return f"{self.time:.9f} s: stays in a {which} for {self.width:.6g} s; {where}"
        near = f" at a distance of {abs(self.distance):.3g}" if self.kind == "grazes" else ""
        return (
            f"{self.time:.9f} s: {self.kind} a {which}{near} (+- {self.width / 2:.1g} s); {where}"
        )


class LimitEvent(NamedTuple):
    """A path leaves a limit of a leg or a joint, or comes back."""

    kind: str
    """``"leaves"``, ``"returns"``, or ``"starts outside"``."""
    leg: int
    """1 to 3 of a 3-RPS; 0 where `joint` is named."""
    quantity: str
    """Of a leg ``"length"``, ``"angle"`` or ``"spherical joint"``, as in `LimitViolation`; of a
    joint ``"position"``, and of an actuator ``"speed"`` and ``"force"`` too."""
    time: float
    """When, s."""
    width: float
    """Width of the bracket around `time`, s."""
    pose: Array
    """(z, tilt_x, tilt_y), or the task's coordinates, at that time, m and rad."""
    limit: float
    """The limit, in `unit`."""
    side: str
    """``"lower"`` or ``"upper"``."""
    unit: str
    """Of the limit: m, rad, m/s, rad/s, N or N m."""
    joint: str = ""
    """Name of the joint; empty for a leg of a 3-RPS."""

    def __str__(self) -> str:
        how = {
            "leaves": "leaves its",
            "returns": "returns within its",
            "starts outside": "starts outside its",
        }[self.kind]
        who = f"joint {self.joint!r}" if self.joint else f"leg {self.leg}"
        return (
            f"{self.time:.9f} s: {who} {how} {self.side} limit of {self.quantity}, "
            f"{self.limit:.6g} {self.unit} (+- {self.width / 2:.1g} s)"
        )


class InterferenceEvent(NamedTuple):
    """Two links begin or cease to overlap, or to be nearer than the clearance."""

    kind: str
    """``"begins"``, ``"ends"``, ``"starts inside"`` (at the path's start; it ends later), or
    ``"throughout"`` (from the start to the end of what was checked: one event)."""
    link_a: str
    """Name of a link."""
    link_b: str
    """Name of the other."""
    time: float
    """When, s."""
    width: float
    """Width of the bracket around `time`, s."""
    pose: Array
    """The task's coordinates at that time, m and rad."""
    clearance: float
    """m."""
    where: str
    """The pose in words."""

    def __str__(self) -> str:
        near = f"nearer than {self.clearance:.6g} m"
        how = {
            "begins": f"come {near}" if self.clearance else "begin to interfere",
            "ends": f"are no longer {near}" if self.clearance else "come apart",
            "starts inside": f"are {near} at the start"
            if self.clearance
            else "interfere at the start",
            "throughout": f"are {near} on the whole path"
            if self.clearance
            else "interfere on the whole path",
        }[self.kind]
        width = f" (+- {self.width / 2:.1g} s)" if self.kind in ("begins", "ends") else ""
        return f"{self.time:.9f} s: {self.link_a} and {self.link_b} {how}{width}; {self.where}"


class PathInterference(NamedTuple):
    """Interference of links along a path."""

    events: tuple[InterferenceEvent, ...]
    """In order of time."""
    pairs: int
    """How many pairs of links were checked."""
    clearance: float
    """Least distance that was asked for, m."""
    minimum_distance: float
    """Least signed distance of a pair, m: negative in interference, infinite if none is checked."""
    minimum_links: tuple[str, str]
    """Names of its links."""
    minimum_time: float
    """When, s."""
    hidden: float
    """Largest depth, m, of a contact between two samples that would not be found, if the links move
    no faster between samples than at them."""
    skipped: str = ""
    """Why nothing was checked; empty if it was."""

    @property
    def ok(self) -> bool:
        """Whether no pair comes nearer than the clearance, or nothing was checked."""
        return not self.events

    def __str__(self) -> str:
        if self.skipped:
            return f"interference: {self.skipped}"
        a, b = self.minimum_links
        return (
            f"interference: {_pairs(self.pairs)} of links, least distance "
            f"{self.minimum_distance:.6g} m ({a} and {b}) at t = {self.minimum_time:.9g} s "
            f"(clearance {self.clearance:.6g} m)"
        )


class PathCheck(NamedTuple):
    """What `check_path` found."""

    singularities: tuple[SingularityEvent, ...]
    """In order of time."""
    limits: tuple[LimitEvent, ...]
    """In order of time."""
    minimum_distance: float
    """Smallest `SingularityMeasures.distance`, 0 to 1."""
    minimum_singularity: str
    """Which kind that is to."""
    minimum_time: float
    """When it is reached, s."""
    duration: float
    """Of the path, s."""
    threshold: float
    """Below this, a smallest distance is a graze."""
    tolerance: float
    """Widest bracket of an event, s."""
    samples: int
    """At how many times the path was looked at before events were bracketed."""
    largest_gap: float
    """Longest time between two of them, s: within it, no signal may turn more than once."""
    minimum_pose: Array
    """(z, tilt_x, tilt_y), or the task's coordinates, where the smallest distance is reached."""
    interference: PathInterference | None = None
    """Of the links; None if it was not asked for."""

    @property
    def ok(self) -> bool:
        """Whether the path meets no singularity, keeps every limit, and no links interfere."""
        return not (self.singularities or self.limits or self.touching)

    @property
    def touching(self) -> tuple[InterferenceEvent, ...]:
        """The events of interference."""
        return () if self.interference is None else self.interference.events

    def lines(self) -> list[str]:
        """Return the findings as lines to read: a summary, then one for each event in time."""
        events: list[SingularityEvent | LimitEvent | InterferenceEvent] = [
            *self.singularities,
            *self.limits,
            *self.touching,
        ]
        events.sort(key=lambda event: event.time)
        return [
            f"{self.duration:.6g} s, {self.samples} samples: {_counted(self)}",
            f"smallest distance to a singularity: {self.minimum_distance:.4g} "
            f"({self.minimum_singularity}) at t = {self.minimum_time:.9g} s "
            f"(threshold {self.threshold:.3g})",
            *([] if self.interference is None else [str(self.interference)]),
            *map(str, events),
        ]

    def __str__(self) -> str:
        return "\n".join(self.lines())


def _counted(check: PathCheck) -> str:
    if check.ok:
        return "meets no singularity and keeps every limit"
    crossings = sum(event.kind == "crosses" for event in check.singularities)
    ends = any(event.kind == "ends" for event in check.singularities)
    near = len(check.singularities) - crossings - ends
    outside = sum(event.kind != "returns" for event in check.limits)
    touching = {(event.link_a, event.link_b) for event in check.touching}
    does = "interferes" if len(touching) == 1 else "interfere"
    met = f"; {_pairs(len(touching))} of links {does}" if touching else ""
    return (
        f"crosses singularities {_times(crossings)}, grazes or stays in them {_times(near)}, "
        f"leaves limits {_times(outside)}{', and its assembly mode ends' if ends else ''}{met}"
    )


def _times(count: int) -> str:
    return f"{count} time" if count == 1 else f"{count} times"


def pose_of_robot_in_words(pose: Array, angle: str = "rad") -> str:
    """Return a pose of a 3-RPS in words, whose angles are in that unit."""
    z, tilt_x, tilt_y = map(short, pose)
    return f"z = {z} m, tilt = ({tilt_x}, {tilt_y}) {angle}"


def _pairs(count: int) -> str:
    return f"{count} pair{'' if count == 1 else 's'}"
