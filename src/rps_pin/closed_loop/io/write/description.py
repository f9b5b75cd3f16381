"""A mechanism's description (YAML) beside the URDF of its tree."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import JointCoupling, LoopClosure
from rps_pin.closed_loop.constraints.system import MAX_CONDITION
from rps_pin.closed_loop.io.write.numbers import number
from rps_pin.closed_loop.io.write.source import Source, coordinates, kind_of, velocities


def description_text(
    source: Source,
    urdf: str,
    merges: Sequence[Mapping[str, Any]],
    ignored: Sequence[tuple[str, str]] = (),
) -> str:
    """Return the description of a tree without rows.

    Parameters
    ----------
    source
        The mechanism.
    urdf
        The name of the URDF's file.
    merges
        The entries of ``merge``.
    ignored
        Pairs of links that may overlap.
    """
    model, effects = source.model, source.effects
    lines = [f"name: {_value(source.name or 'mechanism')}", f"urdf: {_value(urdf)}"]
    lines.append(f"gravity: {_value(model.gravity.linear)}")
    frames: list[dict[str, Any]] = []
    couplings: list[dict[str, Any]] = []
    for closure in source.closures:
        if isinstance(closure, JointCoupling):
            couplings.append(_coupling(closure))
        else:
            frames.append(_closure(closure))
    lines += _list("merge", merges)
    lines += _list("closures", frames)
    lines += _list("couplings", couplings)
    lines.append(f"actuated: {_value(source.actuated)}")
    neutral = source.home is not None and np.array_equal(source.home, pin.neutral(model))
    if source.home is not None and not neutral:  # the neutral one is taken where none is given
        home = {name: _coordinates(model, i, source.home) for i, name in _joints(model)}
        lines += _mapping("home", home)
    lines += _mapping("damping", _by_joint(model, effects.damping))
    lines += _mapping("friction", _by_joint(model, effects.friction))
    stiffness, rest = (_by_joint(model, a) for a in (effects.stiffness, effects.rest))
    lines += _mapping("stiffness", stiffness)
    lines += _mapping("rest", {name: rest.get(name, 0.0) for name in stiffness})
    lines += _mapping("armature", _by_joint(model, model.armature))
    if effects.friction.any():
        lines.append(f"friction_speed: {number(effects.friction_speed)}")
    lines.append(f"characteristic_length: {number(source.characteristic_length)}")
    if source.max_condition != MAX_CONDITION:
        lines.append(f"max_condition: {number(source.max_condition)}")
    if source.accuracy is not None:
        lines.append(f"accuracy: {number(source.accuracy)}")
    if source.task is not None:
        lines.append(f"task: {_value(_with_offsets(source.task))}")
    if ignored:
        lines.append(f"interference: {_value({'ignore': ignored})}")
    return "\n".join(lines) + "\n"


def _joints(model: pin.Model) -> list[tuple[int, str]]:
    return [(index, model.names[index]) for index in range(1, model.njoints)]


def _coordinates(model: pin.Model, joint: int, q: Array) -> Array:
    """Return a joint's coordinates as they are read: turns without bounds have an angle."""
    own = coordinates(model, joint, q)
    is_turn = kind_of(model.joints[joint]) == "continuous"
    return np.arctan2(own[1:], own[:1]) if is_turn else own


def _by_joint(model: pin.Model, array: Array) -> dict[str, Any]:
    """Return the entries of joints that have some, one number where all are equal."""
    found: dict[str, Any] = {}
    for index, name in _joints(model):
        values = velocities(model, index, array)
        if values.any():
            found[name] = values[0] if (values == values[0]).all() else values
    return found


def _closure(closure: LoopClosure) -> dict[str, Any]:
    return _with_offsets(vars(closure))


def _with_offsets(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is given of some fields, placements as offsets."""
    entry = {name: value for name, value in given.items() if value is not None}
    for end in ("placement", "placement_a", "placement_b"):
        if end in entry:
            offset = pin.SE3(np.array(entry[end]))
            angles = pin.rpy.matrixToRpy(offset.rotation)
            entry[end] = {"xyz": offset.translation, "rpy": angles}
    return entry


def _coupling(coupling: JointCoupling) -> dict[str, Any]:
    entry: dict[str, Any] = {"joint": coupling.joint}
    entry["other" if isinstance(coupling.other, str) else "others"] = coupling.other
    if coupling.polynomial is not None:
        entry["polynomial"] = coupling.polynomial
    else:
        entry |= {"ratio": coupling.ratio} if isinstance(coupling.other, str) else {}
        entry["offset"] = coupling.offset
    return entry | {"name": coupling.name}


# YAML ---------------------------------------------------------------------------------------------


def _list(key: str, entries: Sequence[Mapping[str, Any]]) -> list[str]:
    return [f"{key}:", *(f"  - {_value(entry)}" for entry in entries)] if entries else []


def _mapping(key: str, values: Mapping[str, Any]) -> list[str]:
    items = [f"  {_value(name)}: {_value(value)}" for name, value in values.items()]
    return [f"{key}:", *items] if items else []


def _value(value: Any) -> str:
    """Return a value in one line; arrays of one number are that number."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False) if _needs_quotes(value) else value
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_value(k)}: {_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    if isinstance(value, (Sequence, np.ndarray)):
        return "[" + ", ".join(map(_value, value)) + "]"
    return number(value)


def _needs_quotes(text: str) -> bool:
    """Return whether a text could be read as something else than this text."""
    plain = re.fullmatch(r"[A-Za-z_][A-Za-z0-9_./-]*", text)
    words = ("true", "false", "yes", "no", "on", "off", "null", "nan", "inf", "y", "n")
    return plain is None or text.lower() in words
