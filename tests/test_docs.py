"""The documentation's Python runs and prints what is shown, its links are valid, and every public
name is in it."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parent.parent
PUBLIC = (
    "closed_loop",
    "codegen",
    "control",
    "errors",
    "panel",
    "paper",
    "plots",
    "rps",
    "rps.workspace",
    "task",
    "trajectories",
    "viewer",
)
NUMBER = re.compile(r"[-+]?\d+(?:\.(\d*))?(?:e([-+]?\d+))?")


def from_docs(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"docs_{name}", ROOT / "docs" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


pages = from_docs("pages")
PAGES = pages.pages()
TEXTS = {page: page.read_text("utf-8") for page in PAGES}
API = "".join(page.read_text("utf-8") for page in (ROOT / "docs" / "api").rglob("*.md"))


def name(page: Path) -> str:
    return page.relative_to(ROOT / "docs").with_suffix("").as_posix()


#: Pages with code; that of the gallery runs in tests/plots/test_gallery.py.
WITH_CODE = [p for p, text in TEXTS.items() if "```python" in text and name(p) != "gallery"]


@pytest.mark.parametrize("page", WITH_CODE, ids=name)
def test_the_python_blocks_run_in_order_and_print_what_is_shown(page: Path, tmp_path: Path) -> None:
    for block in pages.run(TEXTS[page], tmp_path):
        if block.shown is not None:
            assert_same_print(block.printed, block.shown)


def assert_same_print(printed: str, shown: str) -> None:
    """Numbers may differ by one in the last place shown, and rounding errors by any factor."""
    assert without_numbers(printed) == without_numbers(shown)
    for one, other in zip(NUMBER.finditer(printed), NUMBER.finditer(shown), strict=True):
        place = 10.0 ** (int(other[2] or 0) - len(other[1] or ""))
        a, b = float(one[0]), float(other[0])
        rounding = max(abs(a), abs(b)) < 1e-9
        assert rounding or abs(a - b) <= 1.01 * place, f"{one[0]} is printed, {other[0]} shown"


def without_numbers(text: str) -> str:
    return "".join(NUMBER.sub("#", text).split())


sys.path.append(str(ROOT / "docs"))  # they import each other
first_hour = from_docs("first_hour")


def test_the_first_hour_goes_as_the_page_says() -> None:
    page = TEXTS[ROOT / "docs" / "first_hour.md"]
    for part, lines in first_hour.session().items():
        shown = page.partition(f"<!-- made by docs/first_hour.py: {part} -->")[2]
        assert_same_print("\n".join(lines), shown.partition("<!--")[0])


def test_different_output_is_found() -> None:
    assert_same_print("x = [1.25 -0.  ] m, 4.9e-18", "x = [1.24\n-0.] m, 2.1e-17")
    for wrong in ("x = [1.22 -0.] m, 0", "y = [1.24 -0.] m, 0", "x = [1.24 -0.] m, 0 1"):
        with pytest.raises(AssertionError):
            assert_same_print(wrong, "x = [1.24 -0.] m, 0")


def test_links_lead_to_files() -> None:
    missing = [
        f"{name(page)}: {target}"
        for page, text in TEXTS.items()
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text)
        if not (page.parent / target).exists()
    ]
    assert not missing


def test_tables_name_the_scripts_that_write_them() -> None:
    found = {one for text in TEXTS.values() for one in re.findall(r"made by (docs/\w+\.py)", text)}
    assert len(found) > 5
    assert all((ROOT / script).is_file() for script in found)


def test_named_modules_and_functions_exist() -> None:
    missing = []
    for page, text in TEXTS.items():
        names = re.findall(r"{py:\w+}`~?([\w.]+)`", text)
        names += re.findall(r":: (rps_pin[\w.]*)", text)
        for module, members in re.findall(r"automodule:: ([\w.]+)\n   :members: (.*)", text):
            names += [f"{module}.{member}" for member in re.split(r",\s*", members)]
        missing += [f"{name(page)}: {dotted}" for dotted in names if not exists(dotted)]
    assert not missing


def exists(dotted: str) -> bool:
    """Whether a dotted name is a module, something in one, or an attribute of a class in one."""
    parts = dotted.split(".")
    for cut in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:cut]))
        except ModuleNotFoundError:
            continue
        for part in parts[cut:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


def test_missing_names_are_found() -> None:
    assert exists("rps_pin.rps.kinematics.legs.tips") and exists("rps_pin.rps.RPSRobot.state")
    assert not exists("rps_pin.rps.kinematics.legs.toes") and not exists("rps_pin.rps.limbs")


def documented() -> set[str]:
    """Return the names that have a page of their own in the API."""
    names = set()
    for module, body in re.findall(r"currentmodule:: ([\w.]+)\n(.*?)```", API, re.DOTALL):
        names |= {f"{module}.{name}" for name in re.findall(r"^   ([\w.]+)$", body, re.MULTILINE)}
    return names


def test_every_public_name_is_in_the_api() -> None:
    names = documented()
    assert len(names) > 200 and all(map(exists, names))
    same = {id(found(name)) for name in names}  # some have two names
    missing = []
    for package in PUBLIC:
        module = importlib.import_module(f"rps_pin.{package}")
        classes = [key for key, value in vars(module).items() if inspect.isclass(value)]
        for public in getattr(module, "__all__", classes):
            one = getattr(module, public)
            data = f"py:data:: {public}\n" in API
            ours = getattr(one, "__module__", "rps_pin").startswith("rps_pin")
            if ours and not data and not inspect.ismodule(one) and id(one) not in same:
                missing.append(f"rps_pin.{package}.{public}")
    assert not missing


def found(dotted: str) -> Any:
    """Return what a name of the API stands for."""
    module, _, name = dotted.rpartition(".")
    return getattr(importlib.import_module(module), name)


def test_every_name_of_the_package_itself_lives_where_the_api_has_it() -> None:
    package, names = importlib.import_module("rps_pin"), documented()
    for public in set(package.__all__) - {"__version__", "reproduction"}:
        if not inspect.ismodule(getattr(package, public)):
            assert any(name.endswith(f".{public}") for name in names), public


def test_scenes_of_the_pages_are_those_that_the_build_writes() -> None:
    named = {
        one for text in TEXTS.values() for one in re.findall(r"^```{scene} (\w+)$", text, re.M)
    }
    assert named == set(from_docs("scenes").SCENES)
