"""MuJoCo's files as they are, on the command line: scenes, static meshes, tendons, light rods."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel
from tests.cli.commands import rps_pin
from tests.worst import worst

mujoco = pytest.importorskip("mujoco")

BOB = """<body name="bob" pos="0 0 0.2"><joint name="hinge" axis="0 1 0"/>
    <geom type="sphere" size="0.02" pos="0.1 0 0" mass="1"/></body>"""
MOTOR = '<actuator><motor joint="hinge"/></actuator>'
FINGER = '<geom type="box" size="0.1 0.01 0.01" pos="0.1 0 0" mass="1"/>'
FILES = {
    "robot.xml": f"<mujoco><worldbody>{BOB}</worldbody>{MOTOR}</mujoco>",
    "scene.xml": """<mujoco><include file="robot.xml"/><worldbody><light pos="0 0 2"/>
        <geom type="plane" size="1 1 0.1"/></worldbody></mujoco>""",
    "static_mesh.xml": f"""<mujoco><asset><mesh name="stone"
        vertex="0 0 0  0.1 0 0  0 0.1 0  0 0 0.1"/></asset><worldbody><body>
        <geom type="mesh" mesh="stone"/>{BOB}</body></worldbody>{MOTOR}</mujoco>""",
    "passive.xml": f"<mujoco><worldbody>{BOB}</worldbody></mujoco>",
    "tendon.xml": f"""<mujoco><worldbody><body><joint name="left" axis="0 1 0"/>{FINGER}</body>
        <body pos="0 0.1 0"><joint name="right" axis="0 1 0"/>{FINGER}</body></worldbody>
        <tendon><fixed name="split"><joint joint="left" coef="0.5"/>
        <joint joint="right" coef="0.5"/></fixed></tendon>
        <equality><joint joint1="left" joint2="right"/></equality>
        <actuator><motor tendon="split"/></actuator></mujoco>""",
}
#: What each needs to be held, N m: the weights at 0.1 m, of tendons' forces times their lengths.
HELD = {"robot.xml": [-0.981], "scene.xml": [-0.981], "static_mesh.xml": [-0.981]}
HELD |= {"passive.xml": [], "tendon.xml": [-2 * 0.981]}


@pytest.mark.parametrize("name", FILES)
def test_files_are_described_and_held(name: str, tmp_path: Path) -> None:
    for file, text in FILES.items():
        (tmp_path / file).write_text(text)
    run = rps_pin("describe", name, "--json", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    driven = {"passive.xml": [], "tendon.xml": ["split"]}.get(name, ["hinge"])
    assert (found["mobility"], found["actuated"]) == (1, driven)
    mechanism = ClosedLoopModel.from_mjcf(tmp_path / name)
    still = np.zeros(mechanism.model.nv)
    tau = mechanism.inverse_dynamics(mechanism.home, still, still).tau
    np.testing.assert_allclose(tau, HELD[name], rtol=1e-12)


#: A rod that spins about its length: 1 g at 1 cm from it, and a damper of 0.01 N m s.
SPIN = """<mujoco><compiler angle="radian"/><worldbody>
    <body name="wheel"><joint name="crank" axis="0 1 0"/>
      <geom type="box" size="0.05 0.01 0.01" pos="0.05 0 0" mass="0.2"/>
      <body name="rod" pos="0.1 0 0"><joint name="ball" type="ball" damping="0.01"/>
        <geom type="capsule" size="0.005" fromto="0 0 0 0.3 0 0" mass="0.1"/>
        <geom type="sphere" size="0.002" pos="0.1 0.01 0" mass="0.001"/></body></body>
    <body name="carriage" pos="0.4 0 0"><joint name="slide" type="slide" axis="1 0 0"/>
      <geom type="box" size="0.02 0.02 0.02" mass="0.3"/></body></worldbody>
  <equality><connect name="pin" body1="carriage" body2="rod" anchor="0 0 0"/></equality>
  <actuator><motor joint="crank"/></actuator>
  <keyframe><key name="home" qpos="-1 0.96 0 0.28 0 0"/></keyframe></mujoco>"""


def test_a_light_damped_rod_moves_as_in_mujoco(tmp_path: Path) -> None:
    """By default steps, as by adaptive ones, to MuJoCo's first order in its steps of 0.1 ms."""
    (tmp_path / "spin.xml").write_text(SPIN)
    rows = {}
    for method in ("rk4", "adaptive"):
        options = ("--duration", "0.2", "--method", method, "-o", method, "--json")
        run = rps_pin("simulate", "spin.xml", *options, folder=tmp_path)
        assert run.returncode == 0, run.stderr
        table = tmp_path / method / "simulation.csv"
        with table.open() as file:
            names = file.readline().strip().split(",")
        found = np.loadtxt(table, delimiter=",", skiprows=1)[-1]
        rows[method] = dict(zip(names, found, strict=True))
    ends = [np.array(list(row.values())) for row in rows.values()]
    assert worst(ends[0][:7] - ends[1][:7]) < 1e-7
    home = ClosedLoopModel.from_mjcf(SPIN).home
    m = mujoco.MjModel.from_xml_string(SPIN)
    m.opt.timestep, m.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT  # of the rod and the carriage
    m.eq_solref[:] = [2e-4, 1.0]
    d = mujoco.MjData(m)
    order = [0, 4, 1, 2, 3, 5]
    d.qpos[:] = home[order]
    for _ in range(2000):
        mujoco.mj_step(m, d)
    assert d.time == pytest.approx(0.2)
    q = ends[0][1:7][order]
    assert worst(q - d.qpos) < 2e-4
    assert abs(q[0] - home[0]) > 0.5
