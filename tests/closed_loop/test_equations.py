"""The gaps of the loops, their rates and their rows."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, InputError, JointCoupling, LoopClosure, MechanismError
from tests.closed_loop import mechanisms
from tests.closed_loop.mechanisms import (
    FOUR_BAR,
    closed_guess,
    derivative,
    joint,
    link,
    robot,
    second_derivative,
    spherical,
    three_rps,
    values,
)
from tests.closed_loop.random_mechanisms import EVERY_KIND, case, worst_error

Array = NDArray[np.float64]


@pytest.mark.parametrize("make", [spherical, mechanisms.spatial_four_bar, three_rps])
def test_rates_of_open_gaps_are_their_derivatives(make) -> None:
    """Any configuration, any motion: the tree swings freely."""
    mechanism = make()
    model = mechanism.model
    rng = np.random.default_rng(4)
    q = pin.normalize(model, rng.normal(size=model.nq))
    v, a = rng.normal(size=(2, model.nv))

    def gap(t: float) -> Array:
        # To second order this is the motion with this velocity and acceleration.
        return mechanism.loop_errors(pin.integrate(model, q, v * t + a * t**2 / 2)).position

    errors = mechanism.loop_errors(q, v, a)
    np.testing.assert_allclose(errors.velocity, derivative(gap), rtol=0, atol=1e-9)
    np.testing.assert_allclose(errors.acceleration, second_derivative(gap), rtol=0, atol=1e-7)


@pytest.mark.parametrize("row", range(9))
def test_a_gap_that_is_no_number_is_the_largest(row: int) -> None:
    """In whichever closure: Python's `max` keeps one in the first closure only."""
    equations = three_rps().system.equations
    gaps = np.ones(9)
    assert equations.largest_gap(gaps) == pytest.approx(np.sqrt(3))
    gaps[row] = np.nan
    assert np.isnan(equations.largest_gap(gaps))


def two_bodies() -> ClosedLoopModel:
    """Two free bodies, welded at odd places and orientations, and a turntable to drive."""
    return ClosedLoopModel.from_urdf(
        robot(
            link("one", 1.0, "0 0 0", 0.1),
            link("two", 1.0, "0 0 0", 0.1),
            link("one_end"),
            link("two_end"),
            joint("floating", "base", "one"),
            joint("floating", "base", "two"),
            joint("fixed", "one", "one_end", "0.1 0.2 0.3"),
            joint("fixed", "two", "two_end", "-0.3 0.2 0.1"),
        ),
        [LoopClosure("one_end", "two_end", "rigid", name="weld")],
        ["one_joint"],
    )


def test_rates_of_a_rigid_closure_are_its_gap_s_derivatives() -> None:
    """From a closed configuration, moving apart in every direction; turning together."""
    mechanism = two_bodies()
    model = mechanism.model
    rng = np.random.default_rng(5)
    q = mechanism.close(pin.normalize(model, rng.normal(size=model.nq)))
    apart, a = rng.normal(size=(2, model.nv))

    def gap(t: float, v: Array) -> Array:
        return mechanism.loop_errors(pin.integrate(model, q, v * t + a * t**2 / 2)).position

    errors = mechanism.loop_errors(q, apart, a)
    np.testing.assert_allclose(
        errors.velocity, derivative(lambda t: gap(t, apart)), rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        errors.acceleration[:3], second_derivative(lambda t: gap(t, apart))[:3], rtol=0, atol=1e-7
    )
    together = mechanism.velocity(q, rng.normal(size=6))
    errors = mechanism.loop_errors(q, together, a)
    np.testing.assert_allclose(
        errors.acceleration, second_derivative(lambda t: gap(t, together)), rtol=0, atol=1e-7
    )


def test_rates_are_zero_if_left_out() -> None:
    mechanism = spherical()
    errors = mechanism.loop_errors(closed_guess(mechanism) + 0.1)
    assert np.abs(errors.position).max() > 1e-3
    assert not errors.velocity.any()
    assert not errors.acceleration.any()


