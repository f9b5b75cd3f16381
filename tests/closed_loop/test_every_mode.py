"""All assembly modes by homotopy: known counts, the random search, and proofs of each mode."""

from __future__ import annotations

from fractions import Fraction
from math import comb
from typing import Any

import mpmath
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, LoopClosure, RPSRobot
from rps_pin.closed_loop.assembly.every.study import (
    Legs,
    general_platform,
    poses_of,
    proven,
    quadrics,
    real_ones,
)
from rps_pin.closed_loop.assembly.modes import probability_of_all
from rps_pin.errors import InputError
from rps_pin.numerics.homotopy.krawczyk import disjoint, proven_zero
from rps_pin.numerics.homotopy.tracking import Accuracy, tracked
from rps_pin.numerics.intervals import Interval
from tests.closed_loop.test_assembly_modes import at, dietmaier, four_bar
from tests.proofs.common import loaded
from tests.worst import worst

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def complex_legs(base: Array, platform: Array, length: Array) -> Legs:
    return Legs(*(one.astype(complex) for one in (base, platform, length**2)))


def exact_legs(base: Array, platform: Array, length: Array) -> Legs:
    return Legs(Interval(base), Interval(platform), Interval(length).square())


def random_legs(seed: int) -> tuple[Array, Array, Array]:
    """A platform with a real pose, by its definition: tops are turned and moved."""
    rng = np.random.default_rng(seed)
    base, platform = rng.normal(size=(2, 6, 3))
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    return base, platform, np.linalg.norm(rng.normal(size=3) + platform @ turn.T - base, axis=1)


def placements(x: Complex) -> tuple[Complex, Complex]:
    """R and p of Study coordinates, by products of quaternions."""

    def product(a: Complex, b: Complex) -> Complex:
        v, w = a[:3], a[3]
        return np.array([*(w * b[:3] + b[3] * v + np.cross(v, b[:3])), w * b[3] - v @ b[:3]])

    e, f = x[:4], x[4:]
    back, size = e * [-1, -1, -1, 1], (e * e).sum()
    columns = [product(product(e, np.array([*axis, 0])), back)[:3] / size for axis in np.eye(3)]
    return np.array(columns).T, 2 * product(f, back)[:3] / size


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_a_general_platform_has_forty_complex_poses(seed: int) -> None:
    """All different, of the lengths asked for by R and p alone, and real ones in pairs."""
    base, platform, length = random_legs(seed)
    x = poses_of(complex_legs(base, platform, length))
    assert len(x) == 40
    gaps, places = [], []
    for one in x:
        turn, p = placements(one)
        tops = p + platform @ turn.T - base
        gaps.append(np.abs((tops * tops).sum(axis=1) - length**2) / (1 + np.abs(p @ p)))
        gaps.append(np.abs(turn @ turn.T - np.eye(3)).max() / (1 + np.abs(turn).max() ** 2))
        places.append(np.concatenate([turn.ravel(), p]))
    assert worst(np.concatenate([np.ravel(one) for one in gaps])) < 1e-10
    apart = np.abs(np.array(places)[:, None] - np.array(places)).max(axis=2) + 10 * np.eye(40)
    assert apart.min() > 1e-6
    real = real_ones(x)
    assert len(real) >= 2
    assert len(real) % 2 == 0
    boxes = proven(exact_legs(base, platform, length), real, np.random.default_rng(0))
    assert all(box is not None for box in boxes)


def test_the_general_platform_is_found_from_all_128_paths() -> None:
    legs, x = general_platform()
    assert x.shape == (40, 8)
    values = np.einsum("ijk,nj,nk->ni", quadrics(legs), x, x)
    assert worst(np.abs(values)) < 1e-10
    assert worst(np.abs((x[:, :4] * x[:, 4:]).sum(axis=1))) < 1e-10


def test_dietmaier_has_forty_real_ones_all_proven() -> None:
    mechanism = dietmaier()
    found = mechanism.assembly_modes(method="all")
    assert (found.complex_count, found.paths, found.singular, len(found.q)) == (40, 40, 0, 40)
    assert found.certified is not None
    assert found.certified.all()
    assert found.stopped == "paths"
    assert "40 is the most" in str(found)
    for q in found.q:
        assert worst(np.abs(mechanism.system.equations.gaps(q))) < 1e-12
    turned = found.q[:, 3:]
    alike = np.abs(turned @ turned.T) > 1 - 1e-9
    near = np.abs(found.q[:, None, :3] - found.q[:, :3]).max(axis=2) < 1e-5
    assert np.count_nonzero(alike & near) == 40  # each with itself alone


