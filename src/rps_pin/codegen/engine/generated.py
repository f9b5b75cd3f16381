"""Generated code of one mechanism: its functions, built in groups, proven, and kept.

A group is built when one of its functions is first asked for, or before, by `build`. What the cache
holds is used without making a single expression.
"""

from __future__ import annotations

import copy
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import asdict
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.closed_loop.model import ClosedLoopModel
from rps_pin.codegen.build import Library, Source, build
from rps_pin.codegen.build.builder import CompilerName, build_in_background, kept
from rps_pin.codegen.calls import Argument, CompiledFunction, Entry
from rps_pin.codegen.engine.identity import digest
from rps_pin.codegen.engine.proof import Proof
from rps_pin.codegen.expressions.functions import MechanismFunctions, is_matrix
from rps_pin.codegen.expressions.independent import (
    Partition,
    choose,
    choose_shared,
    regular_samples,
)
from rps_pin.codegen.expressions.mechanism import MechanismExpressions
from rps_pin.codegen.expressions.parameters import Parameters
from rps_pin.codegen.expressions.routines import with_calls
from rps_pin.codegen.units import Kernel, Unit, batch_prelude
from rps_pin.errors import InputError, did_you_mean

#: Functions that are built together.
GROUPS: Mapping[str, tuple[str, ...]] = {
    "dynamics": ("inverse_dynamics", "forward_dynamics"),
    "kinematics": ("gaps", "jacobian", "motion_basis", "velocity", "acceleration"),
    "closing": ("closed", "closed_near", "completed", "nearest"),
    "forces": (
        "constraint_forces",
        "generalised_force",
        "mass_matrix",
        "bias",
        "gravity_forces",
        "energy",
    ),
    "simulation": ("step", "steps"),
    "derivatives": ("inverse_dynamics_derivatives", "forward_dynamics_derivatives"),
}
#: And with parameters.
OF_PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "geometry": ("gaps_by_parameters",),
    "parameters": ("inverse_dynamics_by_parameters", "forward_dynamics_by_parameters"),
}
_ALL = {**GROUPS, **OF_PARAMETERS}
#: Loops over rows gain by GCC's highest optimisation, and all of it by fused multiply-add; other
#: compilers do not read this.
_MORE = '#pragma GCC optimize("O3", "fp-contract=fast")\n'
#: Functions whose last output is a check.
_CHECKED = frozenset(
    name
    for group in _ALL.values()
    for name in group
    if name not in ("gaps", "jacobian", "generalised_force", "energy", "gaps_by_parameters")
)


