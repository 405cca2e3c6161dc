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

"""The page in a real browser: load, zoom, slide, click, save; two tabs; the end of float64."""

from collections.abc import Callable, Iterator
import dataclasses
import math
import os
from pathlib import Path
import shlex
import socket
import subprocess
import sys
import time

from browser import chromium, Tab
import numpy as np
from PIL import Image
import pytest

from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.many.settling import UNSETTLED
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.explorer.computing.trajectory import follow
from gear_rattle_ros.explorer.view import CAP
from gear_rattle_ros.palette import HUES
from gear_rattle_ros.store.store import open_dataset

pytestmark = pytest.mark.long


@pytest.fixture(scope='module')
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[int, Path, int]]:
    """Serve the page; returns port, folder and process."""
    folder = tmp_path_factory.mktemp('explorer')
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        port = int(probe.getsockname()[1])
    process = subprocess.Popen(
        [sys.executable, '-m', 'gear_rattle_ros.start', 'explorer', '--no-browser', '--port',
         str(port), '--folder', str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        assert str(port) in process.stdout.readline()
        yield port, folder, process.pid
    finally:
        process.terminate()
        assert process.wait(20.0) == 0


@pytest.fixture(scope='module')
def browser() -> Iterator[object]:
    """Return the browser."""
    with chromium() as found:
        yield found


@pytest.fixture
def tab(browser: object, server: tuple[int, Path, int]) -> Iterator[Tab]:
    """Return a fresh tab, which must not have seen a script fail or another host."""
    opened = Tab(browser, server[0])
    yield opened
    opened.page.close()
    assert opened.errors == []
    home = f'http://127.0.0.1:{server[0]}/'
    local = (home, 'data:', 'blob:')
    assert [each for each in opened.requests if not each.startswith(local)] == []


def frame_of(tab: Tab, path: Path) -> np.ndarray:
    """Return the pixels of the plane, without its axes."""
    box = tab.page.evaluate("""(() => {
        const view = Bokeh.index.find_one_by_id(
            Bokeh.documents[0].get_model_by_name('plane').id);
        const frame = view.frame.bbox, place = view.el.getBoundingClientRect();
        return [place.x + frame.x0, place.y + frame.y0, frame.width, frame.height];
    })()""")
    left, top, width, height = (round(value) for value in box)
    return np.asarray(Image.open(tab.screenshot(path)).convert('RGB'), float)[
        top + 3:top + height - 3, left + 3:left + width - 3]


def test_page_loads_and_draws_both_basins(tab: Tab, tmp_path: Path) -> None:
    """Orbits of 2 and 3 impacts, with the shares of a separate search, in their colours."""
    tab.wait_for_cells(400)
    pixels = frame_of(tab, tmp_path / 'page.png')
    hues = np.array([list(bytes.fromhex(colour[1:])) for colour in HUES[:2]], float)
    # Shading makes them darker but keeps their proportions.
    direction = pixels / np.maximum(np.linalg.norm(pixels, axis=2, keepdims=True), 1.0)
    near = direction @ (hues / np.linalg.norm(hues, axis=1, keepdims=True)).T > 0.97
    parameters, plane = Parameters(), Plane(phases=150, velocities=150)
    catalogue = find_attractors(parameters, plane.draw(parameters, 300, 4),
                                chaotic=False)
    labels = catalogue.label(plane.cells(parameters, slice(0, 150), slice(0, 150)), CAP)['label']
    # The orbit of two impacts is B, which has the second colour.
    for label, hue in ((0, 1), (1, 0)):
        assert np.mean(near[..., hue]) == pytest.approx(np.mean(labels == label), abs=0.03)
    legend = tab.get('legend', 'text')
    assert legend.index(HUES[1]) < legend.index('B orbit-2-1') < legend.index(HUES[0])


def test_wheel_zooms_and_every_cell_is_computed_afresh(tab: Tab) -> None:
    """The window shrinks about the pointer; labels are those of the cells it now shows."""
    tab.wait_for_cells(400)
    before = tab.window()
    tab.page.mouse.move(300, 250)
    for _ in range(4):
        tab.page.mouse.wheel(0, -200)
        tab.page.wait_for_timeout(60)
    tab.wait("Bokeh.documents[0].get_model_by_name('picture').data.dw[0] < 3")
    tab.wait_for_cells(400)
    after = tab.window()
    assert before[0] < after[0] < after[1] < before[1]
    parameters = Parameters()
    labels = np.array(tab.array('label'))
    # A finer picture of the same window may have come meanwhile.
    size = math.isqrt(labels.size)
    plane = Plane(0.0, after[:2], after[2:], size, size)
    initial = plane.cells(parameters, slice(0, size), slice(0, size))[::97]
    catalogue = find_attractors(parameters, Plane().draw(parameters, 300, 4),
                                chaotic=False)
    theirs = catalogue.label(initial, CAP)
    # The browser knows where its window begins and how wide it is; its end may differ by an ulp.
    assert np.mean(labels[::97] == theirs['label']) > 0.995


def test_slider_changes_alpha_and_colours_stay(tab: Tab) -> None:
    """From 0.48 to 0.495 by the keyboard a third attractor is born; the others keep theirs."""
    tab.wait_for_cells(400)
    handle = tab.page.locator('.noUi-handle').first
    handle.focus()
    for _ in range(15):
        handle.press('ArrowRight')
    tab.wait("Bokeh.documents[0].get_model_by_name('exact_alpha').value == 0.495")
    names = ('A orbit-3-1-U4.1', 'B orbit-2-1-U5.49', 'C orbit-3-1-U5.1')
    # Before it the pictures of the steps in between are shown.
    tab.wait(f"""{list(names)}.every((name) => Bokeh.documents[0].get_model_by_name(
        'legend').text.includes(name))""")
    legend = tab.get('legend', 'text')
    found = [(colour, name) for colour in HUES for name in names
             if f'background:{colour}"></span> {name}' in legend]
    assert found == list(zip(HUES, names, strict=False))


def test_a_view_can_be_sent_by_its_address(tab: Tab) -> None:
    """Another page shows the same window, parameters and second plane, without a click."""
    gamma = tab.page.locator('input').nth(2)
    gamma.fill('0.12')
    gamma.press('Enter')
    tab.page.get_by_text('compare').click()
    tab.page.locator('select').last.select_option(index=2)
    tab.wait("location.search.includes('beside=0.12&which=gamma')")
    tab.page.locator('select').last.select_option(index=0)
    second = tab.page.locator('input').last
    second.fill('0.57')
    second.press('Enter')
    tab.wait("location.search.includes('gamma=0.12') && location.search.includes('beside=0.57')")
    sent = tab.page.url
    tab.page.goto('about:blank')
    tab.page.goto(sent)
    tab.wait('window.Bokeh && Bokeh.documents.length > 0')
    for plane, cells in (('picture', 100), ('picture_beside', 100)):
        tab.wait(f"""(() => {{
            const data = Bokeh.documents[0].get_model_by_name('{plane}').data;
            return data.image.length == 1 && data.image[0].shape[0] >= {cells};
        }})()""")
    assert tab.page.url == sent
    assert tab.get('gamma', 'value') == 0.12
    assert tab.get('beside', 'value') == 0.57
    # B is chaotic there, in the colour that it has on the first plane.
    tab.wait(f"""Bokeh.documents[0].get_model_by_name('legend_beside').text.includes(
        'background:{HUES[0]}')""")


def test_planes_show_the_same_state(tab: Tab, tmp_path: Path) -> None:
    """Buttons lead to the strobe and the section; a click there leads to the state it names."""
    tab.wait_for_cells(400)
    before = tab.get('impacts', 'data.phase[10]')
    tab.page.get_by_text('strobe', exact=True).click()
    tab.wait("Bokeh.documents[0].get_model_by_name('picture').data.x[0] == -1")
    tab.wait_for_cells(400)
    # Through the same trajectory: phase 4 and s = 0 of the plane before.
    assert tab.get('impacts', 'data.phase[10]') == before
    assert (tab.get('point', 'data.x[0]'), tab.get('point', 'data.y[0]')) == (0.0, -0.5)
    assert tab.window() == (-1.0, 0.0, -2.0, 2.0)
    assert 'displacement' in tab.get('plane', 'below[0].axis_label')
    labels, plane = np.array(tab.array('label')), Plane(phase=4.0, kind='strobe')
    size = math.isqrt(labels.size)
    plane = dataclasses.replace(plane, phases=size, velocities=size)
    catalogue = find_attractors(Parameters(), plane.draw(Parameters(), 300, 4), chaotic=False)
    theirs = catalogue.label(plane.cells(Parameters(), slice(0, size), slice(0, size))[::97], CAP)
    assert np.mean(labels[::97] == theirs['label']) > 0.995
    tab.screenshot(tmp_path / 'strobe.png')
    tab.page.mouse.click(300, 250)
    tab.wait("Bokeh.documents[0].get_model_by_name('point').data.x[0] < 0")
    s, velocity = (tab.get('point', f'data.{axis}[0]') for axis in 'xy')
    phases = follow(Parameters(), 4.0, s, velocity).phases.tolist()
    tab.wait(f"Bokeh.documents[0].get_model_by_name('impacts').data.phase[5] == {phases[5]!r}")
    tab.page.mouse.move(300, 250)
    for _ in range(3):
        tab.page.mouse.wheel(0, 200)
        tab.page.wait_for_timeout(60)
    assert tab.get('plane', 'x_range.start') >= -1.0 and tab.get('plane', 'x_range.end') <= 0.0
    tab.page.get_by_text('section', exact=True).click()
    tab.wait("Bokeh.documents[0].get_model_by_name('picture').data.x[0] == 0")
    assert 'phase' in tab.get('plane', 'below[0].axis_label')
    assert 'plane=section' in tab.page.url


def test_click_shows_the_trajectory(tab: Tab) -> None:
    """The impacts beside the plane are those of the point that was clicked."""
    tab.wait_for_cells(400)
    first = tab.get('impacts', 'data.velocity[0]')
    tab.page.mouse.click(350, 200)
    tab.wait(f"Bokeh.documents[0].get_model_by_name('impacts').data.velocity[0] != {first}")
    phase, velocity = (tab.get('point', f'data.{name}[0]') for name in ('x', 'y'))
    expected = follow(Parameters(), phase, 0.0, velocity)
    shown = tab.page.evaluate(
        "Array.from(Bokeh.documents[0].get_model_by_name('impacts').data.velocity)")
    assert shown == expected.velocities.tolist()
    assert -2.0 < velocity < 2.0
    tab.page.mouse.move(355, 210)
    tab.page.wait_for_selector('text=lifetime', timeout=20_000)


def test_view_is_saved_with_the_command_that_makes_it(
        tab: Tab, server: tuple[int, Path, int]) -> None:
    """Dataset and picture; the labels are those of the page, cell by cell."""
    tab.wait_for_cells(400)
    before = np.array(tab.array('label'))
    tab.page.get_by_text('save this view').click()
    tab.wait("Bokeh.documents[0].get_model_by_name('message').text.includes('saved in')")
    place = max(server[1].glob('*-basins'), key=os.path.getmtime)
    words = shlex.split((place / 'command.txt').read_text())
    assert words[:2] == ['gear_rattle', 'basins']
    dataset = open_dataset(place / 'basins.zarr')
    # The tool's own record of how it was called.
    assert shlex.split(dataset.attrs['command']) == words
    assert Image.open(place / 'basins.png').size > (500, 500)
    theirs = dataset['label'].values.ravel()
    # A finer picture may have come meanwhile, before the view was saved or after.
    ours = next(labels for labels in (before, np.array(tab.array('label')))
                if labels.size == theirs.size)
    assert np.mean(ours == theirs) > 0.9999
    assert not np.any(theirs == UNSETTLED)


def test_deepest_window_reports_that_float64_ends(tab: Tab) -> None:
    """The wheel does not lead beyond it, and a sentence explains why."""
    tab.page.mouse.move(300, 250)
    for _ in range(100):
        tab.page.mouse.wheel(0, -200)
        tab.page.wait_for_timeout(15)
    tab.wait("Bokeh.documents[0].get_model_by_name('status').text.includes('float64 ends here')")
    left, right, low, high = tab.window()
    assert 1e-12 < right - left < 1e-11
    assert 1e-12 < high - low < 1e-11


def cpu_of(pid: int) -> float:
    """Return the processor time that a process has used [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rsplit(')', 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def idle(pid: int, share: float) -> Callable[[], bool]:
    """Return a question: is a process idle, over one second."""
    def ask() -> bool:
        before, begin = cpu_of(pid), time.monotonic()
        time.sleep(1.0)
        return cpu_of(pid) - before < share * (time.monotonic() - begin)

    return ask


def test_tabs_are_independent_and_a_closed_one_stops_working(
        tab: Tab, browser: object, server: tuple[int, Path, int]) -> None:
    """A view that takes minutes keeps the server busy until its tab is closed."""
    tab.wait_for_cells(400)
    other = Tab(browser, server[0])
    other.page.get_by_text('lifetimes').click()
    alpha = other.page.locator('input').first
    alpha.fill('1.0')
    alpha.press('Enter')
    other.wait("Bokeh.documents[0].get_model_by_name('alpha').value == 1.0")
    other.wait("Bokeh.documents[0].get_model_by_name('legend').text.includes('unsettled')")
    assert tab.get('alpha', 'value') == 0.48
    # The finest level of the quiet tab may still be under way.
    tab.wait("!Bokeh.documents[0].get_model_by_name('status').text.includes('refining')")
    assert not idle(server[2], 0.05)()
    other.page.close()
    is_idle = idle(server[2], 0.05)
    assert any(is_idle() for _ in range(30))
