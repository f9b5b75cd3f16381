"""Steps under stiff damping: order, limits, against adaptive steps, closed forms and MuJoCo."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from rps_pin import ClosedLoopModel, LoopClosure
from rps_pin.closed_loop import Stepper
from rps_pin.closed_loop.dynamics.passive_joint_forces import JointEffects
from rps_pin.closed_loop.simulation.damped import Damping, implicit_step
from tests.worst import worst

Array = NDArray[np.float64]


def slider(mass: float, **effects: Any) -> ClosedLoopModel:
    """A mass that falls along z."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(mass, 0.1), pin.SE3.Identity())
    of_slide = {name: {"slide": value} for name, value in effects.items()}
    return ClosedLoopModel(model, [], ["slide"], effects=JointEffects.named(model, **of_slide))


def slider_crank(damping: float, friction: float = 0.0) -> ClosedLoopModel:
    """A crank, a thin rod on a damped ball that spins about its length, and a carriage."""
    model = pin.Model()
    crank = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "crank")
    bar = pin.Inertia(0.2, np.array([0.05, 0.0, 0.0]), np.diag([1.3e-5, 1.7e-4, 1.7e-4]))
    model.appendBodyToJoint(crank, bar, pin.SE3.Identity())
    end = pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0]))
    rod = model.addJoint(crank, pin.JointModelSpherical(), end, "ball")
    thin = pin.Inertia(0.1, np.array([0.15, 1e-4, 0.0]), np.diag([1.3e-6, 7.9e-4, 7.9e-4]))
    model.appendBodyToJoint(rod, thin, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))
    model.addFrame(pin.Frame("tip", rod, tip, pin.FrameType.OP_FRAME))
    slide = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(slide, pin.Inertia.FromSphere(0.3, 0.02), pin.SE3.Identity())
    model.addFrame(pin.Frame("pin", slide, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    named = {"damping": {"ball": damping}, "friction": {"ball": friction}}
    effects = JointEffects.named(model, **named)
    start = [-0.8, 0.0, 0.4, 0.0, 0.9, 0.35]
    closure = LoopClosure("tip", "pin", name="pin")
    return ClosedLoopModel(model, [closure], ["crank"], effects=effects, home=start)


@pytest.mark.parametrize("damping", [0.01, 0.1])
def test_light_rod_on_a_damped_ball_as_by_adaptive_steps(damping: float) -> None:
    """Rates of 7,500 and 75,000 per second; steps of 1 ms, which order 4 cannot take."""
    mechanism = slider_crank(damping)
    q = mechanism.home
    found = mechanism.simulate(q, duration=0.05, step=1e-3)
    exact = mechanism.simulate(q, duration=0.05, step=1e-3, method="adaptive", tolerance=1e-9)
    assert worst(np.abs(found.q - exact.q)) < 2e-7
    assert worst(np.abs(found.v - exact.v)) < 2e-5
    assert worst(found.gap) <= 1e-12
    assert worst(np.abs(found.energy_balance)) < 1e-6 * exact.kinetic.max()


def test_light_rod_as_in_mujoco() -> None:
    """With implicit damping, in 20,000 steps and hard constraints."""
    mujoco = pytest.importorskip("mujoco")
    mechanism = slider_crank(0.01)
    text = """<mujoco><compiler angle="radian" inertiafromgeom="false"/>
    <option integrator="implicit" timestep="1e-5"/><worldbody>
    <body name="wheel"><joint name="crank" axis="0 1 0"/>
    <inertial pos=".05 0 0" mass=".2" diaginertia="1.3e-5 1.7e-4 1.7e-4"/>
    <body name="rod" pos=".1 0 0"><joint name="ball" type="ball" damping=".01"/>
    <inertial pos=".15 1e-4 0" mass=".1" diaginertia="1.3e-6 7.9e-4 7.9e-4"/></body></body>
    <body name="carriage" pos=".4 0 0"><joint name="slide" type="slide" axis="1 0 0"/>
    <inertial pos="0 0 0" mass=".3" diaginertia="1e-4 1e-4 1e-4"/></body></worldbody>
    <equality><connect body1="carriage" body2="rod" anchor="0 0 0" solref="2.1e-5 1"
    solimp=".9999 .9999 .001"/></equality></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data, q = mujoco.MjData(model), mechanism.home
    data.qpos[:] = [q[0], q[4], *q[1:4], q[5] - 0.4]
    for _ in range(5000):
        mujoco.mj_step(model, data)
    found = mechanism.simulate(q, duration=0.05, step=1e-3)
    np.testing.assert_allclose(found.v[-1], data.qvel, rtol=0, atol=1e-3 * abs(data.qvel).max())
    assert abs(found.q[-1, 0] - data.qpos[0]) < 1e-4


def test_order_of_stiff_steps_of_a_mechanism() -> None:
    """A rate of 75,000 per second: each step here is implicit, and errors fall as its power 4."""
    mechanism, duration = slider_crank(0.1), 0.048
    q, options = mechanism.home, {"method": "adaptive", "tolerance": 1e-11}
    exact = mechanism.simulate(q, duration=duration, step=duration, **options)
    steps = np.array([2e-3, 1e-3, 5e-4])
    ends = [mechanism.simulate(q, duration=duration, step=step) for step in steps]
    for name in ("q", "v"):
        errors = [np.abs(getattr(end, name)[-1] - getattr(exact, name)[-1]).max() for end in ends]
        np.testing.assert_allclose(-np.diff(np.log2(errors)), 4, rtol=0, atol=0.5)


def test_mujocos_implicit_steps_tend_to_the_same_motion() -> None:
    """A light rod on a damped ball under a pendulum: no closures, which are soft there.

    The error of implicitfast halves with its step, and what it tends to is our motion in steps of
    2 ms: at a rate of 3,000 per second.
    """
    mujoco = pytest.importorskip("mujoco")
    text = """<mujoco><compiler inertiafromgeom="false"/>
    <option integrator="implicitfast" timestep="{step}"/><worldbody>
    <body name="arm"><joint name="hinge" axis="0 1 0"/>
    <inertial pos=".1 0 0" mass=".5" diaginertia="1e-5 2e-3 2e-3"/>
    <body name="rod" pos=".2 0 0"><joint name="ball" type="ball" damping="0.01"/>
    <inertial pos="0 .02 -.1" mass=".05" diaginertia="1e-5 1e-5 3e-6"/></body></body></worldbody>
    <actuator><motor joint="hinge"/></actuator></mujoco>"""
    ends = []
    for step in (1e-4, 5e-5, 2.5e-5):
        model = mujoco.MjModel.from_xml_string(text.format(step=step))
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, round(0.1 / step))
        ends.append(data.qvel.copy())
    mechanism = ClosedLoopModel.from_mjcf(text.format(step=1e-3))
    motion = mechanism.simulate(mechanism.home, duration=0.1, step=2e-3)
    errors = [np.abs(end - motion.v[-1]).max() for end in ends]
    np.testing.assert_allclose(-np.diff(np.log2(errors)), 1, rtol=0, atol=0.1)
    limit = 2 * ends[2] - ends[1]
    assert worst(np.abs(limit - motion.v[-1])) < 0.02 * errors[2]


def test_order_and_stability_against_an_exponential() -> None:
    """v' = g - rate v, whose end is exact: order 4 in short steps, bounded in any."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    force, start = 9.0, 0.4

    def ended(rate: float, steps: int) -> tuple[float, float]:
        one = np.ones((1, 1))
        damping = Damping(one, np.array([rate]), one, rate * one)
        state, h = (np.zeros(1), np.array([start])), 1.0 / steps
        for k in range(steps):
            a = force - rate * state[1]
            state, _ = implicit_step(
                model, lambda t, q, v: force - rate * v, k * h, state, h, a, damping, lambda: 0.0
            )
        return float(state[0][0]), float(state[1][0])

    def exact(rate: float) -> tuple[float, float]:
        end, decay = force / rate, np.exp(-rate)
        return end + (start - end) * (1 - decay) / rate, end + (start - end) * decay

    errors = [np.abs(np.subtract(ended(3.0, n), exact(3.0))) for n in (10, 20, 40)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(orders[-1], 4, rtol=0, atol=0.3)
    for rate in (1e2, 1e4, 1e8):
        assert ended(rate, 10)[1] == pytest.approx(force / rate, rel=1e-6)


def test_falls_at_its_terminal_velocity() -> None:
    """1 g under 1 kN s/m: a rate of 1e6 per second; the power of the weight is the damping's."""
    mechanism = slider(1e-3, damping=1e3)
    motion = mechanism.simulate([0.0], duration=0.1, step=1e-2)
    terminal = -1e-3 * 9.81 / 1e3
    assert motion.v[-1, 0] == pytest.approx(terminal, rel=1e-9)
    assert motion.q[-1, 0] == pytest.approx(terminal * 0.1, rel=1e-3)
    assert motion.work[-1] == pytest.approx(1e-3 * 9.81 * motion.q[-1, 0], rel=1e-2)


def test_dry_friction_holds() -> None:
    """10 N of friction on 1 g: it creeps at v_s atanh(m g / f), instead of hunting."""
    mechanism = slider(1e-3, friction=10.0)
    motion = mechanism.simulate([0.0], duration=0.05, step=1e-3)
    creep = -1e-2 * np.arctanh(1e-3 * 9.81 / 10.0)
    assert motion.v[-1, 0] == pytest.approx(creep, rel=1e-6)


def test_steps_that_are_not_stiff_are_those_of_order_four() -> None:
    """Of a slow mode: as the exponential's series says, not as the implicit method."""
    rate, h = 5.0, 0.1
    mechanism = slider(1.0, damping=rate)
    v = mechanism.simulate([0.0], [1.0], duration=h, step=h).v[-1, 0]
    z = -rate * h
    series = 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24
    end = -9.81 / rate
    assert v == pytest.approx(end + (1 - end) * series, rel=1e-13)


def test_stepper_and_generated_code_take_the_same_steps() -> None:
    mechanism = slider_crank(0.01)
    q, v = mechanism.home, np.zeros(5)
    motion = mechanism.simulate(q, duration=0.02, step=1e-3)
    stepper = Stepper(mechanism, q)
    stepper.advance([0.0], 0.02, 20)
    np.testing.assert_allclose(stepper.q, motion.q[-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(stepper.v, motion.v[-1], rtol=0, atol=1e-9)
    pytest.importorskip("casadi")
    fast = mechanism.compile()
    generated = fast.simulate(q, duration=0.02, step=1e-3)
    np.testing.assert_allclose(generated.q[-1], motion.q[-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(generated.work, motion.work, rtol=0, atol=1e-12)
    for _ in range(20):
        q, v = fast.step(q, v, [0.0], 1e-3)
    np.testing.assert_allclose(q, motion.q[-1], rtol=0, atol=1e-12)
    qs, vs = fast.steps(mechanism.home, np.zeros(5), [0.0], 1e-3, 20)
    np.testing.assert_allclose(qs[-1], q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(vs[-1], v, rtol=0, atol=1e-9)
