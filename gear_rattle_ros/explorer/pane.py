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
import functools
import threading
from typing import Final

from bokeh.document import Document
from bokeh.layouts import column
from bokeh.models import Div

from .computing.catalogues import Catalogues
from .computing.computing import Picture, pictures
from .computing.skeleton import Asked, Layers, Skeleton
from .computing.worker import Worker
from .figures.painting import Colours, legend, legend_of_layers
from .figures.plane_figure import HEIGHT, PlaneFigure, WIDTH
from .view import BASINS, View
from ..attractors.plane import STROBE

# Height of what there is to say about layers, for which the plane gives way [pixels].
SPOKEN: Final = 60


class Pane:
    """Shows one view, and always the latest."""

    def __init__(self, document: Document, plane: PlaneFigure, catalogues: Catalogues,
                 is_open: Callable[[], bool], colours: Colours, name: str = '') -> None:
        self._document = document
        self._view: View | None = None
        self._asked: Asked | None = None
        self._drawn: Layers | None = None
        self.plane, self.colours = plane, colours
        # The latest of each type.
        self._waiting: dict[type, Picture | Layers] = {}
        self._lock = threading.Lock()
        self._legend = Div(name=f'legend{name}', width=WIDTH, height=36,
                           styles={'font-size': '12px', 'line-height': '1.5'})
        self._status = Div(name=f'status{name}', width=WIDTH, height=20,
                           styles={'font-size': '12px', 'color': '#555'})
        self._layers = Div(name=f'skeleton{name}', width=WIDTH, height=SPOKEN - 10, visible=False,
                           styles={'font-size': '12px', 'line-height': '1.4'})
        self.layout = column(plane.figure, self._legend, self._layers, self._status)
        self._pictures: Worker[View, Picture] = Worker(
            functools.partial(pictures, catalogues), self._offer, is_open)
        self._skeleton: Worker[Asked, Layers] = Worker(
            Skeleton(catalogues).layers, self._offer, is_open)

    def ask(self, view: View, point: tuple[float, float], layers: tuple[str, ...]) -> None:
        """Show a view and layers over it, as far as they differ."""
        if view != self._view:
            self._view = view
            self._pictures.ask(view)
            if self._drawn:
                self.plane.show_layers(self._drawn, view)
        # Layers do not depend on the window.
        asked = Asked(view.whole(BASINS), point if layers else (0.0, 0.0), layers)
        if asked != self._asked:
            self._asked = asked
            self._layers.visible = bool(layers)
            self.plane.figure.height = HEIGHT - SPOKEN * bool(layers)
            self._skeleton.ask(asked)

    def stop(self) -> None:
        self._pictures.stop()
        self._skeleton.stop()

    def _offer(self, what: Picture | Layers) -> None:
        """Take a result from a worker, in place of one that has not been drawn yet."""
        with self._lock:
            is_first = not self._waiting
            self._waiting[type(what)] = what
        if is_first:
            self._document.add_next_tick_callback(self._draw)

    def _draw(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, {}
        for what in waiting.values():
            if isinstance(what, Picture) and what.view == self._view:
                self._draw_picture(what)
            elif isinstance(what, Layers) and self._view and what.asked == self._asked:
                self._drawn = what
                self.plane.show_layers(what, self._view)
                self._layers.text = legend_of_layers(what)

    def _draw_picture(self, picture: Picture) -> None:
        self.colours = self.colours.followed(picture.known)
        self.plane.show(picture, self.colours)
        self._legend.text = legend(picture, self.colours)
        view = picture.view
        limit, unit = view.limit(), '[1]' if view.on == STROBE else 'rad'
        done = '' if picture.done == 1.0 else f' ({picture.done:.0%})'
        more = '' if picture.is_last else ', refining'
        text = (f'{picture.cells} × {picture.cells}{done}{more}, {picture.seconds:.2f} s; window '
                f'{view.window[1] - view.window[0]:.3g} {unit} × '
                f'{view.velocity[1] - view.velocity[0]:.3g}')
        self._status.text = f'<b style="color:#b22e18">{limit}</b>' if limit else text
