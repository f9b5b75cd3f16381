"""Boundaries, inscribed shapes, orientations and files of workspaces."""

from __future__ import annotations

import math
from itertools import combinations
from pathlib import Path

import h5py
import numpy as np
import pytest
import trimesh

from rps_pin import InputError
from rps_pin.arrays import Array
from rps_pin.task.workspace import (
    boundary,
    largest_ball,
    largest_box,
    largest_cylinder,
    load_workspace,
    orientation_workspace,
    save_mesh,
    save_workspace,
    task_grid,
    volume,
    workspace,
)
from rps_pin.task.workspace.reasons import UNREACHABLE
from tests.task.robots import compiled
from tests.task.workspaces import of_body, stewart_legs
from tests.worst import worst

AXES = (np.linspace(-1.3, 1.4, 31), np.linspace(-1.4, 1.3, 34), np.linspace(-1.35, 1.3, 30))


def ball(points: Array):
    return np.linalg.norm(points - [0.03, -0.05, 0.02], axis=-1) < 1.1


def random_body(seed: int):
    """Coarse noise on a few uneven points."""
    rng = np.random.default_rng(seed)
    axes = tuple(np.cumsum(rng.uniform(0.5, 1.5, n)) for n in (6, 7, 5))
    return of_body(axes, lambda points: rng.uniform(size=points.shape[:-1]) < 0.85)


@pytest.mark.parametrize("body", [ball, lambda points: (np.abs(points) < 1).any(axis=-1)])
def test_a_boundary_is_closed_and_encloses_the_cells(body) -> None:
    found = of_body(AXES, body)
    mesh = boundary(found)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(volume(found).least, rel=1e-12)
    corners = {tuple(point) for point in found.grid.points()[found.inside].round(9)}
    assert {tuple(point) for point in np.array(mesh.vertices).round(9)} <= corners


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".glb"])
def test_meshes_come_back_from_their_files(suffix: str, tmp_path: Path) -> None:
    mesh, file = boundary(of_body(AXES, ball)), tmp_path / f"ball{suffix}"
    save_mesh(mesh, file)
    back = trimesh.load(file, force="mesh")
    assert back.volume == pytest.approx(mesh.volume, rel=1e-5)
    with pytest.raises(InputError, match="exists"):
        save_mesh(mesh, file)
    with pytest.raises(InputError, match=r"\.stl, \.ply, \.obj, \.glb"):
        save_mesh(mesh, tmp_path / "ball.step")


@pytest.mark.parametrize("seed", range(6))
def test_the_largest_box_is_that_of_all_boxes(seed: int) -> None:
    """Of random bodies, by trying every box."""
    found = random_body(seed)
    sizes = [0.0]
    ends = [list(combinations(range(n), 2)) for n in found.grid.shape]
    for i in ends[0]:
        for j in ends[1]:
            for k in ends[2]:
                where = tuple(slice(a, b + 1) for a, b in (i, j, k))
                if found.inside[where].all():
                    sides = zip(found.grid.axes, (i, j, k), strict=True)
                    sizes.append(math.prod(axis[b] - axis[a] for axis, (a, b) in sides))
    box, best = largest_box(found), float(np.max(sizes))
    assert box.volume == pytest.approx(best, rel=1e-12)
    assert math.prod(box.upper - box.lower) == pytest.approx(best, rel=1e-12)
    points = found.grid.points()
    within = ((points >= box.lower - 1e-12) & (points <= box.upper + 1e-12)).all(axis=-1)
    assert found.inside[within].all()


