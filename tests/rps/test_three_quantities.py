"""Three quantities: SciPy's rotations, Eq. 2 to 5, and a dense search for every solution."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from rps_pin import InputError, UnreachableError
from rps_pin.rps.kinematics import pose as native
from rps_pin.rps.kinematics.conversions import (
    angles_from_pose,
    parasitic_motion,
    pose_from_angles,
    pose_from_position,
    position_from_pose,
)
from rps_pin.rps.kinematics.placement import constraint_residuals, pose_from_placement
from rps_pin.rps.kinematics.three_quantities import poses_from
from tests.strategies import LEG_ANGLES, matrices, random_poses

Array = NDArray[np.float64]

H = 0.23
EPS = np.finfo(float).eps


def quantities(pose: Array) -> dict[str, Array]:
    """Everything `poses_from` takes, of poses (n, 3): from SciPy's rotation, Eq. 2 and 4."""
    R = matrices(pose)
    u, v = R[..., 0], R[..., 1]
    z = pose[..., 0]
    alpha = np.arctan2(-pose[..., 1], pose[..., 2])
    sideways = {"x": H / 2 * (u[..., 0] - v[..., 1]), "y": -H * u[..., 1]}
    angles = {"alpha": alpha, "beta": np.hypot(pose[..., 1], pose[..., 2]), "gamma": -alpha}
    slopes = {"u_z": u[..., 2], "v_z": v[..., 2]}
    heights = {
        f"z_{leg + 1}": z + H * (np.cos(way) * u[..., 2] + np.sin(way) * v[..., 2])
        for leg, way in enumerate(LEG_ANGLES)
    }
    return {"z": z} | sideways | angles | slopes | heights


#: Each set, with its number of branches.
SETS = {
    ("z", "alpha", "beta"): 1,
    ("z", "gamma", "beta"): 1,
    ("z", "x", "y"): 2,
    ("z", "x", "alpha"): 2,
    ("z", "y", "alpha"): 2,
    ("z", "x", "gamma"): 2,
    ("z", "y", "gamma"): 2,
    ("z", "x", "beta"): 4,
    ("z", "y", "beta"): 4,
    ("z", "u_z", "v_z"): 2,
    ("z_1", "z_2", "z_3"): 2,
}
every_set = pytest.mark.parametrize("names", SETS, ids=" ".join)


def asked(names: tuple[str, ...], pose: Array) -> dict[str, Array]:
    every = quantities(pose)
    return {name: every[name] for name in names}


def equations(names: tuple[str, ...], pose: Array, wanted: dict[str, Array]) -> Array:
    """What poses miss of the wanted quantities, smooth in the pose.

    alpha fixes the line in the base plane that the platform turns about, in the one sense or the
    other; beta fixes how far.
    """
    found = quantities(pose)
    missed = []
    for name in names:
        if name in ("alpha", "gamma"):
            alpha = wanted[name] if name == "alpha" else -wanted[name]
            missed.append(pose[..., 1] * np.cos(alpha) + pose[..., 2] * np.sin(alpha))
        elif name == "beta":
            missed.append((pose[..., 1] ** 2 + pose[..., 2] ** 2 - wanted[name] ** 2) / 2)
        else:
            missed.append((found[name] - wanted[name]) / (1 if name in ("u_z", "v_z") else H))
    return np.stack(missed, axis=-1)


@every_set
def test_pose_is_among_the_solutions_of_its_quantities(names: tuple[str, ...]) -> None:
    pose = random_poses(1000, largest_tilt=3.0)
    found = poses_from(H, **asked(names, pose))
    assert found.pose.shape == (1000, SETS[names], 3)
    assert found.exists.any(axis=-1).all()
    error = np.abs(found.pose - pose[:, None]).max(axis=-1)
    error[~found.exists] = np.inf
    # Where branches meet (pi in x and y, a right angle in slopes, ...) they know the pose to the
    # root of rounding; and z_1 - z_2 keeps no digits of a tilt below rounding.
    assert error.min(axis=-1).max() < 1e-7
    assert np.median(error.min(axis=-1)) < 1e-15


@every_set
def test_every_solution_has_the_quantities_asked_for(names: tuple[str, ...]) -> None:
    wanted = asked(names, random_poses(1000, seed=1, largest_tilt=3.0))
    found = poses_from(H, **wanted)
    for branch in range(SETS[names]):
        some = found.exists[:, branch]
        assert some.mean() > 0.8  # tips do not tell the least tilts from level ones
        here = {name: value[some] for name, value in wanted.items()}
        missed = equations(names, found.pose[some, branch], here)
        assert np.abs(missed).max() < 2e-15 * (10 if "z_1" in names else 3)


