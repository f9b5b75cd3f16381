"""Damping, dry friction and springs of joints, what switches them off, and what is refused."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rps_pin import JointEffects, MechanismError
from rps_pin.closed_loop.dynamics.springs import Springs
from rps_pin.closed_loop.io.mjcf import parts_from_mjcf
from rps_pin.closed_loop.io.mjcf.source import MjcfSource
from tests.closed_loop.io.mjcf.twin import BODY, Twin, fourbar, mujoco_file
from tests.each import each
from tests.worst import worst

DEFAULTS = """<default><joint axis="0 1 0" damping="0.3" armature="0.01"/>
    <geom type="box" size="0.1 0.2 0.3" quat="1 1 0 0"/><site pos="0.1 0 0"/>
    <default class="arm"><joint damping="2" frictionloss="0.4"/><geom size="0.2" euler="10 0 0"/>
      <default class="hand"><joint type="slide" stiffness="3" springref="0.2"/></default>
    </default></default>"""


def defaults(*others: str) -> str:
    return mujoco_file(
        """<body name="a" childclass="arm"><joint name="ja"/><geom/>
          <body name="b"><joint name="jb" class="hand"/><geom class="main"/><site name="s"/>
            <body name="c" childclass="hand"><joint name="jc" range="-1 2"/><geom/></body></body>
        </body><body name="e"><joint name="je" stiffness="2" springref="30"/><geom/></body>
        <body name="f"><joint name="jf" springdamper="0.1 1"/><geom/></body>""",
        DEFAULTS,
        *others,
    )


def flags(**values: str) -> str:
    words = " ".join(f'{name}="{value}"' for name, value in values.items())
    return f"<option><flag {words}/></option>"


@each(
    "settings",
    [
        "",
        flags(spring="disable"),
        flags(damper="disable"),
        flags(spring="disable", damper="disable"),
    ],
)
def test_springs_and_dampers_are_mujocos(settings: str) -> None:
    twin = Twin(defaults(settings))
    rng = np.random.default_rng(0)
    for _ in range(3):
        twin.random(rng)
        own, right = twin.passive()
        assert worst(own - right) < 1e-12 * max(1.0, worst(right))
        assert (worst(right) == 0) == ("spring" in settings and "damper" in settings)


@each(("settings", "friction"), [("", 0.4), (flags(frictionloss="disable"), None)])
def test_dry_friction_is_mujocos(settings: str, friction: float | None) -> None:
    found = parts_from_mjcf(defaults(settings)).friction
    assert found == ({} if friction is None else dict.fromkeys(("ja", "jb", "jc"), friction))


def test_damping_of_balls_and_free_joints_is_mujocos() -> None:
    text = mujoco_file(
        BODY.replace('"j"', '"j" type="ball" damping="0.3"')
        + BODY.replace('"b"', '"c"').replace('"j"', '"k" type="free" damping="0.7"')
    )
    twin = Twin(text)
    rng = np.random.default_rng(0)
    for _ in range(3):
        twin.random(rng)
        assert worst(twin.passive()[0] - twin.passive()[1]) < 1e-12


BALL = BODY.replace('"j"', '"j" type="ball" stiffness="0.8"').replace(
    '"b"', '"b" quat="0.8 0.2 -0.5 0.3"'
)
FREE = BODY.replace('"b"', '"c" pos="0.3 -0.2 1" quat="0.8 0.2 -0.5 0.3"')
BALL_AND_FREE = {
    "ball": BALL,
    "free": FREE.replace('"j"', '"k" type="free" stiffness="7" damping="0.2"'),
    "free with a rotor": FREE.replace('"j"', '"k" type="free" stiffness="7" armature="0.1"'),
    "both": BALL + FREE.replace('"j"', '"k" type="free" stiffness="7"'),
    "spring and damper": BALL.replace('stiffness="0.8"', 'springdamper="0.5 1"'),
}


@each("text", BALL_AND_FREE.values(), ids=BALL_AND_FREE)
def test_springs_of_balls_and_free_joints_are_mujocos(text: str) -> None:
    """A free joint is at rest where its body is in the file, a ball at the unit quaternion."""
    twin = Twin(mujoco_file(text, flags(energy="enable", gravity="disable")))
    rng, springs = np.random.default_rng(0), []
    for _ in range(20):
        twin.random(rng, 2.0)
        own, right = twin.passive()
        assert worst(own - right) < 1e-12 * max(1.0, worst(right))
        springs.append(worst(twin.d.qfrc_spring))
        energy = Springs(twin.model, twin.effects()).energy(twin.q)
        assert energy == pytest.approx(twin.d.energy[0], rel=1e-12)
    assert min(springs) > 0.1
    twin.set(twin.m.qpos0, 0 * twin.d.qvel)
    assert worst(*twin.passive()) < 1e-15


@each("kind", ["ball", "free"])
def test_springs_at_rest_elsewhere_are_mujocos(kind: str) -> None:
    """MuJoCo's files cannot say so, its models can: ``qpos_spring``."""
    twin, rng = Twin(mujoco_file(BALL_AND_FREE[kind])), np.random.default_rng(1)
    name, m = twin.parts.model.names[1], twin.m
    for _ in range(10):
        turn = Rotation.random(random_state=rng)
        m.qpos_spring[-4:] = turn.as_quat(scalar_first=True)
        m.qpos_spring[:-4] = rng.normal(size=m.nq - 4)
        rest = np.concatenate([m.qpos_spring[:-4], turn.as_rotvec()])
        effects = JointEffects.named(twin.model, stiffness=twin.parts.stiffness, rest={name: rest})
        twin.random(rng, 2.0)
        own = -twin.L.T @ Springs(twin.model, effects).force(twin.q)
        assert worst(own - twin.d.qfrc_spring) < 1e-12 * worst(twin.d.qfrc_spring)


