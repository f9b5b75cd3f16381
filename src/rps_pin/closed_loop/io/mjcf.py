"""Mechanisms from MuJoCo's files (MJCF): tree, loop closures, actuated joints, losses and springs.

Coordinates are MuJoCo's ``qpos`` (in Pinocchio's order of quaternions): a hinge or slide with a
``ref`` has that value where the file draws it. What is not read is refused, with its line; what
only concerns contacts, sensors, looks and the softness of constraints is passed over.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from rps_pin.closed_loop.constraints.closures import Closure, JointCoupling
from rps_pin.closed_loop.io.mjcf_equalities import Equalities, read_equalities
from rps_pin.closed_loop.io.mjcf_file import MjcfFile
from rps_pin.closed_loop.io.mjcf_tree import MjcfJoint, MjcfTree
from rps_pin.closed_loop.io.parts import MechanismParts
from rps_pin.errors import MechanismError

#: What an actuator may act on, by attribute; only the first two are joints.
_TRANSMISSIONS = (
    "joint",
    "jointinparent",
    "tendon",
    "site",
    "body",
    "cranksite",
    "slidersite",
)
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
        If it is no MJCF, or uses something that is not read here (elements that generate others,
        included files, bodies whose mass is that of a mesh, tendons with forces, equalities other
        than connect, weld and joint, actuators on something other than a joint); with the line.
    """
    file = MjcfFile(path_or_xml)
    for tag in ("extension", "deformable", "model"):
        for element in file.section(tag):
            file.refuse(element, "is not read")
    _refuse_tendons(file)
    tree = MjcfTree(file)
    equalities = read_equalities(file, tree)
    effects = _effects(file, tree, equalities)
    driven = _driven(file, tree) if actuated is None else _as_names(actuated)
    model, home = _held(tree, equalities, driven)
    return MechanismParts(
        model,
        (*equalities.closures, *closures),
        driven,
        home,
        **effects,
        name=file.root.get("model", ""),
    )


def _as_names(actuated: Sequence[str]) -> tuple[str, ...]:
    return (actuated,) if isinstance(actuated, str) else tuple(actuated)


def _driven(file: MjcfFile, tree: MjcfTree) -> tuple[str, ...]:
    """Return the joints that actuators act on, each once."""
    joints = {joint.name: joint for joint in tree.joints}
    found: list[str] = []
    for element in file.entries("actuator"):
        given = [name for name in _TRANSMISSIONS if name in element.attrib]
        if given not in (["joint"], ["jointinparent"]):
            what = f"acts on a {given[0]}" if given else "does not say what it acts on"
            file.refuse(
                element, f"{what}, not on a joint; name the actuated joints yourself (actuated)"
            )
        name = element.get(given[0])
        if name not in joints:
            file.refuse(element, f"acts on no joint {name!r}; there are: {', '.join(joints)}")
        if joints[name].kind not in ("hinge", "slide"):
            file.refuse(
                element,
                f"acts on {name!r} ({joints[name].kind}) about one axis of several; name the "
                "actuated joints yourself (actuated)",
            )
        if name not in found:
            found.append(name)
    return tuple(found)


def _effects(file: MjcfFile, tree: MjcfTree, equalities: Equalities) -> dict[str, Any]:
    """Return damping, dry friction and springs by joint name, as `MechanismParts` has them."""
    effects: dict[str, dict[str, float]] = {
        name: {} for name in ("damping", "friction", "stiffness", "rest")
    }
    for joint in tree.joints:
        if joint.name in equalities.fixed:
            continue
        for option, effect in (
            ("damping", "damping"),
            ("frictionloss", "friction"),
            ("stiffness", "stiffness"),
        ):
            value = _effect(file, joint, option)
            if value:
                effects[effect][joint.name] = value
        if joint.name in effects["stiffness"]:
            if joint.kind not in ("hinge", "slide"):
                file.refuse(joint.element, f"has a spring, which a {joint.kind} joint cannot have")
            rest = file.number(joint.element, joint.attributes, "springref")
            effects["rest"][joint.name] = file.angle(rest) if joint.kind == "hinge" else rest
    return effects


def _effect(file: MjcfFile, joint: MjcfJoint, option: str) -> float:
    if joint.attributes.get("springdamper", "0 0").split() != ["0", "0"]:
        file.refuse(joint.element, "has a springdamper, which is not read; give its stiffness")
    values = file.numbers(joint.element, joint.attributes, option)
    if values is None:
        return 0.0
    if values[1:].any():
        file.refuse(joint.element, f"has a {option} that is not linear, which is not read")
    if values[0] < 0:
        file.refuse(joint.element, f"has a negative {option}")
    return float(values[0])


def _refuse_tendons(file: MjcfFile) -> None:
    """Refuse tendons that exert forces of their own; others are only measured or driven."""
    for element in file.entries("tendon"):
        attributes = file.attributes(element, tag="tendon")
        for option in _TENDON_FORCES:
            values = file.numbers(element, attributes, option)
            if values is not None and values.any():
                file.refuse(element, f"is a tendon with {option}, which is not read")


def _held(
    tree: MjcfTree, equalities: Equalities, driven: tuple[str, ...]
) -> tuple[pin.Model, np.ndarray]:
    """Return the model without the joints that are held, and the home configuration in it."""
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
                f"joint {name!r} is held by an equality, so it cannot be coupled or actuated"
            )
    q = home.copy()
    ids = [model.getJointId(name) for name in equalities.fixed]
    q[[model.idx_qs[i] for i in ids]] = list(equalities.fixed.values())
    reduced = pin.buildReducedModel(model, ids, q)
    kept = [i for i in range(1, model.njoints) if i not in ids]
    parts = [home[model.idx_qs[i] : model.idx_qs[i] + model.nqs[i]] for i in kept]
    return reduced, np.concatenate(parts) if parts else np.empty(0)
