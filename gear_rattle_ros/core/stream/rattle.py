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
import itertools
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from .guard import StreamGuard
from .lyapunov import has_stuck
from .reconstruction import drive_phases
from ..arrays import FloatArray, RecordArray
from ..compiled import kernel
from ..flight.closed_form import elapsed, model_of
from ..flight.elementary import sine_cosine, TWO_PI
from ..gears import Scales
from ..model import EVENT, EventArray, EventKind

STICK, RESET = int(EventKind.STICK), int(EventKind.RESET)
# What is added up; of what has two places the first is for the upper flank.
(DURATION, IMPACTS, IMPULSE, IMPULSE_PEAK, LOSS, LOSS_PEAK, SPEED, SQUARE, SPEED_PEAK, PRESSED,
 GIVEN, DRAG, COUNT, _, CONTACT, _, FORCE, _, SUMS) = range(19)
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
def measure(total: FloatArray, last: RecordArray, events: RecordArray, above: float) -> None:
    """Add what happens from each event to the next; a RESET clears all that was before it."""
    # `last` is the event before, and becomes the last of these. Forces are those on a flank.
    sin_1, cos_1 = sine_cosine(last[0].phase)
    for i in range(len(events)):
        before = events[i - 1] if i else last[0]
        after = events[i]
        sin_0, cos_0 = sin_1, cos_1
        sin_1, cos_1 = sine_cosine(after.phase)
        if after.kind == RESET:
            total[:] = 0.0
            continue
        d = elapsed(np.int64(np.int32(np.uint32(after.cycle) - np.uint32(before.cycle))),
                    before.phase, after.phase)
        alpha, beta, gamma, _ = model_of(before)
        wall = 0 if after.displacement == 0.0 else 1
        total[DURATION] += d
        # Energy of the gear's own motion, which between impacts only load and drag change.
        load = gamma * (after.displacement - before.displacement - alpha * (sin_1 - sin_0))
        own, then = before.velocity_after - alpha * cos_0, after.velocity - alpha * cos_1
        rise = 0.5 * (then * then - own * own)
        drag = load - rise
        if has_stuck(before, after):
            # It follows its flank with the speed -alpha cos tau.
            force = gamma * d + alpha * (cos_1 - cos_0 + beta * (sin_1 - sin_0))
            drag = 0.5 * beta * alpha * alpha * (d + sin_1 * cos_1 - sin_0 * cos_0)
            total[CONTACT + wall] += d
            total[FORCE + wall] += force
            total[PRESSED] += abs(force)
            total[GIVEN] += rise + drag - load
        total[DRAG] += drag
        if after.kind > STICK:
            continue
        speed, slower = abs(after.velocity), abs(after.velocity_after)
        jump, loss = after.velocity - after.velocity_after, 0.5 * (speed * speed - slower * slower)
        total[IMPACTS] += 1.0
        total[FORCE + wall] += jump
        total[GIVEN] += jump * alpha * cos_1
        total[IMPULSE] += abs(jump)
        total[IMPULSE_PEAK] = max(total[IMPULSE_PEAK], abs(jump))
        total[LOSS] += loss
        total[LOSS_PEAK] = max(total[LOSS_PEAK], loss)
        if speed >= above and speed > 0.0:
            total[COUNT + wall] += 1.0
            total[SPEED] += speed
            total[SQUARE] += speed * speed
            total[SPEED_PEAK] = max(total[SPEED_PEAK], speed)
    if len(events):
        last[0] = events[len(events) - 1]


def _report(total: FloatArray) -> Rattle:
    duration = float(total[DURATION])
    if not duration > 0.0:
        return Rattle(0.0)
    one = total.tolist()
    impacts, counted = one[IMPACTS], one[COUNT] + one[COUNT + 1]
    shaken = one[IMPULSE] + one[PRESSED]
    some = {} if not impacts else {
        'impulse_mean': one[IMPULSE] / impacts, 'impulse_peak': one[IMPULSE_PEAK],
        'loss_mean': one[LOSS] / impacts, 'loss_peak': one[LOSS_PEAK]}
    if counted:
        some |= {'speed_rms': math.sqrt(one[SQUARE] / counted),
                 'speed_mean': one[SPEED] / counted, 'speed_peak': one[SPEED_PEAK]}
    return Rattle(
        duration, one[COUNT] / duration, one[COUNT + 1] / duration,
        contact_upper=one[CONTACT] / duration, contact_lower=one[CONTACT + 1] / duration,
        force_upper=one[FORCE] / duration, force_lower=-one[FORCE + 1] / duration + 0.0,
        power_in=one[GIVEN] / duration, power_lost=one[LOSS] / duration,
        power_drag=one[DRAG] / duration,
        rattle_index=one[IMPULSE] / shaken if shaken else 0.0, **some)


def rattle_of(events: EventArray, above: float = 0.0) -> Rattle:
    """
    Measure a stretch of the motion.

    Parameters
    ----------
    events : ndarray of EVENT, shape (n,)
        Records in order, none missing between them. The stretch is from the first, or the last
        RESET, to the last.
    above : float
        Approach speed from which impacts count for rates and speeds [1].

    """
    total = np.zeros(SUMS)
    if len(events):
        events = np.ascontiguousarray(events)
        measure(total, events[:1].copy(), events[1:], above)
    return _report(total)


def order_spectrum(events: EventArray, orders: FloatArray) -> npt.NDArray[np.complex128]:
    """
    Return the contact force at some orders, ``F(k) = 1/T integral f exp(-i k tau) dtau`` [1].

    It is exact: an impact is an impulse, and the force on the gear while it is held is
    integrated. Lines are at the orders j/p of a motion of p drive periods; that at 0 is the mean
    force, gamma. The events are those of `rattle_of`, and the parameters the same in all.
    """
    k, taus = np.asarray(orders, np.float64), drive_phases(events)
    total, model = np.zeros(len(k), np.complex128), events[0]
    wave = 0.5 * float(model['alpha']) * complex(model['beta'], 1.0)
    for n, (before, after) in enumerate(itertools.pairwise(events)):
        tau, d = taus[n], taus[n + 1] - taus[n]
        if has_stuck(before, after):
            for m, size in ((0.0, complex(model['gamma'])), (1.0, wave), (-1.0, wave.conjugate())):
                total += size * d * np.exp(1j * (m - k) * (tau + 0.5 * d)) * np.sinc(
                    (m - k) * d / TWO_PI)
        if after['kind'] <= STICK:
            total += (after['velocity'] - after['velocity_after']) * np.exp(-1j * taus[n + 1] * k)
    return total / float(taus[-1] - taus[0])


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

    def __init__(self) -> None:
        self._guard = StreamGuard()
        self._total = np.zeros(SUMS)
        self._last = np.zeros(1, EVENT)

    def update(self, events: EventArray, above: float = 0.0) -> None:
        """Take the next batch, an array of EVENT; a hole or a reset begins a new stretch."""
        for piece in self._guard.split(events):
            stretch = piece.events
            if not piece.follows:
                self._total[:] = 0.0
                self._last, stretch = stretch[:1].copy(), stretch[1:]
            measure(self._total, self._last, stretch, above)

    def take(self) -> Rattle:
        """Return the rattle up to the last event, from where the next begins."""
        now, self._total = self._total, np.zeros(SUMS)
        return _report(now)
