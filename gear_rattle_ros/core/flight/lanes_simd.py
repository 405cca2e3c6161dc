# Copyright 2026 The gear_rattle_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What numba lacks to let LLVM turn loops into SIMD code."""

from typing import Any, cast

from llvmlite import ir
import numba
from numba import types
import numba.extending

from ..compiled import Function

# Untyped in numba.
intrinsic: Any = numba.extending.intrinsic


def inlined(function: Function) -> Function:
    """Compile a kernel that is inlined where it is called."""
    return cast(Function, numba.njit(error_model='numpy', nogil=True, forceinline=True)(function))


@intrinsic  # type: ignore[untyped-decorator]
def choose(_context: Any, condition: Any, yes: Any, no: Any) -> Any:
    """Select one of two floats without a branch; LLVM would merge branches into masked stores."""
    def code(_target: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.select(*arguments)

    return types.float64(types.boolean, types.float64, types.float64), code


@intrinsic  # type: ignore[untyped-decorator]
def square_root(_context: Any, x: Any) -> Any:
    """Take a square root by instruction: `math.sqrt` calls libm, which does not vectorise."""
    def code(_target: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.call(
            builder.module.declare_intrinsic('llvm.sqrt', [ir.DoubleType()]), arguments)

    return types.float64(types.float64), code


@intrinsic  # type: ignore[untyped-decorator]
def prefer_wide_vectors(_context: Any) -> Any:
    """Let LLVM use 512-bit vectors in the calling function, where the processor has them."""
    # LLVM prefers 256 bits on many Intel processors; this sets the function attribute of clang's
    # `-mprefer-vector-width=512`. llvmlite has no attributes with values: its text is added.
    def code(context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.void(), code
