"""What a store of labelled arrays consists of."""

from collections.abc import Mapping
import dataclasses
from typing import Any

import numpy.typing as npt


@dataclasses.dataclass(frozen=True)
class Variable:
    """
    An array of a store.

    Attributes
    ----------
    name : str
        Its name.
    dimensions : tuple of str
        Their names.
    dtype : str
        Type of its elements, as numpy writes it.
    attributes : mapping
        `long_name`, `units` and the like.

    """

    name: str
    dimensions: tuple[str, ...]
    dtype: str
    attributes: Mapping[str, Any] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Axis:
    """
    A dimension with a coordinate.

    Attributes
    ----------
    name : str
        Of dimension and coordinate.
    values : ndarray
        The coordinate.
    attributes : mapping
        `long_name`, `units` and the like.
    tile : int
        Length of a tile along it; 0 where tiles span all of it.

    """

    name: str
    values: npt.NDArray[Any]
    attributes: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    tile: int = 0


@dataclasses.dataclass(frozen=True)
class Layout:
    """
    What a store consists of.

    Attributes
    ----------
    axes : tuple of Axis
        Dimensions and coordinates.
    variables : tuple of Variable
        The arrays that are written tile by tile.
    identity : mapping
        What makes it this result and no other (tool, parameters, windows, tolerances ...): plain
        numbers, strings and lists. It is written as attributes; a store of another is not resumed.
    attributes : mapping
        Further attributes.

    """

    axes: tuple[Axis, ...]
    variables: tuple[Variable, ...]
    identity: Mapping[str, Any]
    attributes: Mapping[str, Any] = dataclasses.field(default_factory=dict)
