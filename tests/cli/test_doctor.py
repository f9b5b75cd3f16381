"""``rps-pin doctor``: right where all is well, and where something is missing."""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from rps_pin.cli import doctor as module
from rps_pin.cli.doctor import _BROWSERS, PARTS, _browser, _cache, _compilers, _unmet
from rps_pin.viewer.files.browser import BROWSERS
from tests import processes
from tests.cli.commands import rps_pin

ROOT = Path(__file__).resolve().parents[2]
#: A stranger's Python in which a package cannot be imported.
BROKEN = """
import sys
class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == {name!r}:
            raise ImportError({reason!r})
sys.meta_path.insert(0, Hidden())
sys.argv = ["rps-pin", *{arguments!r}]
from rps_pin.cli import main
main()
"""


def doctor(*arguments: str, hidden: str = "nothing", reason: str = "it is not there"):
    code = BROKEN.format(name=hidden, reason=reason, arguments=list(arguments))
    return processes.run([sys.executable, "-c", code])


def test_all_is_well_here() -> None:
    run = rps_pin("doctor", "--json")
    assert run.returncode == 0
    answer = json.loads(run.stdout)
    assert answer["ok"]
    found = {one["name"]: one for one in answer["found"]}
    assert found["Python"]["found"] == sys.version.split()[0]
    assert found["a calculation"]["trouble"] == ""
    assert float(found["a calculation"]["found"].split()[0]) < 1e-12
    assert not [one for one in answer["found"] if one["needed"] and one["trouble"]]


def test_without_pinocchio_every_command_says_what_is_missing() -> None:
    reason = "libgomp.so.1: cannot open shared object file"
    for arguments in (("doctor",), ("helix",)):
        run = doctor(*arguments, hidden="pinocchio", reason=reason)
        assert run.returncode == 1
        assert "Traceback" not in run.stdout + run.stderr
        lines = run.stdout.splitlines()
        row = next(i for i, line in enumerate(lines) if line.startswith("MISSING pin "))
        assert "apt-get install libgomp1" in lines[row + 1]
        assert lines[-1].startswith("something is missing")


def test_without_pinocchio_there_is_help_all_the_same() -> None:
    run = doctor("--help", hidden="pinocchio")
    assert run.returncode == 0
    assert "helix" in run.stdout


@pytest.mark.parametrize("module", ["typer", "numpy"])
def test_it_speaks_without_others_too(module: str) -> None:
    run = doctor("doctor", hidden=module)
    assert run.returncode == 1
    assert f"MISSING {module} " in run.stdout
    assert f"pip install {module}" in run.stdout


def test_versions_that_pyproject_excludes_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = ["h5py>=3.11", "pin<5,>=4.1", 'casadi>=3.6.5; extra == "compile"', "lazy-loader"]
    asked += ["cupy-cuda12x[ctk]>=14; extra == 'cuda'"]
    monkeypatch.setattr("importlib.metadata.requires", lambda name: asked)
    wrong = {
        "h5py": (["3.10.0", "3.9", "2.99"], ">=3.11"),
        "pin": (["4.0.9", "5.0", "5", "12.1"], ">=4.1,<5"),
        "casadi": (["3.6.4", "3.6"], ">=3.6.5"),
        "cupy-cuda12x": (["13.6.0"], ">=14"),
    }
    for name, (versions, wanted) in wrong.items():
        assert [_unmet(name, version) for version in versions] == [wanted] * len(versions)
    right = {"h5py": ["3.11", "3.11.0", "3.110", "4.0"], "pin": ["4.1", "4.1.0", "4.99.1"]}
    right |= {"casadi": ["3.6.5", "3.7.0rc1"], "lazy-loader": ["0.1"], "numpy": ["1.0"]}
    for name, versions in right.items():
        assert [_unmet(name, version) for version in versions] == [""] * len(versions), name


def test_an_old_package_is_an_error_of_the_installation() -> None:
    code = """
import importlib.metadata, sys
from rps_pin.cli.doctor import doctor

version = importlib.metadata.version
importlib.metadata.version = lambda name: "1.0" if name == "h5py" else version(name)
sys.exit(doctor())
"""
    run = processes.run([sys.executable, "-c", code])
    assert run.returncode == 1
    assert "1.0 does not do: pip install 'h5py>=3.1" in run.stdout


