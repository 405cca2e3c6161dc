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

"""The state of a page as the query of its address, which can be sent to somebody."""

from collections.abc import Mapping, Sequence
import dataclasses
from typing import Any, Final
from urllib.parse import urlencode

from .computing.skeleton import LAYERS as NAMES
from .view import VELOCITY_BOUND, View
from ..attractors.plane import STATE, STROBE
from ..core.model import Parameters

MODEL: Final = tuple(field.name for field in dataclasses.fields(Parameters))
POINT: Final = 'point'
BESIDE: Final = 'beside'
WHICH: Final = 'which'
LAYERS: Final = 'layers'


@dataclasses.dataclass(frozen=True)
class Shown:
    """What a page shows."""

    view: View
    point: tuple[float, float]  # in the plane, of the trajectory that is shown [rad or 1, 1]
    beside: float | None = None  # parameter of a second plane, if there is one [1]
    layers: tuple[str, ...] = ()
    which: str = 'alpha'  # that parameter

    def __post_init__(self) -> None:
        if self.which not in MODEL:
            raise ValueError(f'which={self.which} is not one of {", ".join(MODEL)}')
        # A value that cannot be is refused.
        _ = self.second
        for name in self.layers:
            if name not in NAMES:
                raise ValueError(f'layer {name!r} is not one of {", ".join(NAMES)}')

    @property
    def second(self) -> View | None:
        """Return what the second plane shows."""
        return None if self.beside is None else changed(self.view, self.which, self.beside)

    def query(self) -> str:
        """Write it as the query of an address."""
        view = self.view
        words = {name: repr(getattr(view.parameters, name)) for name in MODEL}
        words |= {'kind': view.kind, 'plane': view.on}
        words |= {name: _pair(value) if isinstance(value, tuple) else repr(value)
                  for name in STATE if (value := getattr(view, name)) is not None}
        words[POINT] = _pair(self.point)
        if self.beside is not None:
            words |= {BESIDE: repr(self.beside), WHICH: self.which}
        if self.layers:
            words[LAYERS] = ','.join(self.layers)
        return urlencode(words, safe=',')

    def given(self, query: Mapping[str, Sequence[bytes]]) -> 'Shown':
        """Return the state with what a query gives; `ValueError` names what it does not take."""
        words = {name: values[-1].decode(errors='replace') for name, values in query.items()}
        model = {name: _number(name, words[name]) for name in MODEL if name in words}
        changes: dict[str, Any] = {'kind': words['kind']} if 'kind' in words else {}
        on = words.get('plane', self.view.on)
        if on != self.view.on:
            changes |= {'on': on, 'displacement': None, 'phase': None}
        single = 'phase' if on == STROBE else 'displacement'
        changes |= {name: (_number if name == single else _numbers)(name, words[name])
                    for name in STATE if name in words}
        parameters = dataclasses.replace(self.view.parameters, **model)
        view = dataclasses.replace(self.view, parameters=parameters, **changes)
        return Shown(view, _numbers(POINT, words[POINT]) if POINT in words else self.point,
                     _number(BESIDE, words[BESIDE]) if BESIDE in words else self.beside,
                     tuple(words[LAYERS].split(',')) if LAYERS in words else self.layers,
                     words.get(WHICH, self.which))


def changed(view: View, name: str, value: float) -> View:
    """Return a view with another parameter of the model, or of another plane of its kind."""
    if name in MODEL:
        return dataclasses.replace(
            view, parameters=dataclasses.replace(view.parameters, **{name: value}))
    fixed: dict[str, Any] = {name: value}
    return dataclasses.replace(view, **fixed)


def _pair(values: tuple[float, float]) -> str:
    return ','.join(map(repr, values))


def _number(name: str, word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise ValueError(f'{name}={word} in the address is not a number') from None


def _numbers(name: str, word: str) -> tuple[float, float]:
    first, comma, second = word.partition(',')
    if not comma:
        raise ValueError(f'{name}={word} in the address is not two numbers with a comma between')
    values = _number(name, first), _number(name, second)
    if not all(abs(value) <= VELOCITY_BOUND for value in values):
        raise ValueError(f'{name}={word} in the address is beyond {VELOCITY_BOUND:g}')
    return values
