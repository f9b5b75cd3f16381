"""Arguments of a wrong kind, told when a call fails: which one it is, and what it must be.

A public call that is given, say, a list where it takes a robot fails somewhere inside, with an
error of Python. `refuses_other_kinds` then compares the arguments with the type hints of the call,
and raises `InputError` with the name of the one that does not fit. A call that succeeds pays the
wrapper alone, and one whose arguments fit keeps its error: that is a fault of this package.
"""

from __future__ import annotations

import inspect
import os
import sys
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import wraps
from numbers import Integral, Real
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from rps_pin.errors import InputError, RPSPinError, shown
from rps_pin.validation import numbers

_Public = TypeVar("_Public", bound=Callable[..., Any])
_NUMBERS: dict[Any, Any] = {float: Real, int: Integral}
#: `ArrayLike` is a union, which another union takes apart.
_OF_ARRAYS = frozenset(typing.get_args(ArrayLike))
_FOREIGN = (AttributeError, TypeError, ValueError, LookupError, ArithmeticError)


def refuses_other_kinds(public: _Public, besides: Sequence[str] = ()) -> _Public:
    """Return a function, or a class with its public methods, that tells wrong kinds of arguments.

    Methods in `besides` are left as they are: those of control loops, where the wrapper's 0.1 us
    count.
    """
    if not inspect.isclass(public):
        return typing.cast(_Public, _telling(public))
    for name, member in list(vars(public).items()):
        if name in besides or (name.startswith("_") and name != "__init__"):
            continue
        if isinstance(member, (classmethod, staticmethod)):
            setattr(public, name, type(member)(_telling(member.__func__)))
        elif inspect.isfunction(member):
            setattr(public, name, _telling(member))
    return public


def _telling(function: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        try:
            return function(*args, **options)
        except RPSPinError:
            raise
        except _FOREIGN as error:
            if told := other_kind(function, args, options):
                raise InputError(told) from error
            raise

    return call


def other_kind(
    function: Callable[..., Any], args: Sequence[Any], options: Mapping[str, Any]
) -> str:
    """Return what is wrong with the first argument that does not fit its hint; empty if all fit."""
    function = inspect.unwrap(function)
    signature = inspect.signature(function)
    try:
        given = signature.bind(*args, **options).arguments
    except TypeError:  # too many, or too few
        return ""
    for name, value in given.items():
        one = signature.parameters[name]
        if one.kind in (one.VAR_POSITIONAL, one.VAR_KEYWORD) or one.annotation is one.empty:
            continue
        if not fits(value, _evaluated(one.annotation, function)):
            wanted = inspect.formatannotation(one.annotation).strip("'").replace(" | ", " or ")
            return f"{name} = {shown(value)}: it must be {wanted}"
    return ""


def _evaluated(hint: Any, function: Callable[..., Any]) -> Any:
    if not isinstance(hint, str):
        return hint
    try:
        return eval(hint, getattr(function, "__globals__", {}))
    except Exception:  # a name that only a type checker sees
        return Any


def fits(value: Any, hint: Any) -> bool:
    """Return whether a value is of the kind of a hint; true where that cannot be told."""
    origin, parts, found = typing.get_origin(hint), typing.get_args(hint), True
    if hint is ArrayLike:
        found = _is_numbers(value)
    elif origin in (typing.Union, types.UnionType):
        others = [one for one in parts if one not in _OF_ARRAYS]
        has_arrays = len(others) < len(parts) and set(parts) >= _OF_ARRAYS
        found = has_arrays and _is_numbers(value)
        found = found or any(fits(value, one) for one in (others if has_arrays else parts))
    elif origin is typing.Literal:
        found = any(type(value) is type(one) and value == one for one in parts)
    elif origin is typing.Annotated:
        found = fits(value, parts[0])
    elif hint is None:
        found = value is None
    elif isinstance(origin or hint, type):
        found = _is_instance(value, origin or hint) and _parts_fit(value, origin, parts)
    return found


def _is_numbers(value: Any) -> bool:
    try:
        numbers(value, "", "")
    except InputError:
        return False
    return True


def _is_instance(value: Any, kind: Any) -> bool:
    if kind in _NUMBERS:
        right = isinstance(value, _NUMBERS[kind]) and not isinstance(value, (bool, np.bool_))
        return right and not (type(value) is int and abs(value) > sys.float_info.max)
    if kind is bool:
        return isinstance(value, (bool, np.bool_))
    if kind is Sequence:
        return isinstance(value, (Sequence, np.ndarray)) and not isinstance(value, (str, bytes))
    if getattr(kind, "_is_protocol", False) and kind.__module__.startswith("rps_pin"):
        return all(hasattr(value, name) for name in _members(kind))
    try:
        return isinstance(value, kind)
    except TypeError:  # a kind that only a type checker can tell
        return True


def _members(protocol: Any) -> set[str]:
    own = [one for one in protocol.__mro__ if one.__module__.startswith("rps_pin")]
    found = {name for one in own for name in (*vars(one), *getattr(one, "__annotations__", {}))}
    return {name for name in found if not name.startswith("_")}


def _parts_fit(value: Any, origin: Any, parts: tuple[Any, ...]) -> bool:
    """Return whether what is inside a container fits too."""
    if not parts or origin in (type, os.PathLike, np.ndarray):
        return True
    if isinstance(value, (str, Iterator)):
        return True
    if isinstance(value, Mapping):
        wanted = parts if len(parts) == 2 else (Any, Any)
        return all(fits(key, wanted[0]) and fits(one, wanted[1]) for key, one in value.items())
    if isinstance(value, tuple) and origin is tuple and parts[-1] is not Ellipsis:
        return len(value) == len(parts) and all(map(fits, value, parts))
    if isinstance(value, Iterable) and not callable(value):
        return all(fits(one, parts[0]) for one in value)
    return True