def test_shapes_in_a_ball_are_near_those_of_geometry() -> None:
    """Each below the exact one, and above that of a ball smaller by two diagonals of a cell."""
    found, radius = of_body(AXES, ball), 1.1
    less = radius - 2 * math.hypot(*(axis[1] - axis[0] for axis in AXES))
    exact = {  # over the cube of the radius
        "ball": (largest_ball(found).volume, 4 / 3 * math.pi),
        "box": (largest_box(found).volume, 8 / 3**1.5),
        "cylinder": (largest_cylinder(found).volume, 4 * math.pi / 3**1.5),
    }
    for name, (size, share) in exact.items():
        assert share * less**3 < size < share * radius**3, name
    one = largest_ball(found)
    points = found.grid.points()
    assert found.inside[np.linalg.norm(points - one.centre, axis=-1) <= one.radius].all()
    mesh = boundary(found)  # the whole ball is within the mesh
    turns = np.random.default_rng(0).normal(size=(500, 3))
    rim = one.centre + one.radius * 0.9999 * turns / np.linalg.norm(turns, axis=1)[:, None]
    assert mesh.contains(rim).all()
    rod = largest_cylinder(found, "x")
    assert rod.axis == "x"
    away = np.linalg.norm(points[..., 1:] - rod.centre, axis=-1) <= rod.radius
    along = (points[..., 0] >= rod.lower) & (points[..., 0] <= rod.upper)
    assert found.inside[away & along].all()


def test_what_has_no_shape_is_refused() -> None:
    nothing = of_body(AXES, lambda points: points[..., 0] > 99)
    thin = of_body(AXES, lambda points: np.abs(points[..., 0]) < 0.06)
    for call in (boundary, largest_box, largest_ball, largest_cylinder):
        with pytest.raises(InputError, match="no cell"):
            call(nothing)
        with pytest.raises(InputError, match="three are needed"):
            call(of_body(AXES[:2], lambda points: points[..., 0] < 99))
    for call in (largest_ball, largest_cylinder):
        with pytest.raises(InputError, match=r"no (point|cell)"):
            call(thin)
    uneven = of_body((AXES[0] ** 3, *AXES[1:]), ball)
    with pytest.raises(InputError, match="steps of axis x"):
        largest_ball(uneven)
    assert largest_cylinder(uneven, "x").volume > 0
    with pytest.raises(InputError, match="no axis 'w'"):
        largest_cylinder(uneven, "w")


def test_orientations_are_those_of_shells_for_each() -> None:
    """A Stewart platform: positions for all, and for any, of five orientations."""
    one = compiled("stewart")
    axes = {"x": np.linspace(-0.3, 0.3, 9), "z": np.linspace(0.4, 0.85, 10)}
    turns = {"rx": [0, 0.3, -0.3, 0.2, 0], "ry": [0, 0, 0.1, -0.3, 0.3]}
    grid = task_grid(one, axes)
    points = np.zeros((9, 10, 3))
    points[..., 0], points[..., 2] = np.meshgrid(axes["x"], axes["z"], indexing="ij")
    inside = []
    for rx, ry in zip(turns["rx"], turns["ry"], strict=True):
        legs = stewart_legs(points.reshape(-1, 3), np.array([rx, ry, 0.0])).reshape(9, 10, 6)
        inside.append(((legs >= 0.45) & (legs <= 0.95)).all(axis=-1))
    every = orientation_workspace(one, grid, turns, "all")
    some = orientation_workspace(one, grid, turns, "any")
    assert np.array_equal(every.inside, np.all(inside, axis=0))
    assert np.array_equal(some.inside, np.any(inside, axis=0))
    assert 0 < every.inside.sum() < some.inside.sum() < 90
    assert volume(every).value < volume(some).value
    for given, told in [
        ({}, "empty"),
        ({"x": [0.1]}, "no free coordinate 'x'"),
        ({"rx": [0.1], "ry": [0.1, 0.2]}, "1 of rx, 2 of ry"),
        ({"rx": []}, "rx has shape"),
        ({"rx": [np.nan]}, "rx"),
    ]:
        with pytest.raises(InputError, match=told):
            orientation_workspace(one, grid, given)
    with pytest.raises(InputError, match="rule"):
        orientation_workspace(one, grid, turns, "most")


def saved(tmp_path: Path):
    one = compiled("delta")
    grid = task_grid(one, {"x": np.linspace(-0.5, 0.5, 7), "z": np.linspace(-0.8, -0.3, 6)})
    found = workspace(one, grid, holding=True)
    save_workspace(found, tmp_path / "w.h5", description="name: delta")
    return found, tmp_path / "w.h5"


