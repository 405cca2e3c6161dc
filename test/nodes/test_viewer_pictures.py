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

"""The viewer's file, rendered for real: natively without a display, and in a browser."""

from collections.abc import Iterator
import dataclasses
import importlib.util
import math
from pathlib import Path
import shutil
import socket
import subprocess
import time
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from PIL import Image
import pytest

from gear_rattle_ros.attractors.matching import follow, points_of
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.attractors.skeleton.skeleton import skeletons
from gear_rattle_ros.attractors.watching import Basins, glance, watch
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.messages import markers_from_layers
from gear_rattle_ros.nodes.basin import Memory, picture_of, Settings, Wanted
from gear_rattle_ros.nodes.viewer.basin import BasinInput, layers_of
from gear_rattle_ros.nodes.viewer.recent import Recent
from gear_rattle_ros.nodes.viewer.scene import Scene
from gear_rattle_ros.nodes.viewer.sinks import file_recording
from gear_rattle_ros.palette import AMBER, BLUE, LAYERS, PURPLE, RED, rgb, SKY

pytestmark = pytest.mark.long
WIDTH, HEIGHT = 1280, 720
# Of the picture: left, top, right, bottom.
SECTION = (0.0, 0.09, 0.46, 0.66)
STATE = (0.0, 0.7, 0.2, 0.95)
FLIGHT = (0.47, 0.09, 1.0, 0.29)
VELOCITY = (0.47, 0.34, 1.0, 0.51)
EXPONENTS = (0.49, 0.56, 1.0, 0.8)
ALPHA = (0.49, 0.86, 1.0, 0.94)
# Flags with which Chromium draws WebGL in software.
FLAGS = ('--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader',
         '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist')

Pixels = np.ndarray


@pytest.fixture(scope='module')
def basins() -> Basins:
    """Return the basins at 0.48."""
    planes = [Plane(velocity=(-1.5, 1.5), phases=size, velocities=size, kind='impact')
              for size in (50, 200)]
    *_, last = watch(glance(Parameters(0.48), np.zeros((0, 3)))[0], planes, cap=5000, threads=2,
                     is_dropped=lambda: False)
    return last


