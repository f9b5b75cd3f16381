"""Arguments of a wrong kind are told when a call fails; other errors stay as they are."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import ArrayLike

from rps_pin import RPSRobot, trajectories
from rps_pin.arrays import Array
from rps_pin.errors import InputError
from rps_pin.other_kinds import fits, refuses_other_kinds
from rps_pin.rps import check_path, size_trajectory
from rps_pin.rps.workspace import leg_grid, load_workspace, volume

FITTING = [
    (1.0, float),
    (1, float),
    (np.float64(1.0), float),
    (np.int64(1), int),
    ("a", str),
    (None, str | None),
    ("b", Literal["a", "b"]),
    ([1.0, 2.0], ArrayLike),
    (np.zeros(2), Array),
    (["a"], Sequence[str]),
    (("a", "b"), Sequence[str]),
    ({"a": 1.0}, Mapping[str, float]),
    ((1, 2.0), tuple[int, float]),
    ((1, 2, 3), tuple[int, ...]),
    (Path("a"), str | os.PathLike[str]),
    (len, Callable[[str], int]),
    (iter([1]), Iterator[str]),  # what it yields is not known before
    (object(), Any),
    (object(), "not evaluated"),
]
OTHERS = [
    (True, float),
    (1.0, int),
    ("1", float),
    (b"a", str),
    (1, str | None),
    ("c", Literal["a", "b"]),
    (1, Literal[True]),
    ([[1.0], [1.0, 2.0]], ArrayLike),
    ([1.0], Array),
    ("a", Sequence[str]),
    ([1], Sequence[str]),
    ({1: 1.0}, Mapping[str, float]),
    ({"a": "b"}, Mapping[str, float]),
    ([("a", 1.0)], Mapping[str, float]),
    ((1,), tuple[int, float]),
    (("a",), tuple[int, ...]),
    (1, str | os.PathLike[str]),
    (1, Callable[[str], int]),
    ([1], Iterator[int]),
]


def _kind_of(value: Any) -> str:
    """A name that is the same in every process."""
    return re.sub(r" at 0x[0-9a-f]+", "", str(value))


@pytest.mark.parametrize(("value", "hint"), FITTING, ids=_kind_of)
def test_what_fits_a_hint(value: Any, hint: Any) -> None:
    assert fits(value, hint)


@pytest.mark.parametrize(("value", "hint"), OTHERS, ids=_kind_of)
def test_what_does_not_fit_a_hint(value: Any, hint: Any) -> None:
    assert not fits(value, hint)


@refuses_other_kinds
def _halves(names: Sequence[str], number: float = 1.0, *, more: int | None = None) -> float:
    if names == ["fault"]:
        raise KeyError("a fault of this function")
    return number / 2 + (more or 0) / len(names)


def test_a_call_names_the_argument_and_what_it_must_be() -> None:
    assert _halves(["a", "b"], 3.0, more=4) == 3.5
    with pytest.raises(InputError, match=r"^names = 3: it must be Sequence\[str\]$") as told:
        _halves(3)  # type: ignore[arg-type]
    assert isinstance(told.value.__cause__, TypeError)
    with pytest.raises(InputError, match="more = 'x': it must be int or None"):
        _halves(["a"], more="x")  # type: ignore[arg-type]


def test_a_fault_and_wrong_counts_keep_their_errors() -> None:
    with pytest.raises(KeyError, match="a fault of this function"):
        _halves(["fault"])
    with pytest.raises(ZeroDivisionError):
        _halves([])
    with pytest.raises(TypeError, match="missing 1 required positional argument"):
        _halves()  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="unexpected keyword"):
        _halves(["a"], other=1)  # type: ignore[call-arg]


def test_methods_constructors_and_class_methods_of_a_class() -> None:
    @refuses_other_kinds
    class Thing:
        def __init__(self, size: float) -> None:
            self.size = 1 + size

        def times(self, factor: float) -> float:
            return -self.size * -factor

        @classmethod
        def of(cls, sizes: Sequence[float]) -> Thing:
            return cls(sum(sizes))

    assert Thing.of([1.0, 2.0]).times(2.0) == 8.0
    for call in (
        lambda: Thing("a"),  # type: ignore[arg-type]
        lambda: Thing(1.0).times(None),  # type: ignore[arg-type]
        lambda: Thing.of(1.0),  # type: ignore[arg-type]
    ):
        with pytest.raises(InputError, match="it must be"):
            call()


@pytest.mark.parametrize("value", [None, "micro", 1.0, [1.0], {"a": 1}, object()], ids=_kind_of)
def test_objects_of_the_package_are_asked_for(value: Any) -> None:
    robot = RPSRobot.from_preset("micro")
    circle = trajectories.circle(height=0.223, tilt=0.1, duration=1.0)
    for call in (
        lambda: size_trajectory(value, circle),
        lambda: size_trajectory(robot, value),
        lambda: check_path(value, circle),
        lambda: check_path(robot, value),
        lambda: leg_grid(value),
        lambda: volume(value),
        lambda: load_workspace([value]),  # type: ignore[arg-type]
        lambda: robot.with_payload(value) if value is not None else leg_grid(value),
    ):
        with pytest.raises(InputError):
            call()


def test_the_size_of_the_robot_may_come_from_anything_that_has_parameters() -> None:
    class Like:
        parameters = RPSRobot.from_preset("micro").parameters

    assert trajectories.helix(Like(), radius=1e-3, pitch=1e-3, height=0.22).duration > 0
    with pytest.raises(InputError, match="it must be"):
        trajectories.helix(object(), radius=1e-3, pitch=1e-3, height=0.22)  # type: ignore[arg-type]
