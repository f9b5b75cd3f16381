"""A mass on a slide, whose shortest times are known."""

from __future__ import annotations

from functools import cache

from rps_pin import ClosedLoopModel
from rps_pin.task import Task
from rps_pin.trajectories.point_to_point import LineCurve

WAY, MASS = 0.3, 2.0
ALONG = LineCurve([0.1], [0.1 + WAY])
BACK = LineCurve([0.1 + WAY], [0.1])


@cache
def slide(axis: str = "1 0 0", damping: float = 0.0) -> Task:
    """A mass of 2 kg on a slide, without limits."""
    mechanism = ClosedLoopModel.from_urdf(
        f"""<robot name="slide"><link name="base"/>
        <link name="mass"><inertial><mass value="{MASS}"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="slide" type="prismatic"><parent link="base"/><child link="mass"/>
        <axis xyz="{axis}"/><limit lower="-1" upper="1" effort="1e9" velocity="1e9"/>
        <dynamics damping="{damping}"/></joint></robot>""",
        closures=[],
        actuated=["slide"],
    )
    return Task(mechanism, joints=["slide"]).compile(compiler="tcc")