def search(names: tuple[str, ...], wanted: dict[str, Array]) -> list[Array]:
    """Every pose with these quantities that Newton finds from a dense set of starts."""
    rng = np.random.default_rng(5)
    z = np.mean([value for name, value in wanted.items() if name.startswith("z")])
    way, size = rng.uniform(-np.pi, np.pi, 400), np.pi * np.sqrt(rng.uniform(size=400))
    pose = np.stack([np.full(400, z), size * np.cos(way), size * np.sin(way)], axis=-1)
    step = 1e-6 * np.eye(3)
    for _ in range(25):
        missed = equations(names, pose, wanted)
        ahead = [equations(names, pose + d, wanted) for d in step]
        behind = [equations(names, pose - d, wanted) for d in step]
        jacobian = (np.stack(ahead, -1) - np.stack(behind, -1)) / 2e-6
        move = np.linalg.pinv(jacobian, rcond=1e-9) @ missed[..., None]
        length = np.linalg.norm(move[:, 1:, 0], axis=-1)[:, None, None]
        pose = pose - (move / np.maximum(1, length / 0.3))[..., 0]
    good = np.abs(equations(names, pose, wanted)).max(axis=-1) < 1e-12
    good &= np.hypot(*pose.T[1:]) < np.pi
    distinct: list[Array] = []
    for one in pose[good]:
        if all(np.abs(one - other).max() > 1e-5 for other in distinct):
            distinct.append(one)
    return distinct


@every_set
def test_no_solution_is_missing(names: tuple[str, ...]) -> None:
    """Whatever a dense search finds within tilts of pi is listed, and the other way round."""
    rng = np.random.default_rng(4)
    for _ in range(4):
        pose = pose_from_angles(0.4, rng.uniform(-3, 3), rng.uniform(0.3, 1.4))
        wanted = asked(names, pose)
        listed = list(poses_from(H, **wanted).pose)
        # The search cannot tell alpha from alpha + pi: both are in its answers.
        both = [one * [1, -1, -1] for one in listed] if len(listed) == 1 else []
        found = search(names, wanted)
        assert len(found) == len(listed) + len(both)
        for one in found:
            assert min(np.abs(one - other).max() for other in listed + both) < 1e-8


def test_one_solution_of_the_angles_keeps_their_sign() -> None:
    found = poses_from(H, z=0.4, alpha=0.3, beta=[-0.5, 0.5]).pose[:, 0]
    np.testing.assert_array_equal(found[0, 1:], -found[1, 1:])
    np.testing.assert_array_equal(found[1], pose_from_angles(0.4, 0.3, 0.5))


def test_branches_come_in_the_documented_order() -> None:
    pose = pose_from_angles(0.4, 0.3, 0.5)
    wanted = quantities(pose)

    def solve(*names: str) -> Array:
        return poses_from(H, **{name: wanted[name] for name in names}).pose

    for branch, one in zip("+-", solve("z", "x", "y"), strict=True):
        centre = [wanted["x"], wanted["y"], 0.4]
        np.testing.assert_array_equal(one, pose_from_position(centre, H, branch))
    for name in "xy":
        plus, minus = solve("z", name, "alpha")
        np.testing.assert_allclose(plus, pose, rtol=1e-14)
        np.testing.assert_array_equal(minus[1:], -plus[1:])
    for alpha, one in zip(
        [0.3, -0.3, np.pi + 0.3, np.pi - 0.3], solve("z", "x", "beta"), strict=True
    ):
        np.testing.assert_allclose(one, pose_from_angles(0.4, alpha, 0.5), rtol=0, atol=1e-14)
    for alpha, one in zip(
        [0.3, np.pi / 2 - 0.3, np.pi + 0.3, 1.5 * np.pi - 0.3], solve("z", "y", "beta"), strict=True
    ):
        np.testing.assert_allclose(one, pose_from_angles(0.4, alpha, 0.5), rtol=0, atol=1e-14)
    for names in (("z", "u_z", "v_z"), ("z_1", "z_2", "z_3")):
        upright, upside_down = solve(*names)
        np.testing.assert_allclose(upright, pose, rtol=0, atol=1e-14)
        assert native.rotation(upside_down)[2, 2] == pytest.approx(-np.cos(0.5), abs=1e-14)


LEVEL = {name: float(value) for name, value in quantities(np.array([0.4, 0.0, 0.0])).items()}