@pytest.fixture(scope='module')
def file(basins: Basins, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file as the viewer writes it: a run at 0.57 that goes on at 0.48."""
    path = tmp_path_factory.mktemp('viewer') / 'run.rrd'
    scene = Scene(file_recording(str(path), 'age'), 'age', thins=False)
    traces, hues = follow((), points_of(basins.catalogue))
    picture = picture_of(
        Wanted(basins.catalogue.parameters, 1, Time(sec=7), 0.0, False), basins, hues,
        Memory(traces, 1.5),
        Settings((50, 200), basins.plane, 1.5, 5000, 1, 0))
    inputs = BasinInput()
    assert inputs.take('basin', picture.image) is None
    assert inputs.take('attractors', picture.attractors) is None
    drawn = inputs.take('basin_state', picture.state)
    assert drawn is not None
    *_, last = skeletons(basins.catalogue, {}, basins.plane, lambda: None)
    layers = layers_of(markers_from_layers(last[0], Time(sec=7)))
    simulation = Simulation(Parameters(0.57), State(0, 0.0, 0.0, -1.0))
    recent, running, clock = Recent(1000), RunningLyapunov(), 0.0
    for cycle in range(20, 801, 20):
        events = simulation.advance(cycle, 0.0, 1000)
        if cycle == 400:
            events = np.concatenate([events, simulation.retune(Parameters(0.48))])
            scene.take_basin(drawn)
            scene.take_layers(layers)
        recent.take(events)
        running.update(events)
        report = running.report
        scene.estimate({**dataclasses.asdict(report), 'sum': report.lambda_1 + report.lambda_2})
        scene.draw(recent, '**orbit of 2 impacts in 1 drive period**', clock)
        clock += 1.0
    scene.close()
    return path


def free_port() -> int:
    """Return a port that nobody uses."""
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


def rerun() -> str:
    """Return the program of the wheel."""
    found = importlib.util.find_spec('rerun_cli')
    assert found is not None and found.origin is not None
    return str(Path(found.origin).parent / 'rerun')


@pytest.fixture(scope='module')
def native(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Pixels:
    """Return the window of rerun, drawn by software Vulkan."""
    if not list(Path('/usr/share/vulkan/icd.d').glob('lvp_icd*.json')):
        pytest.skip('no software Vulkan here: apt-get install mesa-vulkan-drivers')
    from rerun.experimental import ViewerClient
    port, path = free_port(), tmp_path_factory.mktemp('native') / 'native.png'
    process = subprocess.Popen(
        [rerun(), '--headless', '--bind', '127.0.0.1', '--port', str(port), '--window-size',
         f'{WIDTH}x{HEIGHT}', str(file)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        client = retried(
            lambda: ViewerClient.connect(f'rerun+http://127.0.0.1:{port}/proxy'), Exception)

        def drawn() -> Pixels:
            client.save_screenshot(str(path))
            return settled(pixels_of(path))

        return retried(drawn, Exception)
    finally:
        process.terminate()
        process.wait()


@pytest.fixture(scope='module')
def browser(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Return a function that draws the web viewer in Chromium, in light or dark."""
    playwright = pytest.importorskip('playwright.sync_api')
    chromium = shutil.which('chromium')
    if chromium is None:
        pytest.skip('no chromium here: apt-get install chromium')
    port, web_port = free_port(), free_port()
    folder = tmp_path_factory.mktemp('web')
    process = subprocess.Popen(
        [rerun(), '--serve-web', '--bind', '127.0.0.1', '--port', str(port), '--web-viewer-port',
         str(web_port), str(file)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def draw(scheme: str) -> Pixels:
        with playwright.sync_playwright() as driver:
            window = driver.chromium.launch(executable_path=chromium, args=list(FLAGS))
            page = window.new_page(
                viewport={'width': WIDTH, 'height': HEIGHT}, color_scheme=scheme)
            address = f'http://127.0.0.1:{web_port}/?url=rerun%2Bhttp://127.0.0.1:{port}/proxy'
            retried(lambda: page.goto(address), playwright.Error)
            path = folder / f'{scheme}.png'

            def drawn() -> Pixels:
                page.screenshot(path=str(path), timeout=60_000)
                return settled(pixels_of(path))

            pixels = retried(drawn, Exception)
            window.close()
            return pixels

    try:
        yield draw
    finally:
        process.terminate()
        process.wait()


def retried(attempt: Any, error: type[BaseException], within: float = 90.0) -> Any:
    """Try again until it works."""
    deadline = time.monotonic() + within
    while True:
        try:
            return attempt()
        except error:
            if time.monotonic() > deadline:
                raise
            time.sleep(1.0)


def pixels_of(path: Path) -> Pixels:
    """Return a picture as numbers."""
    with Image.open(path) as picture:
        return np.asarray(picture.convert('RGB')).astype(int)


def part(pixels: Pixels, view: tuple[float, float, float, float]) -> Pixels:
    """Return the part of the picture that is a view's."""
    left, top, right, bottom = view
    return pixels[int(top * HEIGHT):int(bottom * HEIGHT), int(left * WIDTH):int(right * WIDTH)]


def like(pixels: Pixels, colour: str, tolerance: int = 60) -> np.ndarray:
    """Return which pixels have about a colour."""
    wanted = np.array(rgb(colour))
    return np.abs(pixels - wanted).sum(axis=-1) < tolerance


def hued(pixels: Pixels) -> np.ndarray:
    """Distinguish blue (1), red (2) and other (0) pixels."""
    red, blue = pixels[..., 0], pixels[..., 2]
    return np.where(blue > red + 40, 1, np.where(red > blue + 40, 2, 0))


def settled(pixels: Pixels) -> Pixels:
    """Return pixels that show section and plots; fail while they are not drawn, or covered."""
    assert np.mean(hued(part(pixels, SECTION)) > 0) > 0.4
    assert like(part(pixels, ALPHA), RED).sum() > 300
    assert len(walls_of(pixels))
    return pixels


def walls_of(pixels: Pixels) -> np.ndarray:
    """Return the rows of both walls in the view of the flight."""
    return np.flatnonzero(np.mean(like(part(pixels, FLIGHT), AMBER), axis=1) > 0.7)


def check(pixels: Pixels, basins: Basins) -> None:
    """Every view shows what it should, where it should be."""
    assert pixels.shape == (HEIGHT, WIDTH, 3)
    section = part(pixels, SECTION)
    hues = hued(section)
    # The frame is where the basins are.
    rows = np.flatnonzero(np.mean(hues > 0, axis=1) > 0.4)
    columns = np.flatnonzero(np.mean(hues > 0, axis=0) > 0.4)
    top, bottom, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
    assert right - left > 400 and bottom - top > 250
    # The first attractor is blue, the second red; cells whose neighbours are the same.
    same, looked = [], 0
    for row in range(2, 198, 7):
        for column in range(2, 198, 7):
            near = basins.labels[row - 2:row + 3, column - 2:column + 3]
            if (near == near[0, 0]).all() and near[0, 0] >= 0:
                y = bottom - (row + 0.5) / 200.0 * (bottom - top)
                x = left + (column + 0.5) / 200.0 * (right - left)
                looked += 1
                same.append(hues[int(y), int(x)] == near[0, 0] + 1)
    assert looked > 40 and np.mean(same) > 0.9

    # The newest impacts, white, are those of one of the orbits.
    def is_bright(phase: float, velocity: float) -> bool:
        x = left + phase / (2.0 * math.pi) * (right - left)
        y = bottom - (velocity + 1.5) / 3.0 * (bottom - top)
        return section[int(y) - 4:int(y) + 5, int(x) - 4:int(x) + 5].min(axis=-1).max() > 215

    assert [all(map(is_bright, orbit.phases, orbit.velocities))
            for orbit in basins.catalogue.orbits].count(True) == 1
    # The layers over the basins.
    for name in ('unstable_manifold', 'stable_manifold', 'edge_state'):
        assert like(section, LAYERS[name]).sum() > 100, name
    flight = part(pixels, FLIGHT)
    walls = walls_of(pixels)
    assert walls[-1] - walls[0] > 60
    motion = np.flatnonzero(like(flight, SKY).any(axis=1))
    assert walls[0] - 4 <= motion[0] and motion[-1] <= walls[-1] + 4
    assert motion[-1] - motion[0] > 0.9 * (walls[-1] - walls[0])
    assert like(part(pixels, VELOCITY), BLUE).sum() > 1000
    exponents = part(pixels, EXPONENTS)
    assert like(exponents, PURPLE).sum() + like(exponents, BLUE).sum() > 150
    assert like(exponents, RED).sum() > 150
    # Alpha falls once: the line is higher at the left than at the right.
    alpha = like(part(pixels, ALPHA), RED)
    heights = [np.mean(np.flatnonzero(alpha[:, slot].any(axis=1)))
               for slot in (slice(60, 150), slice(-150, -60))]
    assert heights[0] < heights[1] - 10
    state = part(pixels, STATE)
    ground = np.median(state.reshape(-1, 3), axis=0)
    assert (np.abs(state - ground).sum(axis=-1) > 200).sum() > 300


def test_native_window(native: Pixels, basins: Basins) -> None:
    """Every view is drawn, dark on a machine without a display."""
    check(native, basins)


def test_web_viewer(browser: Any, basins: Basins) -> None:
    """The same in a browser, whose user prefers light; drawing it in software takes a minute."""
    pixels = browser('light')
    check(pixels, basins)
    assert np.median(part(pixels, STATE)) > 128
