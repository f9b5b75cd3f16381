"""A mechanism with springs: its tree, its output and what loads it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.errors import InputError
from rps_pin.task.stiffness.compliances import DIRECTIONS, Compliances
from rps_pin.task.stiffness.elastic import ElasticSystem, Loads
from rps_pin.task.stiffness.springs import ElasticBuilder
from rps_pin.task.task import Task
from rps_pin.validation import real_vector

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class ElasticMechanism:
    """A mechanism with springs, and its output; see `StiffnessModel`."""

    def __init__(
        self,
        task: Task,
        compliances: Compliances,
        frame: str | None,
        gravity: bool,
    ) -> None:
        self.task, self.compliances = task, compliances
        mechanism = task.mechanism
        name, placement = task.output_frame
        if frame is not None:
            name, placement = frame, pin.SE3.Identity()
        output = None if name is None else (name, placement)
        self._tree = tree = ElasticBuilder(mechanism, compliances, output).tree
        self.model = tree.model
        if not gravity:
            self.model.gravity = pin.Motion.Zero()
        rigid = mechanism.system
        self.system = ConstraintSystem(
            self.model,
            tree.closures,
            mechanism.actuated,
            effects=tree.effects,
            characteristic_length=rigid.equations.length,
            max_condition=mechanism.max_condition,
        )
        self.system.equations.accept(rigid.equations.open_limit)
        self.output = DIRECTIONS if output else task.coordinates
        turns = tuple(name.startswith("r") for name in DIRECTIONS)
        self.angular = turns if output else task.angular
        driven = dict(compliances.actuators)
        actuated = dict(zip(mechanism.actuated, self.system.actuated, strict=True))
        of_springs = [actuated[one] for one in driven], tree.spring_v
        self._spring_v = np.concatenate(of_springs).astype(np.intp)
        self.springs = (*driven, *tree.names)
        self.stiffness = np.concatenate([np.array([*driven.values()]), tree.stiffness])
        if not self.springs and self.system.springs is None:
            raise InputError("nothing gives way: name actuators, joints, closures or beams")
        all_stiffness = np.zeros(self.model.nv)
        all_stiffness[self._spring_v] = self.stiffness
        held = [index for one, index in actuated.items() if one not in driven]
        #: Its equations, springs included.
        self.elastic = ElasticSystem(
            self.system, all_stiffness, np.array(held, dtype=np.intp), rigid.rule.tolerance
        )

    @property
    def spring_velocities(self) -> Indices:
        """Velocities of the springs, in the order of `springs`."""
        return self._spring_v

    def configuration(self, q: Array) -> Array:
        """Return the configuration of the tree with springs, springs at rest, shape (nq,)."""
        found = pin.neutral(self.model)
        found[self._tree.idx_q] = q
        return np.asarray(found)

    @property
    def rigid_velocities(self) -> Indices:
        """Where velocities of the rigid mechanism are among those of the tree, (nv,)."""
        return self._tree.idx_v

    def stretch(self, q: Array, q0: Array) -> Array:
        """Return how far springs are stretched at q from q0, in the order of `springs`."""
        return self.elastic.stretch(q, q0)[self._spring_v]

    def output_jacobian(self, q: Array) -> Array:
        """Return A, shape (p, nv): the output's twist in world axes, or joints' rates, is A v."""
        if self._tree.output is None:
            return np.eye(self.model.nv)[self._output_columns()]
        data, frame = self.system.data, self.system.frame(self._tree.output)
        found = pin.computeFrameJacobian(self.model, data, q, frame, _WORLD)
        return np.asarray(found.reshape(6, self.model.nv)).copy()

    def output_motion(self, q: Array, q0: Array) -> Array:
        """Return the output's displacement from q0 to q, shape (p,): shift and rotation vector."""
        if self._tree.output is None:
            columns = self._output_columns()
            return np.asarray(pin.difference(self.model, q0, q)[columns])
        frame, places = self.system.frame(self._tree.output), []
        for one in (q0, q):
            pin.framesForwardKinematics(self.model, self.system.data, one)
            places.append(pin.SE3(self.system.data.oMf[frame]))
        before, after = places
        turn = pin.log3(after.rotation @ before.rotation.T)
        return np.concatenate([after.translation - before.translation, turn])

    def _output_columns(self) -> list[int]:
        names = self.task.coordinates
        return [self.model.joints[self.model.getJointId(name)].idx_v for name in names]

    def loads(
        self,
        wrench: ArrayLike | None,
        wrenches: Wrenches | None,
        forces: Mapping[str, float] | None,
    ) -> Loads:
        """Return loads on the output, on other frames and on joints as one."""
        on_frames = dict(wrenches or {})
        force = np.zeros(self.model.nv)
        for name, value in (forces or {}).items():
            force[self.system.velocity_indices([name], "to load")] += value
        if wrench is not None:
            given = real_vector(wrench, len(self.output), "wrench")
            if self._tree.output is None:
                force[self._output_columns()] += given
            else:
                on_frames[self._tree.output] = given
        return Loads(on_frames, force)