def test_a_workspace_comes_back_from_its_file(tmp_path: Path) -> None:
    found, file = saved(tmp_path)
    back = load_workspace(file)
    for part, same in zip(found.fields, back.fields, strict=True):
        assert part.dtype == same.dtype
        assert np.array_equal(part, same)
    assert (back.mechanism, back.actuated, back.reasons) == ("delta", found.actuated, found.reasons)
    assert back.grid.over == ("x", "z")
    assert back.grid.held == found.grid.held
    assert np.array_equal(back.start, found.start)
    assert back.counts() == found.counts()
    assert found.counts()[UNREACHABLE] > 0
    with h5py.File(file) as stored:
        assert stored.attrs["description"] == "name: delta"
        assert stored.attrs["version"]
        assert stored["axis_2"].attrs["name"] == "z"
    with pytest.raises(InputError, match="exists"):
        save_workspace(found, file)
    with pytest.raises(InputError, match="not a folder"):
        save_workspace(found, tmp_path / "none" / "w.h5")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda f: f.attrs.__delitem__("complete"), "complete"),
        (lambda f: f.attrs.__setitem__("format", "other"), "complete"),
        (lambda f: f.attrs.__setitem__("over", '["x", "w"]'), "do not go together"),
        (lambda f: f.attrs.__setitem__("reasons", '["a", "a"]'), "twice"),
        (lambda f: f.attrs.__setitem__("reasons", '["a"]'), "bits that no reason has"),
        (lambda f: f.attrs.__setitem__("angular", "{"), "double quotes"),
        (lambda f: f.__delitem__("gains"), "gains must be a dataset"),
        (lambda f: f.attrs.__setitem__("at", [0.0, 0.0, 0.0]), "at must be NaN"),
        (lambda f: f["conditioning"].__setitem__((0, 0), np.nan), "not finite"),
        (lambda f: (f.__delitem__("axis_1"), f.create_dataset("axis_1", data=[0.0, 1.0])), "shape"),
        (
            lambda f: (f.__delitem__("gains"), f.__setitem__("gains", h5py.ExternalLink("a", "b"))),
            "not a link",
        ),
    ],
)
def test_files_that_are_no_workspace_are_refused(change, told: str, tmp_path: Path) -> None:
    _, file = saved(tmp_path)
    with h5py.File(file, "r+") as opened:
        change(opened)
    with pytest.raises(InputError, match=f"cannot read the workspace .*{told}"):
        load_workspace(file)


def test_no_file_and_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.h5").write_text("no HDF5")
    for name in ("none.h5", "text.h5", "."):
        with pytest.raises(InputError, match="cannot read the workspace"):
            load_workspace(tmp_path / name)


def test_largest_shapes_of_a_stewart_platform_hold_in_closed_form() -> None:
    """Random points of the box and the ball keep all legs, but for a grid step's curvature."""
    one = compiled("stewart")
    axes = {n: np.linspace(-0.4, 0.4, 17) for n in ("x", "y")} | {"z": np.linspace(0.4, 0.85, 13)}
    found = workspace(one, task_grid(one, axes))
    rng, box, round_ = np.random.default_rng(0), largest_box(found), largest_ball(found)
    turns = rng.normal(size=(2000, 3))
    inner = round_.radius * rng.uniform(size=(2000, 1)) ** (1 / 3)
    points = np.concatenate(
        [
            rng.uniform(box.lower, box.upper, (2000, 3)),
            round_.centre + inner * turns / np.linalg.norm(turns, axis=1)[:, None],
        ]
    )
    legs = stewart_legs(points, np.zeros(3))
    sagitta = 3 * 0.05**2 / (8 * 0.45)  # of a sphere of the least radius over a cell's diagonal
    assert worst(np.minimum(legs - 0.45, 0).min(), np.minimum(0.95 - legs, 0).min()) <= sagitta
    assert box.volume > 0.02
    assert round_.radius > 0.1
