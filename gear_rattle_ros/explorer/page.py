"""One page: the present view, the figures, and the controls."""

from collections.abc import Callable
import dataclasses
import functools
import html
from pathlib import Path
import threading

from bokeh.document import Document
from bokeh.layouts import column, row
from bokeh.models import Button, Div, NumericInput, RadioButtonGroup, Slider

from .catalogues import Catalogues
from .computing import Picture
from .painting import Colours, legend
from .plane_figure import PlaneFigure, WIDTH
from .saving import Saving
from .simulator_link import SimulatorLink
from .trajectory import follow, Trajectory
from .trajectory_figures import TrajectoryFigures, WIDTH as RIGHT_WIDTH
from .view import KINDS, View
from .worker import Worker
from ..core.words import counted

TITLE = 'Gear rattle explorer'
# Phase [rad], displacement and velocity [1] of the first trajectory.
FIRST_POINT = (4.0, 0.0, -0.5)
# Name, title, range and step of each slider.
SLIDERS = (('alpha', 'α drive', 0.0, 2.0, 0.001), ('beta', 'β damping', 0.0, 1.0, 0.005),
           ('gamma', 'γ load', -0.5, 0.5, 0.005),
           ('restitution', 'r restitution', 0.0, 1.0, 0.005),
           ('displacement', 's₀ initial', -1.0, 0.0, 0.01))


@dataclasses.dataclass(frozen=True)
class Shared:
    """What the pages of a server share."""

    catalogues: Catalogues
    link: SimulatorLink
    folder: Path


