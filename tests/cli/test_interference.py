"""``rps-pin check`` of mechanisms with collision shapes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.commands import rps_pin
from tests.closed_loop.interference.shaped import joint, link, robot, shape

BALL = shape('<sphere radius="0.05"/>')
DESCRIPTION = "urdf: slides.urdf\nactuated: [xa, xb]\ntask: {joints: [xa, xb]}\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Balls on two slides that lie 0.06 m beside each other, and a path past each other."""
    slides = (
        joint("xa", "root", "a", "prismatic", axis="1 0 0"),
        joint("xb", "root", "b", "prismatic", "0 0.06 0", "1 0 0"),
    )
    text = robot(link("root"), link("a", BALL), link("b", BALL), *slides)
    (tmp_path / "slides.urdf").write_text(text)
    (tmp_path / "slides.yaml").write_text(DESCRIPTION)
    (tmp_path / "path.csv").write_text(
        "time_s,xa_m,xb_m\n" + "".join(f"{t / 10},{t / 50 - 0.2},0\n" for t in range(21))
    )
    return tmp_path


def check(folder: Path, *options: str, mechanism: str = "slides.yaml") -> tuple[int, str, str]:
    done = rps_pin("check", "path.csv", "-m", mechanism, *options, folder=folder)
    assert "Traceback" not in done.stderr
    return done.returncode, done.stdout, " ".join(done.stderr.replace("│", " ").split())


def test_links_that_touch_are_shown(folder: Path) -> None:
    status, text, _ = check(folder)
    assert status == 1
    # They touch where x^2 + 0.06^2 = 0.1^2, at x = -0.08 m and 0.08 m.
    assert "1 pair of links interferes" in text
    assert "interference: 1 pair of links, least distance -0.04 m (a and b) at t = 1" in text
    assert "0.600000000 s: a and b begin to interfere" in text
    assert "1.400000000 s: a and b come apart" in text
    status, text, _ = check(folder, "--json")
    found = json.loads(text)
    assert (status, found["ok"]) == (1, False)
    assert [one["kind"] for one in found["interference"]["events"]] == ["begins", "ends"]
    assert found["interference"]["events"][0]["time"] == pytest.approx(0.6, abs=1e-8)
    assert found["interference"]["minimum_links"] == ["a", "b"]


def test_a_clearance_and_pairs_that_may_overlap(folder: Path) -> None:
    # x^2 + 0.06^2 = (0.1 + 0.01708...)^2 at x = 0.1 m
    status, text, _ = check(folder, "--clearance", "0.016619037896906")
    assert status == 1
    assert "0.500000000 s: a and b come nearer than 0.016619 m" in text
    status, text, _ = check(folder, "--ignore", "b,a")
    assert (status, "interference: no pair of links to check" in text) == (0, True)
    (folder / "slides.yaml").write_text(DESCRIPTION + "interference: {ignore: [[a, b]]}\n")
    assert check(folder)[0] == 0


def test_without_shapes_or_without_being_asked(folder: Path) -> None:
    status, text, _ = check(folder, "--interference", "no")
    assert (status, "interference" in text) == (0, False)
    (folder / "slides.urdf").write_text((folder / "slides.urdf").read_text().replace(BALL, ""))
    status, text, _ = check(folder)
    assert status == 0
    assert text.splitlines()[-1] == "interference: no collision shapes"
    found = json.loads(check(folder, "--json")[1])
    assert found["interference"]["minimum_distance"] is None
    status, _, told = check(folder, "--interference", "yes")
    assert (status, "has no collision shapes" in told) == (1, True)


def test_meshes_are_found_in_packages(folder: Path) -> None:
    """A tetrahedron of a package that is elsewhere."""
    package = folder / "ws" / "parts"
    package.mkdir(parents=True)
    (package / "part.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    mesh = '<mesh filename="package://parts/part.obj" scale="0.05 0.05 0.05"/>'
    text = (folder / "slides.urdf").read_text()
    (folder / "slides.urdf").write_text(text.replace('<sphere radius="0.05"/>', mesh))
    status, text, told = check(folder, "--interference", "yes")
    assert status == 1
    assert "slides.urdf, line 1: link 'a': 'package://parts/part.obj': no package" in told
    status, text, _ = check(folder)
    assert status == 0
    assert "interference: collision shapes that cannot be used" in text
    status, text, _ = check(folder, "--interference", "yes", "--package-path", "ws")
    assert (status, "interference: 1 pair of links, least distance 0.01 m" in text) == (0, True)


@pytest.mark.parametrize(
    ("options", "status", "message"),
    [
        (("--clearance", "-1"), 2, "--clearance"),
        (("--clearance", "nan"), 2, "--clearance"),
        (("--ignore", "a"), 1, "--ignore 'a': it must be LINK,LINK"),
        (("--ignore", "a,b,c"), 1, "it must be LINK,LINK"),
        (("--ignore", "a,c"), 1, "ignore: no link 'c'; there are: root, a, b"),
        (("--ignore", "a,a"), 1, "'a' is paired with itself"),
    ],
)
def test_what_does_not_fit_is_refused(
    folder: Path, options: tuple[str, ...], status: int, message: str
) -> None:
    found, _, told = check(folder, *options)
    assert (found, message in told) == (status, True), told


@pytest.mark.parametrize(
    "option", ["--clearance=0.1", "--ignore=a,b", "--interference=yes", "--interference=no"]
)
def test_a_helix_has_no_links(option: str) -> None:
    done = rps_pin("check", option)
    assert done.returncode == 2
    assert "interference is checked of a mechanism" in " ".join(
        done.stderr.replace("│", " ").split()
    )
