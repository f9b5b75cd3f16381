"""What simulators' own elements in a URDF say of the dynamics: rotors, springs, loops, gravity.

Drake's rotor inertia is armature. What Gazebo, ros2_control and MuJoCo alone act on is harmless,
but for loops, which are refused, and for springs, weightless links and couplings, which are noted.
"""

from __future__ import annotations

from typing import Any

from rps_pin.closed_loop.io.urdf.elements import SIMPLE, UrdfFile, unknown
from rps_pin.closed_loop.io.urdf.vocabulary import child, children, get, tag_of

_TRUE = ("1", "true", "True")


def armature_of(file: UrdfFile) -> dict[str, float]:
    """Return gear_ratio^2 * rotor_inertia of Drake's actuators, by joint; kg m^2 or kg."""
    armature: dict[str, float] = {}
    places = [
        (actuator, joint.name)
        for joint in file.joints.values()
        for actuator in children(joint.element, "actuator")
    ]
    for transmission in children(file.robot, "transmission"):
        joint, actuator = child(transmission, "joint"), child(transmission, "actuator")
        if joint is not None and actuator is not None:
            places.append((actuator, get(joint, "name")))
    for actuator, name in places:
        rotor, gear = (child(actuator, f"drake:{word}") for word in ("rotor_inertia", "gear_ratio"))
        if rotor is None:
            continue
        if name not in file.joints:
            file.refuse(actuator, unknown("transmission", "joint", name, list(file.joints)))
        if file.joints[name].kind not in SIMPLE:
            file.refuse(rotor, f"joint {name!r} has several coordinates, and one rotor inertia")
        ratio = 1.0 if gear is None else file.number(gear, "value")
        armature[name] = armature.get(name, 0.0) + ratio**2 * file.number(rotor, "value")
    return armature


def look_into_extensions(file: UrdfFile) -> None:
    """Refuse loops in Gazebo's elements; note what Gazebo or ros2_control alone act on.

    Raises
    ------
    MechanismError
        With the line.
    """
    for gazebo in children(file.robot, "gazebo"):
        for element in gazebo.iterchildren("*"):
            _look_at(file, element)
    for control in children(file.robot, "ros2_control"):
        for joint in children(control, "joint"):
            _look_at_control(file, joint)


def _look_at(file: UrdfFile, element: Any) -> None:
    tag, text = tag_of(element), (element.text or "").strip()
    if tag in ("joint", "link", "model", "frame"):
        file.refuse(
            element,
            f"a <{tag}> of SDFormat in <gazebo> is not read; write it as part of the URDF, or a "
            "loop as a closure of the mechanism's description",
        )
    weightless = (tag == "turnGravityOff" and text in _TRUE) or (
        tag == "gravity" and text in ("0", "false", "False")
    )
    if weightless:
        link = str(get(element.getparent(), "reference"))
        file.remark(element, link, "links without gravity in Gazebo only, which have weight here")
    if tag in ("springStiffness", "spring_stiffness") and text not in ("", "0", "0.0"):
        file.note(element, f"<{tag}> acts in Gazebo only; give the joint's stiffness and rest")


def _look_at_control(file: UrdfFile, element: Any) -> None:
    name = get(element, "name")
    joint = file.joints.get(str(name))
    for param in children(element, "param"):
        if get(param, "name") == "mimic" and (joint is None or joint.mimic is None):
            file.note(
                param,
                f"ros2_control couples {name!r} with {(param.text or '').strip()!r}; only <mimic> "
                "in the joint itself, or a coupling of the description, does so here",
            )
