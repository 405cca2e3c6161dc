"""Where the attractors of an orbit diagram appear, double and end."""

from collections.abc import Callable, Iterator
import dataclasses
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from .diagram import Diagram, KINDS
from .ensembles import Followers, run_ensemble, settle, Settled
from .store import Store
from .tracks import spread
from ..core.branches import Change, follow, Turn
from ..core.closed_orbits import close_orbit, double, Orbit
from ..core.lanes_step import LANES

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]
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
# To follow an orbit and its doublings counts as so many searches.
FOLLOWING: Final = 5
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
              told: Callable[[Event], None] = lambda event: None,
              searched: Callable[[int], None] = lambda count: None) -> list[Event]:
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
    searched : callable
        Is told of the searches just done, of those that `searches_of` counts.

    Returns
    -------
    list of Event
        Attractor by attractor, in the order of alpha.

    """
    numbers = store.read_all('attractor')[diagram.sweeps.index('starts')]
    kinds = store.read_all('kind')[diagram.sweeps.index('starts')]
    periods = store.read_all('period_impacts')[diagram.sweeps.index('starts')]
    events: list[Event] = []
    halvings = _halvings(diagram, tolerance)
    for n, columns, slots in _lasting(numbers):
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
        searched(FOLLOWING)
        last = int(columns[-1])
        if last < diagram.columns - 1:
            one = settled_at(diagram, last, int(slots[-1]))
            left = [halvings]

            def tried(left: list[int] = left) -> None:
                # It may outlast its last column: that takes searches that were not foreseen.
                if left[0]:
                    left[0] -= 1
                    searched(1)

            end = find_end(n, one, diagram, last, tolerance, hold, tried)
            searched(left[0])
            found.append(end)
            told(end)
        events += sorted(found, key=lambda event: event.alpha)
    return events


def searches_of(diagram: Diagram, store: Store, tolerance: float) -> int:
    """
    Foresee how many searches `events_of` takes.

    Parameters
    ----------
    diagram : Diagram
        The diagram, with the sweep from starts.
    store : Store
        Complete.
    tolerance : float
        In alpha [1].

    Returns
    -------
    int
        One for each amplitude at which an end is looked for, some for each orbit followed.

    """
    numbers = store.read_all('attractor')[diagram.sweeps.index('starts')]
    return sum(FOLLOWING + _halvings(diagram, tolerance) * int(columns[-1] < diagram.columns - 1)
               for _, columns, _ in _lasting(numbers))


def _lasting(numbers: npt.NDArray[Any]) -> Iterator[tuple[int, IntArray, IntArray]]:
    # Number, columns and slots of each attractor that is seen often enough.
    for n in range(int(numbers.max()) + 1):
        columns, slots = np.nonzero(numbers == n)
        if len(columns) >= FEWEST:
            yield n, columns, slots


def _halvings(diagram: Diagram, tolerance: float) -> int:
    step = (diagram.alphas[1] - diagram.alphas[0]) / (diagram.columns - 1)
    return 1 + max(0, math.ceil(math.log2(step / tolerance)))


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


def _events_of_orbit(n: int, orbit: Orbit, diagram: Diagram,
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
    return Event(n, turn.change.value, turn.alpha, turn.uncertainty, orbit.impacts,
                 orbit.drive_periods, complex(nearest))


def cascade(n: int, orbit: Orbit, direction: float, tolerance: float,
            doublings: int = DOUBLINGS) -> list[Event]:
    """
    Follow a cascade of doublings.

    Parameters
    ----------
    n : int
        Number of the attractor.
    orbit : Orbit
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
        if doubled is None or doubled.impacts > LONGEST:
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


def _doubled(orbit: Orbit, step: float) -> Orbit | None:
    beyond = dataclasses.replace(orbit.parameters, alpha=orbit.parameters.alpha + step)
    for amplitude in AMPLITUDES:
        found = close_orbit(*double(orbit, amplitude), beyond)
        if found is not None and found.impacts == 2 * orbit.impacts:
            return found
    return None


def find_end(n: int, one: Settled, diagram: Diagram, column: int, tolerance: float,
             hold: int, tried: Callable[[], None] = lambda: None) -> Event:
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
    tried : callable
        Is called after every amplitude.

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
        tried()
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
