"""Choose the dimensions of a robot: what may vary, what must hold, what is to be best.

`design` measures candidates of a `DesignSpace` (a mechanism with a task, and `Dimension` s that
vary) in generated code whose parameters the dimensions are, and returns the front of those that
meet `Requirements` and are best in one to three `Objective` s.
"""

from rps_pin.task.design.compute import design
from rps_pin.task.design.file import DescribedDesign, load_design
from rps_pin.task.design.geometry.dimensions import Dimension
from rps_pin.task.design.geometry.rods import Rod
from rps_pin.task.design.measures import Measures
from rps_pin.task.design.region import Region, RoundPart
from rps_pin.task.design.requirements import Objective, Requirements
from rps_pin.task.design.result import Binding, Chosen, DesignResult
from rps_pin.task.design.space import Candidates, DesignSpace, Space

__all__ = [
    "Binding",
    "Candidates",
    "Chosen",
    "DescribedDesign",
    "DesignResult",
    "DesignSpace",
    "Dimension",
    "Measures",
    "Objective",
    "Region",
    "Requirements",
    "Rod",
    "RoundPart",
    "Space",
    "design",
    "load_design",
]
