"""Every kernel on floats, arrays, complex numbers and CasADi expressions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import casadi
import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin.rps.kernels import (
    continuation,
    forces,
    leg_equations,
    legs,
    limits,
    placement,
    platform,
    tilt_functions,
    tips,
)

Array = NDArray[np.float64]
Kernel = Callable[..., Any]
RNG = np.random.default_rng(15)
SAMPLES = 7


def flat(value: Any) -> Iterator[Any]:
    """Yield the numbers of nested tuples, or rows of arrays."""
    if isinstance(value, tuple) or (isinstance(value, np.ndarray) and value.ndim == 2):
        for one in value:
            yield from flat(one)
    else:
        yield value


def shaped(numbers: list[Any], like: Any) -> Any:
    """Take numbers from a list into nested tuples of the same form."""
    if isinstance(like, tuple):
        return tuple(shaped(numbers, one) for one in like)
    return numbers.pop(0)


V2, V3, SLOPES, MATRIX = (0.0,) * 2, (0.0,) * 3, (0.0,) * 6, (0.0,) * 9
ROWS, RINGS = (V3,) * 3, (V3,) * 4

#: The forms of each kernel's arguments. Those called TILT get the functions of a tilt at hand.
TILT = "tilt"
FORMS: dict[Kernel, tuple[Any, ...]] = {
    tilt_functions.tilt_functions: (0.0,),
    tilt_functions.stumpff: (0.0,),
    platform.rotation: (0.0, 0.0, TILT),
    platform.quaternion: (0.0, 0.0),
    platform.to_base: (0.0, 0.0, TILT, V3),
    platform.to_platform: (0.0, 0.0, TILT, V3),
    platform.angular_velocity: (0.0, 0.0, 0.0, 0.0, TILT),
    platform.angular_acceleration: (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, TILT),
    platform.cross: (V3, V3),
    platform.total: (V3, V3),
    platform.inertia_times: (SLOPES, V3),
    platform.principal_times: (SLOPES, V3),
    platform.turning_moment: (V3, V3, V3),
    platform.offset_force: (V3, V3, V3),
    tips.at_legs: (V3,),
    tips.resultant: (V3,),
    tips.tips: (0.0, 0.0, 0.0, TILT, 0.0),
    tips.tip_slopes: (0.0, 0.0, TILT),
    tips.tip_rates: (RINGS, 0.0, 0.0, 0.0),
    tips.tip_accelerations: (SLOPES, 0.0, TILT, 0.0),
    tips.tip_slope_rates: (0.0, 0.0, 0.0, 0.0, TILT),
    tips.speed_form: (RINGS,),
    legs.leg_geometry: V3,
    legs.along_leg: (0.0,) * 4,
    legs.across_leg: (0.0,) * 4,
    legs.leg_acceleration: (0.0,) * 5,
    legs.leg_motion: (0.0, 0.0, 0.0, V2, V2),
    legs.rest_axis: (0.0, 0.0, TILT, 0.0, 0.0),
    legs.rest_axis_rate: (0.0, 0.0, 0.0, 0.0, TILT, 0.0, 0.0),
    legs.cone_cosine: (0.0,) * 4,
    legs.cone_sine: (0.0,) * 5,
    leg_equations.constants: (V3, 0.0, 0.0),
    leg_equations.residuals: (V3, V3, 0.0, V3),
    leg_equations.slopes: (V3, V3, 0.0),
    leg_equations.determinant: (SLOPES,),
    leg_equations.determinant_scale: (V3, 0.0),
    leg_equations.adjugate: (SLOPES,),
    leg_equations.matrix_times: (MATRIX, V3, 0.0),
    leg_equations.turned: V3,
    leg_equations.unit_length: (0.0, 0.0),
    leg_equations.distance_errors: (V3, V3, 0.0, 0.0),
    leg_equations.jacobian_norm: (SLOPES,),
    leg_equations.matrix_norm: (MATRIX,),
    leg_equations.largest: (V3,),
    leg_equations.curvature_bound: (V3, 0.0),
    continuation.newton_step: (V3, SLOPES, 0.0, 0.0),
    continuation.chord_step: (V3, SLOPES, 0.0, 0.0, MATRIX, 0.0),
    continuation.turned_legs: (SLOPES, V3),
    continuation.unit_directions: (SLOPES,),
    placement.platform_axes: (V3, V3, 0.0),
    placement.pose_of_legs: (V3, SLOPES, 0.0, 0.0),
    placement.tilt_of_axes: (0.0,) * 5,
    forces.friction_force: (0.0,) * 4,
    forces.rod_force: (0.0, 0.0, 0.0, V3, 0.0),
    forces.cylinder_moment: (0.0,) * 4,
    forces.rod_moment: (0.0,) * 5,
    forces.virtual_work: (RINGS, V3, V3, V3, (0.0, 0.0)),
    forces.tilt_couple: (0.0, 0.0, TILT, V3),
    forces.cofactors: (ROWS,),
    forces.row_products: (ROWS, V3),
    forces.column_products: (ROWS, V3),
    forces.squared_norm: (ROWS,),
    limits.length_margin: (V3, 0.0, 0.0),
    limits.angle_margin: (V3, V3, V2, 0.0),
    limits.cone_margin: (V3, 0.0),
}
#: Their derivative is not asked for.
JUDGING = (
    continuation.newton_step,
    leg_equations.jacobian_norm,
    leg_equations.matrix_norm,
    leg_equations.largest,
)
#: Of numbers that only compare.
COMPARING = {
    *(limits.within, limits.length_within, forces.is_regular),
    *(continuation.solve_step, continuation.follow_legs, continuation.newton_and_chord),
    *(continuation.refined, continuation.after_step, continuation.step_end),
    continuation.to_be_trusted,
}


def samples_of(kernel: Kernel) -> Array:
    """Arguments, one row a sample: positive where the kernel takes no others."""
    form = [MATRIX if one is TILT else one for one in FORMS[kernel]]
    size = len(list(flat(tuple(form))))
    if kernel in (tilt_functions.tilt_functions, tilt_functions.stumpff):
        return np.array([[0.0], [1e-9], [0.3], [3.9999], [4.0], [9.0], [30.0]])
    if kernel is placement.tilt_of_axes:
        return axes()
    values: Array = RNG.uniform(0.2, 1.5, size=(SAMPLES, size))
    if kernel is placement.pose_of_legs:
        return closed_legs()
    if kernel not in (leg_equations.distance_errors, leg_equations.curvature_bound):
        values *= RNG.choice([-1.0, 1.0], size=values.shape)
    return values


def axes() -> Array:
    """u_x, u_y, u_z, v_y, v_z of rotations about axes in the base plane, small and large."""
    angle = np.array([1e-3, 0.4, 1.5, 1.6, 2.5, 3.0, 3.1])
    direction = np.array([0.3, 2.0, -1.0, 0.7, 2.5, -2.0, -0.4])
    x, y = angle * np.cos(direction), angle * np.sin(direction)
    (u_x, _, _), (u_y, v_y, _), (u_z, v_z, _) = platform.rotation(
        x, y, tilt_functions.tilt_functions(x * x + y * y)
    )
    return np.stack([u_x, u_y, u_z, v_y, v_z], axis=-1)


def closed_legs() -> Array:
    """Lengths, directions, g and h of poses."""
    rows = []
    for x, y in ((0.0, 0.1), (0.5, -0.3), (1.2, 1.4)):
        tilt = tilt_functions.tilt_functions(x * x + y * y)
        rings = tips.tips(0.4, x, y, tilt, 0.2)
        geometry = [
            legs.leg_geometry(radial, height, 0.3)
            for radial, height in zip(*(tips.at_legs(ring) for ring in rings), strict=True)
        ]
        rows.append([*np.transpose(geometry).ravel(), 0.3, 0.2])
    return np.array(rows)


def called(kernel: Kernel, numbers: list[Any]) -> list[Any]:
    form = tuple(MATRIX if one is TILT else one for one in FORMS[kernel])
    return list(flat(kernel(*shaped(list(numbers), form))))


def by_floats(kernel: Kernel, samples: Array) -> Array:
    return np.array([called(kernel, row) for row in samples.tolist()], dtype=np.float64)


def derivative(kernel: Kernel, row: Array) -> Array:
    """The Jacobian (outputs, arguments) by complex step."""
    columns = []
    for i in range(len(row)):
        numbers: list[Any] = row.tolist()
        numbers[i] += 1e-30j
        columns.append([np.imag(x) / 1e-30 for x in called(kernel, numbers)])
    return np.array(columns).T


KERNELS = sorted(FORMS, key=lambda kernel: f"{kernel.__module__}.{kernel.__name__}")


@pytest.mark.parametrize("kernel", KERNELS, ids=lambda kernel: kernel.__name__)
def test_all_types_agree(kernel: Kernel) -> None:
    samples = samples_of(kernel)
    expected = by_floats(kernel, samples)
    assert np.isfinite(expected).all()
    close: dict[str, Any] = {"rtol": 1e-13, "atol": 1e-14}

    columns = [np.ascontiguousarray(column) for column in samples.T]
    arrays = [np.broadcast_to(x, len(samples)) for x in called(kernel, list(columns))]
    np.testing.assert_allclose(np.stack(arrays, axis=-1), expected, **close)
    np.testing.assert_array_equal(np.stack(columns, axis=-1), samples)  # arguments are kept

    complexes = [np.real(called(kernel, row)) for row in samples.astype(complex).tolist()]
    np.testing.assert_allclose(complexes, expected, **close)

    symbols = casadi.SX.sym("x", samples.shape[1])
    result = casadi.vertcat(*called(kernel, casadi.vertsplit(symbols)))
    function = casadi.Function("f", [symbols], [result, casadi.jacobian(result, symbols)])
    for row, value in zip(samples, expected, strict=True):
        found, slopes = function(row)
        np.testing.assert_allclose(np.array(found).ravel(), value, **close)
        if kernel in JUDGING:
            continue
        ours = derivative(kernel, row)
        atol = 1e-11 * max(1.0, np.abs(ours).max())
        np.testing.assert_allclose(np.array(slopes), ours, rtol=1e-10, atol=atol)


def test_every_kernel_is_tested() -> None:
    modules = (
        continuation,
        forces,
        leg_equations,
        legs,
        limits,
        placement,
        platform,
        tilt_functions,
        tips,
    )
    public = {
        value
        for module in modules
        for name, value in vars(module).items()
        if callable(value)
        and not name.startswith("_")
        and getattr(value, "__module__", "") == module.__name__
    }
    assert public <= set(FORMS) | COMPARING


def test_limits_are_kept_to_rounding() -> None:
    values = np.array([0.1 - 2e-12, 0.1 - 5e-13, 0.1, 0.2, 0.2 + 5e-13, 0.2 + 2e-12])
    inside = [False, True, True, True, True, False]
    assert limits.within(values, 0.1, 0.2).tolist() == inside
    assert [limits.within(value, 0.1, 0.2) for value in values.tolist()] == inside
    for unit in (1.0, 1e-9, 1e9):  # lengths relative to their limits
        found = limits.length_within(
            unit * np.array([0.1, 0.1, 0.2, 0.2, 0.2]) * _AROUND, 0.1 * unit, 0.2 * unit
        )
        assert found.tolist() == [False, True, True, True, False]


_AROUND = np.array([1 - 2e-12, 1 - 5e-13, 1.0, 1 + 5e-13, 1 + 2e-12])