def test_rows_are_those_of_the_closures_in_order() -> None:
    mechanism = three_rps()
    assert mechanism.constraint_size == 9
    assert [mechanism.rows(f"leg_{i}") for i in (1, 2, 3)] == [
        slice(0, 3),
        slice(3, 6),
        slice(6, 9),
    ]
    with pytest.raises(MechanismError, match="no closure 'leg_4'; there are: leg_1, leg_2, leg_3"):
        mechanism.rows("leg_4")


def test_gap_of_a_rigid_closure_counts_its_angle_at_the_characteristic_length() -> None:
    mechanism = FOUR_BAR.mechanism(characteristic_length=0.7)
    q = values(mechanism, FOUR_BAR.joint_values(1.0))
    names = list(mechanism.model.names)[1:]
    q[names.index("knee_joint")] += 0.01
    assert mechanism.loop_gap(q) == pytest.approx(0.007, rel=1e-12)


# Every kind ---------------------------------------------------------------------------------------

every_kind = pytest.mark.parametrize("kind", EVERY_KIND)


@every_kind
@pytest.mark.parametrize("seed", range(3))
def test_rates_of_every_kind_are_the_gaps_derivatives(kind: str, seed: int) -> None:
    """Along a motion that stays closed to second order."""
    c = case(seed, kinds=[kind])

    def gap(t: float) -> Array:
        q = pin.integrate(c.mechanism.model, c.q, t * c.v + t**2 / 2 * c.a)
        return c.mechanism.loop_errors(q).position

    np.testing.assert_allclose(derivative(gap), 0, rtol=0, atol=1e-9 * (1 + np.abs(c.v).max()))
    size = 1 + np.abs(c.a).max() + np.abs(c.v).max() ** 2
    np.testing.assert_allclose(second_derivative(gap), 0, rtol=0, atol=1e-7 * size)


@every_kind
@pytest.mark.parametrize("seed", range(3))
def test_rates_of_every_kind_are_those_of_opening_gaps(kind: str, seed: int) -> None:
    """From a closed configuration, moving apart in every direction."""
    c = case(seed, kinds=[kind])
    v = np.random.default_rng(seed).normal(size=c.mechanism.model.nv)

    def gap(t: float) -> Array:
        return c.mechanism.loop_errors(pin.integrate(c.mechanism.model, c.q, t * v)).position

    found = c.mechanism.loop_errors(c.q, v).velocity
    assert np.abs(found).max() > 1e-3
    assert worst_error(found, derivative(gap)) < 1e-9


@pytest.mark.parametrize(
    "kind",
    ["point_on_line", "point_on_plane", "distance", "coupling", "polynomial", "differential"],
)
def test_rows_of_points_and_couplings_are_exact_where_loops_are_open(kind: str) -> None:
    c = case(0, kinds=[kind], joints=["revolute", "prismatic"])
    rng = np.random.default_rng(0)
    model = c.mechanism.model
    q, v, a = c.q + 0.3 * rng.normal(size=model.nq), *rng.normal(size=(2, model.nv))
    own = c.mechanism.rows(c.mechanism.closures[0].name)

    def gap(t: float) -> Array:
        return c.mechanism.loop_errors(q + t * v + t**2 / 2 * a).position[own]

    errors = c.mechanism.loop_errors(q, v, a)
    np.testing.assert_allclose(errors.velocity[own], derivative(gap), rtol=0, atol=1e-8)
    np.testing.assert_allclose(errors.acceleration[own], second_derivative(gap), rtol=0, atol=1e-6)


def couplings(**options: object) -> ClosedLoopModel:
    """A hinge, a slider and a hinge; the slider is tied to the first, the last to the slider."""
    urdf = robot(
        link("one", 1.0, "0.1 0 0", 0.1),
        link("two", 1.0, "0.1 0 0", 0.1),
        link("three", 1.0, "0.1 0 0", 0.1),
        joint("revolute", "base", "one"),
        joint("prismatic", "one", "two", axis="1 0 0"),
        joint("revolute", "two", "three"),
    )
    ties = [
        JointCoupling("two_joint", "one_joint", 0.05, 0.2, name="screw"),
        JointCoupling("three_joint", "two_joint", -4.0, name="rack"),
    ]
    return ClosedLoopModel.from_urdf(urdf, ties, ["one_joint"], **options)


