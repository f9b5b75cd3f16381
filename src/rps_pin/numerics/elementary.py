"""Elementary functions of floats, NumPy arrays (real and complex) and CasADi expressions.

Kernels are written with these and with + - * / only, so that one body serves all four. Of complex
numbers, comparisons read the real part: the imaginary part carries a derivative (complex step).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeAlias

import numpy as np

_NUMERIC = (np.ndarray, np.number, complex, int)
#: A float, an array, a complex number or array, or a CasADi expression.
Number: TypeAlias = Any


def _function(name: str) -> Callable[[Number], Number]:
    """Return the function of one number that has a name in `math`, NumPy and CasADi."""
    on_float, on_array = getattr(math, name), getattr(np, name)

    def function(x: Number) -> Number:
        if type(x) is float:
            return on_float(x)
        return on_array(x) if isinstance(x, _NUMERIC) else getattr(x, name)()

    return function


sqrt, cos, sin, tanh = _function("sqrt"), _function("cos"), _function("sin"), _function("tanh")


def atan2(y: Number, x: Number) -> Number:
    """Return the angle of (x, y) from the x axis, -pi to pi; of complex numbers to first order."""
    if type(y) is type(x) is float:
        return math.atan2(y, x)
    if not (isinstance(y, (float, *_NUMERIC)) and isinstance(x, (float, *_NUMERIC))):
        return _casadi().atan2(y, x)
    if not (_is_complex(x) or _is_complex(y)):
        return np.arctan2(y, x)
    a, b = np.real(x), np.real(y)
    return np.arctan2(b, a) + 1j * (a * np.imag(y) - b * np.imag(x)) / (a * a + b * b)


def less(a: Number, b: Number) -> Number:
    """Return whether a < b, of the real parts."""
    if type(a) is type(b) is float:
        return a < b
    if _is_complex(a) or _is_complex(b):
        return np.real(a) < np.real(b)
    return a < b


def select(condition: Number, yes: Number, no: Number) -> Number:
    """Return one of two numbers; both are evaluated."""
    if condition is True:  # of floats: the fast path
        return yes
    if condition is False:
        return no
    if isinstance(condition, (np.ndarray, np.bool_)):
        return np.where(condition, yes, no)
    return _casadi().if_else(condition, yes, no)


def both(one: Number, other: Number) -> Number:
    """Return whether two conditions hold."""
    if one is True:
        return other
    if one is False:
        return False
    if isinstance(one, (np.ndarray, np.bool_)):
        return one & other
    return _casadi().logic_and(one, other)


def greatest(a: Number, b: Number, c: Number) -> Number:
    """Return the greatest of three numbers."""
    if type(a) is type(b) is type(c) is float:
        return max(a, b, c)
    if is_real_array(a):
        return np.maximum(np.maximum(a, b), c)
    most = select(less(a, b), b, a)
    return select(less(most, c), c, most)


def least(a: Number, b: Number, c: Number) -> Number:
    """Return the least of three numbers."""
    return -greatest(-a, -b, -c)


def clamp(x: Number, lower: Number, upper: Number) -> Number:
    """Return x, or the bound that it passes; the lower one of NaN."""
    bounded = select(less(lower, x), x, lower)
    return select(less(bounded, upper), bounded, upper)


def select_all(condition: Number, yes: tuple[Number, ...], no: tuple[Number, ...]) -> Any:
    """Return one of two tuples of numbers: `select` of each."""
    if condition is True:
        return yes
    if condition is False:
        return no
    return tuple(select(condition, one, other) for one, other in zip(yes, no, strict=True))


def always(condition: Number) -> bool:
    """Return whether a condition holds, of arrays everywhere; not known of expressions: False."""
    if condition is True or condition is False:
        return condition
    return isinstance(condition, (np.ndarray, np.bool_)) and bool(condition.all())


def never(condition: Number) -> bool:
    """Return whether a condition holds nowhere; not known of expressions: False."""
    if condition is True or condition is False:
        return not condition
    return isinstance(condition, (np.ndarray, np.bool_)) and not condition.any()


def is_zero(x: Number) -> bool:
    """Return whether this is the number zero; an expression is not."""
    return isinstance(x, (float, int)) and x == 0


def is_real_array(x: Number) -> bool:
    """Return whether this is a NumPy array of real numbers."""
    return isinstance(x, np.ndarray) and x.dtype.kind == "f"


def _is_complex(x: Number) -> bool:
    return isinstance(x, complex) or (isinstance(x, np.ndarray) and x.dtype.kind == "c")


def _casadi() -> Any:
    """Return the library of an expression at hand; it is no requirement."""
    return import_module("casadi")
