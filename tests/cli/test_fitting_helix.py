"""The helix fits the robot where its radius is not given; the largest that fits is named."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from rps_pin import RPSParameters, RPSRobot, helix
from rps_pin.cli.helix_options import Branch, chosen_helix, middle_height
from tests.cli.commands import rps_pin

MICRO = RPSParameters.from_preset("micro")


def scaled(factor: float) -> RPSParameters:
    """Return the micro robot in another size."""
    lengths = ("base_radius", "platform_radius", "leg_com", "rod_com")
    inertias = ("platform_inertia", "leg_inertia", "rod_inertia")
    return MICRO.replace(
        **{name: factor * getattr(MICRO, name) for name in lengths},
        **{name: factor**2 * getattr(MICRO, name) for name in inertias},
        leg_length_limits=tuple(factor * end for end in MICRO.leg_length_limits),
    )


@pytest.mark.parametrize("preset", ["sokolov", "micro"])
def test_the_presets_keep_the_paper_s(preset: str) -> None:
    path = chosen_helix(RPSRobot.from_preset(preset), None, None, None, Branch.PLUS, 5.0)
    assert (path.radius, path.pitch) == (0.75e-3, 0.5e-3)


@pytest.mark.parametrize("factor", [0.01, 0.1, 0.7, 10.0])
def test_other_sizes_have_it_in_proportion(factor: float) -> None:
    robot = RPSRobot(scaled(factor))
    path = chosen_helix(robot, None, None, None, Branch.PLUS, 5.0)
    assert path.radius / robot.parameters.platform_radius == pytest.approx(0.75e-3 / 0.23, rel=0.01)
    assert path.pitch / path.radius == pytest.approx(2 / 3)


def test_what_is_given_stays() -> None:
    robot = RPSRobot(scaled(0.1))
    path = chosen_helix(robot, 0.2e-3, None, 0.022, Branch.MINUS, 5.0)
    assert (path.radius, path.pitch, path.height, path.branch) == (0.2e-3, 0.5e-3, 0.022, "-")


def test_a_short_stroke_has_the_largest_that_fits(tmp_path: Path) -> None:
    short = MICRO.replace(leg_length_limits=(0.222, 0.228))
    short.to_yaml(tmp_path / "short.yaml")
    ended = rps_pin("helix", "-r", "short.yaml", "--rate", "20", "--json", folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    radius = json.loads(ended.stdout)["helix"]["radius"]
    assert f"note: a helix of radius {1e3 * radius:g} mm, which this robot's limits allow" in (
        ended.stderr
    )
    assert reaches(short, radius, 2 / 3 * radius) and not reaches(
        short, 1.02 * radius, 1.02 * 2 / 3 * radius
    )


def reaches(parameters: RPSParameters, radius: float, pitch: float) -> bool:
    """Return whether legs have the lengths of a helix, by their own formula of the tilt."""
    robot, height = RPSRobot(parameters), middle_height(parameters, pitch)
    path = helix(robot, radius=radius, pitch=pitch, height=height)
    times = [path.duration * k / 2000 for k in range(2001)]
    pose = path.sample(times).pose
    return bool(robot.inverse_kinematics(pose, errors="mask").reachable.all())


@pytest.mark.parametrize("command", ["helix", "view"])
def test_the_largest_radius_that_fits_is_named(command: str, tmp_path: Path) -> None:
    more = ("--rate", "50") if command == "helix" else ("--html", "a.html")
    words = (command, "-r", "micro", "--radius")
    ended = rps_pin(*words, "0.02", *more, folder=tmp_path)
    assert ended.returncode == 1
    named = re.search(r"; the largest radius that fits is ([\d.e-]+) m$", ended.stderr.strip())
    assert named, ended.stderr
    assert rps_pin(*words, named[1], *more, folder=tmp_path).returncode == 0
    beyond = str(1.02 * float(named[1]))
    assert rps_pin(*words, beyond, *more, "--overwrite", folder=tmp_path).returncode == 1
