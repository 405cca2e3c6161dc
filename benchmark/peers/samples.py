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

"""Independent samples of long trajectories, two-sample tests of them, and paths side by side."""

import math

import numpy as np

from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.flight.tangent import flight_matrix, impact_matrix
from gear_rattle_ros.core.model import EventArray, EventKind, Model, Parameters, State

from .chains import STRONG, TWO_PI

Array = np.ndarray
# What one trajectory contributes. Averages are over the second half of its strong impacts.
STATISTICS = ('velocity', 'phase', 'phase by the wall', 'flight time', 'impacts per period',
              'energy lost per period', 'share of rest', 'impacts until the end')
# Numbers are compared as multiples of it: on periodic orbits many trajectories have the same
# ones but for the error of the integrator, which does not change the distribution.
GRAIN = 1e-4
# Where p is small, enough of them for Holm over 24 settings at 1 %.
SHUFFLES, MORE = 1000, 3000
# Number of quantiles at which distribution functions are compared.
PLACES = 41
# Events of one trajectory, far more than any has here.
CAP = 200_000
# Paths are compared as long as the tangent has not grown an error more than this.
GROWTH = 100.0


def random_states(count: int, seed: int) -> Array:
    """Return rows of phase, displacement and velocity."""
    random = np.random.default_rng(seed)
    return np.stack([random.uniform(0.0, TWO_PI, count), random.uniform(-1.0, 0.0, count),
                     random.normal(0.0, 1.0, count)], axis=1)


def events_of(state: Array, setting: Array, most: int, periods: int) -> EventArray:
    """Return the events of a trajectory, up to its last strong impact or the end of its time."""
    simulation = Simulation(Parameters(*setting.tolist()), State(0, *state.tolist()))
    pieces, strong, count = [], 0, 0
    while strong < most:
        piece = simulation.advance(periods, 0.0, 2 * most)
        pieces.append(piece)
        count += len(piece)
        strong += np.count_nonzero(is_strong(piece))
        if len(piece) < 2 * most:
            break
        if count > CAP:
            raise RuntimeError(f'more than {CAP} events from {state} at {setting}')
    events = np.concatenate(pieces)
    return events[:np.flatnonzero(np.cumsum(is_strong(events)) == most)[0] + 1
                  if strong >= most else len(events)]


def is_strong(events: EventArray) -> Array:
    """Return which events are impacts that count."""
    return (events['kind'] <= EventKind.STICK) & (np.abs(events['velocity']) >= STRONG)


def times(events: EventArray) -> Array:
    """Return tau of events."""
    return events['cycle'] * TWO_PI + events['phase']


def rows_of(number: int, events: EventArray) -> Array:
    """Return the rows of a trajectory, as the peers write them."""
    tau = times(events)
    released = events['kind'] == EventKind.RELEASE
    rest = np.cumsum(np.where(released, np.diff(tau, prepend=0.0), 0.0))
    strong = is_strong(events)
    return np.stack([np.full(len(events), float(number)), tau, events['velocity'], rest],
                    axis=1)[strong]


def own_rows(states: Array, setting: Array, most: int, periods: int) -> Array:
    """Follow every initial condition here."""
    return np.concatenate([rows_of(number, events_of(state, setting, most, periods))
                           for number, state in enumerate(states)])


def samples(rows: Array, count: int, restitution: float) -> Array:
    """Return the statistics of every trajectory, a row each; in multiples of GRAIN."""
    result = np.full((count, len(STATISTICS)), -1.0)
    edges = np.searchsorted(rows[:, 0], np.arange(count + 1))
    for k in range(count):
        _, tau, velocity, rest = rows[edges[k]:edges[k + 1]].T
        result[k, -1] = len(tau)
        if len(tau) < 2:
            # At rest or floating nearly at once, permanently: it has no other statistics.
            continue
        half = (len(tau) - 1) // 2
        periods = (tau[-1] - tau[half]) / TWO_PI
        loss = 0.5 * (1.0 - restitution**2) * np.sum(velocity[half + 1:]**2)
        by_wall = tau[-1] if velocity[-1] > 0.0 else tau[-1] + math.pi
        result[k, :-1] = (velocity[-1], tau[-1] % TWO_PI, by_wall % TWO_PI, tau[-1] - tau[-2],
                          (len(tau) - 1 - half) / periods, loss / periods,
                          (rest[-1] - rest[half]) / periods / TWO_PI)
    return np.round(result / GRAIN)


