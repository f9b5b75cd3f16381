"""Figures of a simulated run: errors in micrometres and microradians, forces, statuses."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

import numpy as np
from rich.table import Column, Table

from rps_pin.arrays import Array, Bools
from rps_pin.control.loop.status import STATUSES, Status
from rps_pin.control.simulation.loop_run import LoopRun
from rps_pin.errors import InputError
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.kinematics.legs import leg_angles_and_lengths, tips
from rps_pin.rps.kinematics.pose import position, rotation

#: Tolerance of a window's ends, s.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class TrackingErrors:
    """Errors of the plant's motion, n ticks.

    Attributes
    ----------
    centre : (n, 3) array
        Platform's centre less that of the target, base axes, m.
    turn : (n,) array
        Angle between the platform and the target's, rad.
    length : (n, 3) array
        Leg lengths less those of the target, m.
    """

    centre: Array
    turn: Array
    length: Array

    @classmethod
    def of(cls, run: LoopRun) -> TrackingErrors:
        """Return the errors of every tick."""
        p = run.parameters
        if p is None:
            raise InputError("errors of centre, turn and legs are of a 3-RPS: see TaskSummary")
        h = p.platform_radius
        centre, turned = position(run.target, h), rotation(run.target)
        length, _ = leg_angles_and_lengths(tips(centre, turned, h), p.base_radius)
        # The angle of R_target' R, from |R - R_target| = 2 sqrt(2) sin(angle / 2).
        apart = np.linalg.norm(rotation(run.pose) - turned, axis=(-2, -1))
        angle = 2 * np.arcsin(np.minimum(apart / np.sqrt(8.0), 1.0))
        return cls(run.configuration[:, 6:9] - centre, angle, run.length - length)


@refuses_other_kinds
@dataclass(frozen=True)
class LoopSummary:
    """Figures of a run over a window of time. SI units, but errors in um and urad.

    Attributes
    ----------
    centre_rms, centre_max, centre_end
        Distance of the platform's centre from the target's, um.
    turn_rms, turn_max, turn_end
        Angle between platform and target, in `turn_unit`.
    length_rms, length_max
        Over all legs, um.
    force_peak, force_rms
        Of the actuators, largest of three, N.
    saturated
        Share of ticks at a force limit.
    minimum_type_ii
        Least `SingularityMeasures.type_ii`, 0 to 1.
    gap
        Largest gap of the plant's loops, m.
    ticks
        Number in the window.
    statuses
        Number of ticks with each status that occurred, by name, over the whole run.
    first
        Time of the first of these ticks, s.
    turn_unit
        ``"urad"`` or ``"deg"``.
    """

    centre_rms: float
    centre_max: float
    centre_end: float
    turn_rms: float
    turn_max: float
    turn_end: float
    length_rms: float
    length_max: float
    force_peak: float
    force_rms: float
    saturated: float
    minimum_type_ii: float
    gap: float
    ticks: int
    statuses: dict[str, int]
    first: dict[str, float]
    turn_unit: str = "urad"

    @classmethod
    def of(cls, run: LoopRun, *, begin: float = 0.0, end: float = np.inf) -> LoopSummary:
        """Return the figures of the ticks from `begin` to `end`, s, that not included.

        Raises
        ------
        InputError
            If no tick is in the window.
        """
        here = _window(run, begin, end)
        errors = TrackingErrors.of(run)
        centre = 1e6 * np.linalg.norm(errors.centre[here], axis=1)
        turn, length = 1e6 * errors.turn[here], 1e6 * np.abs(errors.length[here])
        return cls(
            centre_rms=_rms(centre),
            centre_max=float(centre.max()),
            centre_end=float(centre[-1]),
            turn_rms=_rms(turn),
            turn_max=float(turn.max()),
            turn_end=float(turn[-1]),
            length_rms=_rms(length),
            length_max=float(length.max()),
            **_common(run, here),
        )

    def in_degrees(self) -> Self:
        """Return it with angles in degrees."""
        if self.turn_unit == "deg":
            return self
        rms, most, end = (
            math.degrees(1e-6 * one) for one in (self.turn_rms, self.turn_max, self.turn_end)
        )
        return replace(self, turn_rms=rms, turn_max=most, turn_end=end, turn_unit="deg")

    @property
    def nearest_singular(self) -> float:
        """Deprecated name of `minimum_type_ii`."""
        return self.minimum_type_ii

    def as_dict(self) -> dict[str, Any]:
        """Return the figures as plain data."""
        return asdict(self)

    def rows(self) -> list[list[str]]:
        """Return name, RMS, largest, last and unit of the errors and forces."""
        turns = self.turn_rms, self.turn_max, self.turn_end
        rows = (
            ("error of the centre", (self.centre_rms, self.centre_max, self.centre_end), "um"),
            ("error of the orientation", turns, self.turn_unit),
            ("error of the leg lengths", (self.length_rms, self.length_max, None), "um"),
            ("force of an actuator", (self.force_rms, self.force_peak, None), "N"),
        )
        return [
            [name, *("" if figure is None else f"{figure:.4g}" for figure in figures), unit]
            for name, figures, unit in rows
        ]

    def table(self) -> Table:
        """Return the figures for a terminal."""
        return _table(self, "smallest distance to type II")


@refuses_other_kinds
@dataclass(frozen=True)
class TaskSummary:
    """Figures of a run of a task over a window of time, SI units.

    Attributes
    ----------
    names, units
        Of the task's coordinates: ``"m"``, ``"rad"`` or ``"deg"``.
    rms, largest, at_end
        Of the errors of these, actual less target, in these units.
    force_peak, force_rms
        Of the actuators, largest of all, in `force_unit`.
    saturated, minimum_type_ii, gap, ticks, statuses, first
        As of `LoopSummary`; `minimum_type_ii` is the least `SingularityMeasures.distance`.
    force_unit
        ``"N"``, ``"N m"``, or ``"N or N m"`` where some actuators slide and some turn.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    rms: tuple[float, ...]
    largest: tuple[float, ...]
    at_end: tuple[float, ...]
    force_peak: float
    force_rms: float
    saturated: float
    minimum_type_ii: float
    gap: float
    ticks: int
    statuses: dict[str, int]
    first: dict[str, float]
    force_unit: str = "N or N m"

    @classmethod
    def of(cls, run: LoopRun, *, begin: float = 0.0, end: float = np.inf) -> TaskSummary:
        """Return the figures of the ticks from `begin` to `end`, s, that not included.

        Raises
        ------
        InputError
            If no tick is in the window.
        """
        here = _window(run, begin, end)
        errors = (run.pose - run.target)[here]
        return cls(
            names=tuple(name for name, _ in run.of_pose),
            units=tuple(unit for _, unit in run.of_pose),
            rms=tuple(np.sqrt((errors**2).mean(axis=0)).tolist()),
            largest=tuple(np.abs(errors).max(axis=0).tolist()),
            at_end=tuple(np.abs(errors[-1]).tolist()),
            **_common(run, here),
            force_unit=" or ".join(sorted({unit for *_, unit in run.of_actuators})),
        )

    def in_degrees(self) -> Self:
        """Return it with angles in degrees."""
        factors = [math.degrees(1.0) if unit == "rad" else 1.0 for unit in self.units]

        def turned(values: tuple[float, ...]) -> tuple[float, ...]:
            return tuple(f * value for f, value in zip(factors, values, strict=True))

        return replace(
            self,
            units=tuple(unit.replace("rad", "deg") for unit in self.units),
            rms=turned(self.rms),
            largest=turned(self.largest),
            at_end=turned(self.at_end),
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the figures as plain data."""
        return asdict(self)

    def rows(self) -> list[list[str]]:
        """Return name, RMS, largest, last and unit of the errors and forces."""
        small = {"m": (1e6, "um"), "rad": (1e6, "urad"), "deg": (1.0, "deg")}
        errors = zip(self.names, self.units, self.rms, self.largest, self.at_end, strict=True)
        rows = [
            [
                f"error of {name}",
                *(f"{small[unit][0] * value:.4g}" for value in values),
                small[unit][1],
            ]
            for name, unit, *values in errors
        ]
        force = f"{self.force_rms:.4g}", f"{self.force_peak:.4g}"
        return [*rows, ["force of an actuator", *force, "", self.force_unit]]

    def table(self) -> Table:
        """Return the figures for a terminal."""
        return _table(self, "smallest distance to a singularity")


def summary_of(
    run: LoopRun, *, begin: float = 0.0, end: float = np.inf
) -> LoopSummary | TaskSummary:
    """Return the summary of a run: of a 3-RPS, or of a task."""
    kind = LoopSummary if run.task is None else TaskSummary
    return kind.of(run, begin=begin, end=end)


def _window(run: LoopRun, begin: float, end: float) -> Bools:
    here = (run.time >= begin - _ROUNDING) & (run.time < end - _ROUNDING)
    if not here.any():
        raise InputError(f"no tick between {begin} and {end} s; the run has {run.time.size}")
    return np.asarray(here)


def _common(run: LoopRun, here: Bools) -> dict[str, Any]:
    """Return the figures that runs of all robots have."""
    force = run.applied[here]
    flags = {flag: (run.status & int(flag)) != 0 for flag in Status if flag}
    occurred = {_name(flag): on for flag, on in flags.items() if on.any()}
    return {
        "force_peak": float(np.abs(force).max()),
        "force_rms": float(np.sqrt((force**2).mean(axis=0)).max()),
        "saturated": float(flags[Status.SATURATED][here].mean()),
        "minimum_type_ii": float(run.type_ii[here].min()),
        "gap": float(run.gap[here].max()),
        "ticks": int(here.sum()),
        "statuses": {name: int(on.sum()) for name, on in occurred.items()},
        "first": {name: float(run.time[on.argmax()]) for name, on in occurred.items()},
    }


def _table(summary: LoopSummary | TaskSummary, distance: str) -> Table:
    figures = (Column(name, justify="right") for name in ("RMS", "largest", "at the end"))
    table = Table("", *figures, "unit")
    for row in summary.rows():
        table.add_row(*row)
    table.add_section()
    table.add_row("ticks at a force limit", f"{summary.saturated:.2%}")
    table.add_row(distance, f"{summary.minimum_type_ii:.4g}")
    for name, count in summary.statuses.items():
        table.add_row(name, f"{count} ticks", f"first at {summary.first[name]:.6g} s")
    return table


def status_name(number: int) -> str:
    """Return the names of a status's flags, or ``"ok"``."""
    status = STATUSES[number]
    return ", ".join(_name(flag) for flag in Status if flag and flag in status) or "ok"


def _name(flag: Status) -> str:
    return str(flag.name).lower().replace("_", " ")


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
