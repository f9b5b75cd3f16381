"""A stranger finds things where CONTRIBUTING.md says, and versions agree."""

from __future__ import annotations

import ast
import re
import runpy
import subprocess
import sys
import tomllib
from collections import Counter
from datetime import date
from functools import cache
from pathlib import Path

from packaging.version import Version
from ruamel.yaml import YAML

import rps_pin

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "src" / "rps_pin"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def folders_named(page: str) -> dict[str, set[str]]:
    """Return the folders of a page's tree: those at the top, and those of the package."""
    tree = (ROOT / page).read_text("utf-8").partition("## Repository layout")[2]
    top = set(re.findall(r"^    (\S+)/ ", tree, re.MULTILINE)) - {"src/rps_pin"}
    return {"top": top, "package": set(re.findall(r"^      (\w+)/ ", tree, re.MULTILINE))}


def test_the_tree_is_the_tree() -> None:
    named = folders_named("CONTRIBUTING.md")
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
        if path.parent.parent == PACKAGE and path.name == "__init__.py":
            assert len(words.splitlines()) > 2, f"{path}: and what does not"


def test_the_version_is_one() -> None:
    version = PROJECT["version"]
    citation = YAML(typ="safe").load(ROOT / "CITATION.cff")
    assert str(citation["version"]) == version
    assert citation["license"] == PROJECT["license"]
    for key in ("cff-version", "message", "title", "authors"):  # what the format demands
        assert citation[key]
    released = versions()
    assert released[0][0] == version
    assert str(citation["date-released"]) == released[0][1]


def versions() -> list[tuple[str, str]]:
    """Return the changelog's versions with their dates, newest first."""
    changes = (ROOT / "CHANGELOG.md").read_text("utf-8")
    headings = re.findall(r"^## (.*)$", changes, re.MULTILINE)
    assert headings[0] == "[Unreleased]"
    found = [re.fullmatch(r"\[(\d+\.\d+\.\d+)\] - (\d{4}-\d\d-\d\d)", one) for one in headings[1:]]
    assert all(found), headings
    return [(one[1], one[2]) for one in found if one]


def test_the_changelog_keeps_its_form() -> None:
    released = versions()
    assert released == sorted(released, key=lambda one: Version(one[0]), reverse=True)
    dates = [date.fromisoformat(one[1]) for one in released]
    assert dates == sorted(dates, reverse=True)
    kinds = re.findall(r"^### (.*)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    assert set(kinds) <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


#: A package may import those of its own layer and of those before it. `paper` only the command line
#: imports; `reproduction` is its old name.
LAYERS = [
    {
        "errors",
        "validation",
        "arrays",
        "bounds",
        "files",
        "interruption",
        "config",
        "moved",
        "plain_text",
        "one_thread",
        "copies",
        "other_kinds",
        "output_places",
    },
    {"numerics"},
    {"closed_loop"},
    {"codegen"},
    {"trajectories"},
    {"task"},
    {"rps"},
    {"control"},
    {"plots"},
    {"viewer"},
    {"panel"},
    {"paper"},
    {"cli", "reproduction"},
]
LAYER = {name: number for number, layer in enumerate(LAYERS) for name in layer}
COUNT = runpy.run_path(str(ROOT / "tools" / "count_code"))


@cache
def imports() -> dict[str, set[str]]:
    """Return the modules that each module imports, in functions and under TYPE_CHECKING too."""
    found: dict[str, set[str]] = COUNT["imports"](ROOT / "src")
    return found


def room(module: str) -> str:
    """Return the package of a module, or the module beside them; none for rps_pin itself."""
    return module.partition(".")[2].partition(".")[0]


def test_dependencies_point_one_way() -> None:
    """Every package, and every module beside them, has a layer."""
    assert {room(name) for name in imports()} == {*LAYER, ""}
    found = [
        f"{module} imports {other}"
        for module, used in imports().items()
        for other in used
        if room(module) and room(other) and LAYER[room(other)] > LAYER[room(module)]
    ]
    assert not found, "\n".join(found)


def test_no_imports_run_in_a_circle() -> None:
    assert COUNT["circles"](imports()) == []


def test_folders_are_small() -> None:
    """The commands, and the checks of the paper, are as many as there are."""
    counts = Counter(path.parent.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py"))
    large = {str(folder): count for folder, count in counts.items() if count > 14}
    assert set(large) <= {"cli", "paper"}, large


def test_every_package_is_reached_from_the_top() -> None:
    """Without an import of its own: ``rps_pin.control.Gains``. All public packages."""
    packages = {one.parent.name for one in PACKAGE.glob("*/__init__.py")} - {"cli", "numerics"}
    assert packages <= set(rps_pin.__all__)
    code = "import sys, rps_pin; print(sorted({'numpy', 'pinocchio'} & set(sys.modules)));"
    code += " ".join(f"rps_pin.{name};" for name in sorted(packages))
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout) == (0, "[]\n"), run.stderr
