"""Warnings for legal parameters that look like millimetres, grams or other units than SI."""

from __future__ import annotations

import math

import numpy as np

from rps_pin.rps.parameters import RPSParameters

#: No 3-RPS that was built is larger, m.
LARGEST = 10.0
#: A body's radius of gyration is less than this many times the size of what it belongs to (the
#: paper's platform has 4.4, whatever it is made of; millimetres make it 1000 times larger).
WIDEST = 10.0


def unit_doubts(parameters: RPSParameters) -> list[str]:
    """Return a sentence for each quantity that may have been given in another unit.

    Lengths beyond `LARGEST`; inertias whose radius of gyration is more than `WIDEST` times the
    platform's radius, for the platform, or the longest length of the robot, for legs and rods.
    """
    p = parameters
    lengths = {
        "base_radius": p.base_radius,
        "platform_radius": p.platform_radius,
        "leg_com": p.leg_com,
        "rod_com": p.rod_com,
        "leg_length_limits": p.leg_length_limits[1],
    }
    finite = {name: value for name, value in lengths.items() if math.isfinite(value)}
    doubts = [
        f"{name} = {value:g} m; {value:g} mm would be {1e-3 * value:g}"
        for name, value in finite.items()
        if abs(value) > LARGEST
    ]
    longest = max(finite.values())
    for name, inertia, mass, size in (
        (
            "platform_inertia",
            float(np.linalg.eigvalsh(p.platform_inertia).max()),
            p.platform_mass,
            p.platform_radius,
        ),
        ("leg_inertia", p.leg_inertia_about_com, p.leg_mass, longest),
        ("rod_inertia", p.rod_inertia, p.rod_mass, longest),
    ):
        if mass > 0 and (gyration := math.sqrt(inertia / mass)) > WIDEST * size:
            doubts.append(
                f"{name} = {inertia:g} kg m^2 on {mass:g} kg is a radius of gyration of "
                f"{gyration:.3g} m; {inertia:g} kg mm^2 would be {1e-6 * inertia:g}"
            )
    return doubts
