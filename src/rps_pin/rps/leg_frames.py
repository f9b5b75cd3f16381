"""Names and directions of the legs of a 3-RPS in its URDF."""

from __future__ import annotations

import math

LEGS = (1, 2, 3)
#: Direction of each leg in the base plane, and of its spherical joint in the platform, rad.
LEG_DIRECTIONS = (0.0, 2 * math.pi / 3, -2 * math.pi / 3)

#: URDF knows no infinite limit: what it says for an effort (N) or a speed (m/s, rad/s) without one.
URDF_UNLIMITED = 1e6


def ball_frames(leg: int) -> tuple[str, str]:
    """Return the names of the two frames that the spherical joint of a leg (1 to 3) holds together.

    The first is on the platform, the second at the rod's tip.
    """
    return f"platform_ball_{leg}", f"leg_{leg}_ball"
