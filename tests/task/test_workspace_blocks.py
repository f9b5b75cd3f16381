"""Workspaces filled block by block against those in one block, and against steps one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rps_pin.task.workspace import TaskWorkspace, task_grid, workspace
from rps_pin.task.workspace.filling import division
from rps_pin.task.workspace.filling.division import Division, flags_of, marked, no_flags
from rps_pin.task.workspace.reasons import UNREACHABLE
from tests.each import each
from tests.task.robots import compiled, task
from tests.task.test_workspace import DELTA, FIVE_BAR, STEWART
from tests.worst import worst


def in_blocks(monkeypatch: pytest.MonkeyPatch, points: int) -> None:
    monkeypatch.setattr(division, "LEAST_POINTS", points)
    monkeypatch.setattr(division, "MOST_POINTS", points)


@each("shape", [(7, 5), (40, 1), (13, 9, 11), (6, 5, 4, 7), (3, 4, 3, 2, 5, 3)])
def test_blocks_divide_a_grid(monkeypatch: pytest.MonkeyPatch, shape: tuple[int, ...]) -> None:
    """Each point is in one block, where it is found, and beside a face are its neighbours."""
    in_blocks(monkeypatch, 30)
    one, rng = Division(shape), np.random.default_rng(0)
    times, number = np.zeros(shape, dtype=int), np.empty(shape, dtype=int)
    for block in range(int(np.prod(one.counts))):
        times[one.slices(block)] += 1
        number[one.slices(block)] = block
        assert 0 < np.prod(one.shape(block)) <= 30
    assert (times == 1).all()
    flat = np.arange(times.size).reshape(shape)
    for point in rng.integers(times.size, size=50):
        block, at = one.find(int(point))
        assert flat[one.slices(block)].flat[at] == point
        places = one.places(block, np.array([at], dtype=np.int32))
        assert flat[places] == point
        for axis, way in one.faces:
            other = one.beside(block, (axis, way))
            edge = one.slices(block)[axis]
            beyond = edge.start - 1 if way < 0 else edge.stop
            if other is None:
                assert not 0 <= beyond < shape[axis]
                continue
            layer = list(one.slices(block))
            layer[axis] = slice(beyond, beyond + 1)
            assert (number[tuple(layer)] == other).all()
            wanted = flat[tuple(layer)].ravel()
            inside = one.in_layer(other, (axis, -way), np.arange(len(wanted), dtype=np.int32))
            assert np.array_equal(flat[one.slices(other)].ravel()[inside], wanted)
            size = int(np.prod(one.shape(other)))
            some = rng.random(size) < 0.5
            bits = marked(no_flags(size), np.flatnonzero(some).astype(np.int32), size)
            layer_bits = one.layer(other, (axis, -way), bits)
            assert np.array_equal(flags_of(layer_bits, (len(wanted),)), some[inside])


def agree(one: TaskWorkspace, other: TaskWorkspace) -> None:
    """Compare reasons, and numbers to 1e-9; which way round to a point came first is open."""
    assert np.array_equal(one.reason, other.reason)
    turns = (one.actuators - other.actuators) / (2 * np.pi)
    if one.mechanism == "five-bar" and worst(turns) > 0.5:
        assert worst(turns - np.round(turns)) < 1e-9
        fields = other.fields._replace(actuators=one.actuators, stroke_left=one.stroke_left)
        other = replace(other, fields=fields)
    for name in ("actuators", "gains", "conditioning", "determinant", "stroke_left", "holding"):
        first, second = getattr(one, name), getattr(other, name)
        if first.size:
            assert worst((first - second) / (1 + np.abs(first))) < 1e-9, name


@each("name, points", [("five_bar", 40), ("five_bar", 150), ("delta", 60), ("stewart", 100)])
def test_blocks_of_any_size_give_the_same(
    monkeypatch: pytest.MonkeyPatch, name: str, points: int
) -> None:
    """Also where the mode's ends and holes cut blocks into parts reached from different sides."""
    one = compiled(name)
    over = {"five_bar": FIVE_BAR, "delta": DELTA, "stewart": STEWART}[name]
    grid = task_grid(one, {axis: values[::2] for axis, values in over.items()})
    whole = workspace(one, grid, holding=name == "delta")
    in_blocks(monkeypatch, points)
    found = workspace(one, grid, holding=name == "delta")
    assert np.prod(Division(grid.shape).counts) > 10
    agree(found, whole)


def test_each_reached_point_is_one_step_from_another_and_no_step_is_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What is reached is the closure of single steps by the Pinocchio engine, point by point."""
    one = task("five_bar")
    grid = task_grid(one, {name: values[::15] for name, values in FIVE_BAR.items()})
    in_blocks(monkeypatch, 8)
    found = workspace(compiled("five_bar"), grid)
    points = grid.points()
    start = tuple(int(np.argmin(np.abs(axis - found.start[k]))) for k, axis in enumerate(grid.axes))
    reached = {start: one.configuration(points[start], within_limits=False)}
    waiting = [start]
    while waiting:
        at = waiting.pop()
        for step in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            there = at[0] + step[0], at[1] + step[1]
            if there in reached or not all(
                0 <= k < n for k, n in zip(there, grid.shape, strict=True)
            ):
                continue
            q = one.configuration(points[there], reached[at], within_limits=False, errors="mask")
            if np.isfinite(q).all():
                reached[there] = q
                waiting.append(there)
    wanted = np.zeros(grid.shape, dtype=bool)
    wanted[tuple(np.transpose(list(reached)))] = True
    assert np.array_equal(~found.mask(UNREACHABLE), wanted)
