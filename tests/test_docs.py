"""The documentation's Python runs and prints what is shown, its links lead somewhere, and every
public name is in it."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent
PUBLIC = ("closed_loop", "rps", "trajectories", "control", "viewer", "errors")
NUMBER = re.compile(r"[-+]?\d+(?:\.(\d*))?(?:e([-+]?\d+))?")


def from_docs(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"docs_{name}", ROOT / "docs" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


pages = from_docs("pages")
PAGES = pages.pages()
API = "".join(page.read_text("utf-8") for page in (ROOT / "docs" / "api").rglob("*.md"))


def name(page: Path) -> str:
    return page.relative_to(ROOT / "docs").with_suffix("").as_posix()


@pytest.mark.parametrize(
    "page", [page for page in PAGES if "```python" in page.read_text("utf-8")], ids=name
)
def test_the_python_blocks_run_in_order_and_print_what_is_shown(page: Path, tmp_path: Path) -> None:
    for block in pages.run(page.read_text("utf-8"), tmp_path):
        if block.shown is not None:
            assert_same_print(block.printed, block.shown)


def assert_same_print(printed: str, shown: str) -> None:
    """Numbers may differ by one in the last place shown; and rounding errors by all they are."""
    assert without_numbers(printed) == without_numbers(shown)
    for one, other in zip(NUMBER.finditer(printed), NUMBER.finditer(shown), strict=True):
        place = 10.0 ** (int(other[2] or 0) - len(other[1] or ""))
        a, b = float(one[0]), float(other[0])
        rounding = max(abs(a), abs(b)) < 1e-9
        assert rounding or abs(a - b) <= 1.01 * place, f"{one[0]} is printed, {other[0]} shown"


def without_numbers(text: str) -> str:
    return "".join(NUMBER.sub("#", text).split())


first_hour = from_docs("first_hour")


@pytest.mark.parametrize("part", first_hour.PARTS)
def test_the_mistakes_of_the_first_hour_are_answered_as_shown(part: str) -> None:
    text = (ROOT / "docs" / "first_hour.md").read_text("utf-8")
    shown = text.partition(f"<!-- made by docs/first_hour.py: {part} -->")[2]
    assert first_hour.told(first_hour.PARTS[part]).split() == shown.partition("<!--")[0].split()


def test_prints_are_told_apart() -> None:
    assert_same_print("x = [1.25 -0.  ] m, 4.9e-18", "x = [1.24\n-0.] m, 2.1e-17")
    for wrong in ("x = [1.22 -0.] m, 0", "y = [1.24 -0.] m, 0", "x = [1.24 -0.] m, 0 1"):
        with pytest.raises(AssertionError):
            assert_same_print(wrong, "x = [1.24 -0.] m, 0")


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_to_files(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text("utf-8")):
        assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_tables_say_what_wrote_them(page: Path) -> None:
    for script in re.findall(r"made by (docs/\w+\.py)", page.read_text("utf-8")):
        assert (ROOT / script).is_file()


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_named_modules_and_functions_exist(page: Path) -> None:
    text = page.read_text("utf-8")
    for dotted in re.findall(r"{py:\w+}`~?([\w.]+)`", text):
        assert exists(dotted), dotted
    for module, members in re.findall(r"automodule:: ([\w.]+)\n(?:   :members: (.*))?", text):
        for member in filter(None, re.split(r",\s*", members)):
            assert exists(f"{module}.{member}"), f"{module}.{member}"


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


def test_what_does_not_exist_is_found_out() -> None:
    assert exists("rps_pin.rps.kinematics.legs.tips") and exists("rps_pin.rps.RPSRobot.state")
    assert not exists("rps_pin.rps.kinematics.legs.toes") and not exists("rps_pin.rps.limbs")


@pytest.mark.parametrize("package", PUBLIC)
def test_every_public_name_is_in_the_api(package: str) -> None:
    if f":: rps_pin.{package}\n   :imported-members:\n" in API:
        return  # all of them, whatever they are
    module = importlib.import_module(f"rps_pin.{package}")
    own = [key for key, value in vars(module).items() if inspect.isclass(value)]
    for public in getattr(module, "__all__", own):
        if getattr(getattr(module, public), "__module__", "rps_pin").startswith("rps_pin"):
            assert re.search(rf":: rps_pin\.{package}\.{public}\n", API), f"docs/api: {public}"


def test_every_name_of_the_package_itself_lives_where_the_api_has_it() -> None:
    package = importlib.import_module("rps_pin")
    for public in set(package.__all__) - {"__version__"}:
        if inspect.ismodule(getattr(package, public)):
            continue
        assert re.search(rf":: rps_pin\.\w+\.{public}\n", API), public
