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

"""One page: the present view, the figures, and the controls."""

from collections.abc import Callable
import dataclasses
import functools
import html
from pathlib import Path
import threading
from typing import Final

from bokeh.document import Document
from bokeh.events import DocumentReady
from bokeh.layouts import column, row
from bokeh.models import (
    Button,
    CheckboxButtonGroup,
    CustomJS,
    Div,
    NumericInput,
    RadioButtonGroup,
    Row,
    Select,
    Slider,
    Toggle,
)

from .address import changed, MODEL, Shown
from .computing.catalogues import Catalogues
from .computing.skeleton import LAYERS
from .computing.trajectory import follow, Trajectory
from .figures.painting import Colours
from .figures.parameter_map import ParameterMap
from .figures.plane_figure import PlaneFigure
from .figures.trajectory_figures import TrajectoryFigures, WIDTH as RIGHT_WIDTH
from .pane import Pane
from .saving import Saving
from .simulator_link import SimulatorLink
from .view import KINDS
from ..attractors.plane import PLANES, TWO_PI, Window
from ..core.gears import Gears
from ..core.words import counted

TITLE = 'Gear rattle explorer'
# Phase [rad] and velocity [1] of the first trajectory.
FIRST_POINT = (4.0, -0.5)
# Name, title, range and step of each slider.
SLIDERS = (('alpha', 'α drive', 0.0, 2.0, 0.001), ('beta', 'β damping', 0.0, 1.0, 0.005),
           ('gamma', 'γ load', -0.5, 0.5, 0.005),
           ('restitution', 'r restitution', 0.0, 1.0, 0.005),
           ('displacement', 's₀ initial', -1.0, 0.0, 0.01),
           ('phase', 'τ₀ initial', 0.0, TWO_PI, 0.01))
# How often the map of parameters looks for what is new in its store [ms].
MAP_EVERY: Final = 2000
# The same of what the second plane may differ in.
SECOND = {each[0]: each[1:] for each in SLIDERS if each[0] in MODEL}


@dataclasses.dataclass(frozen=True)
class Shared:
    """What the pages of a server share."""

    catalogues: Catalogues
    link: SimulatorLink
    folder: Path
    # A store of `parameter_plane`, if its map is wanted; a gear pair, if there are SI units.
    plane: Path | None = None
    gears: Gears | None = None


