"""Builtin functions of Python whose machine code is generated: a call costs 0.1 microseconds.

The code (``c/python_call.h``) reads NumPy's arrays where they lie and makes new ones, so it has to
know how they lie in memory, and where some functions of Python and NumPy are. Both are documented
for extensions and stay the same over NumPy 1 and 2; here they are proven before they are used.
"""

from __future__ import annotations

import ctypes
import functools
import importlib
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

#: What answers calls that the machine code does not, with the same arguments.
General = Callable[..., Any]

_WORD = ctypes.sizeof(ctypes.c_void_p)
_FASTCALL_AND_KEYWORDS = 0x80 | 0x02
#: Functions of the machine code's record, and their names in Python's C interface.
_PYTHON = {
    "new_tuple": "PyTuple_New",
    "set": "PyTuple_SetItem",
    "integer": "PyLong_FromLong",
    "call": "PyObject_Vectorcall",
    "drop": "Py_DecRef",
}
_LOCK = {"release": "PyEval_SaveThread", "acquire": "PyEval_RestoreThread"}
#: Versions of NumPy's binary interface with `PyArray_New` at its place: those of NumPy 1 and 2.
_INTERFACES = (0x1000009, 0x2000000)
_NEW_ARRAY = 93
#: py_method in C.
_RECORD = np.dtype(
    [
        ("name", np.uintp),
        ("code", np.uintp),
        ("flags", np.intc),
        ("doc", np.uintp),
        ("inputs", np.int_),
        ("outputs", np.int_),
        *((name, np.uintp) for name in ("shapes", "array_type", "new_array", *_PYTHON, *_LOCK)),
    ],
    align=True,
)


class _DType(ctypes.Structure):
    """py_dtype in C."""

    _fields_ = (
        ("references", ctypes.c_long),
        ("type", ctypes.c_void_p),
        ("scalar", ctypes.c_void_p),
        *((name, ctypes.c_char) for name in ("kind", "letter", "order", "old_flags")),
        ("number", ctypes.c_int),
    )


class _Array(ctypes.Structure):
    """py_array in C."""

    _fields_ = (
        ("references", ctypes.c_long),
        ("type", ctypes.c_void_p),
        ("data", ctypes.c_void_p),
        ("nd", ctypes.c_int),
        ("dimensions", ctypes.POINTER(ctypes.c_long)),
        ("strides", ctypes.POINTER(ctypes.c_long)),
        ("base", ctypes.c_void_p),
        ("dtype", ctypes.POINTER(_DType)),
        ("flags", ctypes.c_int),
    )


class _Method(np.ndarray[Any, Any]):
    """The record of a builtin function: ``self`` of the machine code, which calls it for others.

    The record lies in the array's own memory, so it is there as long as the builtin function,
    which reads it to its end.
    """

    general: General
    kept: list[Any]

    def __call__(self, *inputs: Any, **options: Any) -> Any:
        return self.general(*inputs, **options)


class BuiltinFunction:
    """A builtin function of Python with machine code that can be replaced.

    Where all inputs are float64 arrays of one sample's shapes, contiguous and aligned, ``call``
    returns the outputs, new arrays, and the status; it may be called once `replace` has given it
    code. `addresses` must know this Python and NumPy.

    Parameters
    ----------
    name
        Of the function.
    inputs, outputs
        Shapes of one sample's arrays.
    general
        Called for all other arguments, keywords too.
    release
        Whether other threads of Python run while the machine code does.
    """

    def __init__(
        self,
        name: str,
        inputs: Sequence[tuple[int, ...]],
        outputs: Sequence[tuple[int, ...]],
        general: General,
        release: bool,
    ) -> None:
        text = ctypes.create_string_buffer(name.encode())
        shapes = np.array([n for one in (*inputs, *outputs) for n in (len(one), *one)], np.int_)
        record = np.zeros((), _RECORD)
        record["name"], record["flags"] = ctypes.addressof(text), _FASTCALL_AND_KEYWORDS
        record["inputs"], record["outputs"] = len(inputs), len(outputs)
        record["shapes"] = shapes.ctypes.data
        for field, address in (addresses() or {}).items():
            if release or field not in _LOCK:
                record[field] = address
        self._method = _Method((), _RECORD)
        self._method[()] = record
        self._method.general, self._method.kept = general, [text, shapes]
        self.call: Callable[..., Any] = _new_function()(
            self._method.ctypes.data, self._method, None
        )

    def replace(self, code: int, owner: object) -> None:
        """Use the machine code at an address from now on; it goes with its owner.

        A call that runs meanwhile returns to the old code, which is therefore kept.
        """
        if not any(owner is one for one in self._method.kept):
            self._method.kept.append(owner)
        self._method["code"] = code


