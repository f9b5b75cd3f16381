"""StiffnessModel: a mechanism with a task, and what gives way in it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.constraints.system import ConstraintSystem
from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.errors import InputError
from rps_pin.one_thread import one_thread
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.stiffness.compliances import DIRECTIONS, Compliances
from rps_pin.task.stiffness.deflection import Deflection, deflection_of
from rps_pin.task.stiffness.elastic import ElasticSystem, Loads
from rps_pin.task.stiffness.equilibrium import equilibrium
from rps_pin.task.stiffness.springs import ElasticBuilder
from rps_pin.task.task import Task
from rps_pin.validation import real_vector

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@refuses_other_kinds
@one_thread("system.guard")
class StiffnessModel:
    """A mechanism with a task, and what gives way in it.

    The actuators hold their commanded positions; see `elastic` for the equations. The output is the
    task's frame, in all six directions (also those that the task does not have), or the joints of a
    task of joints.

    Parameters
    ----------
    task
        Any task.
    compliances
        What gives way.
    frame
        Name of another frame as the output.
    gravity
        Whether weight counts.

    Attributes
    ----------
    task, compliances
        As given.
    model : pin.Model
        The tree with a joint for each spring.
    system : ConstraintSystem
        Its equations.
    output : tuple of str
        Names of the output's directions: ``x`` to ``rz`` of a frame (world axes), or joints.
    springs : tuple of str
        Names of the springs, actuators first: ``leg``, ``hinge.x``, ``knee.ry``, ``arm[2].rz``.
    stiffness : array
        Theirs, N/m or N m/rad.

    Raises
    ------
    InputError
        If nothing gives way.
    MechanismError
        If something is named that there is not, a beam does not fit its link, or a bearing gives
        way where its joint moves freely.
    """

    def __init__(
        self,
        task: Task,
        compliances: Compliances,
        *,
        frame: str | None = None,
        gravity: bool = True,
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
        self._elastic = ElasticSystem(
            self.system, all_stiffness, np.array(held, dtype=np.intp), rigid.rule.tolerance
        )

    def __repr__(self) -> str:
        return f"StiffnessModel({len(self.springs)} springs; {self.task!r})"

    def deflection(
        self,
        q: ArrayLike,
        wrench: ArrayLike | None = None,
        *,
        wrenches: Wrenches | None = None,
        forces: Mapping[str, float] | None = None,
    ) -> Deflection:
        """Return how the mechanism gives way under loads, and its stiffness there.

        Parameters
        ----------
        q
            Nominal closed configuration, shape (nq,): springs are without load there.
        wrench
            Load on the output, shape (6,): (force, moment) in world axes, N and N m, of constant
            direction; on a task of joints the generalised forces, shape (m,).
        wrenches
            Wrenches on other frames of the mechanism, by name, in world axes.
        forces
            Forces on joints by name, N or N m.

        Returns
        -------
        Deflection

        Raises
        ------
        ClosureError
            If the loops are open.
        SingularityError
            If nothing holds the output, or there is no stable equilibrium near.
        """
        q_ = real_vector(q, self.task.mechanism.model.nq, "q")
        self.task.mechanism.system.equations.jacobian(q_)
        self.task.mechanism.system.refuse_open(q_)
        q0 = self.configuration(q_)
        loads = self._loads(wrench, wrenches, forces)
        tangent = equilibrium(self._elastic, q0, loads, self.output_jacobian)
        return deflection_of(self, q0, tangent, loads)

    def at(self, x: ArrayLike, wrench: ArrayLike | None = None, **options: object) -> Deflection:
        """Return `deflection` at task coordinates x, shape (m,), in the assembly mode of home."""
        return self.deflection(self.task.configuration(x), wrench, **options)  # type: ignore[arg-type]

    # Parts ----------------------------------------------------------------------------------------

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
        return self._elastic.stretch(q, q0)[self._spring_v]

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

    def _loads(
        self,
        wrench: ArrayLike | None,
        wrenches: Wrenches | None,
        forces: Mapping[str, float] | None,
    ) -> Loads:
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
