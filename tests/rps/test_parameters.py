"""Parameters: what is legal, what is refused and how, and files that lose nothing."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rps_pin import InputError, ParameterError, RPSParameters
from rps_pin.rps.parameters import BODIES, INERTIA_ROUNDING
from tests import strategies
from tests.each import each

#: A legal robot with masses everywhere, and nothing at its default.
LEGAL = {
    "name": "legal",
    "base_radius": 0.46,
    "platform_radius": 0.23,
    "platform_mass": 0.18,
    "platform_inertia": [[0.09, 0.01, 0.0], [0.01, 0.1, 0.0], [0.0, 0.0, 0.15]],
    "leg_mass": 0.09,
    "leg_com": 0.2,
    "leg_inertia": 0.05,
    "leg_inertia_about": "com",
    "rod_mass": 0.1,
    "rod_com": 0.1,
    "rod_inertia": 0.01,
    "leg_length_limits": (0.2, 0.5),
    "leg_angle_limits": (0.1, 2.0),
    "spherical_cone_limit": 1.0,
    "spherical_rest_angle": 0.3,
    "actuator_force_limit": 50.0,
    "actuator_speed_limit": 0.5,
    "gravity": [0.0, 0.0, -1.62],
    "prismatic_damping": 12.0,
    "prismatic_friction": 3.0,
    "revolute_damping": 0.2,
    "revolute_friction": 0.1,
    "friction_speed": 0.02,
}
FLOATS = [name for name, value in LEGAL.items() if isinstance(value, float)]
ARRAYS = {"platform_inertia": (3, 3), "gravity": (3,)}
PAIRS = ["leg_length_limits", "leg_angle_limits"]
REQUIRED = [
    "base_radius",
    "platform_radius",
    "platform_mass",
    "platform_inertia",
    "leg_mass",
    "leg_com",
    "leg_inertia",
]


def legal(**changes: object) -> RPSParameters:
    return RPSParameters(**(LEGAL | changes))


def refused(field: str, value: object, rule: str = ".") -> ParameterError:
    """Check that a value is refused with an error that names field, value and rule."""
    with pytest.raises(ParameterError, match=rule) as caught:
        legal(**{field: value})
    error = caught.value
    assert error.field == field
    assert error.value is value or repr(error.value) == repr(value)
    assert error.rule
    assert str(error) == f"{field} = {error.value!r}: {error.rule}"
    return error


def test_these_tests_know_every_field() -> None:
    assert LEGAL.keys() == RPSParameters.model_fields.keys()
    words = {"name", "leg_inertia_about"}
    assert {*FLOATS, *ARRAYS, *PAIRS, *words} == LEGAL.keys()
    required = {name for name, info in RPSParameters.model_fields.items() if info.is_required()}
    assert required | {*BODIES} == set(REQUIRED)  # those of bodies all together, or none
    changed = RPSParameters(**{name: LEGAL[name] for name in REQUIRED})
    for field in LEGAL.keys() - set(REQUIRED):
        assert repr(getattr(changed, field)) != repr(getattr(legal(), field)), field


def test_every_field_has_its_meaning_written_beside_it() -> None:
    assert all(info.description for info in RPSParameters.model_fields.values())


# Table 1 ------------------------------------------------------------------------------------------


def test_sokolov_has_the_values_of_table_1() -> None:
    p = RPSParameters.from_preset("sokolov")
    assert (p.base_radius, p.platform_radius) == (0.460, 0.230)
    assert (p.platform_mass, p.leg_mass, p.leg_com, p.leg_inertia) == (0.18, 0.09, 0.2, 0.05)
    np.testing.assert_array_equal(p.platform_inertia, np.diag([0.093, 0.093, 0.187]))
    assert (p.rod_mass, p.rod_com, p.rod_inertia) == (0, 0, 0)
    assert p.leg_inertia_about == "joint"
    np.testing.assert_array_equal(p.gravity, [0, 0, -9.81])


def test_micro_has_the_workspace_study_s_geometry() -> None:
    p = RPSParameters.from_preset("micro")
    assert p.platform_radius == 0.120
    assert p.leg_length_limits == (0.200, 0.250)


def test_every_preset_loads_and_bears_its_name() -> None:
    assert RPSParameters.presets() == ("micro", "sokolov")
    for name in RPSParameters.presets():
        assert RPSParameters.from_preset(name).name == name


@pytest.mark.parametrize("name", ["nobody", "", "../presets/micro", "micro.yaml"])
def test_unknown_preset_is_refused_with_those_there_are(name: str) -> None:
    with pytest.raises(InputError, match=r"no preset .*; there are: micro, sokolov"):
        RPSParameters.from_preset(name)


# Immutability and equality ------------------------------------------------------------------------


@each("field", LEGAL)
def test_fields_cannot_be_assigned(field: str) -> None:
    p = legal()
    with pytest.raises(ValueError, match="frozen"):
        setattr(p, field, getattr(p, field))


@pytest.mark.parametrize("field", ARRAYS)
def test_arrays_are_read_only_copies(field: str) -> None:
    given_array = np.array(LEGAL[field])
    p = legal(**{field: given_array})
    with pytest.raises(ValueError, match="read-only"):
        getattr(p, field)[0] = 1.0
    before = getattr(p, field).copy()
    given_array[0] = 1.0
    np.testing.assert_array_equal(getattr(p, field), before)


def test_the_default_gravity_cannot_be_changed_for_everyone() -> None:
    with pytest.raises(ValueError, match="read-only"):
        RPSParameters.from_preset("sokolov").gravity[2] = 0.0


@given(strategies.parameters())
def test_equal_parameters_are_equal_and_hash_alike(p: RPSParameters) -> None:
    twin = p.replace()
    assert twin == p
    assert twin is not p
    assert hash(twin) == hash(p)
    assert {p: 1}[twin] == 1


def test_zeros_of_either_sign_are_equal_and_hash_alike() -> None:
    one, other = legal(rod_com=0.0), legal(rod_com=-0.0)
    assert one == other
    assert hash(one) == hash(other)


@pytest.mark.parametrize(
    "twin", [copy.copy, copy.deepcopy, lambda p: pickle.loads(pickle.dumps(p))]
)
def test_copies_are_equal_and_read_only_too(twin: Callable[[RPSParameters], RPSParameters]) -> None:
    """Such as those that a pool of processes makes."""
    p = twin(legal())
    assert p == legal()
    for field in ARRAYS:
        with pytest.raises(ValueError, match="read-only"):
            getattr(p, field)[0] = 1.0


DIFFERENT = {
    "name": "other",
    "platform_inertia": np.diag([0.1, 0.1, 0.1]),
    "leg_inertia_about": "joint",
    "leg_length_limits": (0.2, 0.6),
    "leg_angle_limits": (0.1, 2.1),
    "gravity": [0.0, 0.1, -1.62],
}


@each("field", LEGAL)
def test_parameters_that_differ_in_one_field_are_not_equal(field: str) -> None:
    other = DIFFERENT[field] if field in DIFFERENT else np.nextafter(LEGAL[field], np.inf)
    assert legal(**{field: other}) != legal()


def test_parameters_equal_no_other_type() -> None:
    assert legal() != "legal"
    assert legal() != LEGAL


def test_replace_changes_what_it_is_told_and_nothing_else() -> None:
    changed = legal().replace(rod_mass=0.7)
    assert changed == legal(rod_mass=0.7)
    assert legal().rod_mass == 0.1


def test_replace_validates_anew() -> None:
    with pytest.raises(ParameterError, match="rod_mass = -1"):
        legal().replace(rod_mass=-1.0)
    with pytest.raises(ParameterError, match="a rod without mass has no inertia"):
        legal().replace(rod_mass=0.0)
    with pytest.raises(ParameterError, match="unknown field"):
        legal().replace(rod_length=1.0)


# Bad values ---------------------------------------------------------------------------------------


@each("field", FLOATS)
@each("bad", [math.nan, "0.1 m", None, [0.1], True, False, 1j])
def test_floats_that_are_no_numbers_are_refused(field: str, bad: object) -> None:
    refused(field, bad)


@each("field", FLOATS)
def test_numbers_written_as_strings_are_refused(field: str) -> None:
    """YAML's quoted "0.1" is a mistake, not a number."""
    refused(field, "0.1")


