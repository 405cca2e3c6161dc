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

"""Driving the explorer in a real, headless Chromium."""

from collections.abc import Iterator
import contextlib
from pathlib import Path
import shutil
from typing import Any

import pytest

FLAGS = ('--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
         '--disable-background-networking', '--disable-component-update', '--disable-sync')
SIZE = {'width': 1280, 'height': 720}


@contextlib.contextmanager
def chromium() -> Iterator[Any]:
    """Start the browser that is installed here, or skip the test."""
    playwright = pytest.importorskip('playwright.sync_api')
    path = shutil.which('chromium') or shutil.which('chromium-browser') or shutil.which(
        'google-chrome')
    if path is None:
        pytest.skip('no chromium here: apt-get install chromium')
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=list(FLAGS))
        yield browser
        browser.close()


class Tab:
    """One tab with the explorer."""

    def __init__(self, browser: Any, port: int) -> None:
        """Open it and wait for the first picture."""
        self.page = browser.new_page(viewport=SIZE)
        self.requests: list[str] = []
        self.errors: list[str] = []
        self.page.on('request', lambda request: self.requests.append(request.url))
        self.page.on('pageerror', lambda error: self.errors.append(str(error)))
        self.page.goto(f'http://127.0.0.1:{port}/', timeout=60_000)
        self.wait("window.Bokeh && Bokeh.documents.length > 0 && "
                  "Bokeh.documents[0].get_model_by_name('picture').data.image.length == 1")

    def wait(self, condition: str, within: float = 120.0) -> None:
        """Wait until something holds in the page."""
        self.page.wait_for_function(condition, timeout=1e3 * within)

    def get(self, name: str, what: str) -> Any:
        """Return a property of a model of the page."""
        return self.page.evaluate(f"Bokeh.documents[0].get_model_by_name('{name}').{what}")

    def wait_for_cells(self, cells: int, within: float = 120.0) -> None:
        """Wait for a whole picture of `cells` on a side of the window that is shown."""
        self.wait(f"""(() => {{
            const find = (name) => Bokeh.documents[0].get_model_by_name(name);
            const range = find('plane').x_range, data = find('picture').data;
            return find('status').text.startsWith('{cells} × {cells},')
                && data.x[0] == range.start && data.image[0].shape[0] == {cells};
        }})()""", within)

    def window(self) -> tuple[float, float, float, float]:
        """Return the place of the picture: phase from, to, velocity from, to."""
        x, y, width, height = (self.get('picture', f'data.{name}[0]')
                               for name in ('x', 'y', 'dw', 'dh'))
        return x, x + width, y, y + height

    def array(self, name: str) -> list[float]:
        """Return a grid of the picture, row by row."""
        return self.page.evaluate(
            f"Array.from(Bokeh.documents[0].get_model_by_name('picture').data.{name}[0])")

    def screenshot(self, path: Path) -> Path:
        """Take a picture of the page."""
        self.page.screenshot(path=str(path))
        return path
