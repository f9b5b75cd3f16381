"""Random files, against MuJoCo: masses, bias, springs and dampers, places, limits, home."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.closed_loop.io.mjcf.random_files import RandomFile
from tests.closed_loop.io.mjcf.twin import Array, Twin, read
from tests.each import each
from tests.worst import worst

SEEDS = range(40)


def off(pair: tuple[Array, Array], scale: float = 0.0) -> float:
    """The largest difference relative to the largest number."""
    own, right = pair
    return worst(own - right) / max(scale, worst(right), 1e-9)


@each("seed", SEEDS)
def test_masses_bias_springs_and_dampers_are_mujocos(seed: int) -> None:
    twin = Twin(RandomFile(seed).text)
    rng = np.random.default_rng(seed)
    for _ in range(3):
        twin.random(rng)
        assert off(twin.masses()) < 1e-12
        assert off(twin.bias()) < 1e-12
        assert off(twin.passive()) < 1e-12


@each("seed", SEEDS)
def test_bodies_sites_limits_and_home_are_mujocos(seed: int) -> None:
    twin = Twin(RandomFile(seed).text)
    m, model = twin.m, twin.model
    twin.random(np.random.default_rng(seed))
    pin.framesForwardKinematics(model, twin.data, twin.q)
    for kind, count, places, turns in (
        ("body", m.nbody, twin.d.xpos, twin.d.xmat),
        ("site", m.nsite, twin.d.site_xpos, twin.d.site_xmat),
    ):
        for i in range(1, count):
            placement = twin.data.oMf[model.getFrameId(getattr(m, kind)(i).name)]
            assert worst(placement.translation - places[i]) < 1e-12
            assert worst(placement.rotation.ravel() - turns[i]) < 1e-12
    for i in range(m.njnt):
        if m.jnt_type[i] > 1:
            place = twin.place(m.joint(i).name or f"{m.body(m.jnt_bodyid[i]).name}_joint")
            limits = m.jnt_range[i] if m.jnt_limited[i] else (-np.inf, np.inf)
            assert model.lowerPositionLimit[place.idx_q] == limits[0]
            assert model.upperPositionLimit[place.idx_q] == limits[1]
    np.testing.assert_array_equal(twin.effects().friction[: m.nv], m.dof_frictionloss)
    twin.set(m.qpos0, np.zeros(m.nv))
    np.testing.assert_allclose(twin.parts.home, twin.q, atol=1e-15)
    np.testing.assert_array_equal(model.gravity.linear, m.opt.gravity)
    assert not model.damping.any()  # it is in the parts, and should not count twice


@each("seed", range(10))
def test_included_files_are_the_file(seed: int, tmp_path: Path) -> None:
    text = RandomFile(seed).text
    (tmp_path / "parts").mkdir(exist_ok=True)
    (tmp_path / "parts" / "robot.xml").write_text(text)
    scene = tmp_path / "scene.xml"
    scene.write_text(
        '<mujoco model="m"><include file="parts/robot.xml"/><worldbody><light pos="0 0 2"/>'
        '<geom type="plane" size="1 1 0.1"/></worldbody></mujoco>'
    )
    whole, part = read(text)[0], read(scene)[0]
    assert part.model == whole.model
    assert part.closures == whole.closures
    assert (part.actuated, part.damping) == (whole.actuated, whole.damping)