def cross(a: list[Any], b: list[Any]) -> list[Any]:
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def high_precision(
    base: Array, platform: Array, length: Array, x: Array, chart: Array
) -> list[Any]:
    """Newton's method with 40 digits on R and p written out by the quaternion's products."""
    with mpmath.workdps(40):
        b, a, r = (mpmath.matrix(one.tolist()) for one in (base, platform, length))

        def equations(*y: Any) -> list[Any]:
            e, f = list(y[:4]), list(y[4:])
            v, w = e[:3], e[3]
            found = []
            for k in range(6):
                # |2 f e* + (e a e* - b e e*)|^2 = r^2 (e.e)^2, by components
                ee = sum(one * one for one in e)
                moved = cross(v, list(f[:3]))
                p = [2 * (w * f[i] - f[3] * v[i] + moved[i]) for i in range(3)]
                s = [a[k, i] for i in range(3)]
                va = sum(v[i] * s[i] for i in range(3))
                vv = sum(one * one for one in v)
                c = cross(v, s)
                turned = [(w * w - vv) * s[i] + 2 * va * v[i] + 2 * w * c[i] for i in range(3)]
                d = [p[i] + turned[i] - b[k, i] * ee for i in range(3)]
                found.append((sum(one * one for one in d) - r[k] ** 2 * ee**2) / ee)
            found.append(sum(e[i] * f[i] for i in range(4)))
            found.append(sum(mpmath.mpf(float(chart[i])) * y[i] for i in range(8)) - 1)
            return found

        start = [mpmath.mpf(float(one)) for one in x]
        return list(mpmath.findroot(equations, start, tol=1e-60, verify=False, maxsteps=8))


def test_boxes_hold_the_pose_that_forty_digits_give() -> None:
    base, platform, length = random_legs(11)
    legs = exact_legs(base, platform, length)
    real = real_ones(poses_of(complex_legs(base, platform, length)))
    boxes = proven(legs, real, np.random.default_rng(0))
    middles = np.array([(box.lower + box.upper) / 2 for box in boxes if box is not None])
    assert len(middles) == len(real) >= 2
    for x, box in zip(middles, boxes, strict=True):
        assert box is not None
        chart = x / (x @ x)  # another chart than the boxes' own: ratios are compared
        exact = high_precision(base, platform, length, x, chart)
        with mpmath.workdps(40):
            k = int(np.argmax(np.abs(x)))
            for i in range(8):
                ratio = exact[i] / exact[k]
                bounds = [
                    mpmath.mpf(float(p)) / mpmath.mpf(float(q))
                    for p in (box.lower[i], box.upper[i])
                    for q in (box.lower[k], box.upper[k])
                ]
                assert min(bounds) <= ratio <= max(bounds)


def test_what_is_no_pose_is_not_proven() -> None:
    base, platform, length = random_legs(3)
    real = real_ones(poses_of(complex_legs(base, platform, length)))
    legs, rng = exact_legs(base, platform, length), np.random.default_rng(1)
    away = real + 1e-3 * rng.normal(size=real.shape)
    longer = exact_legs(base, platform, length + 50.0 * np.eye(6)[5])  # no such pose
    assert all(box is None for box in proven(longer, real, rng))
    for box, x in zip(proven(legs, away, rng), real, strict=True):
        if box is not None:  # Newton's steps may lead back: then to a true one
            middle = (box.lower + box.upper) / 2
            cosines = np.abs(real @ middle) / np.linalg.norm(real, axis=1) / np.linalg.norm(middle)
            assert cosines.max() > 1 - 1e-12, x


@pytest.mark.parametrize("name", ["stewart", pytest.param("linear_delta", marks=pytest.mark.slow)])
def test_platforms_have_those_that_the_search_finds(name: str) -> None:
    """The search finds 14 of 16 of the linear Delta, and says that it has settled."""
    mechanism = loaded(name)
    rng, system = np.random.default_rng(4), mechanism.system
    values = mechanism.home[system.coordinates_of(system.actuated)]
    values = values + 0.05 * rng.uniform(-1, 1, values.size)
    found = mechanism.assembly_modes(values, method="all", within_limits=False)
    searched = mechanism.assembly_modes(values, frames=["platform"], within_limits=False)
    places = [
        np.array([mechanism.frame_placement(q, "platform") for q in one.q])
        for one in (found, searched)
    ]
    apart = np.abs(places[1][:, None] - places[0]).max(axis=(2, 3))
    assert worst(apart.min(axis=1)) < 1e-9
    assert len(found.q) >= len(searched.q)
    assert found.certified is not None
    assert found.certified.all()
    assert found.complex_count is not None
    assert (found.complex_count - len(found.q)) % 2 == 0
    for q in found.q:
        assert worst(np.abs(mechanism.system.equations.gaps(q))) < 1e-10