@each(
    "field",
    sorted({*FLOATS} - {"spherical_cone_limit", "actuator_force_limit", "actuator_speed_limit"}),
)
@each("bad", [math.inf, -math.inf])
def test_infinite_sizes_and_masses_are_refused(field: str, bad: float) -> None:
    refused(field, bad)


@each("field", ["base_radius", "platform_radius", "platform_mass", "friction_speed"])
@each("bad", [0.0, -0.1])
def test_what_must_exist_is_positive(field: str, bad: float) -> None:
    refused(field, bad, "greater than 0")


@pytest.mark.parametrize("field", ["leg_mass", "leg_com", "leg_inertia", "rod_mass", "rod_inertia"])
def test_masses_and_inertias_are_not_negative(field: str) -> None:
    refused(field, -1e-12, "greater than or equal to 0")


@pytest.mark.parametrize("joint", ["prismatic", "revolute"])
@pytest.mark.parametrize("kind", ["damping", "friction"])
def test_friction_is_none_unless_given_and_never_negative(joint: str, kind: str) -> None:
    for preset in RPSParameters.presets():
        assert getattr(RPSParameters.from_preset(preset), f"{joint}_{kind}") == 0
    refused(f"{joint}_{kind}", -1e-12, "greater than or equal to 0")


@pytest.mark.parametrize(
    "field", ["spherical_cone_limit", "actuator_force_limit", "actuator_speed_limit"]
)
@pytest.mark.parametrize("bad", [0.0, -1.0])
def test_bounds_leave_something(field: str, bad: float) -> None:
    refused(field, bad, "greater than 0")


