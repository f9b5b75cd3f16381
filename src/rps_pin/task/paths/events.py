"""Events along a path: singularities met, limits left; and the check's findings."""

from __future__ import annotations

from typing import NamedTuple

from rps_pin.arrays import Array


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
        where, which = self.where or _place(self.pose), self.which
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

    @property
    def ok(self) -> bool:
        """Whether the path meets no singularity and keeps every limit."""
        return not (self.singularities or self.limits)

    def lines(self) -> list[str]:
        """Return the findings as lines to read: a summary, then one for each event in time."""
        events: list[SingularityEvent | LimitEvent] = [*self.singularities, *self.limits]
        events.sort(key=lambda event: event.time)
        return [
            f"{self.duration:.6g} s, {self.samples} samples: {_counted(self)}",
            f"smallest distance to a singularity: {self.minimum_distance:.4g} "
            f"({self.minimum_singularity}) at t = {self.minimum_time:.9g} s "
            f"(threshold {self.threshold:.3g})",
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
    return (
        f"crosses singularities {crossings} times, grazes or stays in them {near} times, "
        f"leaves limits {outside} times{', and its assembly mode ends' if ends else ''}"
    )


def _place(pose: Array) -> str:
    """Return a pose of a 3-RPS in words."""
    z, tilt_x, tilt_y = pose
    return f"z = {z:.6g} m, tilt = ({tilt_x:.6g}, {tilt_y:.6g}) rad"