def distances(labels: Array, below: Array, ranks: Array) -> Array:
    """Return Kolmogorov-Smirnov distances and differences of mean ranks, for rows of labels."""
    size = labels.sum(1, keepdims=True)
    here = labels @ below
    steps = np.abs(here / size - (below.sum(0) - here) / (labels.shape[1] - size))
    return np.concatenate([steps.reshape(len(labels), -1, PLACES).max(2), np.abs(labels @ ranks)],
                          axis=1)


def compare(one: Array, two: Array, random: np.random.Generator) -> tuple[float, str]:
    """
    Test whether two samples are of one distribution; returns p and where they differ most.

    A permutation test, exact whatever the distributions: labels of trajectories are shuffled,
    and the largest of all distances, each in its own standard deviations, is compared with that
    of the samples as they are. Ties are broken by chance, so p is uniform.
    """
    pooled = np.concatenate([one, two])
    at = np.quantile(pooled, np.linspace(0.0, 1.0, PLACES), axis=0, method='lower')
    below = (pooled[:, :, None] <= at.T).reshape(len(pooled), -1).astype(np.float32)
    ranks = np.empty(pooled.shape, np.float32)
    for k in range(pooled.shape[1]):
        _, place, copies = np.unique(pooled[:, k], return_inverse=True, return_counts=True)
        ranks[:, k] = (np.cumsum(copies) - 0.5 * copies)[place] - 0.5 * len(pooled)
    as_is = np.arange(len(pooled)) < len(one)
    p, worst = 1.0, ''
    for shuffles in (SHUFFLES, MORE):
        found = [distances(as_is[None].astype(np.float32), below, ranks)]
        for _ in range(shuffles // 100):
            labels = random.permuted(np.tile(as_is, (100, 1)), axis=1).astype(np.float32)
            found.append(distances(labels, below, ranks))
        every = np.concatenate(found)
        spread = every.std(0)
        score = (every - every.mean(0)) / np.where(spread > 1e-6 * every.max(), spread, np.inf)
        largest = score.max(1)
        p = (np.sum(largest[1:] > largest[0])
             + random.uniform() * np.sum(largest == largest[0])) / len(largest)
        worst = STATISTICS[int(score[0].argmax()) % len(STATISTICS)]
        if p > 0.02:
            break
    return float(p), worst


def comparable(events: EventArray, setting: Array) -> Array:
    """Return which strong impacts of a trajectory have grown no error beyond GROWTH yet."""
    alpha, beta, gamma, restitution = setting.tolist()
    strong, tau = is_strong(events), times(events)
    result = []
    # From every event so far to now; an error may be made at each.
    grown = np.eye(2)[None]
    for k in range(1, len(events)):
        event = events[k]
        if event['kind'] == EventKind.RELEASE:
            continue
        integral, decay = flight_matrix(tau[k] - tau[k - 1], beta)
        grown = np.array([[1.0, integral], [0.0, decay]]) @ grown
        velocity = float(event['velocity'])
        force = alpha + abs(gamma) + beta * (abs(velocity) + alpha)
        if np.abs(grown).sum(2).max() * (1.0 + (1.0 + force) / abs(velocity)) > GROWTH:
            break
        if strong[k]:
            result.append(k)
        if event['kind'] == EventKind.STICK:
            # All is forgotten.
            grown = np.zeros((0, 2, 2))
        else:
            one, two, three = impact_matrix(
                float(event['phase']), velocity, float(event['velocity_after']),
                Model(alpha, beta, gamma, restitution))
            grown = np.array([[one, 0.0], [two, three]]) @ grown
        grown = np.concatenate([grown, np.eye(2)[None]])
    return np.array(result, dtype=int)


def path_errors(states: Array, setting: Array, theirs: Array, most: int,
                periods: int) -> tuple[int, float]:
    """Follow states of a peer here; how many impacts are compared, and the largest difference."""
    count, worst = 0, 0.0
    edges = np.searchsorted(theirs[:, 0], np.arange(len(states) + 1))
    for number, state in enumerate(states):
        events = events_of(state, setting, most, periods)
        chosen = comparable(events, setting)
        other = theirs[edges[number]:edges[number + 1]]
        if len(other) < len(chosen):
            return count, math.inf
        if len(chosen):
            mine = np.stack([times(events), events['velocity']], axis=1)[chosen]
            worst = max(worst, float(np.abs(mine - other[:len(chosen), 1:3]).max()))
            count += len(chosen)
    return count, worst
