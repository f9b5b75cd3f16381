"""Arguments of wrong types: each is refused with an error of `rps_pin.errors`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, ForceDistribution, RPSPinError, RPSRobot, trajectories
from rps_pin.control import ComputedTorque, Gains
from rps_pin.rps import size_trajectory


@cache
def _four_bar() -> ClosedLoopModel:
    return ClosedLoopModel.load("urdf/four_bar.yaml")


@cache
def _robot() -> RPSRobot:
    return RPSRobot.from_preset("micro")


_POSE = [0.223, 0.02, -0.01]


@cache
def _q() -> np.ndarray:
    return _four_bar().complete({"crank_joint": 1.0})


def _rebuilt(**options: Any) -> Any:
    four = _four_bar()
    given = {"actuated": four.actuated, **options}
    return ClosedLoopModel(four.model, four.closures, **given)


def _controller(**options: Any) -> Any:
    return ComputedTorque(
        _robot(), options.pop("near", _POSE), Gains.placed(15.0), compiled=False, **options
    )


def _sized(**options: Any) -> Any:
    circle = trajectories.circle(height=0.223, tilt=0.1, duration=1.0)
    return size_trajectory(_robot(), circle, **options)


def _of(value: Any) -> dict[str, Callable[[], Any]]:
    four, q, v = _four_bar(), _q(), np.zeros(3)
    return {
        "max_condition": lambda: _rebuilt(max_condition=value),
        "accuracy": lambda: _rebuilt(accuracy=value),
        "characteristic_length": lambda: _rebuilt(characteristic_length=value),
        "home": lambda: _rebuilt(home=value),
        "actuated": lambda: _rebuilt(actuated=value),
        "one actuated": lambda: _rebuilt(actuated=[value]),
        "with_actuated": lambda: four.with_actuated([value]),
        "without_closures": lambda: four.without_closures([value]),
        "rows": lambda: four.rows(value),
        "values": lambda: four.complete({value: 1.0} if _hashable(value) else value),
        "value": lambda: four.complete({"crank_joint": value}),
        "fixed": lambda: four.close(q, fixed=[value]),
        "independent": lambda: four.motion_basis(q, [value]),
        "frame": lambda: four.frame_placement(q, value),
        "axes": lambda: four.frame_jacobian(q, "coupler", axes=value),
        "wrenches": lambda: four.inverse_dynamics(q, v, v, wrenches=value),
        "wrench": lambda: four.inverse_dynamics(q, v, v, wrenches={"coupler": value}),
        "frame of a wrench": lambda: four.generalised_force(
            q, v, v, wrenches={value if _hashable(value) else 0: np.zeros(6)}
        ),
        "duration": lambda: four.simulate(q, duration=value),
        "step": lambda: four.simulate(q, duration=0.01, step=value),
        "method": lambda: four.simulate(q, duration=0.01, method=value),
        "weights": lambda: ForceDistribution(four, weights=value),
        "torque_limits": lambda: ForceDistribution(four, torque_limits=value),
        "closure_at": lambda: four.closure_at(q, value),
        "near": lambda: _controller(near=value),
        "force_limit": lambda: _controller(force_limit=value),
        "near_singular": lambda: _controller(near_singular=value),
        "stop_singular": lambda: _controller(stop_singular=value),
        "period": lambda: _controller(period=value),
        "cut_off": lambda: _controller(cut_off=value),
        "largest_jump": lambda: _controller(largest_jump=value),
        "most_lost": lambda: _controller(most_lost=value),
        "threshold": lambda: _sized(threshold=value),
        "sample_rate": lambda: _sized(sample_rate=value),
        "wrench of a robot": lambda: _sized(wrench=value),
        "robot's q": lambda: _robot().inverse_dynamics(value, np.zeros(12), np.zeros(12)),
        "parameters": lambda: RPSRobot(value),
    }


def _hashable(value: Any) -> bool:
    try:
        hash(value)
    except TypeError:
        return False
    return True


#: None is left out where it means the default.
NONE_IS_DEFAULT = {
    "accuracy",
    "characteristic_length",
    "home",
    "wrenches",
    "force_limit",
    "largest_jump",
    "weights",
    "torque_limits",
    "wrench of a robot",
    "step",
}
VALUES = {
    "None": None,
    "text": "abc",
    "a complex number": 1j,
    "a dictionary": {"a": 1.0},
    "ragged": [[1.0], [2.0, 3.0]],
    "an object": object(),
    "NaN": float("nan"),
    "bytes": b"abc",
    "a type": float,
}


@pytest.mark.parametrize("name", _of(None))
def test_values_of_wrong_types_are_refused_in_words(name: str) -> None:
    taken = []
    for kind, value in VALUES.items():
        if value is None and name in NONE_IS_DEFAULT:
            continue
        try:
            _of(value)[name]()
        except RPSPinError as error:
            assert str(error)
        except Exception as error:
            taken.append(f"{kind}: {type(error).__name__}: {error}")
        else:
            taken.append(f"{kind}: taken")
    assert not taken