@pytest.mark.parametrize("field", ARRAYS)
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_arrays_are_finite(field: str, bad: float) -> None:
    for entry in np.ndindex(ARRAYS[field]):
        value = np.array(LEGAL[field])
        value[entry] = bad
        refused(field, value, "finite")


@each("field", ARRAYS)
@each("bad", [0.1, [0.1, 0.1], np.eye(4), np.eye(3)[None], "full", None, [[1], [1, 2]]])
def test_arrays_have_their_shape(field: str, bad: object) -> None:
    refused(field, bad, r"shape|numbers")


@pytest.mark.parametrize("field", ARRAYS)
@pytest.mark.parametrize("bad", [True, "1"])
def test_arrays_hold_numbers(field: str, bad: object) -> None:
    value = np.array(LEGAL[field]).astype(object)
    value[(2,) * value.ndim] = bad
    refused(field, value.tolist())


@each("field", PAIRS)
@each(
    "bad",
    [(0.5, 0.2), (0.3, 0.3), (math.nan, 0.5), (0.2, math.nan), 0.5, (0.5,), (0.1, 0.2, 0.3), None],
)
def test_limits_that_are_no_interval_are_refused(field: str, bad: object) -> None:
    with pytest.raises(ParameterError) as caught:
        legal(**{field: bad})
    assert caught.value.field == field


@each("field", PAIRS)
@each("bad", [("0.2", 0.5), (False, 0.5), (0.2, True), ("a", "b")])
def test_limits_hold_numbers(field: str, bad: object) -> None:
    with pytest.raises(ParameterError) as caught:
        legal(**{field: bad})
    assert caught.value.field == field


def test_lengths_are_not_negative() -> None:
    refused("leg_length_limits", (-0.1, 0.5), "negative")


