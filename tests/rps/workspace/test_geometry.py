"""Volumes, boundaries and inscribed sets, each against another way to the same number."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh

from rps_pin import RPSParameters, RPSRobot
from rps_pin.errors import InputError, UnreachableError
from rps_pin.paper import paper_comparison
from rps_pin.rps.workspace import (
    Workspace,
    boundary,
    free_tilt,
    largest_tilt_range,
    leg_grid,
    pose_grid,
    save_mesh,
    theoretical_cylinder,
    volume,
    workspace,
)


@pytest.fixture(scope="module")
def micro() -> RPSParameters:
    return RPSParameters.from_preset("micro")


@pytest.fixture(scope="module")
def by_lengths(micro: RPSParameters) -> Workspace:
    return workspace(micro, leg_grid(micro, 31))


@pytest.fixture(scope="module")
def by_poses(micro: RPSParameters) -> Workspace:
    return workspace(micro, pose_grid(np.linspace(0.199, 0.251, 53), np.linspace(-0.29, 0.29, 59)))


def test_the_two_ways_give_the_same_volumes(by_lengths: Workspace, by_poses: Workspace) -> None:
    lengths, poses = volume(by_lengths), volume(by_poses)
    assert math.isclose(lengths.pose, poses.pose, rel_tol=6e-3)
    assert math.isclose(lengths.position, poses.position, rel_tol=1e-2)
    assert math.isclose(lengths.position_twice, poses.position_twice, rel_tol=1e-2)


def test_volumes_converge_with_the_square_of_the_step(micro: RPSParameters) -> None:
    pose = [volume(workspace(micro, leg_grid(micro, n))).pose for n in (7, 13, 25)]
    assert math.isclose((pose[0] - pose[1]) / (pose[1] - pose[2]), 4.0, rel_tol=0.05)


def test_each_position_is_counted_once(by_lengths: Workspace) -> None:
    """Throw positions into the workspace's box; inside is where either of their tilts is."""
    p = by_lengths.parameters
    rng = np.random.default_rng(5)
    low = by_lengths.position.min(axis=(0, 1, 2))
    high = by_lengths.position.max(axis=(0, 1, 2))
    x, y, z = rng.uniform(low, high, size=(200_000, 3)).T
    # r = h/2 (1 - cos beta); w = beta (cos a, sin a) with (x, y) = r (cos 2a, -sin 2a).
    beta = np.arccos(1 - 2 * np.hypot(x, y) / p.platform_radius)
    way = np.arctan2(-y, x) / 2
    pose = np.stack([z, beta * np.cos(way), beta * np.sin(way)], axis=-1)
    robot = RPSRobot(p)
    assert np.allclose(robot.platform_placement(pose)[0][:, 0], x, rtol=0, atol=1e-12)
    assert np.allclose(robot.platform_placement(pose)[0][:, 1], y, rtol=0, atol=1e-12)
    one = robot.inverse_kinematics(pose, errors="mask").reachable
    other = robot.inverse_kinematics(pose * [1, -1, -1], errors="mask").reachable
    box = float(np.prod(high - low))
    found = volume(by_lengths)
    assert math.isclose(found.position, box * (one | other).mean(), rel_tol=0.015)
    twice = box * (one.mean() + other.mean())
    assert math.isclose(found.position_twice, twice, rel_tol=0.015)


@pytest.mark.parametrize("space", ["pose", "position"])
def test_a_boundary_is_closed_and_encloses_the_sum_of_the_cells(
    by_lengths: Workspace, space: str
) -> None:
    mesh = boundary(by_lengths, space)  # type: ignore[arg-type]
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    expected = volume(by_lengths)
    cells = expected.pose if space == "pose" else expected.position_twice
    assert math.isclose(mesh.volume, cells, rel_tol=5e-3)


def test_a_boundary_on_poses_has_the_volume_of_its_cells_exactly(by_poses: Workspace) -> None:
    inside = by_poses.inside
    cells = np.ones(tuple(n - 1 for n in inside.shape), dtype=bool)
    for i, j, k in np.ndindex(2, 2, 2):
        cells &= inside[i : i + cells.shape[0], j : j + cells.shape[1], k : k + cells.shape[2]]
    cell = math.prod(float(axis[1] - axis[0]) for axis in by_poses.grid.axes)
    mesh = boundary(by_poses, "pose")
    assert math.isclose(mesh.volume, cells.sum() * cell, rel_tol=1e-9)
    assert mesh.volume < volume(by_poses).pose


def test_the_boundarys_vertices_have_a_leg_at_its_limit(by_lengths: Workspace) -> None:
    mesh = boundary(by_lengths, "pose")
    legs = RPSRobot(by_lengths.parameters).inverse_kinematics(mesh.vertices, errors="mask")
    at_limit = np.minimum(np.abs(legs.length - 0.2), np.abs(legs.length - 0.25)).min(axis=-1)
    assert at_limit.max() < 1e-12


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj"])
def test_a_mesh_is_written_and_read_back(
    by_lengths: Workspace, tmp_path: Path, suffix: str
) -> None:
    mesh = boundary(by_lengths)
    path = tmp_path / f"boundary{suffix}"
    save_mesh(mesh, path)
    back = trimesh.load_mesh(path)
    assert len(back.faces) == len(mesh.faces)
    assert np.allclose(back.bounds, mesh.bounds, rtol=0, atol=1e-7)
    assert math.isclose(back.volume, mesh.volume, rel_tol=1e-3)
    with pytest.raises(InputError, match="overwrite"):
        save_mesh(mesh, path)
    save_mesh(mesh, path, overwrite=True)
    with pytest.raises(InputError, match=r"\.stl"):
        save_mesh(mesh, tmp_path / "boundary.txt")
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_nothing_inside_and_slices_have_no_boundary(micro: RPSParameters) -> None:
    far = workspace(micro, pose_grid([1.0, 1.1], [0.0, 0.1]))
    assert volume(far) == (0.0, 0.0, 0.0)
    with pytest.raises(InputError, match="no cell"):
        boundary(far)
    flat = workspace(micro, pose_grid([0.22], [0.0, 0.1]))
    for function in (volume, boundary):
        with pytest.raises(InputError, match="2 points"):
            function(flat)
    with pytest.raises(InputError, match="space"):
        boundary(far, "joint")  # type: ignore[arg-type]


