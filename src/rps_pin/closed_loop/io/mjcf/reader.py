"""A mechanism of an MJCF: tree, closures, actuated joints, effects at joints, home."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from rps_pin.bounds import check_velocities
from rps_pin.closed_loop.column_names import joint_coordinates
from rps_pin.closed_loop.constraints.closures import Closure
from rps_pin.closed_loop.io.mjcf.actuators import Actuator, read_actuators
from rps_pin.closed_loop.io.mjcf.closures import read_equalities
from rps_pin.closed_loop.io.mjcf.collisions import collisions_of
from rps_pin.closed_loop.io.mjcf.effects import joint_effects, refuse_other_forces
from rps_pin.closed_loop.io.mjcf.numbers import refuse_wrong_numbers
from rps_pin.closed_loop.io.mjcf.source import MjcfSource
from rps_pin.closed_loop.io.mjcf.tendons import Tendons
from rps_pin.closed_loop.io.mjcf.tree import MjcfTree
from rps_pin.closed_loop.io.parts import MechanismParts
from rps_pin.closed_loop.io.unit_doubts import unit_doubts
from rps_pin.errors import warn_caller


def parts_from_mjcf(
    path_or_xml: str | os.PathLike[str],
    *,
    actuated: Sequence[str] | None = None,
    closures: Sequence[Closure] = (),
) -> MechanismParts:
    """Read a mechanism from an MJCF: a file's path, or its text (which begins with ``<``).

    MuJoCo compiles the file. The home configuration is that of the key frame called ``home``, or
    else ``qpos0``. What is in the file and is not part of the mechanism (actuators on sites, say)
    is told in a warning; contacts, sensors and appearance are not mentioned.

    Parameters
    ----------
    path_or_xml
        The file, or its text.
    actuated
        Names of the actuated joints. Left out, those joints and fixed tendons that the file's
        actuators act on, in their order.
    closures
        Further closures; they come after those of the file's ``equality`` elements.

    Raises
    ------
    InputError
        If the file cannot be read.
    MechanismError
        If MuJoCo refuses it, or it has forces or closures that are not read here; with the line.
        If it has more velocities than `bounds.MOST_VELOCITIES`.
    RPSPinError
        If MuJoCo is not installed (``rps-pin[mjcf]``).
    """
    source = MjcfSource(path_or_xml)
    check_velocities(source.model.nv, source.origin)
    refuse_wrong_numbers(source)
    refuse_other_forces(source)
    asked = (actuated,) if isinstance(actuated, str) else tuple(actuated or ())
    actuators = read_actuators(source)
    tree = MjcfTree(source)
    tendons = Tendons(tree, {one.target for one in actuators if one.kind == "tendons"}, asked)
    equalities = read_equalities(tree, tendons)
    effects: Mapping[str, Any] = joint_effects(tree, tendons, actuators)
    driven = asked if actuated is not None else _driven(tree, tendons, actuators)
    home = tree.add_key_frames()
    for what, places in source.told.items():
        warn_caller(f"{'; '.join(places)}: {what}")
    return MechanismParts(
        tree.model,
        (*equalities, *tendons.couplings, *closures),
        driven,
        home,
        **effects,
        name=source.name,
        notes=unit_doubts(tree.model),
        collision=collisions_of(tree),
        place_of=partial(_place_of, source, [closure.name for closure in equalities]),
    )


def _place_of(source: MjcfSource, names: Sequence[str], closure: str) -> str:
    """Return where the file has the equality of a closure; "" if it is none of its."""
    active = [int(number) for number in np.flatnonzero(source.model.eq_active0)]
    return source.at("equalities", active[names.index(closure)]) if closure in names else ""


def _driven(tree: MjcfTree, tendons: Tendons, actuators: Sequence[Actuator]) -> tuple[str, ...]:
    """Return the joints that actuators act on, each once, in the order of the actuators."""
    names = [
        tendons.names[one.target] if one.kind == "tendons" else tree.velocity(one.target, one.place)
        for one in actuators
        if one.active
    ]
    return _with_whole_joints(tree, list(dict.fromkeys(names)))


def _with_whole_joints(tree: MjcfTree, names: list[str]) -> tuple[str, ...]:
    """Return names with a joint's in the place of those of all of its coordinates in turn."""
    for joint in list(tree.model.names)[1:]:
        each = list(joint_coordinates(tree.model, joint))
        if each and each[0] in names:
            start = names.index(each[0])
            if names[start : start + len(each)] == each:
                names[start : start + len(each)] = [joint]
    return tuple(names)
