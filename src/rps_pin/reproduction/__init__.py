"""The old name of `rps_pin.paper`: it keeps working, and says where it went."""

import sys
import warnings

import rps_pin.paper

warnings.warn("rps_pin.reproduction has moved to rps_pin.paper", DeprecationWarning, stacklevel=2)
sys.modules[__name__] = rps_pin.paper
