"""The wheel has all that the package needs: it runs the main job away from the checkout.

Here with this Python and its packages. `tools/check-wheel`, which CI calls, builds the wheel from
the sdist and installs it into environments of its own, on every Python found.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from hatchling.builders.sdist import SdistBuilder
from hatchling.builders.wheel import WheelBuilder

import rps_pin

ROOT = Path(__file__).resolve().parent.parent
#: The package's files, as named in it; its folder urdf is a link to the one at the top.
PACKAGE = {
    (into / path.relative_to(folder)).as_posix()
    for folder, into in ((ROOT / "src", Path()), (ROOT / "urdf", Path("rps_pin/urdf")))
    for path in folder.rglob("*")
    if path.is_file() and "__pycache__" not in path.parts
}
JOB = """
import sys
sys.path.insert(0, {site!r})
import rps_pin
assert rps_pin.__file__.startswith({site!r}), rps_pin.__file__
from rps_pin.cli import main
sys.argv = ["rps-pin", *{arguments!r}]
main()
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the wheel unpacked, as an installer does it."""
    folder = tmp_path_factory.mktemp("wheel")
    (wheel,) = WheelBuilder(str(ROOT)).build(directory=str(folder), versions=["standard"])
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def run(site: Path, folder: Path, *arguments: str) -> str:
    code = JOB.format(site=str(site), arguments=arguments)
    command = [sys.executable, "-I", "-c", code]
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_main_job_runs_from_the_wheel(site: Path, tmp_path: Path) -> None:
    summary = json.loads(run(site, tmp_path, "helix", "--rate", "50", "--json"))
    assert [round(one["force_max"], 2) for one in summary["actuators"]] == [0.93, 0.93, 0.93]
    assert summary["loop_gap_max"] < 1e-14
    assert all((tmp_path / file).stat().st_size for file in summary["files"])


def test_its_mechanisms_come_with_it(site: Path, tmp_path: Path) -> None:
    assert "mobility 3" in run(site, tmp_path, "describe", "delta")


def test_every_file_of_the_package_is_in_it_and_no_other(site: Path) -> None:
    (wheel,) = site.parent.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert {name for name in names if name.startswith("rps_pin/")} == PACKAGE
    assert {name.split("/")[0] for name in names} == {
        "rps_pin",
        f"rps_pin-{rps_pin.__version__}.dist-info",
    }
    assert any(name.endswith("licenses/LICENSE") for name in names)


def test_a_wheel_can_be_made_of_the_sdist(tmp_path: Path) -> None:
    """It holds the sources, the folder that a link in them names, and no junk."""
    (sdist,) = SdistBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {f"src/{name}" for name in PACKAGE} <= names
    assert {"LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff", "pyproject.toml"} <= names
    assert not [name for name in names if "__pycache__" in name or "/." in name]
