"""urdf/slider_crank.yaml, and the same with a slider in the tree, against the textbook.

The file has no slider: its piston is held on a line. Here it gets one, as a link on a prismatic
joint that a pin joins to the coupler; and a pin in the tree whose piston a cylinder guides.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from lxml import etree

from rps_pin import ClosedLoopModel, LoopClosure
from tests.proofs import common
from tests.reference import slider_crank, virtual_power
from tests.reference.newton_euler import Jet

GUIDE = "0 0 0.03"
MASSLESS = '<link name="{}"/>'
INERTIAL = (
    '<inertial><mass value="0.6"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" '
    'iyz="0"/></inertial>'
)


def joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>'
        '<limit lower="-9" upper="9" effort="9" velocity="9"/></joint>'
    )


def changed_file(piston: str, *parts: str) -> str:
    """The file's text with another piston, and more parts."""
    tree = etree.parse(common.URDF / "slider_crank.urdf").getroot()
    for element in tree.xpath("*[@name='piston' or @name='piston_joint']"):
        tree.remove(element)
    for part in (piston, *parts):
        tree.append(etree.fromstring(part))
    text: str = etree.tostring(tree, encoding="unicode")
    return text


def on_line() -> ClosedLoopModel:
    return common.loaded("slider_crank")


def with_slider() -> ClosedLoopModel:
    """Crank and coupler, and a slider on the guide; a pin between coupler and slider."""
    text = changed_file(
        f'<link name="piston">{INERTIAL}</link>',
        MASSLESS.format("coupler_tip"),
        joint("slider_joint", "prismatic", "base", "piston", GUIDE, "1 0 0"),
        joint("coupler_tip_joint", "fixed", "coupler", "coupler_tip", "0.35 0 0", "1 0 0"),
    )
    closure = LoopClosure("coupler_tip", "piston", "revolute", name="pin", axis=[0, 1, 0])
    return ClosedLoopModel.from_urdf(text, [closure], ["crank_joint"])


def in_cylinder() -> ClosedLoopModel:
    """Crank, coupler, and a piston that is pinned to it and slides in a cylinder (4 rows)."""
    text = changed_file(
        f'<link name="piston">{INERTIAL}</link>',
        joint("pin_joint", "revolute", "coupler", "piston", "0.35 0 0", "0 -1 0"),
    )
    closure = LoopClosure("guide", "piston", "cylindrical", name="slide", axis=[1, 0, 0])
    return ClosedLoopModel.from_urdf(text, [closure], ["crank_joint"])


VARIANTS = [on_line, with_slider, in_cylinder]
every_variant = pytest.mark.parametrize("make", VARIANTS, ids=lambda make: make.__name__)


def state(mechanism: ClosedLoopModel, curve: Jet) -> common.State:
    joints = slider_crank.joints(curve)
    return common.state(mechanism, {n: joints[n] for n in list(mechanism.model.names)[1:]})


def moments(values: Sequence[float], rate: float = 0.0, pull: float = 0.0) -> list[Jet]:
    return [Jet(np.array([x]), np.array([rate]), np.array([pull])) for x in values]


@common.both_engines
@every_variant
def test_closes_from_rough_guesses(make: Callable[[], ClosedLoopModel], engine: str) -> None:
    """Near a closed configuration, but off by tenths of radians and decimetres."""
    mechanism, rng = common.through(engine, make()), np.random.default_rng(0)
    q, _, _ = state(mechanism, moments([0.5])[0])
    for _ in range(30):
        closed = mechanism.close(q + rng.normal(scale=0.3, size=q.size))
        assert mechanism.loop_gap(closed) <= 1e-12
        (piston,) = common.points(mechanism, closed, "piston")
        np.testing.assert_allclose(piston[1:], [0.0, slider_crank.HEIGHT], rtol=0, atol=1e-12)


@common.both_engines
@every_variant
def test_stroke_over_a_whole_turn(make: Callable[[], ClosedLoopModel], engine: str) -> None:
    mechanism = common.through(engine, make())
    q, _, _ = state(mechanism, moments([-3.0])[0])
    for curve in moments(np.linspace(-3.0, 3.0, 61)):
        q = mechanism.complete({"crank_joint": curve.value[0]}, q)
        (piston,) = common.points(mechanism, q, "piston")
        expected = [slider_crank.stroke(curve).value, 0.0, slider_crank.HEIGHT]
        np.testing.assert_allclose(piston, expected, rtol=0, atol=1e-12)


@common.both_engines
@every_variant
def test_dynamics_along_a_motion(make: Callable[[], ClosedLoopModel], engine: str) -> None:
    mechanism = common.through(engine, make())
    for curve in common.swing(0.4, 3.0, 4.0, count=25):
        q, v, a = state(mechanism, curve)
        common.check_motion(mechanism, q, v, a)
        expected = virtual_power.generalised_forces(
            slider_crank.bodies, curve.value, curve.first, curve.second
        )
        common.check_forces(mechanism, q, v, a, expected)


@common.both_engines
def test_the_guide_pushes_as_lagrange_says(engine: str) -> None:
    """On the piston, upwards; frame a of the closure is the guide, and feels the opposite."""
    mechanism = common.through(engine, on_line())
    absolute = np.array([[1.0, 0], [1, 1]])
    for curve in common.swing(0.4, 3.0, 4.0):
        q, v, a = state(mechanism, curve)
        result = mechanism.inverse_dynamics(q, v, a)
        force = mechanism.closure_wrenches(q, result.constraint_forces)["slide"][:3]
        _, push = slider_crank.equations().inverse_dynamics(
            absolute @ q, absolute @ v, absolute @ a, [0]
        )
        np.testing.assert_allclose(force, [0, 0, -push[0]], rtol=0, atol=1e-9 * abs(push[0]))


@pytest.mark.parametrize(
    ("make", "rows", "rank"), list(zip(VARIANTS, (2, 5, 4), (1, 2, 2), strict=True))
)
def test_describes_a_mobility_of_one(
    make: Callable[[], ClosedLoopModel], rows: int, rank: int
) -> None:
    common.check_description(make(), rows=rows, rank=rank, mobility=1)
