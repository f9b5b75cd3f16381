"""Exported C: its texts, names in it, and files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel
from rps_pin.codegen.export.c_files import c_files, write_c_files
from rps_pin.codegen.export.mechanism import mechanism_package
from rps_pin.codegen.export.names import identifier, quoted
from rps_pin.codegen.export.package import Package, conditions
from rps_pin.codegen.export.vectors import vectors
from rps_pin.errors import InputError, MechanismError
from tests.codegen.exported import URDF, exported
from tests.worst import worst


@pytest.fixture(scope="module", params=["double", "float"])
def five_bar(request, tmp_path_factory) -> tuple[Package, Path]:
    """All functions, with parameters, a wrench and a frame."""
    folder = tmp_path_factory.mktemp("five_bar")
    package = exported(
        folder,
        "five_bar",
        real=request.param,
        functions=["gaps", "inverse_dynamics"],
        frames=["right_tip"],
        parameters=["gravity", "mass:left_arm_joint"],
        wrench_frames=["left_tip"],
    )
    return package, folder


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