def on_legs(kinds: str, seed: int) -> ClosedLoopModel:
    """A platform with a real pose on legs: rods (d), with balls on it (p), then at the base (b)."""
    base, platform, length = random_legs(seed)
    model = pin.Model()
    body = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "platform")
    model.addFrame(pin.Frame("top", body, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    closures = []
    for k, kind in enumerate(kinds):
        foot, corner = at(*base[k]), at(*platform[k])
        if kind == "d":
            points = {"placement_a": corner, "placement_b": foot}
            rod = LoopClosure("top", "universe", "distance", f"{k}", distance=length[k], **points)
            closures.append(rod)
            continue
        parent, place = (0, foot) if kind == "b" else (body, corner)
        ball = model.addJoint(parent, pin.JointModelSpherical(), place, f"ball{k}")
        model.addFrame(pin.Frame(f"tip{k}", ball, at(length[k]), pin.FrameType.OP_FRAME))
        other = ("top", corner) if kind == "b" else ("universe", foot)
        closures.append(LoopClosure(f"tip{k}", other[0], name=f"{k}", placement_b=other[1]))
    for index in range(1, model.njoints):
        model.appendBodyToJoint(index, pin.Inertia.Random(), pin.SE3.Identity())
    return ClosedLoopModel(model, closures, [])


def test_legs_of_all_kinds_lead_to_the_same_poses() -> None:
    """The rods' spins about their lines are idle."""
    places = []
    for kinds in ("dddddd", "ddppbb"):
        mechanism = on_legs(kinds, 7)
        neutral = pin.neutral(mechanism.model)
        found = mechanism.assembly_modes(q_guess=neutral, method="all", frames=["top"])
        assert found.complex_count == 40
        assert found.certified is not None
        assert found.certified.all()
        for q in found.q:
            assert worst(np.abs(mechanism.system.equations.gaps(q))) < 1e-10
        places.append(np.array([mechanism.frame_placement(q, "top") for q in found.q]))
    assert len(places[0]) == len(places[1]) >= 2
    apart = np.abs(places[0][:, None] - places[1]).max(axis=(2, 3))
    assert worst(apart.min(axis=0)) < 1e-9


def three_rpr(seed: int) -> tuple[ClosedLoopModel, Array]:
    """A general planar 3-RPR: a platform at the end of leg 1, legs of given lengths."""
    rng, model = np.random.default_rng(seed), pin.Model()
    feet, corners = rng.normal(size=(2, 3, 2))
    for k in range(3):
        joint = model.addJoint(0, pin.JointModelRZ(), at(*feet[k]), f"foot{k}")
        joint = model.addJoint(joint, pin.JointModelPX(), at(0.0), f"slide{k}")
        if k == 0:
            joint = model.addJoint(joint, pin.JointModelRZ(), at(0.0), "platform")
            for i in (1, 2):
                corner = at(*(corners[i] - corners[0]))
                model.addFrame(pin.Frame(f"c{i}", joint, corner, pin.FrameType.OP_FRAME))
        model.addFrame(pin.Frame(f"t{k}", joint, at(0.0), pin.FrameType.OP_FRAME))
    angle, moved = rng.uniform(-np.pi, np.pi), rng.normal(size=2)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    lengths = np.linalg.norm(moved + corners @ turn.T - feet, axis=1)
    closures = [LoopClosure(f"c{i}", f"t{i}") for i in (1, 2)]
    return ClosedLoopModel(model, closures, ["slide0", "slide1", "slide2"]), lengths


def test_planar_3_rpr_has_six_complex_ones() -> None:
    """Its real ones with either sign of a slide's direction alike: legs' lengths are positive."""
    counts = []
    for seed in range(5):
        mechanism, lengths = three_rpr(seed)
        found = mechanism.assembly_modes(lengths, method="all")
        searched = mechanism.assembly_modes(lengths)
        assert (found.complex_count, found.paths) == (6, 6)
        assert found.certified is not None
        assert found.certified.all()
        assert len(found.q) == len(searched.q) in (2, 4, 6)
        apart = np.abs(wrapped_apart(found.q, searched.q)).max(axis=2)
        assert worst(apart.min(axis=0)) < 1e-7
        for q in found.q:
            assert worst(np.abs(mechanism.system.equations.gaps(q))) < 1e-11
        counts.append(len(found.q))
    assert len(set(counts)) > 1


def wrapped_apart(one: Array, other: Array) -> Array:
    return np.asarray((one[:, None] - other + np.pi) % (2 * np.pi) - np.pi)


@pytest.mark.parametrize(
    ("name", "count"), [("four_bar", 2), ("five_bar", 2), ("slider_crank", 2), ("planar_rrr", 6)]
)
def test_planar_mechanisms_have_their_known_counts(name: str, count: int) -> None:
    mechanism, rng = loaded(name), np.random.default_rng(5)
    system = mechanism.system
    home = mechanism.home[system.coordinates_of(system.actuated)]
    for _ in range(3):
        values = home + 0.2 * rng.uniform(-1, 1, home.size)
        found = mechanism.assembly_modes(values, method="all", within_limits=False)
        searched = mechanism.assembly_modes(values, within_limits=False)
        assert found.complex_count == found.paths == count
        assert f"{count} is the Bezout number" in found.known
        assert found.certified is not None
        assert found.certified.all()
        assert len(found.q) == len(searched.q)
        assert worst(np.abs(wrapped_apart(found.q, searched.q)).max(axis=2).min(axis=0)) < 1e-9


def test_rps_has_sixteen_complex_ones_and_the_real_ones_of_its_closed_form() -> None:
    robot, mechanism = RPSRobot.from_preset("sokolov"), loaded("rps")
    rng = np.random.default_rng(6)
    for _ in range(5):
        lengths = rng.uniform(0.4, 0.5, 3)
        found = mechanism.assembly_modes(lengths, method="all", within_limits=False)
        assert (found.complex_count, found.singular) == (16, 0)
        assert found.certified is not None
        assert found.certified.all()
        exact = robot.assembly_modes(lengths)
        places = np.array([mechanism.frame_placement(q, "platform")[:3, 3] for q in found.q])
        apart = np.linalg.norm(places[:, None] - exact.position, axis=2)
        assert len(found.q) == len(exact.angle)
        assert worst(np.concatenate([apart.min(axis=0), apart.min(axis=1)])) < 1e-9


def test_two_of_a_delta_are_level_where_three_spheres_meet() -> None:
    mechanism = loaded("delta")
    found = mechanism.assembly_modes(method="all", within_limits=False)
    places = [mechanism.frame_placement(q, "platform") for q in found.q]
    level = [one for one in places if np.abs(one[:3, :3] - np.eye(3)).max() < 1e-9]
    assert len(level) == 2
    # By symmetry, at home, both are on the vertical line.
    assert worst(np.abs([one[:2, 3] for one in level])) < 1e-9


@pytest.mark.slow
def test_modes_outside_limits_are_counted() -> None:
    mechanism = loaded("stewart")
    everywhere = mechanism.assembly_modes(method="all", within_limits=False)
    within = mechanism.assembly_modes(method="all")
    assert within.outside > 0
    assert len(within.q) + within.outside == len(everywhere.q)
    assert not any(mechanism.system.limits.outside(q) for q in within.q)


def test_generated_code_has_the_same() -> None:
    mechanism = loaded("four_bar")
    found = mechanism.compile().assembly_modes(method="all")
    np.testing.assert_array_equal(found.q, mechanism.assembly_modes(method="all").q)


# The tracker and the test by themselves ---------------------------------------------------------


class Powers:
    """x^n - 1 to x^n - c, n the same for all: roots move along known curves."""

    def __init__(self, n: int, c: complex) -> None:
        self.n, self.c = n, c

    def __call__(self, x: Complex, s: Array) -> tuple[Complex, Complex, Complex]:
        n, target = self.n, 1 + s[:, None] * (self.c - 1)
        slopes: Complex = np.asarray(n * x ** (n - 1), complex)
        by_s: Complex = np.full_like(x, 1 - self.c)
        values: Complex = np.asarray(x**n - target, complex)
        return values, slopes[:, :, None], by_s


def test_roots_follow_their_own_paths() -> None:
    c = 3 - 4j
    start = np.exp(2j * np.pi * np.arange(7) / 7)[:, None]
    ends = tracked(Powers(7, c), start)
    assert ends.regular.all()
    # Along 1 + s (c - 1) the argument of c stays in (-pi, pi): each root keeps its number.
    exact = abs(c) ** (1 / 7) * np.exp(1j * np.angle(c) / 7) * start
    assert worst(np.abs(ends.x - exact)) < 1e-14


def test_paths_to_a_root_of_many_and_to_infinity_do_not_count() -> None:
    start = np.exp(2j * np.pi * np.arange(3) / 3)[:, None]
    assert not tracked(Powers(3, 0.0), start).regular.any()

    def to_infinity(x: Complex, s: Array) -> tuple[Complex, Complex, Complex]:
        share = 1 - s[:, None]  # (1 - s) x = 1
        return share * x - 1, share[:, :, None] + 0j, -x

    ends = tracked(to_infinity, np.ones((1, 1), complex))
    assert not ends.regular.any()
    assert ends.s[0] > 0.99


def test_a_path_that_meets_another_one_stops_there() -> None:
    """x^2 = (1 - 2 s): the paths meet where s is 1/2."""
    ends = tracked(Powers(2, -1.0), np.array([[1.0], [-1.0]], complex), Accuracy())
    assert not ends.regular.any()
    assert worst(np.abs(ends.s - 0.5)) < 1e-3


def test_square_roots_of_two_are_proven_and_hold_the_exact_one() -> None:
    def system(x: Interval) -> tuple[Interval, Interval]:
        return x.square() - 2.0, (x * 2.0)[:, None]

    for sign in (1, -1):
        box = proven_zero(system, np.array([sign * 1.4142]))
        assert box is not None
        low, high = (Fraction(float(one[0])) for one in (box.lower, box.upper))
        if sign < 0:
            low, high = -high, -low
        assert 0 < low**2 <= 2 <= high**2
        assert high - low < Fraction(1, 10**12)
    boxes = [proven_zero(system, np.array([one])) for one in (1.4, -1.4)]
    assert boxes[0] is not None
    assert boxes[1] is not None
    assert disjoint(boxes[0], boxes[1])
    assert not disjoint(boxes[0], boxes[0])


@pytest.mark.parametrize("constant", [1.0, 1e-8, 0.0])
def test_no_zero_and_a_double_one_are_not_proven(constant: float) -> None:
    def system(x: Interval) -> tuple[Interval, Interval]:
        return x.square() + constant, (x * 2.0)[:, None]

    for near in (1e-3, -0.2, 1.0):
        assert proven_zero(system, np.array([near])) is None


# The search ------------------------------------------------------------------------------------


def test_probability_of_all_is_that_of_its_prior() -> None:
    """Boender and Rinnooy Kan: shares uniform on the simplex, any number of modes as likely.

    P(W = w | w found in n) is proportional to the chance of it: summed here over W with exact
    fractions. With uniform shares all numbers of starts in each of W modes are as likely: there are
    comb(n + W - 1, n), of which comb(W, w) comb(n - 1, w - 1) fill w modes.
    """
    for w, n in ((1, 5), (2, 9), (3, 30), (6, 100)):
        shares = [
            Fraction(comb(total, w) * comb(n - 1, w - 1), comb(n + total - 1, n))
            for total in range(w, 3000)
        ]
        assert probability_of_all(w, n) == pytest.approx(float(shares[0] / sum(shares)), rel=1e-3)
    assert probability_of_all(3, 4) == 0.0


def test_a_search_ends_at_the_probability_asked_for() -> None:
    mechanism = four_bar()
    for probability, count in ((0.9, 100), (0.999, 6000)):
        found = mechanism.assembly_modes([1.0], probability=probability)
        assert found.stopped == "probable"
        assert found.probability >= probability
        assert count <= found.closed < count + 256
    plain = mechanism.assembly_modes([1.0])
    assert plain.stopped == "settled"
    assert 0 < plain.probability < 1


@pytest.mark.parametrize("probability", [0.0, 1.0, -1, np.nan, "much", True])
def test_a_wrong_probability_is_refused(probability: object) -> None:
    with pytest.raises(InputError, match=r"probability = .* between 0 and 1"):
        four_bar().assembly_modes([1.0], probability=probability)  # type: ignore[arg-type]


def test_a_wrong_method_is_refused() -> None:
    with pytest.raises(InputError, match="method = 'each': there are 'search' and 'all'"):
        four_bar().assembly_modes([1.0], method="each")  # type: ignore[arg-type]


def test_mechanisms_of_no_known_kind_are_searched_and_it_is_said() -> None:
    mechanism: ClosedLoopModel = loaded("differential")
    found = mechanism.assembly_modes(method="all")
    assert "searched, not solved as polynomials" in str(found)
    assert found.certified is None
    assert found.stopped == "settled"