def test_a_browser_that_is_a_stub_is_no_browser(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stub = tmp_path / "chromium"
    stub.write_text("#!/bin/sh\nexit 1\n")
    stub.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("PLAYWRIGHT_BROWSERS_PATH", str(tmp_path / "none"))
    monkeypatch.delenv("RPS_PIN_CHROMIUM", raising=False)
    assert "apt-get install chromium" in _browser().trouble
    stub.write_text("#!/bin/sh\nexit 0\n")
    assert _browser().found == str(stub)


def test_compilers_and_what_they_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    for name in ("CC", "RPS_PIN_CC"):
        monkeypatch.delenv(name, raising=False)
    assert _compilers().trouble == "none found: apt-get install gcc"
    for name, says in (("gcc", "gcc version 9.1 (Debian)"), ("clang", "Debian clang version 8.2")):
        (tmp_path / name).write_text(f"#!/bin/sh\necho '{says}'\n")
        (tmp_path / name).chmod(0o755)
    found = _compilers()
    assert found == ("C compiler", "gcc 9.1", "fast code (also clang 8.2)", False, "")
    monkeypatch.setenv("RPS_PIN_CACHE", str(tmp_path / "new" / "cache"))
    assert _cache() == ("compiled code", "0 kept, 0 MB", str(tmp_path / "new/cache"), False, "")
    monkeypatch.setenv("RPS_PIN_CACHE", str(tmp_path / "gcc" / "cache"))
    assert _cache().trouble.endswith("gcc/cache cannot be written to: set RPS_PIN_CACHE")
    monkeypatch.setitem(sys.modules, "filelock", None)
    for part in ("cache", "compilers"):
        monkeypatch.delitem(sys.modules, f"rps_pin.codegen.build.{part}", raising=False)
    monkeypatch.delitem(sys.modules, "rps_pin.codegen.build", raising=False)
    for finding in (_compilers(), _cache()):
        assert finding.trouble == "not looked for: pip install 'rps-pin[compile]'"


def test_it_looks_for_the_browsers_that_are_used() -> None:
    assert tuple(_BROWSERS) == BROWSERS


def test_what_is_optional_is_no_trouble() -> None:
    run = doctor("doctor", hidden="casadi")
    assert run.returncode == 0, run.stdout
    lines = run.stdout.splitlines()
    row = next(line for line in lines if " casadi " in line)
    assert row.startswith("-")
    assert "pip install 'rps-pin[compile]'" in run.stdout
    # It fits a screen; paths may be long.
    assert all(len(line) <= 80 for line in lines if "/" not in line), lines
    names = {line[8:25].strip() for line in lines if line[:8].strip()}
    assert {"rps-pin", "Chromium", "ffmpeg", "mujoco", "backend", "pin's options"} <= names


def test_it_says_why_a_control_loop_is_interpreted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RPS_PIN_COMPILE", "0")
    run = doctor("doctor")
    assert run.returncode == 0, run.stdout
    lines = run.stdout.splitlines()
    row = next(i for i, line in enumerate(lines) if " control loop " in f" {line[8:]}")
    assert lines[row].startswith("-")
    assert "interpreted" in lines[row]
    assert "switched off by RPS_PIN_COMPILE=0" in lines[row + 1]


def test_it_asks_for_what_the_package_needs() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    needed = {Requirement(one).name for one in project["dependencies"]}
    assert {part.name for part in PARTS if part.extra is None} == needed
    for extra, ones in project["optional-dependencies"].items():
        listed = {part.name for part in PARTS if part.extra == extra}
        assert listed == {Requirement(one).name for one in ones} - {"rps-pin"}, extra


def test_paths_steer_no_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("RPS_PIN_CACHE", str(tmp_path / "\x1b]0;title\x07red\u202egpj"))
    monkeypatch.setattr(module, "diagnose", lambda: [_cache(), _cache()._replace(trouble="\x1b")])
    assert module.doctor() == 0
    said = capsys.readouterr().out
    assert r"\x1b]0;title\x07red\u202egpj" in said
    assert said.isascii()
    assert said.replace("\n", "").isprintable()
    assert module.doctor(as_json=True) == 0
    assert json.loads(capsys.readouterr().out)["found"][0]["purpose"].endswith("gpj")
