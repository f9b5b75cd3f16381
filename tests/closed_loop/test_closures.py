"""Loop closures as descriptions."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from rps_pin import LoopClosure, MechanismError
from rps_pin.closed_loop.constraints.closures import KINDS
from tests.closed_loop.mechanisms import FourBar


@pytest.mark.parametrize(("kind", "rows"), [("spherical", 3), ("rigid", 6)])
def test_kinds_have_their_rows(kind: str, rows: int) -> None:
    closure = LoopClosure("knee", "rocker_tip", kind)
    assert closure.size == rows
    model = pin.buildModelFromXML(FourBar().urdf())
    assert closure.constraint_model(model).residualSize() == rows


def test_closures_are_spherical_and_named_after_their_frames_unless_told() -> None:
    closure = LoopClosure("a", "b")
    assert (closure.kind, closure.name) == ("spherical", "a = b")
    assert LoopClosure("a", "b", name="hip").name == "hip"


def test_unknown_kind_is_refused_with_those_there_are() -> None:
    with pytest.raises(
        MechanismError, match="no closure kind 'loose'; there are: spherical, rigid"
    ):
        LoopClosure("a", "b", "loose")


def test_frame_joined_to_itself_is_refused() -> None:
    with pytest.raises(MechanismError, match="cannot join frame 'a' to itself"):
        LoopClosure("a", "a")


@pytest.mark.parametrize("frames", [("knee", "elbow"), ("elbow", "knee")])
def test_unknown_frame_is_refused_with_those_there_are(frames: tuple[str, str]) -> None:
    model = pin.buildModelFromXML(FourBar().urdf())
    with pytest.raises(
        MechanismError, match="closure 'hip': no frame 'elbow'; there are"
    ) as caught:
        LoopClosure(*frames, name="hip").frame_ids(model)
    assert all(frame.name in str(caught.value) for frame in model.frames)


def test_frames_are_found_by_name() -> None:
    model = pin.buildModelFromXML(FourBar().urdf())
    ids = LoopClosure("knee", "universe").frame_ids(model)
    assert [model.frames[i].name for i in ids] == ["knee", "universe"]


def test_closures_are_immutable_and_hashable() -> None:
    closure = LoopClosure("a", "b")
    with pytest.raises(dataclasses.FrozenInstanceError):
        closure.kind = "rigid"
    assert {closure, LoopClosure("a", "b")} == {closure}


# Every kind ---------------------------------------------------------------------------------------

ROWS = {
    "spherical": 3,
    "rigid": 6,
    "revolute": 5,
    "prismatic": 5,
    "cylindrical": 4,
    "universal": 4,
    "planar": 3,
    "point_on_line": 2,
    "point_on_plane": 1,
    "distance": 1,
}
AXES = ["revolute", "prismatic", "cylindrical", "universal", "planar"]
AXES += ["point_on_line", "point_on_plane"]
TWO_AXES = ["revolute", "cylindrical", "universal", "planar"]


def closure(kind: str, **options: object) -> LoopClosure:
    if kind == "distance":
        options = {"distance": 0.5} | options
    return LoopClosure("knee", "rocker_tip", kind, **options)


@pytest.mark.parametrize("kind", ROWS)
def test_every_kind_has_its_rows_and_a_constraint_model(kind: str) -> None:
    """Of a point for spherical, else of a frame, whose six rows it combines."""
    assert set(KINDS) == set(ROWS)
    model = pin.buildModelFromXML(FourBar().urdf())
    assert closure(kind).size == ROWS[kind]
    size = closure(kind).constraint_model(model).residualSize()
    assert size == (3 if kind == "spherical" else 6)


@pytest.mark.parametrize("kind", AXES)
def test_axes_are_unit_vectors_of_any_given_length(kind: str) -> None:
    found = closure(kind, axis=[0, 3e-5, 4e-5])
    assert found.axis == pytest.approx((0, 0.6, 0.8), rel=1e-15)
    expected = (0.0, 1.0, 0.0) if kind == "universal" else (0, 0.6, 0.8)
    if kind in TWO_AXES:
        assert found.axis_b == pytest.approx(expected, rel=1e-15)
        assert closure(kind, axis_b=[-2.0, 0, 0]).axis_b == (-1, 0, 0)
    else:
        assert found.axis_b is None


@pytest.mark.parametrize("kind", ROWS)
def test_axes_left_out_are_z_or_those_of_a_cross(kind: str) -> None:
    found = closure(kind)
    if kind == "universal":
        assert (found.axis, found.axis_b) == ((1, 0, 0), (0, 1, 0))
    else:
        assert found.axis == ((0, 0, 1) if kind in AXES else None)
        assert found.axis_b == ((0, 0, 1) if kind in TWO_AXES else None)


@pytest.mark.parametrize("kind", ROWS)
@pytest.mark.parametrize("option", ["axis", "axis_b"])
def test_axes_of_kinds_that_have_none_are_refused(kind: str, option: str) -> None:
    allowed = AXES if option == "axis" else TWO_AXES
    if kind in allowed:
        closure(kind, **{option: [1.0, 0.0, 0.0]})
        return
    with pytest.raises(
        MechanismError, match=f"{option} does not belong to kind '{kind}', only to {allowed[0]}"
    ):
        closure(kind, **{option: [1.0, 0.0, 0.0]})


@pytest.mark.parametrize("bad", [[0, 0, 0], [1, np.nan, 0], [np.inf, 0, 0]])
def test_axes_without_direction_are_refused(bad: list[float]) -> None:
    with pytest.raises(MechanismError, match=r"closure 'knee = rocker_tip': axis = .* direction"):
        closure("revolute", axis=bad)


@pytest.mark.parametrize("bad", [[1, 0], [1, 0, 0, 0], 3.0, "z", [[1], [2], ["x"]]])
def test_axes_that_are_not_three_numbers_are_refused(bad: object) -> None:
    with pytest.raises(MechanismError, match=r"axis_b = .* must be three numbers"):
        closure("revolute", axis_b=bad)


@pytest.mark.parametrize("bad", [None, 0.0, -1.0, np.nan, np.inf, "long"])
def test_rods_need_a_length(bad: object) -> None:
    with pytest.raises(MechanismError, match=r"distance = .*; it must be a positive length in m"):
        closure("distance", distance=bad)


@pytest.mark.parametrize("kind", [kind for kind in ROWS if kind != "distance"])
def test_lengths_of_other_kinds_are_refused(kind: str) -> None:
    with pytest.raises(MechanismError, match=f"belongs to kind 'distance' only, not to '{kind}'"):
        closure(kind, distance=0.3)


def test_closures_of_arrays_are_hashable_too() -> None:
    assert len({closure("revolute", axis=np.array([0, 0, 2.0])), closure("revolute")}) == 1


@pytest.mark.parametrize("bad", [[1, 0, 1j], ["1", "0", "0"], [1, 0], [[1, 0], 0], "z"])
def test_axes_of_other_than_real_numbers_are_refused(bad: object) -> None:
    with pytest.raises(MechanismError, match=r"axis = .* must be three numbers"):
        LoopClosure("knee", "rocker_tip", "revolute", axis=bad)


def test_lengths_of_rods_are_real_numbers_of_any_type() -> None:
    assert LoopClosure("a", "b", "distance", distance=np.int64(2)).distance == 2.0
    for bad in (True, 2j, "2", np.nan):
        with pytest.raises(MechanismError, match="it must be a positive length in m"):
            LoopClosure("a", "b", "distance", distance=bad)
