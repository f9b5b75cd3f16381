"""A stranger finds things where CONTRIBUTING.md says, and versions agree."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from ruamel.yaml import YAML

import rps_pin

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "src" / "rps_pin"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def folders_named(page: str) -> dict[str, set[str]]:
    """Return the folders of a page's tree: those at the top, and those of the package."""
    tree = (ROOT / page).read_text("utf-8").partition("Where things are")[2]
    top = set(re.findall(r"^    (\S+)/ ", tree, re.MULTILINE)) - {"src/rps_pin"}
    return {"top": top, "package": set(re.findall(r"^      (\w+)/ ", tree, re.MULTILINE))}


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "README.md"])
def test_the_tree_is_the_tree(page: str) -> None:
    named = folders_named(page)
    assert named["top"]
    for name in named["top"]:
        assert (ROOT / name).is_dir(), name
    there = {one.name for one in PACKAGE.iterdir() if one.is_dir() and one.name != "__pycache__"}
    assert named["package"] - {"urdf"} == there - {"urdf"}


def test_every_module_says_what_lives_there() -> None:
    for path in PACKAGE.rglob("*.py"):
        words = ast.get_docstring(ast.parse(path.read_text("utf-8")))
        assert words, path
        assert len(words.splitlines()[0]) > 15, path


def test_the_version_is_one() -> None:
    version = PROJECT["version"]
    citation = YAML(typ="safe").load(ROOT / "CITATION.cff")
    assert str(citation["version"]) == version
    assert citation["license"] == PROJECT["license"]
    for key in ("cff-version", "message", "title", "authors"):  # what the format demands
        assert citation[key]
    changes = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert re.search(rf"^## \[(Unreleased|{re.escape(version)})\]", changes, re.MULTILINE)


def test_dependencies_point_one_way() -> None:
    """Of `rps_pin.closed_loop` and `rps_pin.rps` on what is built on them."""
    below = {
        "closed_loop": ("errors", "files", "yaml_files", "closed_loop"),
        "trajectories": ("errors", "files", "yaml_files", "trajectories", "rps"),
        "rps": ("errors", "files", "yaml_files", "closed_loop", "trajectories", "rps"),
        "control": (
            "errors",
            "files",
            "yaml_files",
            "closed_loop",
            "trajectories",
            "rps",
            "control",
        ),
    }
    for name, allowed in below.items():
        for path in (PACKAGE / name).rglob("*.py"):
            for used in re.findall(r"^\s*from rps_pin\.(\w+)", path.read_text("utf-8"), re.M):
                assert used in allowed, f"{path.relative_to(PACKAGE)} uses {used}"


def test_every_package_is_reached_from_the_top() -> None:
    """Without an import of its own: ``rps_pin.control.Gains``. All but the command line."""
    packages = {one.parent.name for one in PACKAGE.glob("*/__init__.py")} - {"cli"}
    assert packages <= set(rps_pin.__all__)
    code = "import sys, rps_pin; print(sorted({'numpy', 'pinocchio'} & set(sys.modules)));"
    code += " ".join(f"rps_pin.{name};" for name in sorted(packages))
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout) == (0, "[]\n"), run.stderr
