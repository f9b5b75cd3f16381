"""The command line, ``rps-pin``."""

import sys


def main() -> None:
    """Run the command line; where it cannot be imported, say what is missing."""
    try:
        from rps_pin.cli.app import run
    except ImportError:
        from rps_pin.cli.doctor import doctor

        sys.exit(doctor() or 1)
    run()


__all__ = ["main"]
