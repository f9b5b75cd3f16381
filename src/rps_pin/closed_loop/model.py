"""Mechanism with closed loops: an open Pinocchio tree, its loop closures, its actuated joints."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rps_pin.arrays import Array, Bools, Indices
from rps_pin.closed_loop import kinematics
from rps_pin.closed_loop.assembly.closing import close, closed_gap
from rps_pin.closed_loop.assembly.completion import complete
from rps_pin.closed_loop.assembly.every.found_modes import FoundModes
from rps_pin.closed_loop.assembly.modes import Method, assembly_modes
from rps_pin.closed_loop.assembly.projection import project
from rps_pin.closed_loop.assembly.rounding import find_rule
from rps_pin.closed_loop.constraints.closures import Closure, Kind, LoopClosure
from rps_pin.closed_loop.constraints.equations import LoopErrors
from rps_pin.closed_loop.constraints.rank_rule import RankRule
from rps_pin.closed_loop.constraints.system import MAX_CONDITION, ConstraintSystem
from rps_pin.closed_loop.describe import MechanismDescription, describe
from rps_pin.closed_loop.dynamics import derivatives, generalised_forces
from rps_pin.closed_loop.dynamics.forward_dynamics import forward_dynamics
from rps_pin.closed_loop.dynamics.inverse_dynamics import (
    InverseDynamics,
    constraint_forces,
    inverse_dynamics,
)
from rps_pin.closed_loop.dynamics.passive_joint_forces import JointEffects
from rps_pin.closed_loop.dynamics.wrenches import Wrenches, closure_wrenches, forces_on_joints
from rps_pin.closed_loop.editing.present_pose import closure_at
from rps_pin.closed_loop.editing.replace import (
    replace_joints,
    replaced_configuration,
    replaced_effects,
)
from rps_pin.closed_loop.interference.at_pose import Interference, interference_at
from rps_pin.closed_loop.interference.distances import LinkDistances
from rps_pin.closed_loop.interference.geometry import collision_geometry
from rps_pin.closed_loop.interference.shapes import CollisionShapes, pairs_of, shapes_of
from rps_pin.closed_loop.io.gepetto import parts_from_gepetto
from rps_pin.closed_loop.io.mechanism_file import parts_from_yaml
from rps_pin.closed_loop.io.mjcf import parts_from_mjcf
from rps_pin.closed_loop.io.parts import MechanismParts, with_effects, without_position_limits
from rps_pin.closed_loop.io.urdf import parts_from_urdf
from rps_pin.closed_loop.io.write.files import UrdfTexts, urdf_texts, write_mjcf, write_urdf
from rps_pin.closed_loop.io.write.mjcf_inertia import Mending
from rps_pin.closed_loop.io.write.source import Source
from rps_pin.closed_loop.io.xml_file import absolute
from rps_pin.closed_loop.simulation.result import Simulation
from rps_pin.closed_loop.simulation.simulate import simulate
from rps_pin.closed_loop.summary import in_lines, in_one_line
from rps_pin.errors import ClosureError, CompileError, MechanismError, warn_caller
from rps_pin.one_thread import one_thread, refuse_second_thread
from rps_pin.other_kinds import refuses_other_kinds
from rps_pin.validation import choice, non_negative_number, real_vector, whole_number

_REFERENCES = {
    "world": pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
    "frame": pin.ReferenceFrame.LOCAL,
}


@partial(refuses_other_kinds, besides=("inverse_dynamics", "forward_dynamics"))
@one_thread("system.guard", besides=("inverse_dynamics", "forward_dynamics"), properties=("home",))
class ClosedLoopModel:
    """Any mechanism: an open tree whose loops are closed by Pinocchio constraint models.

    Build once, call often: the scratch memory is allocated here. For that reason one object serves
    one thread at a time: a call while another thread's runs is refused with a `ThreadError`.
    `model` itself is never written to and may be shared.

    Dynamics takes closed configurations, as `close`, `project`, `complete` and `simulate` return
    them: one with a gap above 1e-4 characteristic lengths is refused with a `ClosureError`.

    Parameters
    ----------
    model
        The open tree. Its gravity, and its armature, are used as they stand.
    closures
        Its loop closures: `LoopClosure` and `JointCoupling` objects.
    actuated
        Names of the actuated joints, or of one coordinate (``ball.x``); `tau` comes in this order.
        ``[]``: nothing is driven.
    home
        Configuration to start from, shape (nq,); its loops are closed here (see `close`) if they
        are open. Left out: Pinocchio's neutral one, whose loops are closed when `home` is first
        asked for.
    effects
        Damping, friction and springs of the joints; none if left out.
    name
        For tables and messages; that of the model if left out.
    characteristic_length
        Length (m) that makes angles and lengths comparable: in condition numbers, and in the norm
        that `close` makes small. Left out, it is the longest lever of a closure, that is, the
        distance of a closed frame from the joint that carries it; if all are zero, the longest of
        a link, to its centre of mass or a joint that it carries (1 m if these are zero too).
    max_condition
        `SingularityError` is raised where the condition number exceeds this.
    accuracy
        Largest error of the file's numbers, in characteristic lengths and rad: rows of the closures
        that are redundant but for such errors count as redundant, and loops may stay open by as
        much where no motion closes them (see `rank_rule`). 0: the numbers are exact. Left out: 1e-3
        (5e-3 where the rows, if they counted, would leave fewer motions than there are actuators).
        A mechanism in whose closures no such error is found is exact in any case.
    task
        What the mechanism is for: the arguments of a `rps_pin.task.Task`, by name; see `task`.
    notes
        Sentences that `describe` prints: what the reader of a file has decided.
    collision
        Collision shapes of the links, for `interference`: `CollisionShapes`, as another mechanism
        has them, or a `pin.GeometryModel` of this model. Readers of files give those of the file.
    file
        The description or URDF (or its text) that the mechanism was read from: the viewer draws its
        shapes. Readers of files give it.

    Attributes
    ----------
    model, closures, actuated, effects, name, max_condition, accuracy, notes, file
        As given; `closures` and `actuated` as tuples.
    collision_shapes : CollisionShapes
        Collision shapes as they are stated, unbuilt; see `collision_model`.
    system : ConstraintSystem
        The tree with its closure equations and their factorisation, for the algorithms.

    Raises
    ------
    MechanismError
        If a frame or joint is unknown or named twice, or the tree has no joints.
    InputError
        If a number or an array does not fit.
    ClosureError
        If the loops do not close from the home that is given; says by how much, and which.
    """

    def __init__(
        self,
        model: pin.Model,
        closures: Sequence[Closure],
        actuated: Sequence[str],
        *,
        home: ArrayLike | None = None,
        effects: JointEffects | None = None,
        name: str = "",
        characteristic_length: float | None = None,
        max_condition: float = MAX_CONDITION,
        accuracy: float | None = None,
        task: Mapping[str, Any] | None = None,
        notes: Sequence[str] = (),
        collision: CollisionShapes | pin.GeometryModel | None = None,
        file: str | os.PathLike[str] | None = None,
    ) -> None:
        self.system = system = ConstraintSystem(
            model,
            closures,
            actuated,
            effects=effects,
            characteristic_length=characteristic_length,
            max_condition=max_condition,
            rule=None,
        )
        if accuracy is not None:
            non_negative_number(accuracy, "accuracy", "")
        self.accuracy = accuracy
        self.model: pin.Model = model
        self.closures = system.equations.closures
        self.actuated = system.actuated_names
        self.max_condition = max_condition
        self.effects = effects
        self.name: str = name or model.name
        self.notes = tuple(notes)
        self.file = None if file is None else absolute(file)
        self._task = None if task is None else dict(task)
        self.collision_shapes = shapes_of(model, collision)
        self._home: Array | None = None
        self._start: Array = pin.neutral(model)
        self._given_length = characteristic_length
        system.find_rule = self._rank_rule
        if home is not None:
            self._start = system.normalised(home, "home")
            self._start = self._home = self._closed(self._start)

    @classmethod
    def from_urdf(
        cls,
        path_or_xml: str | os.PathLike[str],
        closures: Sequence[Closure],
        actuated: Sequence[str],
        *,
        root: Literal["fixed", "free"] = "fixed",
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        within_limits: bool = True,
        effects: JointEffects | Mapping[str, Mapping[str, ArrayLike]] | None = None,
        **options: Any,
    ) -> ClosedLoopModel:
        """Build a mechanism from a URDF: a file's path, or the XML text itself.

        A joint of type ``continuous`` has one coordinate and no limits, one of type ``floating`` is
        a free-flyer. ``mimic`` elements, and the loop elements of URDF+, Drake and Isaac Sim, are
        closures before those given. The damping and friction of ``dynamics`` elements count.

        Parameters
        ----------
        path_or_xml
            Path of a URDF file, or its text (recognised by its leading ``<``).
        closures, actuated
            As for the class.
        root
            ``"free"``: the root link is on a free-flyer called ``"root_joint"``.
        gravity
            Acceleration of gravity in world axes, shape (3,), m/s^2.
        within_limits
            Whether the file's position limits count.
        effects
            What replaces the file's damping and friction, joint by joint: by effect and joint name,
            ``{"damping": {"hinge": 0.1}, "stiffness": ...}``, or `JointEffects`, whose entries that
            are not zero replace the file's.
        **options
            The class's other parameters.

        Raises
        ------
        InputError
            If the file cannot be read, or gravity is not a finite vector.
        MechanismError
            If it is not a URDF, or as for the class.
        ClosureError
            As for the class.
        """
        parts = parts_from_urdf(path_or_xml, root)
        if not within_limits:
            parts = without_position_limits(parts)
        model, given = parts.model, tuple(closures)
        model.gravity.linear = real_vector(gravity, 3, "gravity")
        own = tuple(closure for closure in parts.closures if closure not in given)
        options.setdefault("notes", parts.notes)
        options.setdefault("collision", parts.collision)
        options.setdefault("file", path_or_xml)
        return cls(model, own + given, actuated, effects=with_effects(parts, effects), **options)

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        within_limits: bool | None = None,
        accuracy: float | None = None,
    ) -> ClosedLoopModel:
        """Build a mechanism from its description, a YAML file; see `description`.

        The file names a URDF or MJCF, the closures, the actuated joints, and `home`, from where
        the loops are closed. Without `home` they are closed from Pinocchio's neutral configuration.

        Parameters
        ----------
        path
            The file.
        within_limits
            Whether position limits count; left out, as the file says, or else they do.
        accuracy
            As for the class; left out, as the file says.

        Raises
        ------
        InputError, MechanismError
            If a file cannot be read, or its contents are not consistent; with file and line.
        ClosureError
            If the loops do not close from there; says by how much, and which.
        """
        parts = parts_from_yaml(path, within_limits)
        parts = parts if accuracy is None else replace(parts, accuracy=accuracy)
        return cls._from_parts(parts, path)

    @classmethod
    def from_gepetto(
        cls,
        path: str | os.PathLike[str],
        *,
        root: Literal["fixed", "free"] = "fixed",
        within_limits: bool = True,
    ) -> ClosedLoopModel:
        """Build a mechanism from a folder of Gepetto's example-parallel-robots.

        `load` reads these too, with a fixed root; whether the root floats is not in the files.

        Parameters
        ----------
        path
            The folder with ``robot.yaml`` and its URDF, or the YAML file.
        root
            ``"free"``: the root link is on a free-flyer called ``"root_joint"``.
        within_limits
            Whether the URDF's position limits count.

        Raises
        ------
        InputError, MechanismError, ClosureError
            As `load`.
        """
        return cls._from_parts(parts_from_gepetto(path, root, within_limits), path)

    @classmethod
    def from_mjcf(
        cls,
        path_or_xml: str | os.PathLike[str],
        *,
        closures: Sequence[Closure] = (),
        actuated: Sequence[str] | None = None,
        within_limits: bool = True,
        accuracy: float | None = None,
    ) -> ClosedLoopModel:
        """Build a mechanism from a MuJoCo file: its path, or its text (which begins with ``<``).

        MuJoCo compiles it (``pip install 'rps-pin[mjcf]'``). Its ``equality`` elements (connect,
        weld, joint, tendon) are the closures; the joints and fixed tendons that its actuators act
        on are the actuated joints. Coordinates are MuJoCo's ``qpos`` in its order, quaternions as
        (x, y, z, w), and then the lengths of fixed tendons that have actuators, forces or limits:
        each is a slide without mass, whose force is the tendon's. What cannot be an actuated joint
        (an actuator on a site, say) is told in a warning.

        Parameters
        ----------
        path_or_xml
            The file, or its text.
        closures
            Further closures, after those of the file.
        actuated
            Names of the actuated joints, instead of the file's.
        within_limits
            Whether the file's position limits count.
        accuracy
            As for the class.

        Raises
        ------
        InputError, MechanismError
            As `load`; also for forces and closures that have no counterpart here.
        RPSPinError
            If MuJoCo is not installed.
        ClosureError
            As `load`.
        """
        parts = parts_from_mjcf(path_or_xml, closures=closures, actuated=actuated)
        parts = parts if within_limits else without_position_limits(parts)
        return cls._from_parts(replace(parts, accuracy=accuracy))

    @classmethod
    def _from_parts(
        cls, parts: MechanismParts, file: str | os.PathLike[str] | None = None
    ) -> ClosedLoopModel:
        mechanism = cls(
            parts.model,
            parts.closures,
            parts.actuated,
            effects=with_effects(parts, None),
            name=parts.name,
            characteristic_length=parts.characteristic_length,
            max_condition=parts.max_condition or MAX_CONDITION,
            accuracy=parts.accuracy,
            task=parts.task,
            notes=parts.notes,
            collision=parts.collision,
            file=file,
        )
        if parts.home is None:
            mechanism._home = mechanism.home  # closed, or not to be built
        else:
            mechanism._start = mechanism.system.normalised(parts.home, "home")
            try:
                mechanism._start = mechanism._home = mechanism.close(parts.home)
            except ClosureError as error:
                raise parts.located(error) from None
        return mechanism

    def __reduce__(self) -> tuple[Any, ...]:
        """Give copies, and other processes, scratch memory of their own."""
        home = self._home if self._home is self._start else None  # as given
        rebuilt = partial(type(self), home=home, **self._options())
        return rebuilt, (self.model, self.closures, self.actuated)

    def __repr__(self) -> str:
        return in_one_line(type(self).__name__, self.name, self.system)

    def __str__(self) -> str:
        """Mobility, actuation, joints, closures; `describe` tells more."""
        return in_lines(self.name, self.system, self.describe)

    def _options(self) -> dict[str, Any]:
        """Return what it was made with, but for model, closures, actuated joints and home."""
        return {
            "effects": self.effects,
            "name": self.name,
            "characteristic_length": self._given_length,
            "max_condition": self.max_condition,
            "accuracy": self.accuracy,
            "task": self._task,
            "notes": self.notes,
            "collision": self.collision_shapes,
            "file": self.file,
        }

    # Interference ---------------------------------------------------------------------------------

    @cached_property
    def collision_model(self) -> pin.GeometryModel:
        """Collision shapes of the links, on this model; without pairs.

        Meshes are found by the rules of ROS (`ROS_PACKAGE_PATH`), and in the folders that
        `CollisionShapes.in_packages` adds: ``one.with_collision(one.collision_shapes.in_packages(
        ["~/ws/src"]))``. One that bounds a convex solid is that solid, another one a surface.

        Raises
        ------
        InputError
            If a shape cannot be read; says which, where in its file, and why.
        """
        return collision_geometry(self.model, self.collision_shapes)

    def with_collision(
        self, collision: CollisionShapes | pin.GeometryModel, *, ignore: Any = ()
    ) -> ClosedLoopModel:
        """Return the same mechanism with other collision shapes; see the class.

        Parameters
        ----------
        collision
            The shapes.
        ignore
            Further pairs of links, by name, that may overlap.

        Raises
        ------
        InputError
            If a shape is on a joint that there is not, or `ignore` holds no pairs of names.
        """
        shapes = shapes_of(self.model, collision).ignoring(ignore)
        options = self._options() | {"collision": shapes}
        return type(self)(self.model, self.closures, self.actuated, home=self._home, **options)

    def link_distances(self, ignore: Any = ()) -> LinkDistances:
        """Return distances of the pairs of links that are checked, for many configurations.

        Checked are links of different bodies that neither a joint nor a closure connects; see
        ``rps_pin.closed_loop.interference.pairs``.

        Parameters
        ----------
        ignore
            Pairs of links, by name, that are not checked: ``[("arm", "cover")]``.

        Raises
        ------
        InputError
            As `collision_model`; or if `ignore` holds no pairs of names.
        MechanismError
            If a link of a pair is unknown.
        """
        pairs, length = pairs_of(ignore), self.characteristic_length
        shapes, geometry = self.collision_shapes, self.collision_model
        return LinkDistances(self.model, self.closures, length, shapes, geometry, pairs)

    def interference(
        self, q: ArrayLike, *, clearance: float = 0.0, ignore: Any = ()
    ) -> Interference:
        """Return which pairs of links overlap, or are nearer than a clearance.

        Parameters
        ----------
        q
            Configuration, shape (nq,).
        clearance
            Least distance of two links, m.
        ignore
            As for `link_distances`.

        Raises
        ------
        InputError, MechanismError
            As `link_distances`; or if q or the clearance do not fit.
        """
        q_, least = self._configuration(q), non_negative_number(clearance, "clearance", "m")
        pairs = pairs_of(ignore)
        distances = self.link_distances(pairs) if pairs else self._distances
        return interference_at(distances, q_, least)

    @cached_property
    def _distances(self) -> LinkDistances:
        return self.link_distances()

    # Other closures and actuators -----------------------------------------------------------------

    def closure_at(
        self,
        q: ArrayLike,
        frame_a: str,
        frame_b: str = "universe",
        kind: Kind = "rigid",
        **options: Any,
    ) -> LoopClosure:
        """Return a closure of two frames as they stand at a configuration, for `with_closures`.

        Both closed frames stand at frame a with its axes; or, if the world carries frame a, at
        frame b's origin with frame a's axes. A closure onto a given pose in the world is
        ``LoopClosure(frame, "universe", kind, placement_b=pose)``.

        Parameters
        ----------
        q
            Configuration, shape (nq,); its loops need not be closed.
        frame_a, frame_b
            Frames by name. The constraint force acts on frame a's body; with the world as frame b,
            it is the force of the ground.
        kind
            As for `LoopClosure`.
        **options
            Its other parameters: ``name``, ``axis`` (in frame a), ``placement_a`` (a point of
            contact, for example). The length of a ``distance`` closure is that at q.

        Raises
        ------
        InputError
            If q does not fit.
        MechanismError
            As `LoopClosure`, and for an option that follows from q.
        """
        q_ = self.system.normalised(q, "q")
        return closure_at(self.model, q_, frame_a, frame_b, kind, **options)

    def with_closures(
        self, closures: Sequence[Closure], *, home: ArrayLike | None = None
    ) -> ClosedLoopModel:
        """Return the same mechanism with further closures.

        Parameters
        ----------
        closures
            Closures; they come after the mechanism's own.
        home
            Its home, shape (nq,); this mechanism's if left out. Its loops are closed if they are
            open.

        Raises
        ------
        InputError, MechanismError, ClosureError
            As the class.
        """
        return self._with((*self.closures, *closures), self.actuated, home)

    def without_closures(self, names: Sequence[str]) -> ClosedLoopModel:
        """Return the same mechanism without some of its closures, by name.

        Raises
        ------
        MechanismError
            If there is no closure of a name; lists those there are.
        """
        removed = (names,) if isinstance(names, str) else tuple(names)
        for name in removed:
            self.rows(name)
        kept = [closure for closure in self.closures if closure.name not in removed]
        return self._with(kept, self.actuated)

    def with_actuated(self, joints: Sequence[str]) -> ClosedLoopModel:
        """Return the same mechanism with other actuated joints, by name.

        Raises
        ------
        MechanismError
            If a joint is unknown or named twice.
        """
        return self._with(self.closures, joints)

    def with_joints(
        self, kinds: Mapping[str, Any], *, home: ArrayLike | None = None
    ) -> ClosedLoopModel:
        """Return the same mechanism with joints of other types: a ball in the place of a hinge.

        Parameters
        ----------
        kinds
            New types by joint, as for `rps_pin.closed_loop.replace_joints`:
            ``{"knee": "spherical", "rod": "universal_xy", "brake": "fixed"}``.
        home
            Its home, shape (nq,) of the new model; if left out, this mechanism's, as far as the
            new joints can take it over. Its loops are closed if they are open.

        Raises
        ------
        MechanismError
            As `replace_joints`; or if a replaced joint is coupled, actuated or has damping,
            friction or a spring, and the new one has another number of velocities.
        InputError, ClosureError
            As the class.
        """
        model = replace_joints(self.model, kinds)
        for name in self.actuated:
            old = self.model.joints[self.model.getJointId(name)]
            count = model.joints[model.getJointId(name)].nv if model.existJointName(name) else 0
            if name in kinds and count != old.nv:
                raise MechanismError(
                    f"joint {name!r} is actuated and would have {count} velocities in place of "
                    f"{old.nv}; choose other actuated joints first, by with_actuated()"
                )
        if home is None and self._home is not None:
            home = replaced_configuration(self.model, kinds, self._home)
        options = self._options()
        if self.effects is not None:
            options["effects"] = replaced_effects(self.model, model, kinds, self.effects)
        return type(self)(model, self.closures, self.actuated, home=home, **options)

    def with_model(self, model: pin.Model) -> ClosedLoopModel:
        """Return the same mechanism on another model of the same joints: of other inertias, say.

        Raises
        ------
        MechanismError
            If the model has other joints.
        """
        kinds = [
            [(name, joint.shortname()) for name, joint in zip(one.names, one.joints, strict=True)]
            for one in (self.model, model)
        ]
        if kinds[0] != kinds[1]:
            raise MechanismError("the model has other joints than the mechanism's")
        options = self._options()
        return type(self)(model, self.closures, self.actuated, home=self._home, **options)

    def with_numbers(
        self, model: pin.Model, closures: Sequence[Closure], home: ArrayLike
    ) -> ClosedLoopModel:
        """Return the same mechanism with other numbers: another model of its joints, its closures.

        Parameters
        ----------
        model
            The tree, its joints those of this mechanism.
        closures
            All closures.
        home
            A closed configuration, shape (nq,).

        Raises
        ------
        MechanismError
            If the model has other joints, or a closure cannot be made.
        """
        same = self.with_model(model)
        return type(self)(same.model, closures, self.actuated, home=home, **self._options())

    def for_task(self, task: Mapping[str, Any]) -> ClosedLoopModel:
        """Return the same mechanism for a task: the arguments of a `rps_pin.task.Task`.

        Those that are None are left out.
        """
        given = {name: value for name, value in task.items() if value is not None}
        options = self._options() | {"task": given}
        return type(self)(self.model, self.closures, self.actuated, home=self._home, **options)

    def without_effects(self) -> ClosedLoopModel:
        """Return the same mechanism without damping, friction and springs of joints."""
        options = self._options() | {"effects": None}
        return type(self)(self.model, self.closures, self.actuated, home=self._home, **options)

    def _with(
        self, closures: Sequence[Closure], actuated: Sequence[str], home: ArrayLike | None = None
    ) -> ClosedLoopModel:
        """Return a mechanism of this tree; its home is closed if one is known."""
        home = self._home if home is None else home
        return type(self)(self.model, closures, actuated, home=home, **self._options())

    def describe(self, q: ArrayLike | None = None) -> MechanismDescription:
        """Return joints, rows, rank, mobility, redundant rows and actuation; `print` it.

        Parameters
        ----------
        q
            Closed configuration to compute it at, shape (nq,). Left out: a regular one, found by
            small steps from `home`.

        Raises
        ------
        ClosureError
            If the loops do not close from `home`.
        """
        at = None if q is None else self._configuration(q)
        return describe(self.system, self.name, at, lambda: self.home, self.notes)

    # Structure ------------------------------------------------------------------------------------

    @property
    def home(self) -> Array:
        """Closed configuration to start from, shape (nq,); a copy.

        The loops are closed from the home that was given, or else from Pinocchio's neutral
        configuration; a home that was given closed is kept as it is.

        Raises
        ------
        ClosureError
            If none was given, and the loops do not close from the neutral configuration.
        """
        if self._home is None:
            try:
                self._home = self._closed(self._start)
            except ClosureError as error:
                raise ClosureError(
                    f"no home was given, and for the neutral configuration: {error}", error.gap
                ) from None
        return self._home.copy()

    @property
    def has_task(self) -> bool:
        """Whether its description, or the constructor, says what it is for; see `task`."""
        return self._task is not None

    @cached_property
    def task(self) -> Any:
        """What the mechanism is for, as its description says; see `rps_pin.task.Task`.

        Raises
        ------
        MechanismError
            If neither a description nor the constructor says; or as `Task`.
        """
        if self._task is None:
            raise MechanismError(
                f"{self.name or 'the mechanism'} has no task: give one in its description "
                "(task: {frame: ..., coordinates: [...]}), or make one: "
                "Task(mechanism, frame=..., coordinates=[...])"
            )
        return import_module("rps_pin.task").Task(self, **self._task)

    @property
    def constraint_size(self) -> int:
        """Number of closure rows, nc."""
        return self.system.equations.size

    @property
    def characteristic_length(self) -> float:
        """Length that makes angles and lengths comparable, m."""
        return self.system.equations.length

    @property
    def row_scale(self) -> Array:
        """Factors that give the rows one unit (m), shape (nc,)."""
        return self.system.row_scale.copy()

    @property
    def velocity_scale(self) -> Array:
        """Factors that take velocities in one unit (m/s) to their own units, shape (nv,)."""
        return self.system.column_scale.copy()

    @property
    def angular_rows(self) -> Bools:
        """Which rows are angular (rad, N m), shape (nc,)."""
        return self.system.equations.angular_rows.copy()

    @property
    def angular_velocities(self) -> Bools:
        """Which velocities are angular (rad/s), shape (nv,)."""
        return self.system.equations.angular_velocities.copy()

    @property
    def actuated_indices(self) -> Indices:
        """Indices of the actuated joints in a velocity vector, shape (na,)."""
        return self.system.actuated.copy()

    def rows(self, closure: str) -> slice:
        """Return the rows of a closure, by its name, in `constraint_forces` and `LoopErrors`.

        Raises
        ------
        MechanismError
            If there is no closure of that name; lists those there are.
        """
        return self.system.equations.rows(closure)

    # Position -------------------------------------------------------------------------------------

    def loop_errors(
        self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None
    ) -> LoopErrors:
        """Return the gaps of the loops, their rates and their accelerations.

        Parameters
        ----------
        q, v, a
            Configuration (nq,), velocity (nv,) and acceleration (nv,) as Pinocchio has them; v and
            a are zero if left out.
        """
        still = np.zeros(self.model.nv)
        state = self.system.state(q, still if v is None else v, still if a is None else a)
        return self.system.equations.errors(*state)

    def loop_gap(self, q: ArrayLike) -> float:
        """Return the largest gap between two closed frames, m.

        An angle between closed frames counts with the characteristic length as its lever.
        """
        equations = self.system.equations
        return equations.largest_gap(equations.gaps(self._configuration(q)))

    def close(
        self,
        q_guess: ArrayLike,
        *,
        fixed: Sequence[str] = (),
        within_limits: bool = True,
        restarts: int = 20,
    ) -> Array:
        """Return a configuration near a guess in which every loop is closed.

        The loops are closed by least-norm steps from the guess (see `closing`): the result lies
        near it, but is not in general the nearest (see `project`). Where the steps do not close
        the loops, they start again from random configurations farther and farther away.

        Parameters
        ----------
        q_guess
            Configuration, shape (nq,); quaternions need not be of unit length.
        fixed
            Names of joints that keep the guess's values.
        within_limits
            Whether the result must lie within the model's joint limits. The guess need not.
        restarts
            How often to start again; always from the same configurations.

        Returns
        -------
        array
            Closed configuration, shape (nq,), gaps at most 1e-12 of the way along the links (of
            displacements of slides and free-flyers where these are more).

        Raises
        ------
        InputError
            If the guess has the wrong shape, is not finite, or holds a quaternion of length zero.
        ClosureError
            If the loops do not close; says by how much, which, and which joints are at a limit.
        """
        q = self.system.normalised(q_guess, "q_guess")
        return close(self.system, q, fixed=fixed, within_limits=within_limits, restarts=restarts)

    def project(self, q_guess: ArrayLike, *, within_limits: bool = True) -> Array:
        """Return the closed configuration nearest to a guess.

        Nearest in the norm that makes angles lengths by `characteristic_length`; a local minimum of
        the distance (see `projection`).

        Raises
        ------
        InputError, ClosureError
            As `close`; also if the steps do not settle.
        """
        guess = self.system.normalised(q_guess, "q_guess")
        return project(self.system, guess, within_limits=within_limits)

    def complete(
        self,
        values: Mapping[str, ArrayLike] | ArrayLike,
        q_guess: ArrayLike | None = None,
        *,
        within_limits: bool = True,
        jump: bool = False,
        restarts: int = 20,
    ) -> Array:
        """Return the closed configuration in which some joints have given values.

        It is the one that continues the guess: the given coordinates are followed on the straight
        line (balls and free-flyers: the geodesic) from their values in the guess to those asked
        for, in steps that cannot leave the assembly mode (see `continuation`). A guess whose loops
        are open is closed first, as by `close`.

        Where fewer values are given than there are motions, the others follow by least-norm
        motions. Where more are given, they are approached by motions that the closures allow.

        Parameters
        ----------
        values
            By joint name, each with as many numbers as the joint has coordinates; or those of the
            actuated joints in order, shape (na,) (if each has one coordinate).
        q_guess
            Closed configuration whose assembly mode is kept, shape (nq,). Left out: `home`.
        within_limits
            Whether the result must lie within the model's joint limits (the way to it need not).
            Angles that are not given may be turned by whole turns for that.
        jump
            Whether the assembly mode may change: the values are set in the guess, and the loops are
            closed from there as by `close`, with these joints fixed. That finds some configuration
            wherever one is found at all.
        restarts
            How often it is looked for from other configurations, as by `close`; where the assembly
            mode ends, the error says by that whether there are any.

        Raises
        ------
        InputError, MechanismError
            If a value has the wrong shape, a joint is unknown, or the way is too long to follow.
        ClosureError
            If no closed configuration with these values is found, or it is outside joint limits.
        SingularityError
            If the assembly mode ends on the way, or the guess is singular; says how far along.
        """
        guess = self.home if q_guess is None else q_guess
        start = self.system.normalised(guess, "q_guess")
        whole_number(restarts, "restarts", 0)
        options: dict[str, Any] = {"within_limits": within_limits, "jump": jump}
        return complete(self.system, values, start, restarts=restarts, **options)

    def assembly_modes(
        self,
        values: Mapping[str, ArrayLike] | ArrayLike | None = None,
        q_guess: ArrayLike | None = None,
        *,
        frames: Sequence[str] | None = None,
        method: Method = "search",
        probability: float | None = None,
        seed: int = 0,
        starts: int = 20_000,
        seconds: float | None = None,
        within_limits: bool = True,
        progress: Callable[[float], None] | None = None,
    ) -> FoundModes:
        """Return the closed configurations with given joint values.

        By ``"search"``, the loops are closed from random starts, until new ones are not expected
        any more, or until all are found with a probability that is asked for. The result says how
        many starts led to each and how many are expected in all. See `modes` for the method and its
        rule. That is no proof that there are no others.

        By ``"all"``, all solutions of the closures over the complex numbers are followed from those
        of a general system of the kind: of platforms on six legs, of platforms on three legs with
        one hinge each, and of planar mechanisms of hinges and slides; of other mechanisms of turns,
        slides and balls, by loops in complex places of the closed frames. The result says how many
        there are, how that is known, and of which of the real ones it is proven that they exist;
        see `every`. Of legs that are closed in several ways for one pose of the platform, one way
        is returned, near the guess. Mechanisms whose closures are not polynomial, or depend on each
        other, are searched, and `known` says so.

        Parameters
        ----------
        values
            By joint name or of the actuated joints, as for `complete`; left out: those of the
            guess's actuated joints.
        q_guess
            Configuration that the starts are drawn about, and the first of them, shape (nq,). Left
            out: `home`, or the neutral configuration if that cannot be closed. Joints that no
            closure moves, such as a robot's floating base, keep its values.
        frames
            Frames by whose places modes are told apart, ``["platform"]``. Left out: all links; so
            a leg turned by half a turn on its universal joint makes another mode.
        method
            ``"search"`` or ``"all"``.
        probability
            Of all modes being found, between 0 and 1, at which a search ends.
        seed
            Of the random numbers: the same starts each time.
        starts, seconds
            Most random starts, and the longest time, s, of a search; and of the loops of ``"all"``,
            after which a search follows.
        within_limits
            Whether the modes must lie within the joint limits; the starts do then.
        progress
            Called with the share that is done; it falls when another mode is found.

        Returns
        -------
        FoundModes
            One configuration of each mode, angles within a turn, nearest to the guess first. Ctrl-C
            ends the search and keeps what it has found.

        Raises
        ------
        InputError, MechanismError
            If a value has the wrong shape, or a joint is unknown; or if the values leave motions
            open that are not idle freedoms, which are named.
        ClosureError
            If no closed configuration was found; says where it comes nearest.
        """
        return assembly_modes(
            self.system,
            values,
            self.search_start(q_guess),
            frames=frames,
            method=method,
            probability=probability,
            seed=seed,
            starts=starts,
            seconds=seconds,
            within_limits=within_limits,
            progress=progress,
        )

    def search_start(self, q_guess: ArrayLike | None) -> Array:
        """Return a guess, checked; or home, or where home was looked for, shape (nq,)."""
        if q_guess is None:
            try:
                q_guess = self.home
            except ClosureError:
                q_guess = self._start
        return self.system.normalised(q_guess, "q_guess")

    # Velocity and acceleration --------------------------------------------------------------------

    def jacobian(self, q: ArrayLike) -> Array:
        """Return J, shape (nc, nv): the rates of the closures' rows are J v (see `rows`)."""
        return self.system.equations.jacobian(self._configuration(q)).copy()

    def allowed_motions(self, q: ArrayLike) -> Array:
        """Return a basis N of the velocities that keep the loops closed, shape (nv, mobility).

        J N = 0; the columns are orthonormal once angles are made lengths by
        `characteristic_length`.
        """
        return kinematics.allowed_motions(self.system, self.jacobian(q))

    def motion_basis(self, q: ArrayLike, independent: Sequence[str] | None = None) -> Array:
        """Return T, shape (nv, m): v = T u, u the velocities of m joints moving independently.

        Parameters
        ----------
        q
            Closed configuration, shape (nq,).
        independent
            Names of the joints; the actuated ones if left out.

        Raises
        ------
        SingularityError
            If these joints do not determine the motion, or do not move independently, here.
        """
        chosen = self.system.independent(independent)
        return kinematics.motion_basis(self.system, self._configuration(q), chosen)

    def frame_placement(self, q: ArrayLike, frame: str) -> Array:
        """Return the homogeneous matrix that places a frame in the world, shape (4, 4), m.

        Raises
        ------
        MechanismError
            If there is no such frame; lists those there are.
        """
        index = self.system.frame(frame)
        model, data = self.model, self.system.data
        pin.framesForwardKinematics(model, data, self._configuration(q))
        return np.array(data.oMf[index].homogeneous)

    def frame_jacobian(
        self,
        q: ArrayLike,
        frame: str,
        independent: Sequence[str] | None = None,
        *,
        axes: Literal["world", "frame"] = "world",
    ) -> Array:
        """Return the closed-loop Jacobian of a frame, shape (6, m): its twist is this times u.

        Parameters
        ----------
        q
            Closed configuration, shape (nq,).
        frame
            Name of a frame of the model.
        independent
            The joints that u belongs to, as for `motion_basis`.
        axes
            Axes of the twist (linear, then angular, of the frame's origin).

        Raises
        ------
        MechanismError
            If there is no such frame; lists those there are.
        SingularityError
            As `motion_basis`.
        """
        reference = _REFERENCES[choice(axes, "axes", tuple(_REFERENCES))]
        basis = self.motion_basis(q, independent)
        q_, index = self._configuration(q), self.system.frame(frame)
        jacobian = pin.computeFrameJacobian(self.model, self.system.data, q_, index, reference)
        return np.asarray(jacobian.reshape(6, self.model.nv) @ basis)

    def velocity(
        self, q: ArrayLike, v_actuated: ArrayLike, independent: Sequence[str] | None = None
    ) -> Array:
        """Return the velocity that keeps the loops closed while some joints move as asked.

        Solves J v = 0 for the other rows: J_p v_p = -J_a v_a.

        Parameters
        ----------
        q
            Closed configuration, shape (nq,).
        v_actuated
            Velocities of the actuated joints, shape (na,), or of those named.
        independent
            Names of the joints that move as asked, if not the actuated ones.

        Returns
        -------
        array
            Velocity, shape (nv,).

        Raises
        ------
        SingularityError
            If these joints do not determine the motion.
        ClosureError
            If no motion of the mechanism has these velocities (more joints than mobility).
        """
        given = self.system.independent(independent)
        rates = real_vector(v_actuated, given.size, "v_actuated")
        return kinematics.velocity(self.system, self._configuration(q), given, rates)

    def acceleration(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a_actuated: ArrayLike,
        independent: Sequence[str] | None = None,
    ) -> Array:
        """Return the acceleration that keeps the loops closed while some joints move as asked.

        Solves J a + J' v = 0 (J' the derivative) for the other rows.

        Parameters
        ----------
        q, v
            Closed configuration (nq,) and a velocity that keeps it closed (nv,).
        a_actuated
            Accelerations of the actuated joints, shape (na,), or of those named.
        independent
            Names of the joints that accelerate as asked, if not the actuated ones.

        Raises
        ------
        SingularityError, ClosureError
            As `velocity`; also if v itself opens the loops.
        """
        given = self.system.independent(independent)
        rates = real_vector(a_actuated, given.size, "a_actuated")
        q_, v_ = self._configuration(q), self._velocity(v)
        return kinematics.acceleration(self.system, q_, v_, given, rates)

    def condition(self, q: ArrayLike) -> float:
        """Return the condition number of J_p, large near a singularity.

        J_p is the closures' Jacobian with respect to the passive joints, angles made lengths with
        `characteristic_length`. Its condition number is 1 at best and infinite where the actuators
        no longer determine the motion, or where a closure's rows fail (a parallel, or type II, or a
        constraint singularity). Its inverse is the relative distance to the nearest singular
        matrix, a number between 0 and 1.
        """
        q_ = self._configuration(q)
        return kinematics.condition(self.system, q_, self.system.equations.jacobian(q_).copy())

    # Inverse dynamics -----------------------------------------------------------------------------

    def inverse_dynamics(
        self, q: Array, v: Array, a: Array, *, wrenches: Wrenches | None = None
    ) -> InverseDynamics:
        """Return the forces that make the mechanism move as asked: constrained RNEA.

        q must be closed; testing that costs about 0.1 us a spherical closure, and 1 us another. v
        and a are assumed to keep the loops closed, as `velocity` and `acceleration` return them;
        `loop_errors` tests that.

        Parameters
        ----------
        q, v, a
            Configuration (nq,), velocity (nv,) and acceleration (nv,) as Pinocchio has them.
        wrenches
            External wrenches by frame name: (force, moment), (6,), N and N m, that the surroundings
            exert at the frame's origin, in world axes.

        Returns
        -------
        InverseDynamics
            `tau` (na,), `constraint_forces` (nc,), `residual`, `condition`. With more actuators
            than mobility, the tau of least norm, torques made forces by `characteristic_length`
            (with limits and weights: `ForceDistribution`). With fewer, the least-squares tau,
            and the residual force in `unproduced`.

        Raises
        ------
        InputError
            If an argument has the wrong shape or is not finite.
        ClosureError
            If q is open by more than 1e-4 characteristic lengths.
        SingularityError
            If the configuration is singular (condition number above `max_condition`).
        """
        guard = self.system.guard
        if not guard.acquire(False):
            refuse_second_thread(self)
        try:
            return inverse_dynamics(self.system, q, v, a, wrenches)
        finally:
            guard.release()

    def generalised_force(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, wrenches: Wrenches | None = None
    ) -> Array:
        """Return the force of actuators and closures together, S' tau + J' lambda, shape (nv,).

        That is ``rnea(q, v, a)`` plus the passive joint forces less the external wrenches (as in
        `inverse_dynamics`).
        """
        return generalised_forces.required_force(self.system, *self.system.state(q, v, a), wrenches)

    def constraint_forces(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        tau: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
    ) -> Array:
        """Return lambda (nc,) of a motion under given actuator forces, of least norm.

        Solves J' lambda = rnea(q, v, a) + passive joint forces - external forces - S' tau in the
        least-squares sense: exact where a is what `forward_dynamics` returns.
        """
        state = self.system.state(self._closed_configuration(q), v, a)
        return constraint_forces(self.system, *state, self._forces(tau), wrenches)

    # Forward dynamics -----------------------------------------------------------------------------

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        method: Literal["reduced", "proximal"] = "reduced",
    ) -> Array:
        """Return the acceleration under given actuator forces, shape (nv,).

        Parameters
        ----------
        q, v
            Closed configuration (nq,), and a velocity that keeps it closed (nv,).
        tau
            Forces of the actuated joints, shape (na,).
        wrenches
            External wrenches, as for `inverse_dynamics`.
        method
            ``"reduced"``: in the motions that the closures allow (see `forward_dynamics`), exact
            also with massless links and redundant rows. ``"proximal"`` is deprecated: it warns,
            and computes the same.

        Raises
        ------
        InputError
            If an argument has the wrong shape or is not finite.
        SingularityError
            If a motion that the closures allow moves no mass.
        ClosureError
            If q is open by more than 1e-4 characteristic lengths.
        """
        if choice(method, "method", ("reduced", "proximal")) == "proximal":
            warn_caller(
                "method='proximal' is deprecated and computed as 'reduced'; leave method out",
                DeprecationWarning,
            )
        q_, v_, tau_ = self._configuration(q), self._velocity(v), self._forces(tau)
        guard = self.system.guard
        if not guard.acquire(False):
            refuse_second_thread(self)
        try:
            return forward_dynamics(self.system, q_, v_, tau_, wrenches)
        finally:
            guard.release()

    def mass_matrix(self, q: ArrayLike, independent: Sequence[str] | None = None) -> Array:
        """Return the reduced mass matrix T' M T, shape (m, m); T of `motion_basis`.

        The kinetic energy is u' (T' M T) u / 2, u the velocities of the independent joints (the
        actuated ones if left out).
        """
        q_ = self._closed_configuration(q)
        basis = self.motion_basis(q_, independent)
        return np.asarray(basis.T @ generalised_forces.tree_mass(self.system, q_) @ basis)

    def bias(self, q: ArrayLike, v: ArrayLike, independent: Sequence[str] | None = None) -> Array:
        """Return the reduced bias T' (rnea(q, v, a_0) + passive joint forces), shape (m,).

        The forces at the independent joints that keep them from accelerating: a_0 is the
        acceleration with w = 0. Includes gravity, Coriolis forces, damping, friction and springs.
        """
        q_ = self._closed_configuration(q)
        basis = self.motion_basis(q_, independent)
        a = self.acceleration(q_, v, np.zeros(basis.shape[1]), independent)
        return np.asarray(basis.T @ self.generalised_force(q_, v, a))

    def gravity_forces(self, q: ArrayLike, independent: Sequence[str] | None = None) -> Array:
        """Return the forces T' g at the independent joints that carry the weight, shape (m,)."""
        q_ = self._closed_configuration(q)
        basis = self.motion_basis(q_, independent)
        weight = pin.computeGeneralizedGravity(self.model, self.system.data, q_)
        return np.asarray(basis.T @ weight)

    def energy(self, q: ArrayLike, v: ArrayLike) -> tuple[float, float]:
        """Return kinetic energy, rotors included, and potential energy, springs included, J."""
        return generalised_forces.energy(self.system, self._configuration(q), self._velocity(v))

    # Wrenches -------------------------------------------------------------------------------------

    def closure_wrenches(self, q: ArrayLike, constraint_forces: ArrayLike) -> dict[str, Array]:
        """Return the wrench in each closure of frames, by name.

        The wrench that frame b's side exerts on frame a's side: (force, moment), shape (6,), N and
        N m, at frame a's origin, in world axes.

        Parameters
        ----------
        q
            Closed configuration, shape (nq,).
        constraint_forces
            lambda, shape (nc,), as `inverse_dynamics` returns it.
        """
        multipliers = real_vector(constraint_forces, self.constraint_size, "constraint_forces")
        return closure_wrenches(self.system.equations, self._configuration(q), multipliers)

    def joint_wrenches(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        constraint_forces: ArrayLike,
        *,
        wrenches: Wrenches | None = None,
        axes: Literal["world", "joint"] = "joint",
    ) -> dict[str, Array]:
        """Return the wrench that each joint of the tree carries, by name.

        The wrench that the link before the joint exerts on the link after it: (force, moment),
        shape (6,), N and N m, at the origin of the joint's frame (which moves with the link after
        it), in that frame's axes or the world's; actuator, damping, friction and spring included.

        Parameters
        ----------
        q, v, a, constraint_forces, wrenches
            A motion, and the result of `inverse_dynamics` or `constraint_forces` for it.
        axes
            ``"joint"`` or ``"world"``.
        """
        choice(axes, "axes", ("world", "joint"))
        q_, v_, a_ = self.system.state(q, v, a)
        on_closures = self.closure_wrenches(q_, constraint_forces)
        model, data = self.model, self.system.data
        pin.framesForwardKinematics(model, data, q_)
        on_frames = self.system.by_frame(wrenches)
        forces = forces_on_joints(self.system.equations, on_closures, on_frames)
        pin.rnea(model, data, q_, v_, a_, forces)
        carried = {}
        for index, name in list(enumerate(model.names))[1:]:
            turn = data.oMi[index].rotation if axes == "world" else np.eye(3)
            carried[name] = (data.f[index].vector.reshape(2, 3) @ turn.T).ravel()
        return carried

    # Derivatives ----------------------------------------------------------------------------------

    def inverse_dynamics_derivatives(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, wrenches: Wrenches | None = None
    ) -> derivatives.InverseDynamicsDerivatives:
        """Return the derivatives of the actuator forces, analytic; see `derivatives`.

        Parameters
        ----------
        q, v, a, wrenches
            As for `inverse_dynamics`. Configurations are varied in their tangent,
            ``pin.integrate(model, q, dq)``.

        Raises
        ------
        SingularityError
            If the actuated joints do not determine the motion here, or are more than the mobility.
        MechanismError
            If the tree holds a joint whose derivatives are not known (ellipsoid, mimic).
        """
        return self._derivatives.inverse(*self.system.state(q, v, a), wrenches)

    def forward_dynamics_derivatives(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        independent: Sequence[str] | None = None,
        *,
        wrenches: Wrenches | None = None,
    ) -> derivatives.ForwardDynamicsDerivatives:
        """Return the derivatives of the acceleration, analytic; see `derivatives`.

        Parameters
        ----------
        q, v, tau, wrenches
            As for `forward_dynamics`.
        independent
            Joints whose positions the mechanism follows; the actuated ones if left out.

        Raises
        ------
        SingularityError
            If these joints do not determine the motion here, or a motion moves no mass.
        """
        q_, v_ = self._configuration(q), self._velocity(v)
        chosen = self.system.independent(independent)
        return self._derivatives.forward(q_, v_, self._forces(tau), chosen, wrenches)

    def linearize(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        independent: Sequence[str] | None = None,
        *,
        wrenches: Wrenches | None = None,
    ) -> derivatives.Linearisation:
        """Return A and B of the motion about an operating point, dx/dt = A dx + B dtau.

        The state x stacks positions and velocities of the independent joints (the actuated ones if
        left out), shape (2 m,): deviations from the motion through q, v under tau. Exact for joints
        of one coordinate.

        Parameters
        ----------
        q, v, tau, independent, wrenches
            As for `forward_dynamics_derivatives`.
        """
        found = self.forward_dynamics_derivatives(q, v, tau, independent, wrenches=wrenches)
        return derivatives.linearisation(found)

    # Simulation -----------------------------------------------------------------------------------

    def simulate(
        self, q: ArrayLike, v: ArrayLike | None = None, *, duration: float, **options: Any
    ) -> Simulation:
        """Return the motion from a closed state; see `simulation.simulate` for all its options.

        Parameters
        ----------
        q, v
            Closed configuration (nq,), and a velocity that keeps it closed (nv,); at rest if left
            out.
        duration
            s.
        **options
            ``step``, ``method``, ``controller``, ``tau``, ``wrenches``, ``closing`` and others.
        """
        return simulate(self, q, v, duration=duration, **options)

    # Files ----------------------------------------------------------------------------------------

    def to_urdf(
        self,
        path: str | os.PathLike[str],
        *,
        shapes: pin.GeometryModel | None = None,
        overwrite: bool = False,
    ) -> Path:
        """Write the tree as a URDF and, beside it, the description that `load` reads.

        Spherical and universal joints are written as revolute joints, which the description
        merges; joints that are rows of others (translations, Z-Y-X angles, composites) as those
        rows, with the names ``joint:1``, ``joint:2``, ..., ``joint``. q, v and tau keep their
        entries; but joints on one link come in the order of their names, as Pinocchio reads URDFs.

        Parameters
        ----------
        path
            The URDF, ``NAME.urdf``; the description is ``NAME.yaml``.
        shapes
            Shapes for its ``visual`` elements, such as ``rps_pin.closed_loop.visuals.visual_model``
            returns; meshes are named by the paths of their files.
        overwrite
            Whether files that exist are replaced.

        Returns
        -------
        Path
            The description.

        Raises
        ------
        InputError
            If the path does not end in ``.urdf``, or a file exists and `overwrite` is false.
        MechanismError
            If URDF has no such joint (ellipsoid, mimic), or a file cannot hold a name; names it.

        Warns
        -----
        UserWarning
            If a limit is one that URDF does not have; names the joint.
        """
        return write_urdf(self._source(), path, shapes, overwrite)

    def urdf_texts(self, path: Path, shapes: pin.GeometryModel | None = None) -> UrdfTexts:
        """Return the texts that `to_urdf` writes for a path, whose arguments and errors it has."""
        return urdf_texts(self._source(), path, shapes)

    def to_mjcf(
        self,
        path: str | os.PathLike[str],
        *,
        least_mass: float = 0.0,
        least_inertia: float = 0.0,
        mend_inertia: bool = False,
        overwrite: bool = False,
    ) -> Path:
        """Write the mechanism as a MuJoCo file, its loops closed by equalities.

        Exact on closed configurations: mass matrix, bias and constraints are those of MuJoCo's
        model. Joints and closures that MuJoCo does not have are written as what it has (tables:
        `io.write.mjcf_joints`, `io.write.mjcf_closures`); names are kept. Nothing in the file
        touches. The home is a key frame of that name. Dry friction becomes ``frictionloss``, which
        sticks where the law here creeps; equalities are soft there.

        Parameters
        ----------
        path
            The file, ``NAME.xml``.
        least_mass, least_inertia
            Mass (kg) and moments of inertia (kg m^2) given to moving links that have less, since
            MuJoCo moves no link without.
        mend_inertia
            Whether a principal moment of inertia that exceeds the sum of the other two, as no
            body's does and MuJoCo refuses, is lowered to it.
        overwrite
            Whether a file that exists is replaced.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        InputError
            If the path does not end in ``.xml``, a least value is negative, or the file exists and
            `overwrite` is false.
        MechanismError
            If MuJoCo has no such joint, effect, actuator or link; or a file cannot hold a name.

        Warns
        -----
        UserWarning
            If a limit is one that MuJoCo does not have; names the joint.
        """
        mending = Mending(least_mass, least_inertia, mend_inertia)
        return write_mjcf(self._source(), path, mending, overwrite)

    def _source(self) -> Source:
        try:
            home = self.home
        except ClosureError:
            home = None
        return Source(
            self.model,
            self.closures,
            self.actuated,
            self.effects or JointEffects.named(self.model),
            home,
            self.name,
            self.characteristic_length,
            self.max_condition,
            self.accuracy,
            self._task,
            self.collision_shapes,
        )

    # Other engines --------------------------------------------------------------------------------

    def compile(self, **options: Any) -> Any:
        """Return the mechanism in generated code: the same calls, ten to a hundred times faster.

        Needs ``pip install rps-pin[compile]``. See `rps_pin.codegen.compile_mechanism` for the
        options, and `rps_pin.codegen.CompiledMechanism` for the result.

        Raises
        ------
        CompileError
            If CasADi is not installed; see there for others.
        """
        return of_codegen("compile_mechanism")(self, **options)

    def to_casadi(self, **options: Any) -> Any:
        """Return the mechanism's quantities as CasADi functions; see `rps_pin.codegen.to_casadi`.

        Needs ``pip install rps-pin[compile]``.

        Raises
        ------
        CompileError
            If CasADi is not installed; see there for others.
        """
        return of_codegen("to_casadi")(self, **options)

    # Arguments and lazily made parts --------------------------------------------------------------

    def _configuration(self, q: ArrayLike) -> Array:
        return real_vector(q, self.model.nq, "q")

    def _closed_configuration(self, q: ArrayLike) -> Array:
        q_ = self._configuration(q)
        self.system.equations.jacobian(q_)
        self.system.refuse_open(q_)
        return q_

    def _velocity(self, v: ArrayLike) -> Array:
        return real_vector(v, self.model.nv, "v")

    def _forces(self, tau: ArrayLike) -> Array:
        return real_vector(tau, self.system.actuated.size, "tau")

    def _closed(self, q: Array) -> Array:
        """Return q if it is closed, or else a closed configuration near it."""
        return q if self.loop_gap(q) <= closed_gap(self.system, q) else close(self.system, q)

    def _rank_rule(self, system: ConstraintSystem, guesses: Sequence[Array]) -> RankRule | None:
        """Return the rule of rank, found near home or else near the guesses."""
        return find_rule(system, [self._start, *guesses], self.accuracy)

    @cached_property
    def _derivatives(self) -> derivatives.DynamicsDerivatives:
        return derivatives.DynamicsDerivatives(self.system)


def of_codegen(name: str, module: str = "rps_pin.codegen") -> Any:
    """Return what a module of `rps_pin.codegen` has, which an extra has to be installed for."""
    try:
        return getattr(import_module(module), name)
    except ModuleNotFoundError as error:
        raise CompileError(
            f"code is generated with {error.name}, which is not installed: "
            "pip install 'rps-pin[compile]'",
            "",
        ) from None