class GeneratedCode:
    """The functions of one mechanism in machine code.

    Parameters
    ----------
    mechanism
        The mechanism. It is copied; its scratch memory is not used.
    parameters
        Names of the parameters' groups (see `Parameters`).
    wrench_frames
        Frames at which wrenches act.
    compiler
        As for `build.build`.
    batches
        Whether code for several samples at once is built with the rest. Otherwise it is built in
        the background when a batch first asks for it.
    single
        Whether the functions are for single precision, whose rounding errors open loops further.
    """

    def __init__(
        self,
        mechanism: ClosedLoopModel,
        parameters: Sequence[str] = (),
        wrench_frames: Sequence[str] = (),
        compiler: CompilerName = "auto",
        batches: bool = False,
        single: bool = False,
    ) -> None:
        self.mechanism = copy.deepcopy(mechanism)
        self.parameters, self.wrench_frames = tuple(parameters), tuple(wrench_frames)
        self.compiler, self.batches, self._single = compiler, batches, single
        self._with_lanes: set[str] = set()
        self._lanes_in_use: set[str] = set()
        self._lock = threading.RLock()
        self._proving = threading.Lock()  # the proof's mechanism has one scratch memory
        self._functions: dict[str, CompiledFunction] = {}
        self._better: list[Future[Library]] = []
        #: Of each group that is built.
        self.libraries: dict[str, Library] = {}

    @cached_property
    def functions(self) -> MechanismFunctions:
        """The functions' expressions."""
        system = self.mechanism.system
        samples = regular_samples(system, self.mechanism.home)
        shared = choose_shared(system, samples.jacobians)
        return MechanismFunctions(
            MechanismExpressions(
                system,
                self.partition,
                self.parameters,
                self.wrench_frames,
                single=self._single,
                shared=shared,
            )
        )

    def with_wrenches(self, frames: Sequence[str]) -> GeneratedCode:
        """Return the code of the same mechanism for wrenches at other frames."""
        options = self.compiler, self.batches, self._single
        return GeneratedCode(self.mechanism, self.parameters, frames, *options)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """What each parameter is."""
        return self._parameters.labels

    @cached_property
    def nominal(self) -> Array:
        """The parameters' numbers of the mechanism, shape (np,)."""
        return self._parameters.nominal

    @cached_property
    def _parameters(self) -> Parameters:
        return Parameters(self.mechanism.system, self.parameters)

    def parameter_values(self, changes: Mapping[str, ArrayLike]) -> Array:
        """Return the nominal numbers with some changed, by label or group."""
        return self._parameters.vector(changes)

    @cached_property
    def partition(self) -> Partition:
        """Independent and dependent velocities."""
        for library in self.libraries.values():
            return _of_dict(library.proof["partition"])
        system = self.mechanism.system
        return choose(system, regular_samples(system, self.mechanism.home).jacobians)

    @cached_property
    def _proof(self) -> Proof:
        partition = self.partition
        return Proof(
            self.mechanism,
            partition.independent,
            self.parameters,
            self.wrench_frames,
            partition.redundant_rows > 0,
        )

    @cached_property
    def identity(self) -> str:
        """Digest of all that the code depends on."""
        options = self.parameters, self.wrench_frames
        return digest(self.mechanism.system, options)

    def __getitem__(self, name: str) -> CompiledFunction:
        """Return a function; its group is built if it is not."""
        try:
            return self._functions[name]
        except KeyError:
            group = next((g for g, names in _ALL.items() if name in names), name)
            self.build(group)
        return self._functions[name]

    def build(self, *groups: str) -> None:
        """Build groups that are not built yet.

        Raises
        ------
        CompileError
            If there is no compiler, or it fails, or the result does not agree with Pinocchio's.
        """
        with self._lock:
            left = []
            for group in dict.fromkeys(groups):
                if group not in self.libraries and not self._take_lanes(group):
                    left.append(group)
            if left:  # together: their texts compile at the same time
                self._build(tuple(left))

    def _take_lanes(self, group: str) -> bool:
        """Use code for several samples at once, if it is kept or has to be built."""
        source, groups = self._source((group,), lanes=True), (group,)
        library = kept(source, self.compiler)
        if library is None and self.batches:
            prove, replace = self._proof_of(groups), self._replacing(groups)
            library = build(source, prove, self.compiler, replace)
        if library is not None:
            self._use(groups, library)
        return library is not None

    def _build(self, groups: tuple[str, ...]) -> None:
        source = self._source(groups, lanes=False)
        library = build(source, self._proof_of(groups), self.compiler, self._replacing(groups))
        self._use(groups, library)
        for group in groups:
            for name in self._names(group):
                self._functions[name].before_batch = partial(self._want_lanes, group)

    def _use(self, groups: tuple[str, ...], library: Library) -> None:
        self._functions |= self._loaded(library, library.proof["signatures"])
        self.libraries |= dict.fromkeys(groups, library)
        if library.better is not None:
            self._better.append(library.better)

    def _want_lanes(self, group: str) -> None:
        """Build code for several samples at once in the background, once."""
        with self._lock:
            if group in self._with_lanes:
                return
            self._with_lanes.add(group)
        groups = (group,)
        source, prove = self._source(groups, lanes=True), self._proof_of(groups)
        better = build_in_background(source, prove, self.compiler, self._replacing(groups, True))
        if better is not None:
            self._better.append(better)

    def _source(self, groups: tuple[str, ...], *, lanes: bool) -> Source:
        kind, which = "batches" if lanes else "samples", ", ".join(groups)
        names = [name for group in groups for name in self._names(group)]
        units = sum(len(self._units(group, lanes)) for group in groups)
        return Source(
            f"{self.mechanism.name or 'mechanism'}: {which}; {kind}",
            tuple(f"{name}_{end}" for name in names for end in ("call", "many")),
            lambda: self._texts(groups, lanes),
            vectors=lanes,
            # Straight-line code is as fast as by -O2, and takes a third less time to compile. That
            # of several samples gains a tenth by fused multiply-add, which rounds once less.
            flags=("-ffp-contract=fast",) if lanes else ("-O1",),
            determined_by=f"{self.identity} {which} {kind}",
            count=2 * units if lanes else units + 1,
        )

    def _proof_of(self, groups: tuple[str, ...]) -> Callable[[Library], Mapping[str, Any]]:
        def prove(library: Library) -> Mapping[str, Any]:
            with self._proving:
                signatures = self._signatures(groups)
                functions = self._loaded(library, signatures)
                return {
                    "signatures": signatures,
                    "partition": _as_dict(self.partition),
                    "differences": {
                        name: self._proof.compare(name, function)
                        for name, function in functions.items()
                    },
                }

        return prove

    def _replacing(self, groups: tuple[str, ...], lanes: bool = False) -> Callable[[Library], None]:
        """Return what takes over a better library: one with lanes gives way to no other."""

        def replace(better: Library) -> None:
            with self._lock:
                for group in groups:
                    if group in self._lanes_in_use and not lanes:
                        continue
                    if lanes:
                        self._lanes_in_use.add(group)
                    for name in self._names(group):
                        self._functions[name].replace(Entry.of(better, name))
                    self.libraries[group] = better

        return replace

    def wait(self) -> None:
        """Wait for what is being built in the background."""
        for better in list(self._better):
            better.result()

    def _names(self, group: str) -> tuple[str, ...]:
        if group == "derivatives" and not self.partition.is_actuated:
            return ("forward_dynamics_derivatives",)  # the forces follow from no actuated motion
        possible = _ALL if self.parameters else GROUPS
        if group in possible:
            return possible[group]
        if group.startswith("frame_"):
            return (group,)
        raise InputError(
            f"no group of functions {group!r}{did_you_mean(group, possible)}; there are: "
            f"{', '.join(possible)}"
        )

    def _texts(self, groups: tuple[str, ...], lanes: bool) -> Iterator[str]:
        """Return the texts of the functions, which compile while the next are written.

        A short one comes first, then those that take longest.
        """
        order, batches = ("dynamics", "derivatives"), list[str]()
        for group in sorted(groups, key=lambda one: order.index(one) if one in order else 2):
            for names in self._units(group, lanes):
                unit, more = self._unit(names), _MORE if group == "derivatives" else ""
                one, many = unit.library(lanes=lanes and names != ["steps"])  # of one motion
                yield more + one
                if lanes:
                    yield more + many
                batches += unit.batches()
        if not lanes:
            yield "\n".join([batch_prelude(), *batches])

    def _units(self, group: str, lanes: bool) -> list[list[str]]:
        """Return which functions share a text: large ones, and those without lanes, have their own.

        A text takes a compiler some time to start with.
        """
        names = list(self._names(group))
        if group == "derivatives" or (lanes and "steps" in names):
            return [[name] for name in names]
        return [names]

    def _unit(self, names: Sequence[str]) -> Unit:
        checked = {n for n in names if n in _CHECKED or n.startswith("frame_jacobian_")}
        called, loops = with_calls(self.functions, list(names))
        kernels = tuple(Kernel(self.functions[one]) for one in called)
        entries = tuple(names)
        return Unit(f"unit_{names[0]}", kernels, loops, entries, frozenset(checked), limit=1.0)

    def _signatures(self, groups: tuple[str, ...]) -> dict[str, Any]:
        """Return names and shapes of the functions' inputs and outputs."""
        found = {}
        for name in [name for group in groups for name in self._names(group)]:
            unit = self._unit([name])
            one = unit.function(name)
            shapes = [list(shape) for shape in one.shapes]
            count, outputs = len(one.inputs), unit.handed_out(name)
            inputs = [[key, shapes[i]] for i, (key, _) in enumerate(one.inputs)]
            results = [[key, shapes[count + i]] for i, (key, _) in enumerate(outputs)]
            for result in results:
                if is_matrix(str(result[0])) and len(result[1]) == 1:
                    result[1] = [*result[1], 1]
            found[name] = [inputs, results]
        return found

    def _loaded(
        self, library: Library, signatures: Mapping[str, Any]
    ) -> dict[str, CompiledFunction]:
        found = {}
        for name, (inputs, outputs) in signatures.items():
            given, results = (
                [Argument(key, tuple(shape)) for key, shape in part] for part in (inputs, outputs)
            )
            found[name] = CompiledFunction(name, given, results, Entry.of(library, name))
        return found


def _as_dict(partition: Partition) -> dict[str, Any]:
    """Return a partition as JSON holds it."""
    values = asdict(partition)
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()}


def _of_dict(values: Mapping[str, Any]) -> Partition:
    indices = ("independent", "dependent", "idle")
    return Partition(**{**values, **{name: np.array(values[name], np.intp) for name in indices}})
