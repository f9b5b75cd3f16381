"""Tolerances: errors of the pose from those of lengths, axes and encoders, of any mechanism.

`tolerance` gives them to first order, with the share that each tolerance has; `monte_carlo`
exactly, of machines at random whose loops are closed; `sobol` the shares where first order is not
enough.
`table_text` and `write_table` are for a workshop.
"""

from rps_pin.task.tolerances.analysis import Part, ToleranceAnalysis
from rps_pin.task.tolerances.compute import names, tolerance
from rps_pin.task.tolerances.monte_carlo import MonteCarlo, monte_carlo
from rps_pin.task.tolerances.sobol import SobolIndices, sobol
from rps_pin.task.tolerances.specification import Tolerance, load_tolerances, tolerances
from rps_pin.task.tolerances.table import table_text, write_indices, write_poses, write_table

__all__ = [
    "MonteCarlo",
    "Part",
    "SobolIndices",
    "Tolerance",
    "ToleranceAnalysis",
    "load_tolerances",
    "monte_carlo",
    "names",
    "sobol",
    "table_text",
    "tolerance",
    "tolerances",
    "write_indices",
    "write_poses",
    "write_table",
]
