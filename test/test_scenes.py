"""The scenes show what the paper states, and a bad file is named."""

from pathlib import Path
import sys

import pytest

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / 'tools'))

import scene_page  # noqa: E402

from gear_rattle_ros.core.flight.simulation import Simulation  # noqa: E402
from gear_rattle_ros.core.model import Parameters, State  # noqa: E402
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov  # noqa: E402
from gear_rattle_ros.core.stream.transients import Regime, TransientDetector  # noqa: E402
from gear_rattle_ros.parameters import SIMULATOR  # noqa: E402
from gear_rattle_ros.scenes import (  # noqa: E402
    find_scene,
    load_scenes,
    NAMES,
    Performance,
    read_scene,
    Step,
)


def follow(name: str, impacts: int, step: int = 0) -> tuple[TransientDetector, RunningLyapunov]:
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
    return detector, running


def test_names_and_values_are_those_of_the_simulator() -> None:
    """A scene may set exactly what changes live, and sets nothing that would be refused."""
    live = {each.name: each for each in SIMULATOR if not each.read_only}
    assert set(NAMES) == live.keys()
    for scene in load_scenes().values():
        assert scene.steps[0].parameters.keys() == live.keys()
        assert scene.steps[0].reset
        for step in scene.steps:
            for name, value in step.parameters.items():
                live[name].check(value)


def test_paper_is_there_by_name() -> None:
    """The five situations, at the paper's amplitudes."""
    alphas = {name: scene.steps[0].parameters['alpha'] for name, scene in load_scenes().items()}
    assert alphas == {'hysteresis': 0.47, 'two-attractors': 0.48, 'chaotic-b': 0.57,
                      'before-crisis': 1.23, 'long-transient': 1.244}


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
    detector, running = follow(name, int(4 * scene.seconds * scene.steps[0].parameters['rate']))
    assert detector.report.regime is Regime.TRANSIENT
    report = running.report
    assert report.lambda_1 > 10.0 * report.lambda_1_error > 0.0


def test_long_transient_is_longer_than_5000_impacts_and_is_seen_to_end() -> None:
    """Chaos lasts more than 5,000 impacts, then the orbit of four impacts takes over."""
    scene = find_scene('long-transient')
    seen = int(3.0 * scene.seconds * scene.steps[0].parameters['rate'])
    report = follow('long-transient', seen)[0].report
    assert report.regime is Regime.ORBIT and report.lifetime is not None
    assert report.lifetime > 5000
    assert (report.period_impacts, report.period_drive) == (4, 1)


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
    with pytest.raises(ValueError, match='hysteresis, two-attractors, chaotic-b'):
        find_scene('chaos')
