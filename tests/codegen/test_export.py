"""Exported C: its texts, compilers that take it, and its self-test: it passes, or fails as it must.

`test_cortex_m` runs it on another processor.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, JointEffects
from rps_pin.codegen.export.c_files import c_files, write_c_files
from rps_pin.codegen.export.mechanism import mechanism_package
from rps_pin.codegen.export.names import identifier, quoted
from rps_pin.codegen.export.package import Package, conditions
from rps_pin.codegen.export.vectors import vectors
from rps_pin.codegen.export.words import FUNCTIONS
from rps_pin.errors import InputError, MechanismError
from tests.closed_loop.random_mechanisms import pooled
from tests.programs import output_of, program
from tests.worst import worst

URDF = Path(__file__).resolve().parents[2] / "urdf"
STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror")
SANITIZED = ("-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
LINE = r"^ok +(\w+) +(\d+) states, at most ([\d.]+) of the accepted difference"


def exported(folder: Path, name: str, **options: object) -> Package:
    mechanism = ClosedLoopModel.load(URDF / f"{name}.yaml")
    package = mechanism_package(mechanism, name=name, **options)
    write_c_files(c_files(package), folder)
    return package


def tested(folder: Path, name: str, compiler: str, *flags: str) -> str:
    """Compile a self-test and run it; return what it prints."""
    sources = f"{name}.c", f"{name}_test.c"
    output_of(program(compiler), *STRICT, *flags, *sources, "-o", "self_test", "-lm", folder=folder)
    return output_of("./self_test", folder=folder)


def shares(printed: str) -> dict[str, float]:
    """Return the share of the accepted difference by function."""
    return {name: float(share) for name, _, share in re.findall(LINE, printed, re.MULTILINE)}


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


# Compilers ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("compiler", "flags"), [("gcc", ("-O2",)), ("gcc", SANITIZED), ("clang", ("-O1",))]
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


@pytest.mark.parametrize("real", ["double", "float"])
def test_the_3_rps_in_c(tmp_path, real) -> None:
    exported(tmp_path, "rps", real=real)
    found = shares(tested(tmp_path, "rps", "gcc", "-O1"))
    assert len(found) == 15
    assert worst(*found.values()) < 0.5


@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize(("seed", "planar"), [(5, False), (4, True)])
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


@pytest.mark.parametrize("change", ["answer", "status", "argument"])
def test_the_self_test_sees_what_is_wrong(tmp_path, change) -> None:
    exported(tmp_path, "four_bar", functions=["inverse_dynamics", "velocity"])
    file = tmp_path / ("four_bar.c" if change == "status" else "four_bar_test.c")
    text = file.read_text("utf-8")
    if change == "status":
        text = text.replace("    return status;", "    return 0;")
    else:
        name = "wanted_tau" if change == "answer" else "given_a"
        number = re.search(rf"{name}\[\d\]\[\d\] = {{\n    {{([^,}}]+)", text)
        begin, end = number.span(1)
        text = f"{text[:begin]}{float(number[1]) * (1 + 1e-9)!r}{text[end:]}"
    file.write_text(text, "utf-8")
    with pytest.raises(AssertionError, match=r"FAILED +inverse_dynamics"):
        tested(tmp_path, "four_bar", "gcc")


# Texts --------------------------------------------------------------------------------------------


def test_the_header_tells_order_units_and_parameters(five_bar) -> None:
    package, folder = five_bar
    text = (folder / "five_bar.h").read_text("utf-8")
    for words in (
        '       0 joint "left_joint", rad\n       1 joint "left_arm_joint", rad',
        'Actuator forces tau:\n       0 joint "left_joint", N m',
        '0 closure "tips" (spherical), row 0, in world axes, m',
        "Gravity is among the parameters.",
        '2 force z at frame "left_tip", N',
        "#define FIVE_BAR_NQ 4 ",
        "#define FIVE_BAR_NC 3 ",
        "#define FIVE_BAR_NP 4 ",
        "#define FIVE_BAR_OPEN 2 ",
        '-9.81, /* 2 "gravity[2]" */',
        "-> jacobian (6 x 2): takes u to linear",
        f"const {package.real} q[4]",
    ):
        assert words in text
    page = (folder / "README.md").read_text("utf-8")
    assert '| 3 | "mass:left_arm_joint' in page
    for file in folder.glob("*.[chm]*"):
        lines = file.read_text("utf-8").splitlines()
        assert all(line.isascii() for line in lines)
        assert "written by rps-pin export c" in lines[0]


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


@pytest.mark.parametrize("name", ["a*/b", "/*", "??/", "é\n", 'quote"', "back\\slash", "`|<"])
def test_a_quoted_name_is_one_ascii_line_without_marks(name) -> None:
    text = quoted(name)
    assert text.isascii()
    assert text.isprintable()
    assert not set("*?`|<") & set(text)


@pytest.mark.parametrize(
    ("names", "made"),
    [(["Five bar!"], "five_bar"), (["3-RPS", "rps"], "rps"), (["A--B_c"], "a_b_c")],
)
def test_identifiers(names, made) -> None:
    assert identifier(*names) == made


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("", "has no letter"),
        ("éü", "has no letter"),
        ("3-RPS", "begins with a digit"),
        ("double", "a keyword"),
        ("Math", "one of C's own headers"),
        ("x" * 40, "40 characters"),
    ],
)
def test_names_that_cannot_be_identifiers_are_refused(name, reason) -> None:
    with pytest.raises(InputError, match=reason):
        identifier(name)


def test_vectors_of_all_joints_have_words() -> None:
    model = pin.Model()
    kinds = [
        pin.JointModelRX(),
        pin.JointModelPY(),
        pin.JointModelRUBZ(),
        pin.JointModelSpherical(),
        pin.JointModelFreeFlyer(),
        pin.JointModelPlanar(),
        pin.JointModelTranslation(),
        pin.JointModelSphericalZYX(),
        pin.JointModelUniversal(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])),
    ]
    for i, kind in enumerate(kinds):
        joint = model.addJoint(i, kind, pin.SE3.Identity(), f"j{i}")
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    found = vectors(ClosedLoopModel(model, [], ["j0"]))
    assert len(found.q) == model.nq
    assert len(found.v) == model.nv
    assert len({entry.what for entry in found.q}) == model.nq
    assert len({entry.what for entry in found.v}) == model.nv
    units = "".join(entry.unit[0] for entry in found.q)
    assert units == "rm111111mmm1111mm11mmmrrrrr"
    assert found.tau == (('joint "j0"', "N m"),)


def test_a_condition_number_is_that_of_a_linear_function() -> None:
    matrix = np.array([[1.0, -2.0], [3.0, 0.5]])
    x, size = np.array([4.0, -1.0]), np.array([4.0, 2.0])
    (found,) = conditions(lambda given: [matrix @ given[0]], [x], [size])
    expected = np.abs(matrix @ x) + np.abs(matrix) @ size
    assert worst(found - expected) < 1e-8
    (found,) = conditions(lambda given: [matrix @ given[0]], [x], [np.zeros(2)])
    assert worst(found - np.abs(matrix @ x)) == 0.0


# Files --------------------------------------------------------------------------------------------


def test_files_of_others_are_not_replaced(tmp_path) -> None:
    package = exported(tmp_path, "four_bar", functions=["gaps"])
    texts = c_files(package)
    write_c_files(texts, tmp_path)  # again: ours
    for name in texts:
        (tmp_path / name).write_text("mine")
        with pytest.raises(InputError, match=f"{name}: there already, and not written by"):
            write_c_files(dict.fromkeys(texts, "new"), tmp_path)
        assert (tmp_path / name).read_text() == "mine"
        assert all((tmp_path / one).read_text() != "new" for one in texts)
        write_c_files(texts, tmp_path, overwrite=True)
        assert (tmp_path / name).read_text("utf-8") == texts[name]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(texts)


def test_nothing_is_written_where_that_cannot_be(tmp_path) -> None:
    package = exported(tmp_path / "a", "four_bar", functions=["gaps"])
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        write_c_files(c_files(package), tmp_path / "file")
    (tmp_path / "b" / "four_bar.h").mkdir(parents=True)
    with pytest.raises(InputError, match="there already"):
        write_c_files(c_files(package), tmp_path / "b")


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"real": "half"}, InputError, "real"),
        ({"functions": ["inverse_dynamic"]}, InputError, "did you mean inverse_dynamics"),
        ({"frames": ["nowhere"]}, MechanismError, "nowhere"),
        ({"wrench_frames": ["nowhere"]}, MechanismError, "nowhere"),
        ({"parameters": ["mass:nowhere"]}, InputError, "nowhere"),
        ({"name": "1"}, InputError, "begins with a digit"),
    ],
)
def test_bad_input_is_refused(options, error, words) -> None:
    mechanism = ClosedLoopModel.load(URDF / "four_bar.yaml")
    with pytest.raises(error, match=words):
        mechanism_package(mechanism, **options)


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
