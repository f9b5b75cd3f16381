"""`make look` walks what README and help name, and tells what fails."""

from __future__ import annotations

import runpy
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from tests.cli.commands import rps_pin
from tests.cli.typed import all_commands, commands_of_new

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def look() -> dict[str, Any]:
    """What the script defines."""
    path = list(sys.path)
    names = runpy.run_path(str(ROOT / "tools" / "look.py"))
    sys.path[:] = path
    return names


def test_it_walks_all_commands_of_readme_and_help(look: dict[str, Any]) -> None:
    lines = look["all_commands"]()
    assert lines == all_commands()
    assert len(lines) == len(set(lines)) > 40
    assert {line.split()[1] for line in lines} > {"helix", "view", "dynamics", "control", "new"}
    served = {line for line in lines if look["SERVES"].match(line)}
    assert "rps-pin view" in served
    assert "rps-pin view --interactive" in served
    assert not any("--png" in line or " view" not in line for line in served)


@pytest.mark.parametrize("kind", ["3rps", "stewart"])
def test_a_robot_with_other_dimensions_works(
    look: dict[str, Any], kind: str, tmp_path: Path
) -> None:
    begun = rps_pin("new", kind, "--output", "mine", folder=tmp_path)
    tries = commands_of_new(begun.stdout)
    assert len(look["pictures_of"](tries)) == 2
    look["with_other_dimensions"](kind, tmp_path / "mine")
    for line in tries:
        words = line.split()[1:]
        if words[0] in ("describe", "ik", "fk"):
            ended = rps_pin(*words, folder=tmp_path)
            assert ended.returncode == 0, ended.stderr


def test_a_command_that_fails_is_told_and_what_it_leaves_is_on_the_page(
    look: dict[str, Any], tmp_path: Path
) -> None:
    work = tmp_path / "work"
    work.mkdir()
    walk = look["Walk"](Path(sys.executable).with_name("rps-pin"), tmp_path, None, "")
    good = walk.run("group <1>", "rps-pin --version", work)
    bad = walk.run("group <1>", "rps-pin hleix", work)
    Image.new("RGB", (4, 4)).save(tmp_path / "drawn.png")
    copies = f"{shutil.which('cp')} ../drawn.png one.png"
    drawn = walk.run("group 2", copies, work)
    assert not good.failed and not drawn.failed
    assert bad.failed and bad.status == 2
    assert [picture.name for picture in drawn.pictures] == ["one.png"]
    page = look["write_page"](tmp_path, walk.steps, [], []).read_text()
    assert page.count("<section>") == 3
    assert page.count("class='failed'") == 1
    assert page.count("<h2>group &lt;1&gt;</h2>") == 1
    assert "Did you mean" in page
    assert page.count("one.png") >= 2  # in the size of print, and in full
