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

"""The scenes show what the paper states, and a bad file is named."""

import dataclasses
from pathlib import Path
import re
import sys

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / 'tools'))

import scene_page  # noqa: E402

from gear_rattle_ros.attractors.cores import find_jumps  # noqa: E402
from gear_rattle_ros.attractors.finding import find_attractors  # noqa: E402
from gear_rattle_ros.attractors.plane import initial_condition  # noqa: E402
from gear_rattle_ros.core.flight.law import Law  # noqa: E402
from gear_rattle_ros.core.flight.simulation import Simulation  # noqa: E402
from gear_rattle_ros.core.many.recorded import record_impacts  # noqa: E402
from gear_rattle_ros.core.model import EventArray, EventKind, Parameters, State  # noqa: E402
from gear_rattle_ros.core.orbits.control import law_of  # noqa: E402
from gear_rattle_ros.core.orbits.orbit import close_orbit  # noqa: E402
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov  # noqa: E402
from gear_rattle_ros.core.stream.transients import Regime, TransientDetector  # noqa: E402
from gear_rattle_ros.parameters import SIMULATOR, SPEEDS  # noqa: E402
from gear_rattle_ros.scenes import (  # noqa: E402
    find_scene,
    load_scenes,
    NAMES,
    Performance,
    read_scene,
    Step,
)


def follow(name: str, impacts: int, step: int = 0
           ) -> tuple[TransientDetector, RunningLyapunov, EventArray]:
    """Follow a scene's trajectory from one of its initial conditions, with the core alone."""
    known: dict[str, float] = {}
    for each in find_scene(name).steps[:step + 1]:
        known |= each.parameters
    simulation = Simulation(
        Parameters(*(known[key] for key in ('alpha', 'beta', 'gamma', 'restitution'))),
        State(0, *(known[f'initial_{key}'] for key in ('phase', 'displacement', 'velocity'))))
    detector, running = TransientDetector(), RunningLyapunov()
    events = simulation.advance(10**9, 0.0, impacts)
    detector.update(events)
    running.update(events)
    return detector, running, events


def test_names_and_values_are_those_of_the_simulator() -> None:
    """A scene may set exactly what changes live, and sets nothing that would be refused."""
    # But for the speed of a gear pair: scenes are dimensionless.
    live = {each.name: each for each in SIMULATOR
            if not each.read_only and each.name not in SPEEDS}
    assert set(NAMES) == live.keys()
    for scene in load_scenes().values():
        assert scene.steps[0].parameters.keys() == live.keys()
        assert scene.steps[0].reset
        for step in scene.steps:
            for name, value in step.parameters.items():
                live[name].check(value)


def test_paper_is_there_by_name() -> None:
    """Its six situations, at the paper's amplitudes, and what one can make of the chaos."""
    alphas = {name: scene.steps[0].parameters['alpha'] for name, scene in load_scenes().items()}
    assert alphas == {'hysteresis': 0.47, 'two-attractors': 0.48, 'hops': 0.48, 'chaotic-b': 0.57,
                      'tamed': 0.57, 'before-crisis': 1.23, 'long-transient': 1.244}


@pytest.mark.parametrize(('step', 'period'), [(0, 3), (1, 2)])
def test_two_attractors_are_a_and_b(step: int, period: int) -> None:
    """A has three impacts in an orbit, B two, as the paper states."""
    report = follow('two-attractors', 2000, step)[0].report
    assert (report.regime, report.period_impacts, report.period_drive) == (
        Regime.ORBIT, period, 1)


@pytest.mark.parametrize('name', ['chaotic-b', 'before-crisis'])
def test_chaotic_scenes_are_chaotic_for_as_long_as_they_last(name: str) -> None:
    """No orbit is found, and the exponent is far above zero."""
    scene = find_scene(name)
    # Fewer than four impacts are made in a drive period here.
    detector, running, _ = follow(name, int(4 * scene.seconds * scene.steps[0].parameters['rate']))
    assert detector.report.regime is Regime.TRANSIENT
    report = running.report
    assert report.lambda_1 > 10.0 * report.lambda_1_error > 0.0


