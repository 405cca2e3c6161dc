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

"""What a store of labelled arrays consists of."""

from collections.abc import Mapping
import dataclasses
from typing import Any

import numpy.typing as npt


@dataclasses.dataclass(frozen=True)
class Variable:
    """An array of a store; its attributes are `long_name`, `units` and the like."""

    name: str
    dimensions: tuple[str, ...]
    dtype: str
    attributes: Mapping[str, Any] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Axis:
    """A dimension with its coordinate; `tile` is a tile's length along it, 0 for all of it."""

    name: str
    values: npt.NDArray[Any]
    attributes: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    tile: int = 0


@dataclasses.dataclass(frozen=True)
class Layout:
    """
    What a store consists of: axes, arrays that are written tile by tile, and attributes.

    `identity` is what makes it this result and no other (tool, parameters, windows, tolerances
    ...): plain numbers, strings and lists. It is written as attributes; a store with another
    identity is not resumed.
    """

    axes: tuple[Axis, ...]
    variables: tuple[Variable, ...]
    identity: Mapping[str, Any]
    attributes: Mapping[str, Any] = dataclasses.field(default_factory=dict)
