"""Status of a call in a control loop, returned instead of an exception."""

from __future__ import annotations

from enum import IntFlag


class Status(IntFlag):
    """Flags, which can be combined; `OK` is zero.

    With `BAD_INPUT`, `JUMP` or `NOT_CONVERGED` there is no new result: the last good one is kept
    (see `kept`). With the others the result is new and valid. The last three are set by controllers
    only.
    """

    OK = 0
    #: An argument is not three numbers, not finite, or out of range.
    BAD_INPUT = 1
    #: A leg length differs from its prediction by more than `largest_jump`.
    JUMP = 2
    #: The lengths cannot be followed, or the forces are not determined.
    NOT_CONVERGED = 4
    #: `SingularityMeasures.type_ii`, of the result in use, is below `near_singular`.
    NEAR_SINGULAR = 8
    #: A leg's length, angle, ball joint, speed or force is beyond the robot's limits.
    BEYOND_LIMIT = 16
    #: The law's forces are beyond a limit and were replaced by the nearest in effect.
    SATURATED = 32
    #: The target was refused (not finite, beyond the robot's limits, or too near a singularity), or
    #: it is valid again and the robot is returning to it.
    TARGET_HELD = 64
    #: The controller has stopped; it holds a pose, or the weight, until it is reset.
    STOPPED = 128

    @property
    def kept(self) -> bool:
        """Whether the result is the last good one and not that of this call."""
        return bool(self & KEPT)


#: The flags of calls without a new result.
KEPT = Status.BAD_INPUT | Status.JUMP | Status.NOT_CONVERGED

#: The flags as integers: operations on enumerations take microseconds.
BAD_INPUT, JUMP, NOT_CONVERGED, NEAR_SINGULAR, BEYOND_LIMIT, SATURATED, TARGET_HELD, STOPPED = (
    int(flag) for flag in Status if flag
)

#: All combinations, by number: creating one takes microseconds.
STATUSES = tuple(Status(number) for number in range(256))
