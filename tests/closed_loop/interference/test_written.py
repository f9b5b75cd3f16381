"""Collision shapes that are written with a mechanism, and read again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel
from tests.closed_loop.interference import shaped
from tests.closed_loop.interference.shaped import joint, link, robot, rod, shape
from tests.worst import worst

RNG = np.random.default_rng(3)


def distances(mechanism: ClosedLoopModel, q: np.ndarray) -> dict[tuple[str, str], float]:
    found = mechanism.link_distances()
    found.set_state(q)
    each = (found.distance(k) for k in range(len(found.pairs)))
    return {(min(d[:2]), max(d[:2])): d.distance for d in each}


def test_shapes_are_written_to_a_urdf(tmp_path: Path) -> None:
    shaped.write_mesh(tmp_path / "wedge.stl", *shaped.box((0.1, 0.2, 0.3)))
    mesh = '<mesh filename="wedge.stl" scale="1 2 3"/>'
    text = robot(
        link("base", shape('<box size="1 1 0.1"/>', "0 0 -0.5", "0.1 0.2 0.3")),
        link("a", rod(0.02, 0.5), shape('<sphere radius="0.1"/>', "0.1 0 0")),
        link("plate", shape('<ellipsoid a="0.1" b="0.2" c="0.3"/>', "0 0.1 0")),
        link("b", rod(0.03, 0.4, "capsule")),
        link("c", shape(mesh, "0.1 0 0", "1 0 0")),
        link("d", shape('<sphere radius="0.05"/>')),
        joint("ab", "base", "a", xyz="0 0 0.2", axis="0 1 0"),
        joint("ap", "a", "plate", "fixed", xyz="0.2 0 0.1"),
        joint("pb", "plate", "b", xyz="0.3 0 0"),
        joint("bc", "b", "c", "prismatic", xyz="0.4 0 0"),
        joint("bd", "base", "d", "floating"),
    )
    (tmp_path / "one.urdf").write_text(text)
    (tmp_path / "one.yaml").write_text(
        "urdf: one.urdf\nactuated: [ab]\njoint_types: {pb: spherical}\n"
        "interference: {ignore: [[a, c], [base, d]]}\n"
    )
    one = ClosedLoopModel.load(tmp_path / "one.yaml")
    (tmp_path / "out").mkdir()
    again = ClosedLoopModel.load(one.to_urdf(tmp_path / "out" / "two.urdf"))
    assert again.model.nq == one.model.nq
    for _ in range(5):
        q = pin.integrate(one.model, one.home, RNG.uniform(-1, 1, one.model.nv))
        before, after = distances(one, q), distances(again, q)
        assert before.keys() == after.keys()
        assert ("a", "c") not in before
        assert len(before) > 5
        assert worst(*(after[pair] - before[pair] for pair in before)) < 1e-9


def test_what_no_urdf_has_is_told(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    text = """<mujoco model="m"><worldbody><geom name="floor" type="plane" size="1 1 1"/>
      <body name="a" pos="0 0 1"><joint/><geom size="0.1" contype="1" conaffinity="2"/></body>
      <body name="b" pos="0 0 2"><joint/><geom size="0.2" contype="1" conaffinity="2"/></body>
      <body name="c" pos="0 0 3"><joint/><geom size="0.3" contype="2" conaffinity="1"/></body>
      </worldbody></mujoco>"""
    one = ClosedLoopModel.from_mjcf(text, actuated=[])
    with pytest.warns(UserWarning, match=r"left out: .*geom 'floor' of body 'world' \(a plane"):
        again = ClosedLoopModel.load(one.to_urdf(tmp_path / "m.urdf"))
    assert set(distances(again, again.home)) == {("a", "c"), ("b", "c")}


def test_shapes_that_cannot_be_read_are_told_when_they_are_written(tmp_path: Path) -> None:
    text = robot(
        link("a", shape('<mesh filename="none.stl"/>')),
        link("b", shape('<cone radius="1"/>')),
        joint("ab", "a", "b"),
    )
    one = ClosedLoopModel.from_urdf(text, [], ["ab"])
    with pytest.warns(UserWarning, match=r"left out: .*no file.*none.stl.*<cone> is not a shape"):
        one.to_urdf(tmp_path / "m.urdf")
