"""Couplings and closures that URDF dialects state: mimic, URDF+, Drake, Isaac Sim, urdfdom 264."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rps_pin import ClosedLoopModel, ClosureError, JointCoupling, MechanismError
from rps_pin.closed_loop.io.urdf import parts_from_urdf
from tests.closed_loop.io.urdf.texts import joint, link, robot
from tests.each import each

# Mimic --------------------------------------------------------------------------------------------


def fingers(*mimics: str, kinds: tuple[str, ...] = ("prismatic",) * 3, last: str = "") -> str:
    """Three bodies of 0.1, 0.2 and 0.4 kg that slide, or turn, along z on one palm."""
    parts = [link("palm")]
    for name, kind, mass, mimic in zip("abc", kinds, (0.1, 0.2, 0.4), mimics, strict=True):
        more = f"<mimic {mimic}/>" if mimic else ""
        parts.append(link(f"link_{name}", mass))
        parts.append(joint(name, kind, "palm", f"link_{name}", axis="0 0 1", more=more))
    return robot(*parts, last)


def test_mimic_joints_are_coupled_in_chains() -> None:
    """b = 2 a + 0.1, c = 0.2 - b: the power of the weights and inertias is that at a."""
    text = fingers(
        "", 'joint="a" multiplier="2" offset="0.1"', 'joint="b" multiplier="-1" offset="0.2"'
    )
    mechanism = ClosedLoopModel.from_urdf(text, [], ["a"])
    assert mechanism.describe().mobility == 1
    q = mechanism.complete({"a": 0.3})
    np.testing.assert_allclose(q, [0.3, 0.7, -0.5], atol=1e-14)
    a = mechanism.acceleration(q, np.zeros(3), [1.0])
    np.testing.assert_allclose(a, [1.0, 2.0, -2.0], atol=1e-14)
    tau = mechanism.inverse_dynamics(q, np.zeros(3), a).tau[0]
    forces = np.array([0.1, 0.2, 0.4]) * (a + 9.81)
    assert tau == pytest.approx(forces @ [1.0, 2.0, -2.0], rel=1e-12)


def test_a_mimic_gives_its_defaults() -> None:
    mechanism = ClosedLoopModel.from_urdf(fingers("", 'joint="a"', 'joint="a"'), [], ["a"])
    np.testing.assert_allclose(mechanism.complete([0.4]), [0.4, 0.4, 0.4], atol=1e-14)


def test_a_multiplier_of_zero_holds_the_joint() -> None:
    text = fingers("", 'joint="a" multiplier="0" offset="0.25"', 'joint="a"')
    mechanism = ClosedLoopModel.from_urdf(text, [], ["a"])
    np.testing.assert_allclose(mechanism.complete([0.4]), [0.4, 0.25, 0.4], atol=1e-14)


def test_a_coupling_that_says_the_same_replaces_the_mimic() -> None:
    text = fingers("", 'joint="a" multiplier="2"', 'joint="a"')
    mechanism = ClosedLoopModel.from_urdf(text, [JointCoupling("b", "a", 2.0)], ["a"])
    assert [closure.name for closure in mechanism.closures] == ["c = a", "b = a"]
    with pytest.raises(MechanismError, match="b = a"):  # another of that name
        ClosedLoopModel.from_urdf(text, [JointCoupling("b", "a", 3.0)], ["a"])


@each(
    ("mimics", "kinds", "why"),
    [
        (("", 'joint="x"', ""), None, "joint 'b': mimic: no joint 'x'; there are: a, b, c"),
        (("", 'joint="b"', ""), None, "joints mimic in a circle: b -> b"),
        (("", 'joint="c"', 'joint="b"'), None, "joints mimic in a circle: b -> c -> b"),
        (("", 'joint="a" multiplier="x"', ""), None, "mimic multiplier = 'x' must be"),
        (("", 'multiplier="1"', ""), None, "<mimic> has no joint"),
        (("", 'joint="a"', ""), ("fixed", "prismatic", "prismatic"), "'a' is fixed: joints of one"),
        (("", 'joint="a"', ""), ("floating", "prismatic", "prismatic"), "'a' is floating"),
        (("", 'joint="a"', ""), ("prismatic", "planar", "prismatic"), "'b' is planar"),
    ],
)
def test_mimics_that_mean_nothing_are_refused(mimics, kinds, why: str) -> None:
    text = fingers(*mimics, kinds=kinds or ("prismatic",) * 3)
    with pytest.raises(MechanismError, match="line 1: ") as caught:
        parts_from_urdf(text)
    assert why in str(caught.value)


def test_the_mimic_of_a_fixed_joint_is_harmless_and_told() -> None:
    parts = parts_from_urdf(
        fingers("", 'joint="a"', 'joint="a"', kinds=("prismatic", "fixed", "prismatic"))
    )
    assert [closure.name for closure in parts.closures] == ["c = a"]
    assert parts.notes == ("the URDF text: fixed joints, whose mimic says nothing: 'b' (line 1)",)


# Loops --------------------------------------------------------------------------------------------

CRANK, GROUND = 0.2, 0.4


def parallelogram(closure: str, *, turned: str = "") -> str:
    """Crank and rocker of 0.2 m, coupler and ground of 0.4 m, in the plane of x and z."""
    return robot(
        link("base"),
        link("crank", 0.3, "0.1 0 0"),
        link("coupler", 0.5, "0.2 0 0"),
        link("rocker", 0.4, "0.1 0 0"),
        joint("a", "revolute", "base", "crank"),
        joint("b", "continuous", "crank", "coupler", xyz=f"{CRANK} 0 0"),
        joint("c", "continuous", "base", "rocker", xyz=f"{GROUND} 0 0" + turned),
        closure,
    )


HINGES = {
    "URDF+": '<loop name="l" type="{hinge}"><predecessor link="coupler"><origin xyz="0.4 0 0"/>'
    '</predecessor><successor link="rocker"><origin xyz="0.2 0 0"/></successor>'
    '<axis xyz="0 1 0"/></loop>',
    "urdfdom 264": '<constraint name="l" type="{hinge}"><parent link="coupler"/><parent_origin '
    'xyz="0.4 0 0"/><parent_axis xyz="0 1 0"/><child link="rocker"/><child_origin xyz="0.2 0 0"/>'
    '<child_axis xyz="0 2 0"/></constraint>',
    "Isaac Sim": '<loop_joint name="l" type="{hinge}"><link1 link="coupler" xyz="0.4 0 0"/>'
    '<link2 link="rocker" xyz="0.2 0 0"/><axis xyz="0 1 0"/></loop_joint>',
}
BALLS = {
    "urdfdom 264, ball": HINGES["urdfdom 264"].format(hinge="spherical"),
    "Isaac Sim, ball": HINGES["Isaac Sim"].format(hinge="spherical"),
    "Drake": "<drake:ball_constraint>"
    '<drake:ball_constraint_body_A name="coupler"/><drake:ball_constraint_p_AP value="0.4 0 0"/>'
    '<drake:ball_constraint_body_B name="rocker"/><drake:ball_constraint_p_BQ value="0.2 0 0"/>'
    "</drake:ball_constraint>",
}
CUTS = {name: text.format(hinge="revolute") for name, text in HINGES.items()} | BALLS


@pytest.mark.parametrize("dialect", CUTS)
def test_a_parallelogram_in_every_dialect(dialect: str) -> None:
    """The coupler stays level, so the torque is (m_1 / 2 + m_2 + m_3 / 2) g L cos(angle)."""
    mechanism = ClosedLoopModel.from_urdf(parallelogram(CUTS[dialect]), [], ["a"])
    (closure,) = mechanism.closures
    assert closure.size == (3 if dialect in BALLS else 5)
    start = mechanism.close([-0.5, 0.5, -0.5])
    for angle in (-0.5, -0.9, -1.4):
        q = start = mechanism.complete([angle], start)
        np.testing.assert_allclose(q[[0]], [angle])
        placed = {mechanism.model.names[i + 1]: q[i] for i in range(3)}
        assert placed["b"] == pytest.approx(-angle, abs=1e-9)
        assert placed["c"] == pytest.approx(angle, abs=1e-9)
        tau = mechanism.inverse_dynamics(q, np.zeros(3), np.zeros(3)).tau[0]
        weight = (0.3 / 2 + 0.5 + 0.4 / 2) * 9.81 * CRANK * math.cos(angle)
        assert tau == pytest.approx(-weight, rel=1e-9)
    assert mechanism.describe(q).mobility == 1


def test_offsets_become_frames_and_links_keep_theirs() -> None:
    model = parts_from_urdf(parallelogram(CUTS["URDF+"])).model
    assert [frame.name for frame in model.frames][-2:] == ["l/coupler", "l/rocker"]
    text = CUTS["URDF+"].replace('<origin xyz="0.4 0 0"/>', "")
    model = parts_from_urdf(parallelogram(text)).model
    assert [frame.name for frame in model.frames][-1:] == ["l/rocker"]


@each(
    ("dialect", "kind", "rows"),
    [
        ("URDF+", "continuous", 5),
        ("URDF+", "prismatic", 5),
        ("URDF+", "planar", 3),
        ("URDF+", "fixed", 6),
        ("urdfdom 264", "prismatic", 5),
        ("urdfdom 264", "link", 6),
        ("urdfdom 264", "universal", 4),
        ("Isaac Sim", "prismatic", 5),
        ("Isaac Sim", "fixed", 6),
    ],
)
def test_the_types_of_loops(dialect: str, kind: str, rows: int) -> None:
    text = HINGES[dialect].format(hinge=kind)
    if kind == "universal":
        text = text.replace("0 2 0", "0 0 1")
    (closure,) = parts_from_urdf(parallelogram(text)).closures
    assert closure.size == rows


def test_the_axis_of_a_loop_is_in_the_frame_of_its_end() -> None:
    """A rocker whose link frame is turned about x: the hinge is its y turned back."""
    turned = '" rpy="0.7 0 0'
    text = CUTS["URDF+"].replace(
        '<origin xyz="0.2 0 0"/></successor>', '<origin xyz="0.2 0 0" rpy="-0.7 0 0"/></successor>'
    )
    text = parallelogram(text, turned=turned).replace(
        '<axis xyz="0 1 0"/></joint><loop',
        f'<axis xyz="0 {math.cos(0.7)!r} {-math.sin(0.7)!r}"/></joint><loop',
    )
    mechanism = ClosedLoopModel.from_urdf(text, [], ["a"])
    q = mechanism.complete([-0.6], mechanism.close([-0.5, 0.5, -0.5]))
    np.testing.assert_allclose(sorted(q), [-0.6, -0.6, 0.6], atol=1e-9)


@each(
    ("text", "why"),
    [
        (CUTS["URDF+"].replace('"revolute"', '"floating"'), "loop 'l': no type 'floating'; there"),
        (CUTS["URDF+"].replace('"coupler"', '"copler"'), "predecessor: no link 'copler'; did you"),
        (CUTS["URDF+"].replace('"rocker"', '"coupler"').replace("0.2", "0.4"), "to itself"),
        (CUTS["URDF+"].replace('xyz="0 1 0"', 'xyz="0 0 0"'), "axis xyz = '0 0 0' is no direction"),
        (CUTS["URDF+"].replace('name="l" ', ""), "<loop> has no name"),
        (CUTS["urdfdom 264"].replace('<parent_axis xyz="0 1 0"/>', ""), "has no <parent_axis>"),
        (CUTS["urdfdom 264"].replace('<child_axis xyz="0 2 0"/>', ""), "has no <child_axis>"),
        ('<constraint name="c" type="revolute"/>', "constraint 'c' has no <parent>"),
        (CUTS["Isaac Sim"].replace('<axis xyz="0 1 0"/>', ""), "loop_joint 'l' has no <axis>"),
        ("<drake:ball_constraint/>", "has no <drake:ball_constraint_body_A>"),
        (CUTS["Drake"].replace("0.4 0 0", "0.4 0"), "value = '0.4 0' must be 3 finite numbers"),
        (CUTS["Drake"].replace("coupler", "rocker"), "'ball_1' joins link 'rocker' to itself"),
        (
            CUTS["Drake"].replace("coupler", "rocker").replace("0.4", "0").replace("0.2", "0"),
            "'ball_1' joins link 'rocker' to itself",
        ),
        ("<gazebo><joint name='j'/></gazebo>", "a <joint> of SDFormat in <gazebo> is not read"),
    ],
)
def test_loops_without_an_exact_meaning_are_refused(text: str, why: str) -> None:
    with pytest.raises(MechanismError, match="line 1: ") as caught:
        parts_from_urdf(parallelogram(text))
    assert why in str(caught.value)


# Couplings ----------------------------------------------------------------------------------------


def chains(coupling: str) -> str:
    """Joints a1, a2 one after the other, and b1, b2, on one common joint."""
    names = ("stem", "a1", "a2", "b1", "b2")
    parents = ("base", "link_stem", "link_a1", "link_stem", "link_b1")
    parts = [link("base")]
    for name, parent in zip(names, parents, strict=True):
        parts += [link(f"link_{name}", 1.0), joint(name, "continuous", parent, f"link_{name}")]
    return robot(*parts, coupling)


def coupled(predecessor: str, successor: str, ratio: float = -2.5, kind: str = "") -> str:
    return (
        f'<coupling name="k"{kind}><predecessor link="link_{predecessor}"/>'
        f'<successor link="link_{successor}"/><ratio value="{ratio}"/></coupling>'
    )


@each(("predecessor", "successor"), [("a1", "b1"), ("a2", "b1"), ("a1", "b2"), ("a2", "b2")])
def test_a_coupling_is_of_the_chains_from_where_they_part(predecessor: str, successor: str) -> None:
    """The sum of the joints to the successor is the ratio times that to the predecessor."""
    text = chains(coupled(predecessor, successor, kind=' type="rolling"'))
    mechanism = ClosedLoopModel.from_urdf(text, [], ["a1"])
    assert mechanism.describe().mobility == 4
    q = mechanism.close(np.random.default_rng(0).uniform(-1, 1, 5))
    values = dict(zip(list(mechanism.model.names)[1:], q, strict=True))
    row = ("a1", "a2", "b1", "b2")
    before = sum(values[name] for name in row if name[0] == "a" and name <= predecessor)
    after = sum(values[name] for name in row if name[0] == "b" and name <= successor)
    assert after == pytest.approx(-2.5 * before, abs=1e-12)
    assert abs(before) > 1e-3


@each(
    ("text", "why"),
    [
        (coupled("a1", "a2"), "one of its links carries the other"),
        (coupled("a1", "b1", kind=' type="belt"'), "no type 'belt', only 'rolling'"),
        (coupled("a1", "b3"), "no link 'link_b3'"),
        (coupled("a1", "b1").replace("-2.5", "x"), "ratio value = 'x' must be a finite number"),
    ],
)
def test_couplings_that_mean_nothing_are_refused(text: str, why: str) -> None:
    with pytest.raises(MechanismError, match="line 1: ") as caught:
        parts_from_urdf(chains(text))
    assert why in str(caught.value)


def tendon(lower: float = 0.3, upper: float = 0.3, more: str = "") -> str:
    word = "drake:tendon_constraint"
    return (
        f'<{word}><{word}_joint name="a1" a="2"/><{word}_joint name="a2" a="-1"/>'
        f'<{word}_joint name="b1" a="4"/><{word}_offset value="0.1"/>'
        f'<{word}_lower_limit value="{lower}"/><{word}_upper_limit value="{upper}"/>{more}</{word}>'
    )


def test_a_stiff_tendon_of_drake_is_a_coupling() -> None:
    """2 a1 - a2 + 4 b1 + 0.1 = 0.3."""
    mechanism = ClosedLoopModel.from_urdf(chains(tendon()), [], ["a1"])
    q = mechanism.close(np.random.default_rng(1).uniform(-1, 1, 5))
    values = dict(zip(list(mechanism.model.names)[1:], q, strict=True))
    assert 2 * values["a1"] - values["a2"] + 4 * values["b1"] == pytest.approx(0.2, abs=1e-12)
    assert mechanism.describe().mobility == 4


@each(
    ("text", "why"),
    [
        (tendon(0.1, 0.3), "its length may be from 0.1 to 0.3"),
        (tendon(more='<drake:tendon_constraint_stiffness value="9"/>'), "is elastic or damped"),
        (tendon().replace('name="a1" a', 'name="a9" a'), "no name 'a9'"),
    ],
)
def test_tendons_that_give_are_refused(text: str, why: str) -> None:
    with pytest.raises(MechanismError, match="line 1: ") as caught:
        parts_from_urdf(chains(text))
    assert why in str(caught.value)


def test_a_loop_that_cannot_close_says_so() -> None:
    text = parallelogram(CUTS["URDF+"].replace('xyz="0.4 0 0"', 'xyz="0.4 0.1 0"'))
    with pytest.raises(ClosureError, match="'l' stays open by"):
        ClosedLoopModel.from_urdf(text, [], ["a"]).close([-0.5, 0.5, -0.5])
