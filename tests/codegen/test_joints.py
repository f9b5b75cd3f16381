"""Motions of single joints as expressions against Pinocchio's."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
import scipy.linalg

from rps_pin import MechanismError
from rps_pin.codegen.expressions.joints import Joint, _half_angle, clean
from tests.closed_loop.editing.test_split import CHANGING, CONSTANT, PX, composite, unit, with_axis
from tests.each import each
from tests.worst import worst

#: Joints along coordinate axes, and those of the tests of split().
JOINTS: dict[str, Any] = {
    **{
        f"{kind}{axis}": lambda rng, kind=kind, axis=axis: getattr(pin, f"JointModel{kind}{axis}")()
        for kind in ("R", "P", "RUB")
        for axis in "XYZ"
    },
    **{
        f"H{axis}": lambda rng, axis=axis: getattr(pin, f"JointModelH{axis}")(0.3) for axis in "XYZ"
    },
    "revolute about -y": lambda rng: pin.JointModelRevoluteUnaligned(0.0, -1.0, 0.0),
    "helical along -z": lambda rng: pin.JointModelHelicalUnaligned(0.0, 0.0, -1.0, 0.3),
    **CONSTANT,
}
STEPS = (0.0, 1e-9, 1e-6, 1e-4, 1e-2, 0.05, 0.2, 1.0, 5.0, 30.0)


def alone(make: Any, seed: int) -> tuple[pin.Model, Joint, np.random.Generator]:
    """A tree of one joint, and the joint as expressions."""
    rng = np.random.default_rng(seed)
    model = pin.Model()
    model.addJoint(0, make(rng), pin.SE3.Identity(), "joint")
    return model, Joint(model.joints[1], "joint"), rng


def values(expression: Any, *arguments: tuple[Any, Any]) -> np.ndarray:
    """An expression's value at values of its symbols."""
    symbols = [symbol for symbol, _ in arguments]
    function = ca.Function("f", symbols, [ca.densify(expression)])
    return np.array(function(*[value for _, value in arguments]))


@each("kind", JOINTS)
def test_placement_and_subspace(kind: str) -> None:
    for seed in range(3):
        model, joint, rng = alone(JOINTS[kind], seed)
        q = pin.integrate(model, pin.neutral(model), 2 * rng.normal(size=model.nv))
        data, symbol = model.createData(), ca.SX.sym("q", model.nq)
        pin.computeJointJacobians(model, data, q)
        rotation, translation = (values(x, (symbol, q)) for x in joint.placement(symbol))
        error = worst(rotation - data.oMi[1].rotation, translation[:, 0] - data.oMi[1].translation)
        assert error < 1e-14
        own = pin.getJointJacobian(model, data, 1, pin.ReferenceFrame.LOCAL)
        own = np.array(own).reshape(6, model.nv)
        assert worst(np.vstack([joint.linear, joint.angular]) - own) < 1e-14


@each("kind", JOINTS)
def test_integrate(kind: str) -> None:
    """As Pinocchio, or the exponential of the motion's matrix, at steps of any size."""
    for seed, size in enumerate(STEPS):
        model, joint, rng = alone(JOINTS[kind], seed)
        q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
        dv = size * rng.normal(size=model.nv) / np.sqrt(model.nv)
        symbol, step = ca.SX.sym("q", model.nq), ca.SX.sym("dv", model.nv)
        moved = values(joint.integrate(symbol, step), (symbol, q), (step, dv))[:, 0]
        expected = pin.integrate(model, q, dv)
        # Pinocchio's translation of short steps of these two cancels digits.
        shift = {"planar": 2, "free": 3}.get(kind, 0)
        assert worst((moved - expected)[shift:]) < 1e-14 * max(1, size)
        if not shift:
            continue
        twist = pin.Motion(joint.linear @ dv, joint.angular @ dv)
        data = model.createData()
        pin.forwardKinematics(model, data, q)
        matrix = np.zeros((4, 4))
        matrix[:3, :3], matrix[:3, 3] = pin.skew(twist.angular), twist.linear
        exact = data.oMi[1].homogeneous @ scipy.linalg.expm(matrix)
        assert worst(moved[:shift] - exact[:shift, 3]) < 4e-15 * max(1, size)
        if size in (0.0, 1.0, 5.0):
            assert worst(moved - expected) < 1e-14 * max(1, size)


@each("kind", JOINTS)
def test_tangent_is_the_derivative_of_integrate(kind: str) -> None:
    """By CasADi's derivative of integrate and by differences of Pinocchio's."""
    model, joint, rng = alone(JOINTS[kind], 5)
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    symbol, step = ca.SX.sym("q", model.nq), ca.SX.sym("dv", model.nv)
    derivative = ca.jacobian(joint.integrate(symbol, step), step)
    expected = values(derivative, (symbol, q), (step, np.zeros(model.nv)))
    tangent = values(joint.tangent(symbol), (symbol, q))
    assert worst(tangent - expected) < 1e-15
    h = 1e-3
    steps = h * np.eye(model.nv)
    rows = [pin.integrate(model, q, dv) - pin.integrate(model, q, -dv) for dv in steps]
    assert worst(tangent - np.transpose(rows) / (2 * h)) < 1e-6