@pytest.mark.parametrize("name", ["x", "y"])
def test_shift_and_no_tilt_is_level_and_nothing_else(name: str) -> None:
    found = poses_from(H, z=0.4, beta=0.0, **{name: 0.0})
    assert found.exists.all()
    np.testing.assert_array_equal(found.pose, [[0.4, 0, 0]] * 4)
    with pytest.raises(UnreachableError, match=f"{name} would be 0.001 m; it can be 0 to 0 m"):
        poses_from(H, z=0.4, beta=0.0, **{name: 1e-3})


@pytest.mark.parametrize("names", [("z", "u_z", "v_z"), ("z_1", "z_2", "z_3")])
def test_zero_slope_is_level_or_a_half_turn_about_any_axis(names: tuple[str, ...]) -> None:
    found = poses_from(H, **{name: LEVEL[name] for name in names})
    np.testing.assert_allclose(found.pose[0], [0.4, 0, 0], rtol=2 * EPS)
    np.testing.assert_array_equal(found.exists, [True, False])
    assert found.continuum


CONTINUA = [("x", a) for a in (np.pi / 4, -np.pi / 4, 3 * np.pi / 4)] + [
    ("y", a) for a in (0.0, np.pi / 2, np.pi, -np.pi / 2)
]


@pytest.mark.parametrize(("name", "alpha"), CONTINUA)
def test_shift_that_the_tilt_does_not_move_is_refused(name: str, alpha: float) -> None:
    """Eq. 5: x = 0 for every beta at cos(2 alpha) = 0, y = 0 at sin(2 alpha) = 0."""
    for beta in (0.3, 2.0):  # so it is: different poses, one x or y
        pose = pose_from_angles(0.4, alpha, beta)
        assert abs(quantities(pose)[name]) < 1e-16
    with pytest.raises(InputError, match=f"{name} = 0 m.*every beta") as caught:
        poses_from(H, z=0.4, alpha=alpha, **{name: 0.0})
    assert not isinstance(caught.value, UnreachableError)
    found = poses_from(H, z=0.4, alpha=alpha, errors="mask", **{name: [0.0, 1e-3]})
    np.testing.assert_array_equal(found.continuum, [True, False])
    assert not found.exists.any()
    with pytest.raises(UnreachableError):
        poses_from(H, z=0.4, alpha=alpha, **{name: 1e-3})


def test_shift_and_alpha_near_a_continuum_is_solved() -> None:
    for offset in (1e-3, 1e-6, 1e-9):
        pose = pose_from_angles(0.4, offset, 1.0)
        y = H / 2 * (1 - np.cos(1.0)) * np.sin(2 * offset)
        np.testing.assert_allclose(
            poses_from(H, z=0.4, alpha=offset, y=y).pose[0], pose, rtol=0, atol=1e-14
        )


@pytest.mark.parametrize(
    ("wanted", "name", "edge"),
    [
        ({"x": None, "alpha": 0.0}, "x", -H),
        ({"x": None, "alpha": 1.2}, "x", -H * np.cos(2.4)),
        ({"y": None, "alpha": 0.5}, "y", H * np.sin(1.0)),
        ({"x": None, "beta": 0.5}, "x", H * np.sin(0.25) ** 2),
        ({"x": None, "beta": -0.5}, "x", -H * np.sin(0.25) ** 2),
        ({"y": None, "beta": 2.0}, "y", H * np.sin(1.0) ** 2),
        ({"x": None, "y": 0.1}, "x", np.sqrt(H**2 - 0.01)),
        ({"u_z": None, "v_z": 0.6}, "u_z", 0.8),
    ],
)
def test_reach_ends_where_the_equations_say(
    wanted: dict[str, float | None], name: str, edge: float
) -> None:
    def at(value: float) -> dict[str, float | None]:
        return {"z": 0.4} | wanted | {name: value}

    assert poses_from(H, **at(edge)).exists.all()
    assert poses_from(H, **at(edge * (1 - 1e-9))).exists.all()
    beyond = poses_from(H, **at(edge * (1 + 1e-9)), errors="mask")
    assert not beyond.exists.any()
    np.testing.assert_array_equal(beyond.pose, np.broadcast_to([0.4, 0, 0], beyond.pose.shape))
    with pytest.raises(UnreachableError, match="misses that by"):
        poses_from(H, **at(edge * (1 + 1e-9)))


def test_shift_to_the_wrong_side_is_out_of_reach() -> None:
    """At alpha = 0 the centre moves towards -x only."""
    with pytest.raises(UnreachableError, match=r"x = 0.1 m, alpha = 0 rad.*-0.23 to 0 m.*by 0.1 m"):
        poses_from(H, z=0.4, x=0.1, alpha=0.0)