@functools.cache
def addresses() -> dict[str, int] | None:
    """Return the addresses that the machine code needs, or None if anything is not as it knows."""
    one_lock = object.__basicsize__ == 2 * _WORD  # otherwise it has no lock, or counts for tests
    if (
        sys.implementation.name != "cpython"
        or not one_lock
        or ctypes.sizeof(ctypes.c_long) != _WORD
    ):
        return None
    try:
        found = {
            field: ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value or 0
            for field, name in {**_PYTHON, **_LOCK}.items()
        }
        found["new_array"] = _new_array()
    except (AttributeError, ImportError):
        return None
    found["array_type"] = id(np.ndarray)
    return found if all(found.values()) and all(map(_lies_as_known, _examples())) else None


@functools.cache
def _new_function() -> Callable[..., Callable[..., Any]]:
    """Return Python's ``PyCFunction_NewEx(definition, self, module)``."""
    kind = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)
    return kind(("PyCFunction_NewEx", ctypes.pythonapi))


def _examples() -> list[np.ndarray[Any, Any]]:
    numbers = np.arange(24.0)
    matrix = numbers.reshape(4, 6)
    arrays = [numbers, matrix, matrix[1:3, ::2], matrix.T, np.array(1.5)]
    unaligned = np.zeros(12, "u1")[4:].view("f8")
    others = [unaligned, numbers.astype(">f8"), numbers.astype("f4")]
    return [*arrays, numbers.reshape(2, 3, 4), *others]


def _lies_as_known(array: np.ndarray[Any, Any]) -> bool:
    """Return whether an array lies in memory as py_array tells."""
    raw = _Array.from_address(id(array))
    dtype = raw.dtype.contents
    flags = array.flags
    return (
        raw.type == id(np.ndarray)
        and raw.data == array.ctypes.data
        and raw.nd == array.ndim
        and tuple(raw.dimensions[: array.ndim]) == array.shape
        and tuple(raw.strides[: array.ndim]) == array.strides
        and (raw.base or None) == (None if array.base is None else id(array.base))
        and ctypes.addressof(dtype) == id(array.dtype)
        and dtype.order.decode() == array.dtype.byteorder
        and dtype.number == array.dtype.num
        and raw.flags & 0x1 == flags.c_contiguous * 0x1
        and raw.flags & 0x100 == flags.aligned * 0x100
    )


def _new_array() -> int:
    """Return the address of NumPy's `PyArray_New`, as ``import_array`` of extensions finds it."""
    try:
        inner = importlib.import_module("numpy._core._multiarray_umath")
    except ImportError:  # of NumPy 1
        inner = importlib.import_module("numpy.core._multiarray_umath")
    pointer = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
        ("PyCapsule_GetPointer", ctypes.pythonapi)
    )
    table = ctypes.cast(pointer(inner._ARRAY_API, None), ctypes.POINTER(ctypes.c_void_p))
    version = ctypes.CFUNCTYPE(ctypes.c_uint)(table[0] or 0)
    return (table[_NEW_ARRAY] or 0) if version() in _INTERFACES else 0
