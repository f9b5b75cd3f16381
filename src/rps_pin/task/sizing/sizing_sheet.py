"""Sizing sheet: demands of a motion on the actuators and their limits, as data and as text.

Work is counted from the actuator's side: force times speed is positive where the actuator drives
its leg, negative where the leg drives the actuator (regenerated). Of actuators that turn, forces
are torques, N m, lengths angles, rad, and speeds rad/s.
"""

from __future__ import annotations

import io
import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Protocol, Self

from rich.console import Console
from rich.table import Table
from rich.text import Text

from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds


class _HasLimits(Protocol):
    @property
    def actuator_force_limit(self) -> float: ...

    @property
    def actuator_speed_limit(self) -> float: ...

    @property
    def leg_length_limits(self) -> tuple[float, float]: ...


@refuses_other_kinds
@dataclass(frozen=True)
class ActuatorLimits:
    """Limits of one actuator; infinity where there is no limit."""

    least: ClassVar[float] = 0.0
    position_names: ClassVar[tuple[str, str]] = ("shortest leg", "longest leg")

    force: float = math.inf
    """Push or pull, N."""
    speed: float = math.inf
    """Out or in, m/s."""
    power: float = math.inf
    """Given out or taken in, W."""
    length: tuple[float, float] = (0.0, math.inf)
    """Shortest and longest leg, m."""

    def __post_init__(self) -> None:
        for name in ("force", "speed", "power"):
            value = getattr(self, name)
            if not value > 0:
                raise InputError(f"{name} limit = {value}: it must be positive")
        low, high = self.length
        if not self.least <= low < high:
            least = "0 <= " if self.least == 0 else ""
            raise InputError(
                f"length limits = {self.length}: they must be {least}shortest < longest"
            )

    @classmethod
    def of(cls, parameters: _HasLimits, *, power: float = math.inf) -> ActuatorLimits:
        """Return the limits in a robot's parameters; they have none of power."""
        return cls(
            parameters.actuator_force_limit,
            parameters.actuator_speed_limit,
            power,
            parameters.leg_length_limits,
        )


@refuses_other_kinds
@dataclass(frozen=True)
class DriveLimits(ActuatorLimits):
    """Limits of an actuated joint, whose position may be negative; N m, rad/s, rad if it turns."""

    least: ClassVar[float] = -math.inf
    position_names: ClassVar[tuple[str, str]] = ("lowest position", "highest position")

    length: tuple[float, float] = (-math.inf, math.inf)
    """Lowest and highest position, m or rad."""


class Margin(NamedTuple):
    """One quantity against its limit."""

    quantity: str
    value: float
    """Demand of the motion, in `unit`."""
    limit: float
    """In `unit`; infinite if there is none."""
    margin: float
    """How far the limit is, in `unit`; negative: exceeded."""
    unit: str

    @property
    def kept(self) -> bool:
        """Whether the limit is kept."""
        return self.margin >= 0

    def in_degrees(self) -> Margin:
        """Return it with angles in degrees."""
        if not self.unit.startswith("rad"):
            return self
        value, limit, margin = map(math.degrees, (self.value, self.limit, self.margin))
        return Margin(self.quantity, value, limit, margin, self.unit.replace("rad", "deg"))


@dataclass(frozen=True)
class ActuatorSizing:
    """Demands on one actuator. Peaks are magnitudes."""

    actuator: int
    """From 1."""
    force_peak: float
    """N."""
    force_peak_time: float
    """When, s."""
    force_min: float
    """N; negative pulls."""
    force_max: float
    """N."""
    force_rms: float
    """Root of the time average of the squared force, N: what heats a motor."""
    speed_peak: float
    """m/s."""
    power_peak: float
    """W."""
    power_mean: float
    """Time average of the magnitude, W."""
    energy_driven: float
    """Positive work: what the actuator puts in, J."""
    energy_regenerated: float
    """Work that the leg does on the actuator, J; positive."""
    duty: float
    """Share of the time that the force is above `SizingSheet.threshold` times its peak."""
    length_min: float
    """m."""
    length_max: float
    """m."""
    margins: tuple[Margin, ...]
    """Force, speed, power, shortest and longest leg, or lowest and highest position."""
    name: str = ""
    """Of the joint; empty for a leg of the 3-RPS."""
    angular: bool = False
    """Whether it turns: forces are torques, N m, and lengths angles, in `angle_unit`."""
    angle_unit: str = "rad"
    """``"rad"`` or ``"deg"``."""

    def in_degrees(self) -> ActuatorSizing:
        """Return it with angles and angular speeds in degrees."""
        if not self.angular:
            return replace(self, angle_unit="deg")
        return replace(
            self,
            speed_peak=math.degrees(self.speed_peak),
            length_min=math.degrees(self.length_min),
            length_max=math.degrees(self.length_max),
            margins=tuple(margin.in_degrees() for margin in self.margins),
            angle_unit="deg",
        )

    @property
    def stroke(self) -> float:
        """Length range of the motion, m."""
        return self.length_max - self.length_min


