"""Array types: the names that annotations of this package use for NumPy arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Real numbers, float64.
Array = NDArray[np.float64]
#: Complex numbers, complex128.
ComplexArray = NDArray[np.complex128]
#: Masks.
Bools = NDArray[np.bool_]
#: Indices into other arrays.
Indices = NDArray[np.intp]

__all__ = ["Array", "Bools", "ComplexArray", "Indices"]
