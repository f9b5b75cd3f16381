"""The command line, run in this process: its entry point, standard streams and exit status."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import threading
from pathlib import Path
from subprocess import CompletedProcess
from unittest import mock

from rps_pin.cli import main


def rps_pin(
    *arguments: str, folder: Path | None = None, **environment: str
) -> CompletedProcess[str]:
    """Run ``rps-pin`` with arguments, in a folder, as its entry point does; return what it said."""
    output, errors = io.StringIO(), io.StringIO()
    status: int | str | None = 0
    with contextlib.ExitStack() as stack:
        stack.enter_context(mock.patch.object(sys, "argv", ["rps-pin", *arguments]))
        stack.enter_context(mock.patch.object(threading, "excepthook", threading.excepthook))
        stack.enter_context(mock.patch.dict(os.environ, environment))
        stack.enter_context(contextlib.chdir(folder or Path.cwd()))
        stack.enter_context(contextlib.redirect_stdout(output))
        stack.enter_context(contextlib.redirect_stderr(errors))
        try:
            main()
        except SystemExit as ended:
            status = ended.code
    assert isinstance(status, int) or status is None
    return CompletedProcess(list(arguments), status or 0, output.getvalue(), errors.getvalue())
