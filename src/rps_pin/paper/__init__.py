"""The paper: its Lagrange equations, virtual work, and its figures and tables compared with ours.

`lagrange_forces` and `virtual_work_forces` are inverse dynamics by independent derivations; the
other modules reproduce the paper as one page (``rps-pin reproduce``). Nothing else of the package
depends on this room, the command line aside.
"""

from rps_pin.paper.lagrange import LagrangeDynamics, lagrange_forces
from rps_pin.paper.virtual_work import virtual_work_forces
from rps_pin.paper.workspace_comparison import PaperComparison, paper_comparison

__all__ = [
    "LagrangeDynamics",
    "PaperComparison",
    "lagrange_forces",
    "paper_comparison",
    "virtual_work_forces",
]
