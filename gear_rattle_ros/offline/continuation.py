"""Attractors and their shares followed across alpha; where each appears, doubles and vanishes."""

import argparse
from collections.abc import Callable
import dataclasses
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from .cli import (
    add_model,
    add_plane,
    add_run,
    add_seed,
    attempt,
    model_of,
    number,
    Parser,
    plane_of,
    run_of,
    say_interrupted,
    whole,
)
from .ensembles import Followers, run_ensemble, settle, Settled, Window
from .orbit_diagram import compute, Diagram, KINDS
from .store import Store
from .tracks import spread
from ..core.branches import Change, follow, Turn
from ..core.closed_orbits import close_orbit, double, PeriodicOrbit
from ..core.lanes_step import LANES

FloatArray = npt.NDArray[np.float64]
ORBIT: Final = KINDS.index('orbit')
# Doublings followed of each orbit, and the longest period [impacts].
DOUBLINGS: Final = 6
LONGEST: Final = 256
FEIGENBAUM: Final = 4.669
# Sizes tried for the orbit just beyond a doubling, and how far beyond it, in alpha [1].
AMPLITUDES: Final = (1e-3, 3e-3, 1e-2, 3e-2)
BEYOND: Final = 2e-5
# Orbits are followed so far outside the window for their beginning [1].
OUTSIDE: Final = 0.2
# An attractor seen over fewer columns is not followed.
FEWEST: Final = 3
# A trajectory has left an attractor where it meets velocities so far from it [1].
AWAY: Final = 0.03
BINS: Final = 1200


@dataclasses.dataclass(frozen=True)
class Event:
    """
    Where an attractor changes.

    Attributes
    ----------
    attractor : int
        Its number.
    what : str
        fold, doubling, torus, grazing, vanishes.
    alpha, tolerance : float
        Where, and how well that is located [1].
    period_impacts, period_drive : int
        Of the orbit that changes; 0 off an orbit.
    multiplier : complex
        Its larger multiplier there [1], nan off an orbit.

    """

    attractor: int
    what: str
    alpha: float
    tolerance: float
    period_impacts: int = 0
    period_drive: int = 0
    multiplier: complex = complex(math.nan)

    def describe(self) -> str:
        """
        Put it in words.

        Returns
        -------
        str
            One line.

        """
        orbit = ''
        if self.period_impacts:
            orbit = (f'  orbit of {self.period_impacts} impacts in {self.period_drive} drive '
                     f'periods, multiplier {self.multiplier.real:+.6f}')
        return (f'attractor {self.attractor + 1}: {self.what:9s} at alpha = {self.alpha:.10f} +- '
                f'{self.tolerance:.0e}{orbit}')


