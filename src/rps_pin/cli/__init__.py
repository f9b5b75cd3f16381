"""The command line, ``rps-pin``."""

from rps_pin.cli.app import main

__all__ = ["main"]
