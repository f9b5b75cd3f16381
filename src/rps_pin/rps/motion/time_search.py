"""The iteration, under the name it had; see `rps_pin.task.motion.time_search`."""

from rps_pin.task.motion.time_search import KEPT, MOST_ROUNDS, TimeSearch

__all__ = ["KEPT", "MOST_ROUNDS", "TimeSearch"]
