"""Closed-loop robots on Pinocchio, in Python; the 3-RPS parallel robot first and completely.

The names to begin with are here (`__init__.pyi` lists them), and the packages with all the others:
`rps_pin.closed_loop` (any mechanism), `rps_pin.codegen` (a mechanism as code), `rps_pin.rps` (the
3-RPS), `rps_pin.task` (what a mechanism is for), `rps_pin.trajectories`, `rps_pin.control`,
`rps_pin.plots`, `rps_pin.viewer`, `rps_pin.panel`, `rps_pin.paper` (the paper) and
`rps_pin.errors`. Each is imported when it is asked for, so that ``import rps_pin`` costs next to
nothing.
"""

from importlib.metadata import version

import lazy_loader

__getattr__, __dir__, _names = lazy_loader.attach_stub(__name__, __file__)
__version__ = version("rps-pin")
__all__ = ["__version__", *_names]  # noqa: PLE0604
