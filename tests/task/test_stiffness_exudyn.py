"""The overconstrained four-bar in Exudyn, with geometrically exact beams.

Their elements are linear in the beam's strains: displacements converge with the square of their
number, and are 0.1 % too small with 16 of them in each link.
"""

from __future__ import annotations

import warnings
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from rps_pin.arrays import Array
from rps_pin.task.stiffness import Beam
from tests.task.test_stiffness import FourBar, _axes, four_bar, four_bar_task
from tests.worst import worst

exu: Any = pytest.importorskip("exudyn")
items: Any = pytest.importorskip("exudyn.itemInterface")
bodies: Any = pytest.importorskip("exudyn.rigidBodyUtilities")

#: Elements of each link.
ELEMENTS = 16
HINGE = [1, 1, 1, 1, 0, 1]


class InExudyn:
    """The four-bar at a configuration, under a load on the coupler's tip."""

    def __init__(self, case: FourBar, q: Array) -> None:
        mechanism = four_bar_task().mechanism
        self.system = exu.SystemContainer().AddSystem()
        A, B, C, D = (
            mechanism.frame_placement(q, name)[:3, 3]
            for name in ("crank_joint", "coupler_joint", "coupler_tip", "rocker_joint")
        )
        crank = self._chain(case.beams["crank"], A, B)
        coupler = self._chain(case.beams["coupler"], B, C)
        rocker = self._chain(case.beams["rocker"], D, C)
        self.tip = coupler[1]
        self._joint(self._ground(A), crank[0], [1] * 6)
        self._joint(crank[1], coupler[0], HINGE)
        self.knee = self._joint(coupler[1], rocker[1], HINGE)
        self._joint(self._ground(D), rocker[0], HINGE)

    def _chain(self, beam: Beam, a: Array, b: Array) -> tuple[Any, Any]:
        """Add a link's elements; return its ends: marker, section axes and node."""
        axes, length = _axes(a, b), float(np.linalg.norm(b - a))
        s, E, G = beam.section, beam.material.young_modulus, beam.material.shear_modulus
        data = exu.BeamSection()
        data.stiffnessMatrix = np.diag(
            [
                *(E * s.area, G * s.shear_area_y, G * s.shear_area_z),  # type: ignore[operator]
                *(G * s.torsion_constant, E * s.second_moment_y, E * s.second_moment_z),
            ]
        )
        data.massPerLength, data.inertia = 1.0, 1e-4 * np.eye(3)
        turn = list(bodies.RotationMatrix2EulerParameters(axes))
        nodes = [
            self.system.AddNode(
                items.NodeRigidBodyEP(referenceCoordinates=[*(a + (b - a) * k / ELEMENTS), *turn])
            )
            for k in range(ELEMENTS + 1)
        ]
        for pair in pairwise(nodes):
            self.system.AddObject(
                items.ObjectBeamGeometricallyExact(
                    nodeNumbers=list(pair), length=length / ELEMENTS, sectionData=data
                )
            )
        first, last = (
            (self.system.AddMarker(items.MarkerNodeRigid(nodeNumber=node)), axes, node)
            for node in (nodes[0], nodes[-1])
        )
        return first, last

    def _ground(self, place: Array) -> tuple[Any, Array, None]:
        body = self.system.AddObject(items.ObjectGround())
        marker = items.MarkerBodyRigid(bodyNumber=body, localPosition=list(place))
        return self.system.AddMarker(marker), np.eye(3), None

    def _joint(self, a: Any, b: Any, held: list[int]) -> Any:
        """Hold directions in the world's axes."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            joint = items.GenericJoint(
                markerNumbers=[a[0], b[0]],
                constrainedAxes=held,
                rotationMarker0=a[1].T,
                rotationMarker1=b[1].T,
            )
            return self.system.AddObject(joint)

    def solve(self, load: Array) -> tuple[Array, Array]:
        """Return the tip's shift, and the force of the rocker on the coupler."""
        marker, _, node = self.tip
        self.system.AddLoad(
            items.LoadForceVector(markerNumber=marker, loadVector=load[:3].tolist())
        )
        self.system.AddLoad(
            items.LoadTorqueVector(markerNumber=marker, loadVector=load[3:].tolist())
        )
        self.system.Assemble()
        settings = exu.SimulationSettings()
        solver = settings.staticSolver
        solver.newton.relativeTolerance, solver.newton.absoluteTolerance = 1e-7, 1e-4
        solver.newton.numericalDifferentiation.doSystemWideDifferentiation = True
        solver.verboseMode = 0
        settings.solution.file.write = False
        self.system.SolveStatic(settings)
        moved = self.system.GetNodeOutput(node, exu.OutputVariableType.Displacement)
        force = self.system.GetObjectOutput(self.knee, exu.OutputVariableType.ForceLocal)
        return np.array(moved), -np.array(force)


def test_the_overconstrained_four_bar_is_exudyns() -> None:
    rng = np.random.default_rng(6)
    mechanism = four_bar_task().mechanism
    shift, force = [], []
    for angle in (0.7, 2.5):
        case, q = four_bar(rng), mechanism.complete([angle], mechanism.home)
        load = rng.normal(size=6) * [50, 50, 50, 5, 5, 5]
        moved, pushed = InExudyn(case, q).solve(load)
        found = case.model.deflection(q, load)
        shift.append(np.abs(found.displacement[:3] - moved).max() / np.abs(moved).max())
        knee = found.closure_wrenches["knee"][:3]
        force.append(np.abs(knee - pushed).max() / np.abs(pushed).max())
    assert worst(*shift) < 5e-3
    assert worst(*force) < 5e-3
