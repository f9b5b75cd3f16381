"""The command line, ``rps-pin``: one module a command, ``NAME.py`` with its ``NAME_command``.

`rps_pin.cli.app` lists them. They read options and files, call the library, and print; nothing is
computed here.
"""


def main() -> None:
    """Run the command line; where a package cannot be imported, say what is missing."""
    try:
        from rps_pin.cli.app import run

        run()
    except ImportError:
        from rps_pin.cli.doctor import doctor

        if doctor() == 0:
            raise  # a mistake of ours, not of the installation
        raise SystemExit(1) from None


__all__ = ["main"]
