"""Samples of a batch that fail one by one: their errors, and the option ``errors``."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import Any, Literal, ParamSpec, TypeVar

import numpy as np

from rps_pin.arrays import Bools
from rps_pin.errors import RPSPinError
from rps_pin.validation import choice

Errors = Literal["raise", "mask"]
_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


def check_errors_option(errors: object) -> None:
    """Raise `InputError` unless errors is ``"raise"`` or ``"mask"``."""
    choice(errors, "errors", ("raise", "mask"))


def refuse(failed: Bools | np.bool_, error: Callable[[tuple[int, ...], str], RPSPinError]) -> None:
    """Raise the error of the first sample that fails, if one does.

    Parameters
    ----------
    failed
        Which samples fail, shape (...); kept as `RPSPinError.failed`.
    error
        Returns the error of a sample, from its index and the text that names it in a batch, such as
        ``" (entry (3,) of 10)"``.
    """
    if failed.any():
        first = tuple(int(i) for i in np.argwhere(failed)[0])
        raised = error(first, f" (entry {first} of {failed.size})" if first else "")
        raised.failed = np.asarray(failed)
        raise raised


def maskable(
    *derived: str,
    **endings: int,
) -> Callable[[Callable[_Arguments, _Result]], Callable[_Arguments, _Result]]:
    """Give a function of batches the option ``errors``, by its keyword argument of this name.

    With ``"mask"``, the function is called with the samples that do not fail. In its results, which
    are arrays with the batch dimensions first, or tuples or dataclasses of such arrays, the others
    are NaN, in masks false.

    Parameters
    ----------
    derived
        Names of keyword arguments that follow from the others, given to save time: left out in the
        call with the samples that do not fail.
    endings
        For each argument with batch dimensions, the number of its dimensions after these.
    """

    def decorate(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
        parameters = signature(function)

        @wraps(function)
        def call(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Result:
            errors = kwargs.get("errors", "raise")
            check_errors_option(errors)
            try:
                return function(*args, **kwargs)
            except RPSPinError as error:
                if errors == "raise" or error.failed is None:
                    raise
                good = ~error.failed
            given = parameters.bind(*args, **kwargs)
            for name in endings.keys() & given.arguments.keys():
                if given.arguments[name] is not None:
                    value = np.asarray(given.arguments[name])
                    whole = good.shape + value.shape[value.ndim - endings[name] :]
                    given.arguments[name] = np.broadcast_to(value, whole)[good]
            for name in derived:
                given.arguments.pop(name, None)
            result: _Result = _spread(call(*given.args, **given.kwargs), good)
            return result

        return call

    return decorate


def _spread(result: Any, good: Bools) -> Any:
    """Return results of the good samples, (n, ...), as results of all, (..., ...)."""
    if isinstance(result, np.ndarray):
        whole = np.full(good.shape + result.shape[1:], False if result.dtype == bool else np.nan)
        whole[good] = result
        return whole
    parts = result if isinstance(result, tuple) else vars(result).values()
    spread = tuple(_spread(part, good) for part in parts)
    return spread if type(result) is tuple else type(result)(*spread)