@each("kind, size", [(kind, size) for kind in ("planar", "spherical", "free") for size in STEPS])
def test_derivatives_of_integrate_are_finite_at_any_step(kind: str, size: float) -> None:
    """And exact: where the series ends, and where a rotation is 0."""
    model, joint, rng = alone(JOINTS[kind], 6)
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    dv = size * unit(rng)[[0, 1, 2] * (model.nv // 3)]
    symbol, step = ca.SX.sym("q", model.nq), ca.SX.sym("dv", model.nv)
    derivative = ca.jacobian(joint.integrate(symbol, step), step)
    found = values(derivative, (symbol, q), (step, dv))
    after = pin.integrate(model, q, dv)
    inner = np.array(pin.dIntegrate(model, q, dv, pin.ArgumentPosition.ARG1))
    expected = values(joint.tangent(symbol), (symbol, after)) @ inner.reshape(model.nv, model.nv)
    # Pinocchio's own derivative loses digits where it leaves its series.
    assert worst(found - expected) < 1e-9 * max(1, size)


def test_series_of_small_angles_join_the_functions() -> None:
    """In 64-bit mantissas; (t - sin t)/t^3 is only used times t^2."""
    squared = ca.SX.sym("squared")
    function = ca.Function("f", [squared], list(_half_angle(squared)))
    for value in [*np.geomspace(1e-8, 30.0, 200), 0.01, np.nextafter(0.01, 0)]:
        t = np.sqrt(np.longdouble(value))
        sinc, cosine, cubic = (float(x) for x in function(value))
        assert worst(sinc - np.sin(t / 2) / (t / 2), cosine - np.cos(t / 2)) < 3e-16
        assert worst(value * cubic - (t - np.sin(t)) / t) < 3e-16
        series = 1 / 6 - value / 120 + value**2 / 5040 - value**3 / 362880
        exact = series if value < 1e-3 else (t - np.sin(t)) / t**3
        assert worst(cubic - exact) < 3e-14
    assert [float(x) for x in function(0.0)] == [1.0, 1.0, 1 / 6]


def test_coordinate_axes_keep_their_zeros() -> None:
    q = ca.SX.sym("q")
    rotation, translation = Joint(pin.JointModelRX(), "joint").placement(q)
    assert rotation.nnz() == 5
    assert translation.nnz() == 0
    rotation, translation = Joint(pin.JointModelPZ(), "joint").placement(q)
    assert rotation.nnz() == 3
    assert rotation.is_constant()
    assert translation.nnz() == 1


@each("kind", CHANGING)
def test_joints_with_changing_axes_are_refused(kind: str) -> None:
    model = pin.Model()
    model.addJoint(0, CHANGING[kind][0](np.random.default_rng(0)), pin.SE3.Identity(), "elbow")
    with pytest.raises(MechanismError, match=r"joint 'elbow' of type \w+"):
        Joint(model.joints[1], "elbow")


def test_unknown_types_are_refused_with_what_is_possible() -> None:
    joint = pin.JointModelEllipsoid(0.3, 0.5, 0.8)
    with pytest.raises(MechanismError, match=r"joint 'shoulder' of type Ellipsoid; types .* RX"):
        Joint(joint, "shoulder")


def test_composites_of_constant_subspace_are_taken_whatever_their_depth() -> None:
    along_any = with_axis(pin.JointModelPrismaticUnaligned)
    slides = composite(composite(PX, PX), composite(PX, along_any))
    model, joint, rng = alone(slides, 4)
    q, symbol = rng.normal(size=4), ca.SX.sym("q", 4)
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    rotation, translation = (values(x, (symbol, q)) for x in joint.placement(symbol))
    error = worst(rotation - data.oMi[1].rotation, translation[:, 0] - data.oMi[1].translation)
    assert error < 1e-14


def test_mimic_joints_are_refused() -> None:
    model = pin.Model()
    for name in ("one", "two"):
        model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), name)
    mimicking = pin.transformJointIntoMimic(model, 1, 2, 1.0, 0.0)
    with pytest.raises(MechanismError, match="'two' of type Mimic"):
        Joint(mimicking.joints[2], "two")


def test_clean_removes_rounding_errors_only() -> None:
    given = [1e-16, -3e-16, 1 - 2e-16, -1 + 4e-16, 2e-15, 0.5, 1 + 3e-15]
    assert clean(given).tolist() == [0, 0, 1, -1, 2e-15, 0.5, 1 + 3e-15]
    assert clean([3e-16, 0.3, 1.0], 0.3).tolist() == [3e-16, 0.3, 1.0]


@each("kind", JOINTS)
def test_difference(kind: str) -> None:
    """Short ones keep the rounding errors of the coordinates that are subtracted."""
    model, joint, rng = alone(JOINTS[kind], 3)
    q_symbol, other_symbol = ca.SX.sym("q", model.nq), ca.SX.sym("other", model.nq)
    errors = []
    for step in (0.0, 1e-5, 1e-3, 0.02, 0.2, 1.0, 2.0):
        q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
        direction = rng.normal(size=model.nv)
        other = pin.integrate(model, q, step * direction / np.linalg.norm(direction))
        expression = joint.difference(q_symbol, other_symbol)
        found = values(expression, (q_symbol, q), (other_symbol, other)).ravel()
        errors.append(np.abs(found - pin.difference(model, q, other)).max())
        back = pin.integrate(model, q, found)
        errors.append(np.abs(pin.difference(model, back, other)).max())
    assert worst(errors) < 1e-12
