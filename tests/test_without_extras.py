"""What needs no extra works without any: modules import, and the first commands run."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from rps_pin.cli.doctor import PARTS

ROOT = Path(__file__).parents[1]

#: Modules of the extras are hidden; packages that generate code are what needs them.
HIDDEN = """
import importlib, pkgutil, sys
for name in {names}:
    sys.modules[name] = None
import rps_pin
failed = []
for module in pkgutil.walk_packages(rps_pin.__path__, "rps_pin."):
    if module.name.startswith({lazy}):
        continue
    try:
        importlib.import_module(module.name)
    except ImportError as error:
        failed.append(f"{{module.name}}: {{error}}")
print(*failed, sep="\\n")
"""
RUN = """
import sys
for name in {names}:
    sys.modules[name] = None
from rps_pin.cli import main
sys.argv = ["rps-pin", *{words}]
main()
"""
#: Those that are imported by functions that generate code.
LAZY = ("rps_pin.codegen", "rps_pin.rps.generated", "rps_pin.control.any_task.tick_text")


def hidden() -> list[str]:
    """Modules of the extras that nothing else brings."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    needed = {Requirement(one).name for one in project["dependencies"]}
    names = [part.module for part in PARTS if part.extra and part.name not in needed]
    assert {"casadi", "platformdirs", "pymoo", "viser"} <= set(names)
    return [name for name in names if name not in ("PIL", "jupyterlab", "ipykernel")]


def python(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )


def test_modules_import(tmp_path: Path) -> None:
    ended = python(HIDDEN.format(names=hidden(), lazy=LAZY), tmp_path)
    assert (ended.returncode, ended.stdout.strip()) == (0, ""), ended.stderr


@pytest.mark.parametrize(
    "words",
    [
        ["helix", "-o", "helix"],
        ["workspace", "-m", "five_bar", "--over", "x=0.1:0.3:3", "--over", "z=0.4:0.6:3"],
    ],
)
def test_commands_run(words: list[str], tmp_path: Path) -> None:
    ended = python(RUN.format(names=hidden(), words=words), tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert list(tmp_path.rglob("*.png"))


def test_a_design_says_what_it_needs(tmp_path: Path) -> None:
    words = ["design", str(ROOT / "examples" / "design" / "micro_motion.yaml")]
    ended = python(RUN.format(names=hidden(), words=words), tmp_path)
    assert ended.returncode == 1
    assert ended.stderr.startswith("error: a design needs pymoo: pip install rps-pin[design]")
