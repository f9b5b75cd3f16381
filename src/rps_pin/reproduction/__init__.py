"""The old name of `rps_pin.paper`, kept for programs that use it.

Importing it gives `rps_pin.paper` itself, with a `DeprecationWarning` that names it.
"""

import sys
import warnings

import rps_pin.paper

warnings.warn("rps_pin.reproduction has moved to rps_pin.paper", DeprecationWarning, stacklevel=2)
sys.modules[__name__] = rps_pin.paper
