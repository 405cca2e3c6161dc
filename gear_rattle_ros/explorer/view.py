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

"""What the page shows: model, window, kind of picture; independent of any toolkit."""

import dataclasses
import math
from typing import Any, Final

from ..attractors.plane import DISPLACEMENT, Plane, STATE, STROBE, TWO_PI, Window
from ..core.model import Parameters, State

BASINS: Final = 'basins'
LIFETIMES: Final = 'lifetimes'
EXPONENTS: Final = 'exponents'
KINDS: Final = (BASINS, LIFETIMES, EXPONENTS)
# Impacts after which a trajectory counts as unsettled, and those in a finite-time exponent.
CAP: Final = 5_000
SPAN: Final = 50
# Initial conditions of the search for attractors, and impacts for which they are followed.
DRAWN: Final = 256
HOLD: Final = 20_000
# Cells along an edge: first, usually last, and where there is time.
COARSEST: Final = 50
FINE: Final = 400
FINEST: Final = 800
# Levels that would take less are skipped [s]; the finest is left out if it would take longer [s].
AT_ONCE: Final = 0.3
PATIENCE: Final = 8.0
# Neighbouring cells must differ by at least this many roundings of float64.
ROUNDINGS: Final = 8
# The narrowest window that follows from it, in both directions [rad, 1].
NARROWEST: Final = FINE * ROUNDINGS * math.ulp(TWO_PI)
# Bounds of panning [rad, 1].
PHASE_BOUND: Final = 900.0
VELOCITY_BOUND: Final = 9000.0


@dataclasses.dataclass(frozen=True)
class View:
    """A picture of one of `KINDS` over a window of a plane [rad, 1]."""

    parameters: Parameters = Parameters()
    displacement: float | Window | None = None
    phase: float | Window | None = None
    velocity: Window = (-2.0, 2.0)
    kind: str = BASINS
    on: str = DISPLACEMENT  # the kind of the plane

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f'kind {self.kind!r} is not one of {", ".join(KINDS)}')
        plane = self.plane(1)
        for name in ('displacement', 'phase', 'velocity'):
            object.__setattr__(self, name, getattr(plane, name))

    def plane(self, cells: int) -> Plane:
        """Cut the window into cells."""
        return Plane(self.displacement, self.phase, self.velocity, cells, cells, self.on)

    @property
    def window(self) -> Window:
        """Return its window in phase, or on a strobe in displacement."""
        return self.plane(1).window

    def moved(self, across: Window, velocity: Window) -> 'View':
        """Return the view with another window."""
        windows: dict[str, Any] = {self.plane(1).across: across, 'velocity': velocity}
        return dataclasses.replace(self, **windows)

    def whole(self, kind: str) -> 'View':
        """Return a picture of the whole plane."""
        plane = self.plane(1).whole()
        return View(self.parameters, plane.displacement, plane.phase, plane.velocity, kind,
                    self.on)

    def state(self, across: float, velocity: float) -> State:
        """Return the initial condition of a point."""
        (initial,) = self.plane(1).at(self.parameters, [across], [velocity])
        return State(0, *(float(initial[name]) for name in STATE))

    def turned(self, on: str, state: State) -> tuple['View', tuple[float, float]]:
        """Return the whole of another plane through a state, and the point of the state."""
        fixed: dict[str, Any] = {DISPLACEMENT: {'displacement': state.displacement},
                                 STROBE: {'phase': state.phase}}.get(on, {})
        view = View(self.parameters, kind=self.kind, on=on, **fixed)
        return view, (getattr(state, view.plane(1).across), state.velocity)

    def finest(self) -> int:
        """Return how many cells along an edge float64 can resolve in this window."""
        return min(int((high - low) / (ROUNDINGS * math.ulp(max(abs(low), abs(high)))))
                   for low, high in (self.window, self.velocity))

    def limit(self) -> str:
        """Return a line where float64 ends; nothing where there is room to zoom in."""
        width = min(self.window[1] - self.window[0], self.velocity[1] - self.velocity[0])
        # The next step of the wheel must not lead beyond.
        if width >= 1.6 * NARROWEST and self.finest() >= 1.6 * FINE:
            return ''
        apart = ROUNDINGS * self.finest() / FINE
        return (f'float64 ends here: in a window {width:.1e} wide, {FINE} cells on a side lie '
                f'only {apart:.0f} roundings apart. Zoom out, or go elsewhere.')

    def command(self, output: str, picture: str) -> list[str]:
        """Return the command that computes this view into a store and draws it."""
        model = [word for name, value in dataclasses.asdict(self.parameters).items()
                 for word in (f'--{name}', repr(value))]
        own = ['--impacts', str(SPAN)] if self.kind == EXPONENTS else [
            '--cap', str(CAP), '--initial-conditions', str(DRAWN), '--hold', str(HOLD)]
        windows = [word for name in STATE if (value := getattr(self, name)) is not None for word in
                   (f'--{name}', *map(repr, value if isinstance(value, tuple) else (value,)))]
        return [self.kind, *model, '--plane', self.on, *windows,
                '--size', str(min(FINE, self.finest())), *own, '--output', output,
                '--picture', picture]


def following(cells: int, seconds: float, view: View) -> int:
    """Return the edge of the next finer level [cells]; 0 if this one is fine enough."""
    per_cell = seconds / cells**2
    wanted = 2 * cells
    while wanted < FINE and per_cell * (2 * wanted)**2 < AT_ONCE:
        wanted *= 2
    wanted = min(wanted, FINE) if cells < FINE else wanted
    if wanted > min(FINEST, view.finest()) or (wanted > FINE and per_cell * wanted**2 > PATIENCE):
        return 0
    return wanted
