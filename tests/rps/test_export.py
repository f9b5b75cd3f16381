"""C functions of a 3-RPS robot: the self-test of what is exported, compiled and run."""

from __future__ import annotations

import re

import numpy as np
import pytest

from rps_pin import RPSRobot
from rps_pin.codegen.export.c_files import c_files, write_c_files
from rps_pin.errors import InputError
from rps_pin.rps.generated.export import SENTENCES, robot_package
from tests.programs import output_of, program
from tests.worst import worst

STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1")
SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.mark.parametrize(
    ("preset", "real", "compiler", "flags"),
    [
        ("micro", "double", "gcc", ()),
        ("micro", "float", "gcc", SANITIZED),
        ("sokolov", "double", "clang", ()),
        ("sokolov", "float", "gcc", ()),
    ],
)
def test_the_self_test_passes(tmp_path, preset, real, compiler, flags) -> None:
    robot = RPSRobot.from_preset(preset)
    names = tuple(SENTENCES)
    write_c_files(c_files(robot_package(robot, name="robot", real=real, functions=names)), tmp_path)
    files = ("robot.c", "robot_test.c", "-o", "self_test", "-lm")
    output_of(program(compiler), *STRICT, *flags, *files, folder=tmp_path)
    printed = output_of("./self_test", folder=tmp_path)
    found = re.findall(r"^ok +(\w+) +6 states, at most ([\d.]+)", printed, re.MULTILINE)
    assert [name for name, _ in found] == [*SENTENCES]
    assert worst(*(float(share) for _, share in found)) < 0.5


def test_the_robot_s_functions_come_first_and_those_of_its_mechanism_on_demand() -> None:
    robot = RPSRobot.from_preset("micro")
    whole = [one.name for one in robot_package(robot, name="a").functions]
    assert whole[: len(SENTENCES)] == [*SENTENCES]
    assert "forward_dynamics" in whole[len(SENTENCES) :]
    some = robot_package(robot, name="a", functions=["energy", "pose_rate"])
    assert [one.name for one in some.functions] == ["pose_rate", "energy"]
    assert some.unit.entries == ("pose_rate", "energy")
    frame = robot_package(robot, name="a", functions=["pose_rate"], frames=["leg_1_ball"])
    assert frame.unit.entries == ("pose_rate", "frame_leg_1_ball")


def test_the_answers_are_those_of_the_mechanism() -> None:
    robot = RPSRobot.from_preset("sokolov")
    (function,) = robot_package(robot, name="a", functions=["actuator_forces"]).functions
    for case in function.cases:
        expected = robot.actuator_forces(*case.given)
        assert worst(case.expected[0] - expected) < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"functions": ["computed_torqe"]}, "did you mean computed_torque"),
        ({"functions": ["energi"]}, "did you mean energy"),
        ({"name": "1"}, "begins with a digit"),
        ({"real": "half"}, "real"),
    ],
)
def test_bad_input_is_refused(options, words) -> None:
    with pytest.raises(InputError, match=words):
        robot_package(RPSRobot.from_preset("micro"), **{"name": "a"} | options)
