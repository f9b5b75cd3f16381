"""StiffnessModel: a mechanism with a task, and what gives way in it."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

from rps_pin.closed_loop.dynamics.wrenches import Wrenches
from rps_pin.one_thread import one_thread
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.task.stiffness.compliances import Compliances
from rps_pin.task.stiffness.deflection import Deflection, deflection_of
from rps_pin.task.stiffness.equilibrium import equilibrium
from rps_pin.task.stiffness.mechanism import ElasticMechanism
from rps_pin.task.task import Task
from rps_pin.validation import real_vector


@refuses_other_kinds
@one_thread("system.guard")
class StiffnessModel(ElasticMechanism):
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
    angular : tuple of bool
        Which of them are turns.
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
        super().__init__(task, compliances, frame, gravity)

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
        loads = self.loads(wrench, wrenches, forces)
        tangent = equilibrium(self.elastic, q0, loads, self.output_jacobian)
        return deflection_of(self, q0, tangent, loads)

    def at(self, x: ArrayLike, wrench: ArrayLike | None = None, **options: object) -> Deflection:
        """Return `deflection` at task coordinates x, shape (m,), in the assembly mode of home."""
        return self.deflection(self.task.configuration(x), wrench, **options)  # type: ignore[arg-type]
