"""Batches of samples, of which the Pinocchio engine answers those that generated code flags."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.arrays import Array
from rps_pin.errors import InputError, RPSPinError
from rps_pin.validation import numbers

Errors = Literal["raise", "mask"]
#: Answers of one sample, from its arguments.
Answer = Callable[..., Sequence[Any]]


def settled(
    found: Sequence[Array],
    status: Any,
    given: Sequence[ArrayLike],
    answer: Answer,
    errors: Errors = "raise",
) -> Sequence[Any]:
    """Return results of generated code, those of flagged samples replaced by an engine's answers.

    Parameters
    ----------
    found, status
        Results, shapes (..., *shape), and status, an int or shape (...).
    given
        The arguments; those with batch dimensions have one more dimension.
    answer
        Returns the results of one sample, or raises.
    errors
        As for `CompiledMechanism`.

    Raises
    ------
    RPSPinError
        That of the first sample which has no answer, and which one it is.
    """
    if isinstance(status, int):
        return _one([part.shape for part in found], given, answer, errors) if status else found
    flagged = np.argwhere(status)
    if not flagged.size:
        return found
    arrays = [_spread(array, status.shape) for array in given]
    failed = np.zeros(status.shape, dtype=bool)
    first: tuple[tuple[int, ...], RPSPinError] | None = None
    for row in flagged:
        index = tuple(int(i) for i in row)
        try:
            answers = answer(*(array[index] for array in arrays))
        except RPSPinError as error:
            failed[index] = True
            first = first or (index, error)
            answers = [np.nan] * len(found)
        for whole, part in zip(found, answers, strict=True):
            whole[index] = part
    if first is not None and errors == "raise":
        index, raised = first
        raised.args = (f"sample {index}: {raised}", *raised.args[1:])
        raised.failed = failed
        raise raised
    return found


def by_samples(
    answer: Answer,
    given: Sequence[ArrayLike],
    shapes: Sequence[tuple[int, ...]],
    errors: Errors = "raise",
) -> Sequence[Any]:
    """Return an engine's answers of all samples, (..., *shape); arguments (..., n) each."""
    arrays = [numbers(array, "an argument", "numbers of shape (..., n)") for array in given]
    try:
        batch = np.broadcast_shapes(*(array.shape[:-1] for array in arrays))
    except ValueError:
        told = ", ".join(str(array.shape) for array in arrays)
        raise InputError(
            f"the leading dimensions of the arguments do not go together: {told}"
        ) from None
    if not batch:
        return _one(shapes, arrays, answer, errors)
    found = [np.empty(batch + shape) for shape in shapes]
    return settled(found, np.ones(batch, dtype=np.int32), arrays, answer, errors)


def _one(
    shapes: Sequence[tuple[int, ...]], given: Sequence[ArrayLike], answer: Answer, errors: Errors
) -> Sequence[Any]:
    """Return an engine's answers of one sample, or NaN."""
    try:
        return answer(*given)
    except RPSPinError:
        if errors == "raise":
            raise
        return [np.full(shape, np.nan) for shape in shapes]


def _spread(array: ArrayLike, batch: tuple[int, ...]) -> Array:
    """Return an argument (..., n) with the whole batch's dimensions."""
    whole = np.asarray(array, dtype=np.float64)
    return np.broadcast_to(whole, batch + whole.shape[-1:])
