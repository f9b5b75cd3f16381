"""What state estimates share: the last good result stays until there is a new one."""

from __future__ import annotations

from rps_pin.control.generated.code import GeneratedTick
from rps_pin.control.loop import status as flags
from rps_pin.control.loop.status import STATUSES, Status
from rps_pin.copies import DeepCopied


class LastGood(DeepCopied):
    """A state estimate that keeps its last good result, computed here or in generated code.

    Attributes
    ----------
    age : int
        Ticks since the last good result.
    elapsed : float
        Time since then, s.
    status : Status
        Of the last estimate.
    """

    age: int
    elapsed: float
    status: Status
    generated: GeneratedTick | None
    _near: float

    @property
    def type_ii(self) -> float:
        """Distance of the estimated pose to a singularity."""
        raise NotImplementedError

    def _begin(self) -> None:
        """Take the memory of generated code, whose next tick starts from another."""
        if self.generated is not None:
            self.generated.pull()
            self.generated.ready = False

    def _renew(self, number: int) -> Status:
        """Note a new result, with its status."""
        self.age, self.elapsed = 0, 0.0
        self.status = status = STATUSES[number]
        return status

    def _keep(self, number: int) -> Status:
        """Keep the last good estimate, with a status."""
        self.age += 1
        if self.type_ii < self._near:
            number |= flags.NEAR_SINGULAR
        self.status = status = STATUSES[number]
        return status
