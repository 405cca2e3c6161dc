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
import pytest

from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.path import Path
from gear_rattle_ros.explorer import server
from gear_rattle_ros.explorer.address import Shown
from gear_rattle_ros.explorer.catalogues import Catalogues
from gear_rattle_ros.explorer.page import FIRST_POINT, Page, Shared
from gear_rattle_ros.explorer.simulator_link import SimulatorLink
from gear_rattle_ros.explorer.view import View
from gear_rattle_ros.studies.parameter_plane import parameter_plane


def test_a_click_on_the_map_sets_both_parameters(tmp_path: FilePath) -> None:
    """The sliders, the view and the mark on the map follow; what is out of range is refused."""
    plane = parameter_plane(Path.over(Parameters(0.48), gamma=(0.0, 0.2), restitution=(0.5, 1.0)),
                            size=(3, 2), threads=1)
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


def test_a_store_that_is_no_map_is_refused(
        tmp_path: FilePath, capsys: pytest.CaptureFixture[str]) -> None:
    """In one line, with status 2."""
    with pytest.raises(SystemExit) as end:
        server.main(['--no-browser', '--parameters', str(tmp_path / 'none.zarr')])
    assert end.value.code == 2
    assert 'none.zarr does not exist' in capsys.readouterr().err