@pytest.mark.parametrize("bad", [(-3.2, 0.0), (0.0, 3.2), (0.0, math.inf)])
def test_angles_are_within_a_turn(bad: tuple[float, float]) -> None:
    refused("leg_angle_limits", bad, "between -pi and pi")


@pytest.mark.parametrize("sign", [-1, 1])
def test_rest_axis_is_within_half_a_turn_of_the_normal(sign: int) -> None:
    assert legal(spherical_rest_angle=sign * math.pi).spherical_rest_angle == sign * math.pi
    refused("spherical_rest_angle", sign * np.nextafter(math.pi, 4), "or equal to -?3.14")


def test_rest_axis_is_the_platform_s_normal_unless_told() -> None:
    for name in RPSParameters.presets():
        assert RPSParameters.from_preset(name).spherical_rest_angle == 0


@each("bad", ["", "3rps", "a b", "a/b", "a\n", "<robot>", 7, None, "ä"])
def test_names_are_plain(bad: object) -> None:
    refused("name", bad)


@pytest.mark.parametrize("bad", ["tip", "", None, 1])
def test_leg_inertia_is_about_joint_or_com(bad: object) -> None:
    refused("leg_inertia_about", bad, "'joint' or 'com'")


@pytest.mark.parametrize("field", REQUIRED)
def test_missing_fields_are_named(field: str) -> None:
    values = {name: value for name, value in LEGAL.items() if name != field}
    with pytest.raises(ParameterError, match=f"{field} = None: is required") as caught:
        RPSParameters(**values)
    assert caught.value.field == field


def test_misspelt_fields_are_named_before_those_that_are_missing(tmp_path: Path) -> None:
    text = MINIMAL.replace("platform_radius", "platform_raduis")
    with pytest.raises(ParameterError, match=r"did you mean platform_radius\?") as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'robot.yaml'}, line 2: platform_raduis = ")


def test_unknown_fields_are_refused_with_those_there_are() -> None:
    error = None
    with pytest.raises(ParameterError, match="unknown field; the fields are") as caught:
        legal(rod_length=0.5)
    error = caught.value
    assert (error.field, error.value) == ("rod_length", 0.5)
    assert all(field in error.rule for field in RPSParameters.model_fields)


@each("key", ["self", "values", "cls"])
def test_any_word_may_be_an_unknown_field(key: str) -> None:
    with pytest.raises(ParameterError, match=f"{key} = 1: unknown field"):
        legal(**{key: 1})


@each("value", [1e51, 1e200, 10**200])
def test_numbers_beyond_all_measure_are_refused(value: float) -> None:
    with pytest.raises(ParameterError, match=r"base_radius = 1.*no number may be beyond 1e.50"):
        legal(base_radius=value)


# Rigid bodies -------------------------------------------------------------------------------------


def turned(principal: list[float]) -> np.ndarray:
    """Full tensor with these principal moments."""
    basis, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    inertia = basis @ np.diag(principal) @ basis.T
    return (inertia + inertia.T) / 2


def test_inertia_beyond_the_triangle_inequality_is_refused() -> None:
    for inertia in (np.diag([0.093, 0.093, 0.19]), turned([1.0, 1.0, 2.03])):
        error = refused("platform_inertia", inertia, "no rigid body has it")
        assert "exceed the sum of the others" in error.rule


def test_inertia_may_miss_the_triangle_inequality_by_a_table_s_rounding() -> None:
    """Table 1: 0.187 > 0.093 + 0.093, by 0.5 percent."""
    for largest in (0.187, 0.186 / (1 - INERTIA_ROUNDING) - 1e-9):
        legal(platform_inertia=np.diag([0.093, 0.093, largest]))
    refused("platform_inertia", np.diag([0.093, 0.093, 0.186 / (1 - INERTIA_ROUNDING) + 1e-9]))


@given(st.data())
def test_inertia_of_any_set_of_points_is_legal(data: st.DataObject) -> None:
    inertia = data.draw(strategies.inertias(1.0))
    np.testing.assert_array_equal(legal(platform_inertia=inertia).platform_inertia, inertia)


