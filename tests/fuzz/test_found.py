"""What the long runs found, one test a kind; each failed before it was mended."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

pytest.importorskip("mujoco")

from rps_pin import ClosedLoopModel, ForceDistribution, RPSParameters, RPSRobot
from rps_pin.control import Gains, RealTimeRobot, load_scenario
from rps_pin.errors import InputError, MechanismError
from rps_pin.paper import lagrange_forces
from rps_pin.rps.motion.trajectory_file import load_trajectory
from rps_pin.rps.robot_file import load_robot
from rps_pin.rps.workspace import leg_grid, load_workspace, save_workspace, workspace
from rps_pin.trajectories import read_csv
from tests.cli.commands import rps_pin

START = Path(__file__).parent / "start"


def _mjcf(old: str, new: str, name: str = "loop") -> str:
    text = (START / f"{name}.xml").read_text("utf-8")
    assert old in text
    return text.replace(old, new, 1)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (
            'class="rod" from',
            'class="%n" from',
            "line 11: class = .* has a %",
        ),
        ('anchor="0.5 0 0"', 'anchor=" "', "not a valid MJCF"),
        ('axis="0 1 0"', 'axis="1e200 1 0"', "line 10: joint 'crank_joint' .*without direction"),
        ('pos="0 0 0.1"', 'pos="0 1e155 0.1"', "line 9: body 'crank' has pos .* beyond 1e"),
        ('gravity="0 0 -9.81"', 'gravity="0 0 1e60"', "gravity is not finite, or beyond"),
        (
            'axis="0 1 0" range',
            'ref="1e200" axis="0 1 0" range',
            "line 10: joint 'crank_joint' has ref = .* beyond 1e",
        ),
    ],
)
def test_mjcf_that_mujoco_takes_and_nobody_can_compute(old: str, new: str, why: str) -> None:
    with pytest.raises(MechanismError, match=why):
        ClosedLoopModel.from_mjcf(_mjcf(old, new))


def test_a_tree_that_cannot_move_is_simulated_though_it_has_damping() -> None:
    joint = '<joint name="coupler_joint" axis="0 1 0" stiffness="0.2" springref="10"/>'
    still = ClosedLoopModel.from_mjcf(_mjcf(joint, ""))
    assert still.describe().mobility == 0
    found = still.simulate(still.home, duration=1e-3, step=1e-3)
    assert np.abs(found.q - still.home).max() < 1e-12


@pytest.mark.parametrize("number", ["1e200", "-1e51"])
def test_urdf_with_numbers_of_which_no_square_is_finite(number: str) -> None:
    text = (START / "dialects.urdf").read_text("utf-8")
    with pytest.raises(MechanismError, match=r"line 5: origin xyz = .* is beyond 1e\+50"):
        ClosedLoopModel.from_urdf(text.replace('xyz="0.1 0 0"/>', f'xyz="{number} 0 0"/>'), [], [])
    limits = text.replace('effort="5" velocity="2"', 'effort="1e300" velocity="inf"')
    ClosedLoopModel.from_urdf(limits, [], [])  # as exporters write no limit


@pytest.mark.parametrize("number", ["\uff11", "\u0661", "1\u00a0", "\u00bd"])
def test_csv_with_digits_that_are_not_ascii(number: str, tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    rows = ["time_s,z_m,tilt_x_rad,tilt_y_rad", "0,0.22,0,0", f"1,0.22,{number},0", "2,0.22,0,0"]
    file.write_text("\n".join(rows), "utf-8")
    with pytest.raises(InputError, match=r"line 3: tilt_x_rad = .*it must be a number"):
        read_csv(file)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("leg_length_limits", (0.2, 1e300)),
        ("actuator_force_limit", 1e200),
        ("spherical_cone_limit", 1e51),
    ],
)
def test_limits_are_infinite_or_of_numbers_that_can_be_squared(field: str, value: Any) -> None:
    parameters = RPSParameters.from_preset("micro")
    with pytest.raises(InputError, match=f"{field} = .*infinite .* or at most 1e"):
        parameters.replace(**{field: value})
    parameters.replace(leg_length_limits=(0.2, np.inf))


def test_arrays_of_which_no_square_is_finite() -> None:
    four = ClosedLoopModel.load("urdf/four_bar.yaml")
    q, zero, huge = four.home, np.zeros(3), np.array([1e200, 0.0, 0.0])
    for call in (
        lambda: four.generalised_force(q, huge, zero),
        lambda: four.loop_errors(q, huge, zero),
        lambda: four.forward_dynamics_derivatives(q, huge, [0.0]),
        lambda: lagrange_forces(RPSParameters.from_preset("micro"), [0.22, 0, 0], huge, zero),
    ):
        with pytest.raises(InputError, match=r"is beyond 1e\+50: entry 0 is 1e\+200"):
            call()
            pytest.fail(str(call))


def test_nests_deeper_than_arrays_are() -> None:
    deep: Any = 1.0
    for _ in range(60):
        deep = [deep]
    with pytest.raises(InputError, match="platform_inertia"):
        RPSParameters.from_preset("micro").replace(platform_inertia=deep)


def test_a_workspace_with_a_singular_point_inside(tmp_path: Path) -> None:
    parameters, file = RPSParameters.from_preset("micro"), tmp_path / "w.h5"
    save_workspace(workspace(parameters, leg_grid(parameters, 3)), file)
    with h5py.File(file, "r+") as opened:
        opened["determinant"][...] = 0.0
    with pytest.raises(InputError, match="determinant is 0 at a point inside"):
        load_workspace(file)


def test_kinds_of_arguments_that_type_hints_do_not_tell() -> None:
    four, robot = ClosedLoopModel.load("urdf/four_bar.yaml"), RPSRobot.from_preset("micro")
    wrong: Any = [1.0]
    with pytest.raises(InputError, match=r"bounds: 1\.0 is not a ForceBound"):
        ForceDistribution(four, bounds=iter(wrong))
    with pytest.raises(InputError, match=r"inertia has shape \(0,\)"):
        Gains.placed(1.0).times([])
    with pytest.raises(InputError, match=r"compiled = 1\.0"):
        RealTimeRobot(robot, [0.223, 0.02, -0.01], compiled=1.0)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"legs = 2\.5: it must be what legs_of_pose returns"):
        robot.motion([0.223, 0, 0], [0, 0, 0], [0, 0, 0], legs=2.5)  # type: ignore[arg-type]
    for call in (four.inverse_dynamics, four.forward_dynamics, four.generalised_force):
        size = 1 if call == four.forward_dynamics else 3
        with pytest.raises(InputError, match="wrenches"):
            call(four.home, np.zeros(3), np.zeros(size), wrenches=np.zeros(3))


def test_grids_that_no_memory_holds(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="points of an axis: at most 1000000 are taken"):
        leg_grid(RPSParameters.from_preset("micro"), 10**60)
    assert rps_pin("workspace", "--points", "9" * 50, folder=tmp_path).returncode == 1


def test_an_output_below_a_file_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "a_file").write_text("x")
    ended = rps_pin("reproduce", "--quick", "--output", "a_file", folder=tmp_path)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert "a_file is a file: " in ended.stderr


@pytest.mark.parametrize(("name", "slip"), [("angle", "anglee"), ("conditioning", "condtioning")])
def test_a_workspace_with_a_misspelt_field(name: str, slip: str, tmp_path: Path) -> None:
    parameters, file = RPSParameters.from_preset("micro"), tmp_path / "w.h5"
    save_workspace(workspace(parameters, leg_grid(parameters, 3)), file)
    with h5py.File(file, "r+") as opened:
        opened["rotation"] = [np.nan]  # the user's own
    load_workspace(file)
    with h5py.File(file, "r+") as opened:
        opened.move(name, slip)
    with pytest.raises(InputError, match=rf"no field '{slip}' \(did you mean {name}\?\)"):
        load_workspace(file)


@pytest.mark.parametrize("complete", ["x", "False", 1.0, np.nan])
def test_a_workspace_is_complete_by_a_boolean_alone(complete: Any, tmp_path: Path) -> None:
    parameters, file = RPSParameters.from_preset("micro"), tmp_path / "w.h5"
    save_workspace(workspace(parameters, leg_grid(parameters, 3)), file)
    with h5py.File(file, "r+") as opened:
        opened.attrs["complete"] = complete
    with pytest.raises(InputError, match="does not hold a complete"):
        load_workspace(file)


@pytest.mark.parametrize("number", ["1e400", "-1.0e+999"])
def test_yaml_numbers_that_overflow_are_not_infinite(number: str, tmp_path: Path) -> None:
    file = tmp_path / "path.yaml"
    text = (
        "kind: point_to_point\nstart: [0.21, 0, 0]\nend: [0.235, 0.1, 0]\nmax_rate: [0.1, 1, {}]\n"
    )
    micro = RPSRobot.from_preset("micro")
    file.write_text(text.format(".inf"), "utf-8")
    assert np.isfinite(load_trajectory(file, micro).duration)
    file.write_text(text.format(number), "utf-8")
    with pytest.raises(InputError, match=r"line 4: .* is too large for a number; \.inf is infin"):
        load_trajectory(file, micro)


@pytest.mark.parametrize("name", ["x" * 300, "a/" * 3000])
def test_names_longer_than_a_system_takes(name: str, tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.yaml"
    controller = "controller: {law: computed_torque, bandwidth: 1}\n"
    trajectories = {
        "robot": "trajectory: {kind: circle, height: 0.22, tilt: 0, duration: 1}\n",
        "mechanism": "trajectory: {kind: point_to_point, end: {z: 0.6}, duration: 1}\n",
    }
    for key, trajectory in trajectories.items():
        scenario.write_text(f"{key}: {name}\n{trajectory}{controller}", "utf-8")
        with pytest.raises(InputError, match=r"there is no such file|not a file or a preset"):
            load_scenario(scenario)
    with pytest.raises(InputError, match="not a file or a preset"):
        load_robot(name)
    for end in ("", ".yaml"):
        with pytest.raises(InputError, match="File name too long"):
            ClosedLoopModel.load(name + end)
