"""Programs that tests start: compilers and emulators, which `tools/missing-compilers` knows."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest


def program(name: str) -> str:
    """Return a program's path; skip the test without it, or fail where it should have been."""
    path = shutil.which(name)
    if path is not None:
        return path
    if os.environ.get("CI") and not os.environ.get("NO_APT"):
        pytest.fail(f"no {name}: tools/check installs it in CI")
    pytest.skip(f"no {name}: sh tools/missing-compilers tells what to install")


def output_of(*command: str | Path, folder: Path | None = None, **environment: str) -> str:
    """Run a program that must succeed; return what it printed, errors too."""
    run = subprocess.run(
        command,
        cwd=folder,
        env=os.environ | environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
        timeout=300,
    )
    assert run.returncode == 0, f"{command}: {run.returncode}\n{run.stdout[-4000:]}"
    return run.stdout
