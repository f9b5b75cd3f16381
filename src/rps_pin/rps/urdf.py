"""The URDF of a 3-RPS, generated from its parameters."""

from __future__ import annotations

from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.rps.parameters import RPSParameters


@refuses_other_kinds
def build_urdf(parameters: RPSParameters) -> str:
    """Return the URDF of the robot as XML text.

    Numbers are written with all their digits, so that what is read back is what was meant. A joint
    without a limit gets a stand-in, since URDF has no infinity: `URDF_UNLIMITED` for efforts and
    speeds, ten times the sum of the radii for lengths. Gravity is no part of a URDF.

    Parameters
    ----------
    parameters
        The robot.

    Returns
    -------
    str
        The URDF, SI units.
    """
    from rps_pin.rps.urdf_links import robot_text  # noqa: PLC0415 (yourdfpy takes long to load)

    return robot_text(parameters)
