"""The command line, ``rps-pin``: one module a command, ``NAME.py`` with its ``NAME_command``.

`rps_pin.cli.app` lists them. They read options and files, call the library, and print; nothing is
computed here.
"""


def main() -> None:
    """Run the command line; where a package cannot be imported, say what is missing."""
    from rps_pin.interruption import signals_as_ctrl_c

    try:
        with signals_as_ctrl_c():
            from rps_pin.cli.app import run

            run()
    except KeyboardInterrupt:  # while it is imported
        raise SystemExit(130) from None
    except ImportError as error:
        from rps_pin.cli.doctor import doctor

        if doctor() == 0:  # a mistake of ours, not of the installation
            from rps_pin.cli.printing import tell_fault

            raise SystemExit(tell_fault(error)) from None
        raise SystemExit(1) from None


__all__ = ["main"]
