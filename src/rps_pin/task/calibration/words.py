"""Directions of parameters that readings do not tell, in words.

A basis of these directions is made in which each has one parameter of its own (Gauss-Jordan with
column pivots), so that few parameters take part in each: "placement:left_joint.pitch by 1 rad has
the effect of offset:left_joint by -1 rad".
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.linalg import qr

from rps_pin.arrays import Array
from rps_pin.errors import few
from rps_pin.task.calibration.information import Identifiable
from rps_pin.task.calibration.prediction import CalibrationModel
from rps_pin.task.calibration.sensors import possible_sensors

#: Parts of a direction below this are rounding; parameters of a sentence, and names of a list.
_NONE, _MOST, _NAMES = 1e-6, 4, 60


def unseen_in_words(model: CalibrationModel, found: Identifiable) -> tuple[str, ...]:
    """Return what the readings cannot tell, a sentence for each combination of parameters.

    Parameters
    ----------
    model
        Whose parameters they are.
    found
        What was seen: `Calibration.identifiable`.
    """
    weak, rest = found.unseen[:, : found.weak], found.unseen[:, found.weak :]
    last = rest.shape[1] - found.opening
    sentences: list[str] = []
    names = [_named(model, k) for k in range(len(model.labels))]
    sentences += _of(rest[:, :last], model, names)
    opening = rest[:, last:]
    if opening.size:
        told = [names[k] for k in np.flatnonzero(np.abs(opening).max(axis=1) > _NONE)]
        sentences.append(
            f"{opening.shape[1]} combinations open the loops, and were left out; they are of "
            f"{few(told, _NAMES)}"
        )
    for k in range(weak.shape[1]):
        terms = _terms(weak[:, k] / model.units, model, names)
        deviation = 1.0 / found.singular_values[found.rank + k]
        sentences.append(
            f"seen too weakly (deviation {1e3 * deviation:.3g} mm): {' with '.join(terms)}"
        )
    return tuple(sentences)


def _of(unseen: Array, model: CalibrationModel, names: Sequence[str]) -> Iterator[str]:
    """Yield sentences of directions (p, k): of single parameters together, of others one each."""
    if not unseen.shape[1]:
        return
    _, _, order = qr(unseen.T, pivoting=True, mode="economic")
    own = order[: unseen.shape[1]]
    basis = np.linalg.solve(unseen[own].T, unseen.T)  # its columns `own` are the unit matrix
    basis[np.abs(basis) < _NONE] = 0.0
    alone = [k for k, row in zip(own, basis, strict=True) if np.count_nonzero(row) == 1]
    if alone:
        yield f"no reading depends on {few([names[k] for k in sorted(alone)], _NAMES)}"
    for k, row in sorted(zip(own, basis, strict=True), key=lambda one: one[0]):
        if k in alone:
            continue
        change = row / model.units
        change = -change / change[k]
        change[k] = 0.0
        terms = _terms(change, model, names)
        yield f"{names[k]} by 1 {_unit(model, k)} has the effect of {' with '.join(terms)}"


def _terms(change: Array, model: CalibrationModel, names: Sequence[str]) -> list[str]:
    """Return the largest parts of a change of parameters, (p,)."""
    size = np.abs(change * model.units)
    order = [k for k in np.argsort(-size) if size[k] > _NONE * size.max()]
    terms = [f"{names[k]} by {change[k]:.4g} {_unit(model, int(k))}" for k in order[:_MOST]]
    return terms + ([f"{len(order) - _MOST} more"] if len(order) > _MOST else [])


def _unit(model: CalibrationModel, k: int) -> str:
    """Return the unit of a parameter: a scale has none."""
    kind, _, name = model.labels[k].partition(":")
    if kind == "scale":
        return "(a ratio)"
    if kind == "offset":
        return "rad" if model.angular[model.sensors.index(name)] else "m"
    return "m" if model.units[k] == 1.0 and not _turns(model.labels[k]) else "rad"


def units_of(model: CalibrationModel) -> tuple[str, ...]:
    """Return the unit of each parameter: m, rad, or nothing of a scale."""
    return tuple(
        "" if label.startswith("scale:") else _unit(model, k)
        for k, label in enumerate(model.labels)
    )


def _turns(label: str) -> bool:
    return label.rpartition(".")[2] in ("roll", "pitch", "yaw", "rx", "ry", "rz")


def _named(model: CalibrationModel, k: int) -> str:
    """Return a parameter's label; that of a joint's own axis says so."""
    label: str = model.labels[k]
    kind, _, rest = label.partition(":")
    joint, _, part = rest.rpartition(".")
    axes = {"x": 0, "y": 1, "z": 2, "roll": 0, "pitch": 1, "yaw": 2}
    if kind != "placement" or part not in axes or joint not in possible_sensors(model.task):
        return label
    tree = model.mechanism.model
    one = tree.joints[tree.getJointId(joint)]
    data = one.createData()
    one.calc(data, np.zeros(tree.nq))
    motion = np.asarray(data.S).reshape(6)
    along = np.abs(motion[:3] if not _turns(label) else motion[3:])
    if along[axes[part]] < 1 - _NONE:
        return label
    return f"{label} ({'about' if _turns(label) else 'along'} its axis)"
