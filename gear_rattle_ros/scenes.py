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

"""
Scenes: situations of the paper by name, read from files.

A scene is a YAML file with a title, a text and steps. A step sets parameters of the simulator,
may reset the state, and lasts its seconds, or longer: until a ramp of alpha that it began ends.
The first step always resets; parameters that it leaves out are as in `INITIAL`.
"""

from collections.abc import Mapping, Sequence
import dataclasses
import math
from pathlib import Path
import types
from typing import Any, Final, TypeAlias

from .core.flight.law import Law
from .core.flight.noise import Noise
from .core.flight.simulation import NOISE_MAXIMUM, SEED_MAXIMUM
from .core.model import Parameters, State
from .places import config_folder
from .plain_yaml import read_yaml

Number: TypeAlias = int | float
# The parameters of the simulator that change live, except alpha, which a scene has to set.
INITIAL: Final[Mapping[str, Any]] = types.MappingProxyType({
    'beta': 0.1, 'gamma': 0.1, 'restitution': 0.9, 'noise': 0.0, 'seed': 0, 'rate': 1000.0,
    'initial_phase': 0.0, 'initial_displacement': 0.0, 'initial_velocity': -1.0,
    'alpha_rate': 0.0, 'noise_kind': 'gaussian', 'control': ''})
NAMES: Final = ('alpha', 'alpha_target', *INITIAL)
LIMITS: Final[Mapping[str, tuple[float, float]]] = types.MappingProxyType({
    'noise': (0.0, NOISE_MAXIMUM), 'rate': (0.0, 1e7), 'alpha_rate': (0.0, 1.0),
    'seed': (0, SEED_MAXIMUM)})


@dataclasses.dataclass(frozen=True)
class Step:
    """Parameters to set, in the simulator's units; duration [s]; whether to reset the state."""

    parameters: Mapping[str, Any]
    seconds: float
    reset: bool = False

    @property
    def ramps_to(self) -> float | None:
        """Return the alpha at which the ramp of this step ends [1]; None without a ramp."""
        ramps = self.parameters.get('alpha_rate', 0.0) > 0.0
        return float(self.parameters['alpha_target']) if ramps else None


@dataclasses.dataclass(frozen=True)
class Scene:
    """A situation by name; its first step holds every parameter."""

    name: str
    title: str
    text: str
    steps: tuple[Step, ...]

    @property
    def seconds(self) -> float:
        """Return its duration, ramps included, at its own rates [s]; inf at full speed."""
        total, alpha, rate = 0.0, 0.0, 0.0
        for step in self.steps:
            alpha = float(step.parameters.get('alpha', alpha))
            rate = float(step.parameters.get('rate', rate))
            ramp = 0.0
            if step.ramps_to is not None:
                periods = abs(step.ramps_to - alpha) / float(step.parameters['alpha_rate'])
                ramp = periods / rate if rate > 0.0 else math.inf
                alpha = step.ramps_to
            total += max(step.seconds, ramp)
        return total


class Performance:
    """Finds the step that is due, from the time and the alpha in force."""

    def __init__(self, steps: Sequence[Step]) -> None:
        self._steps = steps
        self._next = 0
        self._began = -math.inf

    def is_over(self, now: float, alpha: float) -> bool:
        """Whether the last step has ended at a time [s], given alpha [1]."""
        return self._next == len(self._steps) and self._has_ended(now, alpha)

    def due(self, now: float, alpha: float) -> Step | None:
        """Return the step that begins at a time [s], given alpha [1]; None while one lasts."""
        if self._next == len(self._steps) or not self._has_ended(now, alpha):
            return None
        self._began = now
        self._next += 1
        return self._steps[self._next - 1]

    def _has_ended(self, now: float, alpha: float) -> bool:
        """Whether the latest step has ended; True before the first."""
        if self._next == 0:
            return True
        step = self._steps[self._next - 1]
        # The requested value and the one in force may differ in the last digit.
        arrived = step.ramps_to is None or math.isclose(alpha, step.ramps_to, rel_tol=1e-12)
        return arrived and now >= self._began + step.seconds


