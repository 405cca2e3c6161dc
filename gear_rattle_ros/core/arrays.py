"""The arrays of numbers that functions take and return."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int64]
# Records of a structured dtype.
RecordArray: TypeAlias = npt.NDArray[np.void]
# One of them in a kernel: the types of numpy do not know its fields.
Record: TypeAlias = Any
# A whole number in a kernel, of Python or of numpy: for numba they are one.
Whole: TypeAlias = Any