def test_plates_and_bars_are_rigid_bodies() -> None:
    for principal in ([1.0, 1.0, 2.0], [1.0, 2.0, 3.0], [0.0, 1.0, 1.0]):
        inertia = turned(principal)
        np.testing.assert_array_equal(legal(platform_inertia=inertia).platform_inertia, inertia)


@pytest.mark.parametrize("entry", [(0, 1), (1, 2), (2, 0)])
def test_asymmetric_inertia_is_refused(entry: tuple[int, int]) -> None:
    inertia = np.array(LEGAL["platform_inertia"])
    inertia[entry] += 1e-6
    refused("platform_inertia", inertia, "symmetric")


@pytest.mark.parametrize("principal", [[-0.01, 0.1, 0.1], [-1.0, -1.0, -1.0], [0.0, 0.0, 0.0]])
def test_inertia_that_is_not_positive_is_refused(principal: list[float]) -> None:
    refused("platform_inertia", turned(principal), "negative" if any(principal) else "positive")


@pytest.mark.parametrize("body", ["leg", "rod"])
def test_bodies_without_mass_have_no_inertia(body: str) -> None:
    with pytest.raises(ParameterError, match="without mass has no inertia") as caught:
        legal(**{f"{body}_mass": 0.0})
    assert caught.value.field == f"{body}_inertia"
    legal(**{f"{body}_mass": 0.0, f"{body}_inertia": 0.0})


def test_inertia_about_the_joint_includes_that_of_the_mass() -> None:
    """Steiner: I_joint = I_com + m r^2, at least m r^2 = 0.0036."""
    for least in (0.09 * 0.2**2, 0.05):
        p = legal(leg_inertia_about="joint", leg_inertia=least)
        assert p.leg_inertia_about_com == pytest.approx(least - 0.0036, abs=1e-17)
    with pytest.raises(ParameterError, match="at least leg_mass") as caught:
        legal(leg_inertia_about="joint", leg_inertia=0.0035)
    assert caught.value.field == "leg_inertia"


def test_inertia_about_the_com_is_taken_as_it_is() -> None:
    assert legal(leg_inertia=0.0001).leg_inertia_about_com == 0.0001


# Files --------------------------------------------------------------------------------------------


