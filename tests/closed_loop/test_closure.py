"""Loop closures as descriptions."""

from __future__ import annotations

import dataclasses

import pinocchio as pin
import pytest

from rps_pin import LoopClosure, MechanismError
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
