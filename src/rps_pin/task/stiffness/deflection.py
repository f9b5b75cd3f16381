"""Deflection: what a mechanism with springs does under its loads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array
from rps_pin.closed_loop.dynamics.wrenches import closure_wrenches, forces_on_joints
from rps_pin.errors import SingularityError
from rps_pin.task.stiffness.elastic import Loads
from rps_pin.task.stiffness.equilibrium import Tangent
from rps_pin.task.stiffness.mechanism import ElasticMechanism

#: Share of the largest reaction in which a closure that is not determined must take part.
_PART = 1e-9
#: Share of the largest compliance, in one unit, below which a direction is rigid.
_RIGID = 1e-12


@dataclass(frozen=True, eq=False)
class Deflection:
    """What a mechanism with springs does under its loads.

    Attributes
    ----------
    output : tuple of str
        Names of the output's directions.
    angular : tuple of bool
        Which of them are turns.
    displacement : array
        Of the output from its nominal place, shape (p,): shift (m) and rotation vector (rad) of a
        frame in world axes, or joints' positions.
    compliance : array
        C at the equilibrium, shape (p, p), symmetric: small further loads move the output by C w.
        Moments count as semitangential ones, which have an energy.
    springs : tuple of str
    stretch, spring_forces : arrays
        Of each spring, m and N, or rad and N m; the force is stiffness times stretch.
    actuator_forces : dict
        What each actuator exerts, N or N m.
    closure_wrenches : dict
        Wrench of frame b's side on frame a's side of each closure of frames, (6,), N and N m, at
        frame a's origin, in world axes.
    joint_wrenches : dict
        Wrench of the link before each joint on the one after it, (6,), N and N m, at the joint's
        origin, in world axes.
    undetermined : tuple of str
        Closures whose wrench the springs do not determine: rigid parts are held more than once. The
        smallest is returned.
    frequencies : array
        Of free vibrations about the equilibrium, Hz, smallest first; commanded positions held. inf
        for motions without mass.
    modes : array
        How the output moves in each, shape (p, k), as a share of the largest motion of a joint or
        spring (m or rad).
    idle : int
        Number of motions that strain nothing, and are left out.
    configuration : array
        Of the tree with springs, `StiffnessModel.model`.
    energy : float
        What the springs hold, J.
    """

    output: tuple[str, ...]
    angular: tuple[bool, ...]
    displacement: Array
    compliance: Array
    springs: tuple[str, ...]
    stretch: Array
    spring_forces: Array
    actuator_forces: dict[str, float]
    closure_wrenches: dict[str, Array]
    joint_wrenches: dict[str, Array]
    undetermined: tuple[str, ...]
    frequencies: Array
    modes: Array
    idle: int
    configuration: Array
    energy: float
    length: float
    """Characteristic length, m."""

    @property
    def stiffness(self) -> Array:
        """C^-1, shape (p, p): N/m, N, N m.

        Raises
        ------
        SingularityError
            If the output cannot move in some direction: there its stiffness is infinite.
        """
        scale = np.where(self.angular, self.length, 1.0)
        values, vectors = np.linalg.eigh(self.compliance * np.outer(scale, scale))
        if values[0] <= _RIGID * values[-1]:
            parts = np.abs(vectors[:, 0])
            names = [
                name
                for name, part in zip(self.output, parts, strict=True)
                if part > 0.1 * parts.max()
            ]
            raise SingularityError(
                f"the output is rigid in a direction ({', '.join(names)}): it has a compliance, "
                "but no finite stiffness",
                np.inf,
                1 / _RIGID,
            )
        inverse = (vectors / values) @ vectors.T
        return np.asarray(inverse * np.outer(scale, scale))


def deflection_of(model: ElasticMechanism, q0: Array, tangent: Tangent, loads: Loads) -> Deflection:
    """Return the results at an equilibrium."""
    A = model.output_jacobian(tangent.q)
    omega, shapes = tangent.vibrations()
    stretch = model.stretch(tangent.q, q0)
    forces = model.stiffness * stretch
    equations = model.system.equations
    closures = closure_wrenches(equations, tangent.q, tangent.multipliers)
    driven = {
        name: float(tangent.balance[index])
        for name, index in zip(model.system.actuated_names, model.system.actuated, strict=True)
    }
    count = len(model.compliances.actuators)  # the first springs
    driven |= dict(zip(model.springs[:count], (-forces[:count]).tolist(), strict=True))
    return Deflection(
        model.output,
        model.angular,
        model.output_motion(tangent.q, q0),
        tangent.compliance(A),
        model.springs,
        stretch,
        forces,
        driven,
        closures,
        _joint_wrenches(model, tangent.q, closures, loads),
        _undetermined(model, tangent),
        omega / (2 * np.pi),
        A @ shapes,
        tangent.motions.idle.shape[1],
        tangent.q,
        float(forces @ stretch) / 2,
        equations.length,
    )


def _undetermined(model: ElasticMechanism, tangent: Tangent) -> tuple[str, ...]:
    """Return the closures that have a part in reactions that nothing determines."""
    if not tangent.undetermined.size:
        return ()
    parts = np.linalg.norm(tangent.undetermined, axis=1)
    found = []
    for closure in model.system.equations.closures:
        if parts[model.system.equations.rows(closure.name)].max() > _PART * parts.max():
            found.append(closure.name)
    return tuple(found)


def _joint_wrenches(
    model: ElasticMechanism, q: Array, closures: dict[str, Array], loads: Loads
) -> dict[str, Array]:
    """Return the wrench that each joint of the rigid mechanism carries."""
    tree, data = model.model, model.system.data
    pin.framesForwardKinematics(tree, data, q)
    on_frames = model.system.by_frame(loads.wrenches)
    forces = forces_on_joints(model.system.equations, closures, on_frames)
    still = np.zeros(tree.nv)
    pin.rnea(tree, data, q, still, still, forces)
    found = {}
    for name in list(model.task.mechanism.model.names)[1:]:
        index = tree.getJointId(name)
        turn = data.oMi[index].rotation
        found[name] = (data.f[index].vector.reshape(2, 3) @ turn.T).ravel()
    return found
