"""Numbers of an MJCF that MuJoCo compiles and that mean nothing: not finite, huge, or reversed.

A range may have an infinite end. MuJoCo takes a reversed one for none, unless ``limited`` is true.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rps_pin.arrays import Array
from rps_pin.closed_loop.io.mjcf.source import MjcfSource
from rps_pin.errors import MechanismError
from rps_pin.validation import LARGEST

#: Arrays of MuJoCo's model that are read, by its lists of elements; there may be more of others.
_READ = {
    "bodies": ("pos", "quat", "ipos", "iquat", "mass", "inertia", "gravcomp"),
    "joints": ("pos", "axis", "stiffness", "springyield"),
    "sites": ("pos", "quat"),
    "tendons": ("stiffness", "damping", "frictionloss", "armature", "lengthspring"),
    "equalities": ("data",),
    "actuators": ("gear", "armature", "damping"),
}
#: How far the length of an axis may be from 1: MuJoCo makes it so, where it can.
_UNIT = 1e-6
_PREFIXES = {
    "bodies": "body",
    "joints": "jnt",
    "sites": "site",
    "tendons": "tendon",
    "equalities": "eq",
    "actuators": "actuator",
}
_OF_VELOCITIES = ("armature", "damping", "frictionloss")
_RANGES = {
    "joints": ("range", "actfrcrange"),
    "tendons": ("range", "actfrcrange"),
    "actuators": ("forcerange", "ctrlrange"),
}


def refuse_wrong_numbers(source: MjcfSource) -> None:
    """Refuse numbers that are not finite, and tell of ranges that are reversed.

    Raises
    ------
    MechanismError
        With the line of the element.
    """
    if not (np.abs(source.model.opt.gravity) <= LARGEST).all():
        raise MechanismError(
            f"{source.setting('option', attribute='gravity')}: gravity is not finite, or beyond "
            f"{LARGEST:g}"
        )
    for kind, number, name, values in _numbers(source):
        if not (np.abs(values) <= LARGEST).all():
            why = f"beyond {LARGEST:g}" if np.isfinite(values).all() else "not finite"
            source.refuse(kind, number, f"has {name} = {_shown(values)}, which is {why}")
    for number, axis in enumerate(source.model.jnt_axis):
        if abs(np.linalg.norm(axis) - 1) > _UNIT:
            source.refuse("joints", number, f"has an axis without direction: {_shown(axis)}")
    for kind, names in _RANGES.items():
        for name in names:
            ranges = getattr(source.model, f"{_PREFIXES[kind]}_{name}", np.empty((0, 2)))
            for number, (low, high) in enumerate(ranges):
                if np.isnan([low, high]).any():
                    source.refuse(kind, number, f"has a range of {low:g} to {high:g}")
                if low > high:
                    source.tell(kind, number, f"a range of {low:g} to {high:g} counts for none")


def _numbers(source: MjcfSource) -> Iterator[tuple[str, int, str, Array]]:
    """Yield what is read of each element: its list and number, a name, and the numbers."""
    m = source.model
    for kind, names in _READ.items():
        for name in names:
            array = np.asarray(getattr(m, f"{_PREFIXES[kind]}_{name}", ()), dtype=np.float64)
            if not (np.abs(array) <= LARGEST).all():
                yield from ((kind, i, name, np.atleast_1d(one)) for i, one in enumerate(array))
    for name in _OF_VELOCITIES:
        for velocity, one in enumerate(getattr(m, f"dof_{name}")):
            yield "joints", int(m.dof_jntid[velocity]), name, np.atleast_1d(one)
    coordinates = {"ref": m.qpos0, "springref": m.qpos_spring}
    for joint, first in enumerate(m.jnt_qposadr):
        end = m.jnt_qposadr[joint + 1] if joint + 1 < m.njnt else m.nq
        for name, array in coordinates.items():
            yield "joints", joint, name, array[first:end]
    for tendon, (first, count) in enumerate(zip(m.tendon_adr, m.tendon_num, strict=True)):
        yield "tendons", tendon, "coef", m.wrap_prm[first : first + count]


def _shown(values: Array) -> str:
    return " ".join(f"{value:g}" for value in np.ravel(values))
