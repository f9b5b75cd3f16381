"""Order of the numbers in a mechanism's vectors, in words."""

from __future__ import annotations

from typing import NamedTuple

import pinocchio as pin

from rps_pin.closed_loop.constraints.closures import JointCoupling
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.codegen.export.names import quoted

_QUATERNION = tuple(f"quaternion {letter}" for letter in "xyzw")
_POSITION = tuple(f"position {letter}" for letter in "xyz")
_LENGTHS = (*_POSITION, "x", "y")
_LINEAR = tuple(f"linear velocity {letter}, in its own axes" for letter in "xyz")
_ANGULAR = tuple(f"angular velocity {letter}, in its own axes" for letter in "xyz")
#: Words for the entries of q and v of joints with several, by their kind.
_WORDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "JointModelFreeFlyer": (_POSITION + _QUATERNION, _LINEAR + _ANGULAR),
    "JointModelSpherical": (_QUATERNION, _ANGULAR),
    "JointModelPlanar": (
        ("x", "y", "cosine", "sine"),
        ("x, in its own axes", "y, in its own axes", "turn"),
    ),
    "JointModelTranslation": (tuple("xyz"), tuple("xyz")),
    "JointModelSphericalZYX": (("about z", "about y", "about x"),) * 2,
    "JointModelUniversal": (("first axis", "second axis"),) * 2,
}


class Entry(NamedTuple):
    """One number of a vector."""

    what: str
    """Of which joint or closure, quoted for comments."""
    unit: str


class Vectors(NamedTuple):
    """Entries of a mechanism's vectors, in order."""

    q: tuple[Entry, ...]
    v: tuple[Entry, ...]
    tau: tuple[Entry, ...]
    rows: tuple[Entry, ...]


def vectors(mechanism: ClosedLoopModel) -> Vectors:
    """Return the entries of q, v, tau and of the closures' rows; of v in rad and m, without /s."""
    q, v = _joints(mechanism)
    forces = {"rad": "N m", "m": "N"}
    actuated = [v[i] for i in mechanism.system.actuated]
    tau = tuple(Entry(entry.what, forces[entry.unit]) for entry in actuated)
    return Vectors(tuple(q), tuple(v), tau, tuple(_rows(mechanism)))


def _joints(mechanism: ClosedLoopModel) -> tuple[list[Entry], list[Entry]]:
    """Return the entries of q and v."""
    model: pin.Model = mechanism.model
    angular = mechanism.angular_velocities
    of_q, of_v = [Entry("", "")] * model.nq, [Entry("", "")] * model.nv
    for name, joint in list(zip(model.names, model.joints, strict=True))[1:]:
        units = ["rad" if angular[joint.idx_v + i] else "m" for i in range(joint.nv)]
        words_q, words_v = _WORDS.get(joint.shortname()) or _numbered(joint.nq, joint.nv)
        units_q = units
        if joint.nq != joint.nv:
            units_q = ["m" if word in _LENGTHS else "1" for word in words_q]
        for entries, start, words, own in (
            (of_q, joint.idx_q, words_q, units_q),
            (of_v, joint.idx_v, words_v, units),
        ):
            for i, (word, unit) in enumerate(zip(words, own, strict=True)):
                what = f"joint {quoted(name)}" + (f", {word}" if word else "")
                entries[start + i] = Entry(what, unit)
    return of_q, of_v


def _numbered(nq: int, nv: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    if (nq, nv) == (2, 1):
        return ("cosine", "sine"), ("",)
    of_q, of_v = (tuple(map(str, range(n))) if n > 1 else ("",) for n in (nq, nv))
    return of_q, of_v


def _rows(mechanism: ClosedLoopModel) -> list[Entry]:
    """Return the entries of gaps and multipliers."""
    angular, entries = mechanism.angular_rows, []
    for closure in mechanism.closures:
        rows = range(*mechanism.rows(closure.name).indices(mechanism.constraint_size))
        kind = "coupling" if isinstance(closure, JointCoupling) else str(closure.kind)
        axes = ", in world axes" if kind in ("spherical", "rigid") else ""
        for i, row in enumerate(rows):
            number = f", row {i}" if len(rows) > 1 else ""
            unit = "rad" if angular[row] else "m"
            entries.append(Entry(f"closure {quoted(closure.name)} ({kind}){number}{axes}", unit))
    return entries