def test_refusal_names_the_entry_and_the_numbers() -> None:
    with pytest.raises(UnreachableError, match=r"x = 0.2 m.*y = 0.3 m.* \(entry \(1, 0\) of 4\)"):
        poses_from(H, z=0.4, x=[[0, 0.1], [0.2, 0.3]], y=[[0], [0.3]])
    message = r"hypot\(u_z, v_z\) would be 1.2; it can be 0 to 1, and misses that by 0.2$"
    with pytest.raises(UnreachableError, match=message):
        poses_from(H, z=0.4, u_z=1.2, v_z=0.0)


@every_set
def test_quantities_too_large_to_compute_with_are_out_of_reach(names: tuple[str, ...]) -> None:
    if "z_1" in names or names[1] in ("x", "y", "u_z"):
        wanted = {name: 1e49 if name != "z_2" else -1e49 for name in names}
        found = poses_from(H, **wanted, errors="mask")
        assert not found.exists.any()
        assert np.isfinite(found.pose).all()
        with pytest.raises(InputError, match=r"beyond 1e\+50"):
            poses_from(H, **(wanted | {names[0]: 1e308}), errors="mask")


@pytest.mark.parametrize("third", [{}, {"x": 0.0}, {"y": 0.0}, {"beta": 0.1}])
def test_alpha_and_gamma_are_not_independent(third: dict[str, float]) -> None:
    with pytest.raises(InputError, match="alpha and gamma are not independent, gamma = -alpha"):
        poses_from(H, z=0.4, alpha=0.1, gamma=-0.1, **third)


@pytest.mark.parametrize(
    "names",
    ["", "z", "z x", "x y alpha", "x y beta", "z x y beta", "z u_z x", "z z_1 z_2", "z_1 z_2"],
)
def test_sets_that_determine_no_pose_are_refused_with_those_that_do(names: str) -> None:
    with pytest.raises(InputError, match="z, which nothing else determines, with two of x, y,"):
        poses_from(H, **dict.fromkeys(names.split(), 0.1))


def test_quantities_broadcast() -> None:
    found = poses_from(H, z=0.4, x=np.zeros((2, 1)), beta=[0.1, 0.2, 0.3])
    assert (found.pose.shape, found.exists.shape) == ((2, 3, 4, 3), (2, 3, 4))
    assert found.continuum.shape == (2, 3)
    single = poses_from(H, z=0.4, x=0.0, beta=0.2)
    np.testing.assert_array_equal(found.pose[1, 1], single.pose)


def test_empty_batches_stay_empty() -> None:
    none = np.zeros((0, 3))
    assert poses_from(H, z=0.4, x=np.zeros(0), beta=0.1).pose.shape == (0, 4, 3)
    assert pose_from_position(none, H).shape == (0, 3)
    assert angles_from_pose(none).beta.shape == (0,)
    assert pose_from_placement(none, np.zeros((0, 3, 3)), H).shape == (0, 3)


@every_set
def test_quantities_that_are_no_numbers_are_refused_by_name(names: tuple[str, ...]) -> None:
    for name in names:
        for bad in (np.nan, [0.1, np.inf], "0.1", True, 1j, [[0.1], [0.1, 0.2]]):
            with pytest.raises(InputError, match=f"^{name} "):
                poses_from(H, **(dict.fromkeys(names, 0.1) | {name: bad}))


def test_shapes_that_do_not_go_together_are_told() -> None:
    with pytest.raises(InputError, match=r"z \(\), x \(2,\), beta \(3,\)"):
        poses_from(H, z=0.4, x=[0, 0], beta=[0, 0, 0])


@pytest.mark.parametrize("bad", [0.0, -0.1, np.nan, np.inf, "0.23", None, True, [0.23]])
def test_radius_of_no_platform_is_refused(bad: object) -> None:
    calls: list[Callable[[], object]] = [
        lambda: poses_from(bad, z=0.4, x=0.0, y=0.0),
        lambda: position_from_pose(np.zeros(3), bad),
        lambda: parasitic_motion(np.zeros(3), bad),
        lambda: constraint_residuals(np.zeros(3), np.eye(3), bad),
        lambda: pose_from_placement(np.zeros(3), np.eye(3), bad),
    ]
    for call in calls:
        with pytest.raises(InputError, match=r"^platform_radius = "):
            call()


def test_unknown_treatment_of_errors_is_refused() -> None:
    with pytest.raises(InputError, match="errors = 'ignore'"):
        poses_from(H, z=0.4, x=0.0, y=0.0, errors="ignore")
