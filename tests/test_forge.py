"""Files for the services that host the project: each names commands and groups that there are."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).parents[1]
FILES = sorted((ROOT / ".github").rglob("*.yml"))


def read(path: Path) -> Any:
    return YAML(typ="safe", pure=True).load(path)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_yaml_is_as_the_service_reads_it(path: Path) -> None:
    found = read(path)
    if path.parent.name == "workflows":
        assert {"name", "on", "permissions", "jobs"} == set(found)
    elif path.name != "config.yml":
        assert {"name", "description", "body"} < set(found)
        ids = [part["id"] for part in found["body"]]
        assert len(set(ids)) == len(ids)


def test_workflows_call_what_there_is() -> None:
    commands = [
        step["run"]
        for path in FILES
        if path.parent.name == "workflows"
        for job in read(path)["jobs"].values()
        for step in job["steps"]
        if "run" in step
    ]
    assert sorted(commands) == [".ci/run", "make wheel"]
    assert (ROOT / ".ci" / "run").stat().st_mode & 0o111
    assert "\nwheel: " in (ROOT / "Makefile").read_text("utf-8")


def test_the_site_is_built_of_what_there_is() -> None:
    found = read(ROOT / ".readthedocs.yaml")
    assert (ROOT / found["sphinx"]["configuration"]).is_file()
    assert found["sphinx"]["fail_on_warning"] is True
    install = found["build"]["jobs"]["install"][-1].split()
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["dependency-groups"]
    assert install[install.index("--group") + 1] in groups
