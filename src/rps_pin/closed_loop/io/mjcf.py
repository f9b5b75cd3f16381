"""Mechanisms from MuJoCo's files (MJCF): tree, loop closures, actuated joints, losses and springs.

Coordinates are MuJoCo's ``qpos`` (in Pinocchio's order of quaternions): a hinge or slide with a
``ref`` has that value at the placements of the file. Elements that are not read are refused, with
their line; those of contacts, sensors, appearance and the softness of constraints are not used.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.constraints.closures import Closure, JointCoupling
from rps_pin.closed_loop.io.mjcf_equalities import Equalities, read_equalities
from rps_pin.closed_loop.io.mjcf_file import MjcfElement, MjcfFile, children
from rps_pin.closed_loop.io.mjcf_tree import MjcfTree
from rps_pin.closed_loop.io.parts import EFFECTS, MechanismParts
from rps_pin.errors import MechanismError

#: Attributes for what an actuator acts on; only the first two are joints.
_TRANSMISSIONS = "joint", "jointinparent", "tendon", "site", "body", "cranksite", "slidersite"
_NAME_THEM = "name the actuated joints yourself (actuated)"
#: Effects at joints, by the attributes that give them.
_OPTIONS = {"damping": "damping", "frictionloss": "friction", "stiffness": "stiffness"}
_TENDON_FORCES = ("stiffness", "damping", "frictionloss", "armature")


def parts_from_mjcf(
    path_or_xml: str | os.PathLike[str],
    *,
    actuated: Sequence[str] | None = None,
    closures: Sequence[Closure] = (),
) -> MechanismParts:
    """Read a mechanism from an MJCF: a file's path, or its text (which begins with ``<``).

    The home configuration is that of the key frame called ``home``, or else ``qpos0``.

    Parameters
    ----------
    path_or_xml
        The file, or its text.
    actuated
        Names of the actuated joints. Left out, those that the file's actuators act on, in their
        order.
    closures
        Further closures; they come after those of the file's ``equality`` elements.

    Raises
    ------
    InputError
        If the file cannot be read.
    MechanismError
        If it is not an MJCF, or has something that is not read here (elements that generate others,
        included files, bodies whose mass is that of a mesh, tendons with forces, equalities other
        than connect, weld and joint, actuators on something other than a joint); with the line.
    """
    file = MjcfFile(path_or_xml)
    for tag in ("extension", "deformable", "model"):
        for section in file.sections(tag):
            section.refuse("is not read")
    _refuse_tendons(file)
    tree = MjcfTree(file)
    equalities = read_equalities(file, tree)
    if actuated is None:
        driven = _driven(file, tree)
    else:
        driven = (actuated,) if isinstance(actuated, str) else tuple(actuated)
    model, home = _reduced(tree, equalities, driven)
    return MechanismParts(
        model,
        (*equalities.closures, *closures),
        driven,
        home,
        **_effects(tree, equalities),
        name=file.root.get("model", ""),
    )


def _driven(file: MjcfFile, tree: MjcfTree) -> tuple[str, ...]:
    """Return the joints that actuators act on, each once."""
    joints = {joint.name: joint for joint in tree.joints}
    found: dict[str, None] = {}  # a set in order
    for section in file.sections("actuator"):
        for actuator in map(file.plain, children(section.xml)):
            given = [name for name in _TRANSMISSIONS if name in actuator]
            if given not in (["joint"], ["jointinparent"]):
                what = f"acts on a {given[0]}" if given else "does not say what it acts on"
                actuator.refuse(f"{what}, not on a joint; {_NAME_THEM}")
            name = actuator.get(given[0])
            if name not in joints:
                actuator.refuse(f"acts on no joint {name!r}; there are: {', '.join(joints)}")
            if joints[name].kind not in ("hinge", "slide"):
                actuator.refuse(
                    f"acts on {name!r} ({joints[name].kind}) about one axis of several; "
                    f"{_NAME_THEM}"
                )
            found[name] = None
    return tuple(found)


def _effects(tree: MjcfTree, equalities: Equalities) -> dict[str, Any]:
    """Return damping, dry friction and springs by joint name, as `MechanismParts` has them."""
    effects: dict[str, dict[str, float]] = {name: {} for name in EFFECTS}
    for joint in tree.joints:
        if joint.name in equalities.fixed:
            continue
        for option, effect in _OPTIONS.items():
            if value := _effect(joint.element, option):
                effects[effect][joint.name] = value
        if joint.name in effects["stiffness"]:
            if joint.kind not in ("hinge", "slide"):
                joint.element.refuse(f"has a spring, which a {joint.kind} joint cannot have")
            effects["rest"][joint.name] = joint.coordinate(joint.element.number("springref"))
    return effects


def _effect(joint: MjcfElement, option: str) -> float:
    if joint.get("springdamper", "0 0").split() != ["0", "0"]:
        joint.refuse("has a springdamper, which is not read; give its stiffness")
    values = joint.numbers(option)
    if values[1:].any():
        joint.refuse(f"has a {option} that is not linear, which is not read")
    if (values < 0).any():
        joint.refuse(f"has a negative {option}")
    return float(values.sum())


def _refuse_tendons(file: MjcfFile) -> None:
    """Refuse tendons with forces of their own; others are only measured or driven."""
    for tendon in file.entries("tendon"):
        for option in _TENDON_FORCES:
            if tendon.numbers(option).any():
                tendon.refuse(f"is a tendon with {option}, which is not read")


def _reduced(
    tree: MjcfTree, equalities: Equalities, driven: tuple[str, ...]
) -> tuple[pin.Model, Array]:
    """Return the model without the joints that are fixed, and the home configuration in it."""
    model = tree.model
    configurations = {entry.key(): entry.data() for entry in model.referenceConfigurations}
    home = np.array(configurations.get("home", configurations["qpos0"]))
    if not equalities.fixed:
        return model, home
    coupled = [c for c in equalities.closures if isinstance(c, JointCoupling)]
    used = {name for c in coupled for name in (c.joint, c.other)} | set(driven)
    for name in equalities.fixed:
        if name in used:
            raise MechanismError(
                f"joint {name!r} is fixed by an equality, so it cannot be coupled or actuated"
            )
    q = home.copy()
    ids = [model.getJointId(name) for name in equalities.fixed]
    q[[model.idx_qs[i] for i in ids]] = list(equalities.fixed.values())
    reduced = pin.buildReducedModel(model, ids, q)
    kept = [i for i in range(1, model.njoints) if i not in ids]
    parts = [home[model.idx_qs[i] : model.idx_qs[i] + model.nqs[i]] for i in kept]
    return reduced, np.concatenate(parts) if parts else np.empty(0)
