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

"""The picture of a bag: what it is drawn from, what stands in it, and bad input."""

from collections.abc import Iterator
from pathlib import Path

from bag_maker import batches as serialized, make_bag
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.image import imread
import numpy as np
import pytest

from gear_rattle_ros.cli.pictures.summary import main
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, EventKind, impact_count, Parameters, State
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.figures import summary
from gear_rattle_ros.figures.digest import Digest, digest_of, gathered, in_words, POINT, Thinned
from gear_rattle_ros.figures.summary import draw
from gear_rattle_ros.palette import BLUE, GREEN, GREY, PURPLE, RED


def story(periods: int = 600, alpha: float = 1.244) -> list[EventArray]:
    """Return the batches of a run with a change of alpha in the middle."""
    simulation = Simulation(Parameters(0.57), State(0, 0.0, -0.5, -0.5))
    batches = []
    for tick in range(60):
        batches.append(simulation.advance((tick + 1) * periods // 60, 0.0, 100_000))
        if tick == 29:
            batches.append(simulation.retune(Parameters(alpha)))
    return batches


def test_thinning_is_fair_and_does_not_depend_on_the_cut() -> None:
    """Of an orbit of any period each impact is shown as often as the others."""
    rows = np.zeros(200_000, POINT)
    rows['impact'] = np.arange(len(rows))
    whole, cut = Thinned(POINT, 6000), Thinned(POINT, 6000)
    whole.add(rows)
    for start in range(0, len(rows), 777):
        cut.add(rows[start:start + 777])
    np.testing.assert_array_equal(whole.rows, cut.rows)
    assert 3000 <= len(whole.rows) <= 6000
    for period in (2, 3, 4, 8, 16):
        shares = np.bincount(whole.rows['impact'] % period) / len(whole.rows)
        assert np.abs(shares * period - 1.0).max() < 0.25
    quarters = np.histogram(whole.rows['impact'], 4)[0] / len(whole.rows)
    assert np.abs(quarters - 0.25).max() < 0.02


def test_digest_holds_the_run() -> None:
    """Impacts, retunes, exponents and states are those of the stream."""
    batches = story()
    events = np.concatenate(batches)
    digest = digest_of(batches)
    impacts = events[events['kind'] <= EventKind.STICK]
    assert digest.impacts == len(impacts) == len(digest.points.rows)
    for name in ('phase', 'velocity', 'alpha'):
        np.testing.assert_array_equal(digest.points.rows[name], impacts[name])
    assert list(digest.changes.rows['alpha']) == [0.57, 1.244]
    assert digest.changes.rows['drive_time'][1] == pytest.approx(300.0)
    running = RunningLyapunov(1000)
    running.update(events)
    assert digest.estimates.rows['lambda_1'][-1] == running.report.lambda_1
    words = [in_words(word) for word in digest.words]
    assert words[0] == 'impact 0, alpha 0.57: a transient begins'
    retuned = impact_count(np.concatenate(batches[:30]))
    assert any(word.startswith(f'impact {retuned:,}, alpha 1.244: a transient begins')
               for word in words)
    assert digest.guard.lost == 0


def test_gathering_changes_nothing_but_the_cut() -> None:
    """Every record comes once and in order, in far fewer batches in the end."""
    events = np.concatenate(story())
    singles = [events[i:i + 1] for i in range(len(events))] * 4
    joined = list(gathered(singles))
    np.testing.assert_array_equal(np.concatenate(joined), np.concatenate(singles))
    assert len(joined) < 0.7 * len(singles)


def test_a_restart_and_a_hole_are_counted() -> None:
    """The axes go on after a restart, and what was lost is in the title."""
    events = np.concatenate(story(120))
    digest = Digest()
    digest.add(events[:100])
    digest.add(events[110:])
    digest.add(events)
    assert digest.guard.lost == 10 and digest.guard.restarts == 1
    assert (np.diff(digest.points.rows['impact']) > 0).all()
    assert (np.diff(digest.points.rows['drive_time']) > 0).all()
    assert ', 10 lost' in summary.title_of(digest, 'bag')


def test_a_panel_that_stays_empty_explains_why() -> None:
    """Chatter sticks in every period: no exponent is finite; a ramp has finite-time ones."""
    chatter = Simulation(Parameters(5.0, 0.0159, 2.533, 0.7), State(velocity=-1.0)).advance(
        10**6, 0.0, 3000)
    simulation = Simulation(Parameters(0.57), State(velocity=-1.0))
    ramp = []
    for k in range(1, 801):
        ramp += [simulation.advance(k, 0.0, 100), simulation.retune(Parameters(0.57 + 5e-6 * k))]
    short = Simulation(Parameters(0.57), State(velocity=-1.0)).advance(10**6, 0.0, 20)
    for batches, words, curves in (([chatter], 'superstable', 0), (ramp, '', 1),
                                   ([short], 'fewer than 30 impacts', 0)):
        figure = draw(digest_of(batches), 'bag')
        (axes,) = (axes for part in figure.subfigs for axes in part.axes
                   if axes.get_title().startswith('Lyapunov'))
        said = ' '.join(text.get_text() for text in axes.texts)
        assert words in said and bool(words) == bool(said)
        drawn = [line for line in axes.lines
                 if len(line.get_ydata()) > 2 and np.isfinite(line.get_ydata()).any()]
        assert len(drawn) == curves
    said = [in_words(word) for word in digest_of([chatter]).words]
    assert 'orbit of 68 impacts' in said[-1]


def panels(batches: list[np.ndarray]) -> dict[str, Axes]:
    """Return the parts of a picture by the beginning of their titles."""
    figure = draw(digest_of(batches), 'bag')
    return {axes.get_title().split()[0]: axes for part in figure.subfigs for axes in part.axes
            if axes.get_title()} | {'all': figure}


def test_a_ramp_has_a_bar_of_colours_and_a_step_a_legend() -> None:
    """The bar spans the values of alpha, in the colours of the points."""
    simulation = Simulation(Parameters(0.57), State(velocity=-1.0))
    ramp, alphas = [simulation.advance(1, 0.0, 100)], [0.57]
    for k in range(2, 41):
        alphas.append(0.57 + 1e-3 * k)
        ramp += [simulation.retune(Parameters(alphas[-1])), simulation.advance(k, 0.0, 100)]
    parts = panels(ramp)
    bar, = (axes for axes in parts['all'].axes if axes.get_xlabel() == 'alpha [1]')
    assert bar.get_xlim() == pytest.approx((min(alphas), max(alphas)))
    colours = parts['Section:'].collections[0].get_facecolors()
    shades = bar.collections[-1].cmap
    assert shades(0.0) == pytest.approx(colours[0]) and shades(1.0) == pytest.approx(colours[-1])
    assert parts['Section:'].get_legend() is None
    parts = panels(story(60))
    assert len(parts['Section:'].get_legend().get_texts()) == 2
    assert not any(axes.get_xlabel() == 'alpha [1]' for axes in parts['all'].axes)


def test_panels_share_the_axis_of_the_impacts() -> None:
    """Velocity, amplitude and exponents stand above each other; the axis is named once."""
    batches = story(60)
    parts = panels(batches)
    three = [parts[name] for name in ('Velocity', 'Amplitude', 'Lyapunov')]
    assert len({axes.get_xlim() for axes in three}) == 1
    assert [axes.get_xlabel() for axes in three] == ['', '', 'impact number']
    total = impact_count(np.concatenate(batches))
    low, high = three[0].get_xlim()
    assert low < 1 and total < high < 1.02 * total
    retune = impact_count(np.concatenate(batches[:30]))
    x, y = three[1].lines[0].get_data()
    assert y[list(x).index(retune)] == 1.244


def test_one_event_alone_is_drawn_and_explained() -> None:
    last = np.concatenate(story(60))[-1:]
    parts = panels([last])
    assert [line.get_marker() for line in parts['Amplitude'].lines] == ['.']
    assert 'none before it' in parts['Displacement'].texts[0].get_text()
    assert 'fewer than 30 impacts' in parts['Lyapunov'].texts[0].get_text()


@pytest.fixture(scope='module')
def picture(tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    """Return the pixels of a picture of the story, each channel from 0 to 255."""
    path = tmp_path_factory.mktemp('picture') / 'summary.png'
    # Chaos that lasts: at 1.244 it ends after a time that depends on the last bit.
    draw(digest_of(story(3000, 1.1)), 'bag').savefig(path)
    return np.rint(imread(path)[:, :, :3] * 255.0).astype(int)


def count(pixels: np.ndarray, colour: tuple[float, ...] | str) -> int:
    """Return how many pixels have a colour, to within a few steps."""
    if isinstance(colour, str):
        wanted = np.array([int(colour[i:i + 2], 16) for i in (1, 3, 5)])
    else:
        wanted = np.rint(np.array(colour[:3]) * 255.0)
    return int((np.abs(pixels - wanted).max(axis=2) <= 6).sum())


def test_picture_has_its_size_and_every_part_is_drawn(picture: np.ndarray) -> None:
    """1600 x 1000 pixels; each part has the colours of what it shows."""
    assert picture.shape == (1000, 1600, 3)
    low, high = colormaps['plasma'](0.0), colormaps['plasma'](summary.MAP_END)
    section, right = picture[50:800, 60:730], picture[:, 820:]
    # How many points the transient has at 1.244 depends on the last bits of a flight.
    assert count(section, low) > 100 and count(section, high) > 100
    velocity, exponents, motion = right[50:240], right[430:770], right[800:960]
    assert count(velocity, low) > 300 and count(velocity, high) > 300
    for colour in (BLUE, GREEN, PURPLE, RED, GREY):
        assert count(exponents, colour) > 50
    assert count(motion, BLUE) > 500 and count(motion, RED) > 1000
    assert count(right[290:390], RED) > 500
    words = picture[830:, 60:730]
    assert (words.min(axis=2) < 100).sum() > 300


def test_command_makes_a_picture_of_a_bag(tmp_path: Path,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    """Beside the bag or at the path given; what cannot be written is refused in one line."""
    bag = tmp_path / 'bag'
    make_bag(bag, serialized(np.concatenate(story(60))))
    assert main([str(bag)]) == 0
    assert capsys.readouterr().out == f'{tmp_path / "bag-summary.png"}\n'
    made = tmp_path / 'bag-summary.png'
    assert imread(made).shape[:2] == (1000, 1600)
    before = made.read_bytes()
    # A bag beside it has a picture of its own, even one of the same stem.
    other = tmp_path / 'bag.mcap'
    other.write_bytes(next(bag.glob('*.mcap')).read_bytes())
    assert main([str(other)]) == 0
    assert capsys.readouterr().out == f'{tmp_path / "bag.mcap-summary.png"}\n'
    assert made.read_bytes() == before
    assert main([str(bag), '--output', str(tmp_path / 'no' / 'a.png')]) == 2
    assert capsys.readouterr().err == (
        f'summary: --picture {tmp_path}/no/a.png cannot be written\n')
    assert main([str(bag), '--picture', str(tmp_path / 'a.xyz')]) == 2
    assert capsys.readouterr().err == (
        f'summary: --picture {tmp_path}/a.xyz does not end in one of .png .pdf .svg .jpg\n')
    small = tmp_path / 'small.png'
    assert main([str(bag), '--picture', str(small), '--dpi', '50', '--colours', 'paper']) == 0
    picture = imread(small)[..., :3]
    assert picture.shape[:2] == (500, 800)
    assert np.ptp(picture, axis=2).max() == 0.0


@pytest.mark.parametrize(('arguments', 'words'), [
    (['/nowhere/bag'], 'summary: /nowhere/bag: does not exist\n'),
    ([], 'summary: the following arguments are required: BAG\n'),
    (['a', '--colour-map'], 'summary: unrecognized arguments: --colour-map\n'),
])
def test_bad_input_is_one_line(arguments: list[str], words: str,
                               capsys: pytest.CaptureFixture[str]) -> None:
    """Exit status 2 and one line that names what is wrong."""
    try:
        status = main(arguments)
    except SystemExit as exit_:
        status = exit_.code
    assert status == 2
    assert capsys.readouterr() == ('', words)


def test_a_run_without_impacts_is_refused() -> None:
    """There is nothing to draw."""
    def nothing() -> Iterator[EventArray]:
        yield np.concatenate(story(60))[:1]
    with pytest.raises(ValueError, match='no impacts'):
        digest_of(nothing())
