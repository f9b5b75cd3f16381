"""Result of a simulation: a motion as arrays, a row for each recorded time."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from rps_pin.arrays import Array, Indices
from rps_pin.closed_loop.assembly.joint_limits import JointLimits
from rps_pin.closed_loop.column_names import column_names
from rps_pin.files import whole_file
from rps_pin.other_kinds import refuses_other_kinds

#: Arrays of a `Simulation` with a row for each time, in the order of a table.
_ARRAYS = ("time", "q", "v", "a", "tau", "kinetic", "potential", "gap", "work")


class JointLimitPassed(NamedTuple):
    """A joint that left its limits, when it first did."""

    joint: str
    """Its name."""
    time: float
    """End of the step in which it happened, s."""
    value: float
    """Its coordinate then, rad or m."""
    lower: float
    """Its lower limit, rad or m."""
    upper: float
    """Its upper limit, rad or m."""

    def __str__(self) -> str:
        return (
            f"joint {self.joint!r} left its limits {self.lower:.6g} to {self.upper:.6g} at "
            f"t = {self.time:.6g} s: {self.value:.6g}"
        )


@refuses_other_kinds
@dataclass(frozen=True, eq=False)
class Simulation:
    """A simulated motion; n recorded times.

    Attributes
    ----------
    time : (n,) array
        s.
    q, v, a : (n, nq), (n, nv), (n, nv) arrays
        Configurations, velocities and accelerations, as Pinocchio has them; `a` under the `tau` of
        the same row.
    tau : (n, na) array
        Actuator forces from each time on, N or N m.
    kinetic, potential : (n,) arrays
        Energies, rotors and springs included, J.
    gap : (n,) array
        Largest gap between closed frames, m (see `ClosedLoopModel.loop_gap`).
    constraint_forces : (n, nc) array, or None
        The closures' multipliers (see `InverseDynamics`), if they were asked for.
    limits_passed : tuple of JointLimitPassed
        The joints that left their limits (which are not enforced), in the order in which they
        did.
    q_names, v_names, tau_names : tuples of str
        Names of the columns, for tables.
    work : (n,) array
        Work done since the start, J, by actuator forces, external wrenches, damping and friction
        (negative where energy is lost). Integrated along the steps, to
        their order.
    """

    time: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    kinetic: Array
    potential: Array
    gap: Array
    constraint_forces: Array | None
    limits_passed: tuple[JointLimitPassed, ...]
    q_names: tuple[str, ...]
    v_names: tuple[str, ...]
    tau_names: tuple[str, ...]
    work: Array

    @property
    def energy_balance(self) -> Array:
        """Energy less the work done, zero at the start, shape (n,), J: the integration's error."""
        return self.energy - self.energy[:1] - self.work

    @property
    def energy(self) -> Array:
        """Kinetic and potential energy together, shape (n,), J."""
        return self.kinetic + self.potential

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write all of it as a table with a heading; the file is written whole or not at all.

        Numbers have 17 digits: they read back as they were.
        """
        entries = {"q": self.q_names, "v": self.v_names, "a": self.v_names, "tau": self.tau_names}
        names: list[str] = []
        for array in _ARRAYS:
            names += [f"{array}_{name}" for name in entries[array]] if array in entries else [array]
        columns = [getattr(self, array) for array in _ARRAYS]
        if self.constraint_forces is not None:
            names += [f"lambda_{row}" for row in range(self.constraint_forces.shape[1])]
            columns.append(self.constraint_forces)
        with whole_file(path) as scratch:
            table = np.column_stack(columns)
            heading = ",".join(f'"{name}"' if "," in name else name for name in names)
            np.savetxt(scratch, table, fmt="%.17g", delimiter=",", header=heading, comments="")

    def to_npz(self, path: str | os.PathLike[str]) -> None:
        """Write the arrays under their names for `numpy.load`, whole or not at all."""
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        if self.constraint_forces is not None:
            arrays["constraint_forces"] = self.constraint_forces
        for name in ("q_names", "v_names", "tau_names"):
            arrays[name] = np.array(getattr(self, name), dtype=str)
        with whole_file(path) as scratch, scratch.open("wb") as stream:
            np.savez_compressed(stream, **arrays)


class Recorder:
    """Collects samples and watches the joint limits.

    Parameters
    ----------
    model
        The mechanism's tree.
    actuated
        Indices of the actuated velocities.
    """

    def __init__(self, model: pin.Model, actuated: Indices) -> None:
        self._model, self._limits = model, JointLimits(model)
        self._watched = np.ones(self._limits.q.size, dtype=bool)
        self._passed: list[JointLimitPassed] = []
        self._columns: dict[str, list[Any]] = {name: [] for name in (*_ARRAYS, "constraint_forces")}
        q_names, v_names = column_names(model)
        self._names: dict[str, Any] = {
            "q_names": q_names,
            "v_names": v_names,
            "tau_names": tuple(v_names[index] for index in actuated),
        }
        nv = model.nv
        self._shapes = {"q": (model.nq,), "v": (nv,), "a": (nv,), "tau": (actuated.size,)}

    def watch(self, time: float, q: Array) -> None:
        """Note the joints that are outside their limits for the first time."""
        limits = self._limits
        outside = limits.beyond(q)
        if not outside.any():
            return
        for index in np.flatnonzero(outside & self._watched):
            self._watched[index] = False
            value = float(q[limits.q[index]])
            lower, upper = float(limits.lower[index]), float(limits.upper[index])
            passed = JointLimitPassed(limits.names[index], time, value, lower, upper)
            self._passed.append(passed)

    def watch_all(self, time: Array, q: Array) -> None:
        """Watch all rows (n,) and (n, nq) of a motion."""
        for row in np.flatnonzero(self._limits.beyond(q).any(axis=1)):
            self.watch(float(time[row]), q[row])

    def whole(self, columns: Mapping[str, Array]) -> Simulation:
        """Return a motion of whole arrays, by their names in `Simulation`."""
        given: dict[str, Any] = {"constraint_forces": None, **columns}
        return Simulation(**given, **self._names, limits_passed=tuple(self._passed))

    def add(self, **row: Any) -> None:
        """Keep a row of all arrays of a `Simulation`, by name."""
        for name, value in row.items():
            self._columns[name].append(value)

    def simulation(self) -> Simulation:
        """Return what was recorded until now."""
        forces = self._columns["constraint_forces"]
        arrays: dict[str, Any] = {}
        for name in _ARRAYS:
            values = np.array(self._columns[name], dtype=np.float64)
            arrays[name] = values.reshape(len(values), *self._shapes.get(name, ()))
        return Simulation(
            **arrays,
            **self._names,
            constraint_forces=np.array(forces) if forces else None,
            limits_passed=tuple(self._passed),
        )
