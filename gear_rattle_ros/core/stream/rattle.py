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

"""Rattle in numbers: how often and how hard the flanks hit, what that costs, its spectrum."""

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .guard import StreamGuard
from .lyapunov import has_stuck
from ..arrays import FloatArray, RecordArray
from ..compiled import kernel
from ..flight.elementary import TWO_PI
from ..gears import Scales
from ..model import EVENT, EventArray, EventKind

# Taps of the low-pass filter of a sound to each side of an impact.
TAPS: Final = 16


@dataclasses.dataclass(frozen=True)
class Rattle:
    """
    What a stretch of the motion does to the flanks, dimensionless; `in_si` has the units.

    Rates and speeds are those of impacts at or above a stated speed; all others count every
    impact, and forces the contact between impacts, too. Over whole periods of a periodic motion,
    and on average over any bounded one, ``force_upper - force_lower = gamma`` and
    ``power_in = power_lost + power_drag``.
    """

    duration: float  #: Length of the stretch.
    rate_upper: float = math.nan  #: Impacts per time on the upper flank, and on the lower.
    rate_lower: float = math.nan
    speed_rms: float = math.nan  #: Approach speed; nan without impacts.
    speed_mean: float = math.nan
    speed_peak: float = math.nan
    impulse_mean: float = math.nan  #: Impulse of an impact.
    impulse_peak: float = math.nan
    loss_mean: float = math.nan  #: Energy that an impact loses.
    loss_peak: float = math.nan
    contact_upper: float = math.nan  #: Share of the time in contact [1].
    contact_lower: float = math.nan
    force_upper: float = math.nan  #: Mean force on each flank, impacts included.
    force_lower: float = math.nan
    power_in: float = math.nan  #: What the driver gives to the driven gear at the flanks.
    power_lost: float = math.nan  #: What impacts lose.
    power_drag: float = math.nan  #: What the drag takes from the vibration of the driven gear.
    #: Share of the contact impulse that comes in impacts [1]: 0 in contact, 1 for free flights.
    rattle_index: float = math.nan

    @property
    def mode(self) -> str:
        """Return which flanks are hit: none, upper, lower or both."""
        return {(False, False): 'none', (True, False): 'upper', (False, True): 'lower'}.get(
            (self.rate_upper > 0.0, self.rate_lower > 0.0), 'both')

    def in_si(self, scales: Scales) -> dict[str, float]:
        """Return the same in SI units, which end the names."""
        units = {'duration': ('_s', scales.time_s), 'rate': ('_per_s', 1.0 / scales.time_s),
                 'speed': ('_m_per_s', scales.velocity_m_per_s),
                 'impulse': ('_n_s', scales.impulse_n_s), 'loss': ('_j', scales.energy_j),
                 'force': ('_n', scales.force_n),
                 'power': ('_w', scales.energy_j / scales.time_s)}
        found = {}
        for name, value in vars(self).items():
            suffix, unit = units.get(name.split('_')[0], ('', 1.0))
            found[name + suffix] = value * unit
        return found


@kernel
def held(events: RecordArray, is_held: npt.NDArray[np.bool_]) -> None:
    """Find between which events the gear is held by a wall."""
    for i in range(len(events) - 1):
        is_held[i] = has_stuck(events[i], events[i + 1])


@dataclasses.dataclass(frozen=True)
class _Intervals:
    """What happens between events and at the later of them, forces as of the gear on a flank."""

    before: EventArray
    after: EventArray
    tau: FloatArray  # of `before`, from the beginning of the first drive period
    length: FloatArray
    is_held: npt.NDArray[np.bool_]
    jump: FloatArray  # impulse at the end; 0 where there is no impact

    @classmethod
    def of(cls, events: EventArray) -> '_Intervals':
        events = np.ascontiguousarray(events)
        is_held = np.zeros(len(events), np.bool_)
        held(events, is_held)
        before, after = events[:-1], events[1:]
        tau = TWO_PI * (events['cycle'] - events['cycle'][:1]).astype(np.float64) + events['phase']
        return cls(before, after, tau[:-1], np.diff(tau), is_held[:-1], np.where(
            after['kind'] <= EventKind.STICK, after['velocity'] - after['velocity_after'], 0.0))


