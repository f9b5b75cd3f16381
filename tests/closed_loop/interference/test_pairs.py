"""Which pairs of links are checked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import ClosedLoopModel, InputError, LoopClosure
from rps_pin.closed_loop import Part, compose, composed_shapes
from rps_pin.errors import MechanismError
from tests.closed_loop.interference.shaped import joint, link, robot, rod, shape

BALL = '<sphere radius="0.01"/>'


def pairs(mechanism: ClosedLoopModel, ignore: object = ()) -> set[frozenset[str]]:
    return {frozenset(pair) for pair in mechanism.link_distances(ignore).pairs}


def of(*names: str) -> set[frozenset[str]]:
    return {frozenset(name) for name in names}


def chain(*joints: str, shapeless: str = "") -> str:
    """Links a, b, c, ... on each other; one letter each."""
    letters = "abcdefg"[: len(joints) + 1]
    links = [link(one, *([] if one in shapeless else [shape(BALL)])) for one in letters]
    return robot(*links, *joints)


def hinge(name: str, xyz: str = "0.1 0 0", kind: str = "continuous", axis: str = "0 0 1") -> str:
    """The joint "ab" carries b on a."""
    return joint(name, name[0], name[1], kind, xyz, axis)


def test_links_beside_each_other_are_not_checked() -> None:
    text = chain(hinge("ab"), hinge("bc"), hinge("cd"))
    assert pairs(ClosedLoopModel.from_urdf(text, [], [])) == of("ac", "ad", "bd")


def test_links_of_one_body_are_not_checked_and_stand_for_themselves() -> None:
    """c is fixed on b: neither against it, nor against a, which carries b."""
    text = chain(hinge("ab"), hinge("bc", kind="fixed"), hinge("cd"), hinge("de"))
    found = pairs(ClosedLoopModel.from_urdf(text, [], []))
    assert found == of("ad", "ae", "be", "ce")


@pytest.mark.parametrize(
    "kind", ["spherical", "revolute", "prismatic", "point_on_plane", "universal", "rigid"]
)
def test_links_that_a_closure_connects_are_not_checked(kind: str) -> None:
    text = chain(hinge("ab"), hinge("bc"), hinge("cd"), hinge("de"))
    free = ClosedLoopModel.from_urdf(text, [], [])
    closed = ClosedLoopModel(
        free.model, [LoopClosure("e", "b", kind)], [], collision=free.collision_shapes
    )
    expected = pairs(free) - of("be")
    if kind == "rigid":  # one body: what is beside one of them is beside the other
        expected -= of("ae", "ce", "bd")
    assert pairs(closed) == expected


def test_a_distance_closure_keeps_links_apart() -> None:
    text = chain(hinge("ab"), hinge("bc"))
    rod_between = LoopClosure("a", "c", "distance", distance=0.1)
    one = ClosedLoopModel.from_urdf(text, [], [])
    two = ClosedLoopModel(one.model, [rod_between], [], collision=one.collision_shapes)
    assert pairs(two) == of("ac")


def test_bodies_without_shapes_at_one_point_are_a_joint() -> None:
    """A universal joint of two hinges; a slider on its guide. Not: two hinges apart, two slides."""
    universal = chain(hinge("ab"), hinge("bc", "0 0 0", axis="1 0 0"), shapeless="b")
    slider = chain(hinge("ab", kind="prismatic"), hinge("bc", "0 0 0"), shapeless="b")
    for text in (universal, slider):
        assert pairs(ClosedLoopModel.from_urdf(text, [], [])) == set()
    apart = chain(hinge("ab"), hinge("bc", "0.2 0 0"), shapeless="b")
    slides = chain(
        hinge("ab", kind="prismatic"),
        hinge("bc", "0 0 0", "prismatic", "1 0 0"),
        hinge("cd", "0 0 0", "prismatic", "0 1 0"),
        shapeless="bc",
    )
    assert pairs(ClosedLoopModel.from_urdf(apart, [], [])) == of("ac")
    assert pairs(ClosedLoopModel.from_urdf(slides, [], [])) == of("ad")
    ball = chain(*(hinge(n, "0 0 0") for n in ("ab", "bc", "cd")), shapeless="bc")
    assert pairs(ClosedLoopModel.from_urdf(ball, [], [])) == set()


def test_free_bodies_touch_nothing_by_construction() -> None:
    text = robot(
        link("world"), link("a", shape(BALL)), link("b", shape(BALL)),
        joint("fa", "world", "a", "floating"), joint("fb", "world", "b", "floating"),
    )  # fmt: skip
    assert pairs(ClosedLoopModel.from_urdf(text, [], [])) == of("ab")


def test_a_coupling_connects_no_links() -> None:
    text = chain(hinge("ab"), hinge("bc"), hinge("cd")).replace(
        "<limit", '<mimic joint="ab" multiplier="-2"/><limit'
    )
    first = text.replace('<mimic joint="ab" multiplier="-2"/>', "", 1)
    mimics = ClosedLoopModel.from_urdf(first, [], ["ab"])
    assert len(mimics.closures) == 2
    assert pairs(mimics) == of("ac", "ad", "bd")


# Pairs that are left out --------------------------------------------------------------------------

CHAIN = chain(hinge("ab"), hinge("bc"), hinge("cd"))


def test_pairs_can_be_left_out() -> None:
    one = ClosedLoopModel.from_urdf(CHAIN, [], [])
    assert pairs(one, [("d", "a"), ["a", "b"]]) == of("ac", "bd")
    assert one.interference(one.home, ignore=[("a", "c")]).pairs == 2
    with pytest.raises(MechanismError, match=r"ignore: no link 'ca'.*there are: a, b, c, d"):
        one.interference(one.home, ignore=[("a", "ca")])
    with pytest.raises(InputError, match="'a' is paired with itself"):
        one.link_distances([("a", "a")])
    for wrong in ("ab", ["ab"], [("a", "b", "c")], [("a", 1)], [3], 3):
        with pytest.raises(InputError, match="ignore"):
            one.link_distances(wrong)


def test_a_description_leaves_pairs_out(tmp_path: Path) -> None:
    (tmp_path / "chain.urdf").write_text(CHAIN)
    text = "urdf: chain.urdf\nactuated: [ab]\ninterference: {ignore: [[d, a]]}\n"
    (tmp_path / "chain.yaml").write_text(text)
    one = ClosedLoopModel.load(tmp_path / "chain.yaml")
    assert pairs(one) == pairs(one.with_actuated(["bc"])) == of("ac", "bd")
    for wrong, words in (
        ("[[a, e]]", r"wrong.yaml, line 3.*no link 'e'"),
        ("[[a, a]]", r"line 3.*paired with itself"),
        ("[[a]]", "line 3"),
        ("[a]", "line 3"),
    ):
        (tmp_path / "wrong.yaml").write_text(text.replace("[[d, a]]", wrong))
        with pytest.raises((InputError, MechanismError), match=words):
            ClosedLoopModel.load(tmp_path / "wrong.yaml")


def test_filter_groups_of_drake_leave_pairs_out() -> None:
    groups = """
      <drake:collision_filter_group name="near"><drake:member link="a"/>
        <drake:ignored_collision_filter_group name="far"/></drake:collision_filter_group>
      <drake:collision_filter_group name="far"><drake:member_group name="last"/>
        </drake:collision_filter_group>
      <drake:collision_filter_group name="last"><drake:member link="c"/><drake:member link="d"/>
        </drake:collision_filter_group></robot>"""
    one = ClosedLoopModel.from_urdf(CHAIN.replace("</robot>", groups), [], [])
    assert pairs(one) == of("bd")
    for old, new, words in (
        ('link="c"', 'link="x"', "'x'"),
        ('name="far"/>', 'name="fur"/>', "'fur'"),
        ('<drake:member link="c"/>', '<drake:member_group name="far"/>', "member of itself"),
    ):
        text = CHAIN.replace("</robot>", groups.replace(old, new))
        wrong = ClosedLoopModel.from_urdf(text, [], [])
        with pytest.raises(InputError, match=words):
            wrong.link_distances()


# Several files ------------------------------------------------------------------------------------


def test_parts_of_a_composed_mechanism_are_checked_against_each_other() -> None:
    """Two arms beside each other, whose links have their part's name before theirs."""
    text = robot(link("base"), link("arm", rod(0.01, 1.0)), joint("j", "base", "arm"))
    arm = ClosedLoopModel.from_urdf(text, [], [])
    right = Part(arm.model, pin.SE3(np.eye(3), np.array([0.5, -0.5, 0.05])))
    whole = compose({"left": Part(arm.model), "right": right})
    shapes = composed_shapes({"left": arm.collision_shapes, "right": arm.collision_shapes})
    both = ClosedLoopModel(whole, [], ["left/j", "right/j"], collision=shapes)
    assert pairs(both) == {frozenset(("left/arm", "right/arm"))}
    nearest = both.interference([0.0, np.pi / 2]).nearest
    assert nearest is not None
    assert nearest.distance == pytest.approx(0.05 - 0.02, abs=1e-9)
    assert {nearest.link_a, nearest.link_b} == {"left/arm", "right/arm"}
    ignored = composed_shapes({"left": arm.collision_shapes.ignoring([("base", "arm")])})
    assert ignored.ignored == (("left/base", "left/arm"),)
