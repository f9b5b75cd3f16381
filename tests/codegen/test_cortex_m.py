"""Exported C on an emulated Cortex-M: the self-test passes, and instructions are counted."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rps_pin import ClosedLoopModel, RPSRobot
from rps_pin.codegen.export.c_files import c_files, write_c_files
from rps_pin.codegen.export.mechanism import mechanism_package
from rps_pin.rps.generated.export import robot_package
from tests.programs import output_of, program

ROOT = Path(__file__).resolve().parents[2]
RUN = ROOT / "examples" / "cortex_m" / "run"
COUNT = r"^ok +(\w+) .* of the accepted difference, count (\d+)$"


def counts(folder: Path, *options: str) -> dict[str, int]:
    """Run the self-test in a folder; return instructions of a call by function."""
    for name in ("arm-none-eabi-gcc", "qemu-system-arm"):
        program(name)
    printed = output_of("sh", RUN, folder, *options)
    assert ": all functions agree\n" in printed
    return {name: int(count) for name, count in re.findall(COUNT, printed, re.MULTILINE)}


def export(folder: Path, name: str, real: str, *functions: str) -> None:
    mechanism = ClosedLoopModel.load(ROOT / "urdf" / f"{name}.yaml")
    package = mechanism_package(mechanism, name=name, real=real, functions=functions)
    write_c_files(c_files(package), folder)


def test_a_cortex_m7_computes_the_3_rps_in_double_precision(tmp_path: Path) -> None:
    package = robot_package(RPSRobot.from_preset("micro"), name="micro")
    write_c_files(c_files(package), tmp_path)
    found = counts(tmp_path)
    assert len(found) == 20
    # 1 kHz leaves 200,000 cycles and more: of any mechanism, computed torque takes some 20,000
    # instructions, of which Newton's method takes half; that of the 3-RPS in closed form 4,000.
    assert found["inverse_dynamics"] < 5_000
    assert found["forward_dynamics"] < 7_000
    assert found["computed_torque"] < 8_000
    whole = ("closed", "velocity", "acceleration", "inverse_dynamics")
    assert sum(found[name] for name in whole) < 30_000


def test_a_cortex_m4_computes_in_single_precision(tmp_path: Path) -> None:
    export(tmp_path, "four_bar", "float", "inverse_dynamics", "gravity_forces", "step")
    single = counts(tmp_path, "cortex-m4")
    assert counts(tmp_path, "cortex-m4") == single  # instructions, not time
    export(tmp_path, "four_bar", "double", "inverse_dynamics", "gravity_forces", "step")
    double = counts(tmp_path, "cortex-m4")
    for name, count in single.items():
        assert 0 < count < double[name] / 5  # which is computed without hardware there

    file = tmp_path / "four_bar_test.c"
    text = file.read_text("utf-8")
    file.write_text(text.replace("now.factor * (double)EPSILON", "0"))
    with pytest.raises(AssertionError, match=r"FAILED inverse_dynamics"):
        counts(tmp_path, "cortex-m4")


@pytest.mark.parametrize("options", [[], ["no_folder"], ["."], [".", "cortex-m0"]])
def test_the_script_tells_mistakes(tmp_path: Path, options: list[str]) -> None:
    program("arm-none-eabi-gcc")
    with pytest.raises(AssertionError, match=r"FOLDER|no_folder|cortex-m7 or|nothing exported"):
        output_of("sh", RUN, *options, folder=tmp_path)