def test_the_theoretical_cylinder_holds_every_position(micro: RPSParameters) -> None:
    cylinder = theoretical_cylinder(micro, 0.1, 0.3, sections=720)
    assert cylinder.is_watertight
    assert math.isclose(cylinder.volume, math.pi * 0.12**2 * 0.2, rel_tol=1e-4)
    assert np.allclose(cylinder.bounds[:, 2], [0.1, 0.3])
    tilt = np.linspace(-math.pi, math.pi, 41)
    pose = np.stack(np.meshgrid([0.2], tilt, tilt), axis=-1).reshape(-1, 3)
    position, _ = RPSRobot(micro).platform_placement(pose)
    radius = np.hypot(position[:, 0], position[:, 1])
    assert radius.max() <= 0.12 + 1e-12
    assert math.isclose(radius.max(), 0.12, rel_tol=0.01)
    for heights in [(0.3, 0.1), (0.0, math.inf)]:
        with pytest.raises(InputError):
            theoretical_cylinder(micro, *heights)


# The largest set of full tilt ---------------------------------------------------------------------


@pytest.mark.parametrize("shape", ["cylinder", "box"])
def test_the_inscribed_set_is_inside_and_touches(micro: RPSParameters, shape: str) -> None:
    found = largest_tilt_range(micro, shape, points=25)  # type: ignore[arg-type]
    robot = RPSRobot(micro)

    def all_inside(tilt: float) -> bool:
        ray, z = np.linspace(-1, 1, 41), np.linspace(found.lower, found.upper, 9)
        pose = np.stack(np.meshgrid(z, tilt * ray, tilt * ray), axis=-1).reshape(-1, 3)
        if shape == "cylinder":
            pose = pose[np.hypot(pose[:, 1], pose[:, 2]) <= tilt]
            way = np.deg2rad(np.arange(0, 360, 5))
            rim = np.stack([np.cos(way), np.sin(way)], axis=-1) * tilt
            ends = np.repeat([found.lower, found.upper], len(rim))[:, None]
            pose = np.concatenate([pose, np.concatenate([ends, np.tile(rim, (2, 1))], axis=1)])
        return bool(robot.inverse_kinematics(pose, errors="mask").reachable.all())

    assert all_inside(found.tilt * (1 - 1e-9))
    assert not all_inside(found.tilt * (1 + 1e-3))
    area = math.pi if shape == "cylinder" else 4
    assert math.isclose(found.volume, (found.upper - found.lower) * area * found.tilt**2)


def test_no_other_range_of_heights_is_larger(micro: RPSParameters) -> None:
    found = largest_tilt_range(micro, points=25)
    rng = np.random.default_rng(6)
    for low, high in np.sort(rng.uniform(0.2, 0.25, size=(15, 2))):
        tilt = free_tilt(micro, np.linspace(low, high, 3)).min()
        assert (high - low) * math.pi * tilt**2 < found.volume * 1.02


def test_free_tilt_about_a_level_robot_is_by_formula(micro: RPSParameters) -> None:
    """With g = h the tip of leg 1 tilts about y in its own plane: z_1 = z - h sin(tilt_y)."""
    (tilt,) = free_tilt(micro, 0.205)
    way = np.deg2rad(np.arange(0, 360, 15))
    robot = RPSRobot(micro)
    rim = np.stack([np.full_like(way, 0.205), tilt * np.cos(way), tilt * np.sin(way)], axis=-1)
    lengths = robot.inverse_kinematics(rim, errors="mask").length
    assert math.isclose(lengths.min(), 0.2, rel_tol=1e-9)
    assert free_tilt(micro, 0.3)[0] == 0.0


def test_bad_requests_for_inscribed_sets_are_refused(micro: RPSParameters) -> None:
    free = micro.replace(leg_length_limits=(0.1, math.inf))
    for bad in (
        lambda: largest_tilt_range(micro, "ball"),  # type: ignore[arg-type]
        lambda: largest_tilt_range(micro, points=2),
        lambda: largest_tilt_range(free),
        lambda: free_tilt(micro, [0.2], directions=10),
        lambda: free_tilt(micro, [0.2], largest=4.0),
    ):
        with pytest.raises(InputError):
            bad()
    with pytest.raises(UnreachableError, match="height"):
        largest_tilt_range(micro, start=[0.4, 0.0, 0.0])


# The paper ----------------------------------------------------------------------------------------


def test_the_papers_reach_holds_for_g_equal_to_h_and_not_for_larger_ones() -> None:
    small, middle, large = paper_comparison(base_radii=(0.12, 0.18, 0.24), points=26)
    assert small.holds and not middle.holds and not large.holds
    assert np.allclose([*small.x, *small.y], [-2.374e-3, 1.762e-3, -2.056e-3, 2.056e-3], atol=1e-5)
    assert math.isclose(middle.reach, 2.849e-3, rel_tol=1e-3)
    assert math.isclose(large.reach, 4.956e-3, rel_tol=1e-3)
    assert math.isclose(small.stroke, 50e-3)
    assert small.volume < 1e-3 * small.cylinder_volume
    with pytest.raises(InputError):
        paper_comparison(base_radii=())
