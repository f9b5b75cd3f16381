"""What a call in a control loop says of its answer, instead of raising."""

from __future__ import annotations

from enum import IntFlag


class Status(IntFlag):
    """Reasons, which can come together; `OK` (zero) if there is none.

    With `BAD_INPUT`, `JUMP` or `NOT_CONVERGED` there is no new answer: the last good one is kept
    (see `kept`). With the others the answer is new and right, and asks for attention. The last
    three are a controller's own.
    """

    OK = 0
    #: An argument is not three numbers, not finite, or beyond all sense.
    BAD_INPUT = 1
    #: A leg's reading is further than `largest_jump` from where the last good one was going.
    JUMP = 2
    #: No answer was found: the lengths cannot be followed, or the forces are not determined.
    NOT_CONVERGED = 4
    #: The distance to a singularity is below `near_singular`; of a kept answer, that answer's.
    NEAR_SINGULAR = 8
    #: A leg's length, angle, ball joint, speed or force is beyond the robot's limits.
    BEYOND_LIMIT = 16
    #: The law's forces are beyond a limit: those nearest in effect are sent.
    SATURATED = 32
    #: The target was refused: not finite, beyond the robot's limits, or too near a singularity; or
    #: it is good again, and the robot on its way back to it.
    TARGET_HELD = 64
    #: The controller has given up: it holds a pose, or else the weight, until it is reset.
    STOPPED = 128

    @property
    def kept(self) -> bool:
        """Whether the answer is the last good one, kept, and not that of this call."""
        return bool(self & KEPT)


#: The reasons for which there is no new answer.
KEPT = Status.BAD_INPUT | Status.JUMP | Status.NOT_CONVERGED

#: Every combination, by its number: making one anew takes microseconds.
STATUSES = tuple(Status(number) for number in range(256))