def rattle_of(events: EventArray, above: float = 0.0) -> Rattle:
    """
    Measure a stretch of the motion.

    Parameters
    ----------
    events : ndarray of EVENT, shape (n,)
        Records in order, none missing between them, no RESET but the first. The stretch is from
        the first to the last.
    above : float
        Approach speed from which impacts count for rates and speeds [1].

    """
    if len(events) < 2 or not (one := _Intervals.of(events)).length.sum() > 0.0:
        return Rattle(0.0)
    before, after, d, p = one.before, one.after, one.length, one.jump
    total = float(np.sum(d))
    alpha, beta, gamma = (before[name] for name in ('alpha', 'beta', 'gamma'))
    (sin_0, cos_0), (sin_1, cos_1) = (
        (np.sin(each['phase']), np.cos(each['phase'])) for each in (before, after))
    is_hit = after['kind'] <= EventKind.STICK
    is_upper = after['displacement'] == 0.0
    speed, slower = np.abs(after['velocity']), np.abs(after['velocity_after'])
    loss = 0.5 * (speed - slower) * (speed + slower)
    counts = is_hit & (speed >= above) & (speed > 0.0)

    def mean(values: FloatArray) -> float:
        return float(np.sum(values)) / total

    # The gear follows its flank while it is held, with the speed -alpha cos tau.
    force = np.where(one.is_held, gamma * d + alpha * (
        cos_1 - cos_0 + beta * (sin_1 - sin_0)), 0.0)
    # Energy of its own motion, which between impacts only load and drag change.
    load = gamma * (after['displacement'] - before['displacement'] - alpha * (sin_1 - sin_0))
    rise = 0.5 * ((after['velocity'] - alpha * cos_1)**2
                  - (before['velocity_after'] - alpha * cos_0)**2)
    drag = np.where(one.is_held, beta * alpha**2 * (
        0.5 * d + 0.5 * (sin_1 * cos_1 - sin_0 * cos_0)), load - rise)
    given = p * alpha * cos_1 + np.where(one.is_held, rise + drag - load, 0.0)
    impulses, losses, speeds = np.abs(p[is_hit]), loss[is_hit], speed[counts]
    pressed = float(np.sum(np.abs(force)))
    shaken = float(np.sum(impulses))
    some = {} if not len(impulses) else {
        'impulse_mean': float(np.mean(impulses)), 'impulse_peak': float(np.max(impulses)),
        'loss_mean': float(np.mean(losses)), 'loss_peak': float(np.max(losses))}
    if len(speeds):
        some |= {'speed_rms': math.sqrt(np.mean(speeds**2)),
                 'speed_mean': float(np.mean(speeds)), 'speed_peak': float(np.max(speeds))}
    return Rattle(
        total, mean(counts & is_upper), mean(counts & ~is_upper),
        contact_upper=mean(d[one.is_held & is_upper]),
        contact_lower=mean(d[one.is_held & ~is_upper]),
        force_upper=mean((p + force)[is_upper]), force_lower=-mean((p + force)[~is_upper]) + 0.0,
        power_in=mean(given), power_lost=mean(losses), power_drag=mean(drag),
        rattle_index=shaken / (shaken + pressed) if shaken + pressed else 0.0, **some)


def order_spectrum(events: EventArray, orders: FloatArray) -> npt.NDArray[np.complex128]:
    """
    Return the contact force at some orders, ``F(k) = 1/T integral f exp(-i k tau) dtau`` [1].

    It is exact: an impact is an impulse, and the force on the gear while it is held is
    integrated. Lines are at the orders j/p of a motion of p drive periods; that at 0 is the mean
    force, gamma. The events are those of `rattle_of`, and the parameters the same in all.
    """
    one, k = _Intervals.of(events), np.asarray(orders, np.float64)
    total = np.zeros(len(k), np.complex128)
    is_hit, model = one.jump != 0.0, events[0]
    for tau, p in zip((one.tau + one.length)[is_hit], one.jump[is_hit], strict=True):
        total += p * np.exp(-1j * tau * k)
    wave = 0.5 * float(model['alpha']) * complex(model['beta'], 1.0)
    for tau, d in zip(one.tau[one.is_held], one.length[one.is_held], strict=True):
        for m, size in ((0.0, complex(model['gamma'])), (1.0, wave), (-1.0, wave.conjugate())):
            total += size * d * np.exp(1j * (m - k) * (tau + 0.5 * d)) * np.sinc(
                (m - k) * d / TWO_PI)
    return total / float(np.sum(one.length))


def impulse_train(times: FloatArray, impulses: FloatArray, rate: float, count: int) -> FloatArray:
    """Sample impulses at times [s] at a rate [Hz], low-passed at half of it; `count` samples."""
    place = times * rate
    first = np.floor(place).astype(np.int64)
    taps = np.arange(-TAPS + 1, TAPS + 1)
    away = first[:, None] + taps - place[:, None]
    filtered = np.sinc(away) * np.cos(0.5 * math.pi * away / TAPS)**2
    samples = np.zeros(count + 2 * TAPS)
    np.add.at(samples, np.clip(first[:, None] + taps + TAPS, 0, len(samples) - 1),
              rate * impulses[:, None] * filtered)
    return samples[TAPS:TAPS + count]


class RunningRattle:
    """The rattle of a stream since it was last asked for, however the stream is cut."""

    def __init__(self, above: float = 0.0) -> None:
        self._above = above
        self._guard = StreamGuard()
        self._pieces: list[EventArray] = []

    def update(self, events: EventArray) -> None:
        """Take the next batch, an array of EVENT; a hole or a reset begins a new stretch."""
        for piece in self._guard.split(events):
            if not piece.follows:
                self._pieces = []
            resets = np.flatnonzero(piece.events['kind'] == EventKind.RESET)
            if len(resets):
                self._pieces = []
            self._pieces.append(piece.events[resets[-1] if len(resets) else 0:].copy())

    def take(self) -> Rattle:
        """Return the rattle up to the last event, from where the next begins."""
        events = np.concatenate(self._pieces) if self._pieces else np.zeros(0, EVENT)
        self._pieces = [events[-1:]] if len(events) else []
        return rattle_of(events, self._above)
