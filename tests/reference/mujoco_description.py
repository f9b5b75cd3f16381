"""A description (YAML and URDF) in MuJoCo, which reads the URDF itself: tree, closures, effects.

What a URDF cannot say is put into its text, in MuJoCo's own words: joints that the description
merges become one ``spherical`` joint, a free root a ``floating`` one. Closures become equalities,
couplings equalities of a fixed tendon. Nothing of the package's readers is used.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from lxml import etree
from ruamel.yaml import YAML

URDF = Path(__file__).resolve().parents[2] / "urdf"
_OPTIONS = {
    "balanceinertia": "false",
    "boundmass": "0",
    "boundinertia": "0",
    "discardvisual": "true",
}


def compiled(name: str) -> Any:
    """Return MuJoCo's model of urdf/NAME.yaml."""
    description = YAML(typ="safe", pure=True).load((URDF / f"{name}.yaml").read_text("utf-8"))
    tree = etree.fromstring((URDF / description["urdf"]).read_bytes())
    for merge in description.get("merge", []):
        _merge(tree, merge["joints"], merge["name"])
    if description.get("root") == "free":
        _free(tree)
    extension = etree.SubElement(tree, "mujoco")
    etree.SubElement(extension, "compiler", _OPTIONS)
    spec = mujoco.MjSpec.from_string(etree.tostring(tree, encoding="unicode"))
    for closure in description.get("closures", []):
        _close(spec, closure)
    for number, coupling in enumerate(description.get("couplings", [])):
        _couple(spec, coupling, f"coupling_{number}")
    model = spec.compile()
    _add_effects(model, description)
    return model


def _joints(tree: Any) -> dict[str, Any]:
    return {joint.get("name"): joint for joint in tree.findall("joint")}


def _merge(tree: Any, names: list[str], merged: str) -> None:
    """Replace three joints by one ball from the first one's parent to the last one's child."""
    first, *between, last = (_joints(tree)[name] for name in names)
    massless = {first.find("child").get("link"), *(b.find("child").get("link") for b in between)}
    last.find("parent").set("link", first.find("parent").get("link"))
    last.find("origin").attrib.update(first.find("origin").attrib)
    last.attrib.update({"name": merged, "type": "spherical"})
    for limit in last.findall("limit"):
        last.remove(limit)
    for joint in (first, *between):
        assert joint is first or joint.find("origin").get("xyz") == "0 0 0"
        tree.remove(joint)
    for link in tree.findall("link"):
        if link.get("name") in massless:
            assert link.find("inertial") is None
            tree.remove(link)


def _free(tree: Any) -> None:
    children = {joint.find("child").get("link") for joint in tree.findall("joint")}
    (root,) = [n for link in tree.findall("link") if (n := link.get("name")) not in children]
    etree.SubElement(tree, "link", name="ground")
    joint = etree.SubElement(tree, "joint", name="root_joint", type="floating")
    etree.SubElement(joint, "parent", link="ground")
    etree.SubElement(joint, "child", link=root)


def _close(spec: Any, closure: dict[str, Any]) -> None:
    """Connect the origins of two links; of two points for a revolute closure."""
    points = [np.zeros(3)]
    if closure["kind"] == "revolute":
        points.append(np.array(closure["axis"], dtype=float))
    else:
        assert closure["kind"] == "spherical"
    for number, point in enumerate(points):
        names = []
        for frame in (closure["frame_a"], closure["frame_b"]):
            names.append(f"{closure['name']}_{frame}_{number}")
            spec.body(frame).add_site(name=names[-1], pos=point)
        one = spec.add_equality(type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_SITE)
        one.name1, one.name2 = names


def _couple(spec: Any, coupling: dict[str, Any], name: str) -> None:
    """Keep a fixed tendon q - sum of ratio times q_other at its length, that at zero angles."""
    assert not coupling.get("offset")
    others = coupling.get("others") or {coupling["other"]: coupling.get("ratio", 1.0)}
    tendon = spec.add_tendon(name=name)
    tendon.wrap_joint(coupling["joint"], 1.0)
    for other, ratio in others.items():
        tendon.wrap_joint(other, -ratio)
    one = spec.add_equality(type=mujoco.mjtEq.mjEQ_TENDON, objtype=mujoco.mjtObj.mjOBJ_TENDON)
    one.name1 = name


def _add_effects(model: Any, description: dict[str, Any]) -> None:
    for key, array in (("armature", model.dof_armature), ("damping", model.dof_damping)):
        for joint, value in description.get(key, {}).items():
            array[model.joint(joint).dofadr[0]] = value
    for joint, value in description.get("stiffness", {}).items():
        model.jnt_stiffness[model.joint(joint).id] = value
    for joint, value in description.get("rest", {}).items():
        model.qpos_spring[model.joint(joint).qposadr[0]] = value
    mujoco.mj_setConst(model, mujoco.MjData(model))