def events_of(diagram: Diagram, store: Store, tolerance: float, hold: int,
              told: Callable[[Event], None] = lambda event: None) -> list[Event]:
    """
    Locate where the attractors of a diagram appear, double and vanish.

    Parameters
    ----------
    diagram : Diagram
        The diagram, with the sweep from starts.
    store : Store
        Complete.
    tolerance : float
        In alpha [1].
    hold : int
        An attractor lasts where `LANES` trajectories stay for so many impacts.
    told : callable
        Is told of every event when it is found.

    Returns
    -------
    list of Event
        Attractor by attractor, in the order of alpha.

    """
    numbers = store.read_all('attractor')[diagram.sweeps.index('starts')]
    kinds = store.read_all('kind')[diagram.sweeps.index('starts')]
    periods = store.read_all('period_impacts')[diagram.sweeps.index('starts')]
    events: list[Event] = []
    for n in range(int(numbers.max()) + 1):
        columns, slots = np.nonzero(numbers == n)
        if len(columns) < FEWEST:
            continue
        found: list[Event] = []
        regular = [i for i in range(len(columns)) if kinds[columns[i], slots[i]] == ORBIT]
        if regular:
            least = min(regular, key=lambda i: (periods[columns[i], slots[i]], columns[i]))
            same = [i for i in regular
                    if periods[columns[i], slots[i]] == periods[columns[least], slots[least]]]
            middle = same[len(same) // 2]
            one = settled_at(diagram, int(columns[middle]), int(slots[middle]))
            if one.orbit is not None:
                found += _events_of_orbit(n, one.orbit, diagram, tolerance)
        for event in sorted(found, key=lambda event: event.alpha):
            told(event)
        last = int(columns[-1])
        if last < diagram.columns - 1:
            one = settled_at(diagram, last, int(slots[-1]))
            end = find_end(n, one, diagram, last, tolerance, hold)
            found.append(end)
            told(end)
        events += sorted(found, key=lambda event: event.alpha)
    return events


def settled_at(diagram: Diagram, column: int, slot: int) -> Settled:
    """
    Compute a column again and take one of its attractors.

    Parameters
    ----------
    diagram : Diagram
        The diagram.
    column, slot : int
        Which column, and which of its attractors.

    Returns
    -------
    Settled
        The attractor.

    """
    return settle(run_ensemble(diagram.starts(column), diagram.at(column), diagram.window))[slot]


def _events_of_orbit(n: int, orbit: PeriodicOrbit, diagram: Diagram,
                     tolerance: float) -> list[Event]:
    low, high = diagram.alphas[0] - OUTSIDE, diagram.alphas[1] + OUTSIDE
    low = max(low, 0.0)
    events = []
    for direction in (-1.0, 1.0):
        branch = follow(orbit, direction, low, high, tolerance=tolerance)
        if not branch.turns:
            continue
        # What happens to the orbit later, once it is unstable, is no event of the attractor.
        first = branch.turns[0]
        events.append(_event(n, first))
        if first.change is Change.DOUBLING:
            events += cascade(n, first.orbit, direction, tolerance)
    return events


def _event(n: int, turn: Turn) -> Event:
    orbit = turn.orbit
    sign = -1.0 if turn.change is Change.DOUBLING else 1.0
    nearest = min(orbit.multipliers, key=lambda m: abs(m - sign))
    return Event(n, turn.change.value, turn.alpha, turn.uncertainty, orbit.period_impacts,
                 orbit.period_drive, complex(nearest))


def cascade(n: int, orbit: PeriodicOrbit, direction: float, tolerance: float,
            doublings: int = DOUBLINGS) -> list[Event]:
    """
    Follow a cascade of doublings.

    Parameters
    ----------
    n : int
        Number of the attractor.
    orbit : PeriodicOrbit
        At its doubling.
    direction : float
        Sign of the step in alpha beyond which the doubled orbit is stable.
    tolerance : float
        In alpha [1].
    doublings : int
        How many are followed at the most.

    Returns
    -------
    list of Event
        The doublings that follow.

    """
    events: list[Event] = []
    step, longest = BEYOND, 0.02
    for _ in range(doublings):
        doubled = _doubled(orbit, direction * step)
        if doubled is None or doubled.period_impacts > LONGEST:
            break
        alpha = doubled.parameters.alpha
        branch = follow(doubled, direction, alpha - 0.1, alpha + 0.1, tolerance=tolerance,
                        longest=longest, past_doublings=False)
        if not branch.turns or branch.turns[0].change is not Change.DOUBLING:
            break
        events.append(_event(n, branch.turns[0]))
        # The next one is nearer by Feigenbaum's number; velocities part as the square root.
        gap = abs(events[-1].alpha - orbit.parameters.alpha) / FEIGENBAUM
        step, longest = max(0.02 * gap, 1e-9), 0.1 * math.sqrt(gap)
        orbit = branch.turns[0].orbit
    return events


def _doubled(orbit: PeriodicOrbit, step: float) -> PeriodicOrbit | None:
    beyond = dataclasses.replace(orbit.parameters, alpha=orbit.parameters.alpha + step)
    for amplitude in AMPLITUDES:
        found = close_orbit(*double(orbit, amplitude), beyond)
        if found is not None and found.period_impacts == 2 * orbit.period_impacts:
            return found
    return None


def find_end(n: int, one: Settled, diagram: Diagram, column: int, tolerance: float,
             hold: int) -> Event:
    """
    Locate where trajectories no longer stay on an attractor, by bisection.

    Near a crisis they stay long: where `LANES` of them stay for `hold` impacts it is taken to
    last, so the end may be a little early or late by that.

    Parameters
    ----------
    n : int
        Number of the attractor.
    one : Settled
        The attractor at a column.
    diagram : Diagram
        The diagram.
    column : int
        The last column where it was seen.
    tolerance : float
        In alpha [1].
    hold : int
        Impacts.

    Returns
    -------
    Event
        Its end.

    """
    window = dataclasses.replace(diagram.window, skip=1, keep=max(256, hold), bins=BINS)
    starts = diagram.starts(column)[one.members][:LANES]
    followers = Followers(starts)
    seen = followers.run(diagram.at(column), dataclasses.replace(diagram.window, bins=BINS))
    states = followers.states()
    reach = max(1, round(AWAY * BINS / (window.high - window.low)))
    inside = spread(seen.counts.sum(axis=0), reach) > 0.0

    def lasts(alpha: float) -> bool:
        again = Followers(_with_states(starts, states))
        ran = again.run(dataclasses.replace(diagram.parameters, alpha=alpha), window)
        return not np.any(ran.counts[:, ~inside]) and not ran.rests.any()

    low, high = float(diagram.values[column]), float(diagram.values[column + 1])
    step = high - low
    while lasts(high) and high < diagram.alphas[1]:
        low, high = high, high + step
    while high - low > tolerance:
        middle = 0.5 * (low + high)
        if lasts(middle):
            low = middle
        else:
            high = middle
    return Event(n, 'vanishes', 0.5 * (low + high), 0.5 * (high - low))


def _with_states(starts: npt.NDArray[np.void], states: FloatArray) -> npt.NDArray[np.void]:
    # Few starts may reach it: each is used often enough to fill the lanes, a little apart.
    count = len(starts)
    again = np.repeat(starts, -(-LANES // count))[:LANES].copy()
    for k, name in enumerate(('phase', 'displacement', 'velocity')):
        again[name] = np.repeat(states[:count, k], -(-LANES // count))[:LANES]
    again['velocity'] *= 1.0 + 1e-6 * np.arange(len(again)) / LANES
    return again


def write_events(store: Store, events: list[Event]) -> None:
    """
    Write events as a table.

    Parameters
    ----------
    store : Store
        Receives them.
    events : list of Event
        The events.

    """
    one = {'units': '1'}
    columns: dict[str, tuple[Any, dict[str, str]]] = {
        'event_attractor': (np.array([e.attractor for e in events], np.int32), {
            'long_name': 'number of the attractor'}),
        'event_kind': (np.array([e.what for e in events], 'U10'), {
            'long_name': 'what happens'}),
        'event_alpha': (np.array([e.alpha for e in events]), {'long_name': 'where', **one}),
        'event_tolerance': (np.array([e.tolerance for e in events]), {
            'long_name': 'how well it is located', **one}),
        'event_period_impacts': (np.array([e.period_impacts for e in events], np.int32), {
            'long_name': 'period of the orbit', 'units': 'impacts'}),
        'event_period_drive': (np.array([e.period_drive for e in events], np.int32), {
            'long_name': 'period of the orbit', 'units': 'drive periods'}),
        'event_multiplier': (np.array([e.multiplier.real for e in events]), {
            'long_name': 'critical multiplier, real part', **one})}
    store.write_table({name: (('event',), values, attributes)
                       for name, (values, attributes) in columns.items()})


def _tell(event: Event) -> None:
    print(event.describe(), flush=True)


def main(arguments: list[str] | None = None) -> int:
    """
    Run the command `continuation`.

    Parameters
    ----------
    arguments : list of str, optional
        Without the program's name; by default those of the process.

    Returns
    -------
    int
        Exit status.

    """
    return attempt('continuation', lambda: _run(arguments))


def _run(arguments: list[str] | None) -> int:
    parser = Parser('continuation', description='Follow attractors and their shares across alpha; '
                    'locate where they appear, double and vanish.')
    parser.add_argument('--alpha', type=number, nargs=2, default=[0.47, 0.60],
                        metavar=('A', 'B'), help='window of alpha [1]; 0.47 0.60 by default')
    add_model(parser, names=('beta', 'gamma', 'restitution'))
    parser.add_argument('--columns', type=whole(2), default=131, metavar='N',
                        help='amplitudes; 131 by default')
    parser.add_argument('--trajectories', type=whole(1), default=256, metavar='N',
                        help='at each alpha; 256 by default')
    parser.add_argument('--skip', type=whole(1), default=4000, metavar='N',
                        help='impacts passed over; 4000 by default')
    parser.add_argument('--keep', type=whole(256), default=512, metavar='N',
                        help='impacts looked at then; 512 by default')
    parser.add_argument('--tolerance', type=number, default=1e-7, metavar='X',
                        help='in alpha [1]; 1e-7 by default')
    parser.add_argument('--hold', type=whole(256), default=100_000, metavar='N',
                        help='an attractor lasts where trajectories stay for so many impacts; '
                        '100000 by default')
    add_plane(parser, size=None)
    add_seed(parser)
    add_run(parser)
    given = parser.parse_args(arguments)
    if not 1e-12 <= given.tolerance <= 1e-2:
        raise ValueError(f'--tolerance {given.tolerance:g} is not between 1e-12 and 1e-2')
    diagram = Diagram(
        model_of(argparse.Namespace(**{k: v for k, v in vars(given).items() if k != 'alpha'})),
        (given.alpha[0], given.alpha[1]), given.columns, plane_of(given), given.trajectories,
        given.seed, Window(given.skip, given.keep, bins=BINS), ('starts',))
    run = run_of(parser, given, arguments, 'continuation.zarr')
    try:
        store, complete = compute(diagram, run)
        if not complete:
            raise KeyboardInterrupt
        events = events_of(diagram, store, given.tolerance, given.hold, _tell)
    except KeyboardInterrupt:
        store = Store(run.output)
        return say_interrupted(run, len(store.tiles) - len(store.pending()), len(store.tiles))
    write_events(store, events)
    print(f'continuation: {run.output}')
    if run.picture is not None:
        # Only here: matplotlib takes a second to import.
        from .figures_diagrams import draw_shares
        from .figures_style import save
        save(draw_shares(store), run.picture)
        print(f'continuation: {run.picture}')
    return 0
