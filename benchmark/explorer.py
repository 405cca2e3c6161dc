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
How soon the explorer answers in a real browser: first picture and 400 x 400 after each touch.

Times are taken in the page, from the moment the wheel, the drag or the slider's key reaches it to
the moment a picture of the new view has arrived and is drawn. Layers are timed from the click that
switches them on, and from a click on the plane with all of them on. The peer is what answers the
same question without an explorer: the tool `basins`, in a separate process.
"""

import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / 'test' / 'explorer'))
from browser import chromium, Tab  # noqa: E402, I100, RUF100

PORT = 5106
TURNS = 5
# Notes, for the next view that is asked for, when pictures of it have been drawn.
LISTEN = """() => {
    const find = (name) => Bokeh.documents[0].get_model_by_name(name);
    const note = (name) => requestAnimationFrame(() => {
        window.times[name] ??= performance.now() - window.began;
    });
    // Pictures of the view before may still be on their way.
    find('picture').properties.data.change.connect(() => {
        if (window.isNew()) note('first');
    });
    find('status').properties.text.change.connect(() => {
        if (window.isNew() && /^(400 × 400|800 × 800)(,| )/.test(find('status').text)
            && !find('status').text.startsWith('400 × 400 (')) note('fine');
    });
    const mark = () => { window.began = performance.now(); window.times = {}; };
    for (const type of ['wheel', 'pointerup', 'keydown'])
        document.addEventListener(type, mark, {capture: true});
}"""
IS_NEW = {
    'zoom': '() => source.data.dw[0] == plane.x_range.end - plane.x_range.start',
    'pan': '() => source.data.x[0] == plane.x_range.start',
    'slider': '() => true',
}


def touch(tab: Tab, kind: str, turn: int) -> None:
    """Zoom, pan or step a slider once."""
    if kind == 'zoom':
        tab.page.mouse.move(300, 250)
        tab.page.mouse.wheel(0, 120 if turn % 2 else -120)
    elif kind == 'pan':
        tab.page.mouse.move(300, 250)
        tab.page.mouse.down()
        tab.page.mouse.move(300 + 20 * (1 + turn), 260)
        tab.page.mouse.up()
    else:
        tab.page.locator('.noUi-handle').first.press('ArrowRight')


def measure(tab: Tab, kind: str) -> tuple[list[float], list[float]]:
    """Touch the page again and again; returns seconds to the first and to the fine picture."""
    first, fine = [], []
    for turn in range(TURNS):
        tab.page.evaluate(
            "() => { const find = (name) => Bokeh.documents[0].get_model_by_name(name);"
            "const source = find('picture'), plane = find('plane'); window.times = {};"
            f'window.isNew = {IS_NEW[kind]}; }}')
        touch(tab, kind, turn)
        tab.wait('window.times.fine !== undefined')
        times = tab.page.evaluate('window.times')
        first.append(times['first'] / 1e3)
        fine.append(times['fine'] / 1e3)
        # The finest level, which is not timed.
        tab.wait("!Bokeh.documents[0].get_model_by_name('status').text.includes('refining')")
    return first, fine


def measure_layers(tab: Tab) -> None:
    """Print seconds from a click to each layer: switched on, and of another point."""
    tab.page.evaluate("""() => {
        window.times = {};
        const find = (name) => Bokeh.documents[0].get_model_by_name(name);
        for (const name of ['orbits', 'unstable', 'stable', 'edge', 'kick'])
            find(name).properties.data.change.connect(() => {
                if (find(name).data.x.length) requestAnimationFrame(() => {
                    window.times[name] ??= (performance.now() - window.began) / 1e3;
                });
            });
        const mark = () => { window.began = performance.now(); window.times = {}; };
        document.addEventListener('pointerdown', mark, {capture: true});
    }""")
    # The smallest kick at 0.48 is at the lower wall.
    tab.page.locator('input').nth(4).fill('-1')
    tab.page.locator('input').nth(4).press('Enter')
    tab.wait_for_cells(400)
    clicks = [('switched on', name) for name in ('orbits', 'manifolds', 'edge state', 'kick')]
    for words, name in [*clicks, *[('clicked', place) for place in ((200, 150), (450, 200))]]:
        if isinstance(name, str):
            tab.page.get_by_text(name, exact=True).click()
        else:
            tab.page.mouse.click(*name)
        time.sleep(6.0)
        found = ', '.join(f'{layer} {at:.2f} s' for layer, at in sorted(
            tab.page.evaluate('window.times').items(), key=lambda one: one[1]))
        print(f'  {words} {name}: {found}')


def main() -> None:
    """Print all figures."""
    with tempfile.TemporaryDirectory() as name:
        server = subprocess.Popen(
            [sys.executable, '-m', 'gear_rattle_ros.start', 'explorer', '--no-browser', '--port',
             str(PORT), '--folder', name], stdout=subprocess.PIPE, text=True)
        assert server.stdout is not None
        try:
            server.stdout.readline()
            with chromium() as browser:
                tab = Tab(browser, PORT)
                tab.page.evaluate(LISTEN)
                tab.wait("!Bokeh.documents[0].get_model_by_name('status').text"
                         ".includes('refining')")
                print(f'{os.cpu_count()} cores, alpha 0.48, median (worst) of {TURNS}:')
                for kind in IS_NEW:
                    first, fine = measure(tab, kind)
                    print(f'  {kind:6s} first picture {np.median(first):.3f} s '
                          f'({max(first):.3f}), 400 x 400 {np.median(fine):.2f} s '
                          f'({max(fine):.2f})')
                measure_layers(tab)
        finally:
            server.terminate()
            server.wait()
        begin = time.perf_counter()
        subprocess.run([sys.executable, '-m', 'gear_rattle_ros.start', 'basins', '--output',
                        f'{name}/peer.zarr'], check=True, capture_output=True)
        print(f'  the tool basins, 400 x 400 on disk: {time.perf_counter() - begin:.2f} s')


if __name__ == '__main__':
    main()
