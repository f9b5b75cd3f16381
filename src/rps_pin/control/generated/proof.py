"""What is compared before generated ticks are used: two loops, of which one is interpreted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from rps_pin.arrays import Array
from rps_pin.errors import CompileError
from rps_pin.rps.dynamics.loads import Payload
from rps_pin.rps.robot import RPSRobot
from rps_pin.task import Task

if TYPE_CHECKING:
    from rps_pin.codegen.build import Library

#: Status, answers by name, and whether generated code computed them.
Ticked: TypeAlias = tuple[int, Mapping[str, Array], bool]
#: See `prove`.
MakeLoop: TypeAlias = Callable[..., Callable[..., Ticked]]
#: Largest difference relative to the size of what is compared.
TOLERANCE = 1e-10
_TICKS, _PERIOD = 300, 1e-3


class Case(NamedTuple):
    """Arguments of a loop's ticks."""

    robot: RPSRobot | Task
    start: Array
    settings: dict[str, Any]
    ticks: list[tuple[Any, Any, Any, float | None]]
    """Length, target, speed, dt."""
    weight: float
    """Borne by a leg, N: differences of forces are judged by it, those of others by 1e-3."""


def prove(
    name: str,
    library: Library,
    make: MakeLoop,
    motions: Iterable[Case] | None = None,
    tolerance: float = TOLERANCE,
) -> dict[str, Any]:
    """Compare a generated tick with the interpreted one over motions and faults.

    Parameters
    ----------
    name
        Of the tick.
    library
        Its machine code.
    make
        Makes a function of length, target, speed and dt that computes a tick, of a robot, a start,
        an engine (the library, or False) and settings of `Controller`. It returns the status, the
        answers by name, and whether generated code computed them.
    motions
        What is compared; left out, `cases` of the 3-RPS.
    tolerance
        Largest difference relative to the size of what is compared.

    Returns
    -------
    dict
        Ticks, how many of them were generated, and the largest relative difference.

    Raises
    ------
    CompileError
        If anything differs by more than the tolerance, or less than half of the ticks is generated.
    """
    worst, generated, ticks = 0.0, 0, 0
    for number, case in enumerate(cases() if motions is None else motions):
        ours, theirs = (
            make(case.robot, case.start, compiled, **case.settings) for compiled in (library, False)
        )
        for k, arguments in enumerate(case.ticks):
            status, answers, fast = ours(*arguments)
            status_wanted, wanted, _ = theirs(*arguments)
            where = f"proof of {name}, motion {number}, tick {k}"
            if status != status_wanted:
                raise CompileError(
                    f"{where}: the status is {status}; it must be {status_wanted}",
                    library.compiler,
                )
            generated += fast
            for what, expected in wanted.items():
                found, size = answers[what], 1e-3
                if what in ("forces", "reactions"):
                    size = case.weight
                difference = float(abs(found - expected).max() / max(size, abs(expected).max()))
                worst = max(worst, difference)
                if not difference <= tolerance:
                    raise CompileError(
                        f"{where}: {what} is {found.tolist()}; it must be {expected.tolist()}, to "
                        f"{tolerance} of its size",
                        library.compiler,
                    )
        ticks += len(case.ticks)
    if generated < ticks / 2:
        raise CompileError(
            f"proof of {name}: {generated} of {ticks} ticks are generated; at least half must be",
            library.compiler,
        )
    return {"ticks": ticks, "generated": generated, "worst": worst}


def cases() -> Iterator[Case]:
    """Yield motions of several robots, always the same: with friction, payload, faults, limits."""
    rng = np.random.default_rng(16)
    for preset in ("micro", "sokolov"):
        bare = RPSRobot.from_preset(preset)
        rough = bare.parameters.replace(
            prismatic_friction=0.5,
            prismatic_damping=5.0,
            revolute_friction=0.01,
            revolute_damping=0.01,
        )
        radius = bare.parameters.platform_radius
        payload = Payload(0.3, (0.1 * radius, 0.2 * radius, 0.1), 1e-3 * np.eye(3))
        for robot, weak in ((bare, False), (RPSRobot(rough, payload=payload), True)):
            yield _case(robot, weak, rng)


def _case(robot: RPSRobot, weak: bool, rng: np.random.Generator) -> Case:
    """Return a swing about the middle of the lengths, followed with noise, and with faults."""
    p = robot.parameters
    low, high = p.leg_length_limits
    middle = np.array([(low + high) / 2 if high < np.inf else p.base_radius, 0.0, 0.0])
    t = _PERIOD * np.arange(_TICKS)[:, None]
    w = 2 * np.pi * np.array([2.0, 3.0, 5.0])
    size = np.array([0.01 * middle[0], 0.05, 0.04])
    rows = [
        middle + size * np.sin(w * t),
        size * w * np.cos(w * t),
        -size * w**2 * np.sin(w * t),
    ]
    noise = 1e-7 * middle[0] * rng.normal(size=(_TICKS, 3))
    free = RPSRobot(p.without_limits())
    lengths = free.inverse_kinematics(rows[0]).length + noise
    ticks: list[tuple[Any, Any, Any, float | None]] = []
    for k in range(_TICKS):
        target: Any = tuple(row[k] for row in rows)
        length, speed, dt = lengths[k], None, None
        if k % 7 == 3:
            target = None
        if k % 11 == 5:
            length, target = length.tolist(), target and tuple(one.tolist() for one in target)
        if 100 <= k < 150:
            speed = (lengths[k] - lengths[k - 1]) / _PERIOD
        if k % 13 == 6:
            dt = _PERIOD * float(rng.uniform(0.9, 1.1))
        if k == 180:
            length = length * np.nan
        if k == 200:
            length = length * 1.5
        if k == 220:
            target = tuple(row[k] * np.nan for row in rows)
        ticks.append((length, target, speed, dt))
    weight = 9.81 * (p.platform_mass + 3 * (p.leg_mass + p.rod_mass)) / 3
    return Case(robot, rows[0][0], {"force_limit": 3 * weight} if weak else {}, ticks, weight)