@given(p=strategies.parameters())
@settings(max_examples=30)
def test_yaml_round_trip_is_exact(
    p: RPSParameters, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("yaml") / "robot.yaml"
    p.to_yaml(path)
    again = RPSParameters.from_yaml(path)
    assert again == p
    for field in RPSParameters.model_fields:  # not by the package's own ==
        np.testing.assert_array_equal(getattr(again, field), getattr(p, field))


def test_file_says_what_each_field_means(tmp_path: Path) -> None:
    legal().to_yaml(tmp_path / "robot.yaml")
    lines = (tmp_path / "robot.yaml").read_text("utf-8").splitlines()
    for field, info in RPSParameters.model_fields.items():
        (place,) = [i for i, line in enumerate(lines) if line.startswith(f"{field}:")]
        meaning = " ".join(str(info.description).split())
        assert lines[place - 1] == f"# {meaning}"


def test_file_of_an_unlimited_robot_reads_back(tmp_path: Path) -> None:
    p = RPSParameters.from_preset("sokolov")
    p.to_yaml(tmp_path / "robot.yaml")
    assert RPSParameters.from_yaml(str(tmp_path / "robot.yaml")) == p
    assert math.isinf(p.actuator_force_limit)


MINIMAL = """\
base_radius: 0.46
platform_radius: 0.23
platform_mass: 1
platform_inertia: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
leg_mass: 0
leg_com: 0
leg_inertia: 0
"""


def read(folder: Path, text: str | bytes) -> RPSParameters:
    path = folder / "robot.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return RPSParameters.from_yaml(path)


def test_short_file_is_enough(tmp_path: Path) -> None:
    p = read(tmp_path, MINIMAL)
    assert (p.name, p.platform_mass, p.rod_mass) == ("rps", 1.0, 0.0)


@pytest.mark.parametrize("text", ["0.001", "1e-3", "1.0E-3", "1.e-03"])
def test_numbers_may_be_written_any_way(tmp_path: Path, text: str) -> None:
    """Some YAML readers take 1e-3 for a string."""
    assert read(tmp_path, MINIMAL + f"rod_mass: {text}\n").rod_mass == 0.001


@pytest.mark.parametrize("field", ["gravity", "rod_mass", "laughs"])
def test_message_about_a_nest_of_aliases_stays_short(tmp_path: Path, field: str) -> None:
    """Ten of ten of ten...: the file is small, what it stands for is not."""
    nest = "&a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"
    for level in range(1, 5):
        nest = f"&a{level} [{nest}" + f", *a{level - 1}" * 9 + "]"
    with pytest.raises(InputError) as caught:
        read(tmp_path, MINIMAL + f"{field}: {nest}\n")
    assert len(str(caught.value)) < 2000


@each(
    ("text", "message"),
    [
        (MINIMAL + "gravity: [0, 0\nrod_mass: 1\n", "line 9"),
        (MINIMAL + "\tgravity: 1\n", "line 8"),
        (MINIMAL + "leg_mass: 1\n", 'line 8: .*duplicate key "leg_mass"'),
        (MINIMAL + "gravity: *none\n", "line 8"),
        ("- 1\n- 2\n", "must hold 'key: value' lines"),
        ("just words", "must hold 'key: value' lines"),
        ("", "must hold 'key: value' lines"),
        ("1: 2\n", "line 1: the key '1' must be text"),
        (MINIMAL + "---\n" + MINIMAL, "line 8: not valid YAML"),
        (b"\x00\x01\x02\xff\xfe", "not a UTF-8 text"),
        (b"a: \x00\n", "not valid YAML"),
    ],
)
def test_files_that_are_no_parameters_are_refused(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path, text)
    assert "robot.yaml" in str(caught.value)


@pytest.mark.parametrize(
    ("line", "field"),
    [
        ("rod_mass: yes", "rod_mass"),
        ("rod_mass: '1.0'", "rod_mass"),
        ("rod_mass: .nan", "rod_mass"),
        ("rod_mass: 1 kg", "rod_mass"),
        ("rod_mass:", "rod_mass"),
        ("rod_masss: 1", "rod_masss"),
        ("leg_length_limits: [0.5, 0.2]", "leg_length_limits"),
    ],
)
def test_bad_values_in_files_are_refused_by_field(tmp_path: Path, line: str, field: str) -> None:
    with pytest.raises(ParameterError) as caught:
        read(tmp_path, MINIMAL + line + "\n")
    assert caught.value.field == field


@pytest.mark.parametrize(
    "attack",
    [
        "name: !!python/object/apply:pathlib.Path.touch [{target}]",
        "name: !!python/object/apply:os.system ['touch {target}']",
        "name: !!python/object/new:pathlib.PosixPath ['{target}']",
        "name: !!python/name:os.system",
        "name: !!python/module:this",
    ],
)
def test_python_tags_are_refused_and_nothing_is_run(tmp_path: Path, attack: str) -> None:
    target = tmp_path / "touched"
    with pytest.raises(InputError, match="not valid YAML"):
        read(tmp_path, MINIMAL + attack.format(target=target) + "\n")
    assert not target.exists()


def test_missing_file_and_folder_are_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot read .*none\.yaml: No such file"):
        RPSParameters.from_yaml(tmp_path / "none.yaml")
    with pytest.raises(InputError, match=r"cannot read .*directory"):
        RPSParameters.from_yaml(tmp_path)


def test_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "robot.yaml"
    legal().to_yaml(path)
    before = path.read_bytes()

    def fail(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("ruamel.yaml.YAML.dump", fail)
    with pytest.raises(KeyboardInterrupt):
        legal(rod_mass=5.0).to_yaml(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
