"""Files of people's robots, simulated from the command line: stiff damping on light parts."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.cli.commands import rps_pin
from tests.worst import worst

Array = NDArray[np.float64]

#: A slider-crank whose thin rod has balls at both ends; one of them is damped, at a rate of
#: 0.01 N m s over about 1e-6 kg m^2, so that steps of 1 ms are 10 to 100 times too long for it.
STIFF = """<mujoco model="stiff_rod">
  <compiler angle="radian"/>
  {option}
  <worldbody>
    <body name="wheel">
      <joint name="crank" axis="0 1 0"/>
      <geom type="box" size=".05 .01 .01" pos=".05 0 0" mass=".2" contype="0" conaffinity="0"/>
      <body name="rod" pos=".1 0 0">
        <joint name="ball" type="ball" damping="{damping}"/>
        <geom type="capsule" size=".005" fromto="0 0 0 .3 0 0" mass=".1" contype="0"
          conaffinity="0"/>
        <geom type="sphere" size=".002" pos=".1 .01 0" mass=".001" contype="0" conaffinity="0"/>
      </body>
    </body>
    <body name="carriage" pos=".4 0 0">
      <joint name="slide" type="slide" axis="1 0 0"/>
      <geom type="box" size=".02 .02 .02" mass=".3" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <equality><connect name="pin" body1="carriage" body2="rod" anchor="0 0 0" {hard}/></equality>
  <actuator><motor joint="crank"/></actuator>
  <keyframe><key name="home" qpos="{crank} {w} 0 {y} 0 {slide}"/></keyframe>
</mujoco>"""


def stiff_rod(damping: float, option: str = "", hard: str = "") -> str:
    """Closed at home: the crank at -0.8 rad, the carriage where the rod's end is then."""
    crank = -0.8
    pitch = -np.arcsin(0.1 * np.sin(crank) / 0.3)  # of the rod; both turn about y
    half = (pitch - crank) / 2
    slide = 0.1 * np.cos(crank) + 0.3 * np.cos(pitch) - 0.4
    numbers = {"crank": crank, "w": np.cos(half), "y": np.sin(half), "slide": slide}
    return STIFF.format(option=option, hard=hard, damping=damping, **numbers)


def simulated(folder: Path, *options: str) -> tuple[dict[str, Array], dict[str, float]]:
    """Columns of the table, and the summary."""
    out = folder / f"out{len(list(folder.iterdir()))}"
    command = ("simulate", str(folder / "stiff_rod.xml"), "--duration", "0.1", "--json")
    run = rps_pin(*command, "-o", str(out), *options, folder=folder)
    assert run.returncode == 0, run.stderr
    table = np.genfromtxt(out / "simulation.csv", delimiter=",", names=True)
    return {name: table[name] for name in table.dtype.names}, json.loads(run.stdout)


@pytest.mark.parametrize("damping", [0.01, 0.1])
def test_stiff_damping_in_steps_of_a_millisecond(tmp_path: Path, damping: float) -> None:
    """As by adaptive steps; as by MuJoCo with implicit damping, hard closures and steps of 10 us.

    The tip's height, of the crank's end and the carriage's place alone, says that the rod fits.
    """
    mujoco = pytest.importorskip("mujoco")
    (tmp_path / "stiff_rod.xml").write_text(stiff_rod(damping))
    found, summary = simulated(tmp_path)
    exact, _ = simulated(tmp_path, "--method", "adaptive")
    assert found["time"][-1] == pytest.approx(0.1, abs=1e-12)
    for name in ("q_crank", "q_slide"):
        assert worst(np.abs(found[name] - exact[name])) < 1e-6
    ends = found["q_slide"] + 0.4 - 0.1 * np.cos(found["q_crank"])
    lengths = np.hypot(ends, 0.1 * np.sin(found["q_crank"]))
    assert worst(np.abs(lengths - 0.3)) < 1e-11
    assert summary["largest_gap"] <= 1e-12
    assert summary["energy_balance"] < 1e-5
    model = mujoco.MjModel.from_xml_string(
        stiff_rod(
            damping,
            '<option integrator="implicit" timestep="1e-5"/>',
            'solref="2.1e-5 1" solimp=".9999 .9999 .001"',
        )
    )
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 10_000)
    assert found["q_crank"][-1] == pytest.approx(data.qpos[0], abs=1e-3)
    assert found["q_slide"][-1] == pytest.approx(data.qpos[5], abs=1e-4)
    assert found["v_crank"][-1] == pytest.approx(data.qvel[0], rel=1e-3, abs=1e-3)