def test_couplings_alone_make_a_mechanism() -> None:
    """q_2 = 0.05 q_1 + 0.2, q_3 = -4 q_2; rates likewise, without offsets."""
    mechanism = couplings()
    np.testing.assert_array_equal(mechanism.jacobian(np.ones(3)), [[-0.05, 1, 0], [0, 4, 1]])
    q = mechanism.complete([2.0])
    np.testing.assert_allclose(q, [2, 0.3, -1.2], rtol=0, atol=1e-12)
    v = mechanism.velocity(q, [3.0])
    np.testing.assert_allclose(v, [3, 0.15, -0.6], rtol=0, atol=1e-14)
    errors = mechanism.loop_errors([1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [2.0, 0.0, 1.0])
    np.testing.assert_allclose(errors.position, [0.75, 5], rtol=0, atol=1e-15)
    np.testing.assert_allclose(errors.velocity, [0.95, 5], rtol=0, atol=1e-15)
    np.testing.assert_allclose(errors.acceleration, [-0.1, 1], rtol=0, atol=1e-15)


def test_couplings_exert_what_their_name_says() -> None:
    """Weightless: only the last joint's inertia pulls, through rack and screw on the first."""
    mechanism = couplings(gravity=(0.0, 0.0, 0.0))
    q = mechanism.complete([0.5])
    v = mechanism.velocity(q, [0.0])
    a = mechanism.acceleration(q, v, [1.0])
    found = mechanism.inverse_dynamics(q, v, a)
    rest = pin.rnea(mechanism.model, mechanism.model.createData(), q, v, a)
    rack = rest[2]  # of the rack, on joint three
    screw = rest[1] - 4.0 * rack  # of the screw, on joint two, which bears the rack's reaction
    np.testing.assert_allclose(found.constraint_forces, [screw, rack], rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.tau, [rest[0] + 0.05 * screw], rtol=0, atol=1e-13)
    assert mechanism.closure_wrenches(q, found.constraint_forces) == {}


def test_gaps_of_couplings_count_in_metres() -> None:
    """Of a turning joint with the characteristic length as lever, of a sliding one as they are."""
    mechanism = couplings(characteristic_length=0.5)
    assert mechanism.loop_gap([0.0, 0.2, -0.8 + 0.01]) == pytest.approx(0.005, rel=1e-10)
    assert mechanism.loop_gap([0.0, 0.21, -0.84]) == pytest.approx(0.01, rel=1e-10)


def test_world_may_be_either_side_of_a_closure() -> None:
    """Frame a or frame b: the gap's sign and axes change, not the mechanism."""
    c = case(4, kinds=["spherical"], joints=["revolute"])
    model = c.mechanism.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, c.q)
    at = data.oMf[model.getFrameId("body_2")].translation
    model.addFrame(pin.Frame("nail", 0, 0, pin.SE3(np.eye(3), at.copy()), pin.FrameType.OP_FRAME))
    for pair in (("nail", "body_2"), ("body_2", "nail")):
        nailed = ClosedLoopModel(model, [LoopClosure(*pair)], [model.names[1]])
        assert nailed.loop_gap(c.q) < 1e-15
        sign = 1.0 if pair[0] == "body_2" else -1.0
        pin.computeJointJacobians(model, data, c.q)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        expected = pin.getFrameJacobian(model, data, model.getFrameId("body_2"), axes)[:3]
        found = nailed.jacobian(c.q)
        np.testing.assert_allclose(found, sign * expected, rtol=0, atol=1e-14)


def test_names_of_closures_may_not_come_twice() -> None:
    with pytest.raises(MechanismError, match="closure 'screw' is named twice"):
        ClosedLoopModel(
            couplings().model,
            [
                JointCoupling("two_joint", "one_joint", name="screw"),
                JointCoupling("three_joint", "one_joint", name="screw"),
            ],
            ["one_joint"],
        )


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_characteristic_length_is_a_length(bad: float) -> None:
    with pytest.raises(InputError, match=r"characteristic_length = .* positive"):
        couplings(characteristic_length=bad)


def test_what_is_no_closure_is_refused() -> None:
    with pytest.raises(InputError, match=r"LoopClosure or JointCoupling objects, not \('a', 'b'\)"):
        ClosedLoopModel(pin.Model(), [("a", "b")], actuated=[])
