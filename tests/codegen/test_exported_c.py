"""Exported C: compilers take it without a warning, and its self-test passes, or fails as it must.

`test_cortex_m` runs it on another processor.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, JointEffects
from rps_pin.codegen.export.c_files import c_files, write_c_files
from rps_pin.codegen.export.mechanism import mechanism_package
from rps_pin.codegen.export.package import Package
from rps_pin.codegen.export.words import FUNCTIONS
from rps_pin.errors import InputError
from tests.closed_loop.random_mechanisms import pooled
from tests.codegen.exported import STRICT, URDF, exported, shares, tested
from tests.programs import output_of, program
from tests.quick import quick
from tests.worst import worst

SANITIZED = ("-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.fixture(scope="module", params=["double", "float"])
def five_bar(request, tmp_path_factory) -> tuple[Package, Path]:
    """All functions, with parameters, a wrench and a frame."""
    folder = tmp_path_factory.mktemp("five_bar")
    package = exported(
        folder,
        "five_bar",
        real=request.param,
        functions=tuple(FUNCTIONS),
        frames=["right_tip"],
        parameters=["gravity", "mass:left_arm_joint"],
        wrench_frames=["left_tip"],
    )
    return package, folder


@pytest.mark.parametrize(
    ("five_bar", "compiler", "flags"),
    quick(
        [
            (real, *with_)
            for real in ("double", "float")
            for with_ in [("gcc", ("-O2",)), ("gcc", SANITIZED), ("clang", ("-O1",))]
        ],
        [
            ("double", "gcc", ("-O2",)),
            ("double", "gcc", SANITIZED),
            ("float", "gcc", ("-O2",)),
            ("float", "clang", ("-O1",)),
        ],
    ),
    indirect=["five_bar"],
    scope="module",  # one package after the other, each made once
)
def test_the_self_test_passes_without_warnings(five_bar, compiler, flags) -> None:
    package, folder = five_bar
    printed = tested(folder, "five_bar", compiler, *flags)
    assert "five_bar: all functions agree" in printed
    found = shares(printed)
    assert [*found] == [one.name for one in package.functions]
    assert [*found] == [*FUNCTIONS, "frame_right_tip"]
    # The accepted difference is no excuse: a tenth of it would nearly do.
    assert worst(*found.values()) < 0.8


@pytest.mark.parametrize(
    ("seed", "planar", "real"),
    quick(
        [(5, False, "double"), (5, False, "float"), (4, True, "float")],
        [(5, False, "double"), (4, True, "float")],
    ),
)
def test_random_mechanisms(tmp_path, seed, planar, real) -> None:
    """Of many kinds of joints and closures; the planar one has redundant rows."""
    mechanism = pooled(seed, planar=planar, effects=True, armature=True).mechanism
    package = mechanism_package(mechanism, name="random", real=real)
    write_c_files(c_files(package), tmp_path)
    found = shares(tested(tmp_path, "random", "gcc"))
    assert len(found) == 15
    assert worst(*found.values()) < 0.8


def test_the_code_has_no_variables_and_calls_only_mathematics(five_bar) -> None:
    package, folder = five_bar
    output_of(program("gcc"), *STRICT, "-O2", "-c", "five_bar.c", folder=folder)
    symbols = [line.split()[-2:] for line in output_of("nm", folder / "five_bar.o").splitlines()]
    public = {name for kind, name in symbols if kind == "T"}
    assert public == {f"five_bar_{one.name}" for one in package.functions}
    assert {kind for kind, _ in symbols} <= set("TtrRU")  # nothing that can be written to
    f = "" if package.real == "double" else "f"
    used = {name for kind, name in symbols if kind == "U"} - {"_GLOBAL_OFFSET_TABLE_"}
    allowed = {"sin", "cos", "sincos", "tan", "atan2", "sqrt", "tanh", "fabs", "fmin", "fmax"}
    assert used - {"memset", "memcpy", "__stack_chk_fail"} <= {name + f for name in allowed}


def test_the_header_serves_cpp(five_bar, tmp_path) -> None:
    _, folder = five_bar
    (tmp_path / "use.cpp").write_text(
        '#include "five_bar.h"\nint main() { return FIVE_BAR_NQ - 4; }\n'
    )
    flags = ("-std=c++11", "-pedantic", "-Wall", "-Wextra", "-Werror", f"-I{folder}")
    output_of(program("g++"), *flags, "use.cpp", "-o", "use", folder=tmp_path)
    output_of("./use", folder=tmp_path)


def test_cmake_builds_and_tests(tmp_path) -> None:
    exported(tmp_path / "four_bar", "four_bar")
    output_of(program("cmake"), "-S", "four_bar", "-B", "build", folder=tmp_path)
    output_of("cmake", "--build", "build", folder=tmp_path)
    printed = output_of("ctest", "--test-dir", "build", folder=tmp_path)
    assert "100% tests passed, 0 tests failed out of 1" in printed


@pytest.mark.parametrize("change", ["answer", "argument", "status", "open"])
def test_the_self_test_sees_what_is_wrong(tmp_path, change) -> None:
    exported(tmp_path, "four_bar", functions=["inverse_dynamics", "velocity"])
    file = tmp_path / ("four_bar.c" if change in ("status", "open") else "four_bar_test.c")
    text = file.read_text("utf-8")
    if change == "status":
        text = text.replace("    return status;", "    return 0;")
    elif change == "open":
        assert "(check)[0] <= 1" in text
        text = text.replace("(check)[0] <= 1", "(check)[0] <= 1e99")
    else:
        name = "wanted_tau" if change == "answer" else "given_a"
        number = re.search(rf"{name}\[\d\]\[\d\] = {{\n    {{([^,}}]+)", text)
        begin, end = number.span(1)
        text = f"{text[:begin]}{float(number[1]) * (1 + 1e-9)!r}{text[end:]}"
    file.write_text(text, "utf-8")
    with pytest.raises(AssertionError, match=r"FAILED +inverse_dynamics"):
        tested(tmp_path, "four_bar", "gcc")


@pytest.mark.parametrize("count", [1, 3])
def test_fewer_and_more_actuators_than_motions(tmp_path, count) -> None:
    actuated = ["left_joint", "right_joint", "left_arm_joint"][:count]
    found = ClosedLoopModel.load(URDF / "five_bar.yaml")
    mechanism = ClosedLoopModel(found.model, found.closures, actuated, home=found.home)
    functions = ["inverse_dynamics", "forward_dynamics", "forward_dynamics_derivatives"]
    package = mechanism_package(mechanism, name="other", functions=functions)
    write_c_files(c_files(package), tmp_path)
    assert len(shares(tested(tmp_path, "other", "gcc"))) == 3
    with pytest.raises(InputError, match=f"{count} actuated velocities must be the 2"):
        mechanism_package(mechanism, functions=["inverse_dynamics_derivatives"])


@pytest.mark.parametrize("real", ["double", "float"])
def test_a_tree_without_loops(tmp_path, real) -> None:
    model = ClosedLoopModel.load(URDF / "five_bar.yaml").model
    package = mechanism_package(
        ClosedLoopModel(model, [], list(model.names)[1:]), name="tree", real=real
    )
    write_c_files(c_files(package), tmp_path)
    assert len(shares(tested(tmp_path, "tree", "gcc"))) == 15


def test_springs_and_damping_are_told(tmp_path) -> None:
    found = ClosedLoopModel.load(URDF / "four_bar.yaml")
    nv = found.model.nv
    effects = JointEffects(*(np.full(nv, number) for number in (0.1, 0.01, 1.0, 0.2)))
    mechanism = ClosedLoopModel(
        found.model, found.closures, found.actuated, home=found.home, effects=effects
    )
    package = mechanism_package(mechanism, name="damped", functions=["inverse_dynamics", "bias"])
    write_c_files(c_files(package), tmp_path)
    assert "Damping, friction and springs" in (tmp_path / "damped.h").read_text("utf-8")
    tested(tmp_path, "damped", "gcc")


def hostile() -> ClosedLoopModel:
    """A four-bar whose names hold what ends comments, lines and tables."""
    found = ClosedLoopModel.load(URDF / "four_bar.yaml")
    model = found.model.copy()
    names = list(model.names)
    evil = {name: f'{name} */ #error "`| é /* ??/\n\\' for name in names[1:]}
    for i, name in enumerate(names[1:], 1):
        model.names[i] = evil[name]
    return ClosedLoopModel(
        model,
        found.closures,
        [evil[name] for name in found.actuated],
        home=found.home,
        name="evil */ name",
    )


def test_names_of_joints_cannot_leave_their_comments(tmp_path) -> None:
    package = mechanism_package(hostile(), name="evil", functions=["gravity_forces"])
    write_c_files(c_files(package), tmp_path)
    tested(tmp_path, "evil", "gcc")
    text = (tmp_path / "evil.h").read_text("utf-8")
    assert text.count("\\u002a/ #error") >= 4
    assert all("`" not in line.replace("`evil_", "") for line in text.splitlines())
