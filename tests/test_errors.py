"""The error hierarchy: one base class, built-in cousins, and numbers as attributes."""

from __future__ import annotations

import pickle

import pytest

from rps_pin import errors
from rps_pin.errors import LimitExcess, LimitViolation
from tests.each import each

EXAMPLES = [
    errors.RPSPinError("text"),
    errors.InputError("text"),
    errors.MechanismError("text"),
    errors.ParameterError("mass", -1.0, "must be positive"),
    errors.UnreachableError("text", [LimitViolation(2, "length", 0.261, 0.2, 0.25, "m")]),
    errors.ClosureError("text", 0.5),
    errors.SingularityError("text", 1e9, 1e8),
    errors.ThreadError("text"),
    errors.CompileError("text", "gcc version 12.2.0", "x.c:1: error: text"),
    errors.InfeasibleError("text", [LimitExcess("crank", 3.5, 2.0, "N m")]),
]


def test_every_error_class_has_an_example_here() -> None:
    classes = {
        value
        for value in vars(errors).values()
        if isinstance(value, type)
        and issubclass(value, Exception)
        and not issubclass(value, Warning)
    }
    assert {type(example) for example in EXAMPLES} == classes


@each("error", EXAMPLES, ids=lambda error: type(error).__name__)
def test_errors_share_one_base_class(error: Exception) -> None:
    assert isinstance(error, errors.RPSPinError)


@pytest.mark.parametrize(
    ("error", "builtin"),
    [
        (errors.InputError, ValueError),
        (errors.ParameterError, ValueError),
        (errors.MechanismError, ValueError),
        (errors.UnreachableError, ValueError),
        (errors.SingularityError, ArithmeticError),
    ],
)
def test_errors_are_what_python_would_raise(error: type, builtin: type) -> None:
    assert issubclass(error, builtin)


def test_parameter_and_mechanism_errors_are_input_errors() -> None:
    assert issubclass(errors.ParameterError, errors.InputError)
    assert issubclass(errors.MechanismError, errors.InputError)


def test_parameter_error_names_field_value_and_rule() -> None:
    error = errors.ParameterError("platform_mass", -1.5, "must be greater than 0")
    assert (error.field, error.value, error.rule) == (
        "platform_mass",
        -1.5,
        "must be greater than 0",
    )
    assert str(error) == "platform_mass = -1.5: must be greater than 0"


def test_limit_violation_reads_as_a_sentence() -> None:
    violation = LimitViolation(2, "length", 0.261, 0.2, 0.25, "m")
    assert str(violation) == "leg 2: length would be 0.261 m; its limits are 0.2 to 0.25 m"


def test_unreachable_error_keeps_its_violations() -> None:
    violation = LimitViolation(1, "angle", 3.0, 0.0, 1.5, "rad")
    assert errors.UnreachableError("text", [violation]).violations == (violation,)
    assert errors.UnreachableError("text").violations == ()


@each("error", EXAMPLES, ids=lambda error: type(error).__name__)
def test_errors_travel_between_processes(error: Exception) -> None:
    """Sweeps run in pools of processes, whose errors are pickled."""
    twin = pickle.loads(pickle.dumps(error))
    assert type(twin) is type(error)
    assert str(twin) == str(error)
    assert vars(twin) == vars(error)
