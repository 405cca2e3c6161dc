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

"""A plane of initial conditions on a page, with what computes it, its legend and its status."""

from collections.abc import Callable
import threading

from bokeh.document import Document
from bokeh.layouts import column
from bokeh.models import Div

from .catalogues import Catalogues
from .computing import Picture
from .painting import Colours, legend
from .plane_figure import PlaneFigure, WIDTH
from .view import View
from .worker import Worker


class Pane:
    """Shows one view, and always the latest."""

    def __init__(self, document: Document, plane: PlaneFigure, catalogues: Catalogues,
                 is_open: Callable[[], bool], colours: Colours, name: str = '') -> None:
        self._document, self._view = document, View()
        self.plane, self.colours = plane, colours
        self._waiting: Picture | None = None
        self._lock = threading.Lock()
        self._legend = Div(name=f'legend{name}', width=WIDTH, height=36,
                           styles={'font-size': '12px', 'line-height': '1.5'})
        self._status = Div(name=f'status{name}', width=WIDTH, height=20,
                           styles={'font-size': '12px', 'color': '#555'})
        self.layout = column(plane.figure, self._legend, self._status)
        self._worker = Worker(catalogues, self._offer, is_open)

    def ask(self, view: View) -> None:
        self._view = view
        self._worker.ask(view)

    def stop(self) -> None:
        self._worker.stop()

    def _offer(self, picture: Picture) -> None:
        """Take a picture from the worker, in place of one that has not been drawn yet."""
        with self._lock:
            is_first = self._waiting is None
            self._waiting = picture
        if is_first:
            self._document.add_next_tick_callback(self._draw)

    def _draw(self) -> None:
        with self._lock:
            picture, self._waiting = self._waiting, None
        if picture is None or picture.view != self._view:
            return
        self.colours = self.colours.followed(picture.known)
        self.plane.show(picture, self.colours)
        self._legend.text = legend(picture, self.colours)
        view = picture.view
        limit = view.limit()
        done = '' if picture.done == 1.0 else f' ({picture.done:.0%})'
        more = '' if picture.is_last else ', refining'
        text = (f'{picture.cells} × {picture.cells}{done}{more}, {picture.seconds:.2f} s; window '
                f'{view.phase[1] - view.phase[0]:.3g} rad × '
                f'{view.velocity[1] - view.velocity[0]:.3g}')
        self._status.text = f'<b style="color:#b22e18">{limit}</b>' if limit else text