MEDIUM = "forces of a medium are not read; a mechanism in vacuum has 0"
FLEX = """<body><joint axis="0 1 0"/><geom size="0.1"/></body>
    <flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" radius=".01" dim="2"/>"""


def joint(options: str) -> str:
    return mujoco_file(BODY.replace('"j"', f'"j" {options}'))


REFUSED: dict[str, Any] = {
    "density": (mujoco_file(BODY, '<option density="1.2"/>'), "option has density = 1.2: "),
    "viscosity": (mujoco_file(BODY, '<option viscosity="0.1"/>'), MEDIUM),
    "flex": (mujoco_file(FLEX), "flexcomp is flexible, which is not read"),
    "stiffness": (joint('stiffness="1 2"'), "joint 'j' has a stiffness that is not linear"),
    "damping": (joint('damping="1 2"'), "joint 'j' has a damping that is not linear"),
    "negative": (joint('damping="-1"'), "joint 'j' has a negative damping"),
    "yield": (joint('stiffness="1" springyield="3"'), "joint 'j' has a spring that yields"),
    "armature": (joint('armature="-1"'), "joint 'j' has a negative armature"),
}


@each(("text", "why"), REFUSED.values(), ids=REFUSED)
def test_forces_that_are_not_read_are_refused_with_their_line(text: str, why: str) -> None:
    with pytest.raises(MechanismError, match=rf"the MJCF text, line \d: .*{why}"):
        parts_from_mjcf(text)


def test_no_medium_acts_where_all_passive_forces_are_off() -> None:
    off = flags(spring="disable", damper="disable")
    text = mujoco_file(BODY, '<option density="1.2"/>', off)
    twin = Twin(text)
    twin.random(np.random.default_rng(0))
    assert not twin.d.qfrc_passive.any()


def test_older_mujocos_have_one_flag_for_springs_and_dampers() -> None:
    """`passive`; 3.3.2 has it."""
    source = MjcfSource(fourbar())
    source.mujoco = SimpleNamespace(mjtDisableBit=SimpleNamespace(mjDSBL_PASSIVE=32))
    assert not source.without_passive_forces
    source.model.opt.disableflags = 32
    assert source.disabled("spring") and source.disabled("damper")
    assert source.without_passive_forces and not source.disabled("gravity")


def test_wind_without_a_medium_is_nothing() -> None:
    assert parts_from_mjcf(fourbar('<option wind="1 2 3"/>')).model.nv == 3