def load_scenes(folder: Path | None = None) -> dict[str, Scene]:
    """Return all scenes by name, in the order of alpha and noise; ValueError names a bad one."""
    folder = config_folder('scenes') if folder is None else folder
    scenes = [read_scene(path) for path in sorted(folder.glob('*.yaml'))]
    if not scenes:
        raise ValueError(f'{folder} holds no scenes; install the package with its config/')
    scenes.sort(key=lambda scene: [scene.steps[0].parameters[name] for name in ('alpha', 'noise')])
    return {scene.name: scene for scene in scenes}


def find_scene(name: str) -> Scene:
    """Return a scene by its name; ValueError names them all."""
    scenes = load_scenes()
    if name not in scenes:
        raise ValueError(f'no scene {name!r}; there are {", ".join(scenes)}')
    return scenes[name]


def read_scene(path: Path) -> Scene:
    """Read one scene; ValueError names what is wrong with it."""
    try:
        content = read_yaml(path.read_text(encoding='utf-8'))
    except ValueError as error:
        raise ValueError(f'{path} {error}') from error
    if not isinstance(content, dict) or content.keys() != {'title', 'text', 'steps'}:
        raise ValueError(f'{path} must have title, text and steps, and nothing else')
    given = content['steps']
    if not isinstance(given, list) or not given:
        raise ValueError(f'{path}: steps = {given!r} is not a list of steps')
    steps: list[Step] = []
    known: dict[str, Any] = {}
    for number, item in enumerate(given, 1):
        try:
            step = _step(item, first=number == 1)
            known.update(step.parameters)
            _check(known)
        except ValueError as error:
            raise ValueError(f'{path}: step {number}: {error}') from error
        steps.append(step)
    words = {name: ' '.join(str(content[name]).split()) for name in ('title', 'text')}
    return Scene(path.stem, steps=tuple(steps), **words)


def _step(item: Any, first: bool) -> Step:
    if not isinstance(item, dict) or not item.keys() <= {'parameters', 'reset', 'seconds'}:
        raise ValueError(f'{item!r} may have parameters, reset and seconds, and nothing else')
    parameters, seconds = item.get('parameters', {}), item.get('seconds', 0.0)
    reset = item.get('reset', first)
    if not isinstance(parameters, dict) or not isinstance(reset, bool) or not _is_number(seconds):
        raise ValueError(f'{item!r}: parameters maps names to values, reset is true or false, '
                         'seconds a number')
    if not 0.0 <= seconds < math.inf:
        raise ValueError(f'seconds = {seconds!r} must not be negative')
    for name, value in parameters.items():
        if name not in NAMES:
            raise ValueError(f'unknown parameter {name!r}; known are {", ".join(NAMES)}')
        if isinstance(INITIAL.get(name), str):
            if not isinstance(value, str):
                raise ValueError(f'{name} = {value!r} is not a text')
        elif not _is_number(value) or not math.isfinite(value):
            raise ValueError(f'{name} = {value!r} is not a number')
    if first:
        if 'alpha' not in parameters:
            raise ValueError('the first step must set alpha')
        parameters = {**INITIAL, 'alpha_target': parameters['alpha'], **parameters}
    if parameters.get('alpha_rate', 0.0) > 0.0 and 'alpha_target' not in parameters:
        raise ValueError('a ramp needs alpha_target beside alpha_rate')
    # Not everywhere is an integer accepted for a double.
    return Step(types.MappingProxyType({
        name: value if name == 'seed' or isinstance(value, str) else float(value)
        for name, value in parameters.items()}), float(seconds), reset or first)


def _check(known: Mapping[str, Any]) -> None:
    """Raise ValueError where the model refuses the parameters in force."""
    Parameters.of(known)
    Parameters(alpha=float(known['alpha_target']))
    State(0, *(float(known[f'initial_{name}']) for name in ('phase', 'displacement', 'velocity')))
    for name, (low, high) in LIMITS.items():
        if not low <= known[name] <= high:
            raise ValueError(f'{name} = {known[name]!r} is outside [{low:g}, {high:g}]')
    Law.of_text(str(known['control']))
    kinds = [kind.name.lower() for kind in Noise]
    if known['noise_kind'] not in kinds:
        raise ValueError(f'noise_kind = {known["noise_kind"]!r} is not one of {", ".join(kinds)}')
    if not isinstance(known['seed'], int):
        raise ValueError(f'seed = {known["seed"]!r} is not a whole number')


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
