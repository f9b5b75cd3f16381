"""A mechanism as code: the second engine, generated from the mechanism's description.

A mechanism becomes CasADi expressions, these become C99, and the C becomes loaded functions, proven
against the Pinocchio engine of `rps_pin.closed_loop`. Not here: that engine, and robots of a kind.
Needs ``pip install rps-pin[compile]``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
