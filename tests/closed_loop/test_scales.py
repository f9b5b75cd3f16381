"""Answers do not depend on the units: lengths, masses and times from 1e-9 to 1e9.

Factors that are powers of two change no rounding error, so that answers agree to the last digits:
what differs is a number with a unit in the code. Powers of ten, and any, show what rounding does.
"""

from __future__ import annotations

import functools
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, ClosureError, JointEffects, LoopClosure, SingularityError
from rps_pin.closed_loop import JointMerge, merged
from rps_pin.errors import AccuracyWarning, MechanismError
from tests.closed_loop.random_mechanisms import EVERY_KIND, case
from tests.closed_loop.scaled_answers import Answer, Inputs, answers, differences
from tests.each import each
from tests.quick import quick
from tests.scaled import Units, UnitsOf, scaled_mechanism

#: Those that are not slow: plane, platform, gears, rods.
KEPT = ("five_bar.yaml", "rps.yaml", "gripper.yaml", "delta_rods.yaml")
FILES = sorted(path.name for path in (Path(__file__).parents[2] / "urdf").glob("*.yaml"))
#: 9.3e-10 and 1.07e9, and mixed: even powers, whose square roots are powers of two as well.
SMALL, LARGE = 2.0**-30, 2.0**30
TWOS = [
    Units(SMALL, SMALL, SMALL),
    Units(LARGE, LARGE, LARGE),
    Units(SMALL, LARGE, 2.0**11),
    Units(LARGE, SMALL, SMALL),
]
#: Of what ends beside a singularity or in a minimum: the square root of rounding error.
CLOSED = ("close", "project", "modes")
ROUGH = ("project", "close from afar", "modes")


def mechanism_of(name: str) -> ClosedLoopModel:
    return ClosedLoopModel.load(Path(__file__).parents[2] / "urdf" / name)


@functools.cache
def unscaled(name: str) -> tuple[ClosedLoopModel, Inputs, dict[str, Answer]]:
    mechanism = mechanism_of(name)
    inputs = Inputs(mechanism)
    return mechanism, inputs, answers(mechanism, inputs, UnitsOf(mechanism, Units(1.0, 1.0, 1.0)))


def apart(name: str, units: Units) -> dict[str, float | str]:
    mechanism, inputs, right = unscaled(name)
    other = scaled_mechanism(mechanism, units)
    found = differences(right, answers(other, inputs, UnitsOf(other, units)))
    assert len(found) > 30
    return found


@pytest.mark.parametrize("name", quick(FILES, KEPT))
def test_every_call_in_units_that_are_powers_of_two(name: str) -> None:
    for units in TWOS:
        found = apart(name, units)
        assert {k: v for k, v in found.items() if isinstance(v, str) or not v < 1e-13} == {}, units


@pytest.mark.parametrize("name", quick(FILES, KEPT))
def test_every_call_in_millimetres_and_grams(name: str) -> None:
    found = apart(name, Units(1e3, 1e3, 1.0))
    wrong = {
        k: v
        for k, v in found.items()
        if isinstance(v, str) or not v < (1e-6 if k.startswith(ROUGH) else 1e-8)
    }
    assert wrong == {}


@pytest.mark.filterwarnings("ignore::rps_pin.errors.AccuracyWarning")
@each("seed", range(2))
def test_random_mechanisms_of_every_joint_and_closure(seed: int) -> None:
    """Slides and hinges together have inertias whose ratio is a squared length."""
    mechanism = case(seed, kinds=EVERY_KIND, effects=True, armature=seed % 2 == 0).mechanism
    given = mechanism.effects
    assert given is not None
    # One speed of dry friction is of hinges and slides: a unit can be changed for one kind only.
    friction = np.where(mechanism.angular_velocities, given.friction, 0.0)
    effects = JointEffects(given.damping, friction, given.stiffness, given.rest)
    mechanism = ClosedLoopModel(
        mechanism.model,
        mechanism.closures,
        mechanism.actuated,
        home=mechanism.home,
        effects=effects,
    )
    inputs = Inputs(mechanism)
    right = answers(mechanism, inputs, UnitsOf(mechanism, Units(1.0, 1.0, 1.0)))
    for units in TWOS:
        other = scaled_mechanism(mechanism, units)
        found = differences(right, answers(other, inputs, UnitsOf(other, units)))
        # Slides and hinges change the order of pivots; and axes are rounded once more. The length
        # of an adaptive step follows from the difference of two results that are nearly equal.
        limits = dict.fromkeys(CLOSED, 1e-07) | {"simulate adaptive": 1e-9}
        wrong = {
            k: v
            for k, v in found.items()
            if isinstance(v, str)
            or not v < next((limits[one] for one in limits if k.startswith(one)), 1e-11)
        }
        assert wrong == {}, units


# Verdicts -----------------------------------------------------------------------------------------