_SPRING = """<mujoco model="spring"><compiler inertiafromgeom="false"/><worldbody>
<body name="mass"><joint name="slide" type="slide" axis="1 0 0" stiffness="{stiffness}"/>
<inertial pos="0 0 0" mass="0.5" diaginertia="1 1 1"/></body></worldbody>
<actuator><motor joint="slide"/></actuator>
<keyframe><key name="home" qpos="0.01"/></keyframe></mujoco>"""


@pytest.mark.parametrize(("stiffness", "told"), [(2e4, False), (4e5, True)])
def test_steps_too_long_for_a_spring_are_told(tmp_path: Path, stiffness: float, told: bool) -> None:
    """Of 200 and 894 rad/s, in steps of 1 ms: by order 4 the energy falls by (w h)^6 / 72 a step.

    Of 100 steps that is 9e-5 and 0.7 of it.
    """
    pytest.importorskip("mujoco")
    (tmp_path / "spring.xml").write_text(_SPRING.format(stiffness=stiffness))
    command = ("simulate", "spring.xml", "--duration", "0.1", "--json")
    run = rps_pin(*command, folder=tmp_path)
    assert run.returncode == 0, run.stderr
    summary = json.loads(run.stdout)
    each = stiffness / 0.5 * 1e-6
    lost = 1 - (1 - each**3 / 72 + each**4 / 576) ** 100
    assert summary["energy_balance"] == pytest.approx(lost, rel=0.05)
    notes = [note for note in summary["notes"] if "too long for this motion" in note]
    assert bool(notes) is told
    summary = json.loads(rps_pin(*command, "--method", "adaptive", folder=tmp_path).stdout)
    assert summary["energy_balance"] < 1e-8


def test_adaptive_steps_shorten_where_a_trial_step_leaves_all_bounds(tmp_path: Path) -> None:
    """At a rate of 1e6 per second the first trial, of 1 ms, is no motion at all."""
    pytest.importorskip("mujoco")
    (tmp_path / "stiff_rod.xml").write_text(stiff_rod(1.0))
    options = ("--method", "adaptive", "--duration", "0.002")
    exact, summary = simulated(tmp_path, *options)
    found, _ = simulated(tmp_path, "--duration", "0.002")
    assert worst(np.abs(found["q_crank"] - exact["q_crank"])) < 1e-8
    assert summary["energy_balance"] < 1e-9


@pytest.mark.parametrize(
    ("more", "row"),
    [
        ("", "energy balance (nothing does work)"),
        ("damping: {left_joint: 0.1}", "work of damping "),
        ("actuated: [left_joint]", "work of actuators "),
        (
            "actuated: [left_joint]\ndamping: {right_joint: 0.1}\nfriction: {left_joint: 0.1}",
            "work of actuators, damping and friction ",
        ),
    ],
)
def test_the_table_names_what_does_work(more: str, row: str, tmp_path: Path) -> None:
    urdf = Path(__file__).parents[2] / "urdf" / "five_bar.urdf"
    (tmp_path / "a.yaml").write_text(f"urdf: {urdf}\n{more}\n")
    ended = rps_pin("simulate", "a.yaml", "--duration", "0.003", folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert f"│ {row}" in ended.stdout
    assert ended.stdout.count("work of") == (row != "energy balance (nothing does work)")