def test_the_tamed_scene_holds_two_and_four_impacts_and_lets_go() -> None:
    """Its laws are those of orbits that close, and each has done its work when its step ends."""
    steps = find_scene('tamed').steps
    parameters = Parameters(alpha=steps[0].parameters['alpha'])
    simulation = Simulation(parameters, State(velocity=-1.0),
                            noise=steps[0].parameters['noise'])
    ends = []
    for step in steps:
        law = Law.of_text(step.parameters['control'])
        simulation.control(law)
        periods = round(step.seconds * steps[0].parameters['rate'])
        events = simulation.advance(simulation.moment[0] + periods, 0.0, 10**5)
        ends.append(np.sort(events['velocity'][events['kind'] == EventKind.IMPACT][-400:]))
        if law is not None:
            orbit = close_orbit(np.signbit(law.points[:, 1]).astype(int), law.points, parameters)
            assert orbit is not None
            np.testing.assert_allclose(orbit.points, law.points, rtol=0.0, atol=1e-12)
            np.testing.assert_allclose(
                law_of(orbit, law.acts, law.limit).gains, law.gains, rtol=1e-9)
    # Gaps between the velocities separate two, four, and many.
    assert [int(np.sum(np.diff(end) > 1e-6)) + 1 for end in ends[1:3]] == [2, 4]
    assert all(np.sum(np.diff(end) > 1e-6) > 200 for end in (ends[0], ends[3]))


def test_chaos_before_the_crisis_is_a_long_transient_itself() -> None:
    """The scene names its end, after which every twentieth impact is as hard."""
    detector, _, events = follow('before-crisis', 200_000)
    report = detector.report
    assert (report.period_impacts, report.period_drive) == (20, 6)
    assert f'{report.lifetime:,}' in find_scene('before-crisis').text
    velocities = events['velocity'][events['kind'] <= EventKind.STICK]
    changing = np.flatnonzero(np.abs(velocities[20:] - velocities[:-20]) > 0.01)
    assert 0 <= report.lifetime - changing[-1] < 200


def test_long_transient_is_that_of_figures_9b_and_10() -> None:
    """The impacts are those that the figures draw, to the bit, and their transient is as long."""
    scene = find_scene('long-transient')
    recipe = (ROOT / 'config' / 'figures' / 'figure-9b.yaml').read_text(encoding='utf-8')
    drawn = [float(word) for word in re.findall(r'--initial (\S+) (\S+) (\S+)', recipe)[0]]
    first = scene.steps[0].parameters
    assert drawn == [first[f'initial_{key}'] for key in ('phase', 'velocity', 'displacement')]
    parameters = Parameters(alpha=first['alpha'])
    (row,), _ = record_impacts(initial_condition(parameters, *drawn), 0, 6000)
    detector, _, events = follow('long-transient', 7000)
    impacts = events[events['kind'] <= EventKind.STICK]
    for name in row.dtype.names:
        np.testing.assert_array_equal(row[name], impacts[name][:6000])
    report = detector.report
    assert (report.regime, report.period_impacts, report.period_drive) == (Regime.ORBIT, 4, 1)
    assert f'{report.lifetime:,} impacts' in scene.text
    assert re.search(rf'transient of\s+{report.lifetime:,}\s+impacts', recipe)
    # It is seen to end: more than three impacts are made in a drive period.
    assert 5000 < report.lifetime < 3.0 * scene.seconds * first['rate']


def test_noise_makes_the_driven_gear_jump_between_a_and_b() -> None:
    """Tens of jumps each way; with kicks of 0.003 there are none."""
    known = find_scene('hops').steps[0].parameters
    attractors = find_attractors(Parameters(alpha=known['alpha']))
    for noise, least, most in ((known['noise'], 20, 80), (0.003, 0, 0)):
        events = Simulation(attractors.parameters, State(0, 0.0, 0.0, -1.0), noise=noise,
                            seed=int(known['seed'])).advance(30_000, 0.0, 200_000)
        counts = find_jumps(attractors, events['phase'], events['velocity']).counts
        assert all(least <= counts.get(jump, 0) <= most for jump in ((0, 1), (1, 0)))


@pytest.mark.long
def test_page_has_what_is_found_now() -> None:
    """The page is what tools/scene_page.py writes: hysteresis from B to A, too."""
    played = {name: (scene, scene_page.play(scene)) for name, scene in load_scenes().items()}
    text = (ROOT / 'doc' / 'scenes.md').read_text(encoding='utf-8')
    assert scene_page.page(played) == text
    words = [stretch.words for stretch in played['hysteresis'][1]]
    assert 'orbit of 2 impacts' in words[0] and 'orbit of 3 impacts' in words[-1]
    for name in played:
        assert (ROOT / 'doc' / 'scenes' / f'{name}.png').stat().st_size <= 150_000