def parallelogram(units: Units, turned: float = 0.0, longer: float = 0.0) -> ClosedLoopModel:
    """A parallelogram of plane links, one hinge of it turned, and one link longer."""
    model = pin.Model()
    length, mass = units.length, units.mass
    model.gravity.linear = np.array([0.0, 0.0, -9.81]) * units.acceleration
    tilt = pin.rpy.rpyToMatrix(turned, 0.0, 0.0)

    def add(parent: int, name: str, at: list[float], turn: np.ndarray) -> int:
        place = pin.SE3(turn, length * np.array(at))
        joint = model.addJoint(parent, pin.JointModelRY(), place, name)
        inertia = pin.Inertia(mass, length * np.array([0.2, 0.0, 0.0]), np.eye(3) * 0.01)
        inertia = pin.Inertia(mass, inertia.lever, units.inertia * 0.01 * np.eye(3))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        return int(joint)

    flat = np.eye(3)
    crank = add(0, "crank", [0.0, 0.0, 0.0], flat)
    coupler = add(crank, "coupler", [0.4, 0.0, 0.0], flat)
    rocker = add(0, "rocker", [1.0, 0.0, 0.0], tilt)
    for joint, name, at in (
        (coupler, "end", [1.0 + longer, 0.0, 0.0]),
        (rocker, "tip", [0.4, 0.0, 0.0]),
    ):
        place = pin.SE3(flat, length * np.array(at))
        model.addFrame(pin.Frame(name, joint, 0, place, pin.FrameType.OP_FRAME))
    closure = LoopClosure("end", "tip", "revolute", axis=[0.0, 1.0, 0.0])
    return ClosedLoopModel(model, [closure], ["crank"])


UNITS = [Units(1.0, 1.0, 1.0), *TWOS, Units(1e-9, 1e9, 1e9), Units(1e9, 1e-9, 1e-9)]


@each("units", UNITS)
def test_singular_configurations_are_refused_in_all_units(units: Units) -> None:
    flat = parallelogram(units)
    regular = flat.close(np.array([0.5, -0.5, 0.5]))
    tau = flat.inverse_dynamics(regular, np.zeros(3), np.zeros(3)).tau
    assert np.isfinite(tau).all()
    for near in (0.0, 1e-12, 1e-10):
        with pytest.raises(SingularityError):
            flat.inverse_dynamics(np.array([near, -near, near]), np.zeros(3), np.zeros(3))
        with pytest.raises(SingularityError):
            flat.forward_dynamics(np.array([near, -near, near]), np.zeros(3), np.zeros(1))


@each("units", UNITS)
def test_rounded_files_are_rounded_in_all_units(units: Units) -> None:
    with pytest.warns(AccuracyWarning, match="rounded"):
        rule = parallelogram(units, turned=1e-5).describe().rounding
    assert rule is not None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert parallelogram(units).describe().rounding is None


@each("units", UNITS)
def test_loops_that_cannot_close_are_refused_in_all_units(units: Units) -> None:
    long = parallelogram(units, longer=2.0)
    with pytest.raises(ClosureError) as caught:
        long.close(np.array([0.5, -0.5, 0.5]))
    assert caught.value.gap == pytest.approx(1.2 * units.length, rel=1e-3)


@each("units", UNITS)
def test_gaps_count_by_their_part_of_the_mechanism(units: Units) -> None:
    """A configuration is closed, or open, in all units; a robot of micrometres is no exception."""
    mechanism = parallelogram(units)
    q = mechanism.close(np.array([0.5, -0.5, 0.5]))
    assert mechanism.loop_gap(q) < 1e-11 * units.length
    assert mechanism.loop_gap(mechanism.close(q + 1e-7)) < 1e-11 * units.length
    with pytest.raises(ClosureError):
        mechanism.inverse_dynamics(q + np.array([1e-3, 0.0, 0.0]), np.zeros(3), np.zeros(3))
    still = np.zeros(3)
    with pytest.raises(ClosureError):
        mechanism.simulate(q + np.array([1e-6, 0, 0]), duration=units.time, step=0.1 * units.time)
    opened = np.array([1.0, 0.0, 0.0]) / units.time
    with pytest.raises(ClosureError):
        mechanism.simulate(q, opened, duration=units.time, step=0.1 * units.time)
    with pytest.raises(ClosureError):
        mechanism.acceleration(q, 1e-3 * opened, still[:1])


@each("units", UNITS)
def test_joints_that_meet_are_merged_in_all_units(units: Units) -> None:
    """Two hinges a thousandth of a link apart do not meet, however small the link is."""

    def cross(apart: float) -> pin.Model:
        model, length, mass = pin.Model(), units.length, units.mass
        inertia = pin.Inertia(mass, length * np.array([0.5, 0.1, 0.1]), units.inertia * np.eye(3))
        first = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "first")
        place = pin.SE3(np.eye(3), np.array([apart * length, 0.0, 0.0]))
        model.appendBodyToJoint(
            model.addJoint(first, pin.JointModelRY(), place, "second"), inertia, pin.SE3.Identity()
        )
        return merged(model, [JointMerge(("first", "second"), "universal", "cross")])

    assert cross(0.0).nv == cross(1e-12).nv == 2
    with pytest.raises(MechanismError, match="where they meet in a point"):
        cross(1e-3)
