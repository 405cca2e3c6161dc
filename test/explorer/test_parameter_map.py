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

"""The map of parameters on the page: a click there sets the parameters."""

from pathlib import Path as FilePath

from bokeh.document import Document
from bokeh.events import Tap
from bokeh.server.callbacks import PeriodicCallback
import numpy as np
import pytest

from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.path import Path
from gear_rattle_ros.explorer import server
from gear_rattle_ros.explorer.address import Shown
from gear_rattle_ros.explorer.computing.catalogues import Catalogues
from gear_rattle_ros.explorer.figures.parameter_map import PAINTED
from gear_rattle_ros.explorer.page import FIRST_POINT, Page, Shared
from gear_rattle_ros.explorer.simulator_link import SimulatorLink
from gear_rattle_ros.explorer.view import View
from gear_rattle_ros.figures.parameter_plane import paint
from gear_rattle_ros.figures.style import Looks
from gear_rattle_ros.gear_pairs import read_gears
from gear_rattle_ros.places import config_folder
from gear_rattle_ros.store.store import Store
from gear_rattle_ros.studies.sweeps.parameter_plane import parameter_plane


def test_a_click_on_the_map_sets_both_parameters(tmp_path: FilePath) -> None:
    """The sliders, the view and the mark on the map follow; what is out of range is refused."""
    plane = tmp_path / 'a.zarr'
    parameter_plane(Path.over(Parameters(0.48), gamma=(0.0, 0.2), restitution=(0.5, 1.0)),
                    size=(3, 2), threads=1, store=plane)
    view = View(Parameters(0.48))
    page = Page(Document(), Shared(Catalogues(), SimulatorLink(), tmp_path, plane),
                Shown(view, FIRST_POINT), lambda: True)
    assert page._map is not None
    plot = page._map.figure
    assert (plot.x_range.start, plot.x_range.end, plot.y_range.end) == (0.0, 0.2, 1.0)
    plot._trigger_event(Tap(plot, x=0.15, y=0.75))
    found = page._shown.view.parameters
    assert found == Parameters(0.48, 0.1, 0.15, 0.75)
    assert page._map._here.data == {'gamma': [0.15], 'restitution': [0.75]}
    assert page._sliders['gamma'].value == 0.15 and page._typed['restitution'].value == 0.75
    plot._trigger_event(Tap(plot, x=0.1, y=1.5))
    assert page._shown.view.parameters == Parameters(0.48, 0.1, 0.1, 0.75)
    assert 'restitution = 1.5 is outside' in page._message.text
    page.close()


def test_the_map_follows_a_store_that_is_computed(tmp_path: FilePath) -> None:
    """Tiles appear as they are finished, in SI beside it; at the end it has the picture of all."""
    path = tmp_path / 'a.zarr'
    options = {'path': Path.over(alpha=(0.3, 0.9), gamma=(0.0, 0.2)), 'size': (60, 30),
               'skip': 64, 'threads': 1, 'store': path, 'curves': 1}
    whole = parameter_plane(**options)
    expected = paint(Looks(), *(whole.isel(slot=0)[name].values for name in PAINTED))[0]
    store = Store(path)
    assert len(store.tiles) == 2
    store.mark([0, 1], False)
    document = Document()
    gears = read_gears(config_folder('gears') / 'example.yaml')
    page = Page(document, Shared(Catalogues(), SimulatorLink(), tmp_path, path, gears),
                Shown(View(), FIRST_POINT), lambda: True)
    assert page._map is not None and page._map.grows
    assert [axis.axis_label for axis in (*page._map.figure.above, *page._map.figure.right)] == [
        'drive_rad [rad]', 'torque_n_m [N m]']

    def shown() -> np.ndarray:
        (image,) = page._map._image.data['image']
        return image.view(np.uint8).reshape(30, 60, 4)[..., :3]

    def waits() -> bool:
        return any(isinstance(each, PeriodicCallback) for each in document.session_callbacks)

    assert waits() and np.ptp(shown()) == 0
    plot = page._pane.plane.figure
    assert [axis.axis_label for axis in (*plot.above, plot.right[-1])] == ['[μm]', '[mm/s]']
    assert plot.below[0].axis_label == 'initial drive phase τ [rad]' and not plot.above[0].visible
    store.mark(1)
    page._follow()
    first, second = shown()[:, :40], shown()[:, 40:]
    assert np.ptp(first) == 0 < np.ptp(second)
    assert page._map._curves.data == {'alpha': [], 'gamma': []}
    store.mark(0)
    page._follow()
    assert np.allclose(shown(), 255.0 * expected, atol=0.51)
    assert len(page._map._curves.data['alpha']) == len(whole['curve_kind'])
    assert not waits()
    page.close()


def test_a_store_that_is_no_map_is_refused(
        tmp_path: FilePath, capsys: pytest.CaptureFixture[str]) -> None:
    """In one line, with status 2."""
    with pytest.raises(SystemExit) as end:
        server.main(['--no-browser', '--parameters', str(tmp_path / 'none.zarr')])
    assert end.value.code == 2
    assert 'none.zarr does not exist' in capsys.readouterr().err