@pytest.mark.long
def test_ramp_delays_what_hysteresis_shows() -> None:
    """The places in the text are those of its ramp and of a slower one, both beyond the exact."""
    scene = find_scene('hysteresis')
    exact, seen = (0.52915, 0.57229), []
    for slower in (1, 4):
        ramp = dict(scene.steps[1].parameters)
        ramp['alpha_rate'] /= slower
        step = dataclasses.replace(scene.steps[1], parameters=ramp)
        slow = dataclasses.replace(scene, steps=(scene.steps[0], step))
        events = scene_page.play(slow)[1].events
        impacts = events[events['kind'] <= EventKind.STICK]
        upper = impacts[impacts['velocity'] > 0.0]
        doubles = upper['alpha'][1:][np.abs(np.diff(upper['velocity'])) > 0.01]
        # A has three impacts in a drive period; the last period is cut.
        cycles, first, counts = np.unique(impacts['cycle'], return_index=True, return_counts=True)
        not_on_a = np.flatnonzero(counts[:-1] != 3)[-1]
        seen.append((doubles[doubles > 0.5][0], impacts['alpha'][first[not_on_a]]))
        for place in seen[-1]:
            assert f'{place:.4f}' in scene.text
    assert np.all(np.diff([exact, *seen[::-1]], axis=0) > 0.0)
    for place in exact:
        assert str(place) in scene.text


def test_steps_wait_for_time_and_ramp() -> None:
    """A step lasts its seconds, and until alpha is where its ramp leads."""
    steps = [Step({'alpha': 0.4}, 2.0, True),
             Step({'alpha_target': 0.5, 'alpha_rate': 1e-3}, 1.0), Step({'alpha': 0.6}, 1.0)]
    performance = Performance(steps)
    assert performance.due(10.0, 0.1) is steps[0]
    assert performance.due(11.9, 0.4) is None
    assert performance.due(12.0, 0.4) is steps[1]
    assert performance.due(99.0, 0.499) is None
    assert not performance.is_over(99.0, 0.5)
    assert performance.due(99.0, 0.5) is steps[2]
    assert performance.due(200.0, 0.6) is None
    assert not performance.is_over(99.5, 0.6) and performance.is_over(100.0, 0.6)


@pytest.mark.parametrize(('text', 'words'), [
    ('title: x\n', 'must have title, text and steps'),
    ('title: [', 'is not YAML'),
    ('title: x\ntext: y\nsteps: []\n', 'steps = [] is not a list of steps'),
    ('title: x\ntext: y\nsteps: [{seconds: 3}]\n', 'step 1: the first step must set alpha'),
    ('title: x\ntext: y\nsteps: [{parameters: {alhpa: 1}}]\n', "unknown parameter 'alhpa'"),
    ('title: x\ntext: y\nsteps: [{parameters: {alpha: -1}}]\n', 'alpha = -1.0'),
    ('title: x\ntext: y\nsteps: [{parameters: {alpha: 1, rate: -2}}]\n', 'rate = -2.0'),
    ('title: x\ntext: y\nsteps: [{parameters: {alpha: .nan}}]\n', 'alpha = nan is not a number'),
    ('title: x\ntext: y\nsteps: [{parameters: {alpha: 1}}, {parameters: {alpha_rate: 0.1}}]\n',
     'step 2: a ramp needs alpha_target'),
    ('title: x\ntext: y\nsteps: [{parameters: {alpha: 1}, seconds: -1}]\n', 'seconds = -1'),
])
def test_bad_scene_is_named_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    """File, step, value and remedy."""
    path = tmp_path / 'mine.yaml'
    path.write_text(text)
    with pytest.raises(ValueError) as error:
        read_scene(path)
    assert words in str(error.value) and str(path) in str(error.value)
    assert '\n' not in str(error.value)


def test_unknown_scene_is_answered_with_all() -> None:
    """The names are in the answer."""
    with pytest.raises(ValueError, match='hysteresis, two-attractors, hops, chaotic-b'):
        find_scene('chaos')
