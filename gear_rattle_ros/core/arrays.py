"""The arrays of numbers that functions take and return."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
# Records of a structured dtype.
RecordArray: TypeAlias = npt.NDArray[np.void]
