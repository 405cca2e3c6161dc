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
Write doc/scenes.md and its pictures, from the files of config/scenes alone.

Every scene is played without ROS: the same steps, with drive periods for seconds. What the page
reports of a scene was found in the very events that its picture shows.
"""

from collections.abc import Iterator, Mapping
import dataclasses
import math
from pathlib import Path
import sys
import textwrap
from typing import Any

import numpy as np
from scene_pictures import draw, save, Stretch

from gear_rattle_ros.core.flight.law import Law
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, impact_count, Parameters, State
from gear_rattle_ros.core.stream.hold import RunningHold
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.core.stream.transients import TransientDetector
from gear_rattle_ros.scenes import INITIAL, load_scenes, Scene, Step

COMMAND = 'python tools/scene_page.py'
MODEL = tuple(field.name for field in dataclasses.fields(Parameters))
# Events asked for at once.
BATCH = 1024
# Impacts between estimates of the exponents, as many as in their window.
WINDOW = 1000
HEAD = f"""# Scenes

A scene is a situation of the paper with a name. `gear_rattle suite --scene NAME` plays it,
`gear_rattle suite --scene list` names all of them, and the keyboard (`gear_rattle teleop`) has a
key for each. A scene is a file in `config/scenes`. This page, its numbers and its pictures are
written by

    {COMMAND}

Unless the first step sets something else, beta = gamma = 0.1, r = 0.9, there is no noise, the
initial condition is phase 0 on the upper wall with s' = -1, and the rate is 1000 drive periods per
second.
"""


def play(scene: Scene) -> list[Stretch]:
    """Play a scene without ROS."""
    known: dict[str, Any] = dict(scene.steps[0].parameters)
    simulation = Simulation(_model(known), _initial(known), noise=float(known['noise']),
                            seed=int(known['seed']))
    detector, running = TransientDetector(), RunningLyapunov(WINDOW)
    stretches, total = [], 0
    for number, step in enumerate(scene.steps):
        known.update(step.parameters)
        parts = [*_enter(simulation, step, known if number else {}),
                 *_last(simulation, step, known)]
        events = np.concatenate(parts)
        changes = detector.update(events)
        impacts, exponents = [], []
        for piece in np.array_split(events, max(len(events) // WINDOW, 1)):
            running.update(piece)
            total += impact_count(piece)
            impacts.append(total)
            exponents.append(running.report.lambda_1_finite)
        report = running.report
        visits = tuple((change.start + (change.lifetime or 0), change.letter)
                       for change in changes if known['noise'] and change.letter)
        words, law = detector.report.describe(), Law.of_text(known['control'])
        if law is not None:
            hold = RunningHold(law, known['alpha'])
            hold.update(events)
            words = (f'an orbit of {len(law.points)} impacts, caught after '
                     f'{hold.report.catch_impacts:,.0f} and held; exponent without the law '
                     f'{report.lambda_1_finite:+.3f}')
        stretches.append(Stretch(step, events, words, tuple(impacts), tuple(exponents),
                                 report.lambda_1, report.lambda_1_error, visits))
    return stretches


def _enter(simulation: Simulation, step: Step, known: Mapping[str, Any]
           ) -> Iterator[EventArray]:
    """Set the parameters of a step, and reset where it does."""
    if any(name in step.parameters for name in MODEL) and known:
        yield simulation.retune(_model(known))
    if 'control' in step.parameters:
        yield simulation.control(Law.of_text(str(step.parameters['control'])))
    if known and step.reset:
        state = _initial(known)
        yield simulation.reset(state.phase, state.displacement, state.velocity)


def _last(simulation: Simulation, step: Step, known: dict[str, Any]) -> Iterator[EventArray]:
    """Go on for as long as a step lasts; alpha moves at the end of every drive period."""
    left = round(step.seconds * known['rate'])
    target, rate = step.ramps_to, float(known['alpha_rate'])
    while left > 0 or known['alpha'] != target is not None:
        periods = left if known['alpha'] == target or target is None else 1
        end = (simulation.moment[0] + periods, 0.0)
        while simulation.moment < end:
            yield simulation.advance(*end, BATCH)
        left -= periods
        if target is not None and known['alpha'] != target:
            away = target - known['alpha']
            known['alpha'] += math.copysign(min(rate, abs(away)), away)
            yield simulation.retune(_model(known))


def _model(known: Mapping[str, Any]) -> Parameters:
    return Parameters(**{name: float(known[name]) for name in MODEL})


def _initial(known: Mapping[str, Any]) -> State:
    return State(0, *(float(known[f'initial_{name}'])
                      for name in ('phase', 'displacement', 'velocity')))


def found(stretches: list[Stretch]) -> list[str]:
    """Describe what was found, a line for each step."""
    lines = []
    for number, stretch in enumerate(stretches, 1):
        events, words = stretch.events, stretch.words
        alpha = ' to '.join(f'{value:g}' for value in dict.fromkeys(
            round(float(events['alpha'][place]), 6) for place in (0, -1)))
        line = f'{number}. alpha {alpha}, {impact_count(events):,} impacts: {words}'
        # A ramp begins its averages anew in every drive period; a transient has its own exponent.
        if 'exponent' not in words and math.isfinite(stretch.error):
            line += f'; largest exponent {stretch.exponent:+.3f}'
        lines.append(line)
    return lines


def page(played: Mapping[str, tuple[Scene, list[Stretch]]]) -> str:
    """Return the page."""
    parts = [HEAD]
    for number, (name, (scene, stretches)) in enumerate(played.items(), 1):
        steps = '\n'.join(f'| {n} | {_settings(step, n == 1)} | {step.seconds:g} |'
                          for n, step in enumerate(scene.steps, 1))
        parts.append(
            f'\n## {scene.title}\n\n{textwrap.fill(scene.text, 99)}\n\n'
            f'![{scene.title}](scenes/{name}.png)\n\n    gear_rattle suite --scene {name}\n\n'
            f'or key {number} of the keyboard; {scene.seconds:g} s.\n\n'
            f'| step | sets | seconds at least |\n|---|---|---|\n{steps}\n'
            '\nFound in each step:\n\n' + '\n'.join(found(stretches)) + '\n')
    return ''.join(parts)


def _settings(step: Step, first: bool) -> str:
    known = {**INITIAL, 'alpha_target': step.parameters.get('alpha')} if first else {}
    words = [f'`{name}` {value:g}' if not isinstance(value, str) else
             f'`{name}`' if value else f'no `{name}`'
             for name, value in step.parameters.items() if known.get(name) != value]
    return ', '.join([*words, *(['then resets'] if step.reset else [])]) or 'nothing'


def main() -> int:
    """Write the page and its pictures."""
    doc = Path(sys.argv[1] if len(sys.argv) > 1 else 'doc')
    (doc / 'scenes').mkdir(parents=True, exist_ok=True)
    played = {name: (scene, play(scene)) for name, scene in load_scenes().items()}
    for name, (scene, stretches) in played.items():
        save(draw(scene, stretches), doc / 'scenes' / f'{name}.png')
    (doc / 'scenes.md').write_text(page(played), encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
