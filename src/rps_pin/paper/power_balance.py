"""Power of the constraint models' forces compared with the energies of Eq. 13 to 21."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.paper.lagrange_terms import energies
from rps_pin.rps.parameters import RPSParameters
from rps_pin.rps.robot import RPSRobot
from rps_pin.trajectories.path import PathSample


def power_balances(samples: int = 200) -> dict[str, float]:
    """Return the largest difference of power and energy rate over the largest power.

    By variant of the energies; along a fast motion (`_SwingingMotion`), with the forces of the
    constraint models, and the energies' rates by central differences in time.
    """
    robot = RPSRobot.from_preset("sokolov")
    given, path = robot.parameters, _SwingingMotion()
    times = np.linspace(0.1, path.duration - 0.1, samples)
    q, v, a = robot.state(*path.sample(times))
    force = np.array([robot.inverse_dynamics(*state).tau for state in zip(q, v, a, strict=True)])
    power = (force * robot.motion(*path.sample(times))[1].speed).sum(axis=-1)
    variants: list[tuple[str, RPSParameters, tuple[str, ...]]] = [
        ("Eq. 13 to 21 corrected", given, ()),
        ("Eq. 14 as printed", given, ("eq_14",)),
        ("Eq. 16 as printed", given.replace(leg_inertia_about="com"), ()),
        ("Eq. 19 as printed", given, ("eq_19",)),
    ]
    step = 1e-5
    after, before = (robot.motion(*path.sample(times + s))[1] for s in (step, -step))
    found = {}
    for name, parameters, printed in variants:
        end, start = (
            np.sum(energies(parameters, *legs[:4], as_printed=printed), axis=0)
            for legs in (after, before)
        )
        change = (end - start) / (2 * step)
        found[name] = float(np.abs(change - power).max() / np.abs(power).max())
    return found


class _SwingingMotion:
    """Heave and tilts that swing at 3, 6 and 9 rad/s."""

    duration = 3.0

    def sample(self, t: ArrayLike) -> PathSample:
        """Return pose, rate and acceleration at times t, s."""
        times = np.asarray(t, dtype=np.float64)[..., None]
        size, middle = np.array([0.05, 0.3, 0.2]), np.array([0.5, 0.0, 0.1])
        pace = np.array([3.0, 6.0, 9.0])
        sine, cosine = np.sin(pace * times), np.cos(pace * times)
        return PathSample(middle + size * sine, size * pace * cosine, -size * pace**2 * sine)
