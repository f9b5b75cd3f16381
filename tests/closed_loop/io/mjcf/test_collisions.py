"""Collision shapes of MuJoCo's files, and their distances against MuJoCo's own."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from rps_pin import ClosedLoopModel, InputError
from tests.worst import worst

RNG = np.random.default_rng(5)


def kinds(mechanism: ClosedLoopModel) -> dict[str, str]:
    items = mechanism.collision_model.geometryObjects
    return {item.name: type(item.geometry).__name__ for item in items}


MJCF = """
<mujoco model="m">
  <asset><mesh name="wedge" vertex="0 0 0  1 0 0  0 1 0  0 0 1  0.1 0.1 0.1"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" pos="0 0 -1"/>
    <body name="a"><freejoint/>
      <geom type="{form}" size="{size}" pos="0.1 0.2 0.3" euler="10 20 30" mass="1"/>
      <geom name="picture" type="sphere" size="9" contype="0" conaffinity="0"/>
    </body>
    <body name="b" pos="0 0 3"><freejoint/><geom type="sphere" size="0.1"/></body>
    <body name="c" pos="0 0 6"><freejoint/>
      <geom type="mesh" mesh="wedge" contype="2" conaffinity="2"/></body>
  </worldbody>{contact}
</mujoco>"""


@pytest.mark.parametrize(
    ("form", "size"),
    [("box", "0.1 0.2 0.3"), ("capsule", "0.1 0.3"), ("sphere", "0.2")],
)
def test_geoms_are_where_mujoco_has_them(form: str, size: str) -> None:
    text = MJCF.format(form=form, size=size, contact="")
    one = ClosedLoopModel.from_mjcf(text, closures=[], actuated=[])
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    names = {frozenset(pair) for pair in one.link_distances().pairs}
    assert names == {frozenset(p) for p in (("world", "a"), ("world", "b"), ("a", "b"))}
    distances = one.link_distances()
    geoms = {"world": 0, "a": 1, "b": 3}
    errors = []
    for _ in range(20):
        qpos = np.concatenate(
            [[*RNG.uniform(-0.3, 0.3, 3), *RNG.uniform(-1, 1, 4)] for _ in range(3)]
        )
        for k in range(3):
            qpos[7 * k + 3 : 7 * k + 7] /= np.linalg.norm(qpos[7 * k + 3 : 7 * k + 7])
        data.qpos[:] = qpos
        mujoco.mj_forward(model, data)
        q = qpos.reshape(3, 7)[:, [0, 1, 2, 4, 5, 6, 3]].ravel()
        distances.set_state(q)
        for number, (link_a, link_b) in enumerate(distances.pairs):
            found = distances.distance(number).distance
            theirs = mujoco.mj_geomDistance(
                model, data, geoms[link_a], geoms[link_b], 50.0, np.zeros(6)
            )
            if theirs > 1e-3:
                errors.append(found - theirs)
    assert len(errors) > 20
    assert worst(errors) < 1e-5


def test_excluded_bodies_and_meshes_of_mujoco() -> None:
    contact = '<contact><exclude body1="a" body2="b"/></contact>'
    text = MJCF.format(form="sphere", size="0.1", contact=contact)
    one = ClosedLoopModel.from_mjcf(text, actuated=[])
    assert one.collision_shapes.ignored == (("a", "b"),)
    assert kinds(one) == {
        "world_0": "Halfspace", "a_0": "Sphere", "b_0": "Sphere", "c_0": "Convex",
    }  # fmt: skip
    same = ClosedLoopModel.from_mjcf(
        text.replace('contype="2" conaffinity="2"', "").replace('pos="0 0 6"', 'pos="2 0 0"'),
        actuated=[],
    )
    distances = same.link_distances()
    assert ("a", "c") in distances.pairs
    found = same.interference(same.home, clearance=1.5)
    lowest = {one.link_b: one.distance for one in found.found if one.link_a == "world"}
    assert lowest["a"] == pytest.approx(1.0 + 0.3 - 0.1, abs=1e-9)  # the floor is 1 m below
    assert "b" not in lowest


def test_height_fields_are_refused() -> None:
    text = """<mujoco><asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"
      elevation="0 1 0 1"/></asset><worldbody><geom type="hfield" hfield="h"/>
      <body name="a"><joint/><geom size="0.1"/></body></worldbody></mujoco>"""
    one = ClosedLoopModel.from_mjcf(text, actuated=[])
    with pytest.raises(InputError, match=r"geom 0 of body 'world': height fields are not read"):
        one.interference(one.home)
