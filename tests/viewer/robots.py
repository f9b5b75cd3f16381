"""A small robot to look at: a swinging leg beside a floating platform."""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from rps_pin.viewer import write_html

URDF = """
<robot name="sample">
  <link name="base">
    <visual>
      <geometry><cylinder radius="{0.20}" length="{0.02}"/></geometry>
      <material name="steel"><color rgba="0.45 0.50 0.56 1"/></material>
    </visual>
  </link>
  <link name="cylinder/1">
    <visual>
      <origin xyz="0 0 {0.11}"/>
      <geometry><cylinder radius="{0.02}" length="{0.2}"/></geometry>
      <material name="blue"><color rgba="0.16 0.38 0.66 1"/></material>
    </visual>
    <visual>
      <origin rpy="1.5708 0 0"/>
      <geometry><cylinder radius="{0.025}" length="{0.06}"/></geometry>
      <material name="steel"/>
    </visual>
  </link>
  <link name="rod">
    <visual>
      <origin xyz="0 0 {-0.1}"/>
      <geometry><cylinder radius="{0.01}" length="{0.2}"/></geometry>
      <material name="bright"><color rgba="0.80 0.82 0.85 1"/></material>
    </visual>
    <visual>
      <geometry><sphere radius="{0.022}"/></geometry>
      <material name="bronze"><color rgba="0.75 0.52 0.22 1"/></material>
    </visual>
  </link>
  <link name="platform">
    <visual>
      <geometry><box size="{0.16} {0.16} {0.015}"/></geometry>
      <material name="red"><color rgba="0.78 0.25 0.20 1"/></material>
    </visual>
  </link>
  <joint name="swing" type="revolute">
    <parent link="base"/><child link="cylinder/1"/>
    <origin xyz="{0.12} 0 {0.02}"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="cylinder/1"/><child link="rod"/>
    <origin xyz="0 0 {0.2}"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="{0.2}" effort="1" velocity="1"/>
  </joint>
  <joint name="float" type="floating">
    <parent link="base"/><child link="platform"/>
  </joint>
</robot>
"""


@dataclass(frozen=True)
class Sample:
    """A swinging leg beside a floating platform, and a motion of two seconds."""

    model: pin.Model
    visual: pin.GeometryModel
    times: np.ndarray
    configurations: np.ndarray
    scale: float


def sample_robot(scale: float = 1.0) -> Sample:
    """Build the robot; `scale` multiplies every length, as for a small or a large one."""
    model, visual = build(scaled(URDF, scale))
    times = np.linspace(0.0, 2.0, 2001)
    configurations = np.array([configuration(model, t, scale) for t in times])
    return Sample(model, visual, times, configurations, scale)


def scaled(urdf: str, scale: float) -> str:
    """Multiply every number in braces."""
    return re.sub(r"\{([^}]+)\}", lambda found: repr(float(found[1]) * scale), urdf)


def build(urdf: str) -> tuple[pin.Model, pin.GeometryModel]:
    model = pin.buildModelFromXML(urdf)
    return model, pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.VISUAL)


def configuration(model: pin.Model, time: float, scale: float) -> np.ndarray:
    """Return the configuration at a time: the platform makes one full turn in the two seconds."""
    turn = np.pi * time
    q = pin.neutral(model)
    q[joint(model, "swing")] = 0.4 * np.sin(np.pi * time)
    q[joint(model, "slide")] = scale * 0.05 * (1.0 - np.cos(np.pi * time))
    lift = [-0.04 + 0.03 * np.sin(turn), 0.0, 0.30 + 0.04 * np.sin(turn)]
    quaternion = [0.0, 0.0, np.sin(turn / 2.0), np.cos(turn / 2.0)]
    start = joint(model, "float")
    q[start : start + 7] = [*(scale * np.array(lift)), *quaternion]
    return q


def joint(model: pin.Model, name: str) -> int:
    return int(model.joints[model.getJointId(name)].idx_q)


def motion_page(*motion, **options) -> str:
    """Return the page that `write_html` writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "page.html")
        write_html(path, *motion, **options)
        return path.read_text(encoding="utf-8")