class Page:
    """The page of one browser tab."""

    def __init__(self, document: Document, shared: Shared, view: View,
                 is_open: Callable[[], bool]) -> None:
        self._document = document
        self._shared = shared
        self._view = self._home = view
        self._colours = Colours()
        self._trajectory: Trajectory | None = None
        self._waiting: Picture | None = None
        self._lock = threading.Lock()
        self._plane = PlaneFigure(
            view, lambda phase, velocity: self._ask(phase=phase, velocity=velocity), self._click)
        self._figures = TrajectoryFigures()
        self._legend = Div(name='legend', width=WIDTH, height=36,
                           styles={'font-size': '12px', 'line-height': '1.5'})
        self._status = Div(name='status', width=WIDTH, height=20,
                           styles={'font-size': '12px', 'color': '#555'})
        self._message = Div(name='message', width=RIGHT_WIDTH, height=40, text=(
            'Drag to pan, turn the wheel to zoom, click a point to see its trajectory.'),
            styles={'font-size': '12.5px', 'overflow-wrap': 'anywhere'})
        self._kind = RadioButtonGroup(name='kind', labels=list(KINDS),
                                      active=KINDS.index(view.kind), width=270)
        self._sliders: dict[str, Slider] = {}
        self._alpha = NumericInput(name='exact_alpha', value=view.parameters.alpha, mode='float',
                                   low=0.0, high=1000.0, width=110, title='α exactly')
        self._saving = Saving(shared.folder, self._report_later)
        self._worker = Worker(shared.catalogues, self._offer, is_open)
        self._lay_out()
        self._worker.ask(view)
        phase, _, velocity = FIRST_POINT
        self._click(phase, velocity)

    def close(self) -> None:
        self._worker.stop()
        self._saving.stop()

    def _lay_out(self) -> None:
        for name, title, low, high, step in SLIDERS:
            wide = name == 'alpha'
            slider = Slider(name=name, title=title, start=low, end=high, step=step,
                            value=self._value(name), format='0.000',
                            width=RIGHT_WIDTH - 140 if wide else RIGHT_WIDTH // 4 - 14)
            slider.on_change('value', functools.partial(self._slide, name))
            self._sliders[name] = slider
        self._alpha.on_change('value', self._type_alpha)
        self._kind.on_change('active', lambda attr, old, new: self._ask(kind=KINDS[new]))
        home = Button(name='home', label='whole plane', width=100)
        home.on_click(self._go_home)
        save = Button(name='save', label='save this view', width=110, button_type='primary')
        save.on_click(lambda: self._saving.begin(self._view))
        send = Button(name='send', label='send the point to the simulator', width=220,
                      button_type='success')
        send.on_click(self._send)
        title = Div(text=f'<b style="font-size:15px">{TITLE}</b>', width=226)
        left = column(row(title, self._kind, home), self._plane.figure, self._legend, self._status)
        right = column(
            row(self._sliders['alpha'], self._alpha),
            row(*(self._sliders[name] for name, *_ in SLIDERS[1:])),
            self._figures.motion, row(self._figures.section, self._figures.sequence),
            row(send, save), self._message)
        self._document.add_root(row(left, right, spacing=8))
        self._document.title = TITLE

    def _value(self, name: str) -> float:
        owner = self._view if name == 'displacement' else self._view.parameters
        return float(getattr(owner, name))

    def _ask(self, **changes: object) -> None:
        try:
            view = dataclasses.replace(self._view, **changes)  # type: ignore[arg-type]
        except ValueError as error:
            self._report(str(error), False)
            return
        if view != self._view:
            self._view = view
            self._worker.ask(view)

    def _set(self, name: str, value: float) -> bool:
        """Ask for a view with another value, if it is one; the clicked point moves on with it."""
        if value == self._value(name):
            return False
        changes: dict[str, object] = {name: value}
        try:
            if name != 'displacement':
                changes = {'parameters': dataclasses.replace(
                    self._view.parameters, **{name: value})}
        except ValueError as error:
            self._report(str(error), False)
            return False
        self._ask(**changes)
        self._click(*self._clicked)
        return True

    def _slide(self, name: str, attr: str, old: float, new: float) -> None:
        if self._set(name, float(new)) and name == 'alpha':
            # Its own callback then finds nothing new.
            self._alpha.value = float(new)

    def _type_alpha(self, attr: str, old: float | None, value: float | None) -> None:
        if value is not None and self._set('alpha', value):
            slider = self._sliders['alpha']
            slider.update(end=max(slider.end, value), value=value)

    def _go_home(self) -> None:
        self._plane.go_to(self._home.phase, self._home.velocity)
        self._ask(phase=self._home.phase, velocity=self._home.velocity)

    def _click(self, phase: float, velocity: float) -> None:
        view = self._view
        self._plane.mark(phase, velocity)
        try:
            self._trajectory = follow(view.parameters, phase, view.displacement, velocity)
        except ValueError as error:
            self._report(str(error), False)
            return
        self._clicked = (phase, velocity)
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
        trajectory, parameters = self._trajectory, self._view.parameters
        if trajectory is None:
            self._report('click a point first', False)
            return
        self._report('looking for the simulator ...', True)
        threading.Thread(daemon=True, target=lambda: self._report_later(
            *self._shared.link.send(trajectory.state, parameters))).start()

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
        self._colours = self._colours.followed(picture.known)
        self._plane.show(picture, self._colours)
        self._legend.text = legend(picture, self._colours)
        view = picture.view
        limit = view.limit()
        done = '' if picture.done == 1.0 else f' ({picture.done:.0%})'
        more = '' if picture.is_last else ', refining'
        text = (f'{picture.cells} × {picture.cells}{done}{more}, {picture.seconds:.2f} s; window '
                f'{view.phase[1] - view.phase[0]:.3g} rad × '
                f'{view.velocity[1] - view.velocity[0]:.3g}')
        self._status.text = f'<b style="color:#b22e18">{limit}</b>' if limit else text

    def _report(self, text: str, is_good: bool) -> None:
        colour = '#222' if is_good else '#b22e18'
        self._message.text = f'<span style="color:{colour}">{html.escape(text)}</span>'

    def _report_later(self, text: str, is_good: bool) -> None:
        self._document.add_next_tick_callback(lambda: self._report(text, is_good))