class Page:
    """The page of one browser tab."""

    def __init__(self, document: Document, shared: Shared, shown: Shown,
                 is_open: Callable[[], bool], refused: str = '') -> None:
        self._document, self._shared, self._is_open = document, shared, is_open
        self._shown = shown
        self._trajectory: Trajectory | None = None
        view = shown.view
        self._pane = Pane(document, PlaneFigure(
            view, self._move, self._click, gears=shared.gears),
                          shared.catalogues, is_open, Colours())
        self._beside: Pane | None = None
        self._figures = TrajectoryFigures(shared.gears)
        self._message = Div(name='message', width=RIGHT_WIDTH, height=40, text=(
            'Drag to pan, turn the wheel to zoom, click a point to see its trajectory.'),
            styles={'font-size': '12.5px', 'overflow-wrap': 'anywhere'})
        # Its text becomes the query of the address that the browser shows.
        self._address = Div(name='address', visible=False, text='?' + shown.query())
        write = CustomJS(args={'address': self._address},
                         code='history.replaceState(null, "", address.text);')
        self._address.js_on_change('text', write)
        document.js_on_event(DocumentReady, write)
        self._kind = RadioButtonGroup(name='kind', labels=list(KINDS),
                                      active=KINDS.index(view.kind), width=270)
        self._plane = RadioButtonGroup(name='plane_kind', labels=list(PLANES),
                                       active=PLANES.index(view.on), width=320)
        self._sliders: dict[str, Slider] = {}
        self._typed: dict[str, NumericInput] = {}
        self._compare = Toggle(name='compare', label='compare', width=80,
                               active=shown.beside is not None)
        self._layers = CheckboxButtonGroup(
            name='layers', labels=list(LAYERS), width=290,
            active=[LAYERS.index(each) for each in shown.layers])
        self._map = shared.plane and ParameterMap(
            shared.plane, lambda name, value: self._set(name, '', None, value), shared.gears)
        if self._map and self._map.grows:
            self._following = document.add_periodic_callback(self._follow, MAP_EVERY)
        self._saving = Saving(shared.folder, self._report_later)
        self._lay_out()
        self._ask_panes()
        self._click(*shown.point)
        if refused:
            self._report(refused, False)

    def close(self) -> None:
        for pane in filter(None, (self._pane, self._beside)):
            pane.stop()
        self._saving.stop()

    def _follow(self) -> None:
        """Show what has been added to the store of the map."""
        if self._map and not self._map.follow():
            self._document.remove_periodic_callback(self._following)

    def _lay_out(self) -> None:
        controls = [self._control(name, title, (low, high), step)
                    for name, title, low, high, step in SLIDERS]
        self._fixed = dict(zip(('displacement', 'phase'), controls[4:], strict=True))
        self._show_fixed()
        self._kind.on_change('active', lambda attr, old, new: self._ask_view(kind=KINDS[new]))
        self._plane.on_change('active', lambda attr, old, new: self._turn(PLANES[new]))
        home = Button(name='home', label='whole plane', width=100)
        home.on_click(self._go_home)
        save = Button(name='save', label='save this view', width=110, button_type='primary')
        save.on_click(lambda: self._saving.begin(self._shown.view))
        send = Button(name='send', label='send to the simulator', width=160,
                      button_type='success')
        send.on_click(self._send)
        self._compare.on_change('active', self._toggle)
        self._layers.on_change('active', lambda attr, old, new: self._ask(
            lambda: dataclasses.replace(self._shown, layers=tuple(LAYERS[k] for k in new))))
        title = Div(text=f'<b style="font-size:15px">{TITLE}</b>', width=140)
        left = column(row(title, self._kind, home, self._compare), self._pane.layout,
                      *([self._map.figure] if self._map else []))
        # What gives way to the second plane.
        self._first = column(
            row(*controls[1:3]), row(*controls[3:]),
            row(Div(text='initial conditions', width=110), self._plane), self._figures.motion,
            row(self._figures.section, self._figures.sequence))
        which = Select(name='which', value=self._shown.which, width=RIGHT_WIDTH, options=[
            (name, f'the second plane has another {words}')
            for name, (words, *_) in SECOND.items()])
        which.on_change('value', lambda attr, old, new: self._choose(new))
        words, low, high, step = SECOND[self._shown.which]
        self._other = column(which, self._control('beside', words, (low, high), step))
        self._second = column(self._other, visible=False)
        right = column(
            controls[0], self._first, self._second, row(self._layers, send, save), self._message,
            self._address)
        self._document.add_root(row(left, right, spacing=8))
        self._document.title = TITLE

    def _control(self, name: str, title: str, bounds: tuple[float, float], step: float) -> Row:
        # A slider, whose range follows what is typed beside it.
        value = self._value(name)
        width = RIGHT_WIDTH if name in ('alpha', 'beside') else RIGHT_WIDTH // 2 - 6
        slider = Slider(name=name, title=title, start=min(bounds[0], value),
                        end=max(bounds[1], value), step=step, value=value, format='0.000',
                        width=width - 110)
        typed = NumericInput(name=f'exact_{name}', value=value, mode='float', width=86,
                             margin=(14, 5, 0, 5))
        slider.on_change('value', functools.partial(self._set, name))
        typed.on_change('value', functools.partial(self._set, name))
        self._sliders[name], self._typed[name] = slider, typed
        return row(slider, typed)

    def _value(self, name: str) -> float:
        view, beside = self._shown.view, self._shown.beside
        if name == 'beside':
            return float(getattr(view.parameters, self._shown.which)) if beside is None else beside
        if name in MODEL:
            return float(getattr(view.parameters, name))
        value = getattr(view, name)
        return value if isinstance(value, float) else 0.0

    def _show(self, shown: Shown) -> None:
        """Show something else, as far as it differs; the address follows."""
        before, self._shown = self._shown, shown
        self._address.text = '?' + shown.query()
        if shown != before:
            self._ask_panes()

    def _ask(self, change: Callable[[], Shown]) -> bool:
        """Show something else; return whether that can be."""
        try:
            self._show(change())
        except ValueError as error:
            self._report(str(error), False)
            return False
        return True

    def _ask_view(self, **changes: object) -> None:
        self._ask(lambda: dataclasses.replace(self._shown, view=dataclasses.replace(
            self._shown.view, **changes)))  # type: ignore[arg-type]

    def _set(self, name: str, attr: str, old: float | None, value: float | None) -> None:
        """Take what is slid or typed; the clicked point moves on with it."""
        if value is not None and value != self._value(name):
            wanted, shown = float(value), self._shown
            if name == 'beside':
                self._ask(lambda: dataclasses.replace(shown, beside=wanted))
            elif self._ask(lambda: dataclasses.replace(
                    shown, view=changed(shown.view, name, wanted))):
                self._click(*self._shown.point)
        self._match(name)

    def _match(self, name: str) -> None:
        value, slider = self._value(name), self._sliders[name]
        # Their own callbacks then find nothing new.
        slider.update(start=min(slider.start, value), end=max(slider.end, value), value=value)
        self._typed[name].value = value

    def _choose(self, which: str) -> None:
        """Let the second plane differ in another parameter; at first it is that of the first."""
        shown = self._shown
        beside = None if shown.beside is None else float(getattr(shown.view.parameters, which))
        self._show(dataclasses.replace(shown, which=which, beside=beside))
        value, (title, low, high, step) = self._value('beside'), SECOND[which]
        self._sliders['beside'].update(title=title, start=min(low, value), end=max(high, value),
                                       step=step, value=value)
        self._typed['beside'].value = value

    def _toggle(self, attr: str, old: bool, new: bool) -> None:
        self._show(dataclasses.replace(
            self._shown, beside=float(self._typed['beside'].value) if new else None))

    def _ask_panes(self) -> None:
        """Show the plane, and the second one or the trajectory in its place."""
        shown, view = self._shown, self._shown.second
        if self._map:
            self._map.mark(shown.view.parameters)
        self._pane.ask(shown.view, shown.point, shown.layers)
        self._second.visible = view is not None
        self._first.visible = view is None
        if view is None:
            if self._beside:
                self._beside.stop()
                self._beside, self._second.children = None, [self._other]
            return
        if self._beside is None:
            plane = PlaneFigure(view, self._move, self._click,
                                self._pane.plane.figure, '_beside', self._shared.gears)
            plane.mark(*self._shown.point)
            # What has a letter has one colour everywhere; others keep that of the first plane.
            self._beside = Pane(self._document, plane, self._shared.catalogues, self._is_open,
                                self._pane.colours, '_beside')
            self._second.children = [self._other, self._beside.layout]
        self._beside.ask(view, shown.point, shown.layers)

    def _turn(self, on: str) -> None:
        """Show another plane, through the initial condition of the trajectory."""
        view = self._shown.view
        view, point = view.turned(on, view.state(*self._shown.point))
        self._show(dataclasses.replace(self._shown, view=view, point=point))
        self._pane.plane.lay(view)
        self._pane.plane.go_to(view.window, view.velocity)
        self._show_fixed()
        self._click(*point)

    def _show_fixed(self) -> None:
        for name, control in self._fixed.items():
            control.visible = isinstance(getattr(self._shown.view, name), float)
            self._match(name)

    def _move(self, across: Window, velocity: Window) -> None:
        self._ask(lambda: dataclasses.replace(
            self._shown, view=self._shown.view.moved(across, velocity)))

    def _go_home(self) -> None:
        view = self._shown.view.whole(self._shown.view.kind)
        self._pane.plane.go_to(view.window, view.velocity)
        self._move(view.window, view.velocity)

    def _click(self, across: float, velocity: float) -> None:
        view = self._shown.view
        for pane in filter(None, (self._pane, self._beside)):
            pane.plane.mark(across, velocity)
        try:
            state = view.state(across, velocity)
            self._trajectory = follow(
                view.parameters, state.phase, state.displacement, state.velocity)
        except ValueError as error:
            self._report(str(error), False)
            return
        self._show(dataclasses.replace(self._shown, point=(across, velocity)))
        self._figures.show(self._trajectory)
        self._figures.motion.title.text = self._words(self._trajectory)

    @staticmethod
    def _words(trajectory: Trajectory) -> str:
        state = trajectory.state
        words = (f'motion from phase {state.phase:.10g}, s = {state.displacement:g}, velocity '
                 f'{state.velocity:.10g}')
        impacts = counted(len(trajectory.phases), 'impact')
        if trajectory.rests:
            return f'{words}: permanently at rest after {impacts}'
        if trajectory.sticks:
            words += f': sticks {counted(trajectory.sticks, "time")} in {impacts}'
        return words

    def _send(self) -> None:
        trajectory, parameters = self._trajectory, self._shown.view.parameters
        if trajectory is None:
            self._report('click a point first', False)
            return
        self._report('looking for the simulator ...', True)
        threading.Thread(daemon=True, target=lambda: self._report_later(
            *self._shared.link.send(trajectory.state, parameters))).start()

    def _report(self, text: str, is_good: bool) -> None:
        colour = '#222' if is_good else '#b22e18'
        self._message.text = f'<span style="color:{colour}">{html.escape(text)}</span>'

    def _report_later(self, text: str, is_good: bool) -> None:
        self._document.add_next_tick_callback(lambda: self._report(text, is_good))