@refuses_other_kinds
@dataclass(frozen=True)
class SizingSheet:
    """A motion's demands on the actuators; n samples."""

    actuators: tuple[ActuatorSizing, ...]
    limits: ActuatorLimits | tuple[ActuatorLimits, ...]
    """Of all actuators, or of each."""
    threshold: float
    """Share of the peak force that counts for the duty."""
    time: Array
    """Shape (n,), s."""
    force: Array
    """Shape (n, na), N or N m; of the 3-RPS (n, 3)."""
    speed: Array
    """Shape (n, na), m/s or rad/s."""

    @property
    def kept(self) -> bool:
        """Whether every limit is kept."""
        return all(margin.kept for actuator in self.actuators for margin in actuator.margins)

    def limits_of(self, index: int) -> ActuatorLimits:
        """Return the limits of one actuator, from 0."""
        return self.limits if isinstance(self.limits, ActuatorLimits) else self.limits[index]

    def in_degrees(self) -> Self:
        """Return the sheet with angles and angular speeds of its actuators in degrees."""
        limits = []
        for k, one in enumerate(self.actuators):
            own = self.limits_of(k)
            low, high = map(math.degrees, own.length)
            turned = replace(own, speed=math.degrees(own.speed), length=(low, high))
            limits.append(turned if one.angular else own)
        factors = [math.degrees(1.0) if one.angular else 1.0 for one in self.actuators]
        return replace(
            self,
            actuators=tuple(one.in_degrees() for one in self.actuators),
            limits=tuple(limits),
            speed=self.speed * factors,
        )

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers, strings, lists and dictionaries, as JSON has them.

        Without the samples; a limit that there is not, and its margin, are None.
        """
        return {
            "duration": float(self.time[-1] - self.time[0]),
            "samples": len(self.time),
            "threshold": self.threshold,
            "kept": self.kept,
            "actuators": [_plain(actuator) for actuator in self.actuators],
        }

    def table(self) -> Table:
        """Return the sheet as a table for a terminal; limits that are broken are marked."""
        table = Table(title="Actuator sizing")
        table.add_column("")
        for actuator in self.actuators:
            table.add_column(f"actuator {actuator.actuator}", justify="right", overflow="fold")
        for label, name in _ROWS.items():
            table.add_row(label, *(f"{getattr(each, name):.4g}" for each in self.actuators))
        label = f"time above {self.threshold:.0%} of peak force"
        table.add_row(label, *(f"{each.duty:.1%}" for each in self.actuators), end_section=True)
        for margins in zip(*(each.margins for each in self.actuators), strict=True):
            if math.isfinite(margins[0].margin):
                label = f"{margins[0].quantity}: margin to {margins[0].limit:.4g} {margins[0].unit}"
                cells = [
                    f"{each.margin:.4g}"
                    if each.kept
                    else Text(f"{each.margin:.4g} BROKEN", style="bold red")
                    for each in margins
                ]
                table.add_row(label, *cells)
        return table

    def tables(self) -> tuple[Table, ...]:
        """Return the tables for a terminal."""
        return (self.table(),)

    def text(self, width: int = 100) -> str:
        """Return the tables as plain text."""
        written = io.StringIO()
        # In a notebook, a console would show what it prints there, and write nothing.
        console = Console(file=written, width=width, color_system=None, force_jupyter=False)
        for table in self.tables():
            console.print(table)
        return written.getvalue()

    def __str__(self) -> str:
        return self.text()


def _plain(actuator: ActuatorSizing) -> dict[str, Any]:
    margins = [
        {name: None if value in (math.inf, -math.inf) else value for name, value in one.items()}
        for one in (margin._asdict() | {"kept": margin.kept} for margin in actuator.margins)
    ]
    plain = vars(actuator) | {"stroke": actuator.stroke, "margins": margins}
    if not actuator.name:  # the 3-RPS's
        del plain["name"], plain["angular"], plain["angle_unit"]
    return plain


#: Rows of the table: labels, and attributes of `ActuatorSizing`.
_ROWS = {
    "peak force (N)": "force_peak",
    "RMS force (N)": "force_rms",
    "peak speed (m/s)": "speed_peak",
    "peak power (W)": "power_peak",
    "mean power (W)": "power_mean",
    "energy driven (J)": "energy_driven",
    "energy regenerated (J)": "energy_regenerated",
    "stroke (m)": "stroke",
}
